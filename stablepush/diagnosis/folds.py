"""Parts of a log for held-out judgements: trials by fold or half, and their log density by fits to the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.determined import determined_rows, size
from stablepush.diagnosis.equations import Fitted
from stablepush.diagnosis.system import System

#: Parts into which trials fall for held-out judgements.
FOLDS = 5


def folds_of(system: System, seed: int = 0) -> np.ndarray:
    """Number of the fold of each trial; repeats of a push stay together."""
    order = np.random.default_rng(seed).permutation(int(system.push.max(initial=-1)) + 1)
    fold = np.empty(len(order), dtype=int)
    fold[order] = np.arange(len(order)) % FOLDS
    return fold[system.push]


def halves_of(system: System) -> np.ndarray:
    """Number, 0 or 1, of the half of the pushes that each trial is in; repeats of a push stay together."""
    order = np.random.default_rng(1).permutation(int(system.push.max(initial=-1)) + 1)
    return (order % 2)[system.push]


def held_out(system: System, effects: Sequence[str], free: bool, folds: np.ndarray) -> FloatArray:
    """Log density (trials,) of each trial by a fit to the other folds."""
    result = np.zeros(len(folds))
    for test, fit in _fits(system, effects, free, folds):
        result[: len(fit.density)][test[: len(fit.density)]] = fit.density[test[: len(fit.density)]]
    return result


def held_out_square(system: System, effects: Sequence[str], free: bool, folds: np.ndarray) -> float:
    """Mean square (N²) that fits to the other folds leave of the wrenches of each, on rows whose motion determines the load."""
    trial, left = system.observations.trial, np.zeros(len(system.observations.trial))
    for test, fit in _fits(system, effects, free, folds):
        predicted = system.model.predict(fit.loads, system.of_wrench(fit.values))
        left[test[trial]] = size(system, system.observations.wrench - predicted)[test[trial]]
    return float(left[determined_rows(system)].mean())


def _fits(system: System, effects: Sequence[str], free: bool, folds: np.ndarray) -> Iterator[tuple[np.ndarray, Fitted]]:
    """The trials of each fold, and a fit to the others."""
    full = system.fit(effects, free)
    for k in range(FOLDS):
        test = folds == k
        if test.any() and not test.all():
            yield test, system.fit(effects, free, ~test, full)
