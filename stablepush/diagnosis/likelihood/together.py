"""Several logs of one rig as one: causes of table, sensors and contact are shared, surfaces and drift are each log's own.

The logs are joined to one; the friction loads of the support points stand once for each log, one behind the other, and so do the
parameters of a drift, which begins anew with each log.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from stablepush.core import FloatArray, InputError
from stablepush.diagnosis.likelihood.equations import SIZES, Values
from stablepush.diagnosis.likelihood.forward import ForwardModel
from stablepush.diagnosis.likelihood.replay import Replay, friction_of, pose_errors
from stablepush.diagnosis.likelihood.system import System, log_rows
from stablepush.diagnosis.rows.observations import Observations, observe, rows_of
from stablepush.effects import LabEffect
from stablepush.io import Noise, PushLog, Rig, rig_to_json
from stablepush.surfaces import IdealLimitSurface

#: Time (s) between logs, of which only the order counts.
_PAUSE = 1.0
#: Entries of ``rig.json`` that must agree, and up to what share.
_OF_RIG, _ROUNDING = ("slider", "friction", "gravity", "contact_kind", "finger_radius", "model"), 1e-6


def join(logs: Sequence[PushLog], names: Sequence[str]) -> tuple[PushLog, np.ndarray]:
    """Return several logs of one rig as one, and the number (trials,) of the log of each trial.

    Trials and groups have the name of their log before their own. The noise is the largest of all; twists count as those of
    no window where the logs have different ones. Raises
    :class:`InputError` if the rigs differ, or a log is given twice.
    """
    first = rig_to_json(logs[0].rig)
    for log, name in zip(logs[1:], names[1:], strict=True):
        other = rig_to_json(log.rig)
        for key in _OF_RIG:
            if not _alike(first.get(key), other.get(key)):
                raise InputError(f"{name}: rig.json: {key}", "expected the rig of the first log", "another one")
    for k, (log, name) in enumerate(zip(logs, names, strict=True)):
        if any(_same_samples(log, other) for other in logs[:k]):
            raise InputError(name, "expected another log", "the same pushes twice")
    noises = [log.rig.noise for log in logs if log.rig.noise]
    worst = Noise(*(max(getattr(noise, key) for noise in noises) for key in ("force", "position", "angle"))) if noises else None
    windows = {log.rig.twist_window for log in logs}
    rig = replace(
        logs[0].rig,
        noise=worst if len(noises) == len(logs) else None,
        twist_window=windows.pop() if len(windows) == 1 else None,
    )
    tables: list[dict[str, list[object]]] = []
    for attribute in ("trials", "samples"):
        columns = dict.fromkeys(key for log in logs for key in getattr(log, attribute))
        tables.append({key: [] for key in columns})
    begun, number = 0.0, []
    for k, (log, name) in enumerate(zip(logs, names, strict=True)):
        for table, mine in zip(tables, (log.trials, log.samples), strict=True):
            count = len(mine["trial"])
            for key, column in table.items():
                values = mine.get(key)
                if values is None:
                    like = next(other for log in logs for other in (log.trials, log.samples) if key in other)[key]
                    # a log without phases counts every row as a push
                    blank = "push" if key == "phase" else "" if like.dtype == object else np.nan
                    column.extend([blank] * count)
                elif key in ("trial", "group"):
                    column.extend(f"{name}/{value}" if value else "" for value in values)
                elif key == "start_time":
                    column.extend((values - values.min() + begun).tolist())
                    begun += float(np.ptp(values)) + _PAUSE
                else:
                    column.extend(values.tolist())
        number += [k] * len(log)
    return PushLog(rig, *tables), np.array(number)


def _same_samples(log: PushLog, other: PushLog) -> bool:
    poses = [one.columns("t", "x", "y", "theta") for one in (log, other)]
    return poses[0].shape == poses[1].shape and np.array_equal(poses[0], poses[1], equal_nan=True)


def _alike(a: Any, b: Any) -> bool:
    """Whether two entries of JSON are the same, up to rounding."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_alike(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_alike, a, b))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return math.isclose(a, b, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
    return bool(a == b)


def observe_each(log: PushLog, number: np.ndarray) -> Observations:
    """Return the observations of joined logs; the order of the trials counts within each."""
    o = observe(log)
    begun, order = np.asarray(log.trials["start_time"], dtype=np.float64), np.zeros(len(log))
    for k in range(int(number.max()) + 1):
        mine = np.flatnonzero(number == k)
        order[mine] = np.argsort(np.argsort(begun[mine], kind="stable"), kind="stable") / max(1, len(mine) - 1)
    return replace(o, order=order[o.trial])


class _Models:
    """Readings of each log by its own loads: what :class:`ForwardModel` is to one log."""

    def __init__(self, system: Together, observations: Observations, beyond_points: FloatArray, place: FloatArray) -> None:
        self._system, self.beyond_points, self.place = system, beyond_points, place
        self._rows = [np.flatnonzero(system.log[observations.trial] == k) for k in range(system.logs)]
        self._models = []
        for rows in self._rows:
            mine = rows_of(observations, rows)
            inertia = system.rig.slider.radius_of_gyration**2
            self._models.append(
                ForwardModel(
                    mine, system.points, system.weight, inertia, system.center, beyond_points[rows], system.own, log_rows(mine)
                )
            )

    def predict(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return the wrenches (n, 3) for the friction loads of all logs."""
        result = np.empty_like(self.beyond_points)
        for k, (rows, model) in enumerate(zip(self._rows, self._models, strict=True)):
            result[rows] = model.predict(self._system.of_log(loads, k), self._system.values_of(values, k))
        return result

    def matrix(self, values: Values) -> tuple[FloatArray, FloatArray]:
        """Return ``G`` (n, 3, logs k) and ``c`` (n, 3) of the wrenches ``G m + c``."""
        n, points = len(self.beyond_points), len(self._system.points)
        matrix, constant = np.zeros((n, 3, self._system.logs * points)), np.empty((n, 3))
        for k, (rows, model) in enumerate(zip(self._rows, self._models, strict=True)):
            own, constant[rows] = model.matrix(self._system.values_of(values, k))
            matrix[rows, :, k * points : (k + 1) * points] = own
        return matrix, constant


def together_of(
    observations: Observations, rig: Rig, number: np.ndarray, own: Mapping[str, LabEffect] = MappingProxyType({})
) -> Together:
    """Return the equations of joined logs; where their rig states no noise, it is what free pressures leave."""
    system = Together(observations, rig, number, own=own)
    if rig.noise is None and system.noise_left() > 1:
        return Together(observations, rig, number, system.noise_left(), own)
    return system


class Together(System):
    """The whitened equations of several logs of one rig, with forces."""

    each = ("drift",)

    def __init__(
        self,
        observations: Observations,
        rig: Rig,
        number: np.ndarray,
        noisier: float = 1.0,
        own: Mapping[str, LabEffect] = MappingProxyType({}),
    ) -> None:
        super().__init__(observations, rig, noisier, own)
        self.log, self.logs = number, int(number.max()) + 1
        #: The last log with forces.
        self.last = int(number[self.observations.trial].max(initial=0))
        one = self.model
        self.model = _Models(self, self.observations, one.beyond_points, one.place)  # type: ignore[assignment]
        self.nominal = np.tile(self.nominal, self.logs)

    def of_log(self, loads: FloatArray, k: int) -> FloatArray:
        """Loads of one log, along the first axis."""
        points = len(self.points)
        return loads[k * points : (k + 1) * points] if len(loads) > points else loads

    def of_last(self, loads: FloatArray) -> FloatArray:
        return self.of_log(loads, self.last)

    def values_of(self, values: Values, k: int) -> Values:
        """Parameters of effects as one log has them."""
        found = dict(values)
        for id in self.each:
            if id in values:
                value = values[id]
                split = self.logs * SIZES[id]
                terms = value[split:].reshape(self.logs, -1)
                found[id] = np.concatenate((value[:split].reshape(self.logs, -1)[k], terms[k]))
        return found

    def size(self, id: str, whole: bool | None = None) -> int:
        return super().size(id, whole) * (self.logs if id in self.each else 1)

    def clipped(self, id: str, value: FloatArray) -> FloatArray:
        if id not in self.each:
            return super().clipped(id, value)
        split = self.logs * SIZES[id]
        each = [super(Together, self).clipped(id, self.values_of({id: value}, k)[id]) for k in range(self.logs)]
        own = np.concatenate([part[: SIZES[id]] for part in each])
        return np.concatenate((own, *(part[SIZES[id] :] for part in each))) if len(value) > split else own

    def directions(self, free: bool) -> tuple[FloatArray, FloatArray]:
        each = [self.directions_of(self.of_log(self.nominal, k), free) for k in range(self.logs)]
        return block_diag(*(d for d, _ in each)), block_diag(*(p for _, p in each))

    def of_modes(self, values: Values) -> FloatArray:
        matrix, _ = self.model.matrix(self.of_wrench(values))
        return self.white(matrix @ block_diag(*[self.open_modes] * self.logs))

    def surface(self, loads: FloatArray) -> IdealLimitSurface:
        """Return the refitted pressure of the last log as a limit surface."""
        return super().surface(self.of_last(loads))

    def surfaces(self, loads: FloatArray) -> tuple[IdealLimitSurface, ...]:
        return tuple(super(Together, self).surface(self.of_log(loads, k)) for k in range(self.logs))

    def simulated_errors(self, pushes: Sequence[Replay], loads: FloatArray, values: Values) -> FloatArray:
        errors = np.full((len(pushes), 3), np.nan)
        for k, surface in enumerate(self.surfaces(loads)):
            mine = [i for i, push in enumerate(pushes) if self.log[push.trial] == k]
            try:
                table = friction_of(self.believed, surface, self.values_of(values, k), self.moving_weight)
            except InputError:
                # parameters beyond all sense
                continue
            errors[mine] = pose_errors([pushes[i] for i in mine], table, self.rig.slider, self.mu, values)
        return errors
