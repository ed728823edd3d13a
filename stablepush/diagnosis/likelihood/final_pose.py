"""Where pushes end: final poses as they are measured and simulated, and the channel that they are in a log without forces.

``log(p(θ, s)⁻¹ q) = noise`` in ``(x, y, rho θ)`` for the measured final pose ``q`` of a push and its final pose ``p`` when it is
simulated again with effects ``θ`` on a surface ``s``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from stablepush.core import FloatArray, InputError
from stablepush.diagnosis.likelihood.channel import Channel, Values
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.nominal import Nominal
from stablepush.diagnosis.likelihood.prior import STEPS, Prior
from stablepush.diagnosis.likelihood.replay import AMPLIFIED, Replay, carried, friction_of, pose_errors
from stablepush.diagnosis.likelihood.robust import robust_variance

#: Share of what the prior lets the surface move a final pose that counts as noise, before what a free pressure leaves is known.
_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class FinalPoses:
    """The pushes of a log that can be simulated again.

    Attributes
    ----------
    pushes : list of Replay
        Those whose final pose does not depend on noise of the first pose. ``noise`` (n, 3) in m: of the final poses.
    lost : list of Replay
        Others: the final pose of a push whose finger just passes a corner cannot be predicted. ``lost_noise`` (m, 3) in m is
        larger; an object that is lost is farther off than that.
    """

    experiment: Experiment
    prior: Prior
    pushes: list[Replay]
    noise: FloatArray
    lost: list[Replay]
    lost_noise: FloatArray
    _nominal_errors: dict[Replay, FloatArray] = field(repr=False)

    def errors(self, pushes: Sequence[Replay], loads: FloatArray, values: Values, believed: Nominal | None = None) -> FloatArray:
        """Return pose errors (n, 3) of pushes, simulated with friction loads and effects; NaN where they cannot be simulated.

        ``believed``: another surface of the rig's model in the place of the nominal one.
        """
        if believed is None and loads is self.prior.nominal and not values:
            known = [self._nominal_errors[push] for push in pushes if push in self._nominal_errors]
            if len(known) == len(pushes):
                return np.reshape(np.array(known), (-1, 3))
        experiment = self.experiment
        errors = np.full((len(pushes), 3), np.nan)
        surfaces = self.prior.surfaces(loads)
        for k, surface in enumerate(surfaces):
            # pushes that could be made are of no log yet
            mine = [i for i, push in enumerate(pushes) if len(surfaces) == 1 or experiment.log[push.trial] == k]
            own = experiment.values_of(values, k)
            try:
                table = friction_of(believed or experiment.believed, surface, own, experiment.moving_weight)
            except InputError:
                # numbers that no rig can have
                continue
            errors[mine] = pose_errors([pushes[i] for i in mine], table, experiment.rig.slider, experiment.mu, values)
        return errors

    def predictable(self, pushes: Sequence[Replay]) -> FinalPoses:
        """Return the same for other pushes."""
        return final_poses_of(self.experiment, self.prior, pushes)


def final_poses_of(experiment: Experiment, prior: Prior, pushes: Sequence[Replay]) -> FinalPoses:
    """Return the pushes whose final poses can be told, with their noise: what noise of the first pose makes of them."""
    none = np.zeros((0, 3))
    without = FinalPoses(experiment, prior, [], none, [], none, {})
    if not prior.has_surface or not pushes:
        return without
    noise, rho = experiment.noise, experiment.rho
    table = friction_of(experiment.believed, prior.surface(prior.nominal), {}, experiment.moving_weight)
    nominal, moved = carried(pushes, table, experiment.rig.slider, experiment.mu, noise)
    own = np.array((noise.position, noise.position, rho * noise.angle))
    kept = np.linalg.norm(moved, axis=1) <= AMPLIFIED * np.linalg.norm(own)
    left = ~kept & np.isfinite(moved).all(axis=1)
    told = [push for push, good in zip(pushes, kept, strict=True) if good]
    return replace(
        without,
        pushes=told,
        noise=np.hypot(moved[kept], own),
        lost=[push for push, out in zip(pushes, left, strict=True) if out],
        lost_noise=np.hypot(moved[left], own),
        _nominal_errors=dict(zip(pushes, nominal, strict=True)),
    )


@dataclass(frozen=True, eq=False)
class FinalPose(Channel):
    """Whitened final poses (3n,), with slopes about a ``base`` of loads and effects: every residual is a simulation of all
    pushes.

    ``spread`` (3n,): noise in m of the components.
    """

    poses: FinalPoses
    spread: FloatArray
    base: tuple[FloatArray, Values]
    _slopes: dict[str, FloatArray] = field(default_factory=dict, repr=False)
    _found: dict[object, FloatArray] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, poses: FinalPoses) -> FinalPose:
        """Return the channel about the nominal simulation, without what a free pressure leaves."""
        channel = cls(poses, np.zeros(3 * len(poses.pushes)), (poses.prior.nominal, {}))
        return replace(channel, spread=np.hypot(poses.noise.ravel(), _SHARE * channel.reach))

    @property
    def trial(self) -> np.ndarray:  # type: ignore[override]
        return np.repeat([push.trial for push in self.poses.pushes], 3).astype(int)

    def about(self, loads: FloatArray, values: Values) -> FinalPose:
        """Return the channel with slopes about other loads and effects."""
        return replace(self, base=(loads, values), _slopes={})

    def of_noise(self, spread: FloatArray) -> FinalPose:
        """Return the channel with another noise."""
        return replace(self, spread=spread)

    @cached_property
    def reach(self) -> FloatArray:
        """How far (3n,) in m the surface moves each component within its prior: the final pose of a push that slips depends on
        friction, that of a push that sticks follows the pusher."""
        return np.linalg.norm(self._slope("", STEPS) * self.poses.prior.deviations, axis=1)

    def errors(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return pose errors (n, 3): measured minus simulated final poses, in ``(x, y, rho θ)`` of the simulated frame, in m."""
        key = loads.tobytes(), tuple((id, values[id].tobytes()) for id in sorted(values) if values[id].any())
        if key not in self._found:
            found = self.poses.errors(self.poses.pushes, loads, values)
            # what cannot be simulated is as far off as nothing else
            self._found[key] = np.nan_to_num(found, nan=10 * self.poses.experiment.rho)
        return self._found[key]

    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        return self.errors(loads, values).ravel() / self.spread

    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        columns, kind = np.zeros((len(self.trial), size)), self.poses.experiment.effects[id]
        if kind.pose_step:
            columns[:, : kind.size] = self._slope(id, (kind.pose_step,) * kind.size) / self.spread[:, None]
        return columns

    def by_loads(self, values: Values, directions: FloatArray | None, count: int) -> FloatArray:
        slopes = self._slope("", STEPS) / self.spread[:, None]
        return slopes if directions is None else slopes @ directions

    def _slope(self, id: str, steps: tuple[float, ...]) -> FloatArray:
        """Derivatives (3n, d) by the numbers of an effect, or of the surface, by differences about the base."""
        if id not in self._slopes:
            found = []
            for k, size in enumerate(steps):
                step = np.zeros(len(steps))
                step[k] = size
                # to both sides: what makes a finger slip one way may make it stick the other way
                found.append((self._nearby(id, -step) - self._nearby(id, step)).ravel() / (2 * size))
            self._slopes[id] = np.stack(found, axis=-1)
        return self._slopes[id]

    def _nearby(self, id: str, step: FloatArray) -> FloatArray:
        loads, values = self.base
        if not id:
            return self.errors(loads + step, values)
        return self.errors(loads, {**values, id: values.get(id, np.zeros(len(step))) + step})


def noise_left(channel: FinalPose, residual: FloatArray) -> FloatArray:
    """Return the noise (3n,) in m of final poses that a fit with a free pressure leaves: of those that the surface hardly moves,
    and of the others. ``residual`` (3n,): whitened, of that fit. It is at least the noise of measured poses."""
    left, reach, noise = residual * channel.spread, channel.reach, channel.poses.noise.ravel()
    # a final pose that the surface moves by less than a thousandth of its noise counts as not moved
    stuck = reach <= np.maximum(np.median(reach), 1e-3 * noise)
    still = noise * max(1.0, float(np.sqrt(robust_variance((left[stuck] / noise[stuck]) ** 2))))
    moved = np.maximum(left[~stuck] ** 2 - still[~stuck] ** 2, 0.0) / np.maximum(reach[~stuck], 1e-12) ** 2
    share = np.sqrt(robust_variance(moved)) if len(moved) else 0.0
    return np.hypot(still, float(share) * reach)
