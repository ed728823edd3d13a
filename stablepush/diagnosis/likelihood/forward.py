"""What a rig's sensors would read for the motions of a log: the nominal simulation with effects, linear in the support's
loads."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.rows.observations import Observations
from stablepush.effects import CATALOGUE, REFERENCE_SPEED, EffectKind, LogRows
from stablepush.geometry import rotate_vectors

#: Numbers that the compiled readings take: those of all effects, and behind them those of their families.
_COUNT = 53

Values = Mapping[str, FloatArray]


class ForwardModel:
    """Predicted wrenches of the rows of a log, in the tracked frame.

    Parameters
    ----------
    observations : Observations
    points : array, shape (k, 2)
        Support points in B.
    weight : float
        ``m g`` in N; a slope of the table makes the force ``weight * slope``.
    inertia : float
        Moment of inertia over the mass, in m².
    center : array, shape (2,)
        Nominal centre of pressure in B, about which pressure spreads.
    beyond_points : array, shape (n, 3)
        Loads in B that the nominal surface adds to those of the points.
    own : mapping of str to EffectKind
        Effects of a lab's own, which act on what the catalogue's leave.
    rows : LogRows, optional
        The same rows, as those see them.
    """

    def __init__(
        self,
        observations: Observations,
        points: FloatArray,
        weight: float,
        inertia: float,
        center: FloatArray,
        beyond_points: FloatArray,
        own: Mapping[str, EffectKind] = MappingProxyType({}),
        rows: LogRows | None = None,
    ) -> None:
        self._own, self._rows = own, rows
        self.beyond_points = beyond_points
        self._o, self._weight, self._inertia = observations, float(weight), float(inertia)
        self._points, self._center = np.array(points, dtype=np.float64), np.array(center, dtype=np.float64)
        known = np.isfinite(observations.pusher).all(axis=1)
        # without a pusher pose the sensor is taken to sit at the contact, else at the origin
        place = observations.pose[:, :2].copy()
        touching = np.isfinite(observations.place[:, 0]).all(axis=1)
        at = observations.pose[:, :2] + rotate_vectors(observations.pose[:, 2], np.nan_to_num(observations.place[:, 0]))
        place[touching] = at[touching]
        place[known] = observations.pusher[known, :2]
        if observations.computed_moments:
            # what the sensor does to a force is then in the moment as well, with the arm of the contact point
            place[touching] = at[touching]
        self.place = place
        self._tool = np.nan_to_num(observations.pusher[:, 2])

    def matrix(self, values: Values) -> tuple[FloatArray, FloatArray]:
        """Return ``G`` (n, 3, k) and ``c`` (n, 3): the measured wrenches are ``G m + c`` for friction loads ``m`` (k,) in N."""
        matrix = np.empty((len(self._o.twist), 3, len(self._points)))
        constant = self._read(values, np.zeros(len(self._points)), matrix)
        if not set(values) & set(self._own):
            return matrix, constant
        read = self._with_own(constant, values)
        for k in range(matrix.shape[2]):
            matrix[:, :, k] = self._with_own(matrix[:, :, k] + constant, values) - read
        return matrix, read

    def _with_own(self, wrench: FloatArray, values: Values) -> FloatArray:
        """Loads (n, 3) as the lab's own effects change them."""
        for id, effect in self._own.items():
            if id in values and self._rows is not None:
                wrench = effect.wrench(self._rows, wrench.copy(), values[id])
        return wrench

    def predict(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return the wrenches (n, 3) for friction loads (k,)."""
        return self._with_own(self._read(values, loads, np.empty((0, 3, 0))) + self.beyond_points, values)

    def _read(self, values: Values, loads: FloatArray, matrix: FloatArray) -> FloatArray:
        from stablepush.diagnosis.likelihood.sensor_readings import read

        o, theta = self._o, np.zeros(_COUNT)
        for id, value in values.items():
            kind = CATALOGUE.get(id)
            if kind is not None and kind.slots is not None:
                own = min(len(value), kind.size)
                theta[kind.slots[0] : kind.slots[0] + own] = value[: kind.size]
                if kind.term_slots is not None:
                    terms = value[kind.size :]
                    theta[kind.term_slots[0] : kind.term_slots[0] + len(terms)] = terms
        result = np.empty((len(o.twist), 3))
        read(
            self._points, self._center, self._inertia, self._weight, REFERENCE_SPEED, o.order, o.pose, o.twist, o.acceleration,
            self.place, self._tool, theta, np.ascontiguousarray(loads), matrix, result,
        )  # fmt: skip
        return result
