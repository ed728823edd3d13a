"""Random rigs of a campaign of loops: a slider on feet, two fingers, pokes from before something goes wrong, and what does. Only
numpy, and the worlds of the blind check.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stablepush.blind.worlds import GRAVITY, slider_on_feet

#: What goes wrong. The first four spoil plans: of 12 default plans of other loops (seed 991) 8 or 9 arrived with each of them,
#: all 12 with each of the others.
SPOILING = ("contact-friction", "pressure-shift", "anisotropy-world", "tilt")
CAUSES = (*SPOILING, "nothing", "contact-place", "contact-geometry", "latency", "force-bias", "frame-offset")
#: Causes in turn: of 22 loops, four have each of those that spoil plans, and one each of the others.
IN_TURN = tuple(cause for k, other in enumerate(CAUSES[4:]) for cause in (*SPOILING[: 4 if k < 4 else 0], other))
#: Sizes: share that is left of the friction of the fingers, from and to; m along the edge, of radius, of the feet; friction along
#: the grain over that across it; rad; s; N; m.
SIZES: dict[str, Any] = {
    "contact-friction": (0.5, 0.75), "contact-place": 0.004, "contact-geometry": 0.002, "pressure-shift": 0.008,
    "anisotropy-world": 1.3, "tilt": float(np.radians(2.0)), "latency": 0.1, "force-bias": 0.3, "frame-offset": 0.004,
}  # fmt: skip
#: Pokes before, and their relative noise; noise of the log: N, m, rad; radius (m) of the fingers.
POKES, POKE_NOISE, NOISE, FINGER = 8, 0.03, (0.03, 1.5e-4, 2e-3), 0.004
#: Plans that are logged, and goals of the plans that follow.
LOGGED, AFTERWARDS = 5, 2


@dataclass(frozen=True, eq=False)
class LoopWorld:
    """A rig, what it was believed to be, and what is wrong with it.

    ``points`` (2, 2), ``normal`` (2,): where the fingers touch, in B; ``loads``, ``twists`` (n, 3): pokes from before; ``tasks``
    (m, 2, 3): start and goal of each plan in W; ``cause``, ``numbers``: what is wrong.
    """

    outline: np.ndarray
    feet: np.ndarray
    weights: np.ndarray
    mass: float
    mu: float
    contact_mu: float
    points: np.ndarray
    normal: np.ndarray
    loads: np.ndarray
    twists: np.ndarray
    tasks: np.ndarray
    cause: str
    numbers: dict[str, Any] = field(default_factory=dict)

    def true(self, cause: str, without: Any) -> Any:
        """What a cause makes of a number of the rig; ``without`` it."""
        return self.numbers["value"] if self.cause == cause else without


def draw_loop(seed: int, number: int) -> LoopWorld:
    """The rig of a loop: the same for the same numbers."""
    rng = np.random.default_rng([seed, number, 5])
    while True:
        outline, feet, weights = slider_on_feet(rng)
        lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
        edge = int(np.argmax(lengths))
        if lengths[edge] > 0.06:
            break
    a, b = outline[edge], outline[(edge + 1) % len(outline)]
    along = (b - a) / lengths[edge]
    width = min(0.03, 0.4 * float(lengths[edge]))
    # before the centre of mass, as far as the edge allows
    middle = float(np.clip(-a @ along, width / 2 + 0.008, lengths[edge] - width / 2 - 0.008))
    points = a + along * np.array((middle - width / 2, middle + width / 2))[:, None]
    normal = np.array((-along[1], along[0]))
    mass, mu, contact_mu = float(rng.uniform(0.6, 1.4)), float(rng.uniform(0.2, 0.4)), float(rng.uniform(0.3, 0.6))
    rho = float(np.sqrt(weights @ (feet**2).sum(axis=1)))
    twists = rng.normal(size=(POKES, 3)) / (1.0, 1.0, rho)
    velocity = twists[:, None, :2] + twists[:, None, 2:] * np.stack((-feet[:, 1], feet[:, 0]), axis=-1)
    unit = velocity / np.linalg.norm(velocity, axis=2, keepdims=True)
    force = mu * mass * GRAVITY * weights[:, None] * unit
    moment = (feet[:, 0] * force[..., 1] - feet[:, 1] * force[..., 0]).sum(axis=1)
    loads = np.column_stack((force.sum(axis=1), moment)) * (1 + POKE_NOISE * rng.normal(size=(POKES, 3)))
    heading = float(np.arctan2(normal[1], normal[0]))
    tasks = []
    for _ in range(LOGGED + AFTERWARDS):
        start = np.array((*rng.uniform(-0.1, 0.1, 2), rng.uniform(-np.pi, np.pi)))
        ahead, aside = rng.uniform(0.2, 0.4), rng.uniform(-0.25, 0.25)
        c, s = np.cos(start[2] + heading), np.sin(start[2] + heading)
        goal = start + np.array((c * ahead - s * aside, s * ahead + c * aside, rng.uniform(-1.2, 1.2)))
        tasks.append((start, goal))
    cause = IN_TURN[(number + seed) % len(IN_TURN)]
    return LoopWorld(
        outline, feet, weights, mass, mu, contact_mu, points, normal, loads, twists, np.array(tasks), cause,
        _numbers(cause, contact_mu, rng),
    )  # fmt: skip


def _numbers(cause: str, contact_mu: float, rng: np.random.Generator) -> dict[str, Any]:
    """What a cause is, as ``value``, and in the parameters of the catalogue where it has one."""
    if cause == "nothing":
        return {}
    size, angle, sign = SIZES[cause], float(rng.uniform(-np.pi, np.pi)), float(rng.choice((-1.0, 1.0)))
    if cause == "contact-friction":
        return {"value": contact_mu * float(rng.uniform(*size))}
    if cause == "contact-geometry":
        return {"value": FINGER + size}
    if cause == "contact-place":
        return {"value": sign * size}
    if cause == "anisotropy-world":
        return {"value": [size, angle / 2]}
    if cause == "latency":
        return {"value": size}
    return {"value": [size * float(np.cos(angle)), size * float(np.sin(angle))]}
