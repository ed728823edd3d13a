"""A log as the diagnosis sees it: rows of pushes with motion, load, place of the fingers and what may explain a gap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from stablepush.core import LEAST_POSITIVE, BoolArray, FloatArray
from stablepush.diagnosis.rows.fingers import fingers_of, fingers_off
from stablepush.geometry import (
    compose,
    contacts_on_outline,
    exp,
    inverse,
    log as log_of,
    rotate_vectors,
    wrap_angle,
)
from stablepush.io import Noise, PushLog, distinct, end_of_motion, slope_weights

#: Fingers farther (m) from the outline than this certainly do not touch it.
_AWAY = 1e-3
#: Rows of a trial, at most: of more, means over equal parts are taken.
_MOST_ROWS = 12
#: A force below this share of its median in a push has fallen away.
_FALLEN = 0.5
#: Noise of the mean twist of one row, of two and of more, the last of them of one interval, times the span over that of a pose.
_AT_END = (math.sqrt(2), math.sqrt(3.5), math.sqrt(3))
#: Rows slower than this share of the median speed do not move.
_REST = 0.05
#: Differences of poses below this many standard deviations count as zero.
_STANDS = 5.0
#: Share of a moment that is rounding: no sensor of moments agrees with the forces so well in all rows.
_ROUNDING = 1e-3
#: A pose that is so near to the line through its neighbours, over the noise, is taken from them.
_LINE = 0.02
#: Twists of a push that differ by less than this share are one and the same.
_ALIKE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Rows (n,) of pushes in the order of the log.

    Attributes
    ----------
    names : list of str
        Trials, in the order of the log.
    trial : array of int, shape (n,)
        Number of each row's trial.
    order : array, shape (n,)
        Place of the trial in the log, from 0 to 1.
    time : array, shape (n,)
        In s, in the trial.
    pose, twist, acceleration, unsteady : array, shape (n, 3)
        Of the tracked frame in W; its body twist, the twist's rate of change, and how much that changes from row to row.
    wrench : array, shape (n, 3)
        Measured load in the tracked frame; NaN where there is none.
    pusher : array, shape (n, 3)
        Of the pusher's frame in W; NaN where there is none.
    normal : array, shape (n, 2, 2)
        Inward normals of the outline at the fingers, in B; NaN where a finger does not touch.
    place : array, shape (n, 2, 2)
        Contact points of the fingers in B.
    clearance : array, shape (n, 2)
        Distance of the fingers' centres from the outline less the nominal radius, in m.
    slip : array, shape (n,)
        Speed (m/s) at which the touching fingers move along the outline to the left of the normal; NaN if unknown.
    span : array, shape (n,)
        Time (s) over which the row's twist is a mean: noise of poses counts the less the longer it is.
    noise_gain : array, shape (n,)
        Standard deviation (1/s) of the row's twist over that of a pose.
    group : list of str
        Of each trial; blank if none.
    rest : tuple of arrays (m,) of int and (m, 2)
        Trials, and forces (N) in W, of readings before the push while no finger touches: what they read is the sensor's own.
    finger_radius : float or None
        In m: the rig's, else the distance at which fingers usually are from the outline; None if neither is known.
    columns : dict of str to array, shape (trials,)
        Columns of ``trials.csv``: numbers where all are, else words.
    still : list of str
        Trials in which the object stands, but for the noise: they have no rows.
    computed_moments : bool
        Whether moments are those of the measured forces at the contact point: nothing measured them.
    off : tuple of two floats
        Fingers, left and right of where the pusher faces, whose radius may be another, 1 or 0: both, unless one alone is off.
    """

    names: list[str]
    trial: np.ndarray
    order: FloatArray
    time: FloatArray
    pose: FloatArray
    twist: FloatArray
    acceleration: FloatArray
    unsteady: FloatArray
    wrench: FloatArray
    pusher: FloatArray
    normal: FloatArray
    place: FloatArray
    clearance: FloatArray
    slip: FloatArray
    span: FloatArray
    noise_gain: FloatArray
    group: list[str]
    rest: tuple[np.ndarray, FloatArray]
    finger_radius: float | None
    off: tuple[float, float]
    columns: dict[str, np.ndarray]
    still: list[str]
    computed_moments: bool = False

    @property
    def has_wrench(self) -> BoolArray:
        """Rows (n,) that have a load."""
        return np.asarray(np.isfinite(self.wrench).all(axis=1))

    @property
    def trial_order(self) -> FloatArray:
        """Place (trials,) of each trial in the log, from 0 to 1; the middle for those without rows."""
        result = np.full(len(self.names), 0.5)
        result[self.trial] = self.order
        return result

    @property
    def speed(self) -> FloatArray:
        """Speed (n,) of the body origin, in m/s."""
        return np.hypot(self.twist[:, 0], self.twist[:, 1])


def observe(log: PushLog) -> Observations:
    """Return the push rows of a log that have a pose and move."""
    s, names = log.samples, [str(name) for name in log.trials["trial"]]
    pushed = _pushed(log)
    blocks = _blocks_of(log, pushed)
    trial, time = blocks.trial, blocks.means(log.columns("t"))[:, 0]
    pose, twist = blocks.means(pushed.poses), blocks.means(pushed.twists)
    for i, (middle, motion) in blocks.ends.items():
        pose[i], twist[i] = middle, motion
    pusher, wrench = blocks.means(log.columns("px", "py", "ptheta")), blocks.means(log.columns("fx", "fy", "tau"))
    # nor does the mean of a whole push show where the pusher was
    pusher[list(blocks.ends)] = np.nan
    # a sensor that reads nothing at all carries no information on the load
    wrench[~np.abs(wrench).any(axis=1)] = np.nan
    # each contact point for itself: a finger may touch alone
    points = np.stack((blocks.means(log.columns("c1x", "c1y")), blocks.means(log.columns("c2x", "c2y"))), axis=1)
    radius, normal, place, clearance, slip = fingers_of(log, trial, time, pose, twist, pusher, points)
    begun = np.asarray(log.trials["start_time"], dtype=np.float64)
    rank = np.argsort(np.argsort(begun, kind="stable"), kind="stable") / max(1, len(names) - 1)
    group = [str(g) for g in log.trials["group"]] if "group" in log.trials else [""] * len(names)
    span = _spans(trial, time, blocks.whole)
    rested = {str(name) for name in s["trial"][s["phase"] == "rest"]} if "phase" in s else set()
    from_rest = np.array([name in rested for name in names], dtype=bool)
    acceleration, unsteady = _rates(trial, time, twist, span, from_rest)
    # where no finger touches and the sensor reads nothing, nothing pushes: after the object was lost
    touches = np.isfinite(place[:, 0, 0]) | np.isfinite(place[:, 1, 0])
    idle = np.isfinite(pusher).all(axis=1) & ~touches
    idle &= np.linalg.norm(wrench[:, :2], axis=1) <= _STANDS * (log.rig.noise.force if log.rig.noise else 0.0)
    idle |= _being_lost(trial, touches, pusher, np.linalg.norm(wrench[:, :2], axis=1))
    seen = Observations(
        names, trial, rank[trial], time, pose, twist, acceleration, unsteady, wrench, pusher,
        normal, place, clearance, slip, span, _noise_gain(log, blocks, span), group,
        _at_rest(log, names, pushed.rows, pushed.poses), radius,
        fingers_off(log, trial, clearance), {name: _column(values) for name, values in log.trials.items()},
        pushed.still, _moments_are_computed(log, np.asarray(pushed.usable)),
    )  # fmt: skip
    return rows_of(seen, np.flatnonzero(~idle))


class _Pushed(NamedTuple):
    """Rows of pushes by trial, poses and twists (n, 3) of all rows (NaN where the slider stands), which rows are usable (n,), and
    trials in which it stands."""

    rows: dict[str, np.ndarray]
    poses: FloatArray
    twists: FloatArray
    usable: BoolArray
    still: list[str]


def _pushed(log: PushLog) -> _Pushed:
    """Rows of pushes that have a pose and move."""
    s, poses, twists = log.samples, log.columns("x", "y", "theta"), log.twists()
    usable = np.isfinite(poses).all(axis=1) & np.isfinite(twists).all(axis=1)
    if "phase" in s:
        usable &= np.array([phase == "push" for phase in s["phase"]])
    size = np.linalg.norm(twists * (1, 1, log.rig.slider.characteristic_length), axis=1)
    if usable.any():
        usable &= size > max(_REST * float(np.median(size[usable])), LEAST_POSITIVE)
    seconds = np.asarray(s["t"], dtype=np.float64)
    rows, still = {}, []
    for name in map(str, log.trials["trial"]):
        rows[name] = np.flatnonzero((s["trial"] == name) & usable)
        everywhere = np.flatnonzero((s["trial"] == name) & np.isfinite(poses).all(axis=1))
        everywhere = everywhere[np.argsort(seconds[everywhere], kind="stable")]
        if _stands(poses[everywhere], log.rig.noise):
            # what noise makes of standing is no motion
            still.append(name)
            rows[name] = np.zeros(0, dtype=int)
            poses[everywhere] = np.nan
    return _Pushed(rows, poses, twists, np.asarray(usable), still)


class _Blocks(NamedTuple):
    """Blocks of rows whose means are the rows of the diagnosis, each with the number of its trial. ``ends``: middle and motion of
    those that are a push of which only the ends are known; ``whole``: times (s) of those that are a push as a whole."""

    parts: list[tuple[int, np.ndarray]]
    ends: dict[int, tuple[FloatArray, FloatArray]]
    whole: dict[int, float]

    @property
    def trial(self) -> np.ndarray:
        return np.array([k for k, _ in self.parts], dtype=int)

    def means(self, values: FloatArray) -> FloatArray:
        """Means (blocks, d) of the known rows of values (n, d)."""
        result = np.full((len(self.parts), values.shape[1]), np.nan)
        for i, (_, part) in enumerate(self.parts):
            known = np.isfinite(values[part]).all(axis=1)
            if known.any():
                result[i] = values[part][known].mean(axis=0)
        return result


def _blocks_of(log: PushLog, pushed: _Pushed) -> _Blocks:
    blocks, rho = _Blocks([], {}, {}), log.rig.slider.characteristic_length
    poses, twists, seconds = pushed.poses, pushed.twists, np.asarray(log.samples["t"], dtype=np.float64)
    size = np.linalg.norm(twists * (1, 1, rho), axis=1)
    for k, (name, rows) in enumerate(pushed.rows.items()):
        ordered = rows[np.argsort(seconds[rows], kind="stable")]
        number = len(blocks.parts)
        if len(ordered):
            ordered = ordered[: end_of_motion(poses[ordered], rho)]
            ordered = ordered[len(ordered) - end_of_motion(poses[ordered][::-1], rho) :]
            # where the log has one motion for all of a push, it is one row
            alike = len(ordered) > 2 and bool(np.ptp(twists[ordered], axis=0).max() <= _ALIKE * size[ordered].max())
            if alike:
                blocks.whole[number] = float(np.ptp(seconds[ordered]))
            parts = np.array_split(ordered, 1 if alike else min(len(ordered), _MOST_ROWS))
            blocks.parts.extend((k, part) for part in parts)
            continue
        # a log that only has the slider before and after the push: one row for all of it
        everywhere = log.samples["trial"] == name
        mine = np.flatnonzero(everywhere & np.isfinite(poses).all(axis=1) & np.isfinite(seconds))
        if len(mine) < 2:
            continue
        mine = mine[np.argsort(seconds[mine], kind="stable")]
        first, last = mine[0], mine[-1]
        offset = compose(inverse(poses[first]), poses[last])
        offset[2] = wrap_angle(offset[2])
        spent = float(seconds[last] - seconds[first])
        if distinct(seconds[[first, last]]).all() and np.abs(offset).max() > LEAST_POSITIVE:
            blocks.whole[number] = spent
            blocks.ends[number] = compose(poses[first], exp(log_of(offset) / 2)), log_of(offset) / spent
            blocks.parts.append((k, np.flatnonzero(everywhere)))
    return blocks


def _noise_gain(log: PushLog, blocks: _Blocks, span: FloatArray) -> FloatArray:
    """Standard deviations (n,) in 1/s of the blocks' twists, over that of a pose."""
    one_sided = _one_sided(log)
    # a mean of m differences over two rows each telescopes: four poses of a weight of 1/2m, more at the ends of a push
    at_end = [i not in blocks.whole and one_sided[part].any() for i, (_, part) in enumerate(blocks.parts)]
    gain = [_AT_END[min(len(part), 3) - 1] if end else 1.0 for end, (_, part) in zip(at_end, blocks.parts, strict=True)]
    noise_gain: FloatArray = np.array(gain) / span
    if log.rig.twist_window is not None and "vx" in log.samples:
        seen = [None if i in blocks.ends else part for i, part in enumerate(blocks.parts)]
        _of_slopes(log, seen, log.rig.twist_window, noise_gain)
    return noise_gain


def _moments_are_computed(log: PushLog, pushed: BoolArray) -> bool:
    """Whether the moments of all rows of pushes (n,) are the forces times their arm, to rounding.

    So an import has them where no sensor measures moments.
    """
    point, load = log.columns("c1x", "c1y"), log.columns("fx", "fy", "tau")
    rows = pushed & np.isfinite(point).all(axis=1) & np.isfinite(load).all(axis=1)
    arm, force = point[rows], load[rows, :2]
    off = np.abs(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0] - load[rows, 2])
    return bool(rows.any() and (off <= _ROUNDING * np.linalg.norm(arm, axis=1) * np.linalg.norm(force, axis=1)).all())


def rows_of(o: Observations, chosen: np.ndarray) -> Observations:
    """Return some rows of observations."""
    arrays = {f.name: getattr(o, f.name)[chosen] for f in fields(o) if isinstance(getattr(o, f.name), np.ndarray)}
    return replace(o, **arrays)


def pushes_of(groups: Sequence[str]) -> np.ndarray:
    """Numbers (trials,) of the pushes that trials repeat; a log that is one group says nothing of repeats."""
    together = len({g or k for k, g in enumerate(groups)}) > 1
    names = [(g, 0) if g and together else ("", k) for k, g in enumerate(groups)]
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.array([number[name] for name in names], dtype=int)


def _stands(poses: FloatArray, noise: Noise | None) -> bool:
    """Whether poses (n, 3) in the order of time are one, but for the stated noise: none is far off, nor do the means of the first
    and the second half differ. Without a stated noise they have to be the same."""
    half = len(poses) // 2
    if not half:
        return False
    sizes = np.zeros(3) if noise is None else np.array((noise.position, noise.position, noise.angle))
    off = poses - poses[0]
    off[:, 2] = wrap_angle(off[:, 2])
    moved = np.abs(off[:half].mean(axis=0) - off[-half:].mean(axis=0))
    far = np.abs(off - np.median(off, axis=0)).max(axis=0)
    return bool((far <= _STANDS * sizes).all() and (moved <= _STANDS * sizes * math.sqrt(2 / half)).all())


def _column(values: Any) -> np.ndarray:
    """A column as numbers, if all of it are."""
    try:
        return np.asarray([math.nan if value in ("", None) else value for value in values], dtype=np.float64)
    except (TypeError, ValueError):
        return np.asarray([str(value) for value in values])


def _at_rest(log: PushLog, names: list[str], pushes: dict[str, np.ndarray], poses: FloatArray) -> tuple[np.ndarray, FloatArray]:
    """Trials (m,) and forces (m, 2) in W of readings at rest, before the push, with the pusher away from the outline."""
    s = log.samples
    if "phase" not in s or log.rig.contact_kind == "held":
        return np.zeros(0, dtype=int), np.zeros((0, 2))
    times, force, pusher = log.columns("t")[:, 0], log.columns("fx", "fy"), log.columns("px", "py")
    good = np.isfinite(np.column_stack((poses, force, pusher, times))).all(axis=1) & (np.asarray(s["phase"]) == "rest")
    trials, rows = [], []
    for k, name in enumerate(names):
        begin = times[pushes[name]].min() if len(pushes[name]) else -np.inf
        mine = [i for i in log.rows(name) if good[i] and times[i] < begin]
        trials += [k] * len(mine)
        rows += mine
    trial, row = np.array(trials, dtype=int), np.array(rows, dtype=int)
    if len(row):
        centers = rotate_vectors(-poses[row, 2], pusher[row] - poses[row, :2])
        away = contacts_on_outline(log.rig.slider.vertices, centers)[2] - (log.rig.finger_radius or 0.0) > _AWAY
        trial, row = trial[away], row[away]
    return trial, rotate_vectors(poses[row, 2], force[row])


def _of_slopes(log: PushLog, blocks: Sequence[tuple[int, np.ndarray] | None], window: float, noise_gain: FloatArray) -> None:
    """Set the noise (1/s) of mean twists, over that of a pose, where twists are slopes of the poses within a window (s)."""
    times, poses = np.asarray(log.samples["t"], dtype=np.float64), log.columns("x", "y", "theta")
    usable = np.asarray(np.isfinite(poses).all(axis=1) & np.isfinite(times))
    logged = np.asarray(np.isfinite(log.columns("vx", "vy", "omega")).all(axis=1))
    last = -1
    for i, block in enumerate(blocks):
        if block is None or not logged[block[1]].all():
            continue
        k, part = block
        if k != last:
            last, rows = k, log.rows(str(log.trials["trial"][k]))
            rows = rows[usable[rows]]
            rows = rows[np.argsort(times[rows], kind="stable")]
            rows = rows[distinct(times[rows])]
            if len(rows) > 1:
                places, weights = slope_weights(times[rows], window)
                fresh = _fresh(poses[rows], log.rig.noise)
        mine = np.isin(rows, part)
        if len(rows) < 2 or not mine.any():
            continue
        total = np.zeros(len(rows))
        np.add.at(total, places[mine], weights[mine] / mine.sum())
        # noise that poses share does not average out
        noise_gain[i] = float(np.linalg.norm(total)) / math.sqrt(fresh)


def _fresh(poses: FloatArray, noise: Noise | None) -> float:
    """Share of the poses (n, 3), in the order of time, that are a tracker's own: not on a line between others, nor their repeats.

    Poses of a slow tracker on a faster clock have no noise of their own.
    """
    if noise is None or len(poses) < 3 or noise.position == 0:
        return 1.0
    bent = np.abs(np.diff(poses[:, :2], n=2, axis=0)).max(axis=1) > _LINE * noise.position
    return max(float(bent.mean()), 1.0 / len(poses))


def _spans(trial: np.ndarray, time: FloatArray, whole: dict[int, float]) -> FloatArray:
    """Times (n,) between rows; those of rows that are a push as a whole are given."""
    result = np.full(len(time), np.nan)
    for k in np.unique(trial):
        rows = np.flatnonzero(trial == k)
        if len(rows) > 1:
            result[rows] = max(1e-6, float(np.median(np.diff(time[rows]))))
    for row, span in whole.items():
        result[row] = max(1e-6, span)
    known = np.isfinite(result)
    result[~known] = float(np.median(result[known])) if known.any() else 1.0
    return result


def _being_lost(trial: np.ndarray, touches: BoolArray, pusher: FloatArray, force: FloatArray) -> BoolArray:
    """Rows (n,) in which the object is being lost: the last ones of a push, no finger touches, and the force falls away."""
    found = np.zeros(len(trial), dtype=bool)
    for k in np.unique(trial[touches]):
        rows = np.flatnonzero(trial == k)
        touching = rows[touches[rows]]
        after = rows[rows > touching[-1]]
        usual = force[touching][np.isfinite(force[touching])]
        least = _FALLEN * float(np.median(usual)) if len(usual) else 0.0
        gone = np.isfinite(pusher[after]).all(axis=1) & (force[after] < least)
        found[after[gone]] = True
    return found


def _one_sided(log: PushLog) -> BoolArray:
    """Rows (n,) whose twist is of one interval between poses, also where the log has twists: the ends of a trial."""
    poses = np.asarray(np.isfinite(log.columns("x", "y", "theta")).all(axis=1))
    found = np.zeros(len(poses), dtype=np.bool_)
    for name in log.trials["trial"]:
        rows = log.rows(name)
        known = rows[poses[rows]]
        if len(known):
            known = known[np.argsort(log.samples["t"][known], kind="stable")]
            found[known[[0, -1]]] = True
    return found


def _rates(
    trial: np.ndarray, time: FloatArray, values: FloatArray, span: FloatArray, from_rest: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Rates of change (n, k) of velocities (n, k), means over rows, by differences over the neighbouring rows, and what those to
    either side differ by. The first row of a trial that begins at rest begins at none."""
    result, off = np.zeros_like(values), np.zeros_like(values)
    for k in np.unique(trial):
        rows = np.flatnonzero(trial == k)
        if len(rows) < 2 or not distinct(time[rows]).all():
            continue
        result[rows] = np.gradient(values[rows], time[rows], axis=0)
        slopes = np.diff(values[rows], axis=0) / np.diff(time[rows])[:, None]
        off[rows[1:-1]] = np.diff(slopes, axis=0)
        if from_rest[k]:
            result[rows[0]] = (values[rows[0]] + values[rows[1]]) / 2 / span[rows[0]]
            off[rows[0]] = result[rows[0]] - slopes[0]
    return result, off


def beyond_noise(o: Observations, noise: FloatArray) -> FloatArray:
    """Accelerations (n, 3) less what noise (n, 3) of the twists makes of them, linear and angular apart.

    A slope against a measured quantity is too small by the share that noise has in its square; against ``(1 - share)`` times the
    quantity it is not (Fuller 1987, *Measurement error models*). So is a mass against accelerations. The share is that of the
    rows that are as many before the end of their push, or as many after its beginning.
    """
    result, place, ends = o.acceleration.copy(), np.zeros(len(o.trial), dtype=int), np.zeros(len(o.trial), dtype=bool)
    for trial in np.unique(o.trial):
        rows = np.flatnonzero(o.trial == trial)
        count = np.arange(len(rows))
        place[rows] = np.where(count < len(rows) / 2, count, count - len(rows))
        ends[rows[[0, -1]]] = True
    # differences over two rows, but for the first and the last
    spread = np.where(ends, 2.0, 0.5)
    for part in (slice(0, 2), slice(2, 3)):
        squares = (o.acceleration[:, part] ** 2).sum(axis=1)
        of_noise = spread * (noise[:, part] ** 2).sum(axis=1) / o.span**2
        for number in np.unique(place):
            rows = np.flatnonzero(place == number)
            share = min(1.0, float(of_noise[rows].sum()) / max(float(squares[rows].sum()), 1e-300))
            result[rows, part] *= 1 - share
    return result


def smeared(o: Observations, window: float | None, noise: FloatArray) -> FloatArray:
    """How far (n, 3) rows' twists are from those of their middles, where they are slopes of poses within a window (s), else 0.

    The slope of a line through ``x(t)`` is off by ``window² / 40`` times its third derivative; that is what second differences
    of the twists show beyond ``noise`` (n, 3) of each.
    """
    off = np.zeros_like(o.twist)
    if window is None:
        return off
    span = o.span[:, None]
    for trial in np.unique(o.trial):
        rows = np.flatnonzero(o.trial == trial)
        off[rows] = np.sqrt(np.maximum(0.0, (o.unsteady[rows] * span[rows]) ** 2 - 6.0 * noise[rows] ** 2)) / span[rows] ** 2
        if len(rows) > 2:
            off[rows[[0, -1]]] = np.maximum(off[rows[[0, -1]]], off[rows[[1, -2]]])
    return off * window**2 / 40


def contact_velocity(observations: Observations, finger: int) -> FloatArray:
    """Velocity (n, 2) in B of the slider's point at a finger."""
    v, p = observations.twist, observations.place[:, finger]
    return np.stack((v[:, 0] - v[:, 2] * p[:, 1], v[:, 1] + v[:, 2] * p[:, 0]), axis=-1)


def heading(observations: Observations) -> FloatArray:
    """Direction (n,) of motion over the table, rad in W."""
    o = observations
    return wrap_angle(o.pose[:, 2] + np.arctan2(o.twist[:, 1], o.twist[:, 0]))
