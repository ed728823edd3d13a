"""The lattice against OMPL's planners on the scenes of ``examples/scenes``.

Run: python benchmarks/planning.py [--seeds 5] [--seconds 10] [--long 30] [--jobs 2] [--scenes open maze] [-o planning.json]
     python benchmarks/planning.py --show planning.json
     python benchmarks/planning.py --default [--scenes open maze]

``--default`` plans with the default success and with none, side by side: times of the first plan and of the default effort
(median of five), what the plans take, and how likely they are to succeed.

The lattice with the default effort (deterministic) and less, and once until ``--seconds``; every OMPL planner with ``--seeds``
seeds for ``--seconds`` each, and the best of them in a scene for ``--long``. Every plan passes the independent check, or counts
as not solved. Times of first plans come from runs that stop at the first plan. ``5 %``: the shortest run whose plan was within
5 % of the best of all; anytime planners also run with a tenth and a third of ``--seconds``.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import stablepush as sp
from stablepush.core.parallel import run_parallel

SCENES = Path(__file__).parents[1] / "examples" / "scenes"
LATTICE = "cor-lattice"
#: Steps of search after the first plan, up to the default.
EFFORTS = (0.0, 1_000.0, 5_000.0, 20_000.0)
#: Planners whose plans get better with time, and shares of the time that they are also given.
IMPROVING, SHARES = ("ompl-bitstar", "ompl-informed-rrtstar", "ompl-rrtstar"), (0.1, 0.3)


def run(scene: str, planner: str, seed: int, seconds: float, refinement_budget: float) -> dict:
    """Plan once; what became of it."""
    problem = sp.load_scene(SCENES / f"{scene}.json")
    # in a process that has planned before: reading compiled code from disk takes half a second
    sp.plan(sp.load_scene(SCENES / "open.json"), LATTICE, time_limit=60.0, refinement_budget=0.0)
    started = time.perf_counter()
    # what planners compete for is time: the quickest plan
    result = sp.plan(problem, planner, time_limit=seconds, seed=seed, refinement_budget=refinement_budget, success=0.0)
    taken = time.perf_counter() - started
    return {
        "scene": scene,
        "planner": planner,
        "seed": seed,
        "seconds": seconds,
        "improve": refinement_budget,
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


def compare_defaults(scenes: list[str]) -> None:
    """Print the default and the quickest plans of each scene, and what holds over all."""
    rows = []
    head = (
        f"{'default quickest  ratio':>24s}",
        f"{'default quickest':>17s}",
        f"{'default quickest  ratio':>24s}",
        "default quickest",
    )
    print(f"{'':>14s} {'first plan, s':>24s} | {'whole time, s':>17s} | {'plan takes, s':>24s} | success")
    print(f"{'':>14s} {' | '.join(head)}")
    for scene in scenes:
        row: list = []
        for effort in (0.0, EFFORTS[-1]):
            times, plans = np.empty((5, 2)), []
            for k in range(5):
                for side, success in enumerate((0.98, 0.0)):
                    # read anew: a second plan for the same slider finds much of the work done
                    problem = sp.load_scene(SCENES / f"{scene}.json")
                    started = time.perf_counter()
                    plans.append(sp.plan(problem, time_limit=60.0, success=success, refinement_budget=effort))
                    times[k, side] = time.perf_counter() - started
            row += [*np.median(times, axis=0), plans[0], plans[1]]
        if not row[2].solved:
            continue
        first, first_quickest, _, _, whole, whole_quickest, default, quickest = row
        ratio, successes = default.duration / quickest.duration, (default.success_probability, quickest.success_probability)
        rows.append((first, first_quickest, ratio, *successes))
        words = f"{first:6.2f} {first_quickest:8.2f} {first / first_quickest:8.2f} | {whole:8.2f} {whole_quickest:8.2f} | "
        words += f"{default.duration:7.2f} {quickest.duration:8.2f} {ratio:7.3f} | "
        print(f"{scene:>14s} {words}{successes[0]:.4f} {successes[1]:.4f}", flush=True)
    first, quick, ratio, *successes = np.median(rows, axis=0)
    print(f"median: first plan {first:.2f} s, quickest {quick:.2f} s; {100 * (ratio - 1):.1f} % more time; ", end="")
    print(f"success {successes[0]:.3f} against {successes[1]:.3f}")


def alone(*job: object) -> dict:
    """:func:`run` in a process of its own: OMPL takes one seed in a process."""
    done = subprocess.run([sys.executable, __file__, "--alone", json.dumps(job)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--long", type=float, default=30.0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scenes", nargs="*")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--show", type=Path, help="rows of an earlier run, to print again")
    parser.add_argument("--scheduler", help="Dask cluster that does the work instead; it has to have this file")
    parser.add_argument("--default", action="store_true", help="the default success against none, and nothing else")
    parser.add_argument("--alone", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.alone:
        print(json.dumps(run(*json.loads(options.alone))))
        return
    scenes = options.scenes or sorted(file.stem for file in SCENES.glob("*.json") if file.stem != "triangle")
    if options.default:
        run(scenes[0], LATTICE, 0, 60.0, 0.0)
        compare_defaults(scenes)
        return
    others = [name for name in sp.planner_names() if name.startswith("ompl")]
    if options.show:
        rows = json.loads(options.show.read_text(encoding="utf-8"))
        for scene in dict.fromkeys(row["scene"] for row in rows):
            show(scene, [row for row in rows if row["scene"] == scene], others, options)
        summary(rows)
        return
    rows = []
    run(scenes[0], LATTICE, 0, 60.0, 0.0)  # compiled code is built before anything is timed
    for scene in scenes:
        jobs: list[tuple] = [(scene, LATTICE, 0, 120.0, effort) for effort in EFFORTS]
        jobs.append((scene, LATTICE, 0, options.seconds, math.inf))
        for name in others:
            for seed in range(options.seeds):
                shares = (1.0, *(SHARES if name in IMPROVING else ()))
                jobs += [(scene, name, seed, share * options.seconds, math.inf) for share in shares]
                jobs.append((scene, name, seed, options.seconds, 0.0))
        found = list(run_parallel(alone, jobs, options.jobs, scheduler=options.scheduler))
        solved = [row for row in found if row["valid"] and row["planner"] != LATTICE]
        if solved and options.long > 0:
            best = min(solved, key=lambda row: row["duration"])
            found.append(alone(scene, best["planner"], best["seed"], options.long, math.inf))
        rows += found
        show(scene, found, others, options)
    summary(rows)
    if options.output:
        options.output.write_text(json.dumps(rows, indent=1), encoding="utf-8")


def summary(rows: list[dict]) -> None:
    """Print what holds over all scenes."""
    first = [row["time"] for row in rows if row["planner"] == LATTICE and row["improve"] == 0 and row["valid"]]
    print(f"\nlattice: time to a first plan in {len(first)} scenes: median {np.median(first):.2f} s, worst {max(first):.2f} s")


def show(scene: str, rows: list[dict], others: list[str], options: argparse.Namespace) -> None:
    """Print a table of one scene."""
    best = min((row["duration"] for row in rows if row["valid"]), default=math.inf)
    print(f"\n{scene}: lower bound {rows[0]['bound']:.1f} s, best plan {best:.2f} s")
    head = ("solved", "first/s", "5%/s", "time/s", "plan/s", "/best", "/bound", "path/m", "changes", "deg")
    print(f"{'':>24s} " + " ".join(f"{word:>8s}" for word in head))

    def median(times: list[float]) -> str:
        return f"{np.median(times):.2f}" if times and np.isfinite(np.median(times)) else "-"

    def line(name: str, planner: str, seconds: float, refinement_budget: float) -> None:
        runs = [row for row in rows if row["planner"] == planner]
        those = [row for row in runs if row["seconds"] == seconds and row["improve"] == refinement_budget]
        good = [row for row in those if row["valid"]]
        # what takes no more than the runs of this line
        less = [row for row in runs if row["valid"] and (row["improve"] < refinement_budget or row["seconds"] <= seconds)]
        near = [
            min((r["time"] for r in less if r["seed"] == row["seed"] and r["duration"] <= 1.05 * best), default=math.inf)
            for row in those
        ]
        words = [f"{len(good)}/{len(those)}", median([row["time"] for row in less if row["improve"] == 0]), median(near)]
        words.append(median([row["time"] for row in those]))
        if good:
            middle = sorted(good, key=lambda row: row["duration"])[len(good) // 2]
            words += [f"{middle['duration']:.2f}", f"{middle['duration'] / best:.3f}"]
            words += [f"{middle['duration'] / max(middle['bound'], 1e-9):.2f}", f"{middle['length']:.2f}"]
            words += [str(middle["switches"]), f"{middle['margin']:.1f}"]
        else:
            words.append(those[0]["status"])
        print(f"{name:>24s} " + " ".join(f"{word:>8s}" for word in words), flush=True)

    line("lattice, default", LATTICE, 120.0, EFFORTS[-1])
    line(f"lattice, {options.seconds:g} s", LATTICE, options.seconds, math.inf)
    for name in others:
        line(name, name, options.seconds, math.inf)
    if rows[-1]["seconds"] == options.long:
        line(f"{rows[-1]['planner']}, {options.long:g} s", rows[-1]["planner"], options.long, math.inf)


if __name__ == "__main__":
    main()
