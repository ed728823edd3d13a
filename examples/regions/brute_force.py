"""Are regions what the oracle says? Random rigs, every region against brute force.

Half of the rigs have a random convex quartic, half the ideal surface of a random pressure under a random outline, convex or not;
two fingers on a random edge. On each:

- random motions, a third of them near the boundary, are asked of the polygon and of ``H_inv``;
- chords of the polygon are left by the stated tolerance to both sides: the true boundary must lie between;
- loads all over the facets of the cone are mapped to motions: each must lie within the tolerance of the polygon.

    python examples/regions/brute_force.py [--rigs 1000] [--seed 0]
"""

from __future__ import annotations

import argparse

import numpy as np
import rigs
import shapely
from tqdm import tqdm

import stablepush as sp
from stablepush.geometry.planar import normalize_twist, unit
from stablepush.stability.kernels.chart import disc_from_twists, twists_from_disc
from stablepush.stability.region import BOUNDARY_TOLERANCE

MOTIONS, SHARES = 3000, 600


def check(seed: int) -> dict[str, float]:
    """Return what one rig shows."""
    rng = np.random.default_rng(seed)
    slider = sp.Slider(rigs.outline(rng, convex=bool(rng.random() < 0.5)))
    ideal = seed % 2 == 0
    surface = sp.IdealLimitSurface(rigs.pressure(rng, slider.vertices), 3.0) if ideal else rigs.quartic(rng)
    contact = rigs.contact(rng, slider)
    region, rho = sp.stable_region(surface, contact), surface.characteristic_length
    oracle = sp.StabilityOracle(surface, contact)
    found = {"asked": 0, "wrong": 0, "chords": 0, "alike": 0, "far": 0.0, "mapped": 0.0}
    found["point"] = region.solid_angle() == 0
    edges = {}
    for sense in (1, -1):
        disc = region.disc(sense)
        edges[sense] = shapely.boundary(disc)
        places = rng.uniform(-1.42, 1.42, size=(MOTIONS, 2))
        if not disc.is_empty:
            near = shapely.get_coordinates(edges[sense])
            near = near[rng.integers(len(near), size=MOTIONS // 2)]
            places = np.concatenate((places, near + rng.normal(size=near.shape) * 10 ** rng.uniform(-4, -1, (len(near), 1))))
        places = places[(places**2).sum(axis=1) < 2]
        inside = shapely.contains_xy(disc, *places.T)
        stable = region.contains_twists(twists_from_disc(places, sense) / (1, 1, rho))
        differ = places[inside != stable]
        if len(differ):
            away = shapely.distance(edges[sense], shapely.points(differ)) if not disc.is_empty else np.full(len(differ), np.inf)
            differ = differ[away > BOUNDARY_TOLERANCE]
        found["asked"] += len(places)
        found["wrong"] += len(differ)
        # chords, left by the tolerance to both sides; not those of the rim, which is no boundary
        for part in shapely.get_parts(disc):
            if part.is_empty:
                continue
            ring = shapely.get_coordinates(part.exterior)
            middle, step = (ring[1:] + ring[:-1]) / 2, np.diff(ring, axis=0)
            length = np.linalg.norm(step, axis=1)
            kept = (length > 1e-9) & ((middle**2).sum(axis=1) < 2 - 1e-3)
            across = np.stack((-step[:, 1], step[:, 0]), axis=-1)[kept] / length[kept, None] * BOUNDARY_TOLERANCE
            sides = [oracle.is_stable(twists_from_disc(middle[kept] + s * across, sense) / (1, 1, rho)) for s in (1, -1)]
            found["chords"] += int(kept.sum())
            # where the region is thinner than the tolerance, or ends in a corner, both sides look alike: there the middle of the
            # chord is held against the image of many loads
            alike = middle[kept][sides[0] == sides[1]]
            if len(alike):
                fine = [shapely.LineString(disc_from_twists(t, sense)) for t in images(surface, oracle, sense)]
                away = np.min([shapely.distance(shapely.points(alike), line) for line in fine], axis=0)
                found["far"] = max(found["far"], float(away.max()))
                found["alike"] += len(alike)
    for start, end in oracle.cone.facets:
        share = rng.uniform(size=SHARES)[:, None]
        twists = unit(normalize_twist(surface.twist(((1 - share) * start + share * end) * (1, 1, rho)), rho))
        for sense in (1, -1):
            those = twists[sense * twists[:, 2] > 1e-6]
            if len(those) and not found["point"]:
                away = shapely.distance(edges[sense], shapely.points(disc_from_twists(those, sense)))
                found["mapped"] = max(found["mapped"], float(np.nan_to_num(away, nan=np.inf).max()))
    return found


def images(surface: sp.LimitSurface, oracle: sp.StabilityOracle, sense: int) -> list[np.ndarray]:
    """Return pieces of the boundary, as unit twists (n, 3) of one sense, from loads that lie close together on the facets."""
    rho = surface.characteristic_length
    share = np.linspace(0, 1, 20001)[:, None]
    pieces = []
    for start, end in oracle.cone.facets:
        twists = unit(normalize_twist(surface.twist(((1 - share) * start + share * end) * (1, 1, rho)), rho))
        turning = np.flatnonzero(sense * twists[:, 2] > 0)
        pieces += [twists[run] for run in np.split(turning, np.flatnonzero(np.diff(turning) > 1) + 1) if len(run) > 1]
    return pieces


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found, unsolved = [], []
    for seed in tqdm(range(options.seed, options.seed + options.rigs), disable=None, leave=False):
        try:
            found.append(check(seed))
        except sp.ConvergenceError as error:
            unsolved.append(f"rig {seed}: {error}")
    total = {key: sum(f[key] for f in found) for key in ("asked", "wrong", "chords", "alike")}
    worst = max(f["mapped"] for f in found)
    points = sum(f["point"] for f in found)
    print(f"{options.rigs} rigs, of which {points} allow a single rotation about a support point, whatever the load in the cone")
    print(f"{total['asked']} motions: {total['wrong']} on the wrong side of the polygon, farther than the tolerance")
    print(
        f"{total['chords']} chords: the boundary is within {BOUNDARY_TOLERANCE:g} of {total['chords'] - total['alike']}, "
        f"{max(f['far'] for f in found):.2e} from the other {total['alike']}"
    )
    print(f"loads on the facets: farthest motion from the polygon {worst:.2e} (tolerance {BOUNDARY_TOLERANCE:g})")
    failing = sum(bool(f["wrong"] or max(f["mapped"], f["far"]) > BOUNDARY_TOLERANCE) for f in found)
    print(
        f"rigs beyond the tolerance: {failing} of {len(found)}; not checked, as a load or motion has no answer: {len(unsolved)}"
    )
    for line in unsolved:
        print(line)


if __name__ == "__main__":
    main()
