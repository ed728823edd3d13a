"""What each named effect gives, push by push, beside what is left of the measurements without it; how well its parameters are
told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.geometry import rotate_vectors

#: Share of a push's rows that must have a motion that determines the load.
_SEEN = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """An effect in the measurements of n pushes: added-variable data. If it acts as fitted, the partial
    residual is the contribution but for noise.

    Attributes
    ----------
    effect, unit : str
        ``unit`` is "N" for loads, "m" for clearances between fingers and outline.
    parts : sequence of str
        Names of the c components.
    contribution : array, shape (n, c)
        What the effect adds to the prediction at its estimate: medians over the rows of each push that determine their load.
    partial_residual : array, shape (n, c)
        Measured less predicted without the effect; all else as fitted.
    """

    effect: str
    unit: str
    parts: Sequence[str]
    contribution: FloatArray
    partial_residual: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Estimates:
    """Parameters (q) of the effects that are fitted together: names, correlation (q, q) of their errors, and the effects whose
    estimate is as large as this rig can have it."""

    names: Sequence[str]
    correlation: FloatArray
    at_bound: Sequence[str]


def signatures(likelihood: Likelihood, fitted: Fitted, effects: Sequence[str]) -> list[Signature]:
    """Return the signatures of fitted effects, each in loads or in clearances: where it shows more of itself over the noise."""
    found = []
    for id in (id for id in effects if id in fitted.values):
        ways = [_in_loads(likelihood, fitted, id), _in_clearances(likelihood, fitted, id)]
        seen = [(strength, signature) for strength, signature in ways if signature is not None]
        if seen:
            found.append(max(seen, key=lambda pair: pair[0])[1])
    return found


def estimates(likelihood: Likelihood, fitted: Fitted) -> Estimates:
    """Return how the parameters of the fitted effects hang together."""
    names = [f"{id}: {name}" for id, value in fitted.values.items() for name in _names(likelihood.experiment, id, len(value))]
    spread = np.sqrt(np.maximum(np.diag(fitted.covariance), np.finfo(float).tiny))
    correlation = np.clip(fitted.covariance / np.outer(spread, spread), -1.0, 1.0)
    return Estimates(names, correlation, [id for id, value in fitted.values.items() if likelihood.at_bound(id, value)])


def _names(experiment: Experiment, id: str, count: int) -> list[str]:
    """Names of the numbers that are fitted for an effect: its own parameters, then the terms of its family."""
    own, kind = experiment.size(id), experiment.effects[id]
    first = "lobes" if kind.two_lobed else kind.parameters[0].name
    if experiment.per_log(id):
        names = [f"{first} of log {k + 1}" for k in range(own)]
    else:
        names = [first] if own == 1 else [f"{first} {axis}" for axis in ("x", "y", *map(str, range(2, own)))]
    return names[:count] + [f"term {k + 1}" for k in range(count - own)]


def _in_loads(likelihood: Likelihood, fitted: Fitted, id: str) -> tuple[float, Signature | None]:
    wrench, o, rho = likelihood.wrench, likelihood.experiment.observations, likelihood.experiment.rho
    if wrench is None or id not in wrench.acting(fitted.values):
        return 0.0, None
    without = wrench.predict(fitted.loads, {name: value for name, value in fitted.values.items() if name != id})
    given = wrench.predict(fitted.loads, fitted.values) - without
    direction = np.arctan2(o.wrench[:, 1], o.wrench[:, 0])

    def parts(load: FloatArray) -> FloatArray:
        return np.column_stack((rotate_vectors(-direction, load[:, :2]), load[:, 2] / rho))

    names = ("along the load", "across the load", "moment over rho")
    determined = wrench.determined
    # a push shows nothing of which only a few rows have a motion that determines the load
    share = np.bincount(o.trial, weights=determined) / np.maximum(1, np.bincount(o.trial))
    enough = determined & (share[o.trial] >= _SEEN)
    determined = enough if enough.any() else determined
    pushes = [_medians(parts(load)[determined], o.trial[determined]) for load in (given, o.wrench - without)]
    return float((wrench.white(given) ** 2).sum()), Signature(id, "N", names, *pushes)


def _in_clearances(likelihood: Likelihood, fitted: Fitted, id: str) -> tuple[float, Signature | None]:
    touch = likelihood.clearance
    if not touch.shows(id) or not touch.is_seen:
        return 0.0, None
    left = touch.measured
    for name, value in fitted.values.items():
        if name != id and touch.shows(name):
            left = left - touch.change(name, value)
    given = touch.change(id, fitted.values[id])
    pushes = [_medians(part[:, None], touch.trial) for part in (given, left)]
    return float(((given / touch.noise) ** 2).sum()), Signature(id, "m", ("clearance",), *pushes)


def _medians(values: FloatArray, trial: np.ndarray) -> FloatArray:
    """Medians (n, c) of the rows of each trial: a single row may be far off."""
    return np.array([np.median(values[trial == k], axis=0) for k in np.unique(trial)])
