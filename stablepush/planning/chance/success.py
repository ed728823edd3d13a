"""How likely a plan is to succeed, measured on scenarios: whether the slider sticks throughout, and where it ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.geometry import compose, exp, inverse, transform_points, transport_twist, wrap_angle
from stablepush.mechanics import Pusher, TableFriction, final_poses
from stablepush.planning.chance.scenarios import Scenarios, across_of, draw_scenarios
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.pusher_loads import steps_along
from stablepush.planning.result import PlanResult, Push, Success
from stablepush.stability import BOUNDARY_SLACK
from stablepush.surfaces import LimitSurface

#: Scenarios that a stated probability is measured on.
SCENARIOS = 2000
#: Scenarios that lose the slider of which the end is simulated: the others are taken to end like these. A share of all, within
#: bounds: of few that are lost, few say as much about the arrival.
_SIMULATED, _FEWEST, _MOST = 400, 6, 24
#: Longest travel of a finger in a step of these simulations, in radii of the slider: coarser than where a docking is simulated.
_STEP = 1 / 12

#: So many scenarios that lose the slider say why; and a limit that so many of all scenarios are beyond does not.
_TELLING, _MOST_BEYOND = 20, 0.25


def estimate_success(problem: PlanningProblem, result: PlanResult, count: int = SCENARIOS, seed: int = 0) -> Success:
    """Return how likely a plan is to succeed, on scenarios of its own (``seed``).

    All of ``problem.uncertainty`` and the likely surfaces count together, over the whole path.
    """
    losses = first_losses(draw_scenarios(problem, count, seed, stream=2), result)
    sticks = losses.push < 0
    arrives = np.zeros(count, dtype=bool)
    arrives[sticks] = _near_goal(problem, _aside(problem, result, losses.stretches[-1].scenarios.take(sticks)))
    failed = np.flatnonzero(~sticks)
    simulated = int(np.clip(_SIMULATED * len(failed) / count, _FEWEST, _MOST))
    ends = _ends(losses, failed[:simulated], result)
    rescued = _near_goal(problem, ends)
    arriving = int(arrives.sum()) + (len(failed) * rescued.mean() if len(rescued) else 0.0)
    counts = (count, int(sticks.sum()), int(arrives.sum()), int(rescued.sum()))
    shares, whole = (float(sticks.mean()), float(arriving / count)), (0.0, 1.0)
    found = Success(shares[0], whole, shares[1], whole, _failures(losses, result), ends, counts)
    sticking, arrival = found.intervals(0.95)
    return replace(found, interval=sticking, arrival_interval=arrival)


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """Pushes of a plan between two dockings of the pusher, ``first`` to before ``after``, and the scenarios as they are there."""

    first: int
    after: int
    scenarios: Scenarios


@dataclass(frozen=True, slots=True, eq=False)
class Losses:
    """Where scenarios lose the slider: the number ``push`` (n,) of the first push that a scenario does not hold, -1 if it holds
    all, and all margins (n, k)."""

    push: np.ndarray
    margins: FloatArray
    stretches: tuple[_Stretch, ...]

    def at(self, push: int) -> Scenarios:
        """Return the scenarios as they are during a push."""
        return next(stretch.scenarios for stretch in self.stretches if push < stretch.after)


def first_losses(drawn: Scenarios, result: PlanResult) -> Losses:
    """Return where scenarios, as :func:`draw_scenarios` gives them, lose the slider.

    Where the start is uncertain, the first push after each docking is simulated: it leaves the slider elsewhere.
    """
    pushes = result.pushes
    firsts = [0]
    if any(drawn.problem.uncertainty.start):
        firsts += [k for k in range(1, len(pushes)) if pushes[k].contact != pushes[k - 1].contact]
    margins, slips, stretches = np.empty((len(drawn), len(pushes))), np.zeros((len(drawn), len(pushes)), dtype=bool), []
    for first, after in pairwise((*firsts, len(pushes))):
        if any(drawn.problem.uncertainty.start):
            drawn = drawn.after(pushes[first])
        stretches.append(_Stretch(first, after, drawn))
        for number in {push.contact for push in pushes[first:after]}:
            at = [k for k in range(first, after) if pushes[k].contact == number]
            margins[:, at] = _margins(drawn, number, [pushes[k] for k in at])
        slips[:, first] |= ~drawn.flush
    slips |= margins < -BOUNDARY_SLACK
    return Losses(np.where(slips.any(axis=1), slips.argmax(axis=1), -1), margins, tuple(stretches))


def _margins(drawn: Scenarios, number: int, pushes: Sequence[Push]) -> FloatArray:
    """Margins (n, k) of pushes at a contact: the least along each arc, where effects make it depend on the pose."""
    twists = np.array([push.twist for push in pushes])
    if not drawn.loads:
        return drawn.margins(number, twists)
    counts = [steps_along(push, drawn.problem.slider.radius) + 1 for push in pushes]
    shares = [np.linspace(0.0, push.duration, count)[:, None] for push, count in zip(pushes, counts, strict=True)]
    poses = [compose(push.start, exp(push.twist * times)) for push, times in zip(pushes, shares, strict=True)]
    along = drawn.margins(number, np.repeat(twists, counts, axis=0), np.concatenate(poses))
    return np.asarray(np.minimum.reduceat(along, np.cumsum([0, *counts[:-1]]), axis=1))


def _aside(problem: PlanningProblem, result: PlanResult, scenarios: Scenarios) -> FloatArray:
    """Final poses (n, 3) of a slider that sticks: the planned one, but for what is left along the edge of an uncertain start."""
    last = result.pushes[-1]
    across = across_of(problem.contacts[last.contact])
    offset = (scenarios.start[:, :2] @ across)[:, None] * across
    return compose(last.end, np.column_stack((offset, np.zeros(len(offset)))))


def _near_goal(problem: PlanningProblem, poses: FloatArray) -> BoolArray:
    away = np.hypot(*(poses[:, :2] - problem.goal[:2]).T)
    turned = np.abs(wrap_angle(poses[:, 2] - problem.goal[2]))
    return np.asarray((away <= problem.tolerance[0] + 1e-6) & (turned <= problem.tolerance[1] + 1e-6))


def _ends(losses: Losses, rows: np.ndarray, result: PlanResult) -> FloatArray:
    """Final poses (n, 3) of B where the slider slips: the pusher goes where the plan has it, in the open."""
    ends = np.empty((len(rows), 3))
    for first in np.unique(losses.push[rows]):
        scenarios = losses.at(int(first))
        for flush in (True, False):
            chosen = np.flatnonzero((losses.push[rows] == first) & (scenarios.flush[rows] == flush))
            if len(chosen):
                ends[chosen] = _ends_from(scenarios.take(rows[chosen]), result.pushes[first:], flush)
    return ends


def _ends_from(scenarios: Scenarios, pushes: Sequence[Push], flush: bool) -> FloatArray:
    """Final poses (n, 3) of B of scenarios that lose the slider in the first of some pushes."""
    problem, start = scenarios.problem, scenarios.start
    across = across_of(problem.contacts[pushes[-1].contact])
    beside = np.zeros(2)
    if flush:
        # it stands where the plan has it and the fingers are aside: in truth the fingers are where the plan has them
        poses, aside = np.tile(pushes[0].start, (len(scenarios), 1)), scenarios.aside
        beside = (start[:, :2] @ across)[:, None] * transform_points((0.0, 0.0, pushes[-1].end[2]), across[None])
    else:
        # where the first push after the docking left it, and the fingers where the tool has them
        poses, aside, pushes = compose(pushes[0].end, start), scenarios.place, pushes[1:]
    for number, group in groupby(pushes, key=lambda push: push.contact):
        poses = _pushed(scenarios, number, list(group), poses, aside[:, number])
    return np.column_stack((poses[:, :2] + beside, poses[:, 2]))


def _pushed(scenarios: Scenarios, number: int, pushes: Sequence[Push], poses: FloatArray, aside: FloatArray) -> FloatArray:
    """Poses (n, 3) of B after pushes at a contact whose fingers are ``aside`` (n,) in m."""
    problem, contact = scenarios.problem, scenarios.problem.contacts[number]
    if len(contact.points) > 2:
        # what slides past so many fingers is not simulated: it counts as lost where it lies
        return poses
    pusher = Pusher.of_contact(contact, problem.finger_radius)
    docked = pusher.docked(contact)
    away = inverse(docked)
    ends = final_poses(
        _tables(scenarios) if scenarios.loads else scenarios.surfaces,
        scenarios.surface,
        problem.slider,
        pusher,
        scenarios.contact_mu[:, number],
        poses,
        compose(pushes[0].start, docked),
        [(transport_twist(push.twist, away), push.duration) for push in pushes],
        aside=aside,
        centers_of_mass=scenarios.center_of_mass,
        step=_STEP * problem.slider.radius,
    )
    # where the pusher would land on the slider it is lost where it lies
    return np.where(np.isnan(ends), poses, ends)


def _tables(scenarios: Scenarios) -> list[LimitSurface | TableFriction]:
    """Friction with the effects, of the surfaces that scenarios have."""
    found: list[LimitSurface | TableFriction] = list(scenarios.surfaces)
    for member in np.unique(scenarios.surface):
        found[member] = scenarios.loads[member].table(scenarios.surfaces[member])
    return found


def _failures(losses: Losses, result: PlanResult) -> tuple[tuple[int, float, str], ...]:
    lost = losses.push
    numbers, counts = np.unique(lost[lost >= 0], return_counts=True)
    found = []
    for k in np.argsort(-counts, kind="stable"):
        number = int(numbers[k])
        cause = _cause(losses.at(number), result.pushes[number], np.flatnonzero(lost == number))
        found.append((number, float(counts[k] / len(lost)), cause))
    return tuple(found)


def _cause(scenarios: Scenarios, push: Push, rows: np.ndarray) -> str:
    """What the scenarios that lose the slider in a push have in common: what differs most from the other scenarios."""
    everything = {
        ("a contact friction {side} {end:.3g}", "low contact friction", "high contact friction"):
            scenarios.contact_mu[:, push.contact],
        (
            "the fingers more than {more:.3g} mm to the {way} of their place, seen along the push",
            "the fingers to the right of their place, seen along the push",
            "the fingers to the left of their place, seen along the push",
        ): 1000 * scenarios.aside[:, push.contact],
        ("x of the centre of mass {side} {end:.3g} mm", "a small x of the centre of mass", "a large x of the centre of mass"):
            1000 * scenarios.center_of_mass[:, 0],
        ("y of the centre of mass {side} {end:.3g} mm", "a small y of the centre of mass", "a large y of the centre of mass"):
            1000 * scenarios.center_of_mass[:, 1],
    }  # fmt: skip
    if 2 * np.count_nonzero(~scenarios.flush[rows]) > len(rows):
        return "because the slider is not square to the fingers after the docking"
    if len(rows) > 0.9 * len(scenarios):
        return "in nearly every scenario"
    if len(rows) < _TELLING:
        return "too rarely to say why"
    best, words = 0.0, "by several uncertainties together"
    for (limit, low, high), values in everything.items():
        scatter = float(values.std())
        shift = (float(values[rows].mean()) - float(values.mean())) / scatter if scatter > 0 else 0.0
        if abs(shift) <= max(best, 0.7):
            continue
        best = abs(shift)
        end = float(values[rows].max() if shift < 0 else values[rows].min())
        beyond = float((values <= end).mean() if shift < 0 else (values >= end).mean())
        side, way, more = ("below", "right", -end) if shift < 0 else ("above", "left", end)
        # a limit that many scenarios are beyond without loss says little
        if beyond > _MOST_BEYOND:
            words = f"mostly with {low if shift < 0 else high}"
        else:
            words = "always with " + limit.format(side=side, way=way, end=end, more=more)
    return words
