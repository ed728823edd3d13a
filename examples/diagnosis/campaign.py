"""Diagnoses of simulated logs whose effects the diagnosis never sees: what is named, and how often wrongly.

Rigs, campaigns and amplitudes come from seeds. Rows go to a CSV as they are found, and a later run goes on where it stopped.

    python examples/diagnosis/campaign.py -o campaign.csv [--per-effect 10] [--clean 60] [--pushes 60] [--jobs 2]
"""

from __future__ import annotations

import argparse
import csv
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import beta

import stablepush as sp

#: Amplitudes from faint to strong, in shares of these largest ones.
LARGEST = {
    "anisotropy-world": 0.3, "anisotropy-object": 0.3, "speed-dependence": 0.12, "spatial-variation": 1.2, "drift": 0.25,
    "pressure-shift": 0.008, "pressure-spread": 0.25, "tilt": 0.03, "inertia": 3.0, "contact-friction": 0.3,
    "contact-geometry": 0.003, "force-bias": 0.3, "force-rotation": 0.12, "frame-offset": 0.004, "latency": 0.12,
    "model-capacity": 4.0,
}  # fmt: skip
SHARES = (0.15, 0.35, 0.6, 1.0)
FIELDS = ("effect", "seed", "share", "kind", "verdict", "named", "probability", "closed", "seconds")


def effect_of(id: str, size: float, rng: np.random.Generator, mu: float, radius: float) -> sp.Effect:
    """An effect of a size (in the unit of ``LARGEST``) and a random direction."""
    angle = rng.uniform(-np.pi, np.pi)
    sign = rng.choice((-1.0, 1.0))
    vector = (size * np.cos(angle), size * np.sin(angle))
    values = {
        "anisotropy-world": {"ratio": 1 + size, "direction": angle / 2},
        "anisotropy-object": {"ratio": 1 + size, "direction": angle / 2},
        "speed-dependence": {"slope": sign * size},
        "spatial-variation": {"gradient": vector},
        "drift": {"rate": sign * size},
        "pressure-shift": {"offset": vector},
        "pressure-spread": {"scale": 1 + sign * size},
        "tilt": {"slope": vector},
        "inertia": {"mass": size},
        "contact-friction": {"mu": max(0.05, mu + sign * size)},
        "contact-geometry": {"radius": max(1e-3, radius + sign * size)},
        "force-bias": {"force": vector},
        "force-rotation": {"angle": sign * size},
        "frame-offset": {"offset": vector},
        "latency": {"delay": size},
        "model-capacity": {"facets": 3},
    }
    return sp.Effect(id, values[id])


def one(job: tuple[str, int, int]) -> dict[str, object]:
    """Simulate a log and diagnose it; the diagnosis sees the log alone."""
    id, seed, pushes = job
    # the same rigs for all effects would let one unlucky rig count often: effect and seed together make the rig
    rng = np.random.default_rng([seed, *id.encode()])
    hull = shapely.MultiPoint(rng.uniform(-0.07, 0.07, (7, 2))).convex_hull
    vertices = shapely.get_coordinates(shapely.orient_polygons(hull))[:-1] - shapely.get_coordinates(hull.centroid)
    feet = rng.uniform(0.3, 0.9, (len(vertices), 1)) * vertices
    inner = sp.SupportDistribution.from_polygon(vertices * 0.9, 0.03)
    support = inner if rng.random() < 0.5 else sp.SupportDistribution(feet, rng.uniform(0.4, 1.0, len(feet)))
    mass, mu, grip, radius = rng.uniform(0.6, 1.6), rng.uniform(0.2, 0.45), rng.uniform(0.3, 0.8), rng.uniform(0.004, 0.007)
    slider = sp.Slider(vertices, mass, support)
    two = bool(rng.random() < 0.5)
    longest = max(float(np.linalg.norm(b - a)) for a, b in (slider.edge(e) for e in range(len(vertices))))
    pusher = sp.Pusher.two_fingers(min(0.03, 0.4 * longest), radius) if two else sp.Pusher.finger(radius)
    share = SHARES[seed % len(SHARES)]
    effects = [] if id == "none" else [effect_of(id, share * LARGEST[id], rng, grip, radius)]
    noise = sp.Noise(rng.uniform(0.03, 0.05), rng.uniform(1e-4, 2e-4), rng.uniform(0.0018, 0.0035))
    surface = sp.IdealLimitSurface(support, mu * mass * 9.81)
    rig = sp.VirtualRig(slider, surface, grip, pusher, effects, noise, 0.01, 0.005)
    try:
        commands = sp.random_pushes(slider, pusher, pushes, seed=int(rng.integers(2**31)))
    except sp.InputError:
        commands = sp.random_pushes(slider, sp.Pusher.finger(radius), pushes, seed=int(rng.integers(2**31)))
        rig = sp.VirtualRig(slider, surface, grip, sp.Pusher.finger(radius), effects, noise, 0.01, 0.005)
    log = rig.execute(commands, seed=int(rng.integers(2**31))).log
    begin = time.perf_counter()
    report = sp.diagnose(log)
    seconds = time.perf_counter() - begin
    closed = next((e["closed"] for e in report.shrink if e["channel"] == "wrench"), np.nan)
    probability = next((e["probability"] for e in report.ranking if e["effect"] == id), np.nan)
    return {
        "effect": id, "seed": seed, "share": share, "kind": "two" if two else "one", "verdict": report.verdict,
        "named": " ".join(report.named), "probability": probability, "closed": closed, "seconds": seconds,
    }  # fmt: skip


def summary(rows: list[dict[str, str]]) -> None:
    """Print what the rows tell."""
    clean = [r for r in rows if r["effect"] == "none"]
    if clean:
        alarms = sum(bool(r["named"]) or r["verdict"] == "unknown" for r in clean)
        low, high = beta.ppf((0.025, 0.975), (alarms, alarms + 1), (len(clean) - alarms + 1, len(clean) - alarms))
        low, high = np.nan_to_num(low), 1.0 if np.isnan(high) else high
        print(f"clean logs: {alarms} of {len(clean)} alarms, 95 % interval {100 * low:.1f} to {100 * high:.1f} %")
        counts = {v: sum(r["verdict"] == v for r in clean) for v in dict.fromkeys(r["verdict"] for r in clean)}
        print("  verdicts: " + ", ".join(f"{v} {n}" for v, n in counts.items()))
    print(f"{'effect':<20s}" + "".join(f"{100 * s:>9.0f} %" for s in SHARES) + "   wrong names (all amplitudes)")
    for id in LARGEST:
        mine = [r for r in rows if r["effect"] == id]
        if not mine:
            continue
        cells = []
        for share in SHARES:
            part = [r for r in mine if float(r["share"]) == share]
            cells.append(f"{sum(id in r['named'].split() for r in part)}/{len(part)}" if part else "-")
        wrong: dict[str, int] = {}
        for r in mine:
            for name in r["named"].split():
                if name != id:
                    wrong[name] = wrong.get(name, 0) + 1
        print(f"{id:<20s}" + "".join(f"{cell:>11s}" for cell in cells) + "   " + ", ".join(f"{k} {v}" for k, v in wrong.items()))
    print(f"seconds a log: median {np.median([float(r['seconds']) for r in rows]):.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--per-effect", type=int, default=10)
    parser.add_argument("--clean", type=int, default=60)
    parser.add_argument("--pushes", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    rows: list[dict[str, str]] = []
    if options.output.exists():
        with options.output.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    done = {(r["effect"], int(r["seed"])) for r in rows}
    jobs = [("none", seed, options.pushes) for seed in range(options.clean)]
    jobs += [(id, seed, options.pushes) for seed in range(options.per_effect) for id in LARGEST]
    jobs = [job for job in jobs if job[:2] not in done]
    with options.output.open("a", encoding="utf-8", newline="") as file, ProcessPoolExecutor(options.jobs) as pool:
        writer = csv.DictWriter(file, FIELDS)
        if not rows:
            writer.writeheader()
        for k, row in enumerate(pool.map(one, jobs), start=1):
            writer.writerow(row)
            file.flush()
            rows.append({name: str(value) for name, value in row.items()})
            print(f"\r{k} of {len(jobs)}", end="", flush=True)
    print()
    summary(rows)


if __name__ == "__main__":
    main()
