"""Gap reduction: what the nominal simulation, its refit and the corrected one leave of trials that they were not fitted
to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import reduce

import numpy as np
from scipy.stats import chi2, t as student

from stablepush.core import ConvergenceError, FloatArray, InputError
from stablepush.diagnosis.likelihood.channel import Values
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.final_pose import FinalPoses
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.replay import first_contacts
from stablepush.diagnosis.likelihood.wrench import Wrench
from stablepush.diagnosis.results import ChannelGap, GapReduction
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.search.folds import FOLDS, folds_of
from stablepush.effects import FINGER_FRICTION, friction_change
from stablepush.geometry import angle_between, twist_from_cor
from stablepush.io import PushLog
from stablepush.objects import PushContact, Slider
from stablepush.stability import StabilityOracle
from stablepush.surfaces import IdealLimitSurface

#: Resampled trials behind an interval.
_RESAMPLES = 500
#: Draws of the noise behind the floor of the directions of motion.
_DRAWS = 4
#: The error of a simulation with rigid bodies where no cause acts, since fingers and feet are compliant: of a load over its size,
#: of a final pose over the radius of the slider.
_RIGID = 0.01
#: The nominal simulation, its refit, and the corrected one.
FITS = ("before", "refit", "after")


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """Squared residuals of rows by channel, under ``"before"``, ``"refit"`` and ``"after"``, with the rows' trials and the floor.

    ``wrenches``: the predicted wrenches (n, 3) themselves; empty without forces. ``ends``: how far (m, 3) from where pushes
    end in simulation the slider was measured, as ``(x, y, rho θ)`` of its frame; NaN where they cannot be simulated.
    ``rigid``: what simulations of rigid bodies err by themselves in one component, as a mean square.
    The channel ``"touch"``, clearances between fingers and outline, is for judgements; reports have it where it stands for poses.
    """

    wrenches: dict[str, FloatArray] = field(default_factory=dict)
    ends: dict[str, FloatArray] = field(default_factory=dict)
    squares: dict[str, dict[str, FloatArray]] = field(default_factory=dict)
    trials: dict[str, np.ndarray] = field(default_factory=dict)
    floors: dict[str, float] = field(default_factory=dict)
    rigid: dict[str, float] = field(default_factory=dict)

    def plus(self, other: HeldOut) -> HeldOut:
        """Return these channels and others."""
        return HeldOut(*(getattr(self, f.name) | getattr(other, f.name) for f in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class _Fold:
    """Trials (all,) that are left out, and loads, surfaces of each log and effects that were fitted to the others, by name of
    the fit."""

    test: np.ndarray
    loads: dict[str, FloatArray]
    values: dict[str, Values]
    simulated: tuple[FloatArray, Values]
    surfaces: dict[str, tuple[IdealLimitSurface, ...]]


def hold_out(found: Attribution, log: PushLog, poses: FinalPoses) -> HeldOut:
    """Predict every trial by fits to the others: five folds, repeats kept together."""
    likelihood, experiment = found.likelihood, found.likelihood.experiment
    folds, has_surface = list(_folds(found)), likelihood.prior.has_surface
    parts = [HeldOut()]
    if likelihood.wrench is not None:
        parts.append(_wrenches(likelihood, likelihood.wrench, folds))
    if likelihood.clearance.is_seen:
        parts.append(_clearances(likelihood, folds))
    if has_surface and poses.pushes:
        parts.append(_ends(poses, folds))
    elif likelihood.clearance.is_seen:
        touch = parts[-1]
        floor = touch.floors["touch"] + rigid_square(experiment.rig.slider)
        parts.append(
            HeldOut(squares={"pose": touch.squares["touch"]}, trials={"pose": touch.trials["touch"]}, floors={"pose": floor})
        )
    labels = _labels(experiment, log) if has_surface and experiment.rig.contact_friction is not None else {}
    if labels:
        parts.append(_stability(experiment, folds, labels))
    return reduce(lambda first, second: first.plus(second), parts)


def _folds(found: Attribution) -> Iterator[_Fold]:
    likelihood, model = found.likelihood, found.model
    prior, folds, free = likelihood.prior, folds_of(likelihood.experiment), likelihood.fit(Model())
    for k in range(FOLDS):
        test = folds == k
        if not test.any():
            continue
        train = ~test if not test.all() else test
        corrected, plain = likelihood.fit(model, train, found.final), likelihood.fit(Model(), train, free)
        known = likelihood.experiment.known_scale
        scaled = prior.nominal if known else likelihood.fit(Model(free=False), train).loads
        loads = {"before": scaled, "refit": plain.loads, "after": corrected.loads}
        unknown = {id: v for id, v in plain.values.items() if id in likelihood.nuisance}
        values: dict[str, Values] = {"before": {}, "refit": unknown, "after": {**corrected.values, **found.slips}}
        simulated = loads["after"], values["after"]
        if model.families:
            own = likelihood.from_nominal.fit(model.in_own_forms, train)
            simulated = own.loads, {**own.values, **found.slips}
        surfaces = {k: prior.surfaces(m) for k, m in loads.items()} if prior.has_surface else {}
        yield _Fold(test, loads, values, simulated, surfaces)


def _wrenches(likelihood: Likelihood, wrench: Wrench, folds: list[_Fold]) -> HeldOut:
    """Loads of the measured motions, and directions of motion of the measured loads."""
    o = likelihood.experiment.observations
    wrenches = {k: np.zeros_like(o.wrench) for k in FITS}
    angles = {k: np.zeros(len(o.time)) for k in FITS}
    floor = 0.0
    for fold in folds:
        rows = fold.test[o.trial]
        for key in FITS:
            predicted = wrench.predict(fold.loads[key], fold.values[key])
            wrenches[key][rows] = predicted[rows]
            # what the effects do to a load is taken back before the surface is asked for its motion
            load = o.wrench - (predicted - wrench.predict(fold.loads[key], {})) - wrench.beyond_points
            angles[key][rows] = _angles(likelihood.experiment, fold.surfaces[key], load)[rows]
        floor += float(_twist_floor(likelihood.experiment, wrench, fold, rows).sum()) / len(o.time)
    counted = wrench.determined
    own = 3 * _RIGID**2 * wrench.squares(o.wrench)
    explained = wrench.variance(wrench.noise_covariance) + own
    return HeldOut(
        wrenches,
        squares={
            "wrench": {k: wrench.squares(o.wrench - w)[counted] for k, w in wrenches.items()},
            "twist": {k: angle**2 for k, angle in angles.items()},
        },
        trials={"wrench": o.trial[counted], "twist": o.trial},
        floors={"wrench": float(explained[counted].mean()), "twist": floor},
        # a load that is off across itself is that of a motion that is turned about as far
        rigid={"wrench": float(own[counted].mean()) / 3, "twist": _RIGID**2},
    )


def _ends(poses: FinalPoses, folds: list[_Fold]) -> HeldOut:
    """Final poses of pushes."""
    pushes = poses.pushes
    trial, found = np.array([push.trial for push in pushes], dtype=int), {}
    for key in FITS:
        ends = np.zeros((len(pushes), 3))
        for fold in folds:
            here = np.flatnonzero(fold.test[trial])
            loads, values = fold.simulated if key == "after" else (fold.loads[key], fold.values[key])
            ends[here] = poses.errors([pushes[int(i)] for i in here], loads, values)
        found[key] = ends
    simulated = np.isfinite([found[k] for k in FITS]).all(axis=(0, 2))
    if not simulated.any():
        return HeldOut(ends=found)
    rigid = rigid_square(poses.experiment.rig.slider)
    noise = float((poses.noise[simulated] ** 2).sum(axis=1).mean())
    return HeldOut(
        ends=found,
        squares={"pose": {k: (found[k][simulated] ** 2).sum(axis=1) for k in FITS}},
        trials={"pose": trial[simulated]},
        floors={"pose": noise + rigid},
        rigid={"pose": rigid},
    )


def rigid_square(slider: Slider) -> float:
    """Mean square (m²) of what poses of simulated pushes err without noise."""
    return float((_RIGID * slider.radius) ** 2)


def _clearances(likelihood: Likelihood, folds: list[_Fold]) -> HeldOut:
    """Clearances between fingers and outline."""
    channel = likelihood.clearance
    measured, after = channel.measured, np.zeros_like(channel.measured)
    for fold in folds:
        acting = {id: v for id, v in fold.values["after"].items() if channel.shows(id)}
        left = measured - sum(channel.change(id, v) for id, v in acting.items())
        after[fold.test[channel.trial]] = left[fold.test[channel.trial]] ** 2
    # neither the surface nor what a fit takes for granted changes them
    squares = {"before": measured**2, "refit": measured**2, "after": after}
    return HeldOut(squares={"touch": squares}, trials={"touch": channel.trial}, floors={"touch": channel.noise**2})


def _stability(experiment: Experiment, folds: list[_Fold], labels: dict[int, tuple[PushContact, FloatArray, bool]]) -> HeldOut:
    """Labels of stability: 1 where the oracle errs."""
    order, model = experiment.observations.trial_order, experiment.rig.model
    squares = {k: np.zeros(len(labels)) for k in FITS}
    for at, (trial, (contact, twist, stable)) in enumerate(labels.items()):
        fold = next(fold for fold in folds if fold.test[trial])
        for key, surfaces in fold.surfaces.items():
            change = friction_change(fold.values[key].get(FINGER_FRICTION, np.zeros(1)), order[trial])
            touching = replace(contact, mu=max(0.0, contact.mu + change))
            believed = model if model is not None and key == "before" else surfaces[experiment.log[trial]]
            squares[key][at] = float(StabilityOracle(believed, touching).is_stable(twist) != stable)
    return HeldOut(squares={"stability": squares}, trials={"stability": np.array(list(labels))}, floors={"stability": 0.0})


def clearance_reduction(held: HeldOut) -> float:
    """Return the explained fraction of the clearances between fingers and outline; 0 where none are measured."""
    if "touch" not in held.squares:
        return 0.0
    return float(_reduction("touch", "m", held.trials["touch"], held.squares["touch"], held.floors["touch"]).closed)


def _twists(surface: IdealLimitSurface, wrenches: FloatArray) -> FloatArray:
    """Slip twists (n, 3); NaN where they cannot be found."""
    try:
        return surface.twist(wrenches)
    except (ConvergenceError, InputError):
        if len(wrenches) == 1:
            return np.full((1, 3), np.nan)
    half = len(wrenches) // 2
    return np.concatenate((_twists(surface, wrenches[:half]), _twists(surface, wrenches[half:])))


def _angles(experiment: Experiment, surfaces: Sequence[IdealLimitSurface], wrenches: FloatArray) -> FloatArray:
    """Angles (n,) in ``(vx, vy, rho*omega)`` between slip twists of loads and the measured ones; none where there is no twist."""
    return _apart(experiment, surfaces, np.arange(len(wrenches)), wrenches, experiment.observations.twist)


def _apart(
    experiment: Experiment, surfaces: Sequence[IdealLimitSurface], rows: np.ndarray, wrenches: FloatArray, twists: FloatArray
) -> FloatArray:
    """Angles (m,) between the slip twists of loads (m, 3) and twists (m, 3) of rows (m,), each on the surface of its log."""
    scale, found = np.array((1.0, 1.0, experiment.rho)), np.zeros(len(wrenches))
    log = experiment.log[experiment.observations.trial[rows]]
    for k, surface in enumerate(surfaces):
        mine = np.flatnonzero(log == k)
        found[mine] = np.nan_to_num(angle_between(_twists(surface, wrenches[mine]) * scale, twists[mine] * scale))
    return found


def _twist_floor(experiment: Experiment, wrench: Wrench, fold: _Fold, rows: np.ndarray) -> FloatArray:
    """Mean squared angles of rows that noise of forces and motion alone would leave."""
    rng = np.random.default_rng(0)
    clean = (wrench.predict(fold.loads["after"], {}) - wrench.beyond_points)[rows]
    scale = np.array((1.0, 1.0, experiment.rho))
    own = _RIGID * np.linalg.norm(clean / scale, axis=1)[:, None, None] * np.diag(scale)
    readings = np.linalg.cholesky(wrench.reading_covariance[rows] + own @ own)
    motion = experiment.observations.twist[rows]
    total = np.zeros(len(clean))
    for _ in range(_DRAWS):
        load = clean + np.einsum("nij,nj->ni", readings, rng.normal(size=clean.shape))
        moved = motion + experiment.motion_noise[rows] * rng.normal(size=motion.shape)
        total += _apart(experiment, fold.surfaces["after"], np.flatnonzero(rows), load, moved) ** 2
    return total / _DRAWS


def _labels(experiment: Experiment, log: PushLog) -> dict[int, tuple[PushContact, FloatArray, bool]]:
    """Contact, commanded twist and whether it was stable, of trials by number, where the log has them all."""
    needed = ("cor_x", "cor_y", "sense", "stable")
    if not set(needed) <= set(log.trials):
        return {}
    columns = np.stack([np.asarray(log.trials[c], dtype=np.float64) for c in needed], axis=-1)
    found = {}
    for trial, contact in first_contacts(log, experiment.observations).items():
        x, y, sense, stable = columns[trial]
        if np.isfinite((x, y, sense, stable)).all():
            found[trial] = (contact, twist_from_cor((x, y), sense), bool(stable))
    return found


_UNITS = {"wrench": "N", "twist": "rad", "pose": "m", "stability": "1"}


def reductions(held: HeldOut) -> list[GapReduction]:
    """Return gap reduction, channel by channel, for ``diagnosis/1``."""
    return [
        _reduction(channel, unit, held.trials[channel], held.squares[channel], held.floors[channel])
        for channel, unit in _UNITS.items()
        if channel in held.squares
    ]


def _reduction(channel: str, unit: str, trial: np.ndarray, squares: dict[str, FloatArray], floor: float) -> GapReduction:
    """An entry of ``reductions`` from squared residuals of rows, trials resampled for the interval."""
    names, rows = np.unique(trial, return_inverse=True)
    before, after = squares["before"], squares["after"]
    sums = np.stack([np.bincount(rows, values) for values in (before, after, np.ones_like(before))], axis=-1)
    rng = np.random.default_rng(0)
    drawn = sums[rng.integers(0, len(names), (_RESAMPLES, len(names)))].sum(axis=1)
    mean = sums.sum(axis=0)
    b, a, noise = mean[0] / mean[2], mean[1] / mean[2], floor
    # the remaining residual cannot be below the noise: if it is, the noise was overestimated
    floor = min(floor, float(a), 0.999 * float(b))

    def share(before: FloatArray, after: FloatArray) -> FloatArray:
        low = np.minimum(floor, 0.999 * before)
        return np.asarray((before - after) / np.maximum(before - low, 1e-30))

    shares = share(drawn[:, 0] / drawn[:, 2], drawn[:, 1] / drawn[:, 2])
    # where there is hardly a gap its share is anything
    low, high = np.clip(np.quantile(shares, (0.025, 0.975)), -10.0, 1.0)
    return GapReduction(
        channel=channel,
        unit=unit,
        held_out_trials=len(names),
        before=float(np.sqrt(b)),
        after=float(np.sqrt(a)),
        floor=float(np.sqrt(floor)),
        closed=float(np.clip(share(np.array(b), np.array(a)), -10.0, 1.0)),
        ci95=[float(low), float(high)],
        noise_floor=float(np.sqrt(noise)),
    )


def gap(likelihood: Likelihood, held: HeldOut) -> list[ChannelGap]:
    """Return the size of the gap, channel by channel, for ``diagnosis/1``."""
    entries: list[ChannelGap] = []
    for channel, unit in _UNITS.items():
        if channel not in held.squares:
            continue
        if channel == "wrench":
            p = wrenches_lack_of_fit(likelihood, held.wrenches["before"])
        else:
            p = above_floor(held.squares[channel]["before"], held.trials[channel], held.floors[channel])
        squares = held.squares[channel]
        entries.append(
            ChannelGap(
                channel=channel,
                unit=unit,
                nominal=float(np.sqrt(squares["before"].mean())),
                refitted=float(np.sqrt(squares["refit"].mean())),
                noise_floor=float(np.sqrt(held.floors[channel])),
                p_lack_of_fit=p,
            )
        )
    return entries


def wrenches_lack_of_fit(likelihood: Likelihood, predicted: FloatArray) -> float:
    """Return the p-value of mean residuals of the wrench over trials: larger than noise and the simulation's own error leave.

    The mean ``z`` of a trial's n whitened residuals has the covariance ``I/n + A Aᵀ``: the noise of the rows, and an error of
    all of them alike that is :data:`_RIGID` of the load in each component. ``zᵀ (I/n + A Aᵀ)⁻¹ z`` is chi-squared with three
    degrees of freedom.
    """
    wrench = likelihood.wrench
    assert wrench is not None
    o, scale = likelihood.experiment.observations, np.array((1.0, 1.0, likelihood.experiment.rho))
    off = wrench.white(o.wrench - predicted).reshape(-1, 3)
    own = _RIGID * np.linalg.norm(predicted / scale, axis=1)[:, None, None] * np.diag(scale)
    own = wrench.white(own).reshape(-1, 3, 3)
    statistic, names = 0.0, np.unique(o.trial)
    for name in names:
        rows = o.trial == name
        z, common = off[rows].mean(axis=0), own[rows].mean(axis=0)
        statistic += float(z @ np.linalg.solve(np.eye(3) / rows.sum() + common @ common.T, z))
    return float(chi2.sf(statistic, 3 * len(names)))


def above_floor(squares: FloatArray, trial: np.ndarray, floor: float) -> float:
    """Return the p-value of trials whose mean squares lie above a floor, by a one-sided t-test."""
    names, rows = np.unique(trial, return_inverse=True)
    means = np.bincount(rows, squares) / np.bincount(rows)
    error = means.std(ddof=1) / np.sqrt(len(names)) if len(names) > 1 else 0.0
    if error > 0:
        return float(student.sf((means.mean() - floor) / error, len(names) - 1))
    # without scatter the size decides; one push tells nothing
    return float(means.mean() <= floor) if len(names) > 1 else 1.0
