"""Would a plan made from a few pokes stay stuck? Plans executed on ideal surfaces of the posterior.

The limit surface of the built-in rig is identified from ``--pokes`` pokes; each solvable scene of ``examples/scenes`` is planned
with it: quickest, weighing margins, with a chance constraint on every push, and with CORs of the all-pressure region only.
Then 50 pressure distributions are drawn from those that the pokes leave likely. A push holds one body twist, so its load, and
whether the contact holds it, stays the same from its start to its end: on a given surface the slider stays stuck on a plan if and
only if every push of it is stable there.

    python examples/planning/executed.py [--pokes 5] [--surfaces 50] [--seed 0]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

import stablepush as sp
from stablepush.demo import demo_pokes, demo_slider

SCENES = Path(__file__).parents[1] / "scenes"
ASKED: dict[str, dict] = {
    "quickest": {"probability": 0.0},
    "margin weight 2": {"probability": 0.0, "margin_weight": 2.0},
    "chance 0.90": {"probability": 0.9},
    "chance 0.98": {"probability": 0.98},
    "all-pressure": {"probability": 0.0, "region": "all-pressure"},
}


def holds(problem: sp.PlanningProblem, truth: sp.LimitSurface, push: sp.Push) -> bool:
    """Return whether the slider stays stuck during a push on a surface."""
    return bool(sp.StabilityOracle(truth, problem.contacts[push.contact]).is_stable(push.twist))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pokes", type=int, default=5)
    parser.add_argument("--surfaces", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    loads, twists, _ = demo_pokes(options.pokes, options.seed).pairs()
    fit = sp.fit_limit_surface(loads, twists, slider=demo_slider(), seed=options.seed)
    assert fit.pressures is not None
    rng = np.random.default_rng((options.seed, 1))
    drawn = rng.choice(len(fit.pressures.loads), size=options.surfaces, replace=False)
    truths = [
        sp.IdealLimitSurface(
            sp.SupportDistribution(fit.pressures.points[i], fit.pressures.shares[i]), float(fit.pressures.loads[i])
        )
        for i in drawn
    ]
    names = sorted(file.stem for file in SCENES.glob("*.json") if file.stem not in ("triangle", "unsolvable"))
    print(f"surface from {options.pokes} pokes, {options.surfaces} pressures that they leave likely, scenes: {', '.join(names)}")
    print(f"{'':>16s} {'solved':>7s} {'time':>7s} {'sticking throughout':>21s} {'pushing time stuck':>19s}")
    quickest: dict[str, float] = {}
    for asked, words in ASKED.items():
        longer, whole, parts, solved = [], [], [], 0
        for name in tqdm(names, desc=asked, disable=None, leave=False):
            scene = sp.load_scene(SCENES / f"{name}.json")
            problem = sp.PlanningProblem(
                scene.slider, fit.surface, scene.contacts, scene.start, scene.goal, scene.obstacles, scene.bounds,
                scene.pusher, scene.tolerance, scene.speed, scene.switch_cost, 0.0,
            )  # fmt: skip
            result = sp.plan(problem, time_limit=60.0, **words)
            if not result.solved:
                continue
            solved += 1
            quickest.setdefault(name, result.duration)
            longer.append(result.duration / quickest[name])
            times = np.array([p.duration for p in result.pushes])
            stable = np.array([[holds(problem, truth, push) for push in result.pushes] for truth in truths])
            whole.append(stable.all(axis=1).mean())
            parts.append(float((stable @ times).mean() / times.sum()))
        means = f"{100 * np.mean(whole):19.1f} % {100 * np.mean(parts):17.1f} %"
        print(f"{asked:>16s} {solved:3d}/{len(names):<3d} {np.mean(longer):7.3f} {means}")


if __name__ == "__main__":
    main()
