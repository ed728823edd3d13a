"""STABLE within the all-pressure region within the region of every pressure, and how tight the all-pressure region is.

Random convex and non-convex outlines, two fingers on a random edge. On each rig: CORs of both senses and translations, near
and far, are asked of STABLE, of the all-pressure region and, with ideal surfaces, of random pressures with the same centre of
mass. For motions just outside the all-pressure region, the worst pressure is asked for, and checked: its mean, its forces,
its load.

    python examples/regions/nesting.py [--rigs 500] [--pressures 200] [--seed 0]
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np
import rigs
import shapely
from tqdm import tqdm

import stablepush as sp
from stablepush.geometry.planar import point_velocity, unit
from stablepush.identify.pressure import predict_loads
from stablepush.stability.kernels.chart import twists_from_disc
from stablepush.stability.oracle import BOUNDARY_SLACK

MOTIONS, OUTSIDE = 1500, 20


def motions(rng: np.random.Generator, region: sp.StableRegion) -> np.ndarray:
    """Return body twists (n, 3) all over the sphere, half of them within or about a region, and translations."""
    found = []
    for sense in (1, -1):
        places = rng.uniform(-1.42, 1.42, size=(MOTIONS // 4, 2))
        disc = region.disc(sense)
        if not disc.is_empty:
            low, high = np.array(disc.bounds).reshape(2, 2)
            places = np.concatenate((places, rng.uniform(low, high, size=(MOTIONS // 4, 2))))
        found.append(twists_from_disc(places[(places**2).sum(axis=1) < 2], sense))
    angles = rng.uniform(0, 2 * np.pi, size=50)
    found.append(np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=-1))
    return np.concatenate(found) / (1, 1, region.characteristic_length)


def check(seed: int, pressures: int) -> Counter[str]:
    """Return counts of what one rig shows."""
    rng = np.random.default_rng((seed, 11))
    slider = sp.Slider(rigs.outline(rng, convex=bool(rng.random() < 0.5)))
    contact = rigs.contact(rng, slider)
    stable, everywhere = sp.lynch_mason_region(slider, contact), sp.all_pressure_region(slider, contact)
    asked = motions(rng, everywhere)
    in_stable, in_all = stable.contains_twists(asked), everywhere.contains_twists(asked)
    found = Counter(motions=len(asked), stable=int(in_stable.sum()), all_pressure=int(in_all.sum()))
    found["loose"] += int((in_stable & ~in_all).sum())
    drawn = [rigs.pressure(rng, slider.vertices) for _ in range(pressures)]
    # all pressures at once: unused places carry nothing
    most = max(len(d.points) for d in drawn)
    points, shares = np.zeros((pressures, most, 2)), np.zeros((pressures, most))
    for i, d in enumerate(drawn):
        points[i, : len(d.points)], shares[i, : len(d.points)] = d.points, d.weights
    rho = slider.radius
    loads = predict_loads(points / rho, shares, unit(asked[in_all] * (1, 1, rho)))
    found["asked"] += loads.shape[0] * loads.shape[1]
    found["violations"] += int((contact.cone(rho).margin(loads) < -BOUNDARY_SLACK).sum())
    # from the outside: vertices of the boundary lie within it, by 1e-8; a little farther out a pressure must break the push
    for sense in (1, -1):
        for ring in everywhere.disc(sense).geoms if hasattr(everywhere.disc(sense), "geoms") else (everywhere.disc(sense),):
            if ring.is_empty:
                continue
            places = np.asarray(ring.exterior.coords)[:-1]
            middle = np.asarray(ring.representative_point().coords[0])
            chosen = places[rng.integers(len(places), size=OUTSIDE)]
            beyond = chosen + 1e-4 * unit(chosen - middle)
            beyond = beyond[(beyond**2).sum(axis=1) < 2]
            twists = twists_from_disc(beyond, sense) / (1, 1, everywhere.characteristic_length)
            for twist in twists[~everywhere.contains_twists(twists)]:
                found["just outside"] += 1
                found["broken"] += breaks(slider, contact, twist)
    return found


def breaks(slider: sp.Slider, contact: sp.PushContact, twist: np.ndarray) -> bool:
    """Return whether the worst pressure is one (on the outline, with its mean at the origin, its forces friction) and breaks the
    push."""
    worst = sp.worst_pressure(slider, contact, twist)
    velocity = point_velocity(twist, worst.points)
    moves = np.linalg.norm(velocity, axis=1) > 1e-9 * np.linalg.norm(twist[:2]) + 1e-12
    along = np.abs(worst.forces - worst.shares[:, None] * unit(velocity)).max(axis=1) < 1e-9
    inside = shapely.distance(slider.polygon, shapely.points(worst.points)) < 1e-12
    is_pressure = bool(
        (worst.shares >= 0).all()
        and abs(worst.shares.sum() - 1) < 1e-9
        and np.abs(worst.shares @ worst.points).max() < 1e-9
        and inside.all()
        and (along | ~moves).all()
        and (np.linalg.norm(worst.forces, axis=1) <= worst.shares + 1e-9).all()
    )
    rho = slider.radius
    leaves = float(contact.cone(rho).margin(worst.load / (1, 1, rho))) < 0
    return is_pressure and worst.breaks and leaves


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=500)
    parser.add_argument("--pressures", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    total: Counter[str] = Counter()
    for i in tqdm(range(options.rigs), disable=None, leave=False):
        total += check(options.seed + i, options.pressures)
    print(f"{options.rigs} rigs, {total['motions']} motions: {total['stable']} in STABLE, {total['all_pressure']} all-pressure")
    print(f"in STABLE but not all-pressure: {total['loose']}")
    print(f"{options.pressures} pressures a rig, {total['asked']} questions: all-pressure but unstable: {total['violations']}")
    print(f"motions just outside: {total['just outside']}, broken by the pressure returned: {total['broken']}")


if __name__ == "__main__":
    main()
