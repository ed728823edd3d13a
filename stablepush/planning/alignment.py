"""Where the start is uncertain: the straight pushes that make two fingers flush with their edge, and what they leave.

A slider that does not stand where it is believed to be meets one finger first, turns until the other touches, and slides along
both meanwhile. What remains is a displacement along the edge. One finger, or fingers with unlike normals, do not align a slider.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.geometry import compose, inverse, transport_twist, wrap_angle
from stablepush.mechanics import Pusher, final_poses
from stablepush.objects import PushContact
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import Push
from stablepush.stability import StabilityOracle
from stablepush.surfaces import LimitSurface

#: Standard deviations of the start that an alignment push is long enough for.
_DEVIATIONS = 3.0
#: A slider that is turned by less (rad) against the plan is flush with the fingers.
_FLUSH = 5e-3
#: A slider that is farther (m) from where it is planned along the normal is not flush: a finger has not reached it, or went past.
_TOUCHING = 1e-3
#: Directions (rad, each way of the normal) that an alignment push may have, the least first.
_DIRECTIONS = np.radians((0.0, 2.5, 5.0, 7.5, 10.0, 15.0, 20.0))
#: Steps of simulations, over the radius of the slider: final poses are right to 1 mm.
STEP = 1 / 25


def aligns(contact: PushContact) -> bool:
    """Return whether a contact turns a slider square: two fingers with one normal."""
    return len(contact.points) == 2 and contact.has_one_normal


def clearance(problem: PlanningProblem, contact: PushContact) -> float:
    """Return how far (m) the start may be off towards or away from the fingers of a contact."""
    position, heading = problem.uncertainty.start
    # turning moves the edge at a finger by its distance from the origin along the edge, and one finger against the other
    along = contact.points @ np.array((-contact.normals[0][1], contact.normals[0][0]))
    return _DEVIATIONS * (position + heading * max(float(np.abs(along).max()), float(np.ptp(along))))


def straight_pushes(problem: PlanningProblem, number: int, length: float) -> list[Push]:
    """Return the straight pushes (m) from the start at a contact that are stable, those nearest to the normal first."""
    contact = problem.contacts[number]
    oracle, theta = StabilityOracle(problem.surface, contact), float(contact.frame[2])
    angles = theta + np.concatenate([(a, -a) for a in _DIRECTIONS])
    twists = problem.speed * np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1)
    margins = oracle.margin(twists)
    return [
        Push.from_start(number, twists[k], length / problem.speed, problem.start, float(margins[k]))
        for k in np.flatnonzero(margins > max(0.0, problem.min_margin) + 1e-6)
    ]


def after_docking(
    problem: PlanningProblem,
    first: Push,
    surfaces: Sequence[LimitSurface],
    which: np.ndarray,
    mu: FloatArray,
    aside: FloatArray,
    centers_of_mass: FloatArray,
    errors: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Simulate the first push after the pusher docks at sliders that stand elsewhere.

    The arguments are those of :func:`stablepush.mechanics.final_poses`; ``errors`` (n, 3) are start poses in the planned one.
    Returns final poses (n, 3) in the planned final pose, and whether (n,) the slider is then flush with the fingers. The pusher
    starts from far enough back that it does not touch a slider at the start.
    """
    contact = problem.contacts[first.contact]
    if len(contact.points) > 2:
        # what slides past so many fingers is not simulated
        return errors, np.zeros(len(errors), dtype=bool)
    pusher = Pusher.of_contact(contact, problem.finger_radius)
    docked = pusher.docked(contact)
    back = clearance(problem, contact) + 1e-3
    place = compose(compose(first.start, docked), np.array((-back, 0.0, 0.0)))
    motion = [(np.array((problem.speed, 0.0, 0.0)), back / problem.speed)]
    motion.append((transport_twist(first.twist, inverse(docked)), first.duration))
    ends = final_poses(
        surfaces,
        which,
        problem.slider,
        pusher,
        mu,
        compose(first.start, errors),
        place,
        motion,
        aside=aside,
        centers_of_mass=centers_of_mass,
        step=STEP * problem.slider.radius,
    )
    left = compose(inverse(first.end), ends)
    left[:, 2] = wrap_angle(left[:, 2])
    gap = left[:, :2] @ contact.normals.mean(axis=0)
    # one that stands in the pusher's way is NaN
    flush = (np.abs(left[:, 2]) < _FLUSH) & (np.abs(gap) < _TOUCHING)
    return np.where(np.isnan(left), errors, left), flush
