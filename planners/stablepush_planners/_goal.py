"""When a pose is at the goal, and how long it takes to get there at least."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray, compiled, inner
from stablepush_planners._heap import heap_pop, heap_push


class Goal(NamedTuple):
    """Goal pose, poses (n, 3) within its tolerance that connections lead to, tolerance (m, rad), outline (k, 2) of the slider,
    speed limit (m/s); least times (s) by place, and the place's grid (:class:`DistanceField`); times without obstacles by
    contact, heading and cells from the goal's cell ``at``."""

    pose: FloatArray
    ends: FloatArray
    tolerance: FloatArray
    outline: FloatArray
    speed: float
    field: FloatArray
    low: FloatArray
    cell: float
    table: FloatArray
    at: np.ndarray


@compiled
def at_goal(goal, x, y, theta):  # type: ignore[no-untyped-def]
    """Whether a pose is within the tolerance."""
    dx, dy = x - goal.pose[0], y - goal.pose[1]
    turn = (theta - goal.pose[2] + math.pi) % (2 * math.pi) - math.pi
    slack = 1e-7
    return math.sqrt(dx * dx + dy * dy) <= goal.tolerance[0] - slack and abs(turn) <= goal.tolerance[1] - slack


@compiled
def least_time(goal, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """Time (s) that every path to the goal takes: no point of the outline is faster than the limit, nor goes through walls."""
    gc, gs = math.cos(goal.pose[2]), math.sin(goal.pose[2])
    most = 0.0
    for v in range(goal.outline.shape[0]):
        px, py = goal.outline[v, 0], goal.outline[v, 1]
        dx = x + cos * px - sin * py - goal.pose[0] - gc * px + gs * py
        dy = y + sin * px + cos * py - goal.pose[1] - gs * px - gc * py
        slack = goal.tolerance[0] + goal.tolerance[1] * math.sqrt(px * px + py * py)
        most = max(most, math.sqrt(dx * dx + dy * dy) - slack)
    i, j = (
        math.floor((x - goal.low[0]) / goal.cell),
        math.floor((y - goal.low[1]) / goal.cell),
    )
    if 0 <= i < goal.field.shape[0] and 0 <= j < goal.field.shape[1]:
        return max(most / goal.speed, goal.field[i, j])
    return most / goal.speed


@inner
def guessed_time(goal, contact, heading, i, j, least):  # type: ignore[no-untyped-def]
    """Time (s) to the goal that the edges take without obstacles, near the goal, and at least ``least``."""
    di, dj = i - goal.at[0], j - goal.at[1]
    reach = (goal.table.shape[2] - 1) // 2
    if -reach <= di <= reach and -reach <= dj <= reach:
        known = goal.table[contact, heading, di + reach, dj + reach]
        if known < math.inf:
            return max(least, known)
    return least


@compiled
def unobstructed_times(edge_first, steps, durations, headings, contacts, switch_cost, ends, size, table):  # type: ignore[no-untyped-def]
    """Fill ``table`` (contacts, headings, size, size) with least times (s) to ``ends`` without obstacles.

    ``ends`` (n, 3): headings, and cells from the table's middle. Dijkstra from them along edges turned round.
    """
    table[:] = math.inf
    middle = (size - 1) // 2
    # edges by contact and the heading in which they end
    count = np.zeros(contacts * headings + 1, dtype=np.int64)
    for a in range(contacts):
        for k in range(headings):
            for e in range(edge_first[a * headings + k], edge_first[a * headings + k + 1]):
                count[a * headings + (k + steps[e, 2]) % headings + 1] += 1
    first = np.cumsum(count)
    listed, origin = np.empty(len(durations), dtype=np.int64), np.empty(len(durations), dtype=np.int64)
    fill = first.copy()
    for a in range(contacts):
        for k in range(headings):
            for e in range(edge_first[a * headings + k], edge_first[a * headings + k + 1]):
                to = a * headings + (k + steps[e, 2]) % headings
                listed[fill[to]], origin[fill[to]] = e, k
                fill[to] += 1
    capacity = 4 * contacts * headings * size * size + 64
    value, code = np.empty(capacity), np.empty(capacity, dtype=np.int64)
    n = 0
    for a in range(contacts):
        for m in range(len(ends)):
            k, i, j = ends[m, 0], middle + ends[m, 1], middle + ends[m, 2]
            table[a, k, i, j] = 0.0
            heap_push(value, code, n, 0.0, ((a * headings + k) * size + i) * size + j)
            n += 1
    # the first contact there is the cheapest to change from: the others need not ask again
    changed = np.zeros((headings, size, size), dtype=np.bool_)
    while n > 0:
        cost, at = value[0], heap_pop(value, code, n)
        n -= 1
        j, i = at % size, (at // size) % size
        k, a = (at // (size * size)) % headings, at // (size * size * headings)
        if cost > table[a, k, i, j]:
            continue
        number = first[a * headings + k + 1] - first[a * headings + k]
        changes = 0 if changed[k, i, j] else contacts
        changed[k, i, j] = True
        for q in range(number + changes):
            if q < number:
                e = listed[first[a * headings + k] + q]
                b, h, u, v = a, origin[first[a * headings + k] + q], i - steps[e, 0], j - steps[e, 1]
                total = cost + durations[e]
            else:
                b, h, u, v = q - number, k, i, j
                total = cost + switch_cost
            if 0 <= u < size and 0 <= v < size and total < table[b, h, u, v] - 1e-12 and n < capacity:
                table[b, h, u, v] = total
                heap_push(value, code, n, total, ((b * headings + h) * size + u) * size + v)
                n += 1
