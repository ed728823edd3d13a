"""Support points that stand for a limit surface of another kind, where effects act on points under the slider."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray
from stablepush.identify.baselines import fit_pressure_grid
from stablepush.objects import Slider, SupportDistribution
from stablepush.surfaces import IdealLimitSurface, LimitSurface

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


def sample_loads(surface: LimitSurface, load: float) -> tuple[FloatArray, FloatArray]:
    """Return loads (n, 3) in N and twists of motions in all directions."""
    twists = np.random.default_rng(0).normal(size=(_MOTIONS, 3)) / (1.0, 1.0, surface.characteristic_length)
    return surface.wrench(twists) * load, twists
