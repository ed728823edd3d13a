"""Shorten a path of one contact: quickest chain of connections between poses of the path."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import Deadline, FloatArray
from stablepush.geometry import compose, exp, inverse, log, wrap_angle
from stablepush.planning import PlanningProblem, SweptBody
from stablepush.planning.kernels import World
from stablepush_planners._connection import Connections
from stablepush_planners._link import cheapest_link
from stablepush_planners.stable_set import StableSet

#: A push: body twist at the speed limit, and its duration in s.
TimedTwist = tuple[FloatArray, float]
#: Travel (m) below this counts as zero; pushes whose ends differ by less are one.
LEAST_TRAVEL = 1e-10


def shorten(  # noqa: PLR0913
    problem: PlanningProblem,
    connections: Connections,
    world: World,
    swept: SweptBody,
    stable: StableSet,
    start: FloatArray,
    pushes: list[TimedTwist],
    pieces: int,
    deadline: Deadline,
) -> list[TimedTwist]:
    """Return a path between the same poses that costs no more.

    Dynamic programming over about ``pieces`` poses spread along the path and the ends of its pushes. Two of them are joined by
    one push of constant twist where that is stable, or by a Dubins word of the contact's reference point. The path itself
    always stays one of the candidates, also when the deadline cuts the work short.
    """
    poses, legs = _divided(start, pushes, pieces)
    count = len(poses)
    i, j = np.triu_indices(count, 2)
    offsets = compose(inverse(poses[i]), poses[j])
    offsets[:, 2] = wrap_angle(offsets[:, 2])
    direct = log(offsets)
    times = problem.push_speed(direct) / problem.speed
    prices = stable.costs(direct)
    moving = np.abs(direct).max(axis=1) > 1e-9
    good = np.zeros(len(direct), dtype=bool)
    if deadline.left() >= 0:
        headings = np.column_stack((poses[i, 2], direct[:, 2]))
        good[moving] = stable.accepts(direct[moving], headings[moving])
    table, joins = np.full((count, count), np.inf), np.zeros((count, count, 4))
    table[i[good], j[good]] = prices[good]
    joins[i[good], j[good]] = np.column_stack((direct[good] / times[good, None], times[good]))
    spent = stable.costs(np.array([twist * duration for twist, duration in legs]))
    connects = bool(connections.radii[stable.contact, 0] > 0.0)
    lengths, work, link = np.empty((6, 3)), np.empty((3, 4)), np.empty((3, 4))
    cosines = np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
    best = np.full(count, math.inf)
    best[0] = 0.0
    chain: list[tuple[int, list[TimedTwist]]] = [(0, [])] * count
    for b in range(1, count):
        best[b], chain[b] = best[b - 1] + float(spent[b - 1]), (b - 1, [legs[b - 1]])
        if deadline.left() < 0:
            continue
        before = cheapest_link(
            b, best, table, joins, world, swept.body, connections, stable.contact, connects, poses, cosines, lengths, work, link
        )
        if before >= 0:
            parts = [(row[:3].copy(), float(row[3])) for row in link if row[3] * problem.speed > LEAST_TRAVEL]
            chain[b] = before, parts
    result: list[TimedTwist] = []
    b = count - 1
    while b > 0:
        b, part = chain[b]
        result = part + result
    return result


def _divided(start: FloatArray, pushes: list[TimedTwist], pieces: int) -> tuple[FloatArray, list[TimedTwist]]:
    """Poses (n, 3) along a path and the parts of pushes between them."""
    total = sum(d for _, d in pushes)
    poses, legs = [start], []
    for twist, duration in pushes:
        # halves are rounded up, also those that are less by rounding
        parts = max(1, math.floor(pieces * duration / total + 0.5 + 1e-9))
        first = poses[-1]
        poses += [compose(first, exp(twist * (duration * (k + 1) / parts))) for k in range(parts)]
        legs += [(twist, duration / parts)] * parts
    return np.array(poses), legs


def merged(pushes: list[TimedTwist], radius: float) -> list[TimedTwist]:
    """Return a path with equal twists in a row made one push; ``radius`` (m) of the slider says what a turn moves."""
    result: list[TimedTwist] = []
    for twist, duration in pushes:
        if result:
            vx, vy, omega = np.abs(result[-1][0] - twist) * duration
            if max(vx, vy, omega * radius) <= LEAST_TRAVEL:
                result[-1] = (result[-1][0], result[-1][1] + duration)
                continue
        result.append((twist, duration))
    return result
