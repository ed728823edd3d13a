"""Free sliding: a body that was pushed or thrown decelerates under the friction of its support until it rests.

In the body frame, with ``(f, tau) = H_inv(V)`` the load of friction, ``J`` a quarter turn and ``I`` the moment of inertia about
the origin of B,

    m (dv/dt + omega J v) = -f,        I domega/dt = -tau.

In coordinates ``U = (√m vx, √m vy, √I omega)`` the kinetic energy is ``|U|²/2`` and friction pulls along ``-G``,
``G = (fx/√m, fy/√m, tau/√I)``, which depends on the direction ``u = U/|U|`` alone. The speed ``r = |U|`` vanishes in finite
time while ``u`` converges, so the clock of the integration is ``s`` with ``dt = r ds``:

    du/ds = -(G - (G·u) u) - r² c(u),        d ln r/ds = -G·u,

``c`` being the term of the turning frame. Nothing in it is singular, and the end is ``s → ∞``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stablepush._arrays import BoolArray, FloatArray, check_array, check_number
from stablepush.errors import ConvergenceError, InputError
from stablepush.models import IdealLimitSurface, LimitSurface
from stablepush.planar import cor_from_twist, unit
from stablepush.slider import Slider

#: Turns of the body that are followed: each takes some 25 ms.
_MOST_TURNS = 1000
#: Evaluations of the rates that are made, some 20 s: friction off the centre of mass makes a fast body swing all the way.
_MOST_RATES = 1_500_000
#: Speed at which a slide counts as over, of the first speed; what it still travels is the square of that.
_OVER = 1e-8
#: Support points this much slower than the slider, in the norm of U, have friction in proportion to their speed.
_CREEP = 1e-7
#: A last motion that turns less than this, per unit of ``(vx, vy, rho*omega)``, is a translation.
_TURNS = 1e-6
#: Relative tolerance of the integration.
_RELATIVE = 1e-9
#: Points of the sphere between which eigen-directions are sought, and how often they are made four times as many.
_GRID, _REFINEMENTS = 1500, 3
#: Directions so near (rad) to the translations are taken for them, where all translations are kept.
_BELT = 0.01
#: Directions that differ by less (rad) are one.
_SAME = 1e-5
VARIANTS = ("body", "paper")


@dataclass(frozen=True, slots=True, eq=False)
class Slide:
    """A free slide, sampled evenly in time from its start to its end.

    Attributes
    ----------
    t : array, shape (n,)
        Time in s; the last is when the body rests, or when the slide was cut.
    poses : array, shape (n, 3)
        Of B in W.
    twists : array, shape (n, 3)
        In B (m/s, rad/s).
    wrenches : array, shape (n, 3)
        Load of friction ``H_inv(V)`` (N, N·m), in B; its last row is that of the final direction.
    energy : array, shape (n,)
        Kinetic energy in J; it never grows.
    direction : array, shape (3,)
        Direction of the last motion, of unit length in ``(vx, vy, rho*omega)``: an eigen-direction if the body came to rest.
    cor : array, shape (2,)
        COR (m, in B) of that motion; NaN for a translation.
    at_rest : bool
        False if the slide was cut by ``duration``.
    """

    t: FloatArray
    poses: FloatArray
    twists: FloatArray
    wrenches: FloatArray
    energy: FloatArray
    direction: FloatArray
    cor: FloatArray
    at_rest: bool


@dataclass(frozen=True, slots=True, eq=False)
class EigenDirections:
    """Directions of motion that sliding keeps: the load, over inertia, points against the motion.

    They are the critical points of the power ``h(u) = F·V`` on the unit sphere of ``U``, down which directions drift.

    Attributes
    ----------
    twists : array, shape (n, 3)
        Of unit length in ``(vx, vy, rho*omega)``.
    kinds : list of {"stable", "saddle", "unstable"}
        Minima of the power attract; nothing ends in the others.
    decelerations : array, shape (n,)
        ``h(u)`` in √(kg) m/s²: slides end sooner along larger ones.
    translations : array, shape (m, 2)
        If the centre of pressure lies under the centre of mass, friction does not turn a body that translates: every translation
        is kept. Those in these intervals of angles (rad in B, the second up to a turn after the first) attract, the others
        start to turn. Empty if translations are not kept, or none attracts.
    complete : bool
        Whether minima - saddles + maxima is what the topology of the sphere asks for: else some are missing, or there is
        a continuum of them, as for a body of revolution.
    """

    twists: FloatArray
    kinds: list[str]
    decelerations: FloatArray
    translations: FloatArray
    complete: bool


class _Body:
    """Inertia and friction of a slider, in the coordinates U."""

    def __init__(self, surface: LimitSurface, slider: Slider, mu: float | None, gravity: float) -> None:
        if slider.mass is None or slider.mass <= 0:
            raise InputError("slider.mass: expected a mass > 0 in kg, which free sliding needs")
        check_number(gravity, "gravity", above=0.0)
        self.surface, self.mass = surface, slider.mass
        self.inertia = slider.mass * slider.radius_of_gyration**2
        self.roots = np.sqrt((self.mass, self.mass, self.inertia))
        self.load = 1.0
        if surface.force_unit == "mu*N":
            if mu is None:
                raise InputError("mu: expected the friction of the support, since the forces of the model are in units of mu*N")
            self.load = check_number(mu, "mu", at_least=0.0) * self.mass * gravity
        self._points = self._loads = np.zeros((0, 2))
        if isinstance(surface, IdealLimitSurface):
            self._points, self._loads = surface.support.points, surface.loads

    def pull(self, directions: FloatArray) -> FloatArray:
        """``G`` (n, 3) of unit vectors U (n, 3)."""
        twists = directions / self.roots
        if len(self._points):
            return self._wrench_of_points(twists) / self.roots
        return self.load * self.surface.wrench(twists) / self.roots

    def _wrench_of_points(self, twists: FloatArray) -> FloatArray:
        """Load (n, 3) of Coulomb friction that grows with the speed of points that all but rest: no jump, no chatter."""
        x, y = self._points.T
        vx = twists[:, :1] - twists[:, 2:] * y
        vy = twists[:, 1:2] + twists[:, 2:] * x
        share = self._loads / np.sqrt(vx**2 + vy**2 + _CREEP**2 / self.mass)
        fx, fy = share * vx, share * vy
        return np.stack((fx.sum(axis=1), fy.sum(axis=1), (x * fy - y * fx).sum(axis=1)), axis=-1)

    def turning(self, direction: FloatArray) -> FloatArray:
        """``c`` (3,) of a unit vector U."""
        omega = direction[2] / self.roots[2]
        return np.array((-omega * direction[1], omega * direction[0], 0.0))


def simulate_free_sliding(
    surface: LimitSurface,
    slider: Slider,
    twist: ArrayLike,
    *,
    mu: float | None = None,
    gravity: float = 9.81,
    pose: ArrayLike = (0.0, 0.0, 0.0),
    duration: float | None = None,
    samples: int = 201,
    variant: str = "body",
) -> Slide:
    """Simulate a free slide until the body rests.

    The slider's mass is spread evenly over its outline, which gives the moment of inertia about the origin of B. Coulomb friction
    at support points acts in full on points that move; in the limit of a turn about a support point that point creeps at 1e-7
    of the slider's speed.

    Parameters
    ----------
    surface : LimitSurface
        Forces in N, or in units of ``mu*N`` with ``N = mass * gravity``.
    slider : Slider
        With a mass (kg).
    twist : array-like, shape (3,)
        First body twist (m/s, rad/s).
    mu : float, optional
        Friction of the support; needed for surfaces in units of ``mu*N``, else not used.
    gravity : float
        In m/s².
    pose : array-like, shape (3,)
        First pose of B in W.
    duration : float, optional
        Time (s) after which the slide is cut if the body still moves; needed if there is no friction.
    samples : int
        Rows of the result.
    variant : {"body", "paper"}
        ``"paper"`` leaves out the term of the turning frame, ``I dV/dt = -H_inv(V)``, as Zhou et al. (2016) write it: a body that
        spins without friction then does not go straight.

    Raises
    ------
    InputError
        If mass, mu or duration are needed and not given.
    ConvergenceError
        If the integration fails.

    Notes
    -----
    Goyal, Ruina, Papadopoulos (1991), Planar sliding with dry friction, part 2.
    """
    from scipy.integrate import solve_ivp

    if variant not in VARIANTS:
        raise InputError(f"variant: expected {' or '.join(VARIANTS)}, got {variant!r}")
    body = _Body(surface, slider, mu, gravity)
    first = check_array(twist, "twist", (3,))
    start = check_array(pose, "pose", (3,))
    if isinstance(samples, bool) or not isinstance(samples, int | np.integer) or samples < 2:
        raise InputError(f"samples: expected at least 2, got {samples!r}")
    limit = np.inf if duration is None else check_number(duration, "duration", above=0.0)
    if body.load == 0 and np.isinf(limit):
        raise InputError("duration: expected a time in s, since without friction the body never rests")
    scaled = first * body.roots
    speed = float(np.linalg.norm(scaled))
    if speed == 0:
        still = np.zeros((1, 3))
        return Slide(np.zeros(1), start[None], still, still, np.zeros(1), np.zeros(3), np.full(2, np.nan), True)
    turning = body.turning if variant == "body" else lambda _: np.zeros(3)
    # in units of the first speed and of the time that the largest deceleration takes to stop it
    strongest = float(np.linalg.norm(body.pull(np.concatenate((np.eye(3), scaled[None] / speed))), axis=1).max())
    unit_time = speed / strongest if strongest > 0 else limit
    turns = abs(float(first[2])) * min(unit_time, limit) / (2 * np.pi)
    if turns > _MOST_TURNS:
        raise InputError(
            f"duration: the body turns some {turns:.0f} times, of which {_MOST_TURNS} can be followed: expected a time in s to "
            f"cut the slide at, of at most {_MOST_TURNS / turns * min(unit_time, limit):.4g}"
        )

    rates = 0

    def rate(_: float, state: FloatArray) -> FloatArray:
        nonlocal rates
        rates += 1
        if rates > _MOST_RATES:
            raise InputError(
                "duration: the body swings too often to be followed to its end: expected a time in s to cut the slide at, of at "
                f"most {0.9 * unit_time * state[4]:.4g}"
            )
        u, shrink = state[:3], np.exp(state[3])
        norm = np.linalg.norm(u)
        u = u / norm
        pull = body.pull(u[None])[0] * (unit_time / speed)
        along = pull @ u
        v = u / body.roots * (speed * unit_time)
        cos, sin = np.cos(state[7]), np.sin(state[7])
        bend = turning(u) * (speed * unit_time * shrink**2)
        # the length of u is kept at one
        direction = along * u - pull - bend + (1 - norm) * u
        place = shrink**2 * np.array((cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]))
        return np.concatenate((direction, (-along, shrink), place))

    def over(_: float, state: FloatArray) -> float:
        return float(state[3] - np.log(_OVER))

    def cut(_: float, state: FloatArray) -> float:
        return float(limit / unit_time - state[4])

    over.terminal = cut.terminal = True  # type: ignore[attr-defined]
    state = np.concatenate((scaled / speed, (0.0, 0.0), start))
    solution = solve_ivp(
        rate, (0.0, 1e4), state, method="LSODA", rtol=_RELATIVE, atol=1e-12, events=(over, cut), dense_output=True
    )
    if solution.status != 1:
        why = solution.message if solution.status < 0 else "the body does not come to rest in the time that it should take"
        raise ConvergenceError(f"free sliding: {why}")
    at_rest = len(solution.t_events[0]) > 0
    clock = _even(solution.sol, float(solution.t[-1]), samples)
    states = solution.sol(clock).T
    directions = unit(states[:, :3])
    shrink = np.exp(states[:, 3])
    pulls = body.pull(directions)
    t = unit_time * states[:, 4]
    t[0] = 0.0
    twists = (speed * shrink)[:, None] * directions / body.roots
    twists[0] = first
    energy = 0.5 * (speed * shrink) ** 2
    if at_rest:
        # the rest of the way at the last deceleration
        t[-1] += speed * shrink[-1] / float(pulls[-1] @ directions[-1])
        twists[-1], energy[-1] = 0.0, 0.0
    last = directions[-1] / body.roots
    rho = surface.characteristic_length
    direction = unit(last * (1, 1, rho)) / (1, 1, rho)
    # what turns less translates: the integration knows no better
    cor = cor_from_twist(direction)[0] if abs(rho * direction[2]) > _TURNS else np.full(2, np.nan)
    return Slide(t, states[:, 5:].copy(), twists, pulls * body.roots, energy, direction, cor, at_rest)


def _even(state: Callable[[FloatArray], FloatArray], end: float, samples: int) -> FloatArray:
    """Values of the integration's clock (samples,) that are even in time, by bisection: time grows with the clock."""
    wanted = np.linspace(0.0, float(state(np.array([end]))[4, 0]), samples)
    low, high = np.zeros(samples), np.full(samples, end)
    for _ in range(60):
        middle = (low + high) / 2
        early = state(middle)[4] < wanted
        low, high = np.where(early, middle, low), np.where(early, high, middle)
    result = (low + high) / 2
    result[0], result[-1] = 0.0, end
    return result


def eigen_directions(surface: LimitSurface, slider: Slider, *, mu: float | None = None, gravity: float = 9.81) -> EigenDirections:
    """Return all directions of motion that free sliding keeps, and which of them attract.

    Parameters are those of :func:`simulate_free_sliding`. The sphere of directions is searched for critical points of the power,
    from the local minima of its slope on a grid, until their count is what topology asks for (Poincaré and Hopf). Turns about a
    support point attract if the rest of the friction pulls it less than it can hold.
    """
    from scipy.spatial import cKDTree

    body = _Body(surface, slider, 1.0 if mu is None and surface.force_unit == "mu*N" else mu, gravity)
    pivots = _pivots(body)
    kept, translations = _translations(body)
    wanted = _index(body, 1.0) + _index(body, -1.0) if kept else 2
    found: list[tuple[FloatArray, str]] = []
    complete = False
    count = _GRID
    for _ in range(_REFINEMENTS):
        grid = _sphere(count)
        slope = np.linalg.norm(_drift(body, grid), axis=1)
        neighbours = cKDTree(grid).query(grid, k=9)[1]
        starts = grid[slope <= slope[neighbours].min(axis=1)]
        found = [(u, "stable") for u in pivots]
        for begin in starts:
            u = _critical(body, begin)
            if u is None or (kept and abs(u[2]) < _BELT):
                continue
            if all(np.linalg.norm(u - other) > _SAME for other, _ in found):
                found.append((u, _kind(body, u)))
        kinds = [kind for _, kind in found]
        complete = kinds.count("stable") - kinds.count("saddle") + kinds.count("unstable") == wanted
        if complete:
            break
        count *= 4
    directions = np.array([u for u, _ in found]).reshape(-1, 3)
    power = (body.pull(directions) * directions).sum(axis=1) if len(directions) else np.zeros(0)
    order = np.argsort(power, kind="stable")
    rho = surface.characteristic_length
    twists = unit(directions / body.roots * (1, 1, rho)) / (1, 1, rho)
    return EigenDirections(twists[order], [found[i][1] for i in order], power[order], translations, complete)


def sliding_basins(
    surface: LimitSurface, slider: Slider, twists: ArrayLike, *, mu: float | None = None, gravity: float = 9.81
) -> tuple[EigenDirections, np.ndarray]:
    """Return the eigen-directions and, for slow slides that begin along ``twists`` (n, 3), the number of the one they end in.

    Slow: the turning of the frame, which grows with the square of the speed, is left out. -1 where a direction has not
    settled near any of them.
    """
    v = check_array(twists, "twists", (None, 3))
    found = eigen_directions(surface, slider, mu=mu, gravity=gravity)
    body = _Body(surface, slider, 1.0 if mu is None and surface.force_unit == "mu*N" else mu, gravity)
    targets = unit(found.twists * body.roots)
    u = unit(v * body.roots)
    step = 0.05 / max(float(np.linalg.norm(_drift(body, u), axis=1).max()), 1e-300)
    result = np.full(len(u), -1)
    for _ in range(20_000):
        move = _drift(body, u)
        middle = unit(u + step / 2 * move)
        u = unit(u + step * _drift(body, middle))
        near = np.linalg.norm(u[:, None] - targets[None], axis=2)
        result = np.where(near.min(axis=1) < 0.02, near.argmin(axis=1), -1) if len(targets) else result
        if (result >= 0).all() and np.isin(result, [i for i, k in enumerate(found.kinds) if k == "stable"]).all():
            break
    return found, result


def _sphere(count: int) -> FloatArray:
    """Points (count, 3) spread evenly over the unit sphere (a spiral by the golden angle)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (3 - np.sqrt(5)) * k
    return np.stack((np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z), axis=-1)


def _drift(body: _Body, directions: FloatArray) -> FloatArray:
    """Rates (n, 3) at which directions change: down the slope of the power on the sphere."""
    pull = body.pull(directions)
    return (pull * directions).sum(axis=1, keepdims=True) * directions - pull


def _tangents(u: FloatArray) -> FloatArray:
    """Two unit vectors (2, 3) across a unit vector."""
    first = unit(np.cross(u, np.eye(3)[np.argmin(np.abs(u))]))
    return np.stack((first, np.cross(u, first)))


def _slopes(body: _Body, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slope (2,) of the power on the sphere, in the tangents of ``u``, and second derivatives (2, 2) by differences."""
    basis = _tangents(u)
    width = 1e-5
    moved = unit(np.concatenate((u[None], u + width * basis, u - width * basis)))
    drift = -_drift(body, moved)
    # slopes at the neighbours in the basis at u: the part along u of a tangent vector is of second order
    return basis @ drift[0], (drift[1:3] - drift[3:5]) @ basis.T / (2 * width)


def _critical(body: _Body, start: FloatArray) -> FloatArray | None:
    """Newton from a direction to a critical point of the power nearby, or None."""
    u = start
    scale = float(np.linalg.norm(body.pull(u[None])))
    for _ in range(50):
        slope, bend = _slopes(body, u)
        if np.linalg.norm(slope) < 1e-10 * scale:
            return u if np.linalg.norm(u - start) < 1.0 else None
        try:
            step = -np.linalg.solve(bend, slope)
        except np.linalg.LinAlgError:
            return None
        size = float(np.linalg.norm(step))
        u = unit(u + min(1.0, 0.2 / max(size, 1e-300)) * step @ _tangents(u))
    return None


def _kind(body: _Body, u: FloatArray) -> str:
    bend = _slopes(body, u)[1]
    low, high = np.linalg.eigvalsh((bend + bend.T) / 2)
    return "stable" if low > 0 else "unstable" if high < 0 else "saddle"


def _belt(height: float) -> FloatArray:
    """Unit vectors U (n, 3) all round the axis of pure turning, at a height: translations at zero."""
    angles = np.linspace(-np.pi, np.pi, 2000, endpoint=False)
    width = np.sqrt(1 - height**2)
    return np.stack((width * np.cos(angles), width * np.sin(angles), np.full(2000, height)), axis=-1)


def _translations(body: _Body) -> tuple[bool, FloatArray]:
    """Whether friction keeps all translations, and the intervals of angles (n, 2) of those that attract."""
    if np.abs(_drift(body, _belt(0.0))).max() > 1e-9 * np.abs(body.pull(_belt(0.0))).max():
        return False, np.zeros((0, 2))
    height = _BELT / 2
    # they attract where both neighbours drift back
    back = (_drift(body, _belt(height))[:, 2] < 0) & (_drift(body, _belt(-height))[:, 2] > 0)
    if back.all():
        return True, np.array(((-np.pi, np.pi),))
    step = 2 * np.pi / len(back)
    begins = np.flatnonzero(back & ~np.roll(back, 1))
    lengths = [int(np.argmin(np.roll(back, -b))) for b in begins]
    return True, np.array(
        [(-np.pi + b * step, -np.pi + (b + n - 1) * step) for b, n in zip(begins, lengths, strict=True)]
    ).reshape(-1, 2)


def _index(body: _Body, side: float) -> int:
    """Minima - saddles + maxima on one side of the translations: how often the drift turns along the edge of that cap."""
    edge = _belt(side * _BELT)
    drift = _drift(body, edge)
    # stereographic projection of the cap to a disc
    low = 1 + side * edge[:, 2:]
    flat = (drift[:, :2] * low - edge[:, :2] * side * drift[:, 2:]) / low**2
    angles = np.unwrap(np.arctan2(flat[:, 1], flat[:, 0]), discont=np.pi)
    closing = (angles[0] - angles[-1] + np.pi) % (2 * np.pi) - np.pi
    return round(float(angles[-1] + closing - angles[0]) / (2 * np.pi))


def _pivots(body: _Body) -> list[FloatArray]:
    """Turns about support points that attract: the others pull the point along with less than its friction can hold."""
    result: list[FloatArray] = []
    points, loads = body._points, body._loads
    for k in range(len(points)):
        if loads[k] <= 0:
            continue
        for sense in (1.0, -1.0):
            u = unit(np.array((points[k, 1], -points[k, 0], 1.0)) * sense * body.roots)
            # friction f at the point adds (f, x × f), which has to cancel the drift
            others: BoolArray = np.linalg.norm(points - points[k], axis=1) > 1e-12
            held = float(loads[~others].sum())
            metric = np.array(((1.0, 0.0, -points[k, 1]), (0.0, 1.0, points[k, 0]))) / body.roots
            pull = _drift(body, u[None])[0]
            force, *_ = np.linalg.lstsq(_tangents(u) @ metric.T, _tangents(u) @ pull, rcond=None)
            if np.linalg.norm(force) < held:
                result.append(u)
    return result
