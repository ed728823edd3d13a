"""How likely a plan is to succeed, measured on scenarios: whether the slider sticks throughout, and where it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from stablepush.core import BoolArray, FloatArray, StablepushError, binomial_interval
from stablepush.geometry import compose, inverse, transform_points, transport_twist, wrap_angle
from stablepush.mechanics import Pusher, simulate_push
from stablepush.objects import Slider
from stablepush.planning.alignment import STEP, about
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult, Push
from stablepush.planning.scenarios import Scenarios, across_of, draw_scenarios
from stablepush.stability import BOUNDARY_SLACK
from stablepush.surfaces import LimitSurface

#: Scenarios that a stated probability is measured on.
SCENARIOS = 2000
#: Scenarios that lose the slider of which the end is simulated: the others are taken to end like these.
_SIMULATED = 40
#: What may be left (m) of an uncertain start along the normal of a later contact: no push aligns the slider there.
_NEAR = 1e-3

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Success:
    """What scenarios say of a plan.

    Attributes
    ----------
    probability, interval
        That the slider sticks to the pusher throughout, with its 95 % interval (Clopper and Pearson).
    arrival, arrival_interval
        That its final pose is within the tolerance of the goal: a slider that slips may arrive, one that sticks may have started
        aside.
    failures : sequence of (push, share, cause)
        Where it is lost first: number of the push from 0, share of all scenarios, and of what; the most frequent first.
    ends : array, shape (m, 3)
        Final poses in W of the scenarios that lose the slider and were simulated.
    counts : tuple of int
        Scenarios, those that stick, those that stick and arrive, and those that slip, were simulated and arrive.
    """

    probability: float
    interval: Interval
    arrival: float
    arrival_interval: Interval
    failures: tuple[tuple[int, float, str], ...]
    ends: FloatArray
    counts: tuple[int, int, int, int]

    def intervals(self, level: float) -> tuple[Interval, Interval]:
        """Return the intervals of both probabilities at a level.

        Not all slips are simulated: what that leaves open of the arrival adds in quadrature.
        """
        total, stuck, _, rescued = self.counts
        lost, simulated = total - stuck, len(self.ends)
        low, high = binomial_interval(round(self.arrival * total), total, level)
        if lost > simulated:
            share, (least, most) = rescued / simulated, binomial_interval(rescued, simulated, level)
            low = self.arrival - math.hypot(self.arrival - low, lost / total * (share - least))
            high = self.arrival + math.hypot(high - self.arrival, lost / total * (most - share))
        return binomial_interval(stuck, total, level), (max(low, 0.0), min(high, 1.0))


def estimate_success(problem: PlanningProblem, result: PlanResult, count: int = SCENARIOS, seed: int = 0) -> Success:
    """Return how likely a plan is to succeed, on scenarios of its own (``seed``).

    All of ``problem.uncertainty`` and the likely surfaces count together, over the whole path.
    """
    scenarios = draw_scenarios(problem, count, seed, stream=2, first=result.pushes[0])
    lost, margins = first_losses(scenarios, result)
    sticks = lost < 0
    arrives = np.zeros(count, dtype=bool)
    arrives[sticks] = _near_goal(problem, _aside(problem, result, scenarios.take(sticks)))
    failed = np.flatnonzero(~sticks)
    ends = np.array([_end(scenarios, row, result, int(lost[row])) for row in failed[:_SIMULATED]]).reshape(-1, 3)
    rescued = _near_goal(problem, ends)
    arriving = int(arrives.sum()) + (len(failed) * rescued.mean() if len(rescued) else 0.0)
    counts = (count, int(sticks.sum()), int(arrives.sum()), int(rescued.sum()))
    shares, whole = (float(sticks.mean()), float(arriving / count)), (0.0, 1.0)
    found = Success(shares[0], whole, shares[1], whole, _failures(scenarios, result, lost, margins), ends, counts)
    sticking, arrival = found.intervals(0.95)
    return replace(found, interval=sticking, arrival_interval=arrival)


def first_losses(scenarios: Scenarios, result: PlanResult) -> tuple[np.ndarray, FloatArray]:
    """Return the number (n,) of the first push that each scenario does not hold, -1 if it holds all, and all margins (n, k)."""
    pushes = result.pushes
    margins = np.empty((len(scenarios), len(pushes)))
    for number in {push.contact for push in pushes}:
        at = [k for k, push in enumerate(pushes) if push.contact == number]
        margins[:, at] = scenarios.margins(number, np.array([pushes[k].twist for k in at]))
    slips = margins < -BOUNDARY_SLACK
    slips[:, 0] |= ~scenarios.flush
    for k, push in enumerate(pushes):
        # another contact meets the slider nearer or farther than planned by what is left along its normal
        if push.contact != pushes[0].contact:
            normal = scenarios.problem.contacts[push.contact].normals.mean(axis=0)
            slips[:, k] |= np.abs(scenarios.start[:, :2] @ normal) > _NEAR
    return np.where(slips.any(axis=1), slips.argmax(axis=1), -1), margins


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


def _end(scenarios: Scenarios, row: int, result: PlanResult, first: int) -> FloatArray:
    """Final pose (3,) of B where the slider slips: the pusher goes where the plan has it, in the open."""
    problem, center = scenarios.problem, scenarios.center_of_mass[row]
    offset = np.array((*center, 0.0))
    surface = scenarios.surfaces[scenarios.surface[row]]
    # the surface is about the true centre of mass
    slider = about(problem.slider, center)
    at, pushes = result.pushes[first].start, result.pushes[first:]
    left, last = scenarios.start[row, :2], result.pushes[-1]
    aside = np.zeros(2)
    if scenarios.flush[row]:
        # it stands where the plan has it and the fingers are aside: in truth the fingers are where the plan has them
        across = across_of(problem.contacts[last.contact])
        aside = (left @ across) * transform_points((0.0, 0.0, last.end[2]), across[None])[0]
    else:
        # where its first push left it, and the fingers where the tool has them
        acrosses = np.stack([across_of(contact) for contact in problem.contacts], axis=1)
        scenarios = replace(scenarios, place=scenarios.place + scenarios.start[:, :2] @ acrosses)
        at, pushes = compose(pushes[0].end, scenarios.start[row]), pushes[1:]
    pose = compose(at, offset)
    for push in pushes:
        pose = _pushed(scenarios, row, surface, slider, push, pose)
    end = compose(pose, inverse(offset))
    return np.array((*(end[:2] + aside), end[2]))


def _pushed(scenarios: Scenarios, row: int, surface: LimitSurface, slider: Slider, push: Push, pose: FloatArray) -> FloatArray:
    """Pose (3,) of the slider about its centre of mass after a push."""
    contact = scenarios.contact(row, push.contact)
    if len(contact.points) > 2:
        # what slides past so many fingers is not simulated: it counts as lost where it lies
        return pose
    pusher = Pusher.of_contact(contact, scenarios.problem.finger_radius)
    docked = pusher.docked(contact)
    motion = [(transport_twist(push.twist, inverse(docked)), push.duration)]
    try:
        trace = simulate_push(
            surface, slider, pusher, contact.mu, pose, compose(push.start, docked), motion, step=STEP * slider.radius
        )
    except StablepushError:
        # the pusher would land on the slider: it is lost where it lies
        return pose
    return trace.poses[-1]


def _failures(
    scenarios: Scenarios, result: PlanResult, lost: np.ndarray, margins: FloatArray
) -> tuple[tuple[int, float, str], ...]:
    numbers, counts = np.unique(lost[lost >= 0], return_counts=True)
    found = []
    for k in np.argsort(-counts, kind="stable"):
        rows = np.flatnonzero(lost == numbers[k])
        found.append((int(numbers[k]), float(counts[k] / len(lost)), _cause(scenarios, result.pushes[numbers[k]], rows)))
    return tuple(found)


def _cause(scenarios: Scenarios, push: Push, rows: np.ndarray) -> str:
    """What the scenarios that lose the slider in a push have in common: what differs most from the other scenarios."""
    everything = {
        "contact friction": (scenarios.contact_mu[:, push.contact], ""),
        "fingers": (1000 * scenarios.place[:, push.contact], " mm aside"),
        "centre of mass, x": (1000 * scenarios.center_of_mass[:, 0], " mm"),
        "centre of mass, y": (1000 * scenarios.center_of_mass[:, 1], " mm"),
    }
    if 2 * np.count_nonzero(~scenarios.flush[rows]) > len(rows):
        return "the slider is not square to the fingers after the first push"
    if len(rows) > 0.9 * len(scenarios):
        return "nearly every scenario"
    best, words = 0.0, "another limit surface"
    for name, (values, unit_of) in everything.items():
        scatter = float(values.std())
        shift = (float(values[rows].mean()) - float(values.mean())) / scatter if scatter > 0 else 0.0
        if abs(shift) > max(best, 0.7):
            end = values[rows].max() if shift < 0 else values[rows].min()
            best, words = abs(shift), f"{name} {'below' if shift < 0 else 'above'} {end:.3g}{unit_of}"
    return words
