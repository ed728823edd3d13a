"""What a record of poses and forces shows of its pushes: where each begins and ends, its speed, its phases."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from stablepush.core import BoolArray, FloatArray, InputError, StablepushWarning, shown
from stablepush.geometry import point_velocity, rotate_vectors, transform_points
from stablepush.io.pushlog import end_of_motion
from stablepush.io.sensor_offset import LEAST_REST, is_clear
from stablepush.objects import Slider

#: Share of the speed of the fastest point of the outline, of the greatest in the trial, above which the slider moves.
_MOVES = 0.15
#: Share of the 95th percentile of that speed in a trial above which the slider slips steadily.
SLIPS = 0.3
#: A trial in which no point of the outline travels so far (m) is of no push.
LEAST_TRAVEL = 3e-4
#: Rest ends where the force has made this share of the step to that of the slip; contact ends where less of it is left. A step
#: that is a smaller share of the load is none: the trial has no rest.
_STEP, _LEFT, _LEAST_STEP = 0.3, 0.1, 0.3
#: A slider that travels no farther (m) than noise takes its median rests.
_STILL = 1e-4
#: A new trial begins after so many seconds in which the slider rests; so many before it moves are kept.
_PAUSE, _BEFORE = 0.5, 1.0
#: Speed of a slow push over that of the fastest.
_SLOW = 0.05
#: A slow push moves the slider so far (m) at least.
_SLOW_TRAVEL = 2e-3
#: A slider that is so far (m) from where it was in the row before, and was this many times as quick as usual, was set back.
_JUMP, _QUICKER = 5e-3, 8.0
#: A tip that stands for more rows has stopped.
_FEW = 2
#: Percentile of the speed in a record that stands for its pushes: most of the time a slider may rest.
_QUICKEST = 98
#: Rows are missing where two are so many usual steps and so many seconds apart.
_STEPS, _GAP = 5.0, 0.15
#: Windows (s) of slopes, and how far two that follow each other may differ by noise, over the speed of pushes: of twists, and
#: of speeds that tell where pushes are, which many rows have to agree on.
WINDOWS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
NOISY_TWISTS, NOISY_SPEEDS = 0.15, 0.1
#: A push goes so many times as far as noise does (its median) among the hundreds of times that noise looks like motion.
_SURELY = 6.0
#: Rows whose median begins and ends a trial.
_ENDS = 5
#: Where a threshold of the force is less than so many standard deviations of its noise, single rows pass it by chance.
_CLEAR_OF_NOISE = 6.0
#: There it is raised to so many of them, up to half of the load, and most of so many rows have to be beyond it: of rows at rest
#: 1 % are, and three of five in 1e-5.
_RAISED, _AGREEING = 3.0, 5


def named_rows(t: FloatArray, trials: Sequence[str]) -> tuple[list[np.ndarray[Any, np.dtype[np.intp]]], list[str]]:
    """Rows of each trial that is named, and the names."""
    try:
        words = ["" if word is None or word != word else str(word) for word in trials]  # noqa: PLR0124 (NaN)
    except TypeError:
        raise InputError("trials", "expected a list of names", type(trials).__name__) from None
    if len(words) != len(t):
        raise InputError("trials", f"expected {len(t)} names, one for each row", len(words))
    groups: dict[str, list[int]] = {word: [] for word in words if word}
    latest = ""
    for row, word in enumerate(words):
        if word:
            if groups[word] and word != latest:
                raise InputError(
                    f"trials[{row}]", f"expected the rows of a push to follow each other, {shown(word)} is there twice"
                )
            groups[word].append(row)
            latest = word
    return [np.array(rows, dtype=np.intp) for rows in groups.values()], list(groups)


def pushes_in(
    slider: Slider, t: FloatArray, body: FloatArray, window: float | None
) -> tuple[list[np.ndarray[Any, np.dtype[np.intp]]], list[str]]:
    """Rows of each push of a record: where the slider moves, and before. ``window``: None for as long a one as noise needs."""
    jumps = _jumps(slider, t, body)
    if len(jumps):
        when = ", ".join(f"{t[k]:.4g}" for k in jumps[:5])
        later = " and later" if len(jumps) > 5 else ""
        words = f"the slider jumps before t = {when}{later} s: a new push is taken to begin there"
        warnings.warn(StablepushWarning(words), stacklevel=3)
    # what happens while nothing is recorded is no motion
    steps = np.diff(t)
    gaps = 1 + np.flatnonzero(steps > max(_BEFORE, largest_step(steps)))
    pieces = np.split(np.arange(len(t)), np.union1d(jumps, gaps))
    window = window or window_for(slider, t, body, pieces, NOISY_SPEEDS)
    speeds = [speeds_of(slider, twists_of(t[piece], body[piece], window)) for piece in pieces]
    most = max(float(speed.max()) for speed in speeds)
    found, noise = [], _noise_of_travel(slider, body)
    for piece, speed in zip(pieces, speeds, strict=True):
        # a push may be far slower than another one
        moving = piece[speed > _MOVES * max(float(speed.max()), _SLOW * most)]
        if not len(moving):
            continue
        cuts, done = np.flatnonzero(np.diff(t[moving]) > _PAUSE), int(piece[0])
        firsts, lasts = moving[np.concatenate(([0], cuts + 1))], moving[np.concatenate((cuts, [len(moving) - 1]))]
        # what is far slower than a push elsewhere may be a tracker that drifts
        least = max(LEAST_TRAVEL if float(speed.max()) > _MOVES * most else _SLOW_TRAVEL, _SURELY * noise)
        for first, last in zip(firsts, lasts, strict=True):
            begin = max(int(np.searchsorted(t, t[first] - _BEFORE)), done)
            # noise of a tracker is as quick as a slow push, and leads nowhere
            if travel(slider, body[max(begin, first - _ENDS) : min(last + _ENDS, piece[-1]) + 1]) >= least:
                found.append(np.arange(begin, last + 1))
                done = int(last) + 1
    return found, [str(k + 1) for k in range(len(found))]


def noise_of_rows(slider: Slider, t: FloatArray, poses: FloatArray) -> float:
    """By how much (m) the places of a slider at rest differ from row to row (median), be rows named or not.

    From how far each row lies beside the line through its neighbours; across gaps of the record there is none.
    """
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    steps = np.diff(t[known])
    bent = [np.zeros(0)]
    for piece in np.split(known, 1 + np.flatnonzero(steps > largest_step(steps))):
        seen = poses[piece].copy()
        seen[:, 2] = np.unwrap(seen[:, 2])
        places = transform_points(seen, slider.vertices)
        bent.append(np.linalg.norm(places[2:] - 2 * places[1:-1] + places[:-2], axis=-1).max(axis=1, initial=0.0))
    # a - 2 b + c scatters sqrt(3) times as much as a - b
    return float(np.median(np.concatenate(bent))) / math.sqrt(3) if any(map(len, bent)) else 0.0


def _noise_of_travel(slider: Slider, poses: FloatArray) -> float:
    """Median of the noise of :func:`travel` (m), from how far blocks of poses lie beside the middle of their neighbours."""
    known = poses[np.isfinite(poses).all(axis=1)]
    known[:, 2] = np.unwrap(known[:, 2])
    blocks = np.median(known[: len(known) // _ENDS * _ENDS].reshape(-1, _ENDS, 3), axis=1)
    if len(blocks) < 3:
        return 0.0
    places = transform_points(blocks, slider.vertices)
    bent = np.linalg.norm(places[2:] - 2 * places[1:-1] + places[:-2], axis=-1).max(axis=1)
    # a - 2 b + c scatters sqrt(3) times as much as a - b
    return float(np.median(bent)) / math.sqrt(3)


def _jumps(slider: Slider, t: FloatArray, body: FloatArray) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Rows at which the slider is far from where it was, faster than any push takes it there: it was set back."""
    known = np.flatnonzero(np.isfinite(body).all(axis=1))
    places = transform_points(body[known], slider.vertices)
    way = np.linalg.norm(np.diff(places, axis=0), axis=-1).max(axis=1, initial=0.0)
    rate = way / np.diff(t[known])
    if not (way > _JUMP).any():
        return np.zeros(0, dtype=np.intp)
    usual = float(np.median(rate[rate > _MOVES * np.percentile(rate, 90)]))
    return known[1:][(way > _JUMP) & (rate > _QUICKER * usual)]


def phases_of(
    slider: Slider,
    poses: FloatArray,
    speed: FloatArray,
    forces: FloatArray | None,
    away: FloatArray | None = None,
    tips: FloatArray | None = None,
    noise: float = 0.0,
) -> np.ndarray[Any, np.dtype[np.object_]]:
    """Phases (n,) of a trial: ``push`` from the step of the force to where it is gone; without forces, while the slider moves.

    ``away``: clearances (n,) in m of the finger. Before the push the sensor rests where the tip is away; before
    that a finger may press that has ended another push, in ``approach``. ``tips`` (n, 2 or 3): a push ends where
    the tip stops. ``noise`` (m): by how much two rows of a slider at rest differ, as :func:`noise_of_rows` has it.
    """
    phases = np.full(len(speed), "push", dtype=object)
    moving = np.flatnonzero(speed > _MOVES * speed.max())
    surely = _SURELY * noise / math.sqrt(_rows_of_ends(poses))
    if not len(moving) or travel(slider, poses) < max(LEAST_TRAVEL, surely):
        # of what is not seen to move no load is made
        phases[:] = "rest"
        return phases
    # noise of a tracker is as quick as a slow push, and leads nowhere
    begin, end = _in_motion(slider, poses, speed, away, moving)
    middle = slice(begin + (end - begin) // 4, end - (end - begin) // 4)
    if forces is None or not np.isfinite(forces[middle]).all(axis=1).any():
        # forces that are known at its ends only are those of rests
        phases[:begin], phases[end:] = "rest", "retract"
        return phases
    known = np.asarray(np.isfinite(forces).all(axis=1))
    steady = known & (speed >= SLIPS * np.percentile(speed, 95))
    moves = (np.arange(len(speed)) >= begin) & (np.arange(len(speed)) < end)
    steady = steady & moves if (steady & moves).any() else steady
    load, zero = np.median(forces[steady], axis=0), np.zeros(2)
    first_steady = int(np.argmax(steady))
    clear = np.zeros(0, dtype=int) if away is None else np.flatnonzero((is_clear(away, steady) & known)[:first_steady])
    # nothing moves a slider that nothing touches
    still = max(LEAST_TRAVEL, _SURELY * _noise_of_travel(slider, poses))
    if len(clear) >= LEAST_REST and travel(slider, poses[: clear[-1] + 1]) < still:
        zero = np.median(forces[clear], axis=0)
        step = _STEP * float(np.linalg.norm(load - zero))
        pressed = _beyond(forces, zero, _STEP, load)
        pressed[: clear[-1] + 1] = False
        begin = int(np.argmax(pressed)) if pressed.any() else first_steady
        phases[:begin] = "rest"
        phases[:begin][known[:begin] & (_size(forces[:begin] - zero) > step)] = "approach"
    else:
        zero = _of_step(slider, poses, speed, forces, phases, load)
    left = np.flatnonzero(_beyond(forces[::-1], zero, _LEFT, load)[::-1])
    if len(left) and left[-1] >= moving[0]:
        phases[left[-1] + 1 :] = "retract"
    # a finger that has stopped may press on
    pushed = np.flatnonzero((phases == "push") & np.isfinite(poses).all(axis=1))
    if len(pushed):
        stands = end_of_motion(poses[pushed], slider.characteristic_length)
        seen = pushed[:0] if tips is None else pushed[np.isfinite(tips[pushed]).all(axis=1)]
        if tips is not None and len(seen):
            # a robot knows better than a tracker when it stops
            path = np.column_stack((tips[seen], np.zeros((len(seen), 3 - tips.shape[1]))))
            stops = end_of_motion(path, slider.characteristic_length, _FEW)
            stands = min(stands, int(np.searchsorted(pushed, seen[stops - 1])) + 1) if stops < len(seen) else stands
        if stands < len(pushed):
            phases[pushed[stands] :] = "retract"
    return phases


def _beyond(forces: FloatArray, zero: FloatArray, share: float, load: FloatArray) -> BoolArray:
    """Rows (n,) in which a force has made a share of the step from ``zero`` to ``load``, not by noise alone.

    The noise of readings (n, 2) is that of their differences from row to row: nine of ten ``|Δf|`` are below ``3.035 σ``, also of
    a sensor with steps that are coarser than its noise.
    """
    step, changes = float(np.linalg.norm(load - zero)), np.linalg.norm(np.diff(forces, axis=0), axis=1)
    noise = float(np.nanquantile(changes, 0.9)) / 3.035 if np.isfinite(changes).any() else 0.0
    size, least = _size(forces - zero), share * step
    if least > _CLEAR_OF_NOISE * noise:
        return np.asarray(size > least)
    beyond = size > max(least, min(_RAISED * noise, step / 2))
    sums = np.concatenate(([0], np.cumsum(beyond)))
    ends = np.minimum(np.arange(len(beyond)) + _AGREEING, len(beyond))
    lasting = beyond & (2 * (sums[ends] - sums[:-1]) > ends - np.arange(len(beyond)))
    return np.asarray(lasting if lasting.any() else beyond)


def _in_motion(
    slider: Slider, poses: FloatArray, speed: FloatArray, away: FloatArray | None, moving: np.ndarray[Any, np.dtype[np.intp]]
) -> tuple[int, int]:
    """First row in which a slider moves, and the row after the last; of the rows that are as quick as motion is, some may be
    noise of the tracker: before it leaves the place where it stood, after it stands for good, and while the finger is away."""
    begin, end = int(moving[0]), int(moving[-1]) + 1
    seen = np.flatnonzero(np.isfinite(poses).all(axis=1))
    first, last = (
        end_of_motion(poses[seen[::-1]], slider.characteristic_length),
        end_of_motion(poses[seen], slider.characteristic_length),
    )
    begin, end = max(begin, int(seen[len(seen) - first])), min(end, int(seen[last - 1]) + 1)
    steady = speed >= SLIPS * np.percentile(speed, 95)
    if away is not None and steady[begin:end].any():
        clear = is_clear(away, steady)
        pushed = begin + np.flatnonzero(steady[begin:end] & ~clear[begin:end])
        if len(pushed):
            before, after = np.flatnonzero(clear[begin : pushed[0]]), np.flatnonzero(clear[pushed[-1] : end])
            begin, end = begin + (int(before[-1]) + 1 if len(before) else 0), pushed[-1] + int(after[0]) if len(after) else end
    return begin, end


def _of_step(
    slider: Slider,
    poses: FloatArray,
    speed: FloatArray,
    forces: FloatArray,
    phases: np.ndarray[Any, np.dtype[np.object_]],
    load: FloatArray,
) -> FloatArray:
    """Set the rest of a trial whose tip may touch from the first, by the step of the force; return what the sensor reads."""
    known = np.asarray(np.isfinite(forces).all(axis=1))
    # few rows may come before the step: one, in the worst case
    for count in (LEAST_REST, 1):
        first = np.median(forces[np.flatnonzero(known)[:count]], axis=0)
        step, size = float(np.linalg.norm(load - first)), float(np.linalg.norm(load))
        # a single row must read next to nothing
        if step <= _LEAST_STEP * size or (count == 1 and float(np.linalg.norm(first)) > _STEP * size):
            continue
        rest = int(np.argmax(_beyond(forces, first, _STEP, load)))
        # a force that grows while the slider moves is no step from rest
        share = rest / len(speed)
        if rest and travel(slider, poses[:rest]) < SLIPS * share * travel(slider, poses) + _STILL:
            phases[:rest] = "rest"
            return np.median(forces[:rest][known[:rest]], axis=0) if rest >= LEAST_REST else np.zeros(2)
    return np.zeros(2)


def window_for(
    slider: Slider, t: FloatArray, body: FloatArray, pieces: Sequence[np.ndarray[Any, np.dtype[np.intp]]], noisy: float
) -> float:
    """Return the shortest of the :data:`WINDOWS` whose slopes are not ``noisy``.

    Most of the time a slider rests or is pushed steadily: what slopes of two windows that follow each other differ by is noise,
    be it of one row, or of several that are interpolated. Where rows are so far apart that the longest has none but a row's
    neighbours it is the shortest: they are all alike.
    """
    steps = [np.diff(t[piece]) for piece in pieces if len(piece) > 1]
    if not steps or float(np.median(np.concatenate(steps))) > WINDOWS[-1] / 2:
        return WINDOWS[0]
    for window in WINDOWS[:-1]:
        speeds, changes = [], []
        for piece in pieces:
            velocity = point_velocity(twists_of(t[piece], body[piece], window), slider.vertices)
            later = np.minimum(np.searchsorted(t[piece], t[piece] + window), len(piece) - 1)
            follows = np.abs(t[piece][later] - t[piece] - window) < window / 2
            speeds.append(np.linalg.norm(velocity, axis=-1).max(axis=1))
            changes.append(np.linalg.norm(velocity[later] - velocity, axis=-1).max(axis=1)[follows])
        change, speed = np.concatenate(changes), np.concatenate(speeds)
        if not np.isfinite(change).any() or np.nanmedian(change) <= noisy * np.nanpercentile(speed, _QUICKEST):
            return window
    return WINDOWS[-1]


def twists_of(t: FloatArray, poses: FloatArray, window: float) -> FloatArray:
    """Twists (n, 3) in B: slopes of lines through the poses in W within ``window``, at least those of the neighbours.

    Across a gap of the tracker or of the record nobody knows how the slider moved: no line goes through it.
    """
    twists = np.full((len(t), 3), np.nan)
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    if len(known) < 2:
        return twists
    steps = np.diff(t[known])
    gaps = 1 + np.flatnonzero(steps > largest_step(steps))
    for run in np.split(known, gaps):
        if len(run) < 2:
            continue
        seen = poses[run].copy()
        seen[:, 2] = np.unwrap(seen[:, 2])
        places, weights = slope_weights(t[run], window)
        velocity = np.einsum("nw,nwk->nk", weights, seen[places] - seen[:, None])
        velocity[:, :2] = rotate_vectors(-seen[:, 2], velocity[:, :2])
        twists[run] = velocity
    return twists


def bridged(t: FloatArray, poses: FloatArray) -> FloatArray:
    """Poses (n, 3) with those that are missing between two known ones put on a straight line.

    They tell when the slider was moved while nobody saw it, and nothing else: no load or twist is made of them.
    """
    known = np.isfinite(poses).all(axis=1)
    if known.all() or known.sum() < 2:
        return poses
    seen = poses[known].copy()
    seen[:, 2] = np.unwrap(seen[:, 2])
    return np.column_stack([np.interp(t, t[known], column, np.nan, np.nan) for column in seen.T])


def largest_step(steps: FloatArray) -> float:
    """Return the largest time (s) between two rows of a record with such steps (n,) beyond which rows are missing."""
    return max(_STEPS * float(np.median(steps)), _GAP) if len(steps) else _GAP


def slope_weights(t: FloatArray, window: float) -> tuple[np.ndarray, FloatArray]:
    """Return the rows (n, w) within ``window`` of each, and the weights (n, w) in 1/s of their values in the slope there.

    Least squares; the neighbours are always within. Places that are none have weight 0.
    """
    rows, half = np.arange(len(t)), window / 2 * (1 + 1e-9)
    low = np.minimum(np.searchsorted(t, t - half), np.maximum(rows - 1, 0))
    high = np.maximum(np.searchsorted(t, t + half, side="right"), np.minimum(rows + 2, len(t)))
    # a row of the window's numbers for each row of the log
    places = low[:, None] + np.arange(int((high - low).max()))
    within = places < high[:, None]
    places = np.minimum(places, len(t) - 1)
    times = np.where(within, t[places] - t[:, None], 0.0)
    times = np.where(within, times - (times.sum(axis=1) / within.sum(axis=1))[:, None], 0.0)
    return places, times / (times**2).sum(axis=1)[:, None]


def speeds_of(slider: Slider, twists: FloatArray) -> FloatArray:
    """Speeds (n,) in m/s of the fastest point of the outline; 0 where nothing is known."""
    return np.nan_to_num(np.linalg.norm(point_velocity(twists, slider.vertices), axis=-1).max(axis=1))


def travel(slider: Slider, poses: FloatArray) -> float:
    """How far (m) the farthest going point of the outline goes, from the median of the first to that of the last poses (n, 3)."""
    known = poses[np.isfinite(poses).all(axis=1)]
    if len(known) < 2:
        return 0.0
    known[:, 2] = np.unwrap(known[:, 2])
    count = _rows_of_ends(known)
    first, last = (transform_points(np.median(part, axis=0), slider.vertices) for part in (known[:count], known[-count:]))
    return float(np.linalg.norm(last - first, axis=1).max())


def _rows_of_ends(poses: FloatArray) -> int:
    """How many rows of poses (n, 3), of which none or some are missing, have a median at either end of :func:`travel`."""
    return min(_ENDS, max(1, int(np.isfinite(poses).all(axis=1).sum()) // 3))


def _size(vectors: FloatArray) -> FloatArray:
    """Lengths (n,) of vectors (n, 2); 0 where one is missing."""
    return np.nan_to_num(np.linalg.norm(vectors, axis=1))
