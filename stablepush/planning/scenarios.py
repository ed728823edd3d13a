"""Draws of what a problem does not know, and which pushes hold in all of a chosen share of them.

A scenario is a limit surface, friction at the contacts, places of the fingers, a centre of mass and a start pose. In the frame
whose origin is the true centre of mass ``d`` (in B) the surface is as drawn, contact points are ``p - d``, and the body twist of
that frame is ``(vx - omega d_y, vy + omega d_x, omega)``. A push sticks in a scenario if the load of that twist lies in the cone
there.

A plan that lies in the common stable set of a chosen set of scenarios sticks in each of them, whatever its number of pushes:
scenario optimisation with discarded constraints (Campi and Garatti, 2011). A chosen set is optimistic about itself; what it is
worth is measured on scenarios that no choice was made on (:mod:`stablepush.planning.success`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import shapely

from stablepush.core import BoolArray, FloatArray
from stablepush.geometry import normalize_wrench, unit
from stablepush.identify import PressureSampler
from stablepush.objects import PushContact, Slider, SupportDistribution
from stablepush.planning.alignment import after_docking, aligns, clearance, straight_pushes
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import Push
from stablepush.stability import BOUNDARY_SLACK, Case, StabilityOracle, StableRegion, common_region
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Pressures that are drawn for a surface without an ensemble.
_PRESSURES = 64
#: Lengths of an alignment push that are tried, in what the start may be off, on how many scenarios, and what is enough.
_LENGTHS, _TRIED, _NEARLY_ALL = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0), 150, 0.993
#: Largest distance of a centre of mass from the origin, as a share of the distance to the outline.
_INSIDE = 0.9
#: Scenarios that a choice is made among, and the most that are drawn for one.
CHOICE, MOST = 300, 900
#: Unit twists at which scenarios are compared, before those that the nominal surface calls unstable are left out, and after.
_TWISTS, _COMPARED = 4000, 160
#: Rounds of adding the scenarios that the polygons of the others violate by more than this angle (rad), how many each, and which
#: corner of the polygons is asked: one of so many, corners are dense.
_ROUNDS, _VIOLATION, _ADDED, _THINNED = 6, 1e-4, 6, 7
#: Polygons begin with the scenarios that are the worst for one in so many of the compared twists: those nearest to the bound.
_NEAREST = 3


@dataclass(frozen=True, eq=False)
class Scenarios:
    """Draws of a problem.

    Attributes
    ----------
    problem : PlanningProblem
    surfaces : sequence of LimitSurface
        Equally likely surfaces that scenarios are drawn from.
    surface : array of int, shape (n,)
        Which of them.
    contact_mu : array, shape (n, contacts)
        Friction of each contact.
    place : array, shape (n, contacts)
        How far (m) the fingers of each contact are off along the y axis of its frame, on the tool.
    center_of_mass : array, shape (n, 2)
        In B (m).
    start : array, shape (n, 3)
        Where the slider is: its pose in the planned one (m, rad). It moves the fingers in B.
    flush : array of bool, shape (n,)
        Whether it stands square to the fingers, with both of them touching.
    """

    problem: PlanningProblem
    surfaces: Sequence[LimitSurface]
    surface: np.ndarray
    contact_mu: FloatArray
    place: FloatArray
    center_of_mass: FloatArray
    start: FloatArray
    flush: BoolArray

    def __len__(self) -> int:
        return len(self.surface)

    def take(self, rows: np.ndarray) -> Scenarios:
        """Return some of the scenarios."""
        names = ("surface", "contact_mu", "place", "center_of_mass", "start", "flush")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    @cached_property
    def aside(self) -> FloatArray:
        """How far (n, contacts) in m the fingers are off along the y axis of their frame, in B."""
        return np.asarray(self.place - self.start[:, :2] @ np.stack([across_of(c) for c in self.problem.contacts], axis=1))

    def contact(self, scenario: int, number: int) -> PushContact:
        """Return a contact as it is in a scenario, in B."""
        nominal = self.problem.contacts[number]
        aside = self.aside[scenario, number] * across_of(nominal)
        return PushContact(nominal.points + aside, nominal.normals, self.contact_mu[scenario, number])

    def after(self, push: Push | None) -> Scenarios:
        """Return the scenarios after a push that follows a docking of the pusher: what it leaves of an uncertain start.

        Each is simulated. No scenario is flush after no push.
        """
        start, flush = self.start.copy(), np.zeros(len(self), dtype=bool)
        rows = np.flatnonzero(self.flush)
        if push is not None and len(rows):
            mu, place = self.contact_mu[rows, push.contact], self.place[rows, push.contact]
            start[rows], flush[rows] = after_docking(
                self.problem, push, self.surfaces, self.surface[rows], mu, place, self.center_of_mass[rows], start[rows]
            )
        return replace(self, start=start, flush=flush)

    def margins(self, number: int, twists: FloatArray) -> FloatArray:
        """Return the margins (n, k) in rad of body twists (k, 3) at a contact in all scenarios."""
        facets = self._facets[number]
        rho = self.surfaces[0].characteristic_length
        result = np.empty((len(self), len(twists)))
        for member in np.unique(self.surface):
            rows = np.flatnonzero(self.surface == member)
            moved = np.tile(twists, (len(rows), 1, 1))
            moved[..., :2] += twists[None, :, 2:] * (self.center_of_mass[rows, None, ::-1] * (-1.0, 1.0))
            loads = normalize_wrench(self.surfaces[member].wrench(moved), rho)
            heights = np.einsum("rfc,rkc->frk", facets[rows], loads).min(axis=0) / np.sqrt(np.einsum("rkc,rkc->rk", loads, loads))
            result[rows] = np.arcsin(np.clip(heights, -1.0, 1.0))
        return result

    @cached_property
    def _facets(self) -> list[FloatArray]:
        """Unit facet normals (n, f, 3) of the cones of each contact, about the true centres of mass."""
        rho = self.surfaces[0].characteristic_length
        found = []
        for number, contact in enumerate(self.problem.contacts):
            aside = self.aside[:, number, None] * across_of(contact) - self.center_of_mass
            points, mu = contact.points + aside[:, None, :], self.contact_mu[:, number]
            one_edge = len(points[0]) == 2 and contact.has_one_normal
            if one_edge and mu.min() > 0 and abs(np.subtract(*contact.points) @ contact.normals[0]) < 1e-9:
                found.append(_line_facets(points, contact.normals[0], mu, rho))
            else:
                cones = [PushContact(p, contact.normals, m).cone(rho).normals for p, m in zip(points, mu, strict=True)]
                most = max(map(len, cones))
                # a cone with fewer facets repeats one; one without any, the whole space, has margins of pi/2
                padded = np.zeros((len(cones), max(1, most), 3))
                for row, normals in zip(padded, cones, strict=True):
                    if len(normals):
                        row[:] = normals[np.minimum(np.arange(len(row)), len(normals) - 1)]
                found.append(padded)
        return found


def draw_scenarios(problem: PlanningProblem, count: int, seed: int, stream: int = 0) -> Scenarios:
    """Draw scenarios of a problem; ``stream``: draws of different streams share nothing, whatever the seed.

    Where the start is uncertain the slider stands as it is drawn, before the first push (:meth:`Scenarios.after`).
    """
    rng = np.random.default_rng([seed, stream])
    unknown, contacts = problem.uncertainty, len(problem.contacts)
    share, place = rng.uniform(size=(count, 1)), unknown.contact_place * rng.uniform(-1, 1, size=(count, contacts))
    deviations = np.array((unknown.start[0], unknown.start[0], unknown.start[1]))
    start = deviations * rng.normal(size=(count, 3))
    surfaces, chances, frictions = _rigs(problem)
    # without alternatives all are equally likely
    surface = rng.choice(len(surfaces), count, p=chances) if problem.alternatives else rng.integers(len(surfaces), size=count)
    ranges = frictions[surface]
    return Scenarios(
        problem,
        surfaces,
        surface,
        # fingers of one material: the same share of every range
        ranges[..., 0] + share * (ranges[..., 1] - ranges[..., 0]),
        place,
        _within(problem.slider, unknown.center_of_mass * rng.normal(size=(count, 2))),
        start,
        np.ones(count, dtype=bool),
    )


def _rigs(problem: PlanningProblem) -> tuple[list[LimitSurface], FloatArray, FloatArray]:
    """Surfaces that a rig may have, their probabilities (n,), and the ends (n, contacts, 2) of the friction of the contacts.

    Those of a problem's alternatives, by their probability, or its own.
    """
    unknown = problem.uncertainty
    own = np.array([unknown.friction_range(contact.mu) for contact in problem.contacts])
    if not problem.alternatives:
        surfaces = list(likely_surfaces(problem))
        return surfaces, np.full(len(surfaces), 1 / len(surfaces)), np.tile(own, (len(surfaces), 1, 1))
    found: list[LimitSurface] = []
    chances: list[float] = []
    frictions: list[FloatArray] = []
    total = sum(entry.probability for entry in problem.alternatives)
    for entry in problem.alternatives:
        mine = likely_surfaces(problem if entry.surface is None else problem.with_changes(surface=entry.surface, alternatives=()))
        found += mine
        chances += [entry.probability / total / len(mine)] * len(mine)
        ends = own
        if entry.contact_friction is not None:
            width = unknown.relative_friction * entry.contact_friction
            ends = np.tile((entry.contact_friction - width, entry.contact_friction + width), (len(own), 1))
        frictions += [ends] * len(mine)
    return found, np.array(chances), np.array(frictions)


@lru_cache(maxsize=32)
def alignment_push(problem: PlanningProblem, number: int = 0) -> Push | None:
    """Return the straight push from the start, at a contact, that makes a slider flush whose start is uncertain.

    It is the shortest, and the nearest to the normal, of a few after which nearly all of some scenarios are flush and stick: a
    finger near the centre of mass turns the slider slowly. None where the start is certain, the contact does not align, or no
    straight push is stable.
    """
    least = clearance(problem, problem.contacts[number])
    if least == 0 or not aligns(problem.contacts[number]):
        return None
    drawn = draw_scenarios(problem, _TRIED, seed=0, stream=1)
    placed = replace(drawn, start=np.zeros_like(drawn.start))
    best, most = None, -1.0
    for factor in _LENGTHS:
        pushes = straight_pushes(problem, number, factor * least)
        if not pushes:
            return None
        # the length is found with the direction that holds most often
        held = placed.margins(number, np.array([push.twist for push in pushes])) >= -BOUNDARY_SLACK
        safe = np.flatnonzero(held.mean(axis=0) >= min(_NEARLY_ALL, float(held.mean(axis=0).max())))
        push = pushes[int(safe[0])]
        after = drawn.after(push)
        share = float((after.flush & (after.margins(number, push.twist[None])[:, 0] >= -BOUNDARY_SLACK)).mean())
        if share > most:
            best, most = push, share
        if share >= _NEARLY_ALL:
            break
    return best


def _within(slider: Slider, centers: FloatArray) -> FloatArray:
    """Centres of mass (n, 2), those outside of the outline's hull drawn in towards the origin: a body has none there."""
    hull = shapely.get_coordinates(shapely.orient_polygons(slider.polygon.convex_hull))
    along = np.diff(hull, axis=0)
    outward = np.column_stack((along[:, 1], -along[:, 0]))
    # of the way to each edge
    share = (centers @ outward.T / (hull[:-1] * outward).sum(axis=1)).max(axis=1)
    return centers / np.maximum(1.0, share / _INSIDE)[:, None]


@lru_cache(maxsize=8)
def likely_surfaces(problem: PlanningProblem) -> Sequence[LimitSurface]:
    """Return equally likely surfaces: the ensemble of a fit, a support that is known, else pressures under the outline."""
    surface = problem.surface
    members = surface.members()
    if members:
        return members
    if surface.point_loads is not None or problem.slider.support is not None:
        return [surface]
    drawn = PressureSampler(problem.slider.vertices, count=_PRESSURES).prior()
    return [
        IdealLimitSurface(SupportDistribution(points[shares > 0], shares[shares > 0]), 1.0, surface.characteristic_length)
        for points, shares in zip(drawn.points, drawn.shares, strict=True)
    ]


class Choice:
    """Which scenarios a plan is to hold in, and the motions that are stable in all of them.

    Scenarios are left out one by one: those that alone rule out the most of the compared motions. The same are left out for all
    contacts. What one choice worked out serves the next.
    """

    def __init__(self, problem: PlanningProblem, seed: int) -> None:
        # simulated starts take time
        drawn = draw_scenarios(problem, CHOICE if any(problem.uncertainty.start) else MOST, seed)
        if any(problem.uncertainty.start):
            drawn = drawn.after(alignment_push(problem))
        # no push holds a slider that is not flush
        self._all = drawn.take(drawn.flush) if drawn.flush.any() else drawn
        self._contacts = range(len(problem.contacts))
        self._compared = [_compared(problem, number) for number in self._contacts]
        self._margins = [np.empty((0, len(twists))) for twists in self._compared]
        self._cases: dict[tuple[int, int], Case] = {}

    def regions(self, count: int, left_out: int = 0) -> list[StableRegion]:
        """Return for each contact the motions that are stable in all of the first ``count`` scenarios but some."""
        count = min(count, len(self._all))
        new = self._all.take(np.arange(len(self._margins[0]), count))
        if len(new):
            self._margins = [
                np.concatenate((known, new.margins(number, self._compared[number]))) if known.shape[1] else np.empty((count, 0))
                for number, known in enumerate(self._margins)
            ]
        table = np.concatenate([margins[:count] for margins in self._margins], axis=1)
        kept = _kept(table < -BOUNDARY_SLACK, min(left_out, count - 1))
        return [self._region(kept, number) for number in self._contacts]

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


@dataclass(frozen=True)
class _Rig:
    """What a choice depends on: plans to other goals or among other obstacles share it. ``problem`` is any that has it."""

    parts: tuple[object, ...]
    problem: PlanningProblem = field(compare=False)


def choice_of(problem: PlanningProblem, seed: int) -> Choice:
    """Return the choice of a problem, with what earlier plans for the same slider, contacts and surface worked out."""
    parts = (problem.slider, problem.surface, problem.contacts, problem.uncertainty, problem.alternatives)
    # the push that aligns an uncertain start depends on all of the problem
    return _choice_of(_Rig((*parts, problem) if any(problem.uncertainty.start) else parts, problem), seed)


@lru_cache(maxsize=4)
def _choice_of(rig: _Rig, seed: int) -> Choice:
    return Choice(rig.problem, seed)


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


def across_of(contact: PushContact) -> FloatArray:
    """Return the y axis (2,) of the frame of a contact, in B."""
    theta = contact.frame[2]
    return np.array((-np.sin(theta), np.cos(theta)))


def _line_facets(points: FloatArray, normal: FloatArray, mu: FloatArray, rho: float) -> FloatArray:
    """Unit facet normals (n, 4, 3) of the cones of two points (n, 2, 2) on one edge, with friction (n,).

    The force lies in the friction cone, ``mu n·f ± t·f >= 0``, and its line passes between the points: with ``p_a`` before
    ``p_b`` along ``t``, ``tau <= p_a x f`` and ``tau >= p_b x f``.
    """
    tangent = np.array((-normal[1], normal[0]))
    order = np.argsort(points @ tangent, axis=1)
    a, b = (np.take_along_axis(points, order[:, k, None, None], axis=1)[:, 0] for k in (0, 1))
    rows = np.zeros((len(points), 4, 3))
    rows[:, 0, :2], rows[:, 1, :2] = mu[:, None] * normal - tangent, mu[:, None] * normal + tangent
    rows[:, 2] = np.column_stack((-a[:, 1], a[:, 0], np.full(len(a), -rho)))
    rows[:, 3] = np.column_stack((b[:, 1], -b[:, 0], np.full(len(b), rho)))
    return unit(rows)
