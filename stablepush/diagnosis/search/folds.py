"""Parts of a log for held-out judgements: trials by fold or half, and their log density by fits to the others."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.model import Model

#: Parts into which trials fall for held-out judgements.
FOLDS = 5


def folds_of(experiment: Experiment, seed: int = 0) -> np.ndarray:
    """Number of the fold of each trial; repeats of a push stay together."""
    order = np.random.default_rng(seed).permutation(int(experiment.push.max(initial=-1)) + 1)
    fold = np.empty(len(order), dtype=int)
    fold[order] = np.arange(len(order)) % FOLDS
    return fold[experiment.push]


def halves_of(experiment: Experiment) -> np.ndarray:
    """Number, 0 or 1, of the half of the pushes that each trial is in; repeats of a push stay together."""
    order = np.random.default_rng(1).permutation(int(experiment.push.max(initial=-1)) + 1)
    return (order % 2)[experiment.push]


class Predicted(NamedTuple):
    """How fits to the other folds predict each: the log ``density`` (trials,), and the mean ``square`` (N²) that they leave of
    the wrench on rows whose motion determines the load, not a number without forces."""

    density: FloatArray
    square: float


def predicted(likelihood: Likelihood, model: Model, folds: np.ndarray) -> Predicted:
    """Return how fits to the other folds predict the trials of each."""
    o, wrench = likelihood.experiment.observations, likelihood.wrench
    density, left = np.zeros(len(folds)), np.zeros(len(o.trial))
    full = likelihood.fit(model)
    for k in range(FOLDS):
        test = folds == k
        if not test.any() or test.all():
            continue
        fit = likelihood.fit(model, ~test, full)
        n = len(fit.density)
        density[:n][test[:n]] = fit.density[test[:n]]
        if wrench is not None:
            here = test[o.trial]
            left[here] = wrench.squares(o.wrench - wrench.predict(fit.loads, fit.values))[here]
    return Predicted(density, math.nan if wrench is None else float(left[wrench.determined].mean()))
