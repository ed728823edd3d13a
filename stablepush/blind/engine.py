"""A world's pushes: what a heavy pusher with an imposed motion does to a slider on feet, whichever engine carries it out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from stablepush.blind.laws import feet_of, turned
from stablepush.blind.worlds import GRAVITY, Push, World

#: Share of the mass that is in the feet, mass of a finger (kg), radius of a foot, heights of the slider's middle and of its half.
IN_FEET, HEAVY, FOOT, HEIGHT, HALF = 0.999, 500.0, 0.002, 0.03, 0.01
#: Travel (m) after which a push is recorded, where inertia is to show and where it is not; share of the speed at first, where it
#: is; force (N) at which friction of the form "load" is nominal.
_MOVES, _FROM, _NOMINAL_FORCE = (5e-5, 5e-4), 0.25, 1.5
#: Friction of the fingers, at least.
_LEAST_MU = 0.02


@dataclass(frozen=True)
class Truth:
    """What really happened in a push, as means over its parts (n,): times (s), poses (n, 3) of the slider and of the pusher's
    centre in W, forces (n, 3) that the pusher exerts in W with the moment about its centre, body twists (n, 3) and accelerations
    (n, 3) of the slider in W, fingers (n, 2) that touch; and all poses (m, 3) of the slider at times (m,)."""

    time: np.ndarray
    pose: np.ndarray
    pusher: np.ndarray
    force: np.ndarray
    twist: np.ndarray
    acceleration: np.ndarray
    touches: np.ndarray
    fine_time: np.ndarray
    fine_pose: np.ndarray


@dataclass(frozen=True)
class State:
    """After a tick: poses (3,) of the slider and of the pusher's centre in W, their velocities (3,) in W, fingers (2,) that
    touch."""

    slider: np.ndarray
    pusher: np.ndarray
    slider_rate: np.ndarray
    pusher_rate: np.ndarray
    touches: tuple[bool, bool]


def contact_mu_under(world: World, force: np.ndarray) -> np.ndarray:
    """Friction (...) of the fingers under forces (..., 2) of the pusher, in N."""
    contact_mu = world.of("contact-friction")
    if contact_mu is None or contact_mu.form != "load":
        change = 0.0 if contact_mu is None else contact_mu.numbers["change"]
        return np.full(force.shape[:-1], max(_LEAST_MU, world.contact_mu + change))
    # a single finger has all of the load, two share it
    size = np.linalg.norm(force, axis=-1) / (2 if world.two else 1)
    return np.maximum(_LEAST_MU, world.contact_mu + contact_mu.numbers["change"] * 2 * size / (size + _NOMINAL_FORCE))


class Engine(ABC):
    """A world's slider and pusher; friction and motion are reset in every tick of ``tick`` s."""

    name: str
    tick: float

    def __init__(self, world: World) -> None:
        self.world = world
        self.feet, self.weights = feet_of(world)
        self.fingers = np.array(((0.0, world.half), (0.0, -world.half))) if world.two else np.zeros((1, 2))
        radii = np.full(len(self.fingers), world.radius)
        geometry = world.of("contact-geometry")
        if geometry is not None:
            radii[: 1 if geometry.form == "one-finger" else 2] += geometry.numbers["change"]
        self.radii = np.maximum(radii, 5e-4)
        self.contact_mu = float(contact_mu_under(world, np.zeros(2)))
        self._transfer = world.of("load-transfer")

    @abstractmethod
    def begin(self, slider: np.ndarray, pusher: np.ndarray) -> None:
        """Place slider and pusher (3,), at rest."""

    @abstractmethod
    def advance(self, imposed: np.ndarray, order: float, force: np.ndarray) -> State:
        """Give the pusher a velocity (3,) in W and let a tick pass; ``order``: of the push in the log; ``force`` (2,): of the
        pusher, of late."""

    def push(self, push: Push, order: float) -> Truth:
        """Carry out a push; ``order``: its place in the log, 0 to 1."""
        w = self.world
        rotation = turned(push.start[2])
        # fingers thicker or thinner than they are believed to be begin as far from the slider
        toward = push.place[2]
        place = push.place[:2] - (self.radii.max() - w.radius) * np.array((np.cos(toward), np.sin(toward)))
        pusher = np.array((*(push.start[:2] + rotation @ place), push.start[2] + toward))
        self.begin(push.start, pusher)
        steps = max(8, round(push.duration / self.tick))
        begin = _FROM * push.speed if push.acceleration else push.speed
        ramp = max((push.speed - begin) / push.acceleration, self.tick / 4) if push.acceleration else self.tick / 4
        mass = np.array((*([HEAVY * len(self.fingers)] * 2), self._turning_mass()))
        rows = np.empty((steps, 13))
        touches = np.zeros((steps, 2), dtype=bool)
        smooth = np.zeros(2)
        for i in range(steps):
            c, s = np.cos(pusher[2]), np.sin(pusher[2])
            share = (begin + (push.speed - begin) * self._ramped(min(1.0, i * self.tick / ramp))) / push.speed
            vx, vy, omega = share * push.twist
            imposed = np.array((c * vx - s * vy, s * vx + c * vy, omega))
            state = self.advance(imposed, order, smooth)
            # what the pusher lost is what the slider got
            force = mass * (imposed - state.pusher_rate) / self.tick
            smooth += 0.2 * (force[:2] - smooth)
            pusher = state.pusher
            rows[i] = ((i + 1) * self.tick, *state.slider, *pusher, *force, *state.slider_rate)
            touches[i] = state.touches
        return self._means(rows, touches, _MOVES[0] if push.acceleration else _MOVES[1])

    def _ramped(self, share: float) -> float:
        """Share of the speed that is gained after a share of the time in which it is."""
        inertia = self.world.of("inertia")
        form = "mass" if inertia is None else inertia.form
        return {"mass": share, "smooth": share**2 * (3 - 2 * share), "late": share**2, "early": share * (2 - share)}[form]

    def contact_mu_at(self, force: np.ndarray) -> float:
        """Friction of the fingers under a force (2,) in N."""
        return float(contact_mu_under(self.world, force))

    def lifted(self, arms: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Vertical forces (k,) on the feet, at arms (k, 2) in W, that pushing above the table brings."""
        if self._transfer is None:
            return np.zeros(len(arms))
        spread = (arms * self.weights[:, None]).T @ arms
        more = self._transfer.numbers["height"] * self.weights * (arms @ np.linalg.solve(spread, force))
        return -np.clip(more, -0.9 * self.normal, 2 * self.normal)

    @property
    def normal(self) -> np.ndarray:
        """Loads (k,) of the feet in N, of their weight alone."""
        return np.asarray(self.weights * self.world.mass * GRAVITY)

    def _turning_mass(self) -> float:
        """Moment of inertia (kg m²) of the pusher about its centre."""
        spheres = 0.4 * HEAVY * self.radii**2
        return float((spheres + HEAVY * (self.fingers**2).sum(axis=1)).sum())

    def _means(self, rows: np.ndarray, touches: np.ndarray, least: float) -> Truth:
        """Means over equal parts of the time in which the slider moves."""
        travelled = np.hypot(*(rows[:, 1:3] - rows[0, 1:3]).T) + 0.03 * np.abs(rows[:, 3] - rows[0, 3])
        moves = np.flatnonzero(travelled > least)
        first = int(moves[0]) if len(moves) else len(rows) // 2
        parts = [p for p in np.array_split(np.arange(first, len(rows)), self.world.rows) if len(p) > 4]
        mean = np.array([rows[p].mean(axis=0) for p in parts])
        span = np.array([(len(p) - 1) * self.tick for p in parts])[:, None]
        moved = np.array([rows[p[-1], 1:4] - rows[p[0], 1:4] for p in parts]) / span
        turn = turned(mean[:, 3])
        twist = np.column_stack((np.einsum("nji,nj->ni", turn, moved[:, :2]), moved[:, 2]))
        gained = np.array([rows[p[-1], 10:13] - rows[p[0], 10:13] for p in parts]) / span
        return Truth(
            mean[:, 0], mean[:, 1:4], mean[:, 4:7], mean[:, 7:10], twist, gained,
            np.array([touches[p].mean(axis=0) > 0.5 for p in parts]), rows[:, 0], rows[:, 1:4],
        )  # fmt: skip
