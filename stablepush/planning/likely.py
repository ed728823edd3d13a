"""Look for a plan that succeeds with a given probability: choose scenarios, plan in their common stable set, test, tighten."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from stablepush.core import Deadline
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult
from stablepush.planning.scenarios import CHOICE, chosen_regions, draw_scenarios
from stablepush.planning.success import first_losses
from stablepush.stability import StableRegion

#: Fresh scenarios on which a level counts as met.
_TESTED = 1000
#: Rounds of tightening, and of the last of them how many times more scenarios are all to hold.
_ROUNDS, _MORE = 5, 2
#: Shares of scenarios that are tried where there is no plan at the level, from the surest to the least.
_LESS = (0.9, 0.75, 0.5, 0.25)
#: Work on better plans while the share is being found.
_EFFORT = 20_000.0

Attempt = Callable[[Sequence[StableRegion], Deadline, float], PlanResult]


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A plan, and the share of fresh scenarios that it holds in; negative without a plan."""

    result: PlanResult
    held: float


def likely_plan(
    problem: PlanningProblem, level: float, attempt: Attempt, deadline: Deadline, limit: float, effort: float, seed: int
) -> tuple[PlanResult, str]:
    """Return a plan that sticks throughout with the probability ``level``, or the surest that was found, and what falls short.

    ``attempt(regions, deadline, effort)`` plans within regions of the contacts. Half of the time is kept for the surest plan
    where there is none at the level.
    """
    best, regions = _at_level(problem, level, attempt, deadline.reserving(limit / 2), min(effort, _EFFORT), seed)
    if best.held >= level and effort > _EFFORT and not deadline.passed():
        longer = _tested(problem, attempt(regions, deadline, effort), seed, 10 + _ROUNDS)
        best = longer if longer.held >= level else best
    if not best.result.solved and not deadline.stopped:
        best = _surest(problem, level, attempt, deadline, min(effort, _EFFORT), seed)
    if not best.result.solved or best.held >= level:
        return best.result, ""
    return best.result, f"no plan was found that succeeds with probability {level:g}; this one does with about {best.held:.2g}"


def _surest(problem: PlanningProblem, level: float, attempt: Attempt, deadline: Deadline, effort: float, seed: int) -> Candidate:
    """The surest plan of those in the common sets of ever fewer scenarios; the quickest if there is none."""
    # without a quickest plan there is none
    best = _tested(problem, attempt((), deadline, effort), seed, 20)
    for number, share in enumerate(_LESS):
        if share >= level or deadline.passed() or not best.result.solved:
            continue
        chosen = chosen_regions(draw_scenarios(problem, CHOICE, seed), share)
        tried = _tested(problem, attempt(chosen, deadline, effort), seed, 21 + number)
        if tried.held > best.held:
            return tried
    return best


def _at_level(
    problem: PlanningProblem, level: float, attempt: Attempt, deadline: Deadline, effort: float, seed: int
) -> tuple[Candidate, Sequence[StableRegion]]:
    """The first plan that meets the level, else the surest of those that were made on the way, and its regions."""
    scenarios, share = draw_scenarios(problem, CHOICE, seed), level
    best, regions = Candidate(PlanResult("no-path", ""), -1.0), []
    for number in range(_ROUNDS):
        chosen = chosen_regions(scenarios, share)
        tried = _tested(problem, attempt(chosen, deadline, effort), seed, 10 + number)
        if tried.held > best.held or number == 0:
            best, regions = tried, chosen
        if not tried.result.solved or tried.held >= level or deadline.passed():
            break
        # halve what may fail; then all hold, then all of more scenarios
        if share < 1:
            share = 1 - math.floor((1 - share) * len(scenarios) / 2) / len(scenarios)
        else:
            scenarios = draw_scenarios(problem, _MORE * len(scenarios), seed)
    return best, regions


def _tested(problem: PlanningProblem, result: PlanResult, seed: int, stream: int) -> Candidate:
    if not result.solved or not result.pushes:
        return Candidate(result, -1.0)
    lost, _ = first_losses(draw_scenarios(problem, _TESTED, seed, stream), result)
    return Candidate(result, float(np.mean(lost < 0)))
