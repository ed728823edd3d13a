"""Pushes a second on one core and on two, and in MuJoCo (extra ``sim``; left out if it is not there), in one run.

python benchmarks/pushing.py [--pushes 2000]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import stablepush as sp

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "simulation"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pushes", type=int, default=2000)
    options = parser.parse_args()
    outline = np.array(((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)))
    feet = sp.SupportDistribution.from_polygon(outline, 0.03)
    slider = sp.Slider(outline, mass=1.0, support=feet)
    pusher = sp.Pusher.finger(0.005)
    ideal = sp.IdealLimitSurface(feet, 3.0)
    v = np.random.default_rng(0).normal(size=(60, 3)) / (1, 1, 0.04)
    quartic = sp.fit_limit_surface(ideal.wrench(v), v).surface
    for name, surface in ((f"{len(feet.points)} support points", ideal), ("quartic", quartic)):
        rig = sp.VirtualRig(slider, surface, 0.4, pusher)
        jobs = [(rig, sp.random_pushes(slider, pusher, 50, seed=k), k) for k in range(options.pushes // 50)]
        rig.execute(jobs[0][1][:2])
        speeds = {}
        for workers in (1, 2):
            begin = time.perf_counter()
            sp.execute_batch(jobs, workers=workers)
            speeds[workers] = 50 * len(jobs) / (time.perf_counter() - begin)
        ratio = speeds[2] / speeds[1]
        print(f"{name}: {speeds[1]:.0f} logged pushes a second on one core, {speeds[2]:.0f} on two, {ratio:.2f} times")
    try:
        from against_mujoco import both
    except ImportError:
        return
    try:
        found = [both(seed, 1e-4) for seed in range(8)]
    except ImportError:
        print("MuJoCo is not installed (extra sim)")
        return
    ours, theirs = sum(f[2] for f in found), sum(f[3] for f in found)
    here, there = len(found) / ours, len(found) / theirs
    print(f"8 pushes of 40 mm: {here:.0f} a second here, {there:.2f} in MuJoCo: {theirs / ours:.0f} times")


if __name__ == "__main__":
    main()
