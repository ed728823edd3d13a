"""What families of forms are good for: logs whose effects have forms that no catalogue has, diagnosed with parts switched off.

The logs are those of the blind check's generator (MuJoCo, extra ``sim``), with their labels open. Of effects that stand out by
ten times the noise: how many are named and nothing else is; and how many logs get a wrong name.

    python examples/diagnosis/forms.py [--first-number 0] [--logs 100] [--seed 1] [--pushes 60] [--jobs 2] [-o rows.json]
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from scipy.stats import binomtest

import stablepush as sp
from stablepush.blind.generator import generate
from stablepush.blind.instruments import write
from stablepush.blind.worlds import FORMS
from stablepush.core.parallel import run_parallel
from stablepush.diagnosis import attribution, gap_report

VARIANTS = ("as it is", "own forms only", "own forms first or none", "any further cause", "no final poses")
FORCES = ("fx", "fy", "tau")


@contextmanager
def without(variant: str) -> Iterator[None]:
    """The diagnosis without one of its parts."""
    only = [patch.object(attribution, "_in_other_forms", lambda *_: [])]
    parts = {
        "own forms only": [*only, patch.object(attribution, "_with_forms", lambda system, chosen, current: current)],
        "own forms first or none": only,
        "any further cause": [patch.object(attribution, "_FURTHER", 0.0)],
        "no final poses": [patch.object(gap_report, "replays", lambda *_: [])],
    }.get(variant, [])
    for part in parts:
        part.start()
    try:
        yield
    finally:
        for part in parts:
            part.stop()


def one(seed: int, number: int, pushes: int) -> list[dict[str, Any]]:
    """What every variant says of a log, and what it has."""
    label, log = generate("mujoco", seed, number, pushes)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write(Path(folder), *log)
        read = sp.read_pushlog(folder)
        rows = []
        for variant in VARIANTS:
            with without(variant):
                report = sp.diagnose(read)
            common = {"number": number, "kind": label["kind"], "trap": label["trap"], "applied": label["applied"]}
            rows.append(common | {"variant": variant, "verdict": str(report.verdict), "named": report.named})
    return rows


def share(count: int, total: int) -> str:
    if not total:
        return "none"
    low, high = binomtest(count, total).proportion_ci(0.95)
    return f"{count} of {total} ({100 * low:.0f} to {100 * high:.0f} %)"


def truth(row: dict[str, Any]) -> set[str]:
    return {a["effect"] for a in row["applied"]}


def show(rows: list[dict[str, Any]]) -> None:
    heads = ("named in full", "of its own form", "pairs in full", "wrong names", "clean with a name")
    print(" " * 24 + "".join(f"{head:>24s}" for head in heads))
    for variant in VARIANTS:
        mine = [row for row in rows if row["variant"] == variant]
        single = [row for row in mine if row["kind"] == "effect" and row["applied"][0]["detectable"]]
        own = [row for row in single if row["applied"][0]["form"] == FORMS[row["applied"][0]["effect"]][0]]
        pairs = [row for row in mine if row["kind"] == "pair" and all(a["detectable"] for a in row["applied"])]
        inside = [row for row in mine if row["kind"] in ("effect", "pair")]
        clean = [row for row in mine if row["kind"] in ("clean", "trap") and row["trap"] != "patch"]
        cells = (
            share(sum(set(row["named"]) == truth(row) for row in single), len(single)),
            share(sum(set(row["named"]) == truth(row) for row in own), len(own)),
            share(sum(set(row["named"]) == truth(row) for row in pairs), len(pairs)),
            share(sum(bool(set(row["named"]) - truth(row)) for row in inside), len(inside)),
            share(sum(bool(row["named"]) for row in clean), len(clean)),
        )
        print(f"{variant:<24s}" + "".join(f"{cell:>24s}" for cell in cells))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first-number", type=int, default=0)
    parser.add_argument("--logs", type=int, default=100)
    parser.add_argument("--pushes", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    numbers = range(options.first_number, options.first_number + options.logs)
    jobs = [(options.seed, number, options.pushes) for number in numbers]
    rows: list[dict[str, Any]] = []
    for found in run_parallel(one, jobs, options.jobs):
        rows += found
        if options.output:
            options.output.write_text(json.dumps(rows))
    show(rows)


if __name__ == "__main__":
    main()
