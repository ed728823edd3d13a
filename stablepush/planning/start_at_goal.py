"""A start that is within the tolerance of the goal: a push that stays there is a plan."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import FloatArray, InputError
from stablepush.geometry import normalize_wrench, unit
from stablepush.planning.check import check_plan
from stablepush.planning.feasibility import starts_at_goal
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.pusher_loads import loads_of
from stablepush.planning.result import PlanResult, Push
from stablepush.stability import StabilityOracle

#: Pushes that are looked at, the surest first, and how many of them are tried.
_PUSHES, _TRIED = 4000, 20
#: Lengths that are tried, in radii of the slider: a plan has at least one push.
_LENGTHS = (1e-3, 1e-4, 1e-5, 1e-6)


def arrived(problem: PlanningProblem, planner: str, seed: int) -> PlanResult | None:
    """Return a plan of one push that stays within the tolerance, if the start is within it; None if it is not.

    Raises :class:`InputError` if it is, and no push is so short: then nothing is to be planned.
    """
    if not starts_at_goal(problem):
        return None
    rho = problem.surface.characteristic_length
    spread = np.random.default_rng(0).normal(size=(_PUSHES, 3))
    spread[::4, 2] = 0.0
    twists = unit(spread) / (1.0, 1.0, rho)
    twists = twists * (problem.speed / problem.push_speed(twists))[:, None]
    margins = _margins(problem, twists)
    for k in np.argsort(-np.nan_to_num(margins, nan=-math.pi), kind="stable")[:_TRIED]:
        for share in _LENGTHS:
            duration = share * problem.slider.radius / problem.speed
            push = Push.from_start(0, twists[k], duration, problem.start, float(margins[k]))
            result = PlanResult.from_segments(
                [push], planner=planner, seed=seed, lower_bound=0.0, message="the start is the goal"
            )
            if check_plan(problem, result).valid:
                return result
    # the check takes what is off by rounding: a push of less than a micrometre mostly does
    raise InputError("goal", "the start is the goal, within the tolerance, and no push is short enough to stay there")


def _margins(problem: PlanningProblem, twists: FloatArray) -> FloatArray:
    """Margins (n,) in rad of body twists (n, 3) of the first contact, at the start."""
    loads, contact = loads_of(problem), problem.contacts[0]
    if loads is None:
        return StabilityOracle(problem.surface, contact).margin(twists)
    wrenches = normalize_wrench(loads.at(twists, np.tile(problem.start, (len(twists), 1))), loads.rho)
    return contact.cone(loads.rho).margin(wrenches)
