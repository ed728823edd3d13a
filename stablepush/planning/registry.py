"""One entry for all planners; whatever they return passes the independent check first."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from stablepush.core import (
    LARGEST_MAGNITUDE,
    Deadline,
    InputError,
    PlanWarning,
    check_number,
    check_seed,
    load_plugin,
    plugin_names,
    renamed,
    within,
)
from stablepush.planning.check import check_plan
from stablepush.planning.feasibility import infeasibility
from stablepush.planning.options import PlanOptions
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult
from stablepush.stability import StabilityOracle

#: Least probability of stability of each push that a plan has by default: the quickest plans lie on the edge of the stable set,
#: and the least error of the surface makes them lose the object.
DEFAULT_PROBABILITY = 0.98


_GROUP = "stablepush.planners"


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


def planner_names() -> list[str]:
    """Return the names of all installed planners."""
    return plugin_names(_GROUP)


@renamed(cor_rate="max_twist_rate", improve="refinement_budget")
def plan(
    problem: PlanningProblem,
    planner: str = "cor-lattice",
    time_limit: float = 30.0,
    seed: int | None = None,
    *,
    region: str = "model",
    probability: float | None = None,
    margin_weight: float = 0.0,
    max_twist_rate: float = math.inf,
    refinement_budget: float = 20_000,
    stop: Callable[[], bool] | None = None,
    progress: Callable[[str], None] | None = None,
) -> PlanResult:
    """Plan a path of stable pushes.

    Parameters
    ----------
    problem : PlanningProblem
    planner : str
        Name of an installed planner (:func:`planner_names`).
    time_limit : float
        Wall time in s after which the planner stops with the status ``"timeout"``. What the first plan after an install spends on
        building compiled code does not count.
    seed : int, optional
        Seed of planners that draw random numbers; 0 if not given.
    probability : float, optional
        Least probability of stability of each push, by the surface's ensemble; 0 gives the quickest plan. If not given,
        :data:`DEFAULT_PROBABILITY` where the surface has an ensemble. Where there is no such plan, or none is found in half of
        the time, the quickest one comes with a :class:`~stablepush.PlanWarning`: how likely its least certain push is.
    region, margin_weight, cor_rate, improve
        How certain and how good the plan is to be: see :class:`PlanOptions`.
    stop : callable, optional
        Asked now and then; once it returns true, the search ends with the best plan found so far, or with the status
        ``"interrupted"``.
    progress : callable, optional
        Called now and then with a line on the state of the search.

    Returns
    -------
    PlanResult
        Solved plans have passed :func:`check_plan`; one that the check refuses comes back as ``"rejected"``, without its path.
        A problem that :func:`~stablepush.planning.feasibility.infeasibility` shows to have no plan is ``"no-path"`` at once.
    """
    started = time.perf_counter()
    limit = check_number(time_limit, "time_limit", at_least=0.0)
    given = DEFAULT_PROBABILITY if probability is None and problem.surface.members() else probability or 0.0
    options = PlanOptions(region, given, margin_weight, max_twist_rate, refinement_budget)
    if planner not in planner_names():
        raise InputError("planner", f"expected one of {', '.join(planner_names()) or 'none installed'}", repr(planner))
    run: Planner = load_plugin(_GROUP, planner)

    number = 0 if seed is None else check_seed(seed)
    with within(limit, stop) as deadline:
        reason = infeasibility(problem)
        if reason:
            return PlanResult("no-path", planner, seed=number, message=reason, planning_time=time.perf_counter() - started)
        optional = probability is None and given > 0
        first = deadline.reserving(limit / 2) if optional else deadline
        result = run(problem, deadline=first, seed=number, options=options, progress=progress)
        if optional and not result.solved and not deadline.stopped:
            late = f" in {limit / 2:.3g} s, half of the time," if result.status == "timeout" else ""
            anyhow = replace(options, probability=0.0)
            result = run(problem, deadline=deadline, seed=number, options=anyhow, progress=progress)
            least = least_probability(problem, result)
            if result.solved and least is not None and least < given:
                result = _with_warning(result, given, least, late)
        if deadline.stopped and not result.solved:
            result = PlanResult("interrupted", planner, seed=number, message="stopped before a path was found")
    if result.solved:
        objection = _objection(problem, result)
        if objection:
            result = PlanResult("rejected", planner, seed=result.seed, message=objection)
    return replace(result, planning_time=time.perf_counter() - started)


def least_probability(problem: PlanningProblem, result: PlanResult) -> float | None:
    """Return the least probability of stability of any push of a plan, by the surface's ensemble; None without one."""
    if not result.pushes or not problem.surface.members():
        return None
    least = 1.0
    for number in {push.contact for push in result.pushes}:
        twists = np.array([push.twist for push in result.pushes if push.contact == number])
        shares = StabilityOracle(problem.surface, problem.contacts[number]).probability(twists)
        least = min(least, 1.0 if shares is None else float(shares.min()))
    return least


def _with_warning(result: PlanResult, asked: float, least: float, late: str) -> PlanResult:
    """A plan that says how likely it is to fail."""
    words = (
        f"no plan was found{late} in which every push is stable with probability {asked:g}; "
        f"the least certain push of this one has probability {least:.2g}"
    )
    warnings.warn(PlanWarning(words), stacklevel=3)
    return replace(result, message="; ".join(filter(None, (result.message, words))))


def _objection(problem: PlanningProblem, result: PlanResult) -> str:
    """What is wrong with a plan; empty if nothing is."""
    report = check_plan(problem, result)
    fastest = max((float(np.abs(push.twist).max()) for push in result.pushes), default=0.0)
    if max(result.duration, result.length, fastest) > LARGEST_MAGNITUDE:
        return (
            f"a plan/1 file holds numbers up to {LARGEST_MAGNITUDE:g} (SI units), this plan takes {result.duration:g} s "
            f"for {result.length:g} m, with twists up to {fastest:g}"
        )
    return report.objections[0] if report.objections else ""
