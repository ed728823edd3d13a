"""A lattice of poses that closes: every edge is one stable push that leads from a lattice pose exactly to another.

Lattice poses have positions on a square grid and headings that are multiples of a full turn over their number, a multiple of
four: a quarter turn maps the lattice onto itself, so the edges of a quarter of the headings give the rest, unless effects make
loads depend on the heading. Between two lattice poses there is one push of constant body twist, ``log(a⁻¹ b)``; it is an edge if
it is stable. So tightest turns, gentler ones about any centre within the region, and translations in all stable directions come
from one rule; of these, edges that others make up at nearly the same cost are left out.

Where the start is uncertain every docking ends with a straight push that aligns the slider: a change of contact then leads to
the end of it, a lattice pose as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray, compiled
from stablepush.geometry import log, rotate_vectors, wrap_angle
from stablepush.planning import PlanningProblem, Push
from stablepush_planners.stable_set import StableSet

#: Edges reach at most this many cells each way, and turn by at most this angle (rad).
_REACH, _LARGEST_TURN = 9, math.pi / 2
#: An edge is left out if others lead to its end for at most this much more.
_SPARE = 0.03
#: An alignment push may be longer than needed by so many cells, and its direction differ by so much (rad).
_LONGER, _DIRECTION = 4, math.radians(12.0)
#: The time in which a push at the speed limit crosses a cell has two to so many ticks.
_TICKS = 24


class Alignments(NamedTuple):
    """The straight push after a change of contact, by contact and heading, as edges have it.

    Steps (n, 2) in cells, body twists (n, 3), durations and costs (n,) in s. A duration of 0: no push is needed; infinite: there
    is none, so the contact cannot be docked at in that heading.
    """

    steps: np.ndarray
    twists: FloatArray
    durations: FloatArray
    costs: FloatArray


class Lattice(NamedTuple):
    """The lattice and the edges of all contacts.

    Attributes
    ----------
    origin : array, shape (3,)
        Pose in W of the lattice pose (0, 0, 0).
    cell : float
        Width of a cell in m.
    headings : int
    cos, sin : array, shape (headings,)
        Of the body angles in W.
    first : array of int, shape (contacts * headings + 1,)
        The edges from a contact and heading are rows ``first[k]`` to ``first[k + 1]``, ``k = contact * headings + heading``.
    steps : array of int, shape (n, 3)
        Cells along the lattice's x and y axes, and headings.
    twists : array, shape (n, 3)
        Body twists (m/s, rad/s) at the speed limit.
    durations, costs : array, shape (n,)
        In s. Costs are whole multiples of ``tick``.
    tick : float
        Unit (s) of all costs of a search, a power of two: their sums are exact, so paths that cost the same are found to.
    alignments : Alignments
    """

    origin: FloatArray
    cell: float
    headings: int
    cos: FloatArray
    sin: FloatArray
    first: np.ndarray
    steps: np.ndarray
    twists: FloatArray
    durations: FloatArray
    costs: FloatArray
    tick: float
    alignments: Alignments


def make_lattice(
    problem: PlanningProblem,
    stable: Mapping[int, StableSet],
    headings: int,
    cell: float,
    aligning: Mapping[int, Push | None] | None = None,
) -> Lattice:
    """Return the lattice of ``headings`` and ``cell`` (m) whose origin is the start; contacts not in ``stable`` have no edges.

    ``aligning`` has the contacts that are to align the slider when the pusher docks there, and a push that does, if any.
    """
    first, count, found = [0], 0, []
    for contact in range(len(problem.contacts)):
        if contact in stable:
            begins, *edges = _edges(problem, stable[contact], headings, cell)
            first += (count + begins[1:]).tolist()
            count += int(begins[-1])
            found.append(edges)
        else:
            first += [count] * headings
    angles: FloatArray = float(problem.start[2]) + 2 * np.pi / headings * np.arange(headings, dtype=np.float64)
    steps, twists, durations, costs = (np.concatenate(column) for column in zip(*found, strict=True))
    tick = 2.0 ** (round(math.log2(cell / problem.speed)) - _TICKS)
    return Lattice(
        origin=np.array(problem.start),
        cell=cell,
        headings=headings,
        cos=np.cos(angles),
        sin=np.sin(angles),
        first=np.array(first, dtype=np.int64),
        steps=np.ascontiguousarray(steps, dtype=np.int64),
        twists=np.ascontiguousarray(twists),
        durations=np.ascontiguousarray(durations),
        costs=np.ascontiguousarray(np.round(costs / tick) * tick),
        tick=tick,
        alignments=_alignments(problem, stable, angles, cell, tick, aligning or {}),
    )


def _alignments(
    problem: PlanningProblem,
    stable: Mapping[int, StableSet],
    angles: FloatArray,
    cell: float,
    tick: float,
    aligning: Mapping[int, Push | None],
) -> Alignments:
    """For each contact and body angle in W the shortest straight push between lattice poses that is long enough to align.

    Its direction is nearly that of the push that is known to do it; of those as long the nearest to it.
    """
    rows = len(problem.contacts) * len(angles)
    found = Alignments(np.zeros((rows, 2), dtype=np.int64), np.zeros((rows, 3)), np.zeros(rows), np.zeros(rows))
    for contact, push in aligning.items():
        block = slice(contact * len(angles), (contact + 1) * len(angles))
        found.durations[block] = math.inf
        if push is None or contact not in stable:
            continue
        most = math.ceil(push.length / cell) + _LONGER
        i, j = (a.ravel() for a in np.meshgrid(*(np.arange(-most, most + 1),) * 2, indexing="ij"))
        squares = i * i + j * j
        i, j, squares = (a[squares * cell**2 >= push.length**2 * (1 - 1e-9)] for a in (i, j, squares))
        toward = math.atan2(push.twist[1], push.twist[0])
        for k, angle in enumerate(angles - float(problem.start[2])):
            off = np.abs(wrap_angle(np.arctan2(j, i) - angle - toward))
            order = [n for n in np.lexsort((np.round(off, 9), squares)) if off[n] <= _DIRECTION]
            steps = np.column_stack((i[order], j[order]))
            twists = np.column_stack((rotate_vectors(-angle, steps * cell), np.zeros(len(steps))))
            good = np.flatnonzero(stable[contact].accepts(twists))
            if not len(good):
                continue
            row, twist = contact * len(angles) + k, twists[good[0]]
            found.steps[row], found.durations[row] = steps[good[0]], float(problem.push_speed(twist)) / problem.speed
            found.twists[row] = twist / found.durations[row]
            found.costs[row] = round(float(stable[contact].costs(twist[None])[0]) / tick) * tick
    return found


def _edges(problem: PlanningProblem, stable: StableSet, headings: int, cell: float) -> tuple[np.ndarray, ...]:
    """Edges of one contact: where those of each heading begin, steps, twists, durations and costs."""
    most = max(1, int(_LARGEST_TURN / (2 * math.pi / headings)))
    i, j, m = (a.ravel() for a in np.meshgrid(*(np.arange(-_REACH, _REACH + 1),) * 2, np.arange(-most, most + 1), indexing="ij"))
    steps = np.stack((i, j, m), axis=-1)
    steps = steps[(i != 0) | (j != 0)]
    # a quarter turn maps the edges onto themselves, unless loads depend on the heading
    classes = headings // 4 if stable.loads is None else headings
    turn = 2 * math.pi / headings
    twists = []
    for k in range(classes):
        ends = np.column_stack((rotate_vectors(-k * turn, steps[:, :2] * cell), steps[:, 2] * turn))
        twists.append(log(ends))
    flat = np.concatenate(twists)
    # the time at the speed limit: what the fastest point of the outline does in a unit of time, over the limit
    durations = problem.push_speed(flat) / problem.speed
    begins = float(problem.start[2]) + turn * np.repeat(np.arange(classes), len(steps))
    candidates = np.flatnonzero(stable.accepts(flat, np.column_stack((begins, flat[:, 2]))))
    costs = np.full(len(flat), np.inf)
    costs[candidates] = stable.costs(flat[candidates])
    order = candidates[np.argsort(costs[candidates], kind="stable")]
    from_heading = order // len(steps)
    kept = _spanning(steps[order % len(steps)], from_heading, costs[order], headings, classes, _REACH, most, 1 + _SPARE)
    chosen, at = order[kept], from_heading[kept]
    rows, first = [], [0]
    quarter = np.array((((1, 0), (0, 1)), ((0, -1), (1, 0)), ((-1, 0), (0, -1)), ((0, 1), (-1, 0))))
    for k in range(headings):
        mine = chosen[at == k % classes]
        turned = steps[mine % len(steps)].copy()
        turned[:, :2] = turned[:, :2] @ quarter[k // classes].T
        rows.append((turned, flat[mine] / durations[mine, None], durations[mine], costs[mine]))
        first.append(first[-1] + len(mine))
    return (np.array(first), *(np.concatenate(column) for column in zip(*rows, strict=True)))


@compiled
def _spanning(steps, headings_of, costs, headings, classes, reach, most, spare):  # type: ignore[no-untyped-def]
    """Tell which edges, given in the order of their cost, are not made up by two cheaper parts that lead to the same place.

    Parts are edges kept before, or what these make up: ``best`` holds the least cost from a class of heading by a step. Classes
    are a quarter of the headings, or all of them.
    """
    size = 2 * reach + 1
    best = np.full((classes, size, size, 2 * most + 1), np.inf)
    kept = np.zeros(len(costs), dtype=np.bool_)
    listed = np.empty((classes, len(costs)), dtype=np.int64)
    count = np.zeros(classes, dtype=np.int64)
    for n in range(len(costs)):
        k, i, j, m = headings_of[n], steps[n, 0], steps[n, 1], steps[n, 2]
        least = best[k, i + reach, j + reach, m + most]
        for a in range(count[k]):
            e = listed[k, a]
            # the rest of the path, seen from the quarter in which the first part ends
            ri, rj, rm = i - steps[e, 0], j - steps[e, 1], m - steps[e, 2]
            at = (k + steps[e, 2]) % headings
            for _ in range(at // classes):
                ri, rj = rj, -ri
            if abs(ri) <= reach and abs(rj) <= reach and abs(rm) <= most:
                least = min(least, costs[e] + best[at % classes, ri + reach, rj + reach, rm + most])
        if least > spare * costs[n]:
            kept[n] = True
            listed[k, count[k]] = n
            count[k] += 1
            least = min(least, costs[n])
        best[k, i + reach, j + reach, m + most] = least
    return kept
