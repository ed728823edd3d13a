"""Where the start is uncertain: the straight push that makes two fingers flush with their edge, and what it leaves.

A slider that does not stand where it is believed to be meets one finger first, turns until the other touches, and slides along
both meanwhile. What remains is a displacement along the edge. One finger, or fingers with unlike normals, do not align a slider.
"""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import FloatArray, StablepushError
from stablepush.geometry import compose, inverse, transform_points, transport_twist
from stablepush.mechanics import Pusher, simulate_push
from stablepush.objects import PushContact, Slider
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import Push
from stablepush.stability import StabilityOracle
from stablepush.surfaces import LimitSurface

#: Standard deviations of the start that an alignment push is long enough for.
_DEVIATIONS = 3.0
#: A slider that is turned by less (rad) against the plan is flush with the fingers.
_FLUSH = 5e-3
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


def straight_pushes(problem: PlanningProblem, length: float) -> list[Push]:
    """Return the straight pushes (m) at the first contact that are stable, those nearest to the normal first."""
    contact = problem.contacts[0]
    oracle, theta = StabilityOracle(problem.surface, contact), float(contact.frame[2])
    angles = theta + np.concatenate([(a, -a) for a in _DIRECTIONS])
    twists = problem.speed * np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1)
    margins = oracle.margin(twists)
    return [
        Push.from_start(0, twists[k], length / problem.speed, problem.start, float(margins[k]))
        for k in np.flatnonzero(margins > max(0.0, problem.min_margin) + 1e-6)
    ]


def after_first_push(
    problem: PlanningProblem,
    first: Push,
    surface: LimitSurface,
    contact: PushContact,
    center: FloatArray,
    error: FloatArray,
) -> tuple[FloatArray, bool]:
    """Simulate a first push of a slider that stands elsewhere; its final pose (3,) in its planned final pose, and if it is flush.

    ``surface`` and ``contact`` are the true ones, the contact in B, ``center`` (2,) the centre of mass in B, ``error`` (3,) the
    start pose in the planned one. The pusher comes from so far back that it does not meet the slider before.
    """
    offset = np.array((*center, 0.0))
    slider = about(problem.slider, center)
    own = PushContact(contact.points - center, contact.normals, contact.mu)
    if len(own.points) > 2:
        # what slides past so many fingers is not simulated
        return np.asarray(error), False
    pusher = Pusher.of_contact(own, problem.finger_radius)
    docked = pusher.docked(own)
    back = clearance(problem, contact) + 1e-3
    place = compose(compose(compose(first.start, offset), docked), np.array((-back, 0.0, 0.0)))
    motion = [(np.array((problem.speed, 0.0, 0.0)), back / problem.speed)]
    motion.append((transport_twist(first.twist, inverse(compose(offset, docked))), first.duration))
    start = compose(compose(first.start, error), offset)
    try:
        trace = simulate_push(surface, slider, pusher, own.mu, start, place, motion, step=STEP * slider.radius)
    except StablepushError:
        # it stands in the pusher's way
        return np.asarray(error), False
    left = compose(inverse(first.end), compose(trace.poses[-1], inverse(offset)))
    left[2] = math.remainder(left[2], 2 * math.pi)
    return left, abs(left[2]) < _FLUSH


def about(slider: Slider, center: FloatArray) -> Slider:
    """Return a slider with its origin at another centre of mass (2,)."""
    return Slider(transform_points((-center[0], -center[1], 0.0), slider.vertices), slider.mass)
