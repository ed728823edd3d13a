"""How planning time grows with the number of obstacles and the size of the workspace, and where it goes.

Run: python benchmarks/planning_growth.py [--counts 10 30 100 300 1000] [--sizes 1 2 4 8 16]

Small random triangles stand in a square (``--counts``, 6 m wide) or, 4 a m², in squares of growing width (``--sizes``); the
slider of ``examples/scenes`` goes from corner to corner. Times are medians over 3 scenes, to a first plan and with the default
effort; then the shares of a profile.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from pathlib import Path

import numpy as np
import shapely

import stablepush as sp

SCENES = Path(__file__).parents[1] / "examples" / "scenes"
#: Parts of a plan, and the functions that stand for them.
PARTS = {
    "obstacles": ("world_of", "DistanceField", "__init__"),
    "steering": ("steering",),
    "edges": ("lattice_edges",),
    "search": ("_search",),
    "shortening": ("shortened",),
    "check": ("check_plan",),
}


def scene(count: int, width: float, seed: int) -> sp.PlanningProblem:
    """``count`` triangles in a square, away from start and goal."""
    rng = np.random.default_rng((count, seed))
    base = sp.load_scene(SCENES / "open.json")
    start, goal = np.array((0.25, 0.25, 0.0)), np.array((width - 0.3, width - 0.3, 0.0))
    keep = [shapely.Point(pose[:2]).buffer(0.35) for pose in (start, goal)]
    obstacles: list[np.ndarray] = []
    while len(obstacles) < count:
        angles = np.sort(rng.uniform(0, 2 * np.pi, size=3))
        outline = rng.uniform(0, width, size=2) + 0.03 * np.column_stack((np.cos(angles), np.sin(angles)))
        shape = shapely.Polygon(outline)
        if shape.is_valid and shape.area > 1e-4 and not any(shapely.intersects(shape, k) for k in keep):
            obstacles.append(outline)
    return sp.PlanningProblem(
        base.slider, base.surface, base.contacts, start, goal, obstacles, (0, 0, width, width), base.pusher, base.tolerance,
        base.speed, base.switch_cost, base.min_margin,
    )  # fmt: skip


def timed(problem: sp.PlanningProblem, refinement_budget: float) -> tuple[float, sp.PlanResult]:
    """Plan, and say how long it took."""
    started = time.perf_counter()
    result = sp.plan(problem, time_limit=120.0, refinement_budget=refinement_budget, success=0.0)
    return time.perf_counter() - started, result


def line(name: str, problems: list[sp.PlanningProblem]) -> None:
    """Print medians over scenes."""
    first, default = [timed(p, 0.0) for p in problems], [timed(p, 20_000.0) for p in problems]
    solved = sum(r.solved for _, r in default)
    ratios = [r.duration / r.lower_bound for _, r in default if r.solved and r.lower_bound]
    words = f"{np.median([t for t, _ in first]):8.2f} s {np.median([t for t, _ in default]):8.2f} s"
    worst = f"{np.median(ratios):.2f} times the lower bound" if ratios else "-"
    print(f"{name:>24s} {solved}/{len(problems)}   {words}   {worst}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", type=int, nargs="*", default=[10, 30, 100, 300, 1000])
    parser.add_argument("--sizes", type=float, nargs="*", default=[1, 2, 4, 8, 16])
    options = parser.parse_args()
    timed(sp.load_scene(SCENES / "open.json"), 20_000.0)
    print(f"{'':>24s} {'solved':>3s} {'first plan':>10s} {'default':>10s}")
    for count in options.counts:
        line(f"{count} obstacles", [scene(count, 6.0, seed) for seed in range(3)])
    for width in options.sizes:
        line(f"{width:g} m, {round(4 * width**2)} obstacles", [scene(round(4 * width**2), width, seed) for seed in range(3)])
    if options.counts:
        profile = cProfile.Profile()
        problem = scene(options.counts[-1], 6.0, 0)
        profile.enable()
        sp.plan(problem, time_limit=120.0, success=0.0)
        profile.disable()
        stats = pstats.Stats(profile)
        total = stats.total_tt  # type: ignore[attr-defined]
        print(f"\nwhere the time goes with {options.counts[-1]} obstacles, {total:.2f} s under the profiler:")
        for (file, _, name), (*_, spent, _) in sorted(stats.stats.items(), key=lambda item: -item[1][3]):  # type: ignore[attr-defined]
            if any(name in names for names in PARTS.values()) and ("stablepush" in file) and spent > 0.01 * total:
                print(f"{name:>24s} {100 * spent / total:5.1f} %   {Path(file).name}")


if __name__ == "__main__":
    main()
