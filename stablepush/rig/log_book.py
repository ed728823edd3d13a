"""Rows as the sensors of a rig see them: each the mean of readings over a part of a push, with noise and errors of sensors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.geometry import (
    compose,
    inverse,
    nearest_on_outline,
    rotate_vectors,
    transform_points,
    wrap_angle,
    wrench_from_force,
)
from stablepush.io import Noise, PushLog, Rig
from stablepush.mechanics import Pusher, PushTrace

if TYPE_CHECKING:
    from stablepush.rig.commands import Command

#: Readings whose mean is a row.
_READINGS = 16
#: Rest before a push, and between pushes, in s.
_REST, _BETWEEN = 0.2, 5.0
#: Noise of the pusher's pose over that of the slider's.
_PUSHER = 0.2
#: An outlier is so many times as far off as the noise.
_OUTLIER = 10.0
#: A push is called stable if the slider moved no more than this against the pusher once all fingers had met it: a share of its
#: radius, and an angle in rad.
_STUCK = (0.01, 0.02)


class LogBook:
    """A log in the making.

    Parameters
    ----------
    nominal : Rig
        What the log says of the rig.
    rng : Generator
    rows : int
        Of each push.
    noise : Noise
    outliers : float
        Share of rows that are ten times as far off.
    bias, angle
        Offset (2,) in N in W of the force sensor, and the angle (rad) that it is mounted at.
    offset, delay
        Origin (2,) in m of the tracked frame less the centre of mass, in B; time (s) by which its poses lag.
    """

    def __init__(  # noqa: PLR0913
        self,
        nominal: Rig,
        rng: np.random.Generator,
        rows: int,
        noise: Noise,
        outliers: float,
        bias: FloatArray,
        angle: float,
        offset: FloatArray,
        delay: float,
    ) -> None:
        self._nominal, self._rng, self._rows, self._noise, self._outliers = nominal, rng, rows, noise, outliers
        self._bias, self._angle, self._offset, self._delay = bias, angle, offset, delay
        self._time = 0.0
        self._samples: list[dict[str, Any]] = []
        self._trials: list[dict[str, Any]] = []

    def write(self, command: Command, trace: PushTrace, pusher: Pusher) -> None:
        """Add a trial: ``pusher`` as the operator believes it to be."""
        name = str(len(self._trials) + 1)
        touched = np.flatnonzero((trace.modes > 0).any(axis=1))
        end = float(trace.t[-1])
        # rows of the push begin when a finger has met the slider; before that the pusher is on its way
        begin = float(trace.t[min(touched[0] + 1, len(trace.t) - 2)]) if len(touched) and touched[0] > 0 else 0.0
        approach = [0.0, begin] if begin > 0 else [begin]
        edges = np.concatenate(((-_REST,), approach, np.linspace(begin, end, self._rows + 1)[1:]))
        phases = np.array(["rest", *["approach"] * (len(approach) - 1), *["push"] * self._rows])
        columns = self._readings(edges, phases, trace, pusher)
        self._samples.append({"trial": np.full(len(phases), name, dtype=object), **columns, "phase": phases.astype(object)})
        cor = (math.nan, math.nan) if command.cor is None else command.cor
        self._trials.append(
            {
                "trial": name,
                "start_time": round(self._time, 6),
                "group": command.group,
                "speed": command.speed,
                "cor_x": float(cor[0]),
                "cor_y": float(cor[1]),
                "sense": command.sense,
                "angle": command.angle,
                "stable": math.nan if len(pusher.fingers) < 2 else float(self._stayed(trace, len(pusher.fingers))),
            }
        )
        self._time += end + _REST + _BETWEEN

    def _readings(self, edges: FloatArray, phases: np.ndarray, trace: PushTrace, pusher: Pusher) -> dict[str, FloatArray]:
        """Columns of rows between times (n + 1,), in s after the push began: the means of poses, of the force in W and of the
        moment at the pusher, with noise."""
        n, rng = len(phases), self._rng
        times = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(_READINGS) + 0.5) / _READINGS
        pushers = _at(trace.t, trace.pushers, times)
        seen = compose(_at(trace.t, trace.poses, times - self._delay), (*self._offset, 0.0))
        step = np.clip(np.searchsorted(trace.t, times, side="right") - 1, 0, len(trace.wrenches) - 1)
        load = _mean_loads(trace, edges)
        force, moment = load[:, :2], load[:, 2]
        odd = np.where(rng.random(n) < self._outliers, _OUTLIER, 1.0)[:, None]
        noise = self._noise
        spread = np.array((noise.position, noise.position, noise.angle))
        measured = rotate_vectors(self._angle, force) + self._bias + noise.force * odd * rng.normal(size=(n, 2))
        moment = moment + noise.moment * odd[:, 0] * rng.normal(size=n)
        pose = seen.mean(axis=1) + odd * spread * rng.normal(size=(n, 3))
        place = pushers.mean(axis=1) + _PUSHER * spread * rng.normal(size=(n, 3))
        seen_force = rotate_vectors(-pose[:, 2], measured)
        tau = moment + wrench_from_force(place[:, :2] - pose[:, :2], measured)[:, 2]
        touching = self._contact_points(pose, place, pusher, trace.modes[step])
        touching[phases != "push"] = np.nan
        values = (times.mean(axis=1) + _REST, *pose.T, *seen_force.T, tau, *touching.reshape(n, 4).T, *place.T)
        names = ("t", "x", "y", "theta", "fx", "fy", "tau", "c1x", "c1y", "c2x", "c2y", "px", "py", "ptheta")
        return dict(zip(names, values, strict=True))

    def _contact_points(self, pose: FloatArray, place: FloatArray, pusher: Pusher, modes: np.ndarray) -> FloatArray:
        """Contact points (n, 2, 2) in the tracked frame as a laboratory computes them: where the outline, drawn about the tracked
        origin, is nearest to each finger; NaN for fingers that are open in most of ``modes`` (n, r, 2)."""
        result = np.full((len(pose), 2, 2), math.nan)
        centers = transform_points(compose(inverse(pose), place), pusher.fingers)
        for k in range(len(pusher.fingers)):
            closed = 2 * (modes[:, :, k] > 0).sum(axis=1) > modes.shape[1]
            result[closed, k], _ = nearest_on_outline(self._nominal.slider.vertices, centers[closed, k])
        return result

    def _stayed(self, trace: PushTrace, fingers: int) -> bool:
        """Whether the slider kept its place against the pusher from when all fingers had met it."""
        met = np.flatnonzero((trace.modes[:, :fingers] > 0).all(axis=1))
        if not len(met):
            return False
        # where the first contact is there from the start, so is the first pose
        first = met[0] + 1 if met[0] else 0
        relative = compose(inverse(trace.pushers[first:]), trace.poses[first:])
        moved = relative - relative[0]
        far = float(np.hypot(moved[:, 0], moved[:, 1]).max()) / self._nominal.slider.radius
        return far <= _STUCK[0] and float(np.abs(wrap_angle(moved[:, 2])).max()) <= _STUCK[1]

    def log(self) -> PushLog:
        """Return the log so far."""
        samples = {name: np.concatenate([part[name] for part in self._samples]) for name in self._samples[0]}
        samples = {
            name: values
            for name, values in samples.items()
            if name not in ("c1x", "c1y", "c2x", "c2y") or np.isfinite(values).any()
        }
        trials = {name: [entry[name] for entry in self._trials] for name in self._trials[0]}
        return PushLog(self._nominal, trials, samples)


def _mean_loads(trace: PushTrace, edges: FloatArray) -> FloatArray:
    """Means (n, 3) between times (n + 1,) of the force (N) in W and the moment (N·m) at the pusher: of all that happens, so that
    the shock of a first touch counts by its impulse."""
    poses, pushers = (0.5 * (path[:-1] + path[1:]) for path in (trace.poses, trace.pushers))
    force = rotate_vectors(poses[:, 2], trace.wrenches[:, :2])
    moment = trace.wrenches[:, 2:] + wrench_from_force(poses[:, :2] - pushers[:, :2], force)[:, 2:]
    steps = np.concatenate((force, moment), axis=1) * np.diff(trace.t)[:, None]
    sums = np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))
    at_edges = np.stack([np.interp(edges, trace.t, sums[:, k]) for k in range(3)], axis=-1)
    return np.asarray(np.diff(at_edges, axis=0) / np.diff(edges)[:, None])


def _at(t: FloatArray, poses: FloatArray, times: FloatArray) -> FloatArray:
    """Poses (..., 3) at times (...); the first before the push."""
    return np.stack([np.interp(times, t, poses[:, k]) for k in range(3)], axis=-1)
