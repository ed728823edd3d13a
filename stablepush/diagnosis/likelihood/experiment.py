"""The rows of a log beside the rig that its operator believes in, and what follows from both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.channel import Values
from stablepush.diagnosis.likelihood.nominal import CELLS, Nominal, nominal_of
from stablepush.diagnosis.rows.observations import Observations, beyond_noise, pushes_of, rows_of, smeared
from stablepush.effects import CATALOGUE, EffectKind, LogRows, RigBounds
from stablepush.io import Noise, Rig
from stablepush.objects import SupportDistribution

#: Noise of rigs that say nothing of it: share of the median force, m, rad.
_FORCE, _POSITION, _ANGLE = 0.02, 2e-4, 3e-3


@dataclass(frozen=True, eq=False)
class Experiment:
    """A log as its likelihood sees it.

    Attributes
    ----------
    rig : Rig
        As the operator believes it is.
    observations : Observations
        Rows with a wrench, if the log has any; else all. Accelerations are less what noise would make of them.
    rows : LogRows
        The same, as effects see them.
    noise : Noise
        Of the readings: the rig's, else that of a usual laboratory.
    motion_noise : array, shape (n, 3)
        Standard deviations of the rows' twists.
    log : array of int, shape (trials,)
        Which of several logs each trial is of. ``last``: the last of them with forces.
    effects : mapping of str to EffectKind
        All that may act: those of the catalogue, and the lab's own.
    believed : Nominal
        The friction that the operator believes in.
    points : array, shape (k, 2)
        Points in B that carry the slider: those of the nominal support, and a grid.
    center : array, shape (2,)
        Of the nominal pressure in B.
    mu : float
        Friction of the fingers; 1 where it is not known.
    known_scale : bool
        Whether it is known how much friction there is.
    moving_weight : float
        Weight (N), which a slope of the table turns into a force, of a slider whose friction is known; else 0.
    """

    rig: Rig
    observations: Observations
    rows: LogRows
    noise: Noise
    motion_noise: FloatArray
    log: np.ndarray
    last: int
    effects: Mapping[str, EffectKind]
    believed: Nominal
    points: FloatArray
    center: FloatArray
    mu: float
    known_scale: bool
    moving_weight: float

    @property
    def logs(self) -> int:
        """Number of logs that are fitted together."""
        return int(self.log.max(initial=0)) + 1

    @property
    def rho(self) -> float:
        """Characteristic length (m) of the slider."""
        return self.rig.slider.characteristic_length

    @property
    def weight(self) -> float:
        """Weight (N) of the slider; 0 if its mass is not known."""
        return (self.rig.slider.mass or 0.0) * self.rig.gravity

    @cached_property
    def push(self) -> np.ndarray:
        """Numbers (trials,) of the pushes: the same for trials that repeat one."""
        return pushes_of(self.observations.group)

    @cached_property
    def open_modes(self) -> FloatArray:
        """What the pokes behind the nominal surface leave open: changes (k, q) of the loads by one standard deviation."""
        return self.believed.modes(self.points)

    @cached_property
    def bounds(self) -> RigBounds:
        """What bounds effects on this rig."""
        o, slider = self.observations, self.rig.slider
        spans = [float(np.ptp(o.time[o.trial == k]) + np.median(o.span[o.trial == k])) for k in np.unique(o.trial)]
        longest = max(spans, default=np.inf)
        return RigBounds(slider.radius, slider.mass, self.rig.support_friction, o.finger_radius, longest, o.pose[:, :2])

    def per_log(self, id: str) -> bool:
        """Whether each of several logs has its own numbers of an effect."""
        return self.logs > 1 and self.effects[id].per_log

    def size(self, id: str, family: bool = False) -> int:
        """Return how many numbers are fitted of an effect, with the terms of its ``family`` or without."""
        kind = self.effects[id]
        terms = len(kind.family.terms) if family and kind.family is not None else 0
        return (kind.size + terms) * (self.logs if self.per_log(id) else 1)

    def values_of(self, values: Values, k: int) -> Values:
        """Return the numbers of effects as one log, of several, has them."""
        found = dict(values)
        for id in values:
            if self.per_log(id):
                split = self.size(id)
                own, terms = values[id][:split].reshape(self.logs, -1), values[id][split:].reshape(self.logs, -1)
                found[id] = np.concatenate((own[k], terms[k]))
        return found

    def loads_of(self, loads: FloatArray, k: int) -> FloatArray:
        """Return the friction loads (points, ...) of one log, of those of all logs one behind the other."""
        points = len(self.points)
        return loads[k * points : (k + 1) * points] if len(loads) > points else loads

    def clipped(self, id: str, value: FloatArray) -> FloatArray:
        """Return numbers of an effect within what this rig can have: no delay outlasts a push, no offset leaves it."""
        kind = self.effects[id]
        if not self.per_log(id):
            return kind.clipped(value, self.bounds)
        split = self.size(id)
        each = [kind.clipped(self.values_of({id: value}, k)[id], self.bounds) for k in range(self.logs)]
        own = [part[: kind.size] for part in each]
        terms = [part[kind.size :] for part in each] if len(value) > split else []
        return np.concatenate((*own, *terms))


def log_rows(o: Observations) -> LogRows:
    """Return rows as effects see them."""
    columns = {name: values[o.trial] for name, values in o.columns.items()}
    return LogRows(columns, o.time, o.order, o.pose, o.twist, o.pusher, o.wrench, o.normal)


def experiment_of(
    observations: Observations,
    rig: Rig,
    own: Mapping[str, EffectKind] = MappingProxyType({}),
    log: np.ndarray | None = None,
    noisier: float = 1.0,
) -> Experiment:
    """Return a log beside its rig. ``own``: effects of the lab's own; ``log`` (trials,): which of several logs each trial is of;
    ``noisier``: times the noise that is assumed where the rig states none."""
    has_wrench = bool(observations.has_wrench.any())
    chosen = observations.has_wrench if has_wrench else np.ones(len(observations.time), dtype=bool)
    o = rows_of(observations, chosen)
    noise = noise_of(rig, o, noisier)
    of_poses = np.array((noise.position, noise.position, noise.angle))
    own_noise = of_poses * o.noise_gain[:, None]
    motion_noise = np.hypot(own_noise, smeared(o, rig.twist_window, own_noise))
    of_twists = of_poses * (1 / o.span if rig.twist_window is None else o.noise_gain)[:, None]
    o = replace(o, acceleration=beyond_noise(o, of_twists))
    number = np.zeros(len(o.names), dtype=int) if log is None else log
    slider, believed = rig.slider, nominal_of(rig)
    side = float(np.ptp(slider.vertices, axis=0).max())
    support = believed.points.support
    grid = SupportDistribution.from_polygon(slider.vertices, side / CELLS).points
    weight = (slider.mass or 0.0) * rig.gravity
    known_scale = bool(weight and rig.support_friction) or rig.model is not None
    return Experiment(
        rig=rig,
        observations=o,
        rows=log_rows(o),
        noise=noise,
        motion_noise=motion_noise,
        log=number,
        last=int(number[o.trial].max(initial=0)),
        effects=MappingProxyType({**CATALOGUE, **own}),
        believed=believed,
        points=np.concatenate((support.points, grid)),
        center=np.asarray(support.center),
        mu=rig.contact_friction if rig.contact_friction is not None else 1.0,
        known_scale=known_scale,
        moving_weight=weight if has_wrench or known_scale else 0.0,
    )


def noise_of(rig: Rig, o: Observations, noisier: float) -> Noise:
    """The rig's noise, else what a laboratory of that kind has, times a factor."""
    if rig.noise is not None:
        force = max(rig.noise.force, 1e-6)
        return Noise(force, max(rig.noise.position, 1e-7), max(rig.noise.angle, 1e-6))
    size = np.linalg.norm(o.wrench[:, :2], axis=1)
    typical = float(np.median(size[np.isfinite(size)])) if np.isfinite(size).any() else 1.0
    return Noise(noisier * _FORCE * typical, noisier * _POSITION, noisier * _ANGLE)
