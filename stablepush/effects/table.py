"""The friction of a table with effects: what the simulated rig is made of, and what plans reckon with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely

from stablepush.core import LEAST_POSITIVE, EffectError, FloatArray, InputError
from stablepush.effects.catalogue import REFERENCE_SPEED, Effect, principal
from stablepush.geometry import rotate_vectors, unit
from stablepush.mechanics import TableFriction
from stablepush.objects import Slider, SupportDistribution
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Effects that act on points under the slider.
ON_POINTS = (
    *("anisotropy-world", "anisotropy-object", "speed-dependence", "spatial-variation"),
    *("pressure-shift", "pressure-spread"),
)
#: Slowest point (m/s) whose friction by speed is told apart.
CREEP = 1e-5
#: Headings and motions at which friction must hold the slider, and what lies between them.
_HEADINGS, _MOTIONS, _MISSED = 36, 1500, 1.02
#: Models of the degrees that a support may follow instead of the nominal surface.
_MODELS = {2: "quadratic", 4: "poly4-cvx", 6: "poly6-cvx"}


def _slope_force(slider: Slider, effects: Mapping[str, Effect], gravity: float) -> FloatArray:
    """The downhill force (2,) in N in W on a slider on a tilted table: ``m g slope``."""
    if "tilt" not in effects:
        return np.zeros(2)
    return float(slider.mass or 0.0) * gravity * np.array(effects["tilt"].vector("slope"))


def resting_share(friction: TableFriction, place: FloatArray, rho: float) -> float:
    """Return what the external force pulls with over what friction holds: a slider that is not pushed rests below 1.

    The greatest ``pull·v / (F(V)·V)`` of all motions ``V`` at a place (2,) in W, at all headings; ``rho`` (m) scales turns. Of
    friction that depends on speed, the less of that at a creep and at the reference speed counts.
    """
    pull = np.array(friction.external_force)
    if not pull.any():
        return 0.0
    alone = replace(friction, external_force=(0.0, 0.0), inertia=(0.0, 0.0))
    headings = np.linspace(0.0, 2 * np.pi, _HEADINGS, endpoint=False)
    straight = np.column_stack((np.cos(headings), np.sin(headings), np.zeros(len(headings))))
    turning = unit(np.random.default_rng(0).normal(size=(_MOTIONS, 3)))
    motions = np.concatenate((straight, turning)) / (1.0, 1.0, rho)
    worst = 0.0
    for speed in (friction.reference, CREEP)[: 2 if friction.slope else 1]:
        for heading in headings:
            poses = np.tile((*place, heading), (len(motions), 1))
            power = (alone.wrench(speed * motions, poses) * motions).sum(axis=1)
            worst = max(worst, float((motions[:, :2] @ rotate_vectors(-heading, pull) / power).max()))
    return _MISSED * worst


def table_friction(
    slider: Slider,
    surface: LimitSurface,
    effects: Mapping[str, Effect],
    load: float,
    gravity: float,
    points: IdealLimitSurface | None = None,
) -> TableFriction:
    """Return the friction of a table with all effects of the support and of inertia.

    Parameters
    ----------
    slider : Slider
    surface : LimitSurface
        Nominal friction. Effects that act on points under the slider change the points of an ideal surface. To a polynomial one
        they add what they change of the friction of points that stand for it.
    effects : mapping of str to Effect
        By id; those of contact and sensors are left out.
    load : float
        Newtons in the unit of the surface's forces.
    gravity : float
        In m/s².
    points : IdealLimitSurface, optional
        The points that stand for the surface, in N (:func:`stablepush.identify.support_for`); worked out where they are needed.

    Raises
    ------
    EffectError
        For effects that cannot be on this rig.
    """
    # fits load solvers: not before they are needed
    from stablepush.identify import support_for

    shape, load = (surface, load) if "model-capacity" not in effects else _other_shape(slider, surface, effects, load, points)
    stand_in: IdealLimitSurface | None = None
    perturbed: IdealLimitSurface | None = None
    if shape.point_loads is not None:
        shape = _moved_pressure(slider, support_for(shape, slider, load), effects)
    elif any(id in effects for id in ON_POINTS):
        stand_in = points if points is not None and shape is surface else support_for(shape, slider, load)
        perturbed = _moved_pressure(slider, stand_in, effects)
    tables = [np.eye(2), np.eye(2)]
    for i, id in enumerate(("anisotropy-object", "anisotropy-world")):
        if id in effects:
            tables[i] = principal(effects[id].number("ratio") or 1.0, effects[id].number("direction") or 0.0)
    slope = effects["speed-dependence"].number("slope") if "speed-dependence" in effects else 0.0
    gradient = effects["spatial-variation"].vector("gradient") if "spatial-variation" in effects else (0.0, 0.0)
    mass = (effects["inertia"].number("mass") or 0.0) if "inertia" in effects else 0.0
    return TableFriction(
        shape,
        load,
        stand_in,
        perturbed,
        tables[0],
        tables[1],
        gradient or (0.0, 0.0),
        slope or 0.0,
        REFERENCE_SPEED,
        _slope_force(slider, effects, gravity),
        (mass, mass * slider.radius_of_gyration**2),
    )


def _other_shape(
    slider: Slider, surface: LimitSurface, effects: Mapping[str, Effect], load: float, points: IdealLimitSurface | None
) -> tuple[LimitSurface, float]:
    """The surface of another kind that comes nearest to the nominal one, a few support points or a polynomial, and the newtons
    in the unit of its forces."""
    from stablepush.identify import sample_loads, support_for

    effect = effects["model-capacity"]
    facets, degree = effect.number("facets"), effect.number("degree")
    if (facets is None) == (degree is None):
        raise EffectError("effect model-capacity", "expected either facets or degree")
    if degree is not None:
        if degree not in _MODELS:
            raise EffectError("effect model-capacity: degree", f"expected one of {', '.join(map(str, _MODELS))}", f"{degree:g}")
        from stablepush.identify import fit_limit_surface

        loads, twists = sample_loads(surface, load)
        rho = surface.characteristic_length
        fitted = fit_limit_surface(loads, twists, model=_MODELS[int(degree)], characteristic_length=rho).surface
        return fitted, float(fitted.provenance["force_scale_N"]) if fitted.force_unit == "mu*N" else 1.0
    ideal = support_for(surface, slider, load) if points is None else points
    # as many even feet on a circle, about the same centre, as far from it on average
    count = int(facets or 0)
    places, weights = ideal.support.points, ideal.support.weights
    angles = 2 * np.pi * (np.arange(count) + 0.25) / count
    radius = math.sqrt(float(weights @ ((places - ideal.support.center) ** 2).sum(axis=1) / weights.sum()))
    feet = ideal.support.center + radius * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    feet_on = SupportDistribution(feet, np.ones(count))
    return IdealLimitSurface(feet_on, ideal.friction_load, surface.characteristic_length), load


def _moved_pressure(slider: Slider, surface: IdealLimitSurface, effects: Mapping[str, Effect]) -> IdealLimitSurface:
    """The support with its pressure moved or spread."""
    support = surface.support
    points, center = support.points, support.center
    if "pressure-spread" in effects:
        points = center + (effects["pressure-spread"].number("scale") or 1.0) * (points - center)
    if "pressure-shift" in effects:
        offset = np.array(effects["pressure-shift"].vector("offset"))
        points = points + offset
        hull = shapely.Polygon(slider.vertices).convex_hull
        if not hull.buffer(-LEAST_POSITIVE).contains(shapely.Point(center + offset)):
            raise EffectError("effect pressure-shift: offset", "expected a centre of pressure that stays under the slider")
    if points is support.points:
        return surface
    try:
        moved = SupportDistribution(points, support.weights)
        return IdealLimitSurface(moved, surface.friction_load, surface.characteristic_length)
    except InputError as error:
        # a shift that leaves the slider is refused above
        raise EffectError("effect pressure-spread: scale", str(error)) from None
