"""Times of stable regions, in one run: exact regions, maps, all-pressure membership, probabilities, each beside what it replaces.

    python benchmarks/region.py [--repeats 20]

One thread. Compiled code is warmed up first. "Linear program": all-pressure membership of one COR by HiGHS (scipy) over a grid of
pressure points on the polygon, one program for each facet: how one would do without the structure of the problem, and without
a proof for what lies between the points.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import shapely
from scipy.optimize import linprog

import stablepush as sp
from stablepush.geometry.planar import twist_from_cor, unit
from stablepush.stability.probability import probability_map

MU, EXTENT, CELLS, SURFACES, LP_SPACING = 0.5, 0.4, 400, 200, 0.005


def best(function: Callable[[], object], repeats: int) -> float:
    """Return the median wall time in s."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        function()
        times.append(time.perf_counter() - started)
    return float(np.median(times))


def linear_program(points: np.ndarray, normals: np.ndarray, rho: float, twist: np.ndarray) -> bool:
    """Return whether no pressure on the points with its mean at the origin takes the load out of the cone."""
    velocity = np.stack((twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]), axis=-1)
    along = unit(velocity)
    loads = np.column_stack((along, (points[:, 0] * along[:, 1] - points[:, 1] * along[:, 0]) / rho))
    equal = np.vstack((np.ones(len(points)), points.T))
    return all(linprog(loads @ a, A_eq=equal, b_eq=(1, 0, 0), method="highs").fun >= -1e-9 for a in normals)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=20)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)])
    contact = sp.PushContact.on_edge(slider, edge=0, center=0.05, width=0.05, mu=MU)
    even = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 5.0, 0.05)
    directions = unit(rng.normal(size=(20, 3))) / (1, 1, 0.05)
    loads = even.wrench(directions) * (1 + 0.05 * rng.normal(size=(20, 1)))
    fit = sp.fit_limit_surface(loads, directions, slider=slider, characteristic_length=0.05)
    surface = fit.surface
    members = np.resize(surface.ensemble, (SURFACES, len(surface.coefficients)))
    many = sp.PolynomialLimitSurface(surface.coefficients, 4, 0.05, ensemble=members)
    line = EXTENT * ((2 * np.arange(CELLS) + 1) / CELLS - 1)
    cors = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    both = [twist_from_cor(cors, sense) for sense in (1, -1)]
    oracle = sp.StabilityOracle(surface, contact)
    everywhere = sp.all_pressure_region(slider, contact)
    asked = np.concatenate([t[rng.permutation(len(t))[:2000]] for t in both])

    def boundary() -> None:
        region = sp.all_pressure_region(slider, contact)
        region.disc(1), region.disc(-1)

    def chance() -> None:
        region = sp.chance_region(surface, contact, 0.9)
        region.disc(1), region.disc(-1)

    steps = {
        "exact region, quartic": (lambda: sp.stable_region(surface, contact), options.repeats, 1),
        f"exact region, ideal, {len(even.support.points)} points": (lambda: sp.stable_region(even, contact), options.repeats, 1),
        "polygons of both senses, quartic": (
            lambda: [sp.stable_region(surface, contact).polygons(s, EXTENT) for s in (1, -1)],
            10,
            1,
        ),
        f"map {CELLS} x {CELLS}, both senses, by H_inv": (lambda: [oracle.is_stable(t) for t in both], 5, 1),
        f"map {CELLS} x {CELLS}, both senses, by scan lines": (
            lambda: [sp.stable_region(surface, contact).raster(s, EXTENT, CELLS) for s in (1, -1)],
            10,
            1,
        ),
        f"map {CELLS} x {CELLS}, {SURFACES} surfaces, both senses": (lambda: probability_map(many, contact, EXTENT, CELLS), 3, 1),
        "chance region p = 0.9 of 50 surfaces": (
            chance,
            3,
            1,
        ),
        "all-pressure, a COR": (lambda: everywhere.contains_twists(asked), options.repeats, len(asked)),
        "all-pressure boundary, both senses": (boundary, 5, 1),
    }
    found = {}
    print(f"{'':>48s}{'time':>14s}")
    for name, (function, repeats, parts) in steps.items():
        function()
        found[name] = best(function, repeats) / parts
        print(f"{name:>48s}{1e3 * found[name]:>11.4f} ms", flush=True)
    low, high = slider.vertices.min(axis=0), slider.vertices.max(axis=0)
    grid = np.stack(np.meshgrid(*(np.arange(a, b + 1e-9, LP_SPACING) for a, b in zip(low, high, strict=True))), axis=-1)
    points = grid.reshape(-1, 2)
    points = points[shapely.covers(slider.polygon, shapely.points(points))]
    normals = contact.cone(slider.radius).normals
    few = asked[rng.permutation(len(asked))[:100]]
    started = time.perf_counter()
    by_program = np.array([linear_program(points, normals, slider.radius, twist) for twist in few])
    spent = (time.perf_counter() - started) / len(few)
    exact = everywhere.contains_twists(few)
    print(f"{f'linear program over {len(points)} points, a COR':>48s}{1e3 * spent:>11.4f} ms")
    print(f"{'':>48s}{spent / found['all-pressure, a COR']:>11.0f} times the exact membership")
    unsound = int((exact & ~by_program).sum())
    print(f"the two differ on {int((by_program != exact).sum())} of {len(few)} CORs; exact yes, program no: {unsound}")


if __name__ == "__main__":
    main()
