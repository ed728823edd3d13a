"""Another simulator's log of the same commands as the nominal simulation.

An effect is what our model says it changes, so both logs are seen against our model, each at its own motion. With the model's
loads ``g`` a row's residual is ``(F - g(V)) - (F' - g(V'))``: of the log less the other simulator's at the same time. Final
poses are compared alike: how far each ends from where our model carries it by its own pusher's path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from stablepush.core import FloatArray, InputError, some_of
from stablepush.diagnosis.likelihood.experiment import experiment_of
from stablepush.diagnosis.likelihood.nominal import nominal_of
from stablepush.diagnosis.likelihood.replay import Replay, friction_of, pose_errors, replays
from stablepush.diagnosis.likelihood.wrench import Wrench
from stablepush.diagnosis.results import ChannelGap, GapReduction
from stablepush.diagnosis.rows.observations import Observations, observe
from stablepush.geometry import compose, exp, inverse, wrap_angle
from stablepush.io import Noise, PushLog, Rig

#: Outlines that differ by no more (m) are one slider's.
_SAME_OUTLINE = 1e-3
#: A simulated slider that moves by less than this share of the way of the real one was not touched; one that goes this many times
#: as far has flown off. Ways (m) below the last count as none.
_UNTOUCHED, _FLOWN, _NO_WAY = 0.1, 3.0, 1e-3
#: A turn (rad) between two rows that no slider makes.
_JUMP = np.pi / 2
#: Share of trials that must be comparable for causes to be looked for.
_MOST = 0.5
#: A last pose is from the end of a trial if it is within this many rows, or this share of the time, of its end.
_LAST_ROWS, _END = 3, 0.1
#: Final poses are off from this multiple of the scatter of repeats, with a p-value below this; scatter below a share is zero.
_CLEARLY, _SIGNIFICANT, _NO_SCATTER = 1.5, 0.05, 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """A log beside another simulator's log of the same commands.

    Attributes
    ----------
    log : PushLog
        The trials that can be compared: those with a partner whose slider was touched and not lost; all if there is none.
    simulated : PushLog
        The simulator's, seen with the rig of the log.
    partners : dict of str to list of str
        Trials of the simulator by the trial of the log that they stand for.
    errors : array, shape (n, 3)
        Of all trials with a partner: measured minus simulated displacement from first to last pose, as ``(x, y, rho θ)`` in the
        frame of the first pose, in m; without the turn where the simulated slider tumbles.
    displacements : array, shape (n, 2)
        How far (m) the slider moved, in the log and in simulation; NaN where it is not seen at the end.
    floor, repeated : float, bool
        Root mean square (m) of final poses about the mean of their group: how well the log repeats itself. Where nothing is
        repeated, the noise of poses as the rig states it.
    problems : dict of str to list of str
        Trials that cannot be compared, by what is wrong with them.
    """

    log: PushLog
    simulated: PushLog
    partners: dict[str, list[str]]
    errors: FloatArray
    displacements: FloatArray
    floor: float
    repeated: bool
    problems: dict[str, list[str]]

    @property
    def total(self) -> int:
        """Number of trials of the log."""
        return self.comparable + sum(len(names) for names in self.problems.values())

    @property
    def comparable(self) -> int:
        """Number of trials that can be compared."""
        bad = {name for names in self.problems.values() for name in names}
        return sum(str(name) not in bad for name in self.log.trials["trial"])

    @property
    def one_push(self) -> bool:
        """Whether the log repeats a single push."""
        groups = {str(group) for group in self.log.trials.get("group", ())}
        return len(self.log) > 1 and len(groups) == 1 and groups != {""}

    @property
    def can_name(self) -> bool:
        """Whether enough pushes can be compared, and they differ, for causes to be told apart."""
        return not self.one_push and self.comparable >= max(2.0, _MOST * self.total)

    @property
    def is_off(self) -> bool:
        """Whether the two logs clearly differ, by their final poses, or because most pushes cannot be compared."""
        if self.comparable < _MOST * self.total:
            return True
        gap = self.gap()
        return gap.nominal > _CLEARLY * gap.noise_floor and gap.p_lack_of_fit < _SIGNIFICANT

    def gap(self) -> ChannelGap:
        """The gap of the final poses, direct."""
        size = float(np.sqrt((self.errors**2).sum(axis=1).mean()))
        return ChannelGap("pose", "m", size, size, self.floor, self._p())

    def reduction(self) -> GapReduction:
        """None: nothing was corrected."""
        size = self.gap().nominal
        return GapReduction("pose", "m", len(self.errors), size, size, min(self.floor, size), 0.0, [0.0, 0.0], self.floor)

    def _p(self) -> float:
        """p-value of squares above the floor, by a one-sided t-test; without scatter the size alone decides."""
        squares = (self.errors**2).sum(axis=1)
        error = float(squares.std(ddof=1) / np.sqrt(len(squares))) if len(squares) > 1 else 0.0
        if error <= _NO_SCATTER * float(squares.mean()):
            return float(squares.mean() <= self.floor**2)
        return float(student.sf((squares.mean() - self.floor**2) / error, len(squares) - 1))

    def notes(self) -> list[str]:
        """What is to be said of the comparison."""
        found = [f"the nominal simulation is another simulator's log: {self.comparable} of {self.total} trials can be compared"]
        for what, names in self.problems.items():
            found.append(f"in {len(names)} of {self.total} trials {what} ({some_of(names)})")
        if self.one_push:
            found.append("the log repeats one push: it shows how large the gap is, and cannot tell causes apart")
        forces = [np.isfinite(log.columns("fx", "fy", "tau")).all(axis=1).any() for log in (self.log, self.simulated)]
        if forces[0] != forces[1]:
            found.append(f"{'the simulator' if forces[0] else 'the real'} log has no forces: only poses are compared")
        return found

    def sentence(self) -> str:
        """What a comparison without causes says."""
        real, other = self.displacements.T
        seen = np.isfinite(other)
        moves = f"it moves {1000 * np.median(other[seen]):.3g} mm (median)" if seen.any() else "it is not seen at the end"
        how_far = f"{moves}, the real one {1000 * np.median(real):.3g} mm"
        floor = f"{1000 * self.floor:.2g} mm"
        scatter = f"repeats of the real push scatter by {floor}" if self.repeated else f"noise of the poses leaves {floor}"
        if self.comparable < _MOST * self.total and self.problems:
            what, names = max(self.problems.items(), key=lambda entry: len(entry[1]))
            return f"In {len(names)} of {self.total} trials {what}: {how_far}; {scatter}. No cause is named."
        away = f"The slider ends {1000 * self.gap().nominal:.3g} mm from the simulator's (root mean square); {scatter}."
        if self.one_push:
            return f"{away} One repeated push cannot tell which cause it has: make pushes at varied headings, places and speeds."
        return f"{away} Too few pushes can be compared to look for causes."


#: What may be wrong with a trial.
_UNMATCHED = "the simulator's log has no partner"
_UNSEEN = "the real slider is not seen at the beginning or the end"
_NOT_TOUCHED = "the simulator's slider is not touched"
_TUMBLES = "the simulator's slider tumbles"
_FLIES = "the simulator's slider flies off"
_MISSING = "the simulator's last poses are missing"
_APART = "the clocks of the two logs do not overlap"


def compare(log: PushLog, simulated: PushLog) -> Comparison:
    """Match the trials of two logs: by ``group`` where both have it, else by ``trial``.

    Raises :class:`InputError` if the sliders differ or no trial has a partner.
    """
    mine, other = log.rig.slider.vertices, simulated.rig.slider.vertices
    if mine.shape != other.shape or np.abs(mine - other).max() > _SAME_OUTLINE:
        raise InputError("simulated: slider", "expected the outline of the log's slider", f"{len(other)} other vertices")
    partners = _partners(log, simulated)
    if not partners:
        raise InputError("simulated: trials", "expected trials with a group or name of the log's", _first(simulated))
    real, there, tumbling = _ends(log), _ends(simulated), _tumbling(simulated)
    spans = [_spans(one) for one in (log, simulated)]
    rho = log.rig.slider.characteristic_length
    errors, displacements, seen, kept = [], [], [], []
    problems: dict[str, list[str]] = {}
    for name in map(str, log.trials["trial"]):
        start, end = real.get(name, (np.full(3, np.nan), np.full(3, np.nan)))
        moved = compose(inverse(start), end)
        if name not in partners or not np.isfinite(moved).all():
            problems.setdefault(_UNSEEN if name in partners else _UNMATCHED, []).append(name)
            continue
        moves = [there[one] for one in partners[name] if one in there and np.isfinite(there[one]).all()]
        mean = np.mean([compose(inverse(a), b) for a, b in moves], axis=0) if moves else np.zeros(3)
        tumbled = any(one in tumbling for one in partners[name])
        error = moved - mean
        error[2] = 0.0 if tumbled else rho * wrap_angle(error[2])
        distance, its = float(np.hypot(*moved[:2])), float(np.hypot(*mean[:2])) if moves else np.nan
        errors.append(error)
        displacements.append((distance, its))
        seen.append(name)
        wrong = ""
        if not moves:
            wrong = _MISSING
        elif its > _FLOWN * distance + _NO_WAY:
            wrong = _FLIES
        elif tumbled:
            wrong = _TUMBLES
        elif its < _UNTOUCHED * distance and distance > _NO_WAY:
            wrong = _NOT_TOUCHED
        elif not any(_overlap(spans[0][name], spans[1][one]) for one in partners[name]):
            wrong = _APART
        if wrong:
            problems.setdefault(wrong, []).append(name)
        else:
            kept.append(name)
    if not seen:
        raise InputError("simulated: trials", "expected trials with a first and a last pose in both logs", "none")
    found = np.array(errors)
    rig = _with_noise_of_both(log.rig, simulated.rig)
    floor, repeated = _floor(log, seen, found)
    return Comparison(
        _subset(replace(log, rig=rig), kept or seen),
        replace(simulated, rig=rig),
        partners,
        found,
        np.array(displacements),
        floor,
        repeated,
        problems,
    )


def _spans(log: PushLog) -> dict[str, tuple[float, float]]:
    """First and last time (s) of each trial."""
    times = log.columns("t")[:, 0]
    found = {str(name): times[log.rows(name)] for name in log.trials["trial"]}
    return {name: (float(t.min()), float(t.max())) if len(t) else (0.0, 0.0) for name, t in found.items()}


def _overlap(mine: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two spans of time have half of the shorter one in common."""
    shorter = min(mine[1] - mine[0], other[1] - other[0])
    return min(mine[1], other[1]) - max(mine[0], other[0]) >= _MOST * shorter


def _first(simulated: PushLog) -> str:
    return f"{str(simulated.trials['trial'][0])[:40]!r}"


def _partners(log: PushLog, simulated: PushLog) -> dict[str, list[str]]:
    by_group: dict[str, list[str]] = {}
    if "group" in log.trials and "group" in simulated.trials:
        for name, group in zip(simulated.trials["trial"], simulated.trials["group"], strict=True):
            by_group.setdefault(str(group), []).append(str(name))
    # a name counts where one of the two logs has no group for it
    without = set(by_group.pop("", [])) if by_group else {str(name) for name in simulated.trials["trial"]}
    everyone = {str(name) for name in simulated.trials["trial"]}
    groups = log.trials["group"] if "group" in log.trials else [""] * len(log)
    found = {}
    for name, group in zip(log.trials["trial"], groups, strict=True):
        known = everyone if not group else without
        mine = by_group.get(str(group)) or ([str(name)] if str(name) in known else [])
        if mine:
            found[str(name)] = mine
    return found


def _ends(log: PushLog) -> dict[str, tuple[FloatArray, FloatArray]]:
    """First and last known pose of each trial; NaN for the last one (3,) if it is not from the end of the trial."""
    poses, times = log.columns("x", "y", "theta"), log.columns("t")[:, 0]
    found = {}
    for name in log.trials["trial"]:
        rows = log.rows(name)
        rows = rows[np.argsort(times[rows], kind="stable")]
        known = rows[np.isfinite(poses[rows]).all(axis=1)]
        if len(known):
            late = float(np.ptp(times[rows])) * _END + 1e-9
            at_end = times[rows[-1]] - times[known[-1]] <= late or known[-1] in rows[-_LAST_ROWS:]
            found[str(name)] = poses[known[0]], poses[known[-1]] if at_end and len(known) > 1 else np.full(3, np.nan)
    return found


def _tumbling(log: PushLog) -> set[str]:
    """Trials in which the heading jumps between two rows: no planar motion does that, a body that tips over does."""
    poses, times, found = log.columns("x", "y", "theta"), log.columns("t")[:, 0], set()
    for name in log.trials["trial"]:
        rows = log.rows(name)
        rows = rows[np.argsort(times[rows], kind="stable")]
        headings = poses[rows[np.isfinite(poses[rows]).all(axis=1)], 2]
        if (np.abs(wrap_angle(np.diff(headings))) > _JUMP).any():
            found.add(str(name))
    return found


def _subset(log: PushLog, names: Sequence[str]) -> PushLog:
    """The log with some trials only, without labels of stability: the other simulator's say nothing of the oracle."""
    chosen = {str(name) for name in names}
    trials = np.array([str(name) in chosen for name in log.trials["trial"]])
    samples = np.array([str(name) in chosen for name in log.samples["trial"]])
    return PushLog(
        log.rig,
        {key: column[trials] for key, column in log.trials.items() if key != "stable"},
        {key: column[samples] for key, column in log.samples.items()},
    )


def _floor(log: PushLog, names: Sequence[str], errors: FloatArray) -> tuple[float, bool]:
    """Scatter (m) of repeats, and True; else the noise of poses, and False."""
    groups = dict(zip(map(str, log.trials["trial"]), map(str, log.trials.get("group", [""] * len(log))), strict=True))
    squares, free = 0.0, 0
    for group in {groups[name] for name in names} - {""}:
        mine = errors[[groups[name] == group for name in names]]
        squares += float(((mine - mine.mean(axis=0)) ** 2).sum())
        free += len(mine) - 1
    if free:
        return float(np.sqrt(squares / free)), True
    noise, rho = log.rig.noise, log.rig.slider.characteristic_length
    return 0.0 if noise is None else float(np.hypot(np.sqrt(2) * noise.position, rho * noise.angle)), False


def less_simulated(comparison: Comparison, observations: Observations, pushes: list[Replay]) -> tuple[Observations, list[Replay]]:
    """Return observations and pushes of the log, less what the other simulator has beyond our model.

    Loads that only one log has are left out.
    """
    other, rig = comparison.simulated, comparison.log.rig
    o = observe(other)
    number = {name: k for k, name in enumerate(o.names)}
    partners = {
        k: [number[one] for one in comparison.partners[name] if one in number] for k, name in enumerate(observations.names)
    }
    wrench = np.full_like(observations.wrench, np.nan)
    if o.has_wrench.any() and observations.has_wrench.any():
        experiment = experiment_of(o, rig)
        there, channel = experiment.observations, Wrench(experiment, experiment.believed.loads_on(experiment.points))
        beyond = there.wrench - channel.predict(channel.nominal, {})
        wrench = observations.wrench - _at(observations, there, beyond, partners)
    clearance = observations.clearance - np.nan_to_num(_at(observations, o, o.clearance, partners))
    believed = nominal_of(rig)
    table = friction_of(believed, believed.points, {}, 0.0)
    mu = rig.contact_friction if rig.contact_friction is not None else 1.0
    carried = replays(other, o, whole=True)
    off = {push.trial: error for push, error in zip(carried, pose_errors(carried, table, rig.slider, mu, {}), strict=True)}
    shifted = []
    for push in pushes:
        mine = [off[k] for k in partners[push.trial] if k in off and np.isfinite(off[k]).all()]
        if mine:
            error = np.mean(mine, axis=0) / (1.0, 1.0, rig.slider.characteristic_length)
            shifted.append(replace(push, end=compose(push.end, inverse(exp(error)))))
    return replace(observations, wrench=wrench, clearance=clearance), shifted


def _with_noise_of_both(rig: Rig, other: Rig) -> Rig:
    """Return the rig with the noise of both logs; a simulator's log that states none counts as exact."""
    if rig.noise is None or other.noise is None:
        return rig
    both = [float(np.hypot(getattr(rig.noise, name), getattr(other.noise, name))) for name in ("force", "position", "angle")]
    return replace(rig, noise=Noise(*both))


def _at(observations: Observations, there: Observations, values: FloatArray, partners: dict[int, list[int]]) -> FloatArray:
    """Values (n, d) of the rows of another log at the times (m,) of a log's rows, means over partners; NaN where unknown."""
    found = np.full((len(observations.time), values.shape[1]), np.nan)
    for k in np.unique(observations.trial):
        rows = np.flatnonzero(observations.trial == k)
        seen = []
        for partner in partners[int(k)]:
            mine = np.flatnonzero(there.trial == partner)
            column = np.full((len(rows), values.shape[1]), np.nan)
            for c in range(values.shape[1]):
                known = mine[np.isfinite(values[mine, c])]
                if len(known):
                    at, beyond = observations.time[rows], float(there.span[known].max())
                    column[:, c] = np.interp(at, there.time[known], values[known, c])
                    outside = (at < there.time[known[0]] - beyond) | (at > there.time[known[-1]] + beyond)
                    column[outside, c] = np.nan
            seen.append(column)
        known = np.isfinite(seen) if seen else np.zeros((0, len(rows), values.shape[1]), dtype=bool)
        count = known.sum(axis=0)
        if seen:
            found[rows] = np.where(count > 0, np.nansum(seen, axis=0) / np.maximum(count, 1), np.nan)
    return found
