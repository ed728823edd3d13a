"""The bootstrap behind an effect's name, checked: scores linearised at the fit against refits of every draw.

For clean logs of random rigs, the errors of whole trials get random signs; then either the scores alone are recombined, as
the diagnosis does, or all is: surface refitted, all effects tested. The p-value of the likeliest effect that a share of
the draws stays below should be the same.

    python examples/diagnosis/thresholds.py [--logs 20] [--draws 60] [--pushes 60]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial

import campaign
import numpy as np

from stablepush.diagnosis.likelihood.equations import Fitted, Values
from stablepush.diagnosis.likelihood.system import system_of
from stablepush.diagnosis.rows.observations import observe
from stablepush.diagnosis.search.attribution import BEYOND_PRESSURE

Residual = Callable[[np.ndarray, Values], np.ndarray]
LEVELS = (0.05, 0.1, 0.5)


def _moved(measured: Residual, moved: np.ndarray, loads: np.ndarray, values: Values) -> np.ndarray:
    return measured(loads, values) + moved


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
        system = system_of(observe(log), log.rig)
        fitted = system.fit([], True)
        tests = system.tests(fitted, True, BEYOND_PRESSURE)
        signs = np.random.default_rng(k).choice((-1.0, 1.0), (options.draws, len(fitted.density)))
        linear = np.zeros(options.draws)
        for test in tests.values():
            linear = np.minimum(linear, test.log_p(test.under_none(signs)))
        full, measured = np.zeros(options.draws), system.residual
        for i, sign in enumerate(signs):
            moved = (sign[system.trial] - 1) * fitted.residual
            # the rows that would have been measured, had the errors had these signs
            system.residual = partial(_moved, measured, moved)  # type: ignore[method-assign]
            again: Fitted = system.fit([], True, start=fitted)
            found = system.tests(again, True, BEYOND_PRESSURE)
            full[i] = min(test.log_p(test.statistic) for test in found.values())
        system.residual = measured  # type: ignore[method-assign]
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
