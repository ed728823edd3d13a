"""Collision of slider and pusher with obstacles and bounds: exact for poses, arcs and straight lines."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, FloatArray
from stablepush.objects import PushContact
from stablepush.planning.kernels.sweep import Body, World, list_edges, poses_are_free, pushes_are_free
from stablepush.planning.problem import PlanningProblem

#: Bodies may overlap by this much (m): touching is no collision. Half of what the check allows, so that it never disagrees.
OVERLAP = 5e-7
#: Largest number of cells in which edges are looked up; wider scenes get wider cells.
_MOST_CELLS = 20_000
#: Wanted width of a cell, in radii of the slider.
_CELL = 0.25


def world_of(problem: PlanningProblem) -> World:
    """Return the obstacles and bounds of a problem, ready for tests. Obstacles that overlap or touch are merged."""
    merged = shapely.union_all([shapely.Polygon(o) for o in problem.obstacles])
    edges = _edges(merged)
    if problem.bounds is not None:
        bounds = problem.bounds + np.array((-OVERLAP, -OVERLAP, OVERLAP, OVERLAP))
        low, high = problem.bounds[:2], problem.bounds[2:]
    else:
        bounds = np.array((-np.inf, -np.inf, np.inf, np.inf))
        around = np.concatenate((edges.reshape(-1, 2), problem.start[None, :2], problem.goal[None, :2]))
        low, high = around.min(axis=0) - problem.slider.radius, around.max(axis=0) + problem.slider.radius
    cell = max(_CELL * problem.slider.radius, math.sqrt(float(np.prod(high - low)) / _MOST_CELLS))
    nx, ny = (int(n) for n in np.ceil((high - low) / cell))
    first = np.zeros(nx * ny + 1, dtype=np.int64)
    list_edges(edges, low, cell, nx, ny, first, np.zeros(0, dtype=np.int64))
    listed = np.zeros(int(first[-1]), dtype=np.int64)
    if len(listed):
        list_edges(edges, low, cell, nx, ny, first, listed)
    centers = low + (np.moveaxis(np.indices((nx, ny)), 0, -1).reshape(-1, 2) + 0.5) * cell
    clearance = np.minimum(centers - bounds[:2], bounds[2:] - centers).min(axis=1)
    if len(edges):
        tree = shapely.STRtree(shapely.get_parts(merged))
        clearance = np.minimum(clearance, tree.query_nearest(shapely.points(centers), return_distance=True, all_matches=False)[1])
    clearance = np.maximum(0.0, clearance - cell * math.sqrt(0.5)).reshape(nx, ny)
    seen, found = np.zeros(len(edges), dtype=np.int64), np.zeros(len(edges), dtype=np.int64)
    return World(
        edges, first, listed, clearance, np.ascontiguousarray(low), cell, bounds, seen, np.zeros(1, dtype=np.int64), found
    )


def body_of(outlines: Sequence[FloatArray]) -> Body:
    """Return polygons (n, 2) in B as one rigid body."""
    merged = shapely.union_all([shapely.Polygon(o) for o in outlines])
    corners = np.concatenate(outlines)
    shrunk = shapely.buffer(merged, -OVERLAP, join_style="mitre")
    return Body(_edges(shrunk), corners, float(np.linalg.norm(corners, axis=1).max()))


def _edges(region: shapely.Geometry) -> FloatArray:
    """Edges (n, 4) of all rings of polygons."""
    rings = [
        shapely.get_coordinates(ring)
        for part in shapely.get_parts(region)
        if not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]
    found = [np.concatenate((ring[:-1], ring[1:]), axis=1) for ring in rings]
    return np.ascontiguousarray(np.concatenate(found)) if found else np.zeros((0, 4))


class SweptBody:
    """Slider and docked pusher as one rigid body among the obstacles and bounds of a problem.

    Touching is no collision: the body may overlap by :data:`OVERLAP`. Motions are tested exactly, without sampling.
    """

    def __init__(self, problem: PlanningProblem, contact: PushContact | None = None, world: World | None = None) -> None:
        outlines = [problem.slider.vertices]
        if contact is not None:
            outlines += problem.docked_outlines(contact)
        self.world = world_of(problem) if world is None else world
        self.body = body_of(outlines)

    def free(self, poses: ArrayLike) -> BoolArray:
        """Return whether the body at poses (n, 3) overlaps nothing and keeps within the bounds."""
        p = np.ascontiguousarray(np.asarray(poses, dtype=np.float64).reshape(-1, 3))
        result = np.zeros(len(p), dtype=np.bool_)
        poses_are_free(self.world, self.body, p, result)
        return result

    def pushes_are_free(self, starts: ArrayLike, twists: ArrayLike, durations: ArrayLike) -> BoolArray:
        """Return whether pushes (n, 3), (n, 3), (n,) with free starts are free of collision all along."""
        v = np.ascontiguousarray(np.asarray(twists, dtype=np.float64).reshape(-1, 3))
        p = np.ascontiguousarray(np.broadcast_to(np.asarray(starts, dtype=np.float64), v.shape))
        d = np.ascontiguousarray(np.broadcast_to(np.asarray(durations, dtype=np.float64), len(v)))
        result = np.zeros(len(v), dtype=np.bool_)
        pushes_are_free(self.world, self.body, p, v, d, result)
        return result

    def push_is_free(self, start: ArrayLike, twist: ArrayLike, duration: float) -> bool:
        """Return whether one push is free of collision, its start included."""
        return bool(self.free(start)[0] and self.pushes_are_free(np.asarray(start)[None], np.asarray(twist)[None], duration)[0])
