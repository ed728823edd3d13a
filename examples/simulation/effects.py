"""What each effect changes: a 50 mm push with one finger, and what a campaign of pushes logs, at the middle of each range.

python examples/simulation/effects.py
"""

from __future__ import annotations

import math

import numpy as np

import stablepush as sp
from stablepush.effects import CATALOGUE, parse_effect
from stablepush.geometry.se2 import wrap_angle

#: Middle of the range, and nominal values; two numbers are along x and y.
MIDDLES = {
    "anisotropy-world": ("ratio=1.15,direction=0.7", "ratio=1"),
    "anisotropy-object": ("ratio=1.15,direction=0.7", "ratio=1"),
    "speed-dependence": ("slope=0.05", "slope=0"),
    "spatial-variation": ("gradient=0.3/-0.3", "gradient=0/0"),
    "drift": ("rate=-0.15", "rate=0"),
    "pressure-shift": ("offset=0.003/0", "offset=0/0"),
    "pressure-spread": ("scale=0.85", "scale=1"),
    "tilt": (f"slope={math.radians(1):.6f}/0", "slope=0/0"),
    "inertia": ("mass=1.2", "mass=0"),
    "contact-friction": ("mu=0.4", "mu=0.5"),
    "contact-geometry": ("radius=0.006", "radius=0.005"),
    "force-bias": ("force=0.2/-0.1", "force=0/0"),
    "force-rotation": ("angle=0.1", "angle=0"),
    "frame-offset": ("offset=0.003/-0.002", "offset=0/0"),
    "latency": ("delay=0.1", "delay=0"),
    "model-capacity": ("facets=4", None),
}


def pushes(rng: np.random.Generator, slider: sp.Slider, pusher: sp.Pusher) -> list[sp.Command]:
    """Pushes of 50 mm from many headings of the slider, off the middle of a face by up to 20 mm and up to 40 deg oblique."""
    commands = []
    for _ in range(40):
        off, turn = rng.uniform(-0.02, 0.02), rng.uniform(-0.7, 0.7)
        theta = rng.uniform(-np.pi, np.pi)
        docked = np.array((-0.05 - pusher.radius, off, 0.0))
        place = np.array((*_turned(theta, docked[:2]), theta))
        twist = 0.02 * np.array((np.cos(turn), np.sin(turn), 0.0))
        commands.append(sp.Command(place, [(twist, 2.5)], np.array((0.0, 0.0, theta)), speed=0.02))
    return commands


def _turned(theta: float, v: np.ndarray) -> tuple[float, float]:
    c, s = np.cos(theta), np.sin(theta)
    return float(c * v[0] - s * v[1]), float(s * v[0] + c * v[1])


def main() -> None:
    outline = np.array(((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)))
    support = sp.SupportDistribution.from_polygon(outline, 0.02)
    slider = sp.Slider(outline, mass=1.2, support=support)
    pusher = sp.Pusher.finger(0.005)
    commands = pushes(np.random.default_rng(0), slider, pusher)

    def run(text: str | None) -> sp.Execution:
        effects = [] if text is None else [parse_effect(text)]
        return sp.VirtualRig(slider, sp.IdealLimitSurface(support, 0.3 * 1.2 * 9.81), 0.5, pusher, effects).execute(commands)

    def load(execution: sp.Execution) -> np.ndarray:
        rows = execution.log.samples["phase"] == "push"
        f = np.stack([execution.log.samples[name][rows] for name in ("fx", "fy", "tau")], axis=-1)
        return f / (1, 1, slider.characteristic_length)

    plain = run(None)
    print("40 pushes of 50 mm at 20 mm/s on a square of 100 mm, 1.2 kg, mu 0.3 under it and 0.5 at the finger")
    print(f"{'effect':<20s} {'value':<26s} {'final pose: median, 95 %':>36s} {'wrench, rms':>12s} {'at nominal':>12s}")
    for id in CATALOGUE:
        middle, nominal = MIDDLES[id]
        made = run(f"{id}:{middle}")
        moved = np.array([b.poses[-1] - a.poses[-1] for a, b in zip(plain.traces, made.traces, strict=True)])
        route, turn = 1000 * np.hypot(moved[:, 0], moved[:, 1]), np.degrees(np.abs(wrap_angle(moved[:, 2])))
        change = float(np.sqrt(((load(made) - load(plain)) ** 2).sum(axis=1).mean()))
        words = (
            f"{np.median(route):.2f}, {np.quantile(route, 0.95):.2f} mm; {np.median(turn):.2f}, {np.quantile(turn, 0.95):.2f} deg"
        )
        same = "-" if nominal is None else f"{np.abs(load(run(f'{id}:{nominal}')) - load(plain)).max():.1e}"
        print(f"{id:<20s} {middle:<26s} {words:>36s} {change:>10.3f} N {same:>12s}")


if __name__ == "__main__":
    main()
