"""Student errors, and scales that a few rows that are far off do not change."""

from __future__ import annotations

from typing import Any

import numpy as np

from stablepush.core import FloatArray

#: Degrees of freedom of the row errors (Student): rows that are far off count less.
TAIL = 5.0
#: Median of the squares of unit Gaussian noise.
_MEDIAN = 0.455


def robust_variance(squares: FloatArray, axis: int | None = None) -> Any:
    """Return the mean square of Gaussian noise whose squares have this median: a few that are far off do not count."""
    return np.median(squares, axis=axis) / _MEDIAN


def robust_scale(residual: FloatArray, least: float) -> float:
    """Robust mean square of residuals, in units of the noise, and at least ``least``."""
    return max(least, float(robust_variance(residual**2))) if len(residual) else 1.0


def student_weights(residual: FloatArray, scale: float) -> FloatArray:
    """Weights (n,) of residuals whose errors are Student's with this scale: rows that are far off count less."""
    return np.asarray((TAIL + 1) / (TAIL + residual**2 / scale))


def student_density(residual: FloatArray, scale: float) -> FloatArray:
    """Log density (n,) of residuals whose errors are Student's with this scale, but for a constant."""
    return np.asarray(-0.5 * (TAIL + 1) * np.log1p(residual**2 / (TAIL * scale)) - 0.5 * np.log(scale))


def by_trial(trial: np.ndarray, rows: FloatArray) -> FloatArray:
    """Sums (trials, d) of rows (n, d)."""
    count = int(trial.max()) + 1 if len(trial) else 1
    sums = [np.bincount(trial, rows[:, k], minlength=count) for k in range(rows.shape[1])]
    return np.array(sums, dtype=np.float64).reshape(rows.shape[1], count).T
