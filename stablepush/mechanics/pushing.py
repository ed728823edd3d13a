"""Quasi-static pushing: what a slider does under a pusher of imposed motion, with the modes of its contacts.

At every instant friction balances the contact forces (inertia is left out unless the table has it). With ``F(V)`` the load of the
limit surface for a body twist ``V``, contacts ``i`` at ``p_i`` with inward normals ``n_i`` and forces ``f_i``, and ``u_i`` the
pusher's velocity there,

    F(V) = Σ (f_i, p_i × f_i),    0 <= n_i·(v(p_i) - u_i)  ⟂  n_i·f_i >= 0,    |t_i·f_i| <= mu n_i·f_i,

sticking where the last holds strictly, else sliding against ``t_i·f_i``. For one contact the answer exists and is unique (the
force turns monotonically with the slip). With several, Coulomb's law may have more than one answer, or none. All combinations of
modes are tried: sticking before sliding, more contacts before fewer; where nothing is consistent the slider is jammed and stays.

Lynch, Maekawa, Tanie (1992), Manipulation and active sensing by pushing using tactile feedback; Goyal, Ruina, Papadopoulos
(1991).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import (
    BoolArray,
    FloatArray,
    InputError,
    brief,
    check_array,
    check_number,
    in_threads,
    read_only,
)
from stablepush.geometry import compose, inverse, point_velocity, transform_points
from stablepush.objects import PushContact, Slider
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Names of the modes of a contact, by number. Left: the slider slips to the left of the inward normal, seen from the pusher.
MODES = ("open", "sticking", "left", "right")
#: Radius (m) used for a finger of radius 0: it rounds corners.
_POINT = 1e-6
#: How deep (m) a finger without a radius may be in the slider: contacts are kept that deep.
_POINT_DEPTH = 2e-4
#: Parts in which many pushes are simulated side by side.
_PARTS = 4
#: Steps that a push may have.
_MOST_STEPS = 20_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Pusher:
    """A rigid pusher: round fingers, or a flat edge.

    Its frame has the origin midway between the fingers' centres (on the middle of a flat edge) and x along the direction it
    faces.

    Parameters
    ----------
    fingers : array-like, shape (k, 2)
        Centres of one or two fingers in the pusher's frame (m).
    radius : float
        Of the fingers, in m.
    flat : bool
        Two fingers of no radius are the ends of a flat edge.
    """

    fingers: FloatArray
    radius: float
    flat: bool

    def __init__(self, fingers: ArrayLike = ((0.0, 0.0),), radius: float = 0.0, flat: bool = False) -> None:
        places = check_array(fingers, "pusher.fingers", (None, 2))
        if not 1 <= len(places) <= 2:
            raise InputError("pusher.fingers", "expected one or two", len(places))
        if flat and (len(places) != 2 or radius != 0 or np.abs(places[:, 0]).max() > 1e-9 or abs(places[:, 1].sum()) > 1e-9):
            raise InputError("pusher", "expected two ends of no radius, at (0, y) and (0, -y), for a flat edge")
        object.__setattr__(self, "fingers", read_only(places))
        object.__setattr__(self, "radius", check_number(radius, "pusher.radius", at_least=0.0))
        object.__setattr__(self, "flat", bool(flat))

    @classmethod
    def finger(cls, radius: float = 0.0) -> Pusher:
        """Return one round finger."""
        return cls(((0.0, 0.0),), radius)

    @classmethod
    def two_fingers(cls, spacing: float, radius: float = 0.0) -> Pusher:
        """Return two round fingers, ``spacing`` (m) between their centres."""
        half = check_number(spacing, "spacing", positive=True) / 2
        return cls(((0.0, -half), (0.0, half)), radius)

    @classmethod
    def edge(cls, width: float) -> Pusher:
        """Return a flat edge, ``width`` (m) across."""
        half = check_number(width, "width", positive=True) / 2
        return cls(((0.0, -half), (0.0, half)), 0.0, True)

    @classmethod
    def of_contact(cls, contact: PushContact, radius: float = 0.0) -> Pusher:
        """Return the pusher that touches at the points of a contact when it is docked (:meth:`docked`)."""
        x, y, theta = contact.frame
        c, s = math.cos(theta), math.sin(theta)
        offset = contact.points - (x, y) - radius * contact.normals
        places = np.stack((c * offset[:, 0] + s * offset[:, 1], -s * offset[:, 0] + c * offset[:, 1]), axis=-1)
        return cls(places - places.mean(axis=0), radius)

    def moved(self, aside: float) -> Pusher:
        """Return the pusher with its fingers moved along the y axis of its frame by ``aside`` (m)."""
        return Pusher(self.fingers + np.array((0.0, aside)), self.radius, self.flat)

    @property
    def width(self) -> float:
        """Distance (m) between the two fingers; 0 for one."""
        return float(np.linalg.norm(self.fingers[-1] - self.fingers[0]))

    def docked(self, contact: PushContact) -> FloatArray:
        """Return the pose (3,) in B of the pusher's frame that touches at the points of a contact."""
        centers = contact.points - self.radius * contact.normals
        return np.array((*centers.mean(axis=0), contact.frame[2]))


@dataclass(frozen=True, slots=True, eq=False)
class PushTrace:
    """What happened in a push: rows for its steps; poses also for its start.

    Attributes
    ----------
    t : array, shape (n + 1,)
        Time in s.
    poses, pushers : array, shape (n + 1, 3)
        Of B and of the pusher's frame in W, in step with ``t``.
    twists : array, shape (n, 3)
        Body twist (m/s, rad/s) of each step.
    wrenches : array, shape (n, 3)
        Load (N, N·m) that the pusher applies in each step, in B.
    points : array, shape (n, 2, 2)
        Contact points of the fingers in B; NaN where they are open.
    modes : array of int, shape (n, 2)
        Numbers of :data:`MODES`.
    forces : array, shape (n, 2, 2)
        Forces (N) of the fingers in B. How two sticking fingers press against each other is not determined: a mean is given.
    jammed : array of bool, shape (n,)
        Steps in which no motion was consistent; the slider stayed.
    """

    t: FloatArray
    poses: FloatArray
    pushers: FloatArray
    twists: FloatArray
    wrenches: FloatArray
    points: FloatArray
    modes: np.ndarray
    forces: FloatArray
    jammed: BoolArray

    def __repr__(self) -> str:
        return brief(self)


@dataclass(frozen=True, slots=True, eq=False)
class PushAnswer:
    """The motion of an instant.

    ``twist`` (3,) in B, ``wrench`` (3,) that the pusher applies, ``forces`` (k, 2) and ``modes`` (names) of the contacts, and how
    many combinations of modes are consistent (``solutions``): the first is given, sticking before sliding; none is a jam.
    """

    twist: FloatArray
    wrench: FloatArray
    forces: FloatArray
    modes: list[str]
    solutions: int


@dataclass(frozen=True, slots=True, eq=False)
class TableFriction:
    """Friction between a slider and a table, ready for simulation.

    Parameters
    ----------
    surface : LimitSurface
        An ideal surface acts at its support points, so that effects of place, direction and speed mean what they do on a table. A
        polynomial one acts as a whole.
    points : IdealLimitSurface, optional
        Support points that stand for a polynomial surface. What place, direction and speed change of their friction is added to
        the friction of the surface.
    perturbed : IdealLimitSurface, optional
        The support points with a perturbed pressure; ``points`` if not given.
    load : float
        ``mu*N`` in N, for surfaces with forces in units of ``mu*N``.
    body_anisotropy, world_anisotropy : array-like, shape (2, 2)
        Friction over its mean along the axes of B and of W: ``A`` of ``f = m A² v/|A v|``, symmetric and positive.
    gradient : array-like, shape (2,)
        Relative change of friction per m over W, from its origin.
    slope, reference : float
        Relative change of friction per e-fold of a point's speed, and the speed (m/s) where it is nominal.
    external_force : array-like, shape (2,)
        Force (N) in W on the centre of mass besides the pusher's, as on a table that is not level.
    inertia : tuple of float
        Mass (kg) and moment of inertia (kg m²) that count.
    """

    surface: LimitSurface
    load: float = 1.0
    points: IdealLimitSurface | None = None
    perturbed: IdealLimitSurface | None = None
    body_anisotropy: ArrayLike = ((1.0, 0.0), (0.0, 1.0))
    world_anisotropy: ArrayLike = ((1.0, 0.0), (0.0, 1.0))
    gradient: ArrayLike = (0.0, 0.0)
    slope: float = 0.0
    reference: float = 0.02
    external_force: ArrayLike = (0.0, 0.0)
    inertia: tuple[float, float] = (0.0, 0.0)

    def compiled(self, scale: float = 1.0) -> Any:
        """Return the friction as the kernels take it, times ``scale``."""
        from stablepush.mechanics.kernels.friction import Table

        surface = self.surface
        slider = check_array(self.body_anisotropy, "body_anisotropy", (2, 2))
        table = check_array(self.world_anisotropy, "world_anisotropy", (2, 2))
        gradient, external_force = (
            check_array(self.gradient, "gradient", (2,)),
            check_array(self.external_force, "external_force", (2,)),
        )
        plain = bool((slider == np.eye(2)).all() and (table == np.eye(2)).all())
        none = np.zeros((0, 2)), np.zeros(0)
        degree, hessian, axes, factor = 0, np.zeros((6, 1)), np.ones(3), 1.0
        points, nominal = none, none
        if not isinstance(surface, LimitSurface):
            raise InputError("surface", "expected a limit surface", type(surface).__name__)
        if surface.point_loads is not None:
            points = surface.point_loads
        else:
            degree, (hessian, axes, factor) = surface.degree, surface.scaled_hessian()
            factor *= self.load if surface.force_unit == "mu*N" else 1.0
            if self.points is not None:
                nominal = self.points.point_loads
                points = nominal if self.perturbed is None else self.perturbed.point_loads
            elif not plain or gradient.any() or self.slope:
                raise InputError("points", "expected support points: place, direction and speed act on points under the slider")
        return Table(
            points=np.array(points[0]),
            loads=np.array(points[1]),
            nominal_points=np.array(nominal[0]),
            nominal_loads=np.array(nominal[1]),
            body_anisotropy=_entries(slider @ slider),
            world_anisotropy=_entries(table),
            isotropic=plain,
            gradient=(float(gradient[0]), float(gradient[1])),
            slope=float(self.slope),
            reference=float(self.reference),
            scale=float(scale),
            external_force=(float(external_force[0]), float(external_force[1])),
            inertia=(float(self.inertia[0]), float(self.inertia[1])),
            degree=int(degree),
            hessian=np.array(hessian),
            half_axes=(float(axes[0]), float(axes[1]), float(axes[2])),
            factor=float(factor),
            rho=float(surface.characteristic_length),
        )

    def wrench(self, twists: ArrayLike, poses: ArrayLike) -> FloatArray:
        """Return the loads (n, 3) in N and N·m, in B, that held body twists (n, 3) take, each at a pose (n, 3) of B in W.

        Friction less the external force, and what keeps the mass on its arc: ``m ω (-v_y, v_x)``.
        """
        from stablepush.mechanics.kernels.friction import loads_at

        moving = check_array(twists, "twists", (None, 3))
        places = check_array(poses, "poses", (len(moving), 3))
        loads = np.empty((len(moving), 3))
        loads_at(self.compiled(), np.ascontiguousarray(places), np.ascontiguousarray(moving), loads)
        return loads


def _entries(matrix: FloatArray) -> tuple[float, float, float]:
    return float(matrix[0, 0]), float(matrix[0, 1]), float(matrix[1, 1])


def push_twist(
    friction: TableFriction | LimitSurface, contact: PushContact, pusher_twist: ArrayLike, pose: ArrayLike = (0.0, 0.0, 0.0)
) -> PushAnswer:
    """Return how a slider moves at an instant under contacts that move together with a body twist.

    Parameters
    ----------
    friction : TableFriction or LimitSurface
    contact : PushContact
        Its points move rigidly with ``pusher_twist``.
    pusher_twist : array-like, shape (3,)
        In B, about the origin of B: the twist of a slider that is stuck to the pusher.
    pose : array-like, shape (3,)
        Of B in W; it counts where friction depends on place or direction.
    """
    from stablepush.mechanics.kernels.contact_law import respond
    from stablepush.mechanics.kernels.contacts import MOST_CONTACTS, new_solution, new_touch, new_work
    from stablepush.mechanics.kernels.friction import Motion

    table = _friction(friction).compiled()
    pushed = check_array(pusher_twist, "pusher_twist", (3,))
    x, y, theta = check_array(pose, "pose", (3,))
    count = len(contact.points)
    if count > MOST_CONTACTS:
        raise InputError("contact.points", f"expected at most {MOST_CONTACTS}", count)
    touch, solution, work = new_touch(), new_solution(), new_work()
    touch.number[0] = count
    touch.point[:count], touch.normal[:count] = contact.points, contact.normals
    touch.velocity[:count] = point_velocity(pushed, contact.points)
    at = Motion(x, y, math.cos(theta), math.sin(theta), 0.0, 0.0, 0.0, 1.0)
    respond(table, at, touch, np.array(pushed), contact.mu, table.rho, 1.0, True, solution, work)
    modes = [MODES[m] for m in solution.mode[:count]]
    return PushAnswer(solution.twist, solution.load, solution.force[:count].copy(), modes, int(solution.found[0]))


def simulate_push(  # noqa: PLR0913
    friction: TableFriction | LimitSurface,
    slider: Slider,
    pusher: Pusher,
    mu: float,
    start: ArrayLike,
    place: ArrayLike,
    motion: Sequence[tuple[ArrayLike, float]],
    *,
    step: float = 2e-4,
    scale: float = 1.0,
) -> PushTrace:
    """Simulate a push: a pusher follows an imposed motion and moves the slider where it touches it.

    Steps by the midpoint rule; its errors shrink with the square of ``step`` where modes do not change, and gaps are kept closed:
    they do not drift. A push whose motion is stuck to the pusher is exact.

    Parameters
    ----------
    friction : TableFriction or LimitSurface
        Between slider and table.
    slider : Slider
    pusher : Pusher
    mu : float
        Friction between pusher and slider.
    start, place : array-like, shape (3,)
        First poses of B and of the pusher's frame in W.
    motion : sequence of (twist, duration)
        Twists (3,) of the pusher in its own frame (m/s, rad/s), held for durations in s, one after the other.
    step : float
        Longest travel (m) of the fastest finger in a step.
    scale : float
        Friction over its nominal value.
    """
    begin, docked = check_array(start, "start", (3,)), check_array(place, "place", (3,))
    friction_mu = check_number(mu, "mu", at_least=0.0)
    table = _friction(friction).compiled(check_number(scale, "scale", positive=True))
    return rollout(table, slider, pusher, friction_mu, begin, docked, motion_profile(pusher, motion, step))


@dataclass(frozen=True, slots=True, eq=False)
class MotionProfile:
    """A pusher's motion in steps: twists (n, 3) in its own frame, held for ``durations`` (n,) in s, in ``counts`` (n,) steps."""

    twists: FloatArray
    durations: FloatArray
    counts: np.ndarray


def motion_profile(pusher: Pusher, motion: Sequence[tuple[ArrayLike, float]], step: float) -> MotionProfile:
    """Cut a pusher's motion, as :func:`simulate_push` takes it, into steps."""
    pieces = _pieces(motion)
    twists = np.array([twist for twist, _ in pieces]).reshape(-1, 3)
    durations = np.array([duration for _, duration in pieces])
    kept = durations > 0
    twists, durations = twists[kept], durations[kept]
    largest = check_number(step, "step", positive=True)
    x, y = pusher.fingers.T
    fastest = np.hypot(twists[:, :1] - twists[:, 2:] * y, twists[:, 1:2] + twists[:, 2:] * x).max(axis=1, initial=0.0)
    counts = np.maximum(1, np.ceil(fastest * durations / largest - 1e-9)).astype(np.int64)
    if counts.sum() > _MOST_STEPS:
        raise InputError("step", f"expected at most {_MOST_STEPS} steps in a push, {largest:g} m asks for {counts.sum()}")
    return MotionProfile(np.ascontiguousarray(twists), durations, counts)


def rollout(
    table: Any, slider: Slider, pusher: Pusher, mu: float, start: FloatArray, place: FloatArray, profile: MotionProfile
) -> PushTrace:
    """Simulate a push of which all is ready: :meth:`TableFriction.compiled`, :func:`motion_profile`."""
    from stablepush.mechanics.kernels import rollout as _pushing
    from stablepush.mechanics.kernels.contacts import new_solution, new_touch, new_work

    _require_outside(slider, pusher, start, place)
    total = int(profile.counts.sum())
    half = float(np.abs(pusher.fingers[:, 1]).max()) if pusher.flat else 0.0
    body = _pushing.Pusher(np.array(pusher.fingers), max(pusher.radius, 0.0 if pusher.flat else _POINT), half)
    poses, pushers = np.zeros((total + 1, 3)), np.zeros((total + 1, 3))
    moves, loads = np.zeros((total, 3)), np.zeros((total, 3))
    points, forces = np.zeros((total, 2, 2)), np.zeros((total, 2, 2))
    modes, times, jams = np.zeros((total, 2), dtype=np.int64), np.zeros(total), np.zeros(total, dtype=np.bool_)
    _pushing.run(
        table, np.array(slider.vertices), body, mu, np.array(start), np.array(place),
        profile.twists, profile.durations, profile.counts, float(table.rho),
        poses, pushers, moves, loads, points, modes, forces, times, jams,
        new_touch(), new_touch(), new_solution(), new_work(),
    )  # fmt: skip
    return PushTrace(np.concatenate(((0.0,), times)), poses, pushers, moves, loads, points, modes, forces, jams)


def final_poses(  # noqa: PLR0913
    frictions: Sequence[TableFriction | LimitSurface],
    which: np.ndarray,
    slider: Slider,
    pusher: Pusher,
    mu: FloatArray,
    starts: FloatArray,
    place: FloatArray,
    motion: Sequence[tuple[ArrayLike, float]],
    *,
    aside: FloatArray,
    centers_of_mass: FloatArray,
    step: float,
) -> FloatArray:
    """Return where sliders end that differ from each other, all pushed by the same motion: poses (n, 3) of B in W.

    Row ``i`` has the friction ``frictions[which[i]]``, about the centre of mass ``centers_of_mass[i]`` (2,) in B, the contact
    friction ``mu[i]``, the start ``starts[i]`` (3,), and fingers that are moved by ``aside[i]`` (m) along the y axis of the
    pusher's frame. The rest is as for :func:`simulate_push`. A row is NaN where the centre of a finger would lie in the slider.
    """
    from stablepush.mechanics.kernels import rollout as _pushing
    from stablepush.mechanics.kernels.contacts import new_solution, new_touch, new_work

    profile = motion_profile(pusher, motion, step)
    total = int(profile.counts.sum())
    moved = pusher.fingers + np.stack((np.zeros_like(aside), aside), axis=-1)[:, None]
    offsets = np.column_stack((centers_of_mass, np.zeros(len(centers_of_mass))))
    begins, ends = compose(starts, offsets), np.full((len(starts), 3), np.nan)
    clear = ~_inside(slider, pusher.radius, transform_points(compose(inverse(starts), place), moved))
    tables = {k: _friction(frictions[k]).compiled() for k in np.unique(which[clear]).tolist()}

    def simulate(rows: np.ndarray) -> None:
        poses, pushers = np.zeros((total + 1, 3)), np.zeros((total + 1, 3))
        moves, loads = np.zeros((total, 3)), np.zeros((total, 3))
        points, forces = np.zeros((total, 2, 2)), np.zeros((total, 2, 2))
        modes, times, jams = np.zeros((total, 2), dtype=np.int64), np.zeros(total), np.zeros(total, dtype=np.bool_)
        room = new_touch(), new_touch(), new_solution(), new_work()
        for row in rows:
            table = tables[int(which[row])]
            body = _pushing.Pusher(moved[row], max(pusher.radius, _POINT), 0.0)
            _pushing.run(
                table, slider.vertices - centers_of_mass[row], body, float(mu[row]), begins[row], place,
                profile.twists, profile.durations, profile.counts, float(table.rho),
                poses, pushers, moves, loads, points, modes, forces, times, jams, *room,
            )  # fmt: skip
            ends[row] = poses[-1]

    in_threads(simulate, [rows for rows in np.array_split(np.flatnonzero(clear), _PARTS) if len(rows)])
    return compose(ends, inverse(offsets))


def _pieces(motion: Sequence[tuple[ArrayLike, float]]) -> list[tuple[FloatArray, float]]:
    try:
        pairs = [(twist, duration) for twist, duration in motion]
    except (TypeError, ValueError):
        raise InputError("motion", "expected pairs of a twist (3,) and a duration in s") from None
    return [(check_array(v, "motion", (3,)), check_number(d, "motion", at_least=0.0)) for v, d in pairs]


def _require_outside(slider: Slider, pusher: Pusher, start: FloatArray, place: FloatArray) -> None:
    """Refuse fingers whose centres lie in the slider: the contact law would let them pass through it."""
    if not pusher.flat and _inside(slider, pusher.radius, transform_points(compose(inverse(start), place), pusher.fingers)):
        raise InputError("place", "expected fingers outside of the slider, one has its centre inside")


def _inside(slider: Slider, radius: float, centers: FloatArray) -> BoolArray:
    """Whether the centre of any finger (..., k, 2), in B (m), lies in the slider, deeper than contacts of points are kept."""
    inside = shapely.contains_xy(slider.polygon, centers[..., 0], centers[..., 1])
    depth = np.zeros(inside.shape)
    depth[inside] = shapely.distance(shapely.LinearRing(slider.vertices), shapely.points(centers[inside]))
    return np.asarray((depth > max(0.0, _POINT_DEPTH - radius)).any(axis=-1))


def _friction(friction: TableFriction | LimitSurface) -> TableFriction:
    return friction if isinstance(friction, TableFriction) else TableFriction(friction)
