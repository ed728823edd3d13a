"""Pictures of how far probabilities can be believed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import binomial_interval
from stablepush.views.plot.canvas import CLOCKWISE, COUNTER_CLOCKWISE, panels


def plot_calibration(
    bins: Sequence[tuple[float, float, int]], coverage: Sequence[tuple[float, float]], ax: ArrayLike | None = None
) -> np.ndarray:
    """Draw the reliability of reported probabilities, and accuracy against coverage.

    Left: bins of (reported, true, count) with 95 % intervals. Right: accuracy among the most certain share
    of the cases. Draws into two axes, which are returned.
    """
    shown = panels((9.0, 4.2), 1, 2, ax)[0]
    left, right = shown
    left.plot((0, 1), (0, 1), color="#BBBBBB", linewidth=1)
    for reported, true, count in bins:
        left.plot((reported, reported), binomial_interval(round(true * count), count), color=COUNTER_CLOCKWISE, linewidth=1)
        left.plot(reported, true, marker="o", color=COUNTER_CLOCKWISE)
        left.annotate(str(count), (reported, true), textcoords="offset points", xytext=(6, 4), fontsize=8)
    left.set(xlabel="reported probability", ylabel="share that acts", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    if coverage:
        right.plot(*zip(*coverage, strict=True), color=CLOCKWISE)
    right.set(xlabel="share of sets, most certain first", ylabel="most probable effect acts", xlim=(0, 1), ylim=(0, 1.02))
    return shown
