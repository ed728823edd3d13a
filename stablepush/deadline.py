"""Limits of time that do not count the building of compiled code."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Deadline:
    """When a computation has to stop.

    Parameters
    ----------
    seconds : float
        Wall time from now, in s. Time that compiled code takes to be built inside :func:`within` is added to it: the first
        plan after an install would be over before it began.
    stop : callable, optional
        Asked now and then; once it returns true, the time is over.
    """

    def __init__(self, seconds: float = math.inf, stop: Callable[[], bool] | None = None) -> None:
        self._end = time.perf_counter() + seconds
        self._stop = stop

    @property
    def stopped(self) -> bool:
        """Whether ``stop`` ended it."""
        return self._stop is not None and self._stop()

    def left(self) -> float:
        """Return the time in s that is left, negative once it is over."""
        return -math.inf if self.stopped else self._end - time.perf_counter()

    def sooner(self, seconds: float) -> Deadline:
        """Return a deadline that ends ``seconds`` before this one, however that is extended."""
        return _Sooner(self, seconds)

    def passed(self) -> bool:
        """Return whether the time is over."""
        return self.left() < 0

    def extend(self, seconds: float) -> None:
        """Add to the time."""
        self._end += seconds


class _Sooner(Deadline):
    def __init__(self, later: Deadline, seconds: float) -> None:
        self._later, self._seconds = later, seconds

    @property
    def stopped(self) -> bool:
        return self._later.stopped

    def left(self) -> float:
        return self._later.left() - self._seconds

    def extend(self, seconds: float) -> None:
        self._later.extend(seconds)


@contextmanager
def within(seconds: float, stop: Callable[[], bool] | None = None) -> Iterator[Deadline]:
    """Give a block a :class:`Deadline`, and add to it what compiled code takes to be built there."""
    # heavy to import, and of no use to those who only need the class
    from stablepush._compiled import when_built

    deadline = Deadline(seconds, stop)
    with when_built(deadline.extend):
        yield deadline
