"""What an executor takes and gives, whichever engine it uses."""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

#: Share of a slider's mass in the feet, mass of a finger (kg), radius of a foot, height of the slider's middle and half
#: of its thickness (m), gravity (m/s²).
IN_FEET, HEAVY, FOOT, HEIGHT, HALF, GRAVITY = 0.999, 500.0, 0.002, 0.03, 0.01, 9.81


@dataclass(frozen=True, eq=False)
class SliderOnFeet:
    """A slider whose pressure is known: it rests on feet, each of which carries its share of the weight however it is pushed.

    Attributes
    ----------
    outline : array, shape (n, 2)
        Vertices in B (m), counter-clockwise.
    mass : float
        In kg.
    feet : array, shape (k, 2)
        In B (m). The centre of mass is where their shares have their mean.
    shares : array, shape (k,)
        Shares of the weight; their sum is 1.
    friction : float
        Coefficient of friction between feet and table.
    slope : array, shape (2,)
        Of the table: lateral gravity over g in W, it points downhill.
    grain : tuple of float
        Friction along a direction over that across it, and the direction (rad in W): the forces of a foot fill an ellipse whose
        mean radius (geometric) is that of ``friction``. MuJoCo alone has other ratios than 1.
    """

    outline: np.ndarray
    mass: float
    feet: np.ndarray
    shares: np.ndarray
    friction: float
    slope: np.ndarray = field(default_factory=lambda: np.zeros(2))
    grain: tuple[float, float] = (1.0, 0.0)


@dataclass(frozen=True, eq=False)
class Fingers:
    """Discs on one tool: ``centers`` (m, 2) in the pusher's frame (m), ``radius`` (m), ``friction`` with the slider."""

    centers: np.ndarray
    radius: float
    friction: float


@dataclass(frozen=True, eq=False)
class Execution:
    """What happened: times ``t`` (n,) in s, poses in W of ``slider`` (n, 3) and of the frame of the ``pusher`` (n, 3), and the
    ``wrench`` (n, 3) of the pusher on the slider in W, in N and, about the origin of the pusher's frame, N·m."""

    t: np.ndarray
    slider: np.ndarray
    pusher: np.ndarray
    wrench: np.ndarray


class Executor(ABC):
    """Moves fingers through poses and lets a slider on feet answer; ``tick`` (s) is between two commands to the fingers."""

    tick: float

    def __init__(self, fingers: Fingers) -> None:
        spheres = 0.4 * fingers.radius**2 + (fingers.centers**2).sum(axis=1)
        self._mass, self._inertia = HEAVY * len(spheres), HEAVY * float(spheres.sum())
        self._middle = fingers.centers.mean(axis=0)

    def follow(self, slider: np.ndarray, t: np.ndarray, pusher: np.ndarray) -> Execution:
        """Move the pusher's frame through poses (n, 3) at increasing times (n,) in s, straight from one to the next.

        The slider starts at a pose (3,). Both are in W (m, rad). The fingers are so heavy that the slider does not hold them up.
        """
        times, poses = np.asarray(t, dtype=float), np.array(pusher, dtype=float)
        poses[:, 2] = np.unwrap(poses[:, 2])
        count = max(1, round((times[-1] - times[0]) / self.tick))
        asked = times[0] + self.tick * np.arange(count + 1)
        wanted = np.stack([np.interp(asked, times, column) for column in poses.T], axis=-1)
        states, wrenches = np.empty((count + 1, 2, 3)), np.zeros((count + 1, 3))
        states[0] = self._place(np.asarray(slider, dtype=float), wanted[0])
        for k in range(1, count + 1):
            # what the slider held back is made up for
            rate = (wanted[k] - states[k - 1, 1]) / self.tick
            states[k], left = self._advance(rate)
            # what the pusher lost is what the slider got
            wrenches[k] = self._momentum(rate - left, states[k, 1, 2]) / self.tick
        return Execution(asked, states[:, 0], states[:, 1], wrenches)

    def _momentum(self, velocity: np.ndarray, heading: float) -> np.ndarray:
        """Momentum (3,) in W of a pusher that moves with a velocity (3,) in W, the angular one about its frame's origin."""
        c, s = np.cos(heading), np.sin(heading)
        x, y = c * self._middle[0] - s * self._middle[1], s * self._middle[0] + c * self._middle[1]
        vx, vy, omega = velocity
        return np.array(
            (
                self._mass * (vx - omega * y),
                self._mass * (vy + omega * x),
                self._inertia * omega + self._mass * (x * vy - y * vx),
            )
        )

    @abstractmethod
    def _place(self, slider: np.ndarray, pusher: np.ndarray) -> np.ndarray:
        """Place both (3,) at rest; their poses (2, 3)."""

    @abstractmethod
    def _advance(self, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the pusher a velocity (3,) in W and let a tick pass; the poses (2, 3) of slider and pusher, and the velocity (3,)
        that the pusher has left."""


def executor(engine: str, slider: SliderOnFeet, fingers: Fingers) -> Executor:
    """Return an executor in ``"mujoco"`` (extra ``sim``) or ``"drake"`` (extra ``drake``)."""
    if engine not in ("mujoco", "drake"):
        raise ValueError(f"engine: expected mujoco or drake, got {engine!r}")
    module = importlib.import_module(f"stablepush.engines.{engine}_executor")
    found: Executor = module.EXECUTOR(slider, fingers)
    return found
