"""The equations of a log, whitened: loads of support points and parameters of effects against measured wrenches and clearances.

``y = G(θ) m + c(θ) + noise`` for the wrenches, ``clearance = Z θ + noise`` for the fingers: ``m`` are friction loads of support
points with a Gaussian prior about the nominal ones (wide along their scale), ``θ`` the parameters of effects. The noise of a row
is that of the force sensor and what the noise of the motion makes of the prediction. Rows of a trial share errors that no formula
has: every judgement treats trials, not rows, as independent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy.optimize import nnls

from stablepush.core import BoolArray, FloatArray, InputError
from stablepush.diagnosis.likelihood.equations import (
    SIZES,
    Demands,
    Equations,
    Fitted,
    Values,
    robust_variance,
)
from stablepush.diagnosis.likelihood.forward import PARAMETERS, SMALL, ForwardModel
from stablepush.diagnosis.likelihood.nominal import CELLS, nominal_of, unit_loads
from stablepush.diagnosis.likelihood.replay import AMPLIFIED, Replay, carried, friction_of, pose_errors
from stablepush.diagnosis.rows.noise import of_readings, of_turns
from stablepush.diagnosis.rows.observations import Observations, beyond_noise, contact_velocity, pushes_of, rows_of, smeared
from stablepush.effects import FAMILIES, LabEffect, LogRows
from stablepush.io import Noise, Rig
from stablepush.mechanics import TableFriction
from stablepush.objects import SupportDistribution
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Prior standard deviation of a load over the total, and of the scale of the nominal loads over one.
_SPREAD, _SCALE = 0.15, 1.0
#: Noise of rigs that say nothing of it: share of the median force, m, rad.
_FORCE, _POSITION, _ANGLE = 0.02, 2e-4, 3e-3
#: Acceleration that rows with means over parts of a push leave uncertain: share of what its differences to either side differ by,
#: and of itself.
_UNSTEADY = (0.25, 0.3)
#: Change of the friction for each e-fold of speed that a row leaves uncertain whose speed changes: it is of one of its speeds.
_FRICTION_OF_SPEED = 0.05
#: Share of its speed that a row may gain or lose whose speed is known.
_STEADY = 0.3
#: Noise of a gain of speed, over that of a difference of poses: three times the standard deviation of differences of differences.
_OF_NOISE = 1.8
#: Motions over which pressures are compared.
_MOTIONS = 150
#: Effects that show in the clearances between fingers and outline, and numbers of their parameters.
IN_CLEARANCES: Mapping[str, int] = {"contact-geometry": 1, "frame-offset": 2, "latency": 1}


#: What causes must pass where the nominal surface is a model that was fitted to pokes: its errors are alike in pushes that are
#: alike, and an executed plan has few of them.
_DEMANDS_OF_A_MODEL = Demands(25.0, 8.0, 2.5, 0.002, 4.0, 0.02)
#: Times the known mass that what resists acceleration may be, and share of the friction that a gradient takes at most.
_HEAVIER, _LEFT = 2.0, 0.95
#: A value is at its bound from this share of it.
_AT_BOUND = 0.05
#: Steps of differences by the terms of a family, over half of their plausible range.
_SMALL_TERM = 0.05


class System(Equations):
    """The whitened equations of a log.

    Attributes
    ----------
    observations : Observations
        Rows with a wrench, if the log has any; else all. Accelerations are less what noise would make of them.
    points : array, shape (k, 2)
    nominal : array, shape (k,)
        Nominal friction loads (N) of the points.
    has_wrench, has_surface : bool
        Whether the log has forces, and whether it carries information on the limit surface.
    logs, last, log, each
        Number of logs that are fitted together (:mod:`.together`), the last of them with forces, the log of each trial (trials,),
        and effects whose parameters are each log's own.
    """

    logs, last = 1, 0
    each: tuple[str, ...] = ()

    def __init__(
        self, observations: Observations, rig: Rig, noisier: float = 1.0, own: Mapping[str, LabEffect] = MappingProxyType({})
    ) -> None:
        chosen = observations.has_wrench if observations.has_wrench.any() else np.ones(len(observations.time), dtype=bool)
        o = rows_of(observations, chosen)
        self.noise = noise_of(rig, o, noisier)
        if rig.noise is not None:
            self.least_scale = 1.0
        of_poses = np.array((self.noise.position, self.noise.position, self.noise.angle))
        own_noise = of_poses * o.noise_gain[:, None]
        self.motion_noise = np.hypot(own_noise, smeared(o, rig.twist_window, own_noise))
        of_twists = of_poses * (1 / o.span if rig.twist_window is None else o.noise_gain)[:, None]
        self.observations = o = replace(o, acceleration=beyond_noise(o, of_twists))
        self.push = pushes_of(o.group)
        self.log = np.zeros(len(o.names), dtype=int)
        self.own, self.rows = own, log_rows(o)
        self.rig, self.has_wrench = rig, bool(observations.has_wrench.any())
        self.has_surface = self.has_wrench
        slider = rig.slider
        side = float(np.ptp(slider.vertices, axis=0).max())
        #: The friction that the operator believes in.
        self.believed = nominal_of(rig)
        support = self.believed.points.support
        grid = SupportDistribution.from_polygon(slider.vertices, side / CELLS).points
        self.points = np.concatenate((support.points, grid))
        self.weight = (slider.mass or 0.0) * rig.gravity
        #: Friction of the fingers; 1 where it is not known.
        self.mu = rig.contact_friction if rig.contact_friction is not None else 1.0
        self.known_scale = bool(self.weight and rig.support_friction) or rig.model is not None
        #: Weight (N), which a slope of the table turns into a force, of a slider whose friction is known; else 0.
        self.moving_weight = self.weight if self.has_wrench or self.known_scale else 0.0
        self.rho = slider.characteristic_length
        self.center = np.asarray(support.center)
        loads, beyond_points = self.believed.loads_on(self.points), self.believed.beyond_points(o.twist)
        self.model = ForwardModel(
            o, self.points, self.weight, slider.radius_of_gyration**2, self.center, beyond_points, own, self.rows
        )
        #: What the pokes behind the nominal surface leave open, as changes (k, q) of the loads by one standard deviation.
        self.open_modes = self.believed.modes(self.points)
        self._w = np.zeros((len(o.time), 3, 3))
        scale = 1.0 if self.known_scale else 0.0
        if self.has_wrench:
            if not self.known_scale:
                one = self.model.predict(loads, {}) / (1, 1, self.rho)
                scale = float((one * o.wrench / (1, 1, self.rho)).sum() / (one * one).sum())
            self._whiten(scale * loads)
        self.nominal = scale * loads
        # rows of the clearances: finger by finger, where one touches
        self.clearance_rows = [(k, np.flatnonzero(np.isfinite(o.clearance[:, k]))) for k in range(2)]
        self.clearance_noise = float(np.hypot(self.noise.position * 1.05, (o.finger_radius or 0.0) * self.noise.angle))
        trial, self.rest = o.rest if self.has_wrench else (np.zeros(0, dtype=int), np.zeros((0, 2)))
        self._bias_at_rest = self._of_bias_at_rest(trial)
        parts = [np.repeat(o.trial, 3)] if self.has_wrench else []
        parts += [o.trial[rows] for _, rows in self.clearance_rows] + [np.repeat(trial, 2)]
        self.trial = np.concatenate(parts).astype(int)
        #: Noise (m) of the final poses that are carried out again, where there are any.
        self.final_pose_noise = np.zeros((0, 3))
        self.unpredictable: tuple[list[Replay], FloatArray] = ([], np.zeros((0, 3)))
        self._nominal_errors: dict[Replay, FloatArray] = {}
        if rig.model is not None and self.has_wrench:
            self.demands = _DEMANDS_OF_A_MODEL
        if rig.finger_radius is None and any(len(rows) for _, rows in self.clearance_rows):
            self.nuisance = ("contact-geometry",)

    def _of_bias_at_rest(self, trial: np.ndarray) -> FloatArray:
        """What a sensor reads at rest (2m, 6) for the parameters of a bias and of its family, of trials (m,)."""
        o = self.observations
        first = np.minimum(np.searchsorted(o.trial, trial), max(0, len(o.trial) - 1))
        known = o.trial[first] == trial if len(o.trial) else np.zeros(len(trial), dtype=bool)
        late = np.where(known, o.order[first] - 0.5, 0.0) if len(o.trial) else np.zeros(len(trial))
        tool = np.where(known, np.nan_to_num(o.pusher[first, 2]), 0.0) if len(o.trial) else np.zeros(len(trial))
        each, (c, s) = np.tile(np.eye(2), (len(trial), 1, 1)), (np.cos(tool), np.sin(tool))
        turned: FloatArray = np.moveaxis(np.array(((c, -s), (s, c))), 2, 0)
        return np.concatenate((each, late[:, None, None] * each, turned), axis=2).reshape(-1, 6)

    def _whiten(self, loads: FloatArray) -> None:
        """Factors of the inverse covariances of the rows' wrenches."""
        o, noise = self.observations, self.noise
        self.reading_covariance = of_readings(o, noise, self.model.place)
        linear, full = self.believed.spread(self.points, loads, o.twist, self.motion_noise)
        # no pressure has the friction of a model: as far as it differs from that of points it is uncertain
        beyond = self.model.beyond_points
        covariance = self.reading_covariance + beyond[:, :, None] * beyond[:, None, :]
        # where the speed changes between rows, they do not show what the mass takes; rows that are all but at one time show
        # nothing of it
        inertia = (self.rig.slider.mass or 0.0) * np.array((1.0, 1.0, self.rig.slider.radius_of_gyration**2))
        most = float(np.abs(loads).sum()) + noise.force
        for share, off in zip(_UNSTEADY, (o.unsteady, o.acceleration), strict=True):
            jolt = share * inertia * off
            jolt = jolt / np.maximum(1.0, np.linalg.norm(jolt / (1, 1, self.rho), axis=1, keepdims=True) / most)
            covariance += jolt[:, :, None] * jolt[:, None, :]
        #: what noise leaves of a row's wrench, and what rows are trusted to, which is less beside the facets of points
        self.noise_covariance = covariance + full
        turns = of_turns(o, self.points, loads, self.motion_noise, noise, self.rho)
        self.covariance = covariance + (full if self.believed.model is not None else linear + turns)
        # nor at which of its speeds a row's friction is: that is no noise, but rows cannot be trusted to more
        of_speed = (_FRICTION_OF_SPEED * np.log1p(self._gained))[:, None] * self.model.predict(loads, {})
        self._w = np.linalg.inv(np.linalg.cholesky(self.covariance + of_speed[:, :, None] * of_speed[:, None, :]))

    @cached_property
    def _gained(self) -> FloatArray:
        """Speed (n,) that each row gains or loses, as a share of its own: what noise of the poses would not show."""
        o, size = self.observations, np.array((1.0, 1.0, self.rho))
        own, noise = (np.linalg.norm(rates * size, axis=1) for rates in (o.twist, self.motion_noise))
        gained = np.linalg.norm(o.acceleration * size, axis=1) * o.span
        return np.sqrt(np.maximum(0.0, gained**2 - (_OF_NOISE * noise) ** 2)) / np.maximum(own, 1e-12)

    def tells(self, id: str) -> BoolArray:
        """A row whose speed changes by much is no evidence of what depends on speed: its mean lags in all pushes alike."""
        known = super().tells(id)
        if id == "speed-dependence" and self.has_wrench:
            known[: 3 * len(self._gained)] = np.repeat(self._gained <= _STEADY, 3)
        return known

    def predictable(self, pushes: list[Replay]) -> tuple[list[Replay], FloatArray]:
        """Return the pushes whose final pose does not depend on noise of the first pose, and its noise (n, 3) in m.

        For example, the final pose of a push whose finger just passes a corner cannot be predicted. Such pushes, with the larger
        noise of theirs, are in :attr:`unpredictable`: an object that is lost is farther off than that.
        """
        if not self.has_surface or not pushes:
            return [], np.zeros((0, 3))
        table = self.table(self.nominal, {})
        nominal, moved = carried(pushes, table, self.rig.slider, self.mu, self.noise)
        self._nominal_errors = dict(zip(pushes, nominal, strict=True))
        own = np.array((self.noise.position, self.noise.position, self.rho * self.noise.angle))
        kept = np.linalg.norm(moved, axis=1) <= AMPLIFIED * np.linalg.norm(own)
        left = ~kept & np.isfinite(moved).all(axis=1)
        self.unpredictable = [push for push, out in zip(pushes, left, strict=True) if out], np.hypot(moved[left], own)
        return [push for push, good in zip(pushes, kept, strict=True) if good], np.hypot(moved[kept], own)

    def white(self, wrenches: FloatArray) -> FloatArray:
        """Whitened rows (3n, ...) of arrays (n, 3, ...)."""
        white = self._w @ wrenches if wrenches.ndim > 2 else np.einsum("nij,nj->ni", self._w, wrenches)
        return white.reshape(3 * len(wrenches), *wrenches.shape[2:])

    def clipped(self, id: str, value: FloatArray) -> FloatArray:
        """Values within what this rig can have: no delay outlasts a push, no mass is below zero or far above the slider's, no
        offset leaves the slider, no slope is steeper than friction holds, and friction is above zero everywhere."""
        value = super().clipped(id, value)
        count = self.size(id, whole=False)
        own, most = value[:count], self._most.get(id, np.inf)
        size = float(np.linalg.norm(own))
        if size > most:
            own = own * (most / size)
        if id == "spatial-variation":
            lowest = -float((self.observations.pose[:, :2] @ own).min(initial=0.0))
            own = own * (_LEFT / max(lowest, _LEFT))
        if id == "inertia":
            own = np.maximum(own, 0.0)
        if id == "contact-geometry":
            radius = self.observations.finger_radius
            own = np.maximum(own, -np.inf if radius is None else -radius)
        return np.concatenate((own, value[count:]))

    def at_bound(self, id: str, value: FloatArray) -> bool:
        """Whether a fitted effect is as large as this rig can have it: what would need more is another cause."""
        own = float(np.linalg.norm(value[: self.size(id, whole=False)]))
        return own > (1 - _AT_BOUND) * self._most.get(id, np.inf)

    @cached_property
    def _most(self) -> dict[str, float]:
        """Largest sizes of the own parameters of effects."""
        o, rig = self.observations, self.rig
        radius = rig.slider.radius
        spans = [float(np.ptp(o.time[o.trial == k]) + np.median(o.span[o.trial == k])) for k in np.unique(o.trial)]
        found = dict.fromkeys(("frame-offset", "pressure-shift", "contact-geometry"), radius)
        found |= {"latency": max(spans, default=np.inf), "force-rotation": 0.5 * np.pi}
        if rig.slider.mass:
            found["inertia"] = _HEAVIER * rig.slider.mass
        if rig.support_friction:
            found["tilt"] = rig.support_friction
        return found

    def noise_left(self) -> float:
        """Robust root mean square of what a fit with a free pressure leaves of the wrenches, in units of the noise."""
        left = self.fit([], True).residual[: 3 * len(self.observations.time)]
        return float(np.sqrt(robust_variance(left**2)))

    def clearance_lack_of_fit(self, fitted: Fitted) -> float:
        """Robust mean square of the residual clearances of a fit, over their noise; 0 where none are measured."""
        count = sum(len(rows) for _, rows in self.clearance_rows)
        behind = len(fitted.residual) - self.rest.size
        left = fitted.residual[behind - count : behind]
        return float(robust_variance(left**2)) if count else 0.0

    def of_wrench(self, values: Values) -> Values:
        """Return the effects that show in wrenches."""
        return {id: v for id, v in values.items() if id in PARAMETERS or id in self.own}

    def clearance_change(self, id: str, value: FloatArray) -> FloatArray:
        """Change (g,) of the clearances by an effect, in m."""
        half = 0.5 * value if id == "latency" else np.zeros_like(value)
        return np.asarray(self.clearance_columns(id, half, len(value)) @ value) * self.clearance_noise

    def clearance_columns(self, id: str, value: FloatArray | None, size: int) -> FloatArray:
        """Whitened columns (g, size) of the clearance derivatives by an effect's parameters, at a value (none if not given)."""
        if id in self.own:
            changes = [
                np.column_stack([self.own[id].clearance(self.rows, k, unit)[rows] for unit in np.eye(size)])
                for k, rows in self.clearance_rows
            ]
            return np.nan_to_num(np.concatenate(changes)) / self.clearance_noise
        own = self._own_clearance_columns(id, value)
        if size == SIZES[id] or id not in IN_CLEARANCES:
            return np.column_stack((own, np.zeros((len(own), size - SIZES[id]))))
        late = np.concatenate([self.observations.order[rows] - 0.5 for _, rows in self.clearance_rows])
        return np.column_stack((own, late[:, None] * own))

    def _own_clearance_columns(self, id: str, value: FloatArray | None) -> FloatArray:
        o, parts = self.observations, []
        for k, rows in self.clearance_rows:
            normal = o.normal[rows, k]
            if id == "contact-geometry":
                parts.append(np.full((len(rows), 1), o.off[k]))
            elif id == "frame-offset":
                # the outline is drawn about the tracked origin: it lies off by minus the offset
                parts.append(normal)
            elif id == "latency":
                # how far the contact moves in the delay: its velocity grows meanwhile
                there = rows_of(o, rows)
                velocity = contact_velocity(there, k)
                if value is not None:
                    velocity = velocity + float(value[0]) * contact_velocity(replace(there, twist=there.acceleration), k)
                parts.append(-(normal * velocity).sum(axis=1, keepdims=True))
            else:
                parts.append(np.zeros((len(rows), SIZES[id])))
        return np.concatenate(parts) / self.clearance_noise

    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        parts = []
        if self.has_wrench:
            parts.append(self.white(self.observations.wrench - self.model.predict(loads, self.of_wrench(values))))
        clearances = (
            np.concatenate([self.observations.clearance[rows, k] for k, rows in self.clearance_rows]) / self.clearance_noise
        )
        for id in values:
            if (id in IN_CLEARANCES or id in self.own) and len(clearances):
                clearances = clearances - self.clearance_change(id, values[id]) / self.clearance_noise
        # what a sensor reads that touches nothing is its offset
        bias = values.get("force-bias", np.zeros(2))
        left = self.rest.ravel() - self._bias_at_rest[:, : len(bias)] @ bias
        return np.concatenate((*parts, clearances, left / self.noise.force))

    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        parts = []
        if self.has_wrench:
            if id in PARAMETERS or id in self.own:
                base = np.zeros(size)
                known = values.get(id, np.zeros(0))[:size]
                base[: len(known)] = known
                others, own = self.of_wrench(values), id in self.own
                derivatives = []
                for k in range(size):
                    step, small = np.zeros(size), _SMALL_TERM * self.plausible(id)
                    if not own:
                        small = SMALL[id] if k < self.size(id, whole=False) else _SMALL_TERM * FAMILIES[id].plausible
                    step[k] = small
                    ahead = self.model.predict(loads, {**others, id: base + step})
                    behind = self.model.predict(loads, {**others, id: base - step})
                    derivatives.append((ahead - behind) / (2 * small))
                parts.append(self.white(np.stack(derivatives, axis=-1)))
            else:
                parts.append(np.zeros((3 * len(self.observations.time), size)))
        at_rest = np.zeros((self.rest.size, size))
        if id == "force-bias":
            at_rest = self._bias_at_rest[:, :size] / self.noise.force
        return np.concatenate((*parts, self.clearance_columns(id, values.get(id), size), at_rest))

    def base(self, values: Values, free: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
        clearances = sum(len(rows) for _, rows in self.clearance_rows) + self.rest.size
        if not self.has_wrench:
            return np.zeros((len(self.points), 0)), np.zeros((clearances, 0)), np.zeros((0, 0))
        directions, precision = self.directions(free)
        matrix, _ = self.model.matrix(self.of_wrench(values))
        # loads that are free change each for itself
        columns = self.white(matrix if free else matrix @ directions)
        return directions, np.concatenate((columns, np.zeros((clearances, directions.shape[1])))), precision

    def of_modes(self, values: Values) -> FloatArray:
        """Whitened wrenches (3n, q) of what the pokes behind a nominal surface leave open, one standard deviation each."""
        matrix, _ = self.model.matrix(self.of_wrench(values))
        return self.white(matrix @ self.open_modes)

    def directions(self, free: bool) -> tuple[FloatArray, FloatArray]:
        """Return directions (k, q) in which loads may change, and their prior precision (q, q)."""
        return self.directions_of(self.nominal, free)

    def directions_of(self, nominal: FloatArray, free: bool) -> tuple[FloatArray, FloatArray]:
        """Return the directions, and their precision, of one log with these nominal loads."""
        total, size = float(nominal.sum()), float(np.linalg.norm(nominal))
        along = nominal / size
        if not free:
            directions = np.column_stack((along, self.open_modes))
            precision = np.eye(directions.shape[1])
            precision[0, 0] = 1.0 / (_SCALE * size) ** 2
            return directions, precision
        precision = (np.eye(len(along)) - np.outer(along, along)) / (_SPREAD * total) ** 2
        return np.eye(len(along)), precision + np.outer(along, along) / (_SCALE * size) ** 2

    def moved_center(self, loads: FloatArray, changes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far (2,) in m the centre of a refitted pressure is from the nominal one, and its standard deviations (2,).

        ``changes``: of the loads, by one standard deviation each.
        """
        center = loads @ self.points / loads.sum()
        off = center - self.nominal @ self.points / self.nominal.sum()
        spread = (changes.T @ self.points - np.outer(changes.sum(axis=0), center)) / loads.sum()
        return off, np.sqrt((spread**2).sum(axis=0))

    @contextmanager
    def believing(self, model: LimitSurface) -> Iterator[None]:
        """Simulate with another surface of the rig's model."""
        believed = self.believed
        self.believed = replace(believed, model=model)
        try:
            yield
        finally:
            self.believed = believed

    def of_last(self, loads: FloatArray) -> FloatArray:
        """Return the loads (k, ...) of the last log: all there are of one."""
        return loads

    def surfaces(self, loads: FloatArray) -> tuple[IdealLimitSurface, ...]:
        """Return the refitted pressure of each log as a limit surface."""
        return (self.surface(loads),)

    def table(self, loads: FloatArray, values: Values) -> TableFriction:
        """Return the friction of the table, as simulations take it, for friction loads and fitted parameters of effects.

        Raises :class:`InputError` for parameters beyond all sense.
        """
        return friction_of(self.believed, self.surface(loads), values, self.moving_weight)

    def simulated_errors(self, pushes: Sequence[Replay], loads: FloatArray, values: Values) -> FloatArray:
        """Return pose errors (n, 3) of pushes, simulated with friction loads and effects; NaN where they cannot be simulated."""
        if loads is self.nominal and not values and all(push in self._nominal_errors for push in pushes):
            return np.reshape([self._nominal_errors[push] for push in pushes], (-1, 3))
        try:
            table = self.table(loads, values)
        except InputError:
            # parameters beyond all sense
            return np.full((len(pushes), 3), np.nan)
        return pose_errors(pushes, table, self.rig.slider, self.mu, values)

    def surface(self, loads: FloatArray) -> IdealLimitSurface:
        """Return the refitted pressure as a limit surface.

        Loads that came out negative have no meaning as pressure: those that are not negative and nearest to the same friction,
        over motions in all directions, take their place.
        """
        positive = np.asarray(loads)
        if (positive < 0).any():
            rng = np.random.default_rng(0)
            twists = rng.normal(size=(_MOTIONS, 3)) / (1, 1, self.rho)
            rows = unit_loads(self.points, twists, self.rho)
            positive, _ = nnls(rows, rows @ loads)
        if (positive > 0).sum() < 2:
            # a log that carries no information on the pressure: a little of the nominal one keeps it a surface
            positive = positive + 1e-6 * np.abs(self.nominal)
        carrying = positive > 0
        return IdealLimitSurface(SupportDistribution(self.points[carrying], positive[carrying]), float(positive.sum()), self.rho)


def log_rows(o: Observations) -> LogRows:
    """Return rows as effects of a lab's own see them."""
    columns = {name: values[o.trial] for name, values in o.columns.items()}
    return LogRows(columns, o.time, o.order, o.pose, o.twist, o.pusher, o.wrench, o.normal)


def system_of(observations: Observations, rig: Rig, own: Mapping[str, LabEffect] = MappingProxyType({})) -> System:
    """Return the equations of a log; where its rig does not say how noisy it is, the noise is what a free pressure leaves."""
    system = System(observations, rig, own=own)
    if rig.noise is None and system.has_wrench and system.noise_left() > 1:
        return System(observations, rig, system.noise_left(), own)
    return system


def noise_of(rig: Rig, o: Observations, noisier: float) -> Noise:
    """The rig's noise, else what a laboratory of that kind has, times a factor."""
    if rig.noise is not None:
        force = max(rig.noise.force, 1e-6)
        return Noise(force, max(rig.noise.position, 1e-7), max(rig.noise.angle, 1e-6))
    size = np.linalg.norm(o.wrench[:, :2], axis=1)
    typical = float(np.median(size[np.isfinite(size)])) if np.isfinite(size).any() else 1.0
    return Noise(noisier * _FORCE * typical, noisier * _POSITION, noisier * _ANGLE)
