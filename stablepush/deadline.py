"""Limits of time that do not count the building of compiled code."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager


class Deadline:
    """When a computation has to stop.

    Parameters
    ----------
    seconds : float
        Wall time from now, in s. Time that compiled code takes to be built inside :func:`within` is added to it: the first
        plan after an install would be over before it began.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._end = time.perf_counter() + seconds

    def left(self) -> float:
        """Return the time in s that is left, negative once it is over."""
        return self._end - time.perf_counter()

    def passed(self) -> bool:
        """Return whether the time is over."""
        return self.left() < 0

    def extend(self, seconds: float) -> None:
        """Add to the time."""
        self._end += seconds


@contextmanager
def within(seconds: float) -> Iterator[Deadline]:
    """Give a block a :class:`Deadline`, and add to it what compiled code takes to be built there."""
    # heavy to import, and of no use to those who only need the class
    from stablepush._compiled import when_built

    deadline = Deadline(seconds)
    with when_built(deadline.extend):
        yield deadline
