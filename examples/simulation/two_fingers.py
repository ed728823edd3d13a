"""Pushes with two fingers: what the oracle calls stable sticks throughout a quarter turn, what it calls unstable does not.

Random sliders, supports, surfaces, contacts and rotation centres; those within ``--near`` of the boundary are left out.

    python examples/simulation/two_fingers.py [--cases 5000] [--near 0.01] [--seed 0]
"""

from __future__ import annotations

import argparse

import numpy as np
import shapely

import stablepush as sp
from stablepush.geometry.planar import transport_twist, twist_from_cor
from stablepush.geometry.se2 import compose, inverse

#: Rotation centres drawn for a contact.
CANDIDATES = 200


def random_slider(rng: np.random.Generator) -> sp.Slider:
    """A convex outline about its centre of mass."""
    hull = shapely.MultiPoint(rng.uniform(-0.08, 0.08, (8, 2))).convex_hull
    vertices = shapely.get_coordinates(shapely.orient_polygons(hull))[:-1] - shapely.get_coordinates(hull.centroid)
    return sp.Slider(vertices, mass=1.0)


def random_surface(rng: np.random.Generator, slider: sp.Slider) -> sp.LimitSurface:
    """Feet under the outline with the centre of mass as their centre of pressure, an even pressure, or a quartic."""
    kind = rng.integers(0, 3)
    even = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.02), 4.0)
    if kind == 0:
        return even
    feet = rng.uniform(0.2, 0.9, (len(slider.vertices), 1)) * slider.vertices
    weights = rng.uniform(0.2, 1.0, len(feet))
    ideal = sp.IdealLimitSurface(sp.SupportDistribution(feet, weights), 4.0)
    if kind == 1:
        return ideal
    v = rng.normal(size=(40, 3)) / (1, 1, slider.characteristic_length)
    return sp.ellipsoid_from_pressure(ideal.support, ideal.friction_load) if rng.random() < 0.5 else _quartic(ideal, v)


def _quartic(ideal: sp.IdealLimitSurface, twists: np.ndarray) -> sp.LimitSurface:
    return sp.fit_limit_surface(ideal.wrench(twists), twists, validation_indices=np.arange(5)).surface


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=5000)
    parser.add_argument("--near", type=float, default=0.01, help="rad")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    stable = unstable = 0
    most, least, wrong = 0.0, np.inf, 0
    surfaces = 0
    while stable + unstable < options.cases:
        slider = random_slider(rng)
        surface = random_surface(rng, slider)
        surfaces += 1
        for _ in range(25):
            edge = int(rng.integers(0, len(slider.vertices)))
            a, b = slider.edge(edge)
            length = float(np.linalg.norm(b - a))
            width = rng.uniform(0.2, 0.9) * length
            middle = length / 2 + rng.uniform(-0.5, 0.5) * (length - width)
            contact = sp.PushContact.on_edge(slider, edge, middle, width, rng.uniform(0.1, 1.0))
            centers = rng.normal(size=(CANDIDATES, 2)) * np.exp(rng.uniform(np.log(0.03), np.log(1.0), (CANDIDATES, 1)))
            twists = twist_from_cor(centers, rng.choice((-1, 1), CANDIDATES))
            margins = sp.StabilityOracle(surface, contact).margin(twists)
            # few motions are stable: half of the cases are taken from those, where there are any
            wanted = np.flatnonzero(margins > options.near if rng.random() < 0.5 else margins < -options.near)
            if not len(wanted):
                continue
            twist, margin = twists[wanted[0]], float(margins[wanted[0]])
            pusher = sp.Pusher.of_contact(contact, 0.003)
            docked = pusher.docked(contact)
            motion = [(transport_twist(twist, inverse(docked)), np.pi / 2)]
            trace = sp.simulate_push(surface, slider, pusher, contact.mu, (0, 0, 0), docked, motion, step=2e-3)
            relative = compose(inverse(trace.pushers), trace.poses)
            change = np.abs(relative - relative[0]).max(axis=0)
            moved = float(np.hypot(*change[:2]) + slider.radius * change[2])
            if margin > 0:
                stable += 1
                most = max(most, moved)
            else:
                unstable += 1
                least = min(least, moved)
            wrong += (moved < 1e-6) != (margin > 0)
    print(f"{stable + unstable} cases on {surfaces} sliders, {np.degrees(options.near):.2f} deg and more from the boundary")
    print(f"{stable} stable: largest relative motion over 90 deg {most:.1e} m; {unstable} unstable: smallest {least:.1e} m")
    print(f"on the wrong side of 1e-6 m: {wrong}")


if __name__ == "__main__":
    main()
