"""What the parts of the diagnosis are good for, and what a log must have: the logs of a blind check, diagnosed with parts of the
method switched off, and with parts of the logs left out.

The check must be finished: its labels are open. Of effects that stand out by ten times the noise it counts how many are named
and nothing else is; of all logs but those out of the catalogue, how many get a wrong name; of clean logs, how many get any.

    stablepush blind -o check --sets 100 --generator both
    python examples/diagnosis/ablation.py check [--logs 100] [--jobs 2] [-o rows.json]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.stats import chi2
from tqdm import tqdm

import stablepush as sp
from stablepush.blind.score import Row, outcome, share
from stablepush.blind.seal import Ledger, open_label
from stablepush.core.parallel import run_parallel
from stablepush.diagnosis import pipeline
from stablepush.diagnosis.judge import gap_reduction
from stablepush.diagnosis.likelihood import building
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.likelihood import Demands, Likelihood
from stablepush.diagnosis.likelihood.prior import PointLoads
from stablepush.diagnosis.likelihood.score_test import ScoreTest
from stablepush.diagnosis.rows.observations import Observations, observe
from stablepush.diagnosis.search import alternatives, attribution, steps

FORCES = ("fx", "fy", "tau")
Part = Any


def _unchanged(log: sp.PushLog) -> sp.PushLog:
    return log


def _without_forces(log: sp.PushLog) -> sp.PushLog:
    return sp.PushLog(log.rig, log.trials, {k: v for k, v in log.samples.items() if k not in FORCES})


def _without(**fields: None) -> Callable[[sp.PushLog], sp.PushLog]:
    return lambda log: sp.PushLog(replace(log.rig, **fields), log.trials, log.samples)


_FRICTION = {"support_friction": None, "contact_friction": None}
#: What is left out of a log.
LOGS: Mapping[str, Callable[[sp.PushLog], sp.PushLog]] = {
    "no forces": _without_forces,
    "no friction in the rig": _without(**_FRICTION),
    "no finger radius": _without(finger_radius=None),
    "no noise": _without(noise=None),
    "none of these three": _without(**_FRICTION, finger_radius=None, noise=None),
}


def _observed(**parts: Callable[[Observations], Any]) -> Part:
    """Rows of a log with some of them changed."""

    def changed(log: sp.PushLog) -> Observations:
        o = observe(log)
        return replace(o, **{name: function(o) for name, function in parts.items()})

    return patch.object(pipeline, "observe", changed)


def _rows_as_trials(log: sp.PushLog) -> Observations:
    """Rows as if each were a push of its own."""
    o = observe(log)
    rows = len(o.trial)
    return replace(
        o, trial=np.arange(rows), names=[str(k) for k in range(rows)], group=[""] * rows,
        columns={name: values[o.trial] for name, values in o.columns.items()}, rest=(o.rest[0][:0], o.rest[1][:0]),
    )  # fmt: skip


def _one_by_one(tests: Mapping[str, ScoreTest], seed: int = 0) -> dict[str, float]:
    """An effect's own p-value, made such that 5 % of it meet the demand."""
    sizes = {id: len(test.estimate) for id, test in tests.items()}
    return {id: float(chi2.sf(test.statistic, sizes[id])) * _DEMANDS.family_wise_p / 0.05 for id, test in tests.items()}


def _whole(self: Likelihood, *arguments: Any, whole: bool = False) -> dict[str, ScoreTest]:
    return _TESTS(self, *arguments, whole=True)


def _size(self: Experiment, id: str, family: bool = False) -> int:
    return _SIZE(self, id, True)


_DEMANDS, _TESTS, _SIZE, _DIRECTIONS = building._DEMANDS, Likelihood.tests, Experiment.size, PointLoads.directions
_LAX = Demands(3.84, 0.0, 0.0, _DEMANDS.family_wise_p, np.inf)
_OWN_FORMS = [
    patch.object(steps, "_in_other_forms", lambda *_: ([], {})),
    patch.object(steps, "_with_families", lambda at: at),
]
_ANY_SHARE = patch.object(steps.Search, "least_gain", 0.0)
_REFITTED = patch.object(PointLoads, "directions", lambda self, free: _DIRECTIONS(self, False))
#: What is switched off.
PARTS: Mapping[str, list[Part]] = {
    "families off": _OWN_FORMS,
    "heredity off: families as a whole": [
        *_OWN_FORMS, patch.object(Likelihood, "tests", _whole), patch.object(Experiment, "size", _size), _ANY_SHARE,
    ],
    "further causes at any share": [_ANY_SHARE],
    "channel final poses off": [patch.object(pipeline, "replays", lambda *_: [])],
    "channel clearances off": [_observed(clearance=lambda o: np.full_like(o.clearance, np.nan))],
    "channel rest off": [_observed(rest=lambda o: (o.rest[0][:0], o.rest[1][:0]))],
    "channel slip off": [
        patch.object(attribution, "slip_friction", lambda *_: None),
        patch.object(pipeline, "friction_from_poses", lambda *_: None),
    ],
    "plausibility off": [
        *(patch.object(module, "possible", lambda *_: True) for module in (attribution, alternatives, steps)),
        *(patch.object(module, "identifiable", lambda *_: True) for module in (alternatives, steps)),
        patch.object(Experiment, "clipped", lambda self, id, value: value),
        patch.object(Likelihood, "at_bound", lambda *_: False),
    ],
    "replication off": [patch.object(module, "replicates", lambda *_: True) for module in (attribution, alternatives)],
    "surface not refitted": [_REFITTED],
    "rows, not trials": [
        patch.object(pipeline, "observe", _rows_as_trials),
        # rows that are called trials have neither final poses nor labels
        patch.object(pipeline, "replays", lambda *_: []), patch.object(gap_reduction, "_labels", lambda *_: {}),
    ],
    "each effect at 5 %": [
        *(patch.object(module, "family_wise_p_values", _one_by_one) for module in (alternatives, steps)),
        patch.object(building, "_DEMANDS", _LAX),
    ],
}  # fmt: skip
VARIANTS = ("as it is", *LOGS, *PARTS)


@contextmanager
def without(variant: str) -> Iterator[None]:
    """The diagnosis without one of its parts."""
    with ExitStack() as parts:
        for part in PARTS.get(variant, []):
            parts.enter_context(part)
        yield


def answer(variant: str, folder: Path, label: dict[str, Any]) -> Row:
    """What a variant says of a log."""
    log = LOGS.get(variant, _unchanged)(sp.read_pushlog(folder))
    try:
        with without(variant):
            report = sp.diagnose(log)
        said = {"verdict": str(report.verdict), "effects": report.named}
    except (ValueError, np.linalg.LinAlgError) as error:
        # a part that is missing may break what stands on it
        said = {"verdict": "failed", "effects": [], "why": str(error)}
    return {"variant": variant, "set": folder.parent.name, "label": label, "answer": said}


def opened(check: Path, count: int) -> list[tuple[Path, dict[str, Any]]]:
    """The logs and labels of a finished check."""
    if not (check / "score.csv").is_file():
        raise SystemExit(f"{check}: expected a finished blind check, it has no score.csv")
    ledger, key = Ledger(check / "ledger.jsonl"), (check / "key").read_bytes()
    found = []
    for folder in sorted((check / "sets").iterdir())[:count]:
        found.append((folder / "log", open_label(ledger, int(folder.name), (folder / "label.sealed").read_bytes(), key)))
    return found


def show(rows: list[Row]) -> None:
    """Print a line for each variant."""
    print(f"{'':<36s}{'named, nothing else':>32s}{'wrong names':>32s}{'clean with a name':>32s}")
    for variant in dict.fromkeys(row["variant"] for row in rows):
        mine = [(row, outcome(row)) for row in rows if row["variant"] == variant]
        single = [said for row, said in mine if row["label"]["kind"] == "effect" and row["label"]["applied"][0]["detectable"]]
        judged = [said for row, said in mine if row["label"]["kind"] != "outside"]
        clean = [row for row, _ in mine if row["label"]["kind"] == "clean"]
        cells = (
            share(single.count("right"), len(single)),
            share(sum(said in ("wrong name", "right and more") for said in judged), len(judged)),
            share(sum(bool(row["answer"]["effects"]) for row in clean), len(clean)),
        )
        failed = sum(said == "failed" for _, said in mine)
        print(f"{variant:<36s}" + "".join(f"{cell:>32s}" for cell in cells) + (f"  {failed} failed" if failed else ""))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("check", type=Path, help="folder of a finished blind check")
    parser.add_argument("--logs", type=int, default=100, help="how many of its logs, from the first")
    parser.add_argument("--variants", nargs="*", default=VARIANTS, choices=VARIANTS, metavar="VARIANT")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    logs = opened(options.check, options.logs)
    jobs = [(variant, *log) for log in logs for variant in options.variants]
    rows = list(tqdm(run_parallel(answer, jobs, options.jobs), total=len(jobs), disable=None, leave=False))
    if options.output:
        options.output.write_text(json.dumps(rows))
    show(rows)


if __name__ == "__main__":
    main()
