"""Intervals of shares, against scipy's."""

import pytest
from scipy.stats import binomtest

from stablepush.core import binomial_interval


@pytest.mark.parametrize(("successes", "count"), [(0, 0), (0, 10), (10, 10), (3, 10), (1987, 2000)])
@pytest.mark.parametrize("level", [0.95, 0.999])
def test_intervals_are_those_of_scipy(successes, count, level):
    expected = binomtest(successes, count).proportion_ci(level) if count else (0.0, 1.0)
    assert binomial_interval(successes, count, level) == pytest.approx(tuple(expected), abs=1e-9)
