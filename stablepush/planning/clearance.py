"""How near a plan comes to an obstacle: probabilities of success do not count collisions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from stablepush.geometry import compose, exp, transform_points
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult

#: Way (m) of the farthest corner between two poses that are looked at.
_STEP = 2e-3


class Clearance(NamedTuple):
    """Least distance (m) to an obstacle, and the push, counted from 1, in which it is reached."""

    distance: float
    push: int


def clearance_of(problem: PlanningProblem, result: PlanResult) -> Clearance | None:
    """Return how near slider and docked pusher come to an obstacle in the pushes of a plan; None without obstacles or pushes.

    Poses are sampled: the true distance is at most 1 mm less.
    """
    if not len(problem.obstacles) or not result.pushes:
        return None
    obstacles = shapely.MultiPolygon([shapely.Polygon(corners) for corners in problem.obstacles])
    shapely.prepare(obstacles)
    found = Clearance(math.inf, 0)
    for number, push in enumerate(result.pushes, 1):
        outlines = [problem.slider.vertices, *problem.docked_outlines(problem.contacts[push.contact])]
        reach = max(float(np.linalg.norm(outline, axis=1).max()) for outline in outlines)
        way = push.length + abs(float(push.twist[2])) * push.duration * reach
        shares = np.linspace(0.0, 1.0, 2 + math.ceil(way / _STEP))
        poses = compose(push.start, exp(push.twist * (shares * push.duration)[:, None]))
        for outline in outlines:
            bodies = shapely.polygons([transform_points(pose, outline) for pose in poses])
            found = min(found, Clearance(float(shapely.distance(obstacles, bodies).min()), number))
    return found
