"""Distance to the goal around obstacles, as a lower bound on the time to go."""

from __future__ import annotations

import math

import numpy as np
import shapely

from stablepush.core import BoolArray, FloatArray, compiled
from stablepush.planning import PlanningProblem
from stablepush_planners._heap import heap_pop, heap_push

#: Paths along the eight directions of a grid are at most this much longer than the straight ones: sqrt(4 - 2 sqrt(2)).
_OCTILE = math.sqrt(4 - 2 * math.sqrt(2))
#: Largest number of cells, and width of a cell in radii of the slider; wider scenes get wider cells.
_MOST_CELLS, _CELL = 20_000, 0.15


class DistanceField:
    """Length of the shortest path of the body origin to the goal on a grid, made optimistic.

    A cell counts as blocked only when the origin cannot be anywhere in it: the disc about the origin that lies inside
    the slider would then overlap an obstacle. Octile grid distances are scaled down to what a straight path takes at least, and
    two cells' diagonals are taken off for where in their cells start and goal are.

    Attributes
    ----------
    times : array, shape (nx, ny)
        Lower bounds in s by cell; infinite where the goal cannot be reached.
    low : array, shape (2,)
    cell : float
    """

    def __init__(self, problem: PlanningProblem) -> None:
        self.low, high = _extent(problem)
        self.cell = max(_CELL * problem.slider.radius, math.sqrt(float(np.prod(high - self.low)) / _MOST_CELLS))
        shape = tuple(int(n) for n in np.ceil((high - self.low) / self.cell) + 1)
        blocked = self._blocked(problem, shape)
        # the goal region may stick out of a blocked cell
        reach = math.ceil(problem.tolerance[0] / self.cell)
        i, j = np.clip(np.floor((problem.goal[:2] - self.low) / self.cell).astype(int), 0, np.array(shape) - 1)
        distance = np.full(shape, np.inf)
        distance[max(0, i - reach) : i + reach + 1, max(0, j - reach) : j + reach + 1] = 0.0
        _flood(blocked, distance)
        length = np.maximum(0.0, (distance / _OCTILE - 2 * math.sqrt(2)) * self.cell)
        self.times = np.ascontiguousarray(np.maximum(0.0, length - problem.tolerance[0]) / problem.speed)

    def _blocked(self, problem: PlanningProblem, shape: tuple[int, ...]) -> BoolArray:
        origin = shapely.Point(0.0, 0.0)
        outline = problem.slider.polygon
        inner = float(outline.exterior.distance(origin)) if outline.contains(origin) else 0.0
        reach = inner - self.cell * math.sqrt(0.5)
        if reach <= 0 or not problem.obstacles:
            return np.zeros(shape, dtype=bool)
        centers = self.low + (np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 2) + 0.5) * self.cell
        tree = shapely.STRtree([shapely.Polygon(o) for o in problem.obstacles])
        hits = tree.query(shapely.points(centers), predicate="dwithin", distance=reach)
        blocked = np.zeros(len(centers), dtype=bool)
        blocked[hits[0]] = True
        return blocked.reshape(shape)


def _extent(problem: PlanningProblem) -> tuple[FloatArray, FloatArray]:
    if problem.bounds is not None:
        return problem.bounds[:2], problem.bounds[2:]
    points = np.concatenate([problem.start[None, :2], problem.goal[None, :2], *problem.obstacles])
    padding = 20 * problem.slider.radius
    return points.min(axis=0) - padding, points.max(axis=0) + padding


@compiled
def _flood(blocked, distance):  # type: ignore[no-untyped-def]
    """Spread octile distances (cells) over the free cells, from those that are zero in ``distance`` (Dijkstra)."""
    nx, ny = distance.shape
    capacity = 8 * nx * ny + 16
    value, code = np.empty(capacity), np.empty(capacity, dtype=np.int64)
    n = 0
    for i in range(nx):
        for j in range(ny):
            if distance[i, j] == 0.0:
                value[n], code[n] = 0.0, i * ny + j
                n += 1
    while n > 0:
        cost, at = value[0], heap_pop(value, code, n)
        n -= 1
        i, j = at // ny, at % ny
        if cost > distance[i, j]:
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                u, v = i + di, j + dj
                if (di == 0 and dj == 0) or not (0 <= u < nx and 0 <= v < ny) or blocked[u, v]:
                    continue
                total = cost + (1.0 if di == 0 or dj == 0 else math.sqrt(2.0))
                if total < distance[u, v]:
                    distance[u, v] = total
                    heap_push(value, code, n, total, u * ny + v)
                    n += 1
