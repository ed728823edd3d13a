"""The distances between fingers and outline: a channel."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.channel import Channel, Values
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.robust import robust_variance
from stablepush.diagnosis.rows.observations import contact_velocity, rows_of
from stablepush.effects import EffectKind, TouchingRows


class Clearance(Channel):
    """Rows finger by finger, where one touches.

    Attributes
    ----------
    rows : list of tuple
        Numbers of the fingers, and rows of the log in which they touch.
    measured : array, shape (m,)
        In m.
    noise : float
        In m.
    """

    def __init__(self, experiment: Experiment) -> None:
        o, noise = experiment.observations, experiment.noise
        self._experiment = experiment
        self.rows = [(k, np.flatnonzero(np.isfinite(o.clearance[:, k]))) for k in range(2)]
        self.noise = float(np.hypot(noise.position * 1.05, (o.finger_radius or 0.0) * noise.angle))
        self.trial = np.concatenate([o.trial[rows] for _, rows in self.rows]).astype(int)
        self.measured: FloatArray = np.concatenate([o.clearance[rows, k] for k, rows in self.rows])

    @property
    def is_seen(self) -> bool:
        """Whether any finger is seen to touch."""
        return bool(len(self.trial))

    @cached_property
    def _touching(self) -> list[TouchingRows]:
        found = []
        for k, rows in self.rows:
            there = rows_of(self._experiment.observations, rows)
            faster = contact_velocity(replace(there, twist=there.acceleration), k)
            found.append(
                TouchingRows(
                    self._experiment.rows, k, rows, there.normal[:, k], contact_velocity(there, k), faster, there.off[k],
                    there.order,
                )
            )  # fmt: skip
        return found

    def shows(self, id: str) -> bool:
        """Whether an effect changes these distances."""
        return self._experiment.effects[id].in_clearances

    def _slope(self, kind: EffectKind, value: FloatArray, size: int) -> FloatArray:
        """Derivatives (m, size), in m for each unit."""
        if not kind.in_clearances:
            return np.zeros((len(self.trial), size))
        own: FloatArray = np.concatenate([kind.clearance_slope(touch, value) for touch in self._touching])
        if size <= own.shape[1]:
            return own
        # the terms of these families are changes over the log
        late = np.concatenate([touch.order for touch in self._touching]) - 0.5
        return np.column_stack((own, late[:, None] * own))

    def change(self, id: str, value: FloatArray) -> FloatArray:
        """Return the change (m,) of the distances by an effect, in m; of a slope that changes with the value: half way."""
        return np.asarray(self._slope(self._experiment.effects[id], 0.5 * value, len(value)) @ value)

    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        left = self.measured
        for id, value in values.items() if self.is_seen else ():
            if self.shows(id):
                left = left - self.change(id, value)
        return left / self.noise

    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        kind = self._experiment.effects[id]
        return self._slope(kind, values.get(id, np.zeros(0)), size) / self.noise

    def lack_of_fit(self, residual: FloatArray) -> float:
        """Return the robust mean square of residual rows (m,), over their noise; 0 where none are measured."""
        return float(robust_variance(residual**2)) if self.is_seen else 0.0
