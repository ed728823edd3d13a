"""Poses that a tracker got wrong for a moment: the slider seems to leap away and back."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from stablepush.core import BoolArray, FloatArray, StablepushWarning
from stablepush.geometry import wrap_angle

#: Rows of the running median, at least, and its width in s: glitches shorter than half of it do not move it.
LEAST_ROWS, _WIDTH = 7, 0.12
#: A glitch is so far (m) from that median, and so many times as far as rows usually are.
_FAR, _TIMES = 1e-3, 12.0
#: The slider would be so many times as quick on its way as it is ever over so many s, windows left out of which one step makes
#: more than this share: there it was set back.
_QUICKER, _OVER, _MOST = 8.0, 0.3, 0.6
#: A tracker that has lost the slider may tell another place, as 0 or -9999, for up to this share of a trial; so far (m) away.
_LONGEST, _ELSEWHERE = 0.5, 5e-3
#: It is told in more rows than so many times as many as other poses.
_HELD = 3.0
#: It is told in more rows than so many times as many as other poses.
_HELD = 3.0
#: A force that leaps is so large a share of the greatest running median.
_LARGE = 0.5


def without_glitches(
    t: FloatArray,
    poses: FloatArray,
    trials: Sequence[np.ndarray[Any, np.dtype[np.intp]]],
    names: Sequence[str],
    length: float,
) -> FloatArray:
    """Return poses (n, 3) without those that leap away and back, NaN instead; a warning says when.

    What lies far from a running median may also be the pose before a slider turns round, or is set back: a glitch is quicker than
    the slider is in pushes, and comes back to where it was. ``length`` (m) makes angles distances.
    """
    known, found, usual = [], [], []
    for rows in trials:
        mine = rows[np.isfinite(poses[rows]).all(axis=1)]
        if len(mine) < LEAST_ROWS:
            continue
        seen, steps = poses[mine], np.diff(t[mine])
        steps = np.maximum(steps, np.median(steps) / 2)
        smooth = _running_median(seen, rows_of_median(steps))
        known.append(mine)
        # a tracker that is slower than the clock repeats its poses: it took as long since the first of them
        since = np.maximum.accumulate(
            np.where(np.append(True, (np.diff(seen, axis=0) != 0).any(axis=1)), np.arange(len(mine)), 0)
        )
        took = np.maximum(t[mine][1:] - t[mine][since[:-1]], steps)
        found.append((_apart(smooth, seen, length), _apart(seen[:-1], seen[1:], length) / took, seen))
        span = min(max(2, round(_OVER / float(np.median(steps)))), len(mine) - 1)
        usual.append(_greatest_speed(t[mine], smooth, span, length))
    if not known:
        return poses
    far = max(_FAR, _TIMES * float(np.median(np.concatenate([away for away, *_ in found]))))
    quick = _QUICKER * float(np.median(usual))
    wrong, when = np.zeros(len(t), dtype=bool), []
    for mine, (away, speed, seen) in zip(known, found, strict=True):
        for first, last in runs_of(away > far):
            if 0 < first and last + 1 < len(mine):
                back = _apart(seen[first - 1 : first], seen[last + 1 : last + 2], length)[0] < away[first : last + 1].max() / 2
                if back and speed[first - 1 : last + 1].max() > quick:
                    wrong[mine[first : last + 1]] = True
                    when.append(int(mine[first]))
        for first, last in _placeholders(seen, speed > quick, length):
            if not wrong[mine[first : last + 1]].all():
                wrong[mine[first : last + 1]] = True
                when.append(int(mine[first]))
    if not when:
        return poses
    tell_leaps("the tracker leaps", "pose", t, trials, names, when, int(wrong.sum()))
    return np.where(wrong[:, None], np.nan, poses)


def tell_leaps(
    what: str, one: str, t: FloatArray, trials: Sequence[np.ndarray[Any, np.dtype[np.intp]]], names: Sequence[str],
    when: Sequence[int], count: int,
) -> None:  # fmt: skip
    """Warn of leaps that begin in rows ``when``."""
    first = min(when)
    trial = next(k for k, rows in enumerate(trials) if first in rows)
    place = f"{t[first] - t[trials[trial][0]]:.4g} s after the first row" + (f" of push {names[trial]}" if names[trial] else "")
    times = "once," if len(when) == 1 else f"{len(when)} times, at first"
    left_out = f"1 {one} is" if count == 1 else f"{count} {one}s are"
    warnings.warn(StablepushWarning(f"{what} away and back {times} {place}: {left_out} left out"), stacklevel=4)


def _placeholders(seen: FloatArray, quick: BoolArray, length: float) -> Iterator[tuple[int, int]]:
    """First and last index of runs of poses (n, 3) that are far from where the slider was before and is after; ``quick``
    (n - 1,): which steps no slider makes."""
    steps = np.flatnonzero(quick & (_apart(seen[:-1], seen[1:], length) > _ELSEWHERE))
    # a tracker that is slower than the rows repeats its poses
    usual = float(np.median(np.diff(np.flatnonzero(np.append((np.diff(seen, axis=0) != 0).any(axis=1), True)), prepend=-1)))
    k = 0
    while k + 1 < len(steps):
        leaves, returns = int(steps[k]), int(steps[k + 1])
        before, away, after = seen[leaves : leaves + 1], seen[leaves + 1 : returns + 1], seen[returns + 1 : returns + 2]
        back = _apart(before, after, length)[0] < np.median(_apart(before, away, length)) / 2
        # a lost slider is told at one place, which no tracker does of one that it sees
        if back and _HELD * usual < len(away) <= _LONGEST * len(seen) and not np.ptp(away, axis=0).any():
            yield leaves + 1, returns
            k += 1
        k += 1


def _greatest_speed(t: FloatArray, poses: FloatArray, span: int, length: float) -> float:
    """Greatest speed (m/s) over ``span`` steps that several of them make."""
    ways = _apart(poses[:-span], poses[span:], length)
    largest = maximum_filter1d(_apart(poses[:-1], poses[1:], length), span, origin=-(span // 2))[: len(ways)]
    by_many = largest <= _MOST * ways
    return float((ways / (t[span:] - t[:-span]))[by_many].max(initial=0.0))


def rows_of_median(steps: FloatArray) -> int:
    """Return over how many rows, an odd number, a running median goes, for times (s) from row to row (n - 1,)."""
    count = max(LEAST_ROWS, 2 * round(_WIDTH / float(np.median(steps)) / 2) + 1)
    return min(count, len(steps) + (len(steps) + 1) % 2)


def _running_median(poses: FloatArray, count: int) -> FloatArray:
    """Medians (n, 3) over an odd number of rows about each: of a heading, of its cosine and sine."""
    x, y, theta = poses.T
    of = [median_filter(column, count, mode="nearest") for column in (x, y, np.cos(theta), np.sin(theta))]
    return np.column_stack((of[0], of[1], np.arctan2(of[3], of[2])))


def _apart(one: FloatArray, other: FloatArray, length: float) -> FloatArray:
    """Distances (n,) in m of poses (n, 3)."""
    return np.asarray(np.hypot(*(other - one)[:, :2].T) + length * np.abs(wrap_angle(other[:, 2] - one[:, 2])))


def runs_of(flags: BoolArray) -> Iterator[tuple[int, int]]:
    """First and last index of each run of flags (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return ((int(first), int(last) - 1) for first, last in zip(edges[::2], edges[1::2], strict=True))
