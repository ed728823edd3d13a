"""Draws of what a problem does not know.

A scenario is a limit surface, friction at the contacts, places of the fingers, a centre of mass and a start pose. In the frame
whose origin is the true centre of mass ``d`` (in B) the surface is as drawn, contact points are ``p - d``, and the body twist of
that frame is ``(vx - omega d_y, vy + omega d_x, omega)``. A push sticks in a scenario if the load of that twist lies in the cone
there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import shapely

from stablepush.core import BoolArray, FloatArray
from stablepush.geometry import normalize_wrench, unit
from stablepush.identify import PressureSampler
from stablepush.objects import PushContact, Slider, SupportDistribution
from stablepush.planning.alignment import after_docking, aligns, clearance, straight_pushes
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.pusher_loads import PushLoads, likely_loads
from stablepush.planning.result import Push
from stablepush.stability import BOUNDARY_SLACK
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Pressures that are drawn for a surface without an ensemble.
_PRESSURES = 64
#: Lengths of an alignment push that are tried, in what the start may be off, on how many scenarios, and what is enough.
_LENGTHS, _TRIED, _NEARLY_ALL = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0), 150, 0.993
#: Draws of effects whose covariance is known, for a choice and for a measurement.
_EFFECTS_CHOSEN, _EFFECTS_MEASURED = 8, 64
#: Largest distance of a centre of mass from the origin, as a share of the distance to the outline.
_INSIDE = 0.9


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
    loads : sequence of PushLoads
        What effects make of the load of each surface; empty where none acts.
    """

    problem: PlanningProblem
    surfaces: Sequence[LimitSurface]
    surface: np.ndarray
    contact_mu: FloatArray
    place: FloatArray
    center_of_mass: FloatArray
    start: FloatArray
    flush: BoolArray
    loads: Sequence[PushLoads] = ()

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

    def margins(self, number: int, twists: FloatArray, poses: FloatArray | None = None) -> FloatArray:
        """Return the margins (n, k) in rad of body twists (k, 3) at a contact in all scenarios.

        ``poses`` (k, 3) of B in W, which count where effects act: what they add is that of the nominal surface.
        """
        facets = self.facets(number)
        rho = self.surfaces[0].characteristic_length
        result = np.empty((len(self), len(twists)))
        added: dict[int, FloatArray] = {}
        for member in np.unique(self.surface):
            rows = np.flatnonzero(self.surface == member)
            wrenches = self.surface_loads(int(member), rows, twists)
            if self.loads:
                of = self.loads[member]
                if id(of) not in added:
                    added[id(of)] = of.changes(twists, np.zeros_like(twists) if poses is None else poses)
                wrenches = wrenches + added[id(of)]
            loads = normalize_wrench(wrenches, rho)
            heights = np.einsum("rfc,rkc->frk", facets[rows], loads).min(axis=0) / np.sqrt(np.einsum("rkc,rkc->rk", loads, loads))
            result[rows] = np.arcsin(np.clip(heights, -1.0, 1.0))
        return result

    def surface_loads(self, member: int, rows: np.ndarray, twists: FloatArray) -> FloatArray:
        """Return the loads (m, k, 3) of a surface for body twists (k, 3), about the centres of mass of scenarios (m,), in N where
        effects act."""
        moved = np.tile(twists, (len(rows), 1, 1))
        moved[..., :2] += twists[None, :, 2:] * (self.center_of_mass[rows, None, ::-1] * (-1.0, 1.0))
        surface = self.surfaces[member]
        return surface.wrench(moved) * (self.loads[member].newtons_of(surface) if self.loads else 1.0)

    @cached_property
    def _facets(self) -> dict[int, FloatArray]:
        return {}

    def facets(self, number: int) -> FloatArray:
        """Return unit facet normals (n, f, 3) of the cones of a contact, about the true centres of mass."""
        if number not in self._facets:
            self._facets[number] = self._facets_of(number)
        return self._facets[number]

    def _facets_of(self, number: int) -> FloatArray:
        rho, contact = self.surfaces[0].characteristic_length, self.problem.contacts[number]
        aside = self.aside[:, number, None] * across_of(contact) - self.center_of_mass
        points, mu = contact.points + aside[:, None, :], self.contact_mu[:, number]
        one_edge = len(points[0]) == 2 and contact.has_one_normal
        if one_edge and mu.min() > 0 and abs(np.subtract(*contact.points) @ contact.normals[0]) < 1e-9:
            return _line_facets(points, contact.normals[0], mu, rho)
        cones = [PushContact(p, contact.normals, m).cone(rho).normals for p, m in zip(points, mu, strict=True)]
        most = max(map(len, cones))
        # a cone with fewer facets repeats one; one without any, the whole space, has margins of pi/2
        padded = np.zeros((len(cones), max(1, most), 3))
        for row, normals in zip(padded, cones, strict=True):
            if len(normals):
                row[:] = normals[np.minimum(np.arange(len(row)), len(normals) - 1)]
        return padded


def draw_scenarios(problem: PlanningProblem, count: int, seed: int, stream: int = 0) -> Scenarios:
    """Draw scenarios of a problem; ``stream``: draws of different streams share nothing, whatever the seed.

    Where the start is uncertain the slider stands as it is drawn, before the first push (:meth:`Scenarios.after`).
    """
    rng = np.random.default_rng([seed, stream])
    unknown, contacts = problem.uncertainty, len(problem.contacts)
    share = rng.uniform(size=(count, 1))
    # what is drawn of one contact does not depend on which others there are
    streams = [rng, *(np.random.default_rng([seed, stream, 2, number]) for number in range(1, contacts))]
    place = unknown.contact_place * np.column_stack([of.uniform(-1, 1, size=count) for of in streams])
    deviations = np.array((unknown.start[0], unknown.start[0], unknown.start[1]))
    start = deviations * rng.normal(size=(count, 3))
    draws = _EFFECTS_CHOSEN if stream == 0 else _EFFECTS_MEASURED
    surfaces, chances, frictions, loads = _rigs(problem, draws, np.random.default_rng([seed, stream, 1]))
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
        loads,
    )


def _rigs(
    problem: PlanningProblem, draws: int, rng: np.random.Generator
) -> tuple[list[LimitSurface], FloatArray, FloatArray, list[PushLoads]]:
    """Surfaces that a rig may have, their probabilities (n,), the ends (n, contacts, 2) of the friction of the contacts, and what
    effects make of the loads: each surface with each of some ``draws`` of the effects.

    Those of a problem's alternatives, by their probability, or its own.
    """
    unknown = problem.uncertainty
    own = np.array([unknown.friction_range(contact.mu) for contact in problem.contacts])
    loads: list[PushLoads] = []
    if not problem.alternatives:
        surfaces = list(likely_surfaces(problem))
        if problem.acting_effects:
            surfaces, loads = _crossed(surfaces, likely_loads(problem, problem.surface, problem.effects, draws, rng))
        return surfaces, np.full(len(surfaces), 1 / len(surfaces)), np.tile(own, (len(surfaces), 1, 1)), loads
    found: list[LimitSurface] = []
    chances: list[float] = []
    frictions: list[FloatArray] = []
    total = sum(entry.probability for entry in problem.alternatives)
    for entry in problem.alternatives:
        own_rig = problem if entry.surface is None else problem.with_changes(surface=entry.surface, alternatives=())
        mine = list(likely_surfaces(own_rig))
        if problem.acting_effects:
            drawn = likely_loads(problem, entry.surface or problem.surface, entry.effects, draws, rng)
            mine, acting = _crossed(mine, drawn)
            loads += acting
        found += mine
        chances += [entry.probability / total / len(mine)] * len(mine)
        ends = own
        if entry.contact_friction is not None:
            width = unknown.relative_friction * entry.contact_friction
            ends = np.tile((entry.contact_friction - width, entry.contact_friction + width), (len(own), 1))
        frictions += [ends] * len(mine)
    return found, np.array(chances), np.array(frictions), loads


def _crossed(surfaces: Sequence[LimitSurface], loads: Sequence[PushLoads]) -> tuple[list[LimitSurface], list[PushLoads]]:
    """Every surface with every load."""
    return [surface for _ in loads for surface in surfaces], [of for of in loads for _ in surfaces]


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
