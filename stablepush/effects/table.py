"""The friction of a table with effects: what the simulated rig is made of, and what plans reckon with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stablepush.core import EffectError, FloatArray, InputError
from stablepush.effects.catalogue import CATALOGUE
from stablepush.effects.effect import Effect
from stablepush.effects.kind import REFERENCE_SPEED, in_order
from stablepush.geometry import rotate_vectors, unit
from stablepush.mechanics import TableFriction
from stablepush.objects import Slider, SupportDistribution
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Slowest point (m/s) whose friction by speed is told apart.
CREEP = 1e-5
#: Headings and motions at which friction must hold the slider, and what lies between them.
_HEADINGS, _MOTIONS, _MISSED = 36, 1500, 1.02

#: Numbers of parameters, by effect and name.
Numbers = Mapping[str, Mapping[str, Sequence[float]]]


def with_effects(
    surface: IdealLimitSurface, acting: Numbers, weight: float, gyration: float, center: FloatArray
) -> tuple[IdealLimitSurface, dict[str, Any]]:
    """Return the friction of support points with effects, and the fields of :class:`TableFriction` that these change.

    ``acting``: numbers of their parameters; ``weight`` (N) and radius of ``gyration`` (m) of the slider; ``center`` (2,) of the
    nominal pressure in B. The rig, plans and the diagnosis all have it from here.
    """
    points = surface.support.points
    fields: dict[str, Any] = {}
    for kind in in_order(CATALOGUE[id] for id in acting):
        points = kind.pressed(points, center, acting[kind.id])
        fields |= kind.table_fields(acting[kind.id], weight, gyration)
    if points is surface.support.points:
        return surface, fields
    support = SupportDistribution(points, surface.support.weights)
    return IdealLimitSurface(support, surface.friction_load, surface.characteristic_length), fields


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

    acting, shape = {id: effect.numbers for id, effect in effects.items()}, surface
    for id, numbers in acting.items():
        shape, load = CATALOGUE[id].other_shape(slider, shape, numbers, load, points)
    weight = float(slider.mass or 0.0) * gravity

    def changed(ideal: IdealLimitSurface) -> tuple[IdealLimitSurface, dict[str, Any]]:
        for id, numbers in acting.items():
            CATALOGUE[id].require_on(slider, ideal.support.center, numbers)
        try:
            return with_effects(ideal, acting, weight, slider.radius_of_gyration, ideal.support.center)
        except InputError as error:
            # a shift that leaves the slider is refused above
            raise EffectError("effect pressure-spread: scale", str(error)) from None

    if shape.point_loads is not None:
        shape, fields = changed(support_for(shape, slider, load))
        return TableFriction(shape, load, reference=REFERENCE_SPEED, **fields)
    if not any(CATALOGUE[id].on_points for id in effects):
        fields = {}
        for id, numbers in acting.items():
            fields |= CATALOGUE[id].table_fields(numbers, weight, slider.radius_of_gyration)
        return TableFriction(shape, load, reference=REFERENCE_SPEED, **fields)
    stand_in = points if points is not None and shape is surface else support_for(shape, slider, load)
    perturbed, fields = changed(stand_in)
    return TableFriction(shape, load, stand_in, perturbed, reference=REFERENCE_SPEED, **fields)
