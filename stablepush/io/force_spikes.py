"""Forces that are wrong for a moment: a sensor drops a word, or somebody knocks against the table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from stablepush.core import FloatArray
from stablepush.io.tracker_glitches import LEAST_ROWS, rows_of_median, runs_of, tell_leaps

#: A spike is so many times as far from a running median as rows usually are, and so large a share of the greatest median.
_TIMES, _LARGE = 12.0, 0.5


def without_spikes(
    t: FloatArray, forces: FloatArray, trials: Sequence[np.ndarray[Any, np.dtype[np.intp]]], names: Sequence[str]
) -> FloatArray:
    """Return forces (n, 2) without those that leap far from a running median and back, NaN instead; a warning says when.

    A force that slides an object is that of friction: it has no spikes of its own size.
    """
    wrong, when = np.zeros(len(t), dtype=bool), []
    for rows in trials:
        mine = rows[np.isfinite(forces[rows]).all(axis=1)]
        if len(mine) < LEAST_ROWS:
            continue
        seen, count = forces[mine], rows_of_median(np.diff(t[mine]))
        smooth = np.column_stack([median_filter(column, count, mode="nearest") for column in seen.T])
        away, size = np.linalg.norm(seen - smooth, axis=1), np.linalg.norm(smooth - np.median(smooth, axis=0), axis=1)
        far = max(_TIMES * float(np.median(away)), _LARGE * float(max(size.max(), np.linalg.norm(smooth, axis=1).max())))
        for first, last in runs_of(away > far):
            beside = [k for k in (first - 1, last + 1) if 0 <= k < len(mine)]
            # of a step the rows on one side stay
            if last - first + 1 < count / 2 and all(away[k] < far / 2 for k in beside):
                wrong[mine[first : last + 1]] = True
                when.append(int(mine[first]))
    if not when:
        return forces
    tell_leaps("the force leaps", "force", t, trials, names, when, int(wrong.sum()))
    return np.where(wrong[:, None], np.nan, forces)
