"""Which scenarios a plan is to hold in, and the pushes that are stable in all of them.

A plan whose pushes are stable in all of a chosen set of scenarios sticks in each of them, whatever its number of pushes: scenario
optimisation with discarded constraints (Campi and Garatti, 2011). A chosen set is optimistic about itself; what it is worth is
measured on scenarios that no choice was made on (:mod:`stablepush.planning.chance.success`).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from stablepush.core import BoolArray, Deadline, FloatArray
from stablepush.geometry import normalize_wrench, unit
from stablepush.planning.chance.scenarios import Scenarios, alignment_push, draw_scenarios
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.pusher_loads import PushLoads, loads_of
from stablepush.stability import BOUNDARY_SLACK, Case, StabilityOracle, StableRegion, common_region

#: Scenarios that a choice is made among, and the most that are drawn for one.
CHOICE, MOST = 300, 900
#: Unit twists at which scenarios are compared, before those that the nominal surface calls unstable are left out, and after.
_TWISTS, _COMPARED = 4000, 160
#: Rounds of adding the scenarios that the polygons of the others violate by more than this angle (rad), how many each, and which
#: corner of the polygons is asked: one of so many, corners are dense.
_ROUNDS, _VIOLATION, _ADDED, _THINNED = 6, 1e-4, 6, 7
#: Polygons begin with the scenarios that are the worst for one in so many of the compared twists: those nearest to the bound.
_NEAREST = 3


class Choice:
    """Which scenarios a plan is to hold in, and the motions that are stable in all of them.

    Scenarios are left out one by one: those that alone rule out the most of the compared motions. The same are left out for all
    contacts. What one choice worked out serves the next.
    """

    def __init__(self, problem: PlanningProblem, seed: int) -> None:
        drawn = draw_scenarios(problem, MOST, seed)
        if any(problem.uncertainty.start):
            drawn = drawn.after(alignment_push(problem))
        # no push holds a slider that is not flush
        self._all = drawn.take(drawn.flush) if drawn.flush.any() else drawn
        self._problem = problem
        self._contacts = range(len(problem.contacts))
        self._compared: dict[int, FloatArray] = {}
        self._margins: dict[int, FloatArray] = {}
        self._cases: dict[tuple[int, int], Case] = {}

    def regions(self, count: int, left_out: int, deadline: Deadline, used: Collection[int]) -> list[StableRegion | None]:
        """Return for each contact the motions that are stable in all of the first ``count`` scenarios but some.

        ``used``: contacts that count; the others have none, and no scenario is left out for their sake. Raises
        :class:`OutOfTimeError` when the deadline passes; what is known by then serves the next.
        """
        count = min(count, len(self._all))
        mine = sorted(used)
        for number in mine:
            deadline.check()
            self._compare(number, count)
        table = np.concatenate([self._margins[number][:count] for number in mine], axis=1)
        kept = _kept(table < -BOUNDARY_SLACK, min(left_out, count - 1))
        found: list[StableRegion | None] = [None] * len(self._contacts)
        for number in mine:
            deadline.check()
            found[number] = self._region(kept, number)
        return found

    def _compare(self, number: int, count: int) -> None:
        """Work out the margins (count, k) of a contact at the compared twists, as far as they are not known."""
        if number not in self._compared:
            self._compared[number] = _compared(self._problem, number)
            self._margins[number] = np.empty((0, len(self._compared[number])))
        known = self._margins[number]
        new = self._all.take(np.arange(len(known), max(count, len(known))))
        if len(new):
            more = new.margins(number, self._compared[number]) if known.shape[1] else np.empty((len(new), 0))
            self._margins[number] = np.concatenate((known, more))

    def _region(self, kept: np.ndarray, number: int) -> StableRegion:
        """The exact common region of a contact, from the scenarios that bound it: others are added while it violates them."""
        chosen, margins = self._all.take(kept), self._margins[number][kept]
        # those that come nearest to ruling out what is compared, or just do
        nearest = np.argsort(np.abs(margins.min(axis=0)), kind="stable")[: math.ceil(margins.shape[1] / _NEAREST)]
        active = list(dict.fromkeys(np.argmin(margins[:, nearest], axis=0).tolist())) if margins.shape[1] else [0]
        # a region that a scenario holds whole shrinks when others are added: it is not asked again
        doubtful = np.arange(len(kept))
        name, known = f"{len(kept)} scenarios", set(active)
        region = common_region([self._case(int(kept[row]), number) for row in active], name)
        for _ in range(_ROUNDS):
            ends = [np.array((np.cos(a), np.sin(a), 0.0))[None] for interval in region.translation_intervals for a in interval]
            rings = [ring[::_THINNED] for sense in (1, -1) for ring in region.boundary_twists(sense)]
            border = np.concatenate([*rings, *ends, np.zeros((0, 3))])
            if not (len(border) and len(doubtful)):
                break
            worst = chosen.take(doubtful).margins(number, border).min(axis=1)
            order = [k for k in np.argsort(worst, kind="stable") if worst[k] < -_VIOLATION and doubtful[k] not in known]
            if not order:
                break
            active = doubtful[order[:_ADDED]].tolist()
            region = common_region([self._case(int(kept[row]), number) for row in active], name, region)
            known.update(active)
            doubtful = doubtful[order[_ADDED:]]
        return region

    def _case(self, row: int, number: int) -> Case:
        if (row, number) not in self._cases:
            surface = self._all.surfaces[self._all.surface[row]]
            self._cases[row, number] = Case(surface, self._all.contact(row, number), self._all.center_of_mass[row])
        return self._cases[row, number]


class ArcChoice:
    """As :class:`Choice`, where effects make the stable pushes depend on heading and place.

    Scenarios are compared on pushes at headings of all kinds. Those that come first to rule out any of them stand for the others.
    """

    def __init__(self, problem: PlanningProblem, seed: int) -> None:
        drawn = draw_scenarios(problem, MOST, seed)
        self._all, self._contacts, self._problem = drawn, range(len(problem.contacts)), problem
        self._margins: dict[int, FloatArray] = {}

    def regions(self, count: int, left_out: int, deadline: Deadline, used: Collection[int]) -> list[ArcSet | None]:
        """Return pushes of each contact that are stable in the first ``count`` scenarios but some, as :class:`Choice` does."""
        count, mine = min(count, len(self._all)), sorted(used)
        for number in mine:
            deadline.check()
            if number not in self._margins:
                twists, poses = _compared_at(self._problem, number)
                self._margins[number] = self._all.margins(number, twists, poses)
        table = np.concatenate([self._margins[number][:count] for number in mine], axis=1)
        kept = _kept(table < -BOUNDARY_SLACK, min(left_out, count - 1))
        return [self._set(kept, number) if number in mine else None for number in self._contacts]

    def _set(self, kept: np.ndarray, number: int) -> ArcSet:
        margins = self._margins[number][kept]
        nearest = np.argsort(np.abs(margins.min(axis=0)), kind="stable")[: math.ceil(margins.shape[1] / _NEAREST)]
        first = list(dict.fromkeys(np.argmin(margins[:, nearest], axis=0).tolist())) if margins.shape[1] else [0]
        return ArcSet(self._all.take(kept[first]), number)


@dataclass(frozen=True, eq=False)
class ArcSet:
    """Pushes of a contact that are stable in all of some scenarios, all along their arcs."""

    scenarios: Scenarios
    number: int

    def contains_pushes(self, twists: FloatArray, headings: FloatArray) -> BoolArray:
        """Return whether body twists (n, 3) in m/s and rad/s, from ``headings[:, 0]`` by ``headings[:, 1]`` (rad), are in it."""
        good = np.ones(len(twists), dtype=bool)
        drawn = self.scenarios
        of_row = [drawn.loads[member] for member in drawn.surface]
        for loads in dict.fromkeys(of_row):
            rows = np.flatnonzero([mine is loads for mine in of_row])
            chosen = np.flatnonzero(good)
            if not len(chosen):
                break
            extra = self._extra(loads, rows, twists[chosen])
            least = np.full(len(rows), -BOUNDARY_SLACK)
            good[chosen] = loads.are_stable(twists[chosen], headings[chosen], extra, drawn.facets(self.number)[rows], least)
        return good

    def _extra(self, loads: PushLoads, rows: np.ndarray, twists: FloatArray) -> FloatArray:
        """What the surfaces of scenarios (k,) have more than the nominal one, (n, k, 3)."""
        drawn, result = self.scenarios, np.empty((len(twists), len(rows), 3))
        nominal = loads.newtons * loads.surface.wrench(twists)
        for member in np.unique(drawn.surface[rows]):
            mine = np.flatnonzero(drawn.surface[rows] == member)
            result[:, mine] = drawn.surface_loads(int(member), rows[mine], twists).transpose(1, 0, 2)
        return result - nominal[:, None, :]


def _compared_at(problem: PlanningProblem, number: int) -> tuple[FloatArray, FloatArray]:
    """Body twists (k, 3) at the speed limit and poses (k, 3), at which the nominal load is within the cone of a contact."""
    loads = loads_of(problem)
    assert loads is not None
    rng = np.random.default_rng(0)
    spread = rng.normal(size=(_TWISTS, 3))
    spread[::8, 2] = 0.0
    twists = unit(spread) / (1.0, 1.0, loads.rho)
    twists = twists * (problem.speed / problem.push_speed(twists))[:, None]
    places = loads.places[rng.integers(len(loads.places), size=_TWISTS)]
    poses = np.column_stack((places, rng.uniform(-np.pi, np.pi, _TWISTS)))
    wrenches = normalize_wrench(loads.at(twists, poses), loads.rho)
    held = problem.contacts[number].cone(loads.rho).margin(wrenches) >= -BOUNDARY_SLACK
    return twists[held][: 2 * _COMPARED], poses[held][: 2 * _COMPARED]


@dataclass(frozen=True)
class _Rig:
    """What a choice depends on: plans to other goals or among other obstacles share it. ``problem`` is any that has it."""

    parts: tuple[object, ...]
    problem: PlanningProblem = field(compare=False)


def choice_of(problem: PlanningProblem, seed: int) -> Choice | ArcChoice:
    """Return the choice of a problem, with what earlier plans for the same slider, contacts and surface worked out."""
    parts = (problem.slider, problem.surface, problem.contacts, problem.uncertainty, problem.alternatives)
    # the push that aligns an uncertain start depends on all of the problem, and so do loads that depend on the place
    whole = any(problem.uncertainty.start) or bool(problem.acting_effects)
    return _choice_of(_Rig((*parts, problem) if whole else parts, problem), seed)


@lru_cache(maxsize=4)
def _choice_of(rig: _Rig, seed: int) -> Choice | ArcChoice:
    return ArcChoice(rig.problem, seed) if rig.problem.acting_effects else Choice(rig.problem, seed)


def _compared(problem: PlanningProblem, number: int) -> FloatArray:
    """Body twists (k, 3), spread evenly, that the nominal surface calls stable at a contact; some are translations."""
    rho = problem.surface.characteristic_length
    spread = np.random.default_rng(0).normal(size=(_TWISTS, 3))
    spread[::8, 2] = 0.0
    twists = unit(spread) / (1.0, 1.0, rho)
    stable = twists[StabilityOracle(problem.surface, problem.contacts[number]).is_stable(twists)]
    return stable[:_COMPARED]


def _kept(violated: np.ndarray, left_out: int) -> np.ndarray:
    """Rows (m,) of scenarios that stay, of a table (n, k) of the twists that each rules out."""
    left = np.ones(len(violated), dtype=bool)
    for _ in range(left_out):
        count = violated[left].sum(axis=0)
        # a twist that one scenario rules out is won by leaving that one out; one that many rule out is far away
        worth = np.where(count > 0, np.maximum(count, 1.0) ** -4.0, 0.0)
        gain = np.where(left, violated @ worth, -1.0)
        left[int(np.argmax(gain))] = False
    return np.flatnonzero(left)
