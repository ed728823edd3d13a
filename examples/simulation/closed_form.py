"""One contact on an ellipsoidal limit surface against the closed-form model of Lynch, Maekawa and Tanie (1992), on random cases.

python examples/simulation/closed_form.py [--cases 10000] [--seed 0]
"""

from __future__ import annotations

import argparse

import numpy as np

import stablepush as sp
from stablepush.geometry.planar import point_velocity


def closed_form(c2: float, point: np.ndarray, normal: np.ndarray, mu: float, velocity: np.ndarray) -> tuple[np.ndarray, str]:
    """Twist and mode of a slider with ``(fx² + fy²)/f² + tau²/m² = 1``, ``c2 = (m/f)²``, whose contact moves with
    ``velocity``."""
    x, y = point
    ux, uy = velocity
    stick = np.array(((c2 + x * x) * ux + x * y * uy, x * y * ux + (c2 + y * y) * uy)) / (c2 + x * x + y * y)
    tangent = np.array((-normal[1], normal[0]))
    # the force points along the velocity of the centre
    along, across = stick @ normal, stick @ tangent
    if abs(across) <= mu * along:
        return np.array((*stick, (x * stick[1] - y * stick[0]) / c2)), "sticking"
    side = 1.0 if across > 0 else -1.0
    force = normal + side * mu * tangent
    twist = np.array((*force, (x * force[1] - y * force[0]) / c2))
    return twist * (velocity @ normal) / (point_velocity(twist, point[None])[0] @ normal), "right" if side > 0 else "left"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    worst, counts, wrong = 0.0, {"sticking": 0, "left": 0, "right": 0}, 0
    for _ in range(options.cases):
        force, arm, rho = rng.uniform(0.5, 20), rng.uniform(0.01, 0.2), rng.uniform(0.02, 0.1)
        torque = force * arm
        surface = sp.PolynomialLimitSurface([1 / force**2, 0, 0, 1 / force**2, 0, rho**2 / torque**2], 2, rho)
        angle = rng.uniform(0, 2 * np.pi)
        normal = np.array((np.cos(angle), np.sin(angle)))
        point = rng.uniform(-0.2, 0.2, 2)
        heading = angle + rng.uniform(-0.49, 0.49) * np.pi
        velocity = np.exp(rng.uniform(np.log(1e-3), np.log(1.0))) * np.array((np.cos(heading), np.sin(heading)))
        mu = rng.uniform(0, 1.5)
        twist, mode = closed_form(arm**2, point, normal, mu, velocity)
        answer = sp.push_twist(surface, sp.PushContact([point], [normal], mu), (*(velocity), 0.0))
        counts[mode] += 1
        wrong += answer.modes != [mode] or answer.solutions != 1
        scale = (1, 1, arm)
        worst = max(worst, float(np.linalg.norm((answer.twist - twist) * scale) / np.linalg.norm(twist * scale)))
    print(f"{options.cases} cases ({', '.join(f'{n} {mode}' for mode, n in counts.items())})")
    print(f"modes that differ: {wrong}; largest relative error of the twist: {worst:.1e}")


if __name__ == "__main__":
    main()
