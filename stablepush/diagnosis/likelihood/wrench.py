"""The loads that are read: a channel. ``y = G(θ) m + c(θ) + noise``, with ``m`` the friction loads of support points.

The noise of a row is that of the force sensor, and what noise of the motion makes of the prediction.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.likelihood.channel import Channel, Values
from stablepush.diagnosis.likelihood.experiment import Experiment, log_rows
from stablepush.diagnosis.likelihood.forward import ForwardModel
from stablepush.diagnosis.rows.noise import of_readings, of_turns
from stablepush.diagnosis.rows.observations import rows_of

#: Acceleration that rows with means over parts of a push leave uncertain: share of what its differences to either side differ by,
#: and of itself.
_UNSTEADY = (0.25, 0.3)
#: Change of the friction for each e-fold of speed that a row leaves uncertain whose speed changes: it is of one of its speeds.
_FRICTION_OF_SPEED = 0.05
#: Share of its speed that a row may gain or lose whose speed is known.
_STEADY = 0.3
#: Noise of a gain of speed, over that of a difference of poses: three times the standard deviation of differences of differences.
_OF_NOISE = 1.8
#: Share of a load that noise of the motion may leave open, for rows that count in the root mean squares of the wrench.
_OPEN = 0.3
#: Share of the rows that must have such a motion, for the others to be left out.
_ENOUGH = 0.2


class Wrench(Channel):
    """Measured loads of all rows (n,); those of each of several logs are predicted by its own friction loads.

    Attributes
    ----------
    place : array, shape (n, 2)
        Of the sensor in W.
    beyond_points : array, shape (n, 3)
        What the nominal surface adds to the loads of the points.
    reading_covariance, noise_covariance, covariance : array, shape (n, 3, 3)
        Of the readings; with what noise of the motion makes of a load; and what rows are trusted to, which is less beside the
        facets of points.
    """

    def __init__(self, experiment: Experiment, loads: FloatArray) -> None:
        o, slider = experiment.observations, experiment.rig.slider
        self._experiment = experiment
        self.beyond_points = experiment.believed.beyond_points(o.twist)
        self._rows = [np.flatnonzero(experiment.log[o.trial] == k) for k in range(experiment.logs)]
        own = {id: kind for id, kind in experiment.effects.items() if kind.reads_otherwise}
        self._models = [
            ForwardModel(
                rows_of(o, rows), experiment.points, experiment.weight, slider.radius_of_gyration**2, experiment.center,
                self.beyond_points[rows], own, log_rows(rows_of(o, rows)),
            )
            for rows in self._rows
        ]  # fmt: skip
        self.place = np.empty((len(o.time), 2))
        for rows, model in zip(self._rows, self._models, strict=True):
            self.place[rows] = model.place
        self.trial = np.repeat(o.trial, 3)
        self.nominal = loads if experiment.known_scale else self._scaled(loads)
        self._whiten(self.nominal)

    def _scaled(self, loads: FloatArray) -> FloatArray:
        """Loads (k,) whose friction as a whole is that of the log."""
        size = (1, 1, self._experiment.rho)
        one, measured = self.predict(loads, {}) / size, self._experiment.observations.wrench / size
        return float((one * measured).sum() / (one * one).sum()) * loads

    def _whiten(self, loads: FloatArray) -> None:
        """Factors of the inverse covariances of the rows' wrenches."""
        experiment, o, beyond = self._experiment, self._experiment.observations, self.beyond_points
        noise, points, rho, slider = experiment.noise, experiment.points, experiment.rho, experiment.rig.slider
        self.reading_covariance = of_readings(o, noise, self.place)
        linear, full = experiment.believed.spread(points, loads, o.twist, experiment.motion_noise)
        # no pressure has the friction of a model: as far as it differs from that of points it is uncertain
        covariance = self.reading_covariance + beyond[:, :, None] * beyond[:, None, :]
        # where the speed changes between rows, they do not show what the mass takes; rows that are nearly at one time show
        # nothing of it
        inertia = (slider.mass or 0.0) * np.array((1.0, 1.0, slider.radius_of_gyration**2))
        most = float(np.abs(loads).sum()) + noise.force
        for share, off in zip(_UNSTEADY, (o.unsteady, o.acceleration), strict=True):
            jolt = share * inertia * off
            jolt = jolt / np.maximum(1.0, np.linalg.norm(jolt / (1, 1, rho), axis=1, keepdims=True) / most)
            covariance += jolt[:, :, None] * jolt[:, None, :]
        self.noise_covariance = covariance + full
        turns = of_turns(o, points, loads, experiment.motion_noise, noise, rho)
        self.covariance = covariance + (full if experiment.believed.model is not None else linear + turns)
        # nor at which of its speeds a row's friction is: that is no noise, but rows cannot be trusted to more
        of_speed = (_FRICTION_OF_SPEED * np.log1p(self._gained))[:, None] * self.predict(loads, {})
        self._factors = np.linalg.inv(np.linalg.cholesky(self.covariance + of_speed[:, :, None] * of_speed[:, None, :]))

    @cached_property
    def _gained(self) -> FloatArray:
        """Speed (n,) that each row gains or loses, as a share of its own: what noise of the poses would not show."""
        o, size = self._experiment.observations, np.array((1.0, 1.0, self._experiment.rho))
        own, noise = (np.linalg.norm(rates * size, axis=1) for rates in (o.twist, self._experiment.motion_noise))
        gained = np.linalg.norm(o.acceleration * size, axis=1) * o.span
        return np.sqrt(np.maximum(0.0, gained**2 - (_OF_NOISE * noise) ** 2)) / np.maximum(own, 1e-12)

    @cached_property
    def determined(self) -> BoolArray:
        """Rows (n,) whose motion determines the load, within the noise; all, if those are few.

        In a turn about a support point the friction of that point may be any: what is left of such a row says little of a
        simulation. So may all friction be in a motion so slow that noise decides its direction.
        """
        left_open = self.variance(self.covariance - self.reading_covariance)
        found = left_open <= _OPEN**2 * self.squares(self.predict(self.nominal, {}))
        return np.asarray(found if found.mean() >= _ENOUGH else np.ones_like(found))

    def squares(self, wrenches: FloatArray) -> FloatArray:
        """Return the squared size (n,) of wrenches in ``(fx, fy, tau/rho)``, in N²."""
        return np.asarray(((wrenches / (1, 1, self._experiment.rho)) ** 2).sum(axis=1))

    def variance(self, covariance: FloatArray) -> FloatArray:
        """Return the traces (n,) in N² of covariances (n, 3, 3) of wrenches in ``(fx, fy, tau/rho)``."""
        return np.asarray((np.einsum("nii->ni", covariance) / np.array((1.0, 1.0, self._experiment.rho)) ** 2).sum(axis=1))

    def white(self, wrenches: FloatArray) -> FloatArray:
        """Whitened rows (3n, ...) of arrays (n, 3, ...)."""
        white = self._factors @ wrenches if wrenches.ndim > 2 else np.einsum("nij,nj->ni", self._factors, wrenches)
        return white.reshape(3 * len(wrenches), *wrenches.shape[2:])

    def acting(self, values: Values) -> Values:
        """Return the effects that change loads."""
        return {id: v for id, v in values.items() if self._experiment.effects[id].in_loads}

    def predict(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return the wrenches (n, 3) for friction loads (k,) and the effects that change loads."""
        acting, result = self.acting(values), np.empty_like(self.beyond_points)
        for k, (rows, model) in enumerate(zip(self._rows, self._models, strict=True)):
            result[rows] = model.predict(self._experiment.loads_of(loads, k), self._experiment.values_of(acting, k))
        return result

    def matrix(self, values: Values) -> tuple[FloatArray, FloatArray]:
        """Return ``G`` (n, 3, k) and ``c`` (n, 3) of the wrenches ``G m + c``."""
        acting, points = self.acting(values), len(self._experiment.points)
        if len(self._models) == 1:
            return self._models[0].matrix(acting)
        matrix = np.zeros((len(self.beyond_points), 3, len(self._models) * points))
        constant = np.empty_like(self.beyond_points)
        for k, (rows, model) in enumerate(zip(self._rows, self._models, strict=True)):
            own, constant[rows] = model.matrix(self._experiment.values_of(acting, k))
            matrix[rows, :, k * points : (k + 1) * points] = own
        return matrix, constant

    def of_modes(self, values: Values) -> FloatArray:
        """Return whitened wrenches (3n, q) of what the pokes behind a nominal surface leave open, one standard deviation each."""
        matrix, _ = self.matrix(values)
        return self.white(matrix @ block_diag(*[self._experiment.open_modes] * len(self._models)))

    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        return self.white(self._experiment.observations.wrench - self.predict(loads, values))

    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        kind = self._experiment.effects[id]
        if not kind.in_loads:
            return np.zeros((len(self.trial), size))
        base = np.zeros(size)
        known = values.get(id, np.zeros(0))[:size]
        base[: len(known)] = known
        own, derivatives = self._experiment.size(id), []
        for k in range(size):
            # of several logs' own numbers each is one of the effect's
            small = kind.step(0 if k < own else kind.size)
            step = np.zeros(size)
            step[k] = small
            ahead, behind = (self.predict(loads, {**values, id: base + side * step}) for side in (1, -1))
            derivatives.append((ahead - behind) / (2 * small))
        return self.white(np.stack(derivatives, axis=-1))

    def by_loads(self, values: Values, directions: FloatArray | None, count: int) -> FloatArray:
        matrix, _ = self.matrix(values)
        return self.white(matrix if directions is None else matrix @ directions)

    def tells(self, id: str) -> BoolArray:
        """A row whose speed changes by much is no evidence of what depends on speed: its mean lags in all pushes alike."""
        steady = np.repeat(self._gained <= _STEADY, 3)
        return steady if self._experiment.effects[id].depends_on_speed else np.ones_like(steady)
