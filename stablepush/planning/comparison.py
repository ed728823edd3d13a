"""What the identified surface buys: one problem planned with the model's region, the all-pressure region and STABLE."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stablepush.core import InputError, UnsupportedContactError
from stablepush.planning.options import REGIONS
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.registry import plan
from stablepush.planning.result import PlanResult
from stablepush.stability import all_pressure_region


@dataclass(frozen=True, slots=True, eq=False)
class RegionPlan:
    """A plan with the CORs of one region, and the share of its pushing time that is stable for every pressure distribution.

    ``certified`` is NaN without a plan, or where the slider's support leaves the all-pressure region undefined.
    """

    region: str
    result: PlanResult
    certified: float


def compare_regions(
    problem: PlanningProblem,
    planner: str = "cor-lattice",
    time_limit: float = 30.0,
    seed: int | None = None,
    *,
    refinement_budget: float = 20_000,
    progress: Callable[[str], None] | None = None,
) -> list[RegionPlan]:
    """Plan a problem with each region of :data:`stablepush.planning.options.REGIONS`; the time limit (s) is for each.

    A contact that a region does not cover (STABLE needs a line contact) makes a plan with the status ``"no-path"``.
    """
    found = []
    for region in REGIONS:
        notify = None if progress is None else lambda words, region=region: progress(f"{region}: {words}")  # type: ignore[misc]
        try:
            result = plan(
                problem,
                planner,
                time_limit,
                seed,
                region=region,
                success=0.0,
                refinement_budget=refinement_budget,
                progress=notify,
            )
        except UnsupportedContactError as error:
            result = PlanResult("no-path", planner, message=str(error))
        found.append(RegionPlan(region, result, certified_share(problem, result)))
    return found


def certified_share(problem: PlanningProblem, result: PlanResult) -> float:
    """Return the share of a plan's pushing time at CORs of the all-pressure region."""
    if not result.pushes:
        return math.nan
    certain = total = 0.0
    try:
        regions = {i: all_pressure_region(problem.slider, problem.contacts[i]) for i in {p.contact for p in result.pushes}}
        for push in result.pushes:
            total += push.duration
            certain += push.duration * float(regions[push.contact].contains_twists(np.array([push.twist]))[0])
    except InputError:
        return math.nan
    return certain / total
