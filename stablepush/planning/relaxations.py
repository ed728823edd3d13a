"""Which relaxed problem has a plan where none was found: one with wider bounds, or one without obstacles."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from stablepush.core import PlanWarning, StablepushError
from stablepush.geometry import transform_points
from stablepush.planning.check import check_plan
from stablepush.planning.clearance import motions_of
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult

#: Bounds are proposed in whole steps of this length (m), and those of the problem that are whole but for rounding stay.
_STEP, _WHOLE = 0.01, 1e-6


def feasible_relaxations(problem: PlanningProblem, make: Callable[[PlanningProblem], PlanResult]) -> str:
    """Return in words which relaxed problems have a plan; empty if none was found.

    ``make`` plans: the problem without its bounds, and without its obstacles; without both, where neither helps. The bounds that
    are proposed hold the plan that was found, and :func:`check_plan` has verified it within them.
    """

    def without(changes: dict[str, Any]) -> PlanResult | None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PlanWarning)
                found = make(problem.with_changes(**changes))
        except StablepushError:
            # an effect may need bounds
            return None
        return found if found.solved else None

    words = []
    if problem.bounds is not None:
        words.append(_within(problem, without({"bounds": None})))
    if problem.obstacles:
        words.append("without the obstacles" if without({"obstacles": ()}) else "")
    if problem.bounds is not None and problem.obstacles and not any(words):
        free = problem.with_changes(obstacles=())
        plan = without({"bounds": None, "obstacles": ()})
        both = _within(free, plan)
        if plan is not None and (both or check_plan(free, plan).valid):
            words.append(", ".join(filter(None, (both, "without the obstacles"))))
    told = " or ".join(filter(None, words))
    return f"there is a plan {told}" if told else ""


def _within(problem: PlanningProblem, plan: PlanResult | None) -> str:
    """Return bounds that hold a plan and the bounds of the problem, in words, as a scene has them; empty without such."""
    if plan is None or problem.bounds is None:
        return ""
    if check_plan(problem, plan).valid:
        # it was not the bounds that were in the way
        return ""
    within, low, high = problem.bounds, problem.bounds[:2], problem.bounds[2:]
    for _, outline, poses in motions_of(problem, plan):
        places = transform_points(poses, outline).reshape(-1, 2)
        low, high = np.minimum(low, places.min(axis=0)), np.maximum(high, places.max(axis=0))
    steps = np.concatenate((np.floor(low / _STEP + _WHOLE), np.ceil(high / _STEP - _WHOLE)))
    held = np.concatenate((low >= within[:2], high <= within[2:]))
    bounds = [
        float(side) if keeps else round(float(n) * _STEP, 9) + 0.0 for side, keeps, n in zip(within, held, steps, strict=True)
    ]
    if not check_plan(problem.with_changes(bounds=bounds), plan).valid:
        return ""
    return f"within bounds of [{', '.join(f'{bound:g}' for bound in bounds)}] (m)"
