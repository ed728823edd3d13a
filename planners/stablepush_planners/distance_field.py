"""Distance to the goal around obstacles, as a lower bound on the time to go."""

from __future__ import annotations

import heapq
import math

import numpy as np
import shapely

from stablepush._arrays import FloatArray
from stablepush.problem import PlanningProblem

#: Ways along the eight directions of a grid are at most this much longer than the straight ones: sqrt(4 - 2 sqrt(2)).
_OCTILE = math.sqrt(4 - 2 * math.sqrt(2))
#: Largest number of cells; wider scenes get wider cells.
_MOST_CELLS = 12_000

_STEPS = [(dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


class DistanceField:
    """Length of the shortest way of the body origin to the goal on a grid, made optimistic.

    A cell counts as blocked only when the origin cannot be anywhere in it: the disc about the origin that lies inside
    the slider would then overlap an obstacle. Octile grid distances are scaled down to what a straight way takes at least, and
    two cells' diagonals are taken off for where in their cells start and goal are.
    """

    def __init__(self, problem: PlanningProblem, cell: float) -> None:
        self._speed = problem.speed
        self._slack = problem.tolerance[0]
        low, high = _extent(problem)
        self._cell = max(cell, math.sqrt(float(np.prod(high - low)) / _MOST_CELLS))
        self._low = low
        self._shape = tuple(int(n) for n in np.ceil((high - low) / self._cell) + 1)
        blocked = self._blocked(problem)
        distance = self._distances(blocked, self._index(problem.goal[None])[0])
        self._bound = np.maximum(0.0, (distance / _OCTILE - 2 * math.sqrt(2)) * self._cell)

    def time_to_go(self, poses: FloatArray) -> FloatArray:
        """Lower bound (n,) in s for poses (n, 3); infinite where the goal cannot be reached."""
        i, j = self._index(poses).T
        return np.asarray(np.maximum(0.0, self._bound[i, j] - self._slack) / self._speed)

    def _index(self, poses: FloatArray) -> np.ndarray:
        index = np.floor((poses[:, :2] - self._low) / self._cell).astype(np.int64)
        return np.clip(index, 0, np.array(self._shape) - 1)

    def _blocked(self, problem: PlanningProblem) -> np.ndarray:
        origin = shapely.Point(0.0, 0.0)
        outline = problem.slider.polygon
        inner = float(outline.exterior.distance(origin)) if outline.contains(origin) else 0.0
        reach = inner - self._cell * math.sqrt(0.5)
        if reach <= 0 or not problem.obstacles:
            return np.zeros(self._shape, dtype=bool)
        centers = self._low + (np.moveaxis(np.indices(self._shape), 0, -1).reshape(-1, 2) + 0.5) * self._cell
        tree = shapely.STRtree([shapely.Polygon(o) for o in problem.obstacles])
        hits = tree.query(shapely.points(centers), predicate="dwithin", distance=reach)
        blocked = np.zeros(len(centers), dtype=bool)
        blocked[hits[0]] = True
        return blocked.reshape(self._shape)

    def _distances(self, blocked: np.ndarray, goal: np.ndarray) -> FloatArray:
        """Octile distances in cells from the goal's cell (Dijkstra)."""
        width, height = self._shape
        distance = np.full(self._shape, np.inf).tolist()
        wall = blocked.tolist()
        gx, gy = int(goal[0]), int(goal[1])
        # the goal region may stick out of a blocked cell
        reach = math.ceil(self._slack / self._cell)
        queue = []
        for x in range(max(0, gx - reach), min(width, gx + reach + 1)):
            for y in range(max(0, gy - reach), min(height, gy + reach + 1)):
                distance[x][y] = 0.0
                queue.append((0.0, x, y))
        heapq.heapify(queue)
        while queue:
            d, x, y = heapq.heappop(queue)
            if d > distance[x][y]:
                continue
            for dx, dy, way in _STEPS:
                nx, ny = x + dx, y + dy
                if 0 <= nx < width and 0 <= ny < height and not wall[nx][ny] and d + way < distance[nx][ny]:
                    distance[nx][ny] = d + way
                    heapq.heappush(queue, (d + way, nx, ny))
        return np.array(distance)


def _extent(problem: PlanningProblem) -> tuple[FloatArray, FloatArray]:
    if problem.bounds is not None:
        return problem.bounds[:2], problem.bounds[2:]
    points = np.concatenate([problem.start[None, :2], problem.goal[None, :2], *problem.obstacles])
    room = 20 * problem.slider.radius
    return points.min(axis=0) - room, points.max(axis=0) + room
