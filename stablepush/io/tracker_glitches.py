"""Poses that a tracker got wrong for a moment: the slider seems to leap away and back."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from stablepush.core import BoolArray, FloatArray, StablepushWarning

#: Rows of the running median, at least, and its width in s: glitches shorter than half of it do not move it. It leaves alone
#: what only grows or only shrinks, as a pose does in a push, and a slider that was set back.
_ROWS, _WIDTH = 7, 0.12
#: A glitch is so far (m) from that median, and so many times as far as rows usually are.
_FAR, _TIMES = 1e-3, 12.0
#: To be there between the rows beside it, the slider would be so many times as quick as in a push.
_QUICKER = 8.0


def without_glitches(
    t: FloatArray, poses: FloatArray, trials: Sequence[np.ndarray[Any, np.dtype[np.intp]]], length: float
) -> FloatArray:
    """Return poses (n, 3) without those that leap away and back, NaN instead; a warning says when.

    ``length`` (m) makes angles distances.
    """
    known, seen, away, speed, usual = [], [], [], [], 0.0
    for rows in trials:
        mine = rows[np.isfinite(poses[rows]).all(axis=1)]
        if len(mine) < _ROWS:
            continue
        path = poses[mine].copy()
        path[:, 2] = length * np.unwrap(path[:, 2])
        steps = np.diff(t[mine])
        count = min(max(_ROWS, 2 * round(_WIDTH / float(np.median(steps)) / 2) + 1), len(mine))
        smooth = np.column_stack([median_filter(column, count, mode="nearest") for column in path.T])
        known.append(mine)
        seen.append(path)
        away.append(np.linalg.norm(path - smooth, axis=1))
        speed.append(away[-1] / np.maximum(np.append(steps, steps[-1]), np.append(steps[0], steps)))
        usual = max(usual, float(np.percentile(np.linalg.norm(np.diff(smooth, axis=0), axis=1) / steps, 90)))
    far = max(_FAR, _TIMES * float(np.median(np.concatenate(away)))) if away else np.inf
    wrong = np.zeros(len(t), dtype=bool)
    for mine, path, distance, quick in zip(known, seen, away, speed, strict=True):
        for first, last in _runs(distance > far):
            # it comes back to where it was: a slider that was set back does not
            back = (
                0 < first
                and last + 1 < len(mine)
                and np.linalg.norm(path[last + 1] - path[first - 1]) < distance[first : last + 1].max() / 2
            )
            wrong[mine[first : last + 1]] = back and quick[first : last + 1].max() > _QUICKER * usual
    if not wrong.any():
        return poses
    when = ", ".join(f"{moment:.4g}" for moment in t[wrong][:5])
    later = " and later" if wrong.sum() > 5 else ""
    left_out = "1 pose is" if wrong.sum() == 1 else f"{int(wrong.sum())} poses are"
    warnings.warn(StablepushWarning(f"the tracker leaps away and back at t = {when}{later} s: {left_out} left out"), stacklevel=3)
    return np.where(wrong[:, None], np.nan, poses)


def _runs(flags: BoolArray) -> Iterator[tuple[int, int]]:
    """First and last index of each run of flags (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return ((int(first), int(last) - 1) for first, last in zip(edges[::2], edges[1::2], strict=True))
