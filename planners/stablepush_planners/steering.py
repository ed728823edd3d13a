"""A contact as a Dubins vehicle: turns as tight as it allows either way, and a straight push.

For one contact, choose a direction ``d`` of stable translation and a line across it (at right angles). Let ``c_L, c_R`` be the
tightest stable CORs on that line, counter-clockwise and clockwise. Their midpoint then moves along ``d`` on arcs of equal
radius ``r = |c_L - c_R|/2`` either way: the pushed slider is a Dubins vehicle with that reference point, although the two limits
measured from the body origin differ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stablepush.core import BoolArray, FloatArray, order_with_ties
from stablepush.geometry import transport_twist, twist_from_cor
from stablepush.planning import PlanningProblem
from stablepush_planners.stable_set import StableSet

#: Grid of candidate lines: directions across the stable interval, and offsets of the line along the direction, in rho.
_DIRECTIONS = 5
_OFFSETS = np.linspace(-2.0, 2.0, 9)
#: Places along a line, in rho, denser near the slider: the widest turn looked at is 50 rho.
_PLACES = np.sinh(np.linspace(-np.arcsinh(500.0), np.arcsinh(500.0), 121)) / 10.0


#: A turn is tighter than another if its radius is less by this share; of equal ones the first line that is looked at stays.
_GAIN = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Steering:
    """How one contact steers: a reference frame in B whose origin moves like a Dubins vehicle along its x axis.

    Attributes
    ----------
    frame : array, shape (3,)
        Pose of the reference frame in B.
    radius : float
        Least turning radius (m) of its origin.
    """

    frame: FloatArray
    radius: float

    def twist(self, curvature: float) -> FloatArray:
        """Body twist (3,) for unit speed of the reference point along its x axis, turning with a curvature (1/m)."""
        return transport_twist((1.0, 0.0, curvature), self.frame)


def steering(problem: PlanningProblem, stable: StableSet, headings: tuple[float, float] = (0.0, 2 * np.pi)) -> Steering | None:
    """Return the tightest steering of a contact, or None if it has no stable translation with turns to both sides.

    ``headings``: from where (rad in W) and by how much round they are to be stable, where loads depend on the heading. Raises
    :class:`OutOfTimeError` as ``stable`` does.
    """
    rho = problem.surface.characteristic_length
    heading = float(problem.contacts[stable.contact].frame[2])

    def accepts(twists: FloatArray) -> BoolArray:
        return stable.accepts(twists, headings)

    # directions of stable translation, by sampling half a turn about the mean normal
    angles = heading + np.linspace(-np.pi / 2, np.pi / 2, 361)
    straight = accepts(np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1))
    if not straight.any():
        return None
    good = angles[straight]
    best: Steering | None = None
    directions = np.unique(good[np.linspace(0, len(good) - 1, _DIRECTIONS).round().astype(int)])
    offsets = _OFFSETS * rho
    for _ in range(2):
        found = _tightest(accepts, directions, offsets, rho)
        if found is None:
            break
        direction, offset, left, right = found
        radius = (left - right) / 2
        if best is None or radius < best.radius * (1 - _GAIN):
            along = np.array((np.cos(direction), np.sin(direction)))
            middle = offset * along + (left + right) / 2 * np.array((-along[1], along[0]))
            best = Steering(np.array((*middle, direction)), radius)
        # once more, finer, about the best line; directions stay within the stable interval
        step = (good[-1] - good[0]) / (_DIRECTIONS - 1)
        directions = np.clip(direction + np.linspace(-step, step, _DIRECTIONS), good[0], good[-1])
        offsets = offset + np.linspace(-1, 1, len(_OFFSETS)) * (_OFFSETS[1] - _OFFSETS[0]) * rho
    return best


def _tightest(
    accept: Callable[[FloatArray], BoolArray], directions: FloatArray, offsets: FloatArray, rho: float
) -> tuple[float, float, float, float] | None:
    """Direction (rad), offset and places (m) of the CORs nearest to each other on any of the lines."""
    places = _PLACES * rho
    lines = []
    along = np.stack((np.cos(directions), np.sin(directions)), axis=-1)
    straight = accept(np.column_stack((along, np.zeros(len(along)))))
    for d, direction in zip(along[straight], directions[straight], strict=True):
        normal = np.array((-d[1], d[0]))
        cors = offsets[:, None, None] * d + places[None, :, None] * normal
        flat = cors.reshape(-1, 2)
        shape = cors.shape[:2]
        left = accept(twist_from_cor(flat, 1.0)).reshape(shape)
        right = accept(twist_from_cor(flat, -1.0)).reshape(shape)
        for row, offset in enumerate(offsets):
            if not (left[row].any() and right[row].any()):
                continue
            i, j = int(np.argmax(left[row])), len(places) - 1 - int(np.argmax(right[row][::-1]))
            if places[i] > places[j]:
                # how near to each other they may be at best
                least = places[max(i - 1, 0)] - places[min(j + 1, len(places) - 1)]
                lines.append((float(least), float(direction), float(offset), d, normal, i, j))
    best: tuple[float, float, float, float] | None = None
    for n in order_with_ties(np.array([line[0] for line in lines]), _GAIN * rho):
        least, way, offset, d, normal, i, j = lines[n]
        if best is not None and least > best[2] - best[3]:
            break
        s_left = _refine(accept, offset * d, normal, 1.0, places, i, i - 1)
        s_right = _refine(accept, offset * d, normal, -1.0, places, j, j + 1)
        if s_left > s_right and (best is None or s_left - s_right < (best[2] - best[3]) * (1 - _GAIN)):
            best = (way, offset, s_left, s_right)
    return best


def _refine(
    accept: Callable[[FloatArray], BoolArray],
    foot: FloatArray,
    normal: FloatArray,
    sense: float,
    places: FloatArray,
    inside: int,
    outside: int,
) -> float:
    """Narrow the boundary between a stable place and its unstable neighbour; the result is stable."""
    good = places[inside]
    if not 0 <= outside < len(places):
        return float(good)
    bad = places[outside]
    for _ in range(3):
        tried = np.linspace(good, bad, 18)[1:-1]
        stable = accept(twist_from_cor(foot + tried[:, None] * normal, sense))
        count = len(stable) if stable.all() else int(np.argmin(stable))
        good, bad = (tried[count - 1] if count else good), (tried[count] if count < len(tried) else bad)
    return float(good)
