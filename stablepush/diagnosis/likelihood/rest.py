"""What a force sensor reads before a push, while it touches nothing: a channel."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.channel import Channel, Values
from stablepush.diagnosis.likelihood.experiment import Experiment


class Rest(Channel):
    """Forces in W of readings at rest: those are offsets of the sensor."""

    def __init__(self, experiment: Experiment) -> None:
        o = experiment.observations
        trial, self._forces = o.rest
        self._noise, self._effects = experiment.noise.force, experiment.effects
        first = np.minimum(np.searchsorted(o.trial, trial), max(0, len(o.trial) - 1))
        known = o.trial[first] == trial if len(o.trial) else np.zeros(len(trial), dtype=bool)
        self._late = np.where(known, o.order[first] - 0.5, 0.0) if len(o.trial) else np.zeros(len(trial))
        self._heading = np.where(known, np.nan_to_num(o.pusher[first, 2]), 0.0) if len(o.trial) else np.zeros(len(trial))
        self.trial = np.repeat(trial, 2).astype(int)

    def _slope(self, id: str, size: int) -> FloatArray:
        own = self._effects[id].at_rest(self._late, self._heading)
        if not own.shape[2]:
            return np.zeros((len(self.trial), size))
        return own.reshape(len(self.trial), own.shape[2])[:, :size]

    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        left = self._forces.ravel()
        for id, value in values.items():
            left = left - self._slope(id, len(value)) @ value
        return left / self._noise

    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        return self._slope(id, size) / self._noise
