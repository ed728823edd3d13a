"""Plans keep away from obstacles where that costs little: on a robot nothing is quite where it is believed to be."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple, Protocol

from stablepush.core import Deadline
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult

#: Distance (m) that plans keep from obstacles if none is asked for, and how much longer they may take than the first plan that
#: may touch.
APART, _LONGER = 0.005, 1.05
#: Search steps that are spent on finding such a plan: a count, so that it does not depend on the machine whether it is found.
_STEPS = 50_000


class Found(NamedTuple):
    """A result, whether it succeeds with the probability that was asked for, and what is doubtful of it."""

    result: PlanResult
    met: bool
    doubts: tuple[str, ...] = ()


class Search(Protocol):
    """Plan for a problem until a deadline: at most so many search steps for a first plan, then so many on better ones."""

    def __call__(self, problem: PlanningProblem, until: Deadline, /, *, first: float, refining: float) -> Found: ...


def keep_away(problem: PlanningProblem, search: Search, deadline: Deadline, refining: float) -> Found:
    """Return a plan that keeps :data:`APART` from obstacles, if one is found that takes little longer; else one that may touch.

    The first plan that may touch tells whether there is any, and how long it takes.
    """
    touching = search(problem, deadline, first=math.inf, refining=0.0)
    if not touching.result.solved or deadline.passed():
        return touching
    larger = problem.with_clearance(APART)
    apart = search(larger, deadline.reserving(deadline.left() / 2), first=_STEPS, refining=refining)
    near = apart.result.solved and apart.result.duration <= _LONGER * touching.result.duration
    if near and apart.met >= touching.met:
        # a bound of the problem itself holds for these plans as well
        return apart._replace(result=replace(apart.result, lower_bound=touching.result.lower_bound))
    refined = search(problem, deadline, first=math.inf, refining=refining)
    return refined if refined.result.solved else touching
