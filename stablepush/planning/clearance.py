"""How near a plan comes to an obstacle: probabilities of success do not count collisions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from stablepush.core import FloatArray
from stablepush.geometry import compose, exp, transform_points
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult, Push

#: Way (m) of the farthest corner between two poses that are looked at.
_STEP = 2e-3


class Clearance(NamedTuple):
    """Least distance (m) to an obstacle, and where it is reached, in words."""

    distance: float
    where: str


def clearance_of(problem: PlanningProblem, result: PlanResult) -> Clearance | None:
    """Return how near slider and pusher come to an obstacle in a plan; None without obstacles or pushes.

    Poses are sampled: the true distance is at most 1 mm less.
    """
    if not len(problem.obstacles) or not result.pushes:
        return None
    obstacles = shapely.MultiPolygon([shapely.Polygon(corners) for corners in problem.obstacles])
    shapely.prepare(obstacles)
    found = Clearance(math.inf, "")
    for where, outline, poses in motions_of(problem, result):
        bodies = shapely.polygons([transform_points(pose, outline) for pose in poses])
        found = min(found, Clearance(float(shapely.distance(obstacles, bodies).min()), where))
    return found


def motions_of(problem: PlanningProblem, result: PlanResult) -> Iterator[tuple[str, FloatArray, FloatArray]]:
    """Where in the plan, outline (n, 2) and its poses (k, 3) in W, of all that moves."""
    number = 0
    for segment in result.segments:
        if isinstance(segment, Push):
            number += 1
            for outline in (problem.slider.vertices, *problem.docked_outlines(problem.contacts[segment.contact])):
                reach = float(np.linalg.norm(outline, axis=1).max())
                way = segment.length + abs(float(segment.twist[2])) * segment.duration * reach
                shares = np.linspace(0.0, 1.0, 2 + math.ceil(way / _STEP))
                poses = compose(segment.start, exp(segment.twist * (shares * segment.duration)[:, None]))
                yield f"push {number}", outline, poses
        elif len(segment.pusher_path):
            for outline in problem.pusher_outlines(problem.contacts[segment.source]):
                poses = _between(np.asarray(segment.pusher_path), float(np.linalg.norm(outline, axis=1).max()))
                yield f"the change of contact after push {number}", outline, poses


def _between(path: FloatArray, reach: float) -> FloatArray:
    """Poses (k, 3) along a path (n, 3) in straight lines, the heading the short way."""
    found = [path[:1]]
    for first, last in pairwise(path):
        change = last - first
        change[2] = math.remainder(change[2], 2 * math.pi)
        way = math.hypot(change[0], change[1]) + abs(float(change[2])) * reach
        found.append(first + np.linspace(0.0, 1.0, 2 + math.ceil(way / _STEP))[1:, None] * change)
    return np.concatenate(found)
