"""The bootstrap behind an effect's name, checked: scores linearised at the fit against refits of every draw.

For clean logs of random rigs, the errors of whole trials get random signs; then either the scores alone are recombined, as
the diagnosis does, or all is: surface refitted, all effects tested. The p-value of the likeliest effect that a share of
the draws stays below should be the same.

    python examples/diagnosis/thresholds.py [--logs 20] [--draws 60] [--pushes 60]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field, fields

import campaign
import numpy as np

from stablepush.diagnosis.likelihood.building import log_model
from stablepush.diagnosis.likelihood.channel import Values
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.rows.observations import observe
from stablepush.diagnosis.search.screening import beyond_pressure

LEVELS = (0.05, 0.1, 0.5)


@dataclass(frozen=True, eq=False)
class Moved(Likelihood):
    """The likelihood of rows that would have been measured, had the errors been others by ``moved`` (rows,)."""

    moved: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def residual(self, loads: np.ndarray, values: Values) -> np.ndarray:
        return super().residual(loads, values) + self.moved


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=20)
    parser.add_argument("--draws", type=int, default=60)
    parser.add_argument("--pushes", type=int, default=60)
    options = parser.parse_args()
    both: list[tuple[np.ndarray, np.ndarray]] = []
    print(f"{'log':>4s}" + "".join(f"{f'scores, {100 * v:.0f} %':>16s}{f'refits, {100 * v:.0f} %':>16s}" for v in LEVELS))
    for k in range(options.logs):
        rig, commands, draw = campaign.world("none", 7000 + k, options.pushes)
        log = rig.execute(commands, seed=draw).log
        likelihood, _ = log_model(observe(log), log.rig, [])
        asked, parts = beyond_pressure(likelihood), {f.name: getattr(likelihood, f.name) for f in fields(likelihood)}
        fitted = likelihood.fit(Model())
        tests = likelihood.tests(fitted, True, asked)
        signs = np.random.default_rng(k).choice((-1.0, 1.0), (options.draws, len(fitted.density)))
        linear = np.zeros(options.draws)
        for test in tests.values():
            linear = np.minimum(linear, test.log_p(test.under_none(signs)))
        full = np.zeros(options.draws)
        for i, sign in enumerate(signs):
            moved = Moved(**{**parts, "_fits": {}, "moved": (sign[likelihood.trial] - 1) * fitted.residual})
            found = moved.tests(moved.fit(Model(), start=fitted), True, asked)
            full[i] = min(test.log_p(test.statistic) for test in found.values())
        both.append((linear, full))
        cells = [f"{np.exp(np.quantile(values, level)):16.2e}" for level in LEVELS for values in (linear, full)]
        print(f"{k:>4d}" + "".join(cells), flush=True)
    scores, refits = (np.concatenate(parts) for parts in zip(*both, strict=True))
    for level in LEVELS:
        share = np.mean([(full <= np.quantile(linear, level)).mean() for linear, full in both])
        print(f"refits that are as improbable as {100 * level:.0f} % of the scores: {100 * share:.1f} %")
    print(f"correlation of the logarithms, draw by draw: {np.corrcoef(scores, refits)[0, 1]:.3f}")


if __name__ == "__main__":
    main()
