"""Diagnoses of simulated logs whose effects the diagnosis never sees: what is named, how often wrongly, how probable.

Rigs, campaigns and amplitudes come from seeds. Rows go to a CSV as they are found, and a later run goes on where it stopped.

    python examples/diagnosis/campaign.py -o campaign.csv [--per-effect 10] [--poses 10] [--bare 0] [--clean 60] [--pushes 60]
"""

from __future__ import annotations

import argparse
import csv
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import beta
from tqdm import tqdm

import stablepush as sp
from stablepush.core.parallel import run_parallel
from stablepush.effects import CATALOGUE

#: Amplitudes from faint to strong, in shares of these largest ones.
LARGEST = {
    "anisotropy-world": 0.3, "anisotropy-object": 0.3, "speed-dependence": 0.12, "spatial-variation": 1.2, "drift": 0.25,
    "pressure-shift": 0.008, "pressure-spread": 0.25, "tilt": 0.03, "inertia": 3.0, "contact-friction": 0.3,
    "contact-geometry": 0.003, "force-bias": 0.3, "force-rotation": 0.12, "frame-offset": 0.004, "latency": 0.12,
    "model-capacity": 4.0,
}  # fmt: skip
SHARES = (0.15, 0.35, 0.6, 1.0)
#: What else logs may have: nothing, two effects at once, noise with heavy tails, and friction in squares that no effect has.
OTHERS = ("none", "pair", "heavy-tail", "checkerboard")
#: Logs without forces: what is left out of them, what they are called, and the effects that change where a slider goes.
FORCES, POSES = ("fx", "fy", "tau"), "poses:"
MOVING = (
    "none", "anisotropy-world", "anisotropy-object", "spatial-variation", "pressure-shift", "tilt", "contact-friction",
    "contact-geometry", "frame-offset", "latency",
)  # fmt: skip
#: The same on rigs that say nothing of the fingers' friction and radius and of noise, and effects that these can show.
BARE = "bare:"
OF_BARE = tuple(id for id in MOVING if not id.startswith("contact"))
#: Effects that pairs are made of: they do not only reshape the surface.
PAIRED = tuple(id for id in LARGEST if not id.startswith(("pressure", "model", "anisotropy-object", "inertia")))
#: Side of the squares in m, and how far (relatively) their friction is from the mean.
SQUARE, CONTRAST = 0.05, 0.2
#: Levels between which probabilities are counted together.
LEVELS = (0, 0.02, 0.05, 0.2, 0.5, 0.8, 0.95, 1.01)
FIELDS = (*("effect", "truth", "seed", "share", "kind", "verdict", "named", "closed", "covered", "seconds", "probabilities"),)


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


def in_squares(rig: sp.VirtualRig, commands: list[sp.EdgePush], seed: int) -> sp.PushLog:
    """A log of pushes, each on the friction of the square of the table where it starts."""
    trials: dict[str, list] = {}
    samples: dict[str, list] = {}
    for k, command in enumerate(commands):
        x, y, _ = command.start
        sign = 1 if (np.floor(x / SQUARE) + np.floor(y / SQUARE)) % 2 else -1
        load = rig.surface.friction_load * (1 + sign * CONTRAST)
        other = replace(rig, surface=sp.IdealLimitSurface(rig.surface.support, load))
        log = other.execute([command], seed=seed + k).log
        for table, part in ((trials, log.trials), (samples, log.samples)):
            for name, values in part.items():
                table.setdefault(name, []).append(np.full(len(values), str(k + 1), dtype=object) if name == "trial" else values)
        trials["start_time"][-1] = np.array([10.0 * k])
        rows = len(log.samples["t"])
        for name in ("c1x", "c1y", "c2x", "c2y"):
            if name not in log.samples:
                samples.setdefault(name, [np.full(len(t), np.nan) for t in samples["t"][:-1]]).append(np.full(rows, np.nan))
    columns = [{name: np.concatenate(parts) for name, parts in table.items()} for table in (trials, samples)]
    return sp.PushLog(rig.execute(commands[:1]).log.rig, *columns)


def covered(report: sp.GapReport, effects: list[sp.Effect]) -> str:
    """Whether the intervals of effects that are named hold the truth: 1 or 0 for each number."""
    found = []
    for effect in effects:
        entry = next(e for e in report.ranking if e.effect == effect.id)
        for parameter in CATALOGUE[effect.id].parameters:
            # a direction counts up to half a turn, and means nothing when the ratio is near one
            if effect.id not in report.named or parameter.name not in entry.parameters or parameter.name == "direction":
                continue
            pairs = np.reshape(entry.parameters[parameter.name].ci95, (-1, 2))
            found += [str(int(a <= v <= b)) for (a, b), v in zip(pairs, effect.vector(parameter.name), strict=True)]
    return " ".join(found)


def world(id: str, seed: int, pushes: int, **campaign: object) -> tuple[sp.VirtualRig, list[sp.EdgePush], int]:
    """A random rig with an effect, a campaign of pushes (options of ``random_pushes``), and a seed for its noise.

    The same rigs for all effects would let one unlucky rig count often: effect and seed together make the rig.
    """
    rng = np.random.default_rng([seed, *id.encode()])
    hull = shapely.MultiPoint(rng.uniform(-0.07, 0.07, (7, 2))).convex_hull
    vertices = shapely.get_coordinates(shapely.orient_polygons(hull))[:-1] - shapely.get_coordinates(hull.centroid)
    feet = rng.uniform(0.3, 0.9, (len(vertices), 1)) * vertices
    inner = sp.SupportDistribution.from_polygon(vertices * 0.9, 0.03)
    support = inner if rng.random() < 0.5 else sp.SupportDistribution(feet, rng.uniform(0.4, 1.0, len(feet)))
    mass, mu, contact_mu, radius = rng.uniform(0.6, 1.6), rng.uniform(0.2, 0.45), rng.uniform(0.3, 0.8), rng.uniform(0.004, 0.007)
    slider = sp.Slider(vertices, mass, support)
    two = bool(rng.random() < 0.5)
    longest = max(float(np.linalg.norm(b - a)) for a, b in (slider.edge(e) for e in range(len(vertices))))
    share = SHARES[seed % len(SHARES)]
    acting = [id] if id in LARGEST else list(rng.choice(PAIRED, 2, replace=False)) if id == "pair" else []
    effects = [effect_of(str(e), share * LARGEST[e], rng, contact_mu, radius) for e in acting]
    noise = sp.Noise(rng.uniform(0.03, 0.05), rng.uniform(1e-4, 2e-4), rng.uniform(0.0018, 0.0035))
    surface = sp.IdealLimitSurface(support, mu * mass * 9.81)
    spacing = min(0.03, 0.4 * longest)
    # two fingers that fit on no edge give way to one
    two = two and longest > 2.2 * (spacing / 2 + radius)
    pusher = sp.Pusher.two_fingers(spacing, radius) if two else sp.Pusher.finger(radius)
    rig = sp.VirtualRig(slider, surface, contact_mu, pusher, effects, noise, 0.12 if id == "heavy-tail" else 0.01, 0.005)
    commands = sp.random_pushes(slider, pusher, pushes, seed=int(rng.integers(2**31)), **campaign)  # type: ignore[arg-type]
    return rig, commands, int(rng.integers(2**31))


def one(name: str, seed: int, pushes: int) -> dict[str, object]:
    """Simulate a log and diagnose it; the diagnosis sees the log alone."""
    id = name.removeprefix(POSES).removeprefix(BARE)
    rig, commands, draw = world(id, seed, pushes)
    effects = list(rig.effects)
    log = in_squares(rig, commands, draw) if id == "checkerboard" else rig.execute(commands, seed=draw).log
    if name != id:
        nominal = replace(log.rig, contact_friction=None, finger_radius=None, noise=None) if name.startswith(BARE) else log.rig
        log = sp.PushLog(nominal, log.trials, {c: v for c, v in log.samples.items() if c not in FORCES})
    begin = time.perf_counter()
    report = sp.diagnose(log)
    seconds = time.perf_counter() - begin
    truth = [f"{e.id}:{name}={'/'.join(f'{x:.6g}' for x in v)}" for e in effects for name, v in e.values.items()]
    return {
        "effect": name, "truth": " ".join(truth), "seed": seed, "share": SHARES[seed % len(SHARES)],
        "kind": "two" if len(rig.pusher.fingers) == 2 else "one",
        "verdict": report.verdict, "named": " ".join(report.named),
        "closed": next((e.closed for e in report.reductions if e.channel in ("wrench", "pose")), np.nan),
        "covered": covered(report, effects), "seconds": seconds,
        "probabilities": " ".join(f"{e['effect']}={e['probability']:.3f}" for e in report.ranking),
    }  # fmt: skip


def bounds(count: int, total: int) -> tuple[float, float]:
    """Clopper and Pearson's 95 % interval of a share."""
    low, high = beta.ppf((0.025, 0.975), (count, count + 1), (total - count + 1, total - count))
    return (0.0 if count == 0 else float(low)), (1.0 if count == total else float(high))


def interval(count: int, total: int) -> str:
    """The same in percent."""
    low, high = bounds(count, total)
    return f"{100 * low:.1f} to {100 * high:.1f} %"


def acting_in(row: dict[str, str]) -> set[str]:
    return {part.partition(":")[0] for part in row["truth"].split()}


def probabilities(rows: list[dict[str, str]]) -> tuple[np.ndarray, np.ndarray]:
    """Reported probabilities of every effect in every log, and whether it acts; friction in squares is no effect."""
    pairs = [
        (float(p), name in acting_in(r))
        for r in rows
        if r["effect"] != "checkerboard"
        for name, p in (part.split("=") for part in r["probabilities"].split())
    ]
    return np.array([p for p, _ in pairs]), np.array([acts for _, acts in pairs])


def read_rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def summary(rows: list[dict[str, str]]) -> None:
    """Print a summary of the rows."""
    for word in OTHERS:
        mine = [r for r in rows if r["effect"] == word]
        if not mine:
            continue
        counts = {v: sum(r["verdict"] == v for r in mine) for v in dict.fromkeys(r["verdict"] for r in mine)}
        verdicts = ", ".join(f"{v} {n}" for v, n in counts.items())
        if word == "pair":
            both = sum(acting_in(r) == set(r["named"].split()) for r in mine)
            some = sum(bool(acting_in(r) & set(r["named"].split())) for r in mine)
            wrong = sum(bool(set(r["named"].split()) - acting_in(r)) for r in mine)
            print(f"pairs: both and nothing else {both} of {len(mine)}, one at least {some}, a wrong name {wrong}; {verdicts}")
        elif word == "checkerboard":
            unknown = counts.get("unknown", 0)
            print(f"friction in squares: unknown {unknown} of {len(mine)} ({interval(unknown, len(mine))}); {verdicts}")
        else:
            alarms = sum(bool(r["named"]) or r["verdict"] == "unknown" for r in mine)
            names = ", ".join(sorted({r["named"] for r in mine if r["named"]}))
            print(f"{word}: {alarms} of {len(mine)} alarms ({interval(alarms, len(mine))}); {verdicts}; {names or 'no names'}")
    print(f"{'effect, named at':<26s}" + "".join(f"{100 * s:>9.0f} %" for s in SHARES) + "   of; other names and verdicts")
    for name in (*LARGEST, *(POSES + id for id in MOVING), *(BARE + id for id in OF_BARE)):
        id = name.removeprefix(POSES).removeprefix(BARE)
        mine = [r for r in rows if r["effect"] == name]
        if not mine:
            continue
        cells = []
        for share in SHARES:
            part = [r for r in mine if float(r["share"]) == share]
            cells.append(f"{sum(id in r['named'].split() for r in part)}/{len(part)}" if part else "-")
        wrong: dict[str, int] = {}
        for r in mine:
            for other in [n for n in r["named"].split() if n != id] or ([] if r["named"] else [r["verdict"]]):
                wrong[other] = wrong.get(other, 0) + 1
        others = ", ".join(f"{k} {v}" for k, v in wrong.items())
        largest = LARGEST.get(id, 0.0)
        print(f"{name:<26s}" + "".join(f"{cell:>11s}" for cell in cells) + f"   {largest:g}; {others}")
    inside = [c for r in rows for c in r["covered"].split()]
    if inside:
        hold = inside.count("1")
        print(f"intervals of 95 % that hold the truth: {hold} of {len(inside)} ({interval(hold, len(inside))})")
    stated, acts = probabilities(rows)
    print("stated probability: share that act (number)")
    for low, high in pairwise(LEVELS):
        here = (stated >= low) & (stated < high)
        if here.any():
            print(
                f"  {low:.2f} to {min(high, 1):.2f}: stated {stated[here].mean():.3f}, act {acts[here].mean():.3f} ({here.sum()})"
            )
    base = acts.mean() * (1 - acts.mean())
    print(f"Brier score {np.mean((stated - acts) ** 2):.4f}; always reporting the base rate {base:.4f}")
    print(f"seconds a log: median {np.median([float(r['seconds']) for r in rows]):.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--per-effect", type=int, default=10)
    parser.add_argument("--poses", type=int, help="logs without forces of each effect, as many as with forces if not given")
    parser.add_argument("--bare", type=int, default=0, help="the same on rigs that say nothing of the fingers and of noise")
    parser.add_argument("--clean", type=int, default=60)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--pushes", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scheduler", help="Dask cluster that does the work instead; it has to find this folder's modules")
    options = parser.parse_args()
    rows: list[dict[str, str]] = []
    if options.output.exists():
        rows = read_rows(options.output)
    done = {(r["effect"], int(r["seed"])) for r in rows}
    jobs = [("none", options.first_seed + seed, options.pushes) for seed in range(options.clean)]
    counts = dict.fromkeys((*LARGEST, *OTHERS[1:]), options.per_effect)
    counts |= dict.fromkeys((POSES + id for id in MOVING), options.per_effect if options.poses is None else options.poses)
    counts |= dict.fromkeys((BARE + id for id in OF_BARE), options.bare)
    most = max(counts.values())
    jobs += [(id, options.first_seed + seed, options.pushes) for seed in range(most) for id, n in counts.items() if seed < n]
    jobs = [job for job in jobs if job[:2] not in done]
    with options.output.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, FIELDS)
        if not rows:
            writer.writeheader()
        found = run_parallel(one, jobs, options.jobs, scheduler=options.scheduler)
        for row in tqdm(found, total=len(jobs), disable=None, leave=False):
            writer.writerow(row)
            file.flush()
            rows.append({name: str(value) for name, value in row.items()})
    summary(rows)


if __name__ == "__main__":
    main()
