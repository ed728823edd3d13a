"""From a log to its likelihood: which channels it has, and which prior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from stablepush.core import first_least
from stablepush.diagnosis.likelihood.channel import Channel
from stablepush.diagnosis.likelihood.clearance import Clearance
from stablepush.diagnosis.likelihood.experiment import Experiment, experiment_of
from stablepush.diagnosis.likelihood.final_pose import FinalPose, FinalPoses, final_poses_of, noise_left
from stablepush.diagnosis.likelihood.likelihood import Demands, Likelihood, Solver
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.prior import MovedPressure, PointLoads
from stablepush.diagnosis.likelihood.replay import Replay, friction_of, pose_errors
from stablepush.diagnosis.likelihood.rest import Rest
from stablepush.diagnosis.likelihood.robust import robust_variance
from stablepush.diagnosis.likelihood.wrench import Wrench
from stablepush.diagnosis.rows.observations import Observations
from stablepush.effects import CATALOGUE, EffectKind
from stablepush.io import Rig

#: What causes must pass. Beside a model that was fitted to pokes: its errors are alike in pushes that are alike, and an executed
#: plan has few of them. Without forces: final poses depend nonlinearly on effects, a single step is a poor test, so the gain of a
#: full fit may decide.
_DEMANDS = Demands(18.0, 6.0, 2.0, 0.01)
_DEMANDS_OF_A_MODEL = Demands(25.0, 8.0, 2.5, 0.002, 4.0, 0.02)
_DEMANDS_OF_POSES = Demands(4.0, 12.0, 3.0, 0.01, 1.5)
#: Steps where every residual is a simulation of all pushes.
_SOLVER_OF_POSES = Solver(5, 4, 1e-3)
#: Mean square below which whitened residuals are rounding.
_ROUNDING = 1e-4
#: Friction of the fingers, where it is not known, that is tried to begin with.
_CONTACT_MUS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15)


class LogModel(NamedTuple):
    """The likelihood of a log, and its pushes whose final poses are measurements."""

    likelihood: Likelihood
    poses: FinalPoses


def log_model(
    observations: Observations,
    rig: Rig,
    replays: Sequence[Replay],
    own: Mapping[str, EffectKind] = MappingProxyType({}),
    log: np.ndarray | None = None,
) -> LogModel:
    """Return the likelihood of a log. ``own``: effects of the lab's own; ``log`` (trials,): of which of several logs a trial is.

    Where its rig does not say how noisy it is, the noise is what a free pressure leaves.
    """
    if replays and not observations.has_wrench.any():
        return _of_poses(observations, rig, replays)
    likelihood = _of_loads(experiment_of(observations, rig, own, log))
    wrench = likelihood.wrench
    if rig.noise is None and wrench is not None:
        left = likelihood.rows_of(wrench, likelihood.fit(Model()).residual)
        noisier = float(np.sqrt(robust_variance(left**2)))
        if noisier > 1:
            likelihood = _of_loads(experiment_of(observations, rig, own, log, noisier))
    return LogModel(likelihood, final_poses_of(likelihood.experiment, likelihood.prior, replays))


def _of_loads(experiment: Experiment) -> Likelihood:
    """The likelihood of a log with forces, or of one in which only the fingers are seen."""
    rig, has_wrench = experiment.rig, bool(experiment.observations.has_wrench.any())
    loads = experiment.believed.loads_on(experiment.points)
    clearance = Clearance(experiment)
    channels: tuple[Channel, ...] = (clearance,)
    nominal = loads if experiment.known_scale else 0.0 * loads
    if has_wrench:
        wrench = Wrench(experiment, loads)
        channels, nominal = (wrench, clearance, Rest(experiment)), wrench.nominal
    prior = PointLoads(experiment, np.tile(nominal, experiment.logs), has_wrench)
    demands = _DEMANDS_OF_A_MODEL if rig.model is not None and has_wrench else _DEMANDS
    return Likelihood(experiment, channels, prior, _nuisance(experiment, clearance), demands, Solver(), _least_scale(rig))


def _least_scale(rig: Rig) -> float:
    return _ROUNDING if rig.noise is None else 1.0


def _nuisance(experiment: Experiment, clearance: Clearance) -> tuple[str, ...]:
    """Effects on what the rig does not state."""
    unknown = experiment.rig.finger_radius is None and clearance.is_seen
    return tuple(id for id, kind in CATALOGUE.items() if unknown and kind.of_radius)


def _of_poses(observations: Observations, rig: Rig, replays: Sequence[Replay]) -> LogModel:
    """The likelihood of a log without forces; the noise of final poses is at least that of measured poses, and what a free
    pressure leaves of them.

    Where friction of the fingers is not known fits begin at what it is like, with the slopes there.
    """
    experiment = experiment_of(observations, rig)
    prior = MovedPressure.of(experiment.believed.points)
    believed = replace(experiment.believed, points=prior.pressure)
    experiment = replace(experiment, believed=believed, known_scale=True)
    clearance = Clearance(experiment)
    nuisance = _nuisance(experiment, clearance)
    unknown = [id for id, kind in CATALOGUE.items() if kind.by_slip] if rig.contact_friction is None else []
    if unknown:
        nuisance, experiment = (*nuisance, *unknown), replace(experiment, mu=_likely_contact_mu(experiment, prior, replays))
    poses = final_poses_of(experiment, prior, replays)
    channel = FinalPose.of(poses)

    def likelihood_of(channel: FinalPose) -> Likelihood:
        channels = (channel, clearance)
        return Likelihood(experiment, channels, prior, nuisance, _DEMANDS_OF_POSES, _SOLVER_OF_POSES, _least_scale(rig))

    likelihood = likelihood_of(channel)
    if not poses.pushes:
        return LogModel(likelihood, poses)
    plain = likelihood.fit(Model())
    channel = channel.of_noise(noise_left(channel, likelihood.rows_of(channel, plain.residual)))
    likelihood = likelihood_of(channel)
    if unknown:
        likelihood = likelihood.anew_at(plain)
        likelihood = likelihood.anew_at(likelihood.fit(Model()))
    if rig.noise is None:
        poses = replace(poses, noise=channel.spread.reshape(-1, 3))
    return LogModel(likelihood, poses)


def _likely_contact_mu(experiment: Experiment, prior: MovedPressure, pushes: Sequence[Replay]) -> float:
    """Friction of the fingers that minimises the pose errors of the nominal simulation: the start of fits."""
    table = friction_of(experiment.believed, prior.surface(prior.nominal), {}, experiment.moving_weight)
    slider = experiment.rig.slider
    errors = [np.linalg.norm(pose_errors(pushes, table, slider, mu, {}), axis=1) for mu in _CONTACT_MUS]
    totals = [np.nan_to_num(sizes, nan=10 * experiment.rho).sum() for sizes in errors]
    return _CONTACT_MUS[first_least(totals, 1e-6 * len(pushes))]
