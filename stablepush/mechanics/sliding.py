"""Free sliding: a body that was pushed or thrown decelerates under the friction of its support until it rests.

In the body frame, with ``(f, tau) = H_inv(V)`` the load of friction, ``J`` a quarter turn and ``I`` the moment of inertia about
the origin of B,

    m (dv/dt + omega J v) = -f,        I domega/dt = -tau.

In coordinates ``U = (√m vx, √m vy, √I omega)`` the kinetic energy is ``|U|²/2`` and friction acts along ``-G``,
``G = (fx/√m, fy/√m, tau/√I)``, which depends on the direction ``u = U/|U|`` alone. The speed ``r = |U|`` vanishes in finite
time while ``u`` converges, so the clock of the integration is ``s`` with ``dt = r ds``:

    du/ds = -(G - (G·u) u) - r² c(u),        d ln r/ds = -G·u,

``c`` being the term of the turning frame. Nothing in it is singular, and the end is ``s → ∞``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import ConvergenceError, FloatArray, InputError, brief, check_array, check_count, check_number, did_you_mean
from stablepush.geometry import cor_from_twist, unit
from stablepush.mechanics.kernels.inertia import Body
from stablepush.objects import Slider
from stablepush.surfaces import LimitSurface, check_surface

#: Turns of the body that are followed: each takes some 25 ms on support points, twice that on a polynomial.
_MOST_TURNS = 200
#: Evaluations of the rates that are made, some 10 to 20 s: friction off the centre of mass makes a fast body swing all the way,
#: and so does a surface that is not convex. Each evaluation of a friction of many parts counts as several.
_MOST_RATES = 300_000
#: Speed at which a slide counts as over, of the first speed; what it still travels is the square of that.
_OVER = 1e-8
#: A last motion that turns less than this, per unit of ``(vx, vy, rho*omega)``, is a translation.
_TURNS = 1e-6
#: Relative tolerance of the integration.
_RELATIVE = 1e-9
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

    def __repr__(self) -> str:
        return brief(self)


def simulate_free_sliding(  # noqa: PLR0913
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
    if variant not in VARIANTS:
        raise InputError("variant", f"expected {' or '.join(VARIANTS)}", f"{variant!r}{did_you_mean(variant, VARIANTS)}")
    body = Body(check_surface(surface, "surface"), slider, mu, gravity)
    first = check_array(twist, "twist", (3,))
    start = check_array(pose, "pose", (3,))
    check_count(samples, "samples", least=2, most=1_000_000)
    limit = np.inf if duration is None else check_number(duration, "duration", positive=True)
    if body.load == 0 and np.isinf(limit):
        raise InputError("duration", "expected a time in s, since without friction the body never rests")
    scaled = first * body.roots
    speed = float(np.linalg.norm(scaled))
    if speed == 0:
        still = np.zeros((1, 3))
        return Slide(np.zeros(1), start[None], still, still, np.zeros(1), np.zeros(3), np.full(2, np.nan), True)
    turning = body.turning if variant == "body" else lambda _: np.zeros(3)
    # in units of the first speed and of the time that the largest deceleration takes to stop it
    strongest = float(np.linalg.norm(body.friction(np.concatenate((np.eye(3), scaled[None] / speed))), axis=1).max())
    unit_time = speed / strongest if strongest > 0 else limit
    if not 0 < unit_time < np.inf:
        raise InputError("slider", "expected a mass and a friction that stop it in a time that numbers hold", f"{unit_time:g} s")
    turns = abs(float(first[2])) * min(unit_time, limit) / (2 * np.pi)
    if turns > _MOST_TURNS:
        raise InputError(
            "duration",
            f"the body turns some {turns:.0f} times, of which {_MOST_TURNS} can be followed: "
            f"expected a time in s to cut the slide at, of at most {_MOST_TURNS / turns * min(unit_time, limit):.4g}",
        )

    state = np.concatenate((scaled / speed, (0.0, 0.0), start))
    solution = _integrated(body, turning, state, speed, unit_time, limit)
    at_rest = len(solution.t_events[0]) > 0
    clock = _even(solution.sol, float(solution.t[-1]), samples)
    states = solution.sol(clock).T
    directions = unit(states[:, :3])
    shrink = np.exp(states[:, 3])
    friction = body.friction(directions)
    t = unit_time * states[:, 4]
    t[0] = 0.0
    twists = (speed * shrink)[:, None] * directions / body.roots
    twists[0] = first
    energy = 0.5 * (speed * shrink) ** 2
    if at_rest:
        # the rest of the path at the last deceleration
        t[-1] += speed * shrink[-1] / float(friction[-1] @ directions[-1])
        twists[-1], energy[-1] = 0.0, 0.0
    last = directions[-1] / body.roots
    rho = surface.characteristic_length
    direction = unit(last * (1, 1, rho)) / (1, 1, rho)
    # what turns less translates: the integration knows no better
    cor = cor_from_twist(direction)[0] if abs(rho * direction[2]) > _TURNS else np.full(2, np.nan)
    return Slide(t, states[:, 5:].copy(), twists, friction * body.roots, energy, direction, cor, at_rest)


def _integrated(
    body: Body,
    turning: Callable[[FloatArray], FloatArray],
    state: FloatArray,
    speed: float,
    unit_time: float,
    limit: float,
) -> Any:
    """The solution of the slide from a state (8,): direction of the motion, logarithm of its share of the first speed (m/s), time
    over ``unit_time`` (s), and pose; to rest, or to the ``limit`` (s)."""
    from scipy.integrate import solve_ivp

    rates = 0

    def rate(_: float, state: FloatArray) -> FloatArray:
        nonlocal rates
        rates += body.cost
        if rates > _MOST_RATES:
            raise InputError(
                "duration",
                "the body swings too often to be followed to its end: "
                f"expected a time in s to cut the slide at, of at most {0.9 * unit_time * state[4]:.4g}",
            )
        u, shrink = state[:3], np.exp(state[3])
        norm = np.linalg.norm(u)
        u = u / norm
        friction = body.friction(u[None])[0] * (unit_time / speed)
        along = friction @ u
        v = u / body.roots * (speed * unit_time)
        cos, sin = np.cos(state[7]), np.sin(state[7])
        bend = turning(u) * (speed * unit_time * shrink**2)
        # the length of u is kept at one
        direction = along * u - friction - bend + (1 - norm) * u
        place = shrink**2 * np.array((cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]))
        return np.concatenate((direction, (-along, shrink), place))

    def over(_: float, state: FloatArray) -> float:
        return float(state[3] - np.log(_OVER))

    def cut(_: float, state: FloatArray) -> float:
        return float(limit / unit_time - state[4])

    over.terminal = cut.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        rate, (0.0, 1e4), state, method="LSODA", rtol=_RELATIVE, atol=1e-12, events=(over, cut), dense_output=True
    )
    if solution.status != 1:
        why = solution.message if solution.status < 0 else "the body does not come to rest within the integration limit"
        raise ConvergenceError(f"free sliding: {why}")
    return solution


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
