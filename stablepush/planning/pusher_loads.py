"""What a pusher must supply where effects make it depend on heading, place and speed.

With the effects of a problem the load of a body twist ``V`` at the pose ``(x, theta)`` is

    F(V, x, theta) = F_friction(V, x, theta) - (R(theta)' m g s, 0) + (m_i omega J v, 0),

``s`` the slope of the table, ``m_i`` the mass that counts while an arc is held: starts and stops are no part of a push. A push is
stable if its load lies in the cone of its contact all along the arc. How fast a load turns with the heading, and how much its
course bends, is bounded: that carries what holds at some headings to all between.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, EffectError, FloatArray, InputError, check_vectors
from stablepush.effects import CATALOGUE, CREEP, KnownEffect, resting_share, table_friction
from stablepush.geometry import compose, exp, normalize_wrench
from stablepush.mechanics import TableFriction
from stablepush.mechanics.kernels import arcs_are_stable
from stablepush.objects import PushContact, Slider, SupportDistribution
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import Push
from stablepush.surfaces import IdealLimitSurface, LimitSurface

GRAVITY = 9.81
#: What the test of a part of an arc may take off a margin (rad), and the least and greatest part (rad).
_TAKEN, _PARTS = 2e-3, (math.radians(1.0), math.radians(10.0))
#: Steps along an arc at which a margin is looked at, rad and shares of the slider's radius, and steps of the golden section that
#: narrows the least of them.
_STEP, _WAY, _SECTIONS = math.radians(1.0), 0.05, 50
#: Directions and headings at which the turning of anisotropic friction is bounded, and what their grid may miss.
_GRID, _MISSED = 180, 1.02
#: Least margins along an arc that may be the least of all (rad above what was seen), and how many of them are narrowed.
_NEAR, _NARROWED = 0.03, 8
_GOLDEN = (math.sqrt(5) - 1) / 2


class Changing(NamedTuple):
    """Most by which loads, as ``(fx, fy, tau/rho)``, change.

    ``per_turn`` in N per rad of heading, ``per_way`` in N per m of way, ``per_both`` in N per rad and m; ``bend``: their second
    derivative by the heading, in N/rad²; ``least``: about the least force (N) of a straight push.
    """

    per_turn: float
    per_way: float
    per_both: float
    bend: float
    least: float


class PushLoads:
    """Loads of pushes on a table with effects.

    Attributes
    ----------
    friction : TableFriction
        Of the table with the effects.
    newtons : float
        Newtons in the unit of the surface's forces.
    places : array, shape (q, 2)
        Places in W (m) that stand for all places within the bounds: where friction is least and greatest.

    Raises :class:`InputError` if an effect needs a mass, friction or bounds that the problem does not have.
    """

    def __init__(self, problem: PlanningProblem, surface: LimitSurface, effects: Sequence[KnownEffect]) -> None:
        self.surface, self.rho = surface, surface.characteristic_length
        self._slider = problem.slider
        # members of a fit's ensemble have its unit
        self._measured = bool(surface.members())
        self._effects = {entry.effect.id: entry.effect for entry in effects if not entry.changes_no_plan}
        self.newtons = _newtons(problem, surface, self._effects)
        self._points = _stand_in(surface, problem.slider, self.newtons)
        try:
            self.friction = table_friction(self._slider, surface, self._effects, self.newtons, GRAVITY, self._points)
        except EffectError as error:
            raise InputError("effects", str(error)) from None
        gradient = np.array(self.friction.gradient)
        self.places, self._least_share, self._most_share = np.zeros((1, 2)), 1.0, 1.0
        if gradient.any():
            self.places = _extremes(problem, gradient)
            swing = float(np.linalg.norm(gradient)) * float(np.linalg.norm(self._feet[0], axis=1).max())
            self._least_share = float(1 + self.places[0] @ gradient) - swing
            self._most_share = float(1 + self.places[1] @ gradient) + swing
            if self._least_share <= 0:
                raise InputError("effects", "expected friction above 0 everywhere within the bounds", "spatial-variation")

    @property
    def _feet(self) -> tuple[FloatArray, FloatArray]:
        """Places (k, 2) and loads (k,) in N of the points that effects act on."""
        acting = self.friction.surface.point_loads
        if acting is None:
            acting = (self.friction.perturbed or self._points).point_loads
        assert acting is not None
        return acting

    @cached_property
    def changing(self) -> Changing:
        """How fast loads change along a push, at most."""
        turning, bending, weakest, strongest = _of_anisotropy(self.friction)
        places, loads = self._feet
        away = np.linalg.norm(places, axis=1)
        reach, lever = (float(loads @ (arm * np.hypot(1.0, away / self.rho))) for arm in (np.ones(len(away)), away))
        slope, steep = self.friction.slope, float(np.linalg.norm(self.friction.gradient))
        by_speed = 1 + abs(slope * math.log(CREEP / self.friction.reference)) if slope else 1.0
        pull, most = float(np.linalg.norm(self.friction.external_force)), self._most_share
        curved = most * bending * reach + steep * (2 * turning + strongest) * lever
        return Changing(
            per_turn=pull + by_speed * (most * turning * reach + steep * strongest * lever),
            per_way=by_speed * steep * strongest * reach,
            per_both=by_speed * steep * turning * reach,
            bend=pull + by_speed * curved,
            least=self.newtons * _size(self.surface) * self._least_share * weakest,
        )

    @cached_property
    def resting_share(self) -> float:
        """What the slope pulls with over what friction holds, where that is least. A slider that is not pushed rests below 1."""
        return resting_share(self.friction, self.places[0], self.rho)

    def at(self, twists: FloatArray, poses: FloatArray) -> FloatArray:
        """Return the loads (n, 3) in N and N·m, in B, of body twists (n, 3) in m/s and rad/s at poses (n, 3) of B in W."""
        return self.friction.wrench(twists, poses)

    def changes(self, twists: FloatArray, poses: FloatArray) -> FloatArray:
        """Return what the effects add (n, 3) to the load of the surface, which is the same for all likely surfaces."""
        return self.at(twists, poses) - self.newtons * self.surface.wrench(twists)

    def newtons_of(self, member: LimitSurface) -> float:
        """Newtons in the unit of a likely surface: pressures that were drawn have no scale of their own."""
        if member is self.surface or self._measured:
            return self.newtons
        return self.newtons * _size(self.surface) / _size(member)

    def table(self, member: LimitSurface) -> TableFriction:
        """Return the friction of a likely surface with the effects."""
        newtons = self.newtons_of(member)
        if isinstance(member, IdealLimitSurface) and member is not self.surface:
            support = SupportDistribution(*member.point_loads)
            scaled = IdealLimitSurface(support, newtons * float(member.point_loads[1].sum()), self.rho)
            return table_friction(self._slider, scaled, self._effects, 1.0, GRAVITY)
        return table_friction(self._slider, member, self._effects, newtons, GRAVITY, self._points)

    def are_stable(
        self, twists: FloatArray, headings: FloatArray, extra: FloatArray, facets: FloatArray, least: FloatArray
    ) -> BoolArray:
        """Return whether pushes (n,) stay in all of some cones at every place within the bounds, all along their arcs.

        ``twists`` (n, 3) in m/s and rad/s; ``headings`` (n, 2): where each begins (rad in W), and by how much it turns; ``extra``
        (n, k, 3): what is added to the load for cone ``k``; ``facets`` (k, f, 3): unit normals; ``least`` (k,) margins in rad.
        """
        result = np.zeros(len(twists), dtype=bool)
        arrays = (np.ascontiguousarray(a) for a in (twists, headings, self.places, extra, facets, np.sin(least)))
        arcs_are_stable(self.friction.compiled(), *arrays, self._part(), self.changing.bend, self.rho, result)
        return result

    def _part(self) -> float:
        """Part of an arc (rad) over which little is taken off a margin."""
        size = self.changing.least
        return float(np.clip(math.sqrt(8 * _TAKEN * size / max(self.changing.bend, 1e-12 * size)), *_PARTS))

    def least_margin(self, contact: PushContact, push: Push) -> float:
        """Return the least margin (rad) of a push along its arc."""
        cone = contact.cone(self.rho)

        def margins(shares: FloatArray) -> FloatArray:
            poses = compose(push.start, exp(push.twist * (shares * push.duration)[:, None]))
            loads = self.at(np.tile(push.twist, (len(shares), 1)), poses)
            return cone.margin(normalize_wrench(loads, self.rho))

        count = steps_along(push, self._slider.radius)
        shares = np.linspace(0.0, 1.0, count + 1)
        values = margins(shares)
        padded = np.concatenate(((np.inf,), values, (np.inf,)))
        low = (values <= padded[:-2]) & (values <= padded[2:]) & (values < values.min() + _NEAR)
        near = [(float(shares[max(k - 1, 0)]), float(shares[min(k + 1, count)])) for k in np.flatnonzero(low).tolist()]
        return min(float(values.min()), *(_narrowed(margins, *ends) for ends in near[:_NARROWED]))


def steps_along(push: Push, radius: float) -> int:
    """Return in how many steps a push is looked at: at most one degree of heading, and a share of the slider's radius, each."""
    return max(2, math.ceil(abs(push.twist[2]) * push.duration / _STEP), math.ceil(push.length / (_WAY * radius)))


def _narrowed(function: Callable[[FloatArray], FloatArray], low: float, high: float) -> float:
    """The least value between two shares of an arc, by golden section."""
    inner = [high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)]
    values = function(np.array(inner)).tolist()
    for _ in range(_SECTIONS):
        if values[0] < values[1]:
            high, inner, values = inner[1], [inner[1] - _GOLDEN * (inner[1] - low), inner[0]], [0.0, values[0]]
            inner[0] = high - _GOLDEN * (high - low)
            values[0] = float(function(np.array(inner[:1]))[0])
        else:
            low, inner, values = inner[0], [inner[1], 0.0], [values[1], 0.0]
            inner[1] = low + _GOLDEN * (high - low)
            values[1] = float(function(np.array(inner[1:]))[0])
    return float(min(values))


@lru_cache(maxsize=32)
def loads_of(problem: PlanningProblem) -> PushLoads | None:
    """Return the loads of pushes of a problem; None where no effect changes them."""
    return PushLoads(problem, problem.surface, problem.effects) if problem.acting_effects else None


def push_margins(problem: PlanningProblem, twists: ArrayLike, poses: ArrayLike | None = None, contact: int = 0) -> FloatArray:
    """Return the margins (...) in rad of body twists (..., 3) at poses (..., 3) of B in W, with the effects of a problem.

    The angle from the load that the pusher must supply to the nearest facet of the cone of a contact (by number). It is negative
    where the push is not stable. ``poses``: the start of the problem if not given. Where no effect acts this is
    :meth:`StabilityOracle.margin`, whatever the pose. It is of one pose, not of the arc that a push makes from there: a plan's
    ``margin`` is the least along it.

    Raises :class:`InputError` for shapes that do not fit, a contact that there is not, and where mass, friction or bounds lack
    that an effect needs.
    """
    motions = check_vectors(twists, "twists", 3)
    places = np.asarray(problem.start) if poses is None else check_vectors(poses, "poses", 3)
    known = isinstance(contact, int | np.integer) and not isinstance(contact, bool)
    if not known or not 0 <= contact < len(problem.contacts):
        raise InputError("contact", f"expected a whole number from 0 to {len(problem.contacts) - 1}", repr(contact))
    loads, rho = loads_of(problem), problem.surface.characteristic_length
    cone = problem.contacts[contact].cone(rho)
    try:
        motions, places = np.broadcast_arrays(motions, places)
    except ValueError:
        raise InputError("poses", "expected one for all twists, or one for each", f"{places.shape} for {motions.shape}") from None
    flat = motions.reshape(-1, 3)
    needed = problem.surface.wrench(flat) if loads is None else loads.at(flat, places.reshape(-1, 3))
    found = cone.margin(normalize_wrench(needed, rho))
    return np.asarray(found).reshape(motions.shape[:-1])


def require_loads(problem: PlanningProblem) -> None:
    """Refuse effects, of a problem or one of its alternatives, whose loads cannot be worked out."""
    if not problem.acting_effects:
        return
    loads_of(problem)
    for number, entry in enumerate(problem.alternatives):
        try:
            PushLoads(problem, entry.surface or problem.surface, entry.effects)
        except InputError as error:
            raise error.within(f"alternatives[{number}]") from None


def likely_loads(
    problem: PlanningProblem, surface: LimitSurface, effects: Sequence[KnownEffect], count: int, rng: np.random.Generator
) -> list[PushLoads]:
    """Return ``count`` likely loads of pushes: effects whose covariance is known are drawn from it. One where none is.

    A draw that no rig can have is moved toward the estimate until a rig can.
    """
    if not any(entry.covariance is not None and not entry.changes_no_plan for entry in effects):
        return [PushLoads(problem, surface, effects)]
    found = []
    for _ in range(count):
        state = rng.bit_generator.state
        for share in (1.0, 0.5, 0.25, 0.0):
            # the same draw, nearer
            rng.bit_generator.state = state
            try:
                found.append(PushLoads(problem, surface, [entry.drawn(rng, share) for entry in effects]))
                break
            except InputError:
                if share == 0.0:
                    raise
    return found


def _newtons(problem: PlanningProblem, surface: LimitSurface, effects: Collection[str]) -> float:
    """Newtons in the unit of a surface's forces; 1 where neither they nor a weight count."""
    weighs = [id for id in effects if CATALOGUE[id].needs_weight]
    if weighs and not problem.slider.mass:
        raise InputError("slider.mass", f"expected a mass in kg, since the effect {weighs[0]} acts")
    if surface.force_unit == "N":
        return 1.0
    if weighs and problem.support_friction is None:
        raise InputError("support_friction", f"expected one, since the effect {weighs[0]} acts and the model is in units of mu*N")
    return float(problem.support_friction or 1.0) * float(problem.slider.mass or 1.0) * GRAVITY


@lru_cache(maxsize=32)
def _stand_in(surface: LimitSurface, slider: Slider, newtons: float) -> IdealLimitSurface:
    """Support points that stand for a surface."""
    # fits load solvers: not before they are needed
    from stablepush.identify import support_for

    return support_for(surface, slider, newtons)


def _extremes(problem: PlanningProblem, gradient: FloatArray) -> FloatArray:
    """Corners (2, 2) of the bounds where friction is least and greatest."""
    if problem.bounds is None:
        raise InputError("bounds", "expected bounds, since friction varies over the table")
    x0, y0, x1, y1 = problem.bounds
    corners = np.array(((x0, y0), (x1, y0), (x0, y1), (x1, y1)))
    order = np.argsort(corners @ gradient, kind="stable")
    return corners[order[[0, -1]]]


def _size(surface: LimitSurface) -> float:
    """Mean force of straight pushes."""
    angles = np.linspace(0.0, 2 * np.pi, 72, endpoint=False)
    loads = surface.wrench(np.stack((np.cos(angles), np.sin(angles), np.zeros(len(angles))), axis=-1))
    return float(np.hypot(loads[:, 0], loads[:, 1]).mean())


def _of_anisotropy(table: TableFriction) -> tuple[float, float, float, float]:
    """How much the force of a point of unit friction changes with the heading (1/rad) at most, and how much that bends (1/rad²);
    its least and greatest size.

    ``f = M e / sqrt(e' M e)`` in B for the direction ``e`` of motion, ``M = A_w M_o A_w`` with the table's ``A_w`` turned into B.
    It depends on both angles smoothly: a fine grid bounds its slope.
    """
    body, world = np.array(table.body_anisotropy), np.array(table.world_anisotropy)
    angles = np.linspace(0.0, np.pi, _GRID, endpoint=False)
    e = np.stack((np.cos(angles), np.sin(angles)), axis=-1)

    def forces(headings: FloatArray) -> FloatArray:
        c, s = np.cos(headings), np.sin(headings)
        turn: FloatArray = np.moveaxis(np.array(((c, -s), (s, c))), 2, 0)
        in_body = turn.transpose(0, 2, 1) @ world @ turn
        m = in_body @ (body @ body) @ in_body
        moved = np.einsum("hij,ej->hei", m, e)
        return np.asarray(moved / np.sqrt(np.einsum("hei,ei->he", moved, e))[..., None])

    small = 1e-4
    before, here, after = forces(angles - small), forces(angles), forces(angles + small)
    slope = np.linalg.norm(after - before, axis=2).max() / (2 * small)
    bend = np.linalg.norm(after - 2 * here + before, axis=2).max() / small**2
    sizes = np.linalg.norm(here, axis=2)
    if bend < 1e-4:
        # rounding: it is the same all round
        slope = bend = 0.0
    return _MISSED * float(slope), _MISSED * float(bend), float(sizes.min()) / _MISSED, _MISSED * float(sizes.max())
