"""Logs with confounded causes: how often the pushes that the diagnosis proposes separate them, against as many random pushes.

Small campaigns (few pushes, one place, one speed, few headings) on random rigs are diagnosed until enough are ambiguous; then the
same rig makes the proposed pushes as well, or random ones, and the longer log is diagnosed again.

    python examples/diagnosis/next_experiment.py [--logs 40] [--pushes 12] [--more 2] [--without-forces] [--jobs 2]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import count, islice

import campaign
import numpy as np

import stablepush as sp
from stablepush.core.parallel import run_parallel

#: Effects that small campaigns confuse, and how strong they are.
CONFUSED = (
    "anisotropy-world", "anisotropy-object", "speed-dependence", "spatial-variation", "drift", "tilt", "force-bias",
    "force-rotation", "frame-offset", "contact-geometry",
)  # fmt: skip
#: Where the slider is reset in a small campaign: within this many rad of one heading, and this many m of one place.
TURN, FIELD = 0.3, 0.04


def small(push: sp.EdgePush, rng: np.random.Generator) -> sp.EdgePush:
    """The same push of a slider that is reset as always."""
    start = np.array((*rng.uniform(-FIELD / 2, FIELD / 2, 2), rng.uniform(-TURN, TURN)))
    return replace(push, start=start)


def named(log: sp.PushLog, truth: str, forces: bool) -> tuple[str, bool, sp.GapReport]:
    if not forces:
        log = sp.PushLog(log.rig, log.trials, {c: v for c, v in log.samples.items() if c not in campaign.FORCES})
    report = sp.diagnose(log)
    return report.verdict, report.named == [truth], report


def one(id: str, seed: int, pushes: int, wanted: int, forces: bool) -> tuple[str, ...] | None:
    """None if the small log is not ambiguous; else the effect, the effects reported, and verdicts with more pushes."""
    rig, commands, draw = campaign.world(id, seed, pushes, groups=0, speeds=(0.015, 0.025))
    rng = np.random.default_rng(seed)
    commands = [small(command, rng) for command in commands]
    verdict, _, report = named(rig.execute(commands, seed=draw).log, id, forces)
    proposed = report.next_experiment.pushes
    if verdict != "ambiguous" or not proposed:
        return None
    more = list(proposed[:wanted])
    others = sp.random_pushes(rig.slider, rig.pusher, len(more), seed=seed, groups=0)
    words = []
    for extra in (more, others):
        verdict, right, longer = named(rig.execute([*commands, *extra], seed=draw).log, id, forces)
        words += [verdict, "right" if right else "wrong", " ".join(longer.named)]
    return (id, " ".join(report.named), *words)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=40)
    parser.add_argument("--pushes", type=int, default=12)
    parser.add_argument("--more", type=int, default=2, help="pushes that are added")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--without-forces", action="store_true", help="logs that have poses alone")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scheduler", help="Dask cluster that does the work instead; it has to find this folder's modules")
    options = parser.parse_args()
    forces = not options.without_forces
    confused = [id for id in CONFUSED if forces or id in campaign.MOVING]
    jobs = ((id, options.first_seed + seed, options.pushes, options.more, forces) for seed in count() for id in confused)
    found: list[tuple[str, ...]] = []
    tried = 0
    while len(found) < options.logs:
        for row in run_parallel(one, islice(jobs, 20 * options.jobs), options.jobs, scheduler=options.scheduler):
            tried += 1
            if row is not None and len(found) < options.logs:
                found.append(row)
                print(f"{row[0]:<20s} reported {row[1]:<50s} proposed: {row[2]} {row[4]}; random: {row[5]} {row[7]}", flush=True)
    print(f"{len(found)} ambiguous logs of {tried} that were simulated; the true cause among those reported in ", end="")
    print(sum(row[0] in row[1].split() for row in found))
    for word, at in (("proposed", 3), ("random", 6)):
        right = sum(row[at] == "right" for row in found)
        wrong = sum(row[at - 1] == "named" and row[at] == "wrong" for row in found)
        share = campaign.interval(right, len(found))
        print(f"{options.more} {word} pushes more: {right} of {len(found)} resolved ({share}), something else named {wrong}")


if __name__ == "__main__":
    main()
