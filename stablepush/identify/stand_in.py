"""Support points that stand for a limit surface of another kind, where effects act on points under the slider."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray, first_least
from stablepush.geometry import angle_between, normalize_twist
from stablepush.identify.baselines import fit_pressure_grid
from stablepush.identify.pressure import predict_loads
from stablepush.objects import Slider, SupportDistribution
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Loads of a few points may be off by so much (deg) on average.
_FEW_OFF = 0.5
#: Points whose friction is as like what is missing, to this share, are taken in their order.
_ALIKE = 1e-9
#: Motions whose loads stand for a surface.
_MOTIONS = 200


def support_for(surface: LimitSurface, slider: Slider, load: float) -> IdealLimitSurface:
    """Return the limit surface of support points that stands for another one, in N.

    Its own points, else those of the slider with the load that explains most of the surface, else pressures on a grid under the
    outline that come as near to the surface as pressures can. ``load`` is the force (N) that the unit of the surface is.
    """
    if surface.point_loads is not None:
        points, carried = surface.point_loads
        return IdealLimitSurface(SupportDistribution(points, carried), float(carried.sum()), surface.characteristic_length)
    loads, twists = sample_loads(surface, load)
    if slider.support is not None:
        one = IdealLimitSurface(slider.support, 1.0, surface.characteristic_length)
        shape = one.wrench(twists) / (1, 1, surface.characteristic_length)
        scaled = loads / (1, 1, surface.characteristic_length)
        total = float((shape * scaled).sum() / (shape * shape).sum())
        return IdealLimitSurface(slider.support, total, surface.characteristic_length)
    return fit_pressure_grid(loads, twists, slider).surface


def on_few_points(surface: IdealLimitSurface) -> IdealLimitSurface:
    """Return the friction of a few support points that is nearly that of many: engines take a contact for each.

    Points are added one by one, each the one whose friction is most like what is missing, and their loads fitted anew, none
    negative, until loads of random motions are off by no more than 0.5 deg on average.
    """
    from scipy.optimize import nnls

    points, rho = surface.support.points, surface.characteristic_length
    loads, twists = sample_loads(surface, 1.0)
    wanted = loads / (1.0, 1.0, rho)
    unit = predict_loads(points[:, None] / rho, np.ones((len(points), 1)), normalize_twist(twists, rho))
    design, missing, chosen = unit.transpose(1, 2, 0).reshape(-1, len(points)), wanted.ravel(), np.zeros(0, dtype=np.intp)
    carried = np.zeros(0)
    for _ in range(len(points)):
        likeness = design.T @ missing / np.linalg.norm(design, axis=0)
        likeness[chosen] = -np.inf
        chosen = np.append(chosen, first_least(-likeness, _ALIKE * float(likeness.max())))
        carried, _ = nnls(design[:, chosen], wanted.ravel())
        chosen, carried = chosen[carried > 0], carried[carried > 0]
        missing = wanted.ravel() - design[:, chosen] @ carried
        if np.degrees(angle_between(wanted - missing.reshape(-1, 3), wanted).mean()) < _FEW_OFF:
            break
    return IdealLimitSurface(SupportDistribution(points[chosen], carried), float(carried.sum()), rho)


def sample_loads(surface: LimitSurface, load: float) -> tuple[FloatArray, FloatArray]:
    """Return loads (n, 3) in N and twists of motions in all directions."""
    twists = np.random.default_rng(0).normal(size=(_MOTIONS, 3)) / (1.0, 1.0, surface.characteristic_length)
    return surface.wrench(twists) * load, twists
