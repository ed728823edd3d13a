"""Look for a plan that succeeds with a given probability: choose scenarios, plan in their common stable set, test, tighten."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stablepush.core import Deadline, OutOfTimeError
from stablepush.planning.chance.scenario_choice import CHOICE, choice_of
from stablepush.planning.chance.scenarios import draw_scenarios
from stablepush.planning.chance.success import first_losses
from stablepush.planning.options import PushSet
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult
from stablepush.stability import StableRegion

#: Fresh scenarios on which a level counts as met.
_TESTED = 1000
#: Scenarios fewer than the level allows that a choice leaves out: about as many bound a plan's motions and bias its share.
_BOUNDING = 4
#: Numbers of scenarios that must all hold, tried when those of the first choice are not enough.
_MORE = (600, 900)
#: Shares of scenarios that are tried where there is no plan at the level, in falling order.
_LESS = (0.9, 0.75, 0.5, 0.25)
#: Time limits (s) below which the quickest plan is made first.
_HURRIED = 5.0
#: Searches for better plans at the level, each in tighter regions.
_REFINED = 3

Attempt = Callable[[Sequence[StableRegion | PushSet | None], Deadline, float], PlanResult]


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A plan, and the share of fresh scenarios that it holds in; negative without a plan."""

    result: PlanResult
    held: float


def likely_plan(
    problem: PlanningProblem, level: float, attempt: Attempt, deadline: Deadline, limit: float, effort: float, seed: int
) -> tuple[PlanResult, float]:
    """Return a plan that sticks throughout with the probability ``level``, else the most probable one found, and the
    share of scenarios that it holds in.

    ``attempt(regions, deadline, effort)`` plans within regions of the contacts, with so much work on better plans. Half of the
    time is reserved to find the most probable plan where there is none at the level.
    """
    quickest = _Candidate(PlanResult("no-path", ""), -1.0)
    if limit < _HURRIED:
        # there may be no time for more
        quickest = _Candidate(attempt((), deadline, 0.0), 0.0)
        if not quickest.result.solved or deadline.passed():
            return quickest.result, 0.0
    search, first = _Search(problem, level, attempt, seed), deadline.reserving(limit / 2)
    every = frozenset(range(len(problem.contacts)))
    # in a hurry the contacts of the quickest plan come first
    tried = [_contacts_of(quickest) or every]
    best = search.at_level(first, deadline, effort, tried[0])
    for fewer in (False, True):
        # without the others no scenario is left out for their sake, and a search gets farther
        used = _contacts_of(best) if fewer else every
        if used and used not in tried and not deadline.passed() and (effort or best.held < level):
            tried.append(used)
            best = max(best, search.at_level(deadline if best.result.solved else first, deadline, effort, used), key=search.worth)
    if not best.result.solved and not deadline.stopped:
        best = search.most_probable(deadline, quickest)
    elif not best.result.solved and quickest.result.solved:
        best = quickest
    return best.result, best.held


def _contacts_of(candidate: _Candidate) -> frozenset[int]:
    return frozenset(push.contact for push in candidate.result.pushes)


class _Search:
    def __init__(self, problem: PlanningProblem, level: float, attempt: Attempt, seed: int) -> None:
        self._problem, self._level, self._attempt, self._seed = problem, level, attempt, seed
        self._choice = choice_of(problem, seed)
        self._every = range(len(problem.contacts))
        self._tests = 0

    def at_level(self, first: Deadline, deadline: Deadline, effort: float, used: Collection[int]) -> _Candidate:
        """A refined plan of the contacts ``used`` that meets the level, else the most probable of those made meanwhile.

        A first plan is looked for until the deadline ``first``.
        """
        best, refined = _Candidate(PlanResult("no-path", ""), -1.0), 0
        self._tests = 0
        for count, left_out in self._choices():
            try:
                regions = self._choice.regions(count, left_out, deadline if best.result.solved else first, used)
            except OutOfTimeError:
                break
            tried = self._tested(regions, first, 0.0)
            if not tried.result.solved and best.result.solved:
                break
            best = max(best, tried, key=self.worth)
            if not tried.result.solved or deadline.passed():
                break
            if tried.held < self._level:
                continue
            if effort == 0:
                break
            # a better plan may lie nearer to the bounds
            tried, refined = self._tested(regions, deadline, effort), refined + 1
            best = max(best, tried, key=self.worth)
            if tried.held >= self._level or refined == _REFINED or deadline.passed():
                break
        return best

    def most_probable(self, deadline: Deadline, quickest: _Candidate) -> _Candidate:
        """The first plan, over common sets of ever fewer scenarios, more probable than the quickest; else the quickest.

        ``quickest``: that plan, if it has been made.
        """
        # without a quickest plan there is none
        best = self._held(quickest.result) if quickest.result.solved else self._tested((), deadline, 0.0)
        for share in _LESS:
            if share >= self._level or deadline.passed() or not best.result.solved:
                continue
            try:
                regions = self._choice.regions(CHOICE, round((1 - share) * CHOICE), deadline, self._every)
            except OutOfTimeError:
                break
            tried = self._tested(regions, deadline, 0.0)
            if tried.held > best.held:
                return tried
        return best

    def _choices(self) -> Iterator[tuple[int, int]]:
        """Of how many scenarios how many are left out, ever fewer."""
        left_out = max(0, math.floor((1 - self._level) * CHOICE) - _BOUNDING)
        while left_out:
            yield CHOICE, left_out
            left_out //= 2
        for count in (CHOICE, *_MORE):
            yield count, 0

    def worth(self, candidate: _Candidate) -> tuple[float, float]:
        """What makes a plan better: that it meets the level, and then its time; else how often it holds."""
        return min(candidate.held, self._level), -candidate.result.duration

    def _tested(self, regions: Sequence[StableRegion | PushSet | None], deadline: Deadline, effort: float) -> _Candidate:
        return self._held(self._attempt(regions, deadline, effort))

    def _held(self, result: PlanResult) -> _Candidate:
        """A plan, and the share of fresh scenarios that it holds in."""
        # each test of one round has scenarios of its own; rounds for other contacts are compared on the same
        self._tests += 1
        if not result.solved or not result.pushes:
            return _Candidate(result, -1.0)
        fresh = draw_scenarios(self._problem, _TESTED, self._seed, 10 + self._tests)
        return _Candidate(result, float(np.mean(first_losses(fresh, result).push < 0)))
