"""What is measured in a log, as whitened rows: measured less predicted, over the noise."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from stablepush.core import BoolArray, FloatArray

#: Numbers that are fitted, by effect: those of its parameters, and those of its family behind them.
Values = dict[str, FloatArray]


class Channel(ABC):
    """Whitened rows (m,) of one kind of measurement.

    Attributes
    ----------
    trial : array of int, shape (m,)
        The trial of each whitened row.
    """

    trial: np.ndarray

    @abstractmethod
    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return measured minus predicted rows (m,) over their noise."""

    @abstractmethod
    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        """Return derivatives (m, size) of the prediction over the noise by the first numbers of an effect."""

    def by_loads(self, values: Values, directions: FloatArray | None, count: int) -> FloatArray:
        """Return derivatives (m, q) by the loads, along ``directions`` (k, q); by each of ``count`` loads if there are none. Zero
        for rows that do not depend on the friction under the slider."""
        return np.zeros((len(self.trial), count if directions is None else directions.shape[1]))

    def about(self, loads: FloatArray, values: Values) -> Channel:
        """Return the channel with derivatives about other loads and effects; itself if it has them exactly."""
        return self

    def tells(self, id: str) -> BoolArray:
        """Return which rows (m,) count as evidence for an effect. The effect itself changes all rows."""
        return np.ones(len(self.trial), dtype=bool)
