"""Parts of a log for held-out judgements: trials by fold or half, and their log density by fits to the others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.determined import determined_rows, size
from stablepush.diagnosis.likelihood.system import System

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


class Predicted(NamedTuple):
    """How fits to the other folds predict each: the log ``density`` (trials,), and the mean ``square`` (N²) that they leave of
    the wrench on rows whose motion determines the load, not a number without forces."""

    density: FloatArray
    square: float


def predicted(system: System, effects: Sequence[str], free: bool, folds: np.ndarray) -> Predicted:
    """Return how fits to the other folds predict the trials of each."""
    trial = system.observations.trial
    density, left = np.zeros(len(folds)), np.zeros(len(trial))
    full = system.fit(effects, free)
    for k in range(FOLDS):
        test = folds == k
        if not test.any() or test.all():
            continue
        fit = system.fit(effects, free, ~test, full)
        n = len(fit.density)
        density[:n][test[:n]] = fit.density[test[:n]]
        if system.has_wrench:
            wrench = system.model.predict(fit.loads, system.of_wrench(fit.values))
            left[test[trial]] = size(system, system.observations.wrench - wrench)[test[trial]]
    return Predicted(density, float(left[determined_rows(system)].mean()) if system.has_wrench else math.nan)
