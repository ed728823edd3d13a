"""Logs of executed plans on rigs without any effect: how often does the diagnosis give a cause?

Random sliders on random feet, and a surface from eight pokes with 3 % noise (`examples/planning/arrive.py`). One to six default
plans are executed on the simulated rig, and their log diagnosed. ``itself``: the table has the friction that the plans were made
with, so that the nominal simulation is the truth. ``feet``: the table has that of the feet, which the surface of eight pokes does
not quite meet. Each with forces and without.

    python examples/diagnosis/executed_plans.py [--tasks 100] [--first-seed 0] [--jobs 2] [-o rows.json]
    python examples/diagnosis/executed_plans.py --effect contact-friction:mu=0.3 [--plans 1]

With an effect, logs in which it spoils the plans are told apart: the object ends more than 10 mm from where it ends without it.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

import stablepush as sp
from stablepush.effects import parse_effect
from stablepush.rig import Command, plan_commands

sys.path.append(str(Path(__file__).parents[1] / "planning"))
from arrive import FINGER, Task, random_task

#: A plan is spoilt if the object ends so far (m) from where it ends without the effect.
SPOILT = 0.01
#: Noise of a row: N, m, rad.
NOISE = sp.Noise(0.02, 1e-4, 1e-3)
FORCES = ("fx", "fy", "tau")


def commands_of(task: Task, seed: int, most: int) -> list[Command]:
    """Commands of one to ``most`` default plans, each from a start of its own to a goal of its own."""
    rng = np.random.default_rng([seed, 4])
    heading = float(task.problem.contacts[0].frame[2])
    found: list[Command] = []
    for _ in range(int(rng.integers(1, most + 1))):
        start = np.array((*rng.uniform(-0.1, 0.1, 2), rng.uniform(-np.pi, np.pi)))
        ahead, aside = rng.uniform(0.25, 0.5), rng.uniform(-0.2, 0.2)
        c, s = np.cos(start[2] + heading), np.sin(start[2] + heading)
        goal = start + np.array((c * ahead - s * aside, s * ahead + c * aside, rng.uniform(-0.8, 0.8)))
        problem = task.problem.with_changes(start=start, goal=goal)
        result = sp.plan(problem, refinement_budget=2000)
        if result.solved:
            found += plan_commands(problem, result, FINGER)
    return found


def rows_of(job: tuple[int, tuple[str, ...], int]) -> list[dict[str, Any]]:
    """What the diagnosis says of the log of one task, on both tables."""
    seed, texts, most = job
    task = random_task(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        commands = commands_of(task, seed, most)
    if not commands:
        return []
    problem, contact = task.problem, task.problem.contacts[0]
    effects = [parse_effect(text) for text in texts]
    pusher = sp.Pusher.of_contact(contact, FINGER)
    load = task.table_mu * float(problem.slider.mass or 1.0) * 9.81
    feet = sp.IdealLimitSurface(sp.SupportDistribution(task.feet - task.center, task.shares), load)
    believed = sp.VirtualRig(problem.slider, problem.surface, contact.mu, pusher, effects, NOISE)
    real = sp.VirtualRig(problem.slider, feet, contact.mu, pusher, effects, NOISE)
    known = believed.execute(commands, seed=seed).log
    found = []
    for name, rig in (("itself", believed), ("feet", real)):
        execution = rig.execute(commands, seed=seed)
        without = replace(rig, effects=[]).execute(commands, seed=seed)
        spoilt = float(np.hypot(*(execution.final_pose - without.final_pose)[:2])) > SPOILT
        log = execution.log
        rig_of_log = replace(log.rig, slider=known.rig.slider, support_friction=known.rig.support_friction, model=known.rig.model)
        log = sp.PushLog(rig_of_log, log.trials, log.samples)
        blind = sp.PushLog(rig_of_log, log.trials, {k: v for k, v in log.samples.items() if k not in FORCES})
        for words, asked in ((f"{name}, forces", log), (f"{name}, no forces", blind)):
            report = sp.diagnose(asked)
            row = {"seed": seed, "name": words, "pushes": len(commands), "spoilt": spoilt, "verdict": str(report.verdict)}
            found.append(row | {"effects": report.named, "sentence": report.sentence})
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=100)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--effect", nargs="*", default=[], help="effects of the rig, as the command simulate takes them")
    parser.add_argument("--plans", type=int, default=6, help="most plans of a log")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    seeds = range(options.first_seed, options.first_seed + options.tasks)
    with ProcessPoolExecutor(options.jobs) as pool:
        for found in pool.map(rows_of, [(seed, tuple(options.effect), options.plans) for seed in seeds]):
            rows += found
            if options.output:
                options.output.write_text(json.dumps(rows))
    sizes = [row["pushes"] for row in rows]
    print(f"{len(rows)} logs of {min(sizes)} to {max(sizes)} pushes, median {np.median(sizes):.0f}")
    for name in dict.fromkeys(row["name"] for row in rows):
        mine = [row for row in rows if row["name"] == name]
        named = sum(row["verdict"] in ("named", "ambiguous") for row in mine)
        low, high = binomtest(named, len(mine)).proportion_ci(0.95)
        words = Counter(" ".join((row["verdict"], *row["effects"])) for row in mine)
        print(
            f"{name:>20s}: a cause in {named} of {len(mine)} ({100 * low:.1f} to {100 * high:.1f} %); {dict(words.most_common())}"
        )
        if options.effect:
            ids = {text.split(":")[0] for text in options.effect}
            lost = [row for row in mine if row["spoilt"]]
            among = sum(ids <= set(row["effects"]) for row in lost)
            print(f"{'':>20s}  spoilt: {len(lost)}; of these with the effect among the names: {among}")


if __name__ == "__main__":
    main()
