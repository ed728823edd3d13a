"""Limits of time that do not count the building of compiled code."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from stablepush.core.errors import OutOfTimeError

#: Time (s) that a search that was stopped has left to shorten the path that it has.
_GRACE = 1.0


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
        self._last: float | None = None

    @property
    def stopped(self) -> bool:
        """Whether ``stop`` ended it."""
        return self._stop is not None and self._stop()

    def left(self) -> float:
        """Return the time in s that is left, negative once it is over; after ``stop``, what is left to finish a path in."""
        left = self._end - time.perf_counter()
        if self.stopped:
            if self._last is None:
                self._last = time.perf_counter() + _GRACE
            left = min(left, self._last - time.perf_counter())
        return left

    def passed(self) -> bool:
        """Return whether the search is to end."""
        return self.stopped or self.left() < 0

    def check(self) -> None:
        """Raise :class:`OutOfTimeError` if the computation is to end."""
        if self.passed():
            raise OutOfTimeError("the deadline has passed")

    def extend(self, seconds: float) -> None:
        """Add to the time."""
        self._end += seconds

    def path_found(self) -> None:
        """Note that there is a path: nothing has to be kept back for another search."""

    def reserving(self, seconds: float) -> Deadline:
        """Return a deadline that ends ``seconds`` before this one, however that is extended, unless a path is found by then."""
        return _Reserving(self, seconds)


class _Reserving(Deadline):
    def __init__(self, whole: Deadline, seconds: float) -> None:
        self._whole, self._kept = whole, seconds

    @property
    def stopped(self) -> bool:
        return self._whole.stopped

    def left(self) -> float:
        return self._whole.left() - self._kept

    def extend(self, seconds: float) -> None:
        self._whole.extend(seconds)

    def path_found(self) -> None:
        self._kept = 0.0


@contextmanager
def within(seconds: float, stop: Callable[[], bool] | None = None) -> Iterator[Deadline]:
    """Give a block a :class:`Deadline`, and add to it what compiled code takes to be built there."""
    # heavy to import, and of no use to those who only need the class
    from stablepush.core.compiled import when_built

    deadline = Deadline(seconds, stop)
    with when_built(deadline.extend):
        yield deadline
