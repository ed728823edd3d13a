"""Intervals of shares."""

from __future__ import annotations

from scipy.special import betaincinv


def binomial_interval(successes: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of a probability after so many successes in ``count`` trials (Clopper and Pearson, 1934)."""
    tail = (1 - level) / 2
    low = betaincinv(successes, count - successes + 1, tail) if successes else 0.0
    high = betaincinv(successes + 1, count - successes, 1 - tail) if successes < count else 1.0
    return float(low), float(high)
