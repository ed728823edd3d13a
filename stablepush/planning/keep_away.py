"""Plans keep away from obstacles where that costs little: on a robot nothing is quite where it is believed to be."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import shapely

from stablepush.core import Deadline, FloatArray, StablepushError
from stablepush.geometry import transform_points
from stablepush.planning.check import check_plan
from stablepush.planning.clearance import clearance_of
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult
from stablepush.planning.search import Found, Search

#: Distance (m) that plans keep from obstacles if none is asked for. They may take so many times as long for it.
APART, _LONGER = 0.005, 1.05
#: Search steps of a first plan that keeps away: a count, so that it does not depend on the machine whether one is found.
_STEPS = 50_000
#: Planners that do not count steps have this many times as long as the plan took that may touch, and at least so many s.
_TIMES, _AT_LEAST = 3.0, 1.0
#: What an obstacle that is near to start or goal is not grown by (m).
_SLACK = 1e-4


#: What a plan that may touch obstacles says, where there was none that keeps away.
NO_ROOM = (
    f"no plan was found that keeps {1000 * APART:g} mm away, is as sure, and takes at most {100 * (_LONGER - 1):.0f} % longer; "
    f"a clearance of {APART:g} m accepts others"
)


def keep_away(problem: PlanningProblem, search: Search, deadline: Deadline) -> Found:
    """Return a plan that keeps :data:`APART` from obstacles, or else one that may touch them.

    The first is taken if it lasts at most 5 % longer and holds as surely.
    """
    began = time.perf_counter()
    touching = search(problem, deadline, search_budget=math.inf)
    near = clearance_of(problem, touching.result) if touching.result.solved else None
    if near is None or near.distance >= APART or deadline.passed():
        return touching
    without = touching._replace(remark=NO_ROOM)
    larger = problem.with_clearance(_growth(problem, touching.result))
    most = max(_AT_LEAST, _TIMES * (time.perf_counter() - began))
    try:
        apart = search(larger, deadline.reserving(max(0.0, deadline.left() - most)), search_budget=_STEPS)
    except StablepushError:
        # it has made a plan all the same
        return without
    if deadline.stopped or deadline.passed():
        # whether there is room is not known
        without = touching
    good = apart.result.solved and apart.held >= touching.held
    if good and apart.result.duration <= _LONGER * touching.result.duration and check_plan(larger, apart.result).valid:
        # a bound of the problem itself holds for these plans as well
        return apart._replace(result=replace(apart.result, lower_bound=touching.result.lower_bound))
    return without


def _growth(problem: PlanningProblem, plan: PlanResult) -> FloatArray:
    """How much (m) each obstacle may grow: less where slider or pusher are nearer to it at the start, the goal or the end."""
    first, last = plan.pushes[0], plan.pushes[-1]
    bodies = []
    for pose, push in ((problem.start, first), (problem.goal, last), (last.end, last)):
        for outline in (problem.slider.vertices, *problem.docked_outlines(problem.contacts[push.contact])):
            bodies.append(shapely.Polygon(transform_points(pose, outline)))
    apart = [min(shapely.Polygon(corners).distance(body) for body in bodies) for corners in problem.obstacles]
    return np.clip(np.array(apart) - _SLACK, 0.0, APART)
