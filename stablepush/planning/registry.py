"""One entry for all planners; whatever they return passes the independent check first."""

from __future__ import annotations

import inspect
import math
import time
import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stablepush.core import (
    LARGEST_MAGNITUDE,
    InputError,
    PlanWarning,
    UnavailableError,
    check_number,
    check_seed,
    check_share,
    did_you_mean,
    load_plugin,
    plugin_names,
    within,
)
from stablepush.geometry import normalize_twist, unit, wrap_angle
from stablepush.planning.alignment import aligns
from stablepush.planning.chance.success import estimate_success
from stablepush.planning.check import check_plan
from stablepush.planning.keep_away import keep_away
from stablepush.planning.options import PlanOptions, promised_region
from stablepush.planning.problem import PlanningProblem, require_problem
from stablepush.planning.pusher_loads import require_loads
from stablepush.planning.result import PlanResult, Transfer
from stablepush.planning.search import Planner, Search

#: Probability of success that is looked for by default: the quickest plans lie on the edge of the stable set, and the least error
#: of surface or friction makes them lose the object.
DEFAULT_SUCCESS = 0.98
_GROUP = "stablepush.planners"
#: Time (s) that is kept of the limit to check a plan and estimate its success, at most a quarter of it: 0.2 to 0.5 were measured.
_JUDGING = 0.5
#: What may make plans more likely to succeed.
_MORE_TIME = "the time limit ended the search, with more time it may find a surer one"
_MORE_LIKELY = "fingers farther apart, another contact, wider bounds or a better known surface (more pokes) may give a surer one"
#: Unit twists that are so near to a region are in it but for rounding.
_LAST = 1e-6
#: A vertex is a corner if the outline turns there by more than this (rad).
_CORNER = math.radians(20)


def planner_names() -> list[str]:
    """Return the names of all installed planners."""
    return plugin_names(_GROUP)


def plan(  # noqa: PLR0913
    problem: PlanningProblem,
    planner: str = "cor-lattice",
    time_limit: float = 30.0,
    seed: int | None = None,
    *,
    success: float = DEFAULT_SUCCESS,
    require_success: float = 0.0,
    region: str = "model",
    margin_weight: float = 0.0,
    max_twist_rate: float = math.inf,
    refinement_budget: float = 20_000,
    clearance: float | None = None,
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
        Wall time in s. Near its end the planner stops, with the best plan found or the status ``"timeout"``. What the first plan
        after an install spends on building compiled code does not count.
    seed : int, optional
        Seed of planners that draw random numbers; 0 if not given.
    success : float, optional
        Wanted probability that the slider sticks to the pusher over the whole path, given the likely surfaces and
        ``problem.uncertainty`` together. If no plan reaches it, the most probable one found is returned with a
        :class:`~stablepush.PlanWarning`. 0 gives the quickest plan. A surface that is no limit surface (a Gaussian process) has
        no such probability: its plan is the quickest.
    require_success : float
        Plans that are less likely to succeed are rejected: the status is ``"no-path"``.
    region, margin_weight
        What each push must be besides, or cost: see :class:`PlanOptions`.
    max_twist_rate, refinement_budget
        How gradual and how good the plan is to be: see :class:`PlanOptions`.
    clearance : float, optional
        Least distance (m) of slider and pusher from obstacles all along the path; 0: they may touch. If not given: 0.005 if such
        a plan is found that takes at most 5 % longer than one that may touch, else 0. Obstacles that are nearer to the start or
        the goal are kept away from as far as those are. No probability counts collisions, and a real object is never quite
        where it is believed to be. Plans with ``refinement_budget=0`` or ``success=0`` may touch.
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
    require_problem(problem)
    limit = check_number(time_limit, "time_limit", at_least=0.0)
    least = check_share(require_success, "require_success")
    level = max(least, check_share(success, "success"))
    if least > 0 and not problem.surface.is_dual:
        kind = type(problem.surface).__name__
        raise InputError("require_success", f"expected 0: plans of a {kind} have no probability of success", f"{least:g}")
    options = PlanOptions(region, margin_weight, max_twist_rate, refinement_budget)
    run = _planner(planner)
    problem = problem.with_clearance(clearance or 0.0)
    _require_known(problem, region)
    number = 0 if seed is None else check_seed(seed)
    search = Search(planner, run, options, level, clearance or 0.0, number, progress)
    with within(limit - min(_JUDGING, limit / 4), stop) as deadline:
        if clearance is None and level and refinement_budget and problem.obstacles:
            result, held_in, doubtful, remark = keep_away(problem, search, deadline)
        else:
            result, held_in, doubtful, remark = search(problem, deadline, search_budget=math.inf)
        if deadline.stopped and not result.solved:
            result = PlanResult("interrupted", planner, seed=number, message="stopped before a path was found")
        hint = _MORE_TIME if deadline.passed() and not deadline.stopped else _MORE_LIKELY
    result, doubts = _judged(problem, result, region, level, least, held_in, hint)
    if result.lower_bound is not None and clearance:
        # it is that of the larger obstacles
        result = replace(result, lower_bound=None)
    if result.solved:
        assumed = _assumptions(problem) if region != "model" else ""
        doubts = [*doubtful, *doubts, *_unaligned(problem, result), *_near_ends(problem, result)]
        if doubts:
            warnings.warn(PlanWarning("; ".join(doubts)), stacklevel=2)
        result = replace(result, message="; ".join(filter(None, (result.message, remark, assumed, *doubts))))
    return replace(result, planning_time=time.perf_counter() - started)


def _planner(name: str) -> Planner:
    """Return the planner of that name, which another package may have registered."""
    try:
        run: Planner = load_plugin(_GROUP, name)
    except LookupError:
        names = planner_names()
        raise InputError(
            "planner", f"expected one of {', '.join(names) or 'none installed'}", f"{name!r}{did_you_mean(name, names)}"
        ) from None
    _require_signature(run, name)
    return run


def _require_known(problem: PlanningProblem, region: str) -> None:
    """Refuse what no plan can take into account, and guarantees that are not known for what acts."""
    problem.require_plannable()
    require_loads(problem)
    if problem.acting_effects and region != "model":
        acting = ", ".join(problem.acting_effects)
        raise InputError("region", f"expected model: no guarantee is known under the effect {acting}", repr(region))
    if problem.alternatives and region != "model":
        raise InputError("region", "expected model: a guarantee knows no alternatives of the rig", repr(region))


def _judged(
    problem: PlanningProblem, result: PlanResult, region: str, level: float, least: float, held: float, hint: str
) -> tuple[PlanResult, list[str]]:
    """A plan as the check and scenarios that no choice was made on judge it, and what is doubtful of it.

    ``region``: what was asked of each push; ``level``, ``least``: the probabilities of success that are looked for and required;
    ``held``: what the search held; ``hint``: what may help where that is too little.
    """
    if not result.solved:
        return result, []
    objection = _objection(problem, result) or _outside(problem, result, region)
    if objection:
        return PlanResult("rejected", result.planner, seed=result.seed, message=objection), []
    if not problem.surface.is_dual:
        return result, []
    result = _with_success(problem, result)
    probability = result.success_probability or 0.0
    # rounded down: 0.9998 is not 1
    stated = f"{math.floor(1e4 * probability) / 1e4:g}"
    if probability < least:
        words = f"the most probable plan found succeeds with probability {stated}, {least:g} is required: {hint}"
        return PlanResult("no-path", result.planner, seed=result.seed, message=words), []
    if max(held, probability) < level:
        words = f"no plan was found that succeeds with probability {level:g}; this one does with {stated}: {hint}"
        return result, [words]
    return result, []


def _require_signature(run: Planner, name: str) -> None:
    """Refuse what another package registered and is no planner."""
    try:
        inspect.signature(run).bind(None, deadline=None, seed=0, options=None, progress=None)
    except (TypeError, ValueError):
        words = "expected a function f(problem, *, deadline, seed, options, progress)"
        raise UnavailableError(f"planner {name}: {words}, got {getattr(run, '__name__', type(run).__name__)}") from None


def _unaligned(problem: PlanningProblem, result: PlanResult) -> list[str]:
    """What is doubtful of changes of contact where the start is uncertain."""
    docked = sorted({segment.target for segment in result.segments if isinstance(segment, Transfer)})
    left = [number for number in docked if any(problem.uncertainty.start) and not aligns(problem.contacts[number])]
    why = "it does not have two fingers on one normal"
    return [f"the start is uncertain, and contact {number} does not align the slider: {why}" for number in left]


def _near_ends(problem: PlanningProblem, result: PlanResult) -> list[str]:
    """Which contacts have a finger that may be off the end of its edge: success takes it to touch all the same."""
    found: list[str] = []
    # a vertex in the middle of a side is no end of it
    sides = np.diff(problem.slider.vertices, axis=0, append=problem.slider.vertices[:1])
    headings = np.arctan2(sides[:, 1], sides[:, 0])
    corners = problem.slider.vertices[np.abs(wrap_angle(headings - np.roll(headings, 1))) > _CORNER]
    if not len(corners):
        return found
    for number in sorted({push.contact for push in result.pushes}):
        points = problem.contacts[number].points
        left = float(np.linalg.norm(points[:, None] - corners, axis=2).min())
        if left < problem.uncertainty.contact_place:
            found.append(
                f"contact {number}: a finger is {1000 * left:.2g} mm from a corner and may be "
                f"{1000 * problem.uncertainty.contact_place:.2g} mm aside; the success holds if it stays on its edge"
            )
    return found


def _assumptions(problem: PlanningProblem) -> str:
    """What a plan of motions that hold for every pressure takes for granted."""
    ranges = [problem.uncertainty.friction_range(contact.mu) for contact in problem.contacts]
    low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
    return (
        f"stable for every pressure under the slider, contact friction from {low:.3g} to {high:.3g}, and fingers up to "
        f"{1000 * problem.uncertainty.contact_place:.3g} mm off along their edge; the centre of mass, the outline and the start "
        "under the pusher are assumed exact"
    )


def _with_success(problem: PlanningProblem, result: PlanResult) -> PlanResult:
    """A plan with what scenarios that no choice was made on say of it."""
    found = estimate_success(problem, result, seed=result.seed)
    return replace(
        result,
        success_probability=found.probability,
        success_interval=found.interval,
        arrival_probability=found.arrival,
        arrival_interval=found.arrival_interval,
        success=found,
    )


def _outside(problem: PlanningProblem, result: PlanResult, region: str) -> str:
    """Which push of a plan is clearly not in the region that was asked for; empty if none is. A planner of another package may
    not know of it."""
    for number in sorted({push.contact for push in result.pushes}):
        promised = promised_region(problem, number, region)
        for k, push in enumerate(result.pushes):
            if promised is None or push.contact != number:
                continue
            twist = unit(normalize_twist(push.twist, problem.surface.characteristic_length))
            near = np.concatenate((twist[None], twist + _LAST * np.eye(3), twist - _LAST * np.eye(3)))
            near[:, 2] /= problem.surface.characteristic_length
            if not promised.contains_twists(near).any():
                return f"push {k + 1} is not in the region that was asked for, {region}"
    return ""


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
