"""One entry for all planners; whatever they return passes the independent check first."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import entry_points
from typing import Protocol

import numpy as np

from stablepush._arrays import LARGEST_MAGNITUDE, check_number
from stablepush.check import check_plan
from stablepush.deadline import Deadline, within
from stablepush.errors import InputError
from stablepush.options import PlanOptions
from stablepush.path import PlanResult
from stablepush.problem import PlanningProblem


class Planner(Protocol):
    """What a package registers under the entry point group ``stablepush.planners``.

    A planner asks ``deadline`` now and then whether it has passed; ``progress`` takes short words on the state of the search.
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
    return sorted(entry.name for entry in entry_points(group="stablepush.planners"))


def plan(
    problem: PlanningProblem,
    planner: str = "cor-lattice",
    time_limit: float = 30.0,
    seed: int | None = None,
    *,
    region: str = "model",
    probability: float = 0.0,
    margin_weight: float = 0.0,
    cor_rate: float = math.inf,
    improve: float = 20_000,
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
    region, probability, margin_weight, cor_rate, improve
        How sure and how good the plan is to be: see :class:`PlanOptions`.
    progress : callable, optional
        Called now and then with a line on the state of the search.

    Returns
    -------
    PlanResult
        Solved plans have passed :func:`check_plan`; one that the check refuses comes back as ``"rejected"``, without its path.
    """
    started = time.perf_counter()
    limit = check_number(time_limit, "time_limit", at_least=0.0)
    options = PlanOptions(region, probability, margin_weight, cor_rate, improve)
    found = {entry.name: entry for entry in entry_points(group="stablepush.planners")}
    if planner not in found:
        raise InputError(f"planner: expected one of {', '.join(sorted(found)) or 'none installed'}, got {planner!r}")
    run: Planner = found[planner].load()

    number = 0 if seed is None else int(seed)
    with within(limit) as deadline:
        result = run(problem, deadline=deadline, seed=number, options=options, progress=progress)
    if result.solved:
        report = check_plan(problem, result)
        objection = report.objections[0] if report.objections else ""
        fastest = max((float(np.abs(push.twist).max()) for push in result.pushes), default=0.0)
        if max(result.duration, result.length, fastest) > LARGEST_MAGNITUDE:
            objection = (
                f"a plan/1 file holds numbers up to {LARGEST_MAGNITUDE:g} (SI units), this plan takes {result.duration:g} s "
                f"for {result.length:g} m, with twists up to {fastest:g}"
            )
        if objection:
            result = PlanResult("rejected", planner, seed=result.seed, message=objection)
    return replace(result, planning_time=time.perf_counter() - started)
