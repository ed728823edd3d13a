"""The lattice against OMPL's planners on the scenes of ``examples/scenes``.

Run: python benchmarks/planning.py [--seeds 5] [--seconds 10] [--long 30] [--jobs 2] [--scenes open maze] [-o planning.json]
     python benchmarks/planning.py --show planning.json

The lattice once with the default effort (deterministic), and once until ``--seconds``; every OMPL planner with ``--seeds``
seeds for ``--seconds`` each, and the best of them in a scene for ``--long``. Every plan passes the independent check, or counts
as not solved. Times of first plans come from runs that stop at the first plan. ``5 %``: time after which a plan was within 5 %
of the best of all, as far as these runs tell: that of the first plan, or of the whole run.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import stablepush as sp

SCENES = Path(__file__).parents[1] / "examples" / "scenes"
LATTICE = "cor-lattice"


def run(scene: str, planner: str, seed: int, seconds: float, improve: float) -> dict:
    """Plan once; what became of it."""
    problem = sp.load_scene(SCENES / f"{scene}.json")
    # in a process that has planned before: reading compiled code from disk takes half a second
    sp.plan(sp.load_scene(SCENES / "open.json"), LATTICE, time_limit=60.0, improve=0.0)
    started = time.perf_counter()
    result = sp.plan(problem, planner, time_limit=seconds, seed=seed, improve=improve)
    taken = time.perf_counter() - started
    return {
        "scene": scene,
        "planner": planner,
        "seed": seed,
        "seconds": seconds,
        "improve": improve,
        "status": result.status,
        "message": result.message,
        "time": taken,
        "duration": result.duration if result.solved else math.inf,
        "length": result.length,
        "switches": result.switches,
        "margin": math.degrees(result.min_margin),
        "bound": result.lower_bound,
        "valid": result.solved and sp.check_plan(problem, result).valid,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--long", type=float, default=30.0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scenes", nargs="*")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--show", type=Path, help="rows of an earlier run, to print again")
    options = parser.parse_args()
    scenes = options.scenes or sorted(file.stem for file in SCENES.glob("*.json") if file.stem != "triangle")
    others = [name for name in sp.planner_names() if name.startswith("ompl")]
    if options.show:
        rows = json.loads(options.show.read_text(encoding="utf-8"))
        for scene in dict.fromkeys(row["scene"] for row in rows):
            show(scene, [row for row in rows if row["scene"] == scene], others, options)
        summary(rows)
        return
    rows = []
    run(scenes[0], LATTICE, 0, 60.0, 0.0)  # compiled code is built before anything is timed
    with ProcessPoolExecutor(options.jobs, max_tasks_per_child=1) as pool:
        for scene in scenes:
            jobs = [pool.submit(run, scene, LATTICE, 0, 120.0, effort) for effort in (0.0, 20_000.0)]
            jobs.append(pool.submit(run, scene, LATTICE, 0, options.seconds, math.inf))
            for name in others:
                jobs += [pool.submit(run, scene, name, seed, options.seconds, math.inf) for seed in range(options.seeds)]
                jobs += [pool.submit(run, scene, name, seed, options.seconds, 0.0) for seed in range(options.seeds)]
            found = [job.result() for job in jobs]
            solved = [row for row in found[3:] if row["valid"]]
            if solved and options.long > 0:
                best = min(solved, key=lambda row: row["duration"])
                found.append(pool.submit(run, scene, best["planner"], best["seed"], options.long, math.inf).result())
            rows += found
            show(scene, found, others, options)
    summary(rows)
    if options.output:
        options.output.write_text(json.dumps(rows, indent=1), encoding="utf-8")


def summary(rows: list[dict]) -> None:
    """Print what holds over all scenes."""
    first = [row["time"] for row in rows if row["planner"] == LATTICE and row["improve"] == 0 and row["valid"]]
    print(f"\nlattice: time to a first plan in {len(first)} scenes: median {np.median(first):.2f} s, worst {max(first):.2f} s")


def paired(firsts: list[dict], those: list[dict]) -> list[tuple[dict, ...]]:
    """Runs of the same seed, the one that stops at the first plan first."""
    return [(*(f for f in firsts if f["seed"] == row["seed"]), row) for row in those]


def show(scene: str, rows: list[dict], others: list[str], options: argparse.Namespace) -> None:
    """Print a table of one scene."""
    first, usual, long = rows[:3]
    best = min((row["duration"] for row in rows if row["valid"]), default=math.inf)
    print(f"\n{scene}: lower bound {first['bound']:.1f} s, best plan {best:.2f} s")
    head = ("solved", "first/s", "5%/s", "time/s", "plan/s", "/best", "/bound", "way/m", "changes", "deg")
    print(f"{'':>24s} " + " ".join(f"{word:>8s}" for word in head))

    def line(name: str, those: list[dict], firsts: list[dict]) -> None:
        good = [row for row in those if row["valid"]]
        soon = [row["time"] for row in firsts if row["valid"]]
        words = [f"{len(good)}/{len(those)}", f"{np.median(soon):.2f}" if soon else "-"]
        near = [
            min((r["time"] for r in (*pair,) if r["valid"] and r["duration"] <= 1.05 * best), default=math.inf)
            for pair in paired(firsts, those)
        ]
        words.append(f"{np.median(near):.2f}" if near and np.isfinite(np.median(near)) else "-")
        words.append(f"{np.median([row['time'] for row in those]):.2f}")
        if good:
            middle = sorted(good, key=lambda row: row["duration"])[len(good) // 2]
            words += [f"{middle['duration']:.2f}", f"{middle['duration'] / best:.3f}"]
            words += [f"{middle['duration'] / max(middle['bound'], 1e-9):.2f}", f"{middle['length']:.2f}"]
            words += [str(middle["switches"]), f"{middle['margin']:.1f}"]
        else:
            words.append(those[0]["status"])
        print(f"{name:>24s} " + " ".join(f"{word:>8s}" for word in words))

    line("lattice, default", [usual], [first])
    line(f"lattice, {options.seconds:g} s", [long], [first])
    for name in others:
        line(
            name,
            [r for r in rows[3:] if r["planner"] == name and r["improve"] and r["seconds"] == options.seconds],
            [r for r in rows[3:] if r["planner"] == name and not r["improve"]],
        )
    if len(rows) > 3 and rows[-1]["seconds"] == options.long:
        line(f"{rows[-1]['planner']}, {options.long:g} s", [rows[-1]], [])


if __name__ == "__main__":
    main()
