"""The same work on one process, on several, and on a Dask cluster of this machine: seconds, and whether the numbers are the same.

    python benchmarks/scale.py [--workers 2] [--rigs 12]

Cross-validation of two models, simulated logs with their diagnoses, and plans by a planner that draws at random.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import stablepush as sp
from stablepush.core.parallel import run_parallel
from stablepush.demo import demo_pokes

SCENES = Path(__file__).parents[1] / "examples" / "scenes"


def validated(**place: Any) -> list[float]:
    log = demo_pokes(24)
    loads, twists, _ = log.pairs()
    found = sp.cross_validate(loads, twists, ["poly4-cvx", "quadratic"], slider=log.rig.slider, repeats=3, **place)
    return found.errors.ravel().tolist()


def diagnosed(seed: int) -> list[float]:
    slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)], 1.2)
    support = sp.SupportDistribution.from_polygon(0.9 * slider.vertices, 0.03)
    pusher, effect = sp.Pusher.finger(0.005), sp.parse_effect("tilt:slope=0.02/0.01")
    slider = sp.Slider(slider.vertices, 1.2, support)
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(support, 3.5), 0.5, pusher, [effect], sp.Noise(0.03, 1e-4, 2e-3))
    report = sp.diagnose(rig.execute(sp.random_pushes(slider, pusher, 40, seed=seed), seed=seed).log)
    return [entry.probability for entry in report.ranking] + [entry.closed for entry in report.reductions]


def planned(seed: int) -> list[float]:
    problem = sp.load_scene(SCENES / "clutter.json")
    result = sp.plan(problem, "cor-lattice", seed=seed, refinement_budget=2000, success=0.0, margin_weight=0.1 * seed)
    return [result.duration, result.length, result.min_margin]


def each(function: Callable[[int], list[float]], rigs: int) -> Callable[..., list[float]]:
    def run(**place: Any) -> list[float]:
        return [v for row in run_parallel(function, [(seed,) for seed in range(rigs)], **place) for v in row]

    return run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rigs", type=int, default=12)
    options = parser.parse_args()
    from dask.distributed import LocalCluster

    tasks = {"cross-validation": validated, "diagnoses": each(diagnosed, options.rigs), "plans": each(planned, options.rigs)}
    with LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=None) as cluster:
        places: dict[str, dict[str, Any]] = {
            "1 process": {"processes": 1},
            f"{options.workers} processes": {"processes": options.workers},
            f"Dask, {options.workers} workers": {"scheduler": cluster.scheduler_address},
        }
        for name, task in tasks.items():
            first: list[float] = []
            for word, place in places.items():
                task(**place)  # workers start, compiled code is read
                began = time.perf_counter()
                found = task(**place)
                took = time.perf_counter() - began
                if not first:
                    first, alone = found, took
                off = float(np.abs(np.subtract(found, first)).max())
                print(f"{name:<18s}{word:<18s}{took:8.2f} s{alone / took:7.2f} times; largest difference {off:.1g}", flush=True)


if __name__ == "__main__":
    main()
