"""One search for a plan by a planner of the registry: aligned before it where the start is uncertain, and likely to succeed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from stablepush.core import Deadline, StablepushError, UnavailableError, what_failed
from stablepush.planning.alignment import aligns
from stablepush.planning.chance.constrained import likely_plan
from stablepush.planning.chance.scenarios import alignment_push
from stablepush.planning.collision import SweptBody
from stablepush.planning.feasibility import infeasibility
from stablepush.planning.options import PlanOptions, PushSet, promised_region
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult, Push
from stablepush.planning.start_at_goal import arrived
from stablepush.stability import StableRegion


class Planner(Protocol):
    """What a package registers under the entry point group ``stablepush.planners``.

    A planner asks ``deadline`` now and then whether it has passed, and reports its first path to it
    (:meth:`Deadline.path_found`); ``progress`` takes short words on the state of the search.
    """

    def __call__(
        self,
        problem: PlanningProblem,
        *,
        deadline: Deadline,
        seed: int,
        options: PlanOptions,
        progress: Callable[[str], None] | None,
    ) -> PlanResult: ...


class Found(NamedTuple):
    """A result, what is doubtful of it, and what else its message says.

    ``held``: share of scenarios that it holds in, at most the level asked for.
    """

    result: PlanResult
    held: float
    doubts: tuple[str, ...] = ()
    remark: str = ""


@dataclass(frozen=True, slots=True)
class Search:
    """What a request asks of a planner; called with a problem it looks for a plan, and says which probability that holds.

    ``level``: the probability of success that is looked for, 0 for any; ``clearance`` (m): what obstacles were enlarged by.
    """

    planner: str
    run: Planner
    options: PlanOptions
    level: float
    clearance: float
    seed: int
    progress: Callable[[str], None] | None

    def __call__(self, asked: PlanningProblem, until: Deadline, *, search_budget: float) -> Found:
        reason = infeasibility(asked)
        if reason and self.clearance:
            reason += f" (of obstacles that are larger by the clearance of {1000 * self.clearance:.3g} mm)"
        aligning, impossible, doubt = (None, reason, "") if reason else _alignment(asked, self.options.region)
        if impossible:
            return Found(PlanResult("no-path", self.planner, seed=self.seed, message=impossible), 0.0)
        here = None if reason or aligning is not None else arrived(asked, self.planner, self.seed)
        if here is not None:
            return Found(here, self.level)
        alone = asked if aligning is None else asked.starting_at(aligning.end)

        def attempt(regions: Sequence[StableRegion | PushSet | None], until: Deadline, effort: float) -> PlanResult:
            options = replace(self.options, regions=tuple(regions), refinement_budget=effort, search_budget=search_budget)
            found = self._run(alone, until, options)
            return found if aligning is None or not found.solved else _preceded(found, aligning)

        effort = self.options.refinement_budget
        if self.level and asked.surface.is_dual:
            result, held = likely_plan(asked, self.level, attempt, until, until.left(), effort, self.seed)
        else:
            result, held = attempt((), until, effort), self.level
        return Found(result, min(held, self.level), (doubt,) if doubt else ())

    def _run(self, problem: PlanningProblem, deadline: Deadline, options: PlanOptions) -> PlanResult:
        """The planner's own answer, which may come from another package."""
        try:
            found = self.run(problem, deadline=deadline, seed=self.seed, options=options, progress=self.progress)
        except StablepushError:
            raise
        except Exception as error:
            raise UnavailableError(f"planner {self.planner}: it failed by {what_failed(error)}") from error
        if not isinstance(found, PlanResult):
            kind = type(found).__name__
            raise UnavailableError(f"planner {self.planner}: expected it to return a PlanResult, got {kind}")
        # also where that planner asked another one, the result names the planner that was asked
        return replace(found, planner=self.planner)


def _alignment(problem: PlanningProblem, region: str) -> tuple[Push | None, str, str]:
    """Return the push that aligns a slider whose start is uncertain, if any, the reason for infeasibility, and a warning."""
    if not any(problem.uncertainty.start):
        return None, "", ""
    contact, push = problem.contacts[0], alignment_push(problem)
    if push is None:
        why = "its straight pushes are not stable" if aligns(contact) else "it does not have two fingers on one normal"
        return None, "", f"the start is uncertain, and contact 0 does not align the slider: {why}"
    words = f"the straight push of {1000 * push.length:.3g} mm that aligns the slider"
    if not SweptBody(problem, contact).push_is_free(push.start, push.twist, push.duration):
        return None, f"start: obstacles or bounds block {words}", ""
    promised = promised_region(problem, 0, region)
    if promised is not None and not promised.contains_twists(push.twist[None])[0]:
        return None, f"start: {words} is not stable for every pressure, contact friction and finger position", ""
    return push, "", ""


def _preceded(result: PlanResult, push: Push) -> PlanResult:
    """A plan with a push before it, without a lower bound: that of the rest does not hold for plans without the push."""
    return PlanResult.from_segments(
        [push, *result.segments], planner=result.planner, seed=result.seed, message=result.message, lower_bound=None
    )
