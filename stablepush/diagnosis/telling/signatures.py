"""What each named effect gives, push by push, beside what is left of the measurements without it; how well its parameters are
told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.determined import determined_rows
from stablepush.diagnosis.likelihood.equations import Fitted
from stablepush.diagnosis.likelihood.system import IN_CLEARANCES, System
from stablepush.effects import CATALOGUE
from stablepush.geometry import rotate_vectors

#: Effects that are fitted as the two components of a pattern with two lobes, of which ratio and direction follow.
_LOBES = ("anisotropy-world", "anisotropy-object")
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


def signatures(system: System, fitted: Fitted, effects: Sequence[str]) -> list[Signature]:
    """Return the signatures of fitted effects, each in loads or in clearances: where it shows more of itself over the noise."""
    found = []
    for id in (id for id in effects if id in fitted.values):
        ways = [_in_loads(system, fitted, id), _in_clearances(system, fitted, id)]
        seen = [(strength, signature) for strength, signature in ways if signature is not None]
        if seen:
            found.append(max(seen, key=lambda pair: pair[0])[1])
    return found


def estimates(system: System, fitted: Fitted) -> Estimates:
    """Return how the parameters of the fitted effects hang together."""
    names = [f"{id}: {name}" for id, value in fitted.values.items() for name in _names(system, id, len(value))]
    spread = np.sqrt(np.maximum(np.diag(fitted.covariance), np.finfo(float).tiny))
    correlation = np.clip(fitted.covariance / np.outer(spread, spread), -1.0, 1.0)
    return Estimates(names, correlation, [id for id, value in fitted.values.items() if system.at_bound(id, value)])


def _names(system: System, id: str, count: int) -> list[str]:
    """Names of the numbers that are fitted for an effect: its own parameters, then the terms of its family."""
    own = system.size(id, whole=False)
    if id in system.own:
        first = system.own[id].parameter.name
    elif id in _LOBES:
        first = "lobes"
    else:
        first = CATALOGUE[id].parameters[0].name
    if id in system.each:
        names = [f"{first} of log {k + 1}" for k in range(own)]
    else:
        names = [first] if own == 1 else [f"{first} {axis}" for axis in ("x", "y", *map(str, range(2, own)))]
    return names[:count] + [f"term {k + 1}" for k in range(count - own)]


def _in_loads(system: System, fitted: Fitted, id: str) -> tuple[float, Signature | None]:
    acting = system.of_wrench(fitted.values)
    if not system.has_wrench or id not in acting:
        return 0.0, None
    o = system.observations
    without = system.model.predict(fitted.loads, {name: value for name, value in acting.items() if name != id})
    given = system.model.predict(fitted.loads, acting) - without
    direction = np.arctan2(o.wrench[:, 1], o.wrench[:, 0])

    def parts(load: FloatArray) -> FloatArray:
        return np.column_stack((rotate_vectors(-direction, load[:, :2]), load[:, 2] / system.rho))

    names = ("along the load", "across the load", "moment over rho")
    told = determined_rows(system)
    # a push shows nothing of which only a few rows have a motion that determines the load
    share = np.bincount(o.trial, weights=told) / np.maximum(1, np.bincount(o.trial))
    enough = told & (share[o.trial] >= _SEEN)
    told = enough if enough.any() else told
    pushes = [_medians(parts(load)[told], o.trial[told]) for load in (given, o.wrench - without)]
    return float((system.white(given) ** 2).sum()), Signature(id, "N", names, *pushes)


def _in_clearances(system: System, fitted: Fitted, id: str) -> tuple[float, Signature | None]:
    rows = np.concatenate([rows for _, rows in system.clearance_rows]) if system.clearance_rows else np.zeros(0, dtype=int)
    shows = id in IN_CLEARANCES or id in system.own
    if not shows or not len(rows):
        return 0.0, None
    o = system.observations
    left = np.concatenate([o.clearance[rows, k] for k, rows in system.clearance_rows])
    for name, value in fitted.values.items():
        if name != id and (name in IN_CLEARANCES or name in system.own):
            left = left - system.clearance_change(name, value)
    given = system.clearance_change(id, fitted.values[id])
    pushes = [_medians(part[:, None], o.trial[rows]) for part in (given, left)]
    return float(((given / system.clearance_noise) ** 2).sum()), Signature(id, "m", ("clearance",), *pushes)


def _medians(values: FloatArray, trial: np.ndarray) -> FloatArray:
    """Medians (n, c) of the rows of each trial: a single row may be far off."""
    return np.array([np.median(values[trial == k], axis=0) for k in np.unique(trial)])
