"""What the parts of the diagnosis are good for: wrong names and false alarms without the joint refit of the surface, without
trials as the unit of scatter, and without the bootstrap of the greatest statistic.

    python examples/diagnosis/ablation.py [--clean 60] [--per-effect 4] [--pushes 60] [--jobs 2]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import campaign
import numpy as np
from scipy.stats import chi2
from tqdm import tqdm

import stablepush as sp
from stablepush.core.parallel import run_parallel
from stablepush.diagnosis import attribution, gap_reduction, gap_report, system
from stablepush.diagnosis.equations import SIZES, Demands, ScoreTest
from stablepush.diagnosis.observations import Observations, observe

VARIANTS = ("as it is", "nominal surface, not refitted", "rows, not trials", "each effect at 5 %")


def by_rows(log: sp.PushLog) -> Observations:
    """Rows as if each were a push of its own."""
    o = observe(log)
    return replace(
        o, trial=np.arange(len(o.trial)), names=[str(k) for k in range(len(o.trial))], group=[""] * len(o.trial),
        rest=(o.rest[0][:0], o.rest[1][:0]),
    )  # fmt: skip


def one_by_one(tests: Mapping[str, ScoreTest], seed: int = 0) -> dict[str, float]:
    """An effect's own p-value, made such that 5 % of it meet the demand."""
    least = system.System.demands.family_wise_p
    return {id: float(chi2.sf(test.statistic, SIZES[id])) * least / 0.05 for id, test in tests.items()}


@contextmanager
def without(variant: str) -> Iterator[None]:
    """The diagnosis without one of its parts; final poses, which name nothing where there are forces, are left out."""
    base = system.System.base
    # rows that are called trials have no labels
    with patch.object(gap_report, "replays", lambda *_: []), patch.object(gap_reduction, "_labels", lambda *_: {}):
        if variant == VARIANTS[1]:
            with patch.object(system.System, "base", lambda self, values, free: base(self, values, False)):
                yield
        elif variant == VARIANTS[2]:
            with patch.object(gap_report, "observe", by_rows):
                yield
        elif variant == VARIANTS[3]:
            # the other demands are there for the same reason
            lax = Demands(3.84, 0.0, 0.0, system.System.demands.family_wise_p, np.inf)
            with patch.object(attribution, "family_wise_p_values", one_by_one), patch.object(system.System, "demands", lax):
                yield
        else:
            yield


def one(variant: str, id: str, seed: int, pushes: int) -> dict[str, object]:
    with without(variant):
        return {"variant": variant, **campaign.one(id, seed, pushes)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clean", type=int, default=60)
    parser.add_argument("--per-effect", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--pushes", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scheduler", help="Dask cluster that does the work instead; it has to find this folder's modules")
    options = parser.parse_args()
    kinds = [("none", k) for k in range(options.clean)]
    kinds += [(id, k) for k in range(options.per_effect) for id in campaign.LARGEST if id != "model-capacity"]
    jobs = [(v, id, options.first_seed + seed, options.pushes) for v in VARIANTS for id, seed in kinds]
    found = run_parallel(one, jobs, options.jobs, scheduler=options.scheduler)
    rows = list(tqdm(found, total=len(jobs), disable=None, leave=False))
    print(f"{'':<32s}{'clean logs with a name':>32s}{'effects named':>32s}{'with a wrong name':>32s}")
    for variant in VARIANTS:
        mine = [row for row in rows if row["variant"] == variant]
        clean = [row for row in mine if row["effect"] == "none"]
        acting = [row for row in mine if row["effect"] != "none"]
        alarms = sum(bool(row["named"]) or row["verdict"] == "unknown" for row in clean)
        right = sum(row["effect"] in str(row["named"]).split() for row in acting)
        wrong = sum(bool(set(str(row["named"]).split()) - {row["effect"]}) for row in acting)
        cells = [(alarms, len(clean)), (right, len(acting)), (wrong, len(acting))]
        print(f"{variant:<32s}" + "".join(f"{f'{n} of {m} ({campaign.interval(n, m)})':>32s}" for n, m in cells))


if __name__ == "__main__":
    main()
