"""When the program was started: time limits count from here."""

from __future__ import annotations

import time

_started = time.perf_counter()


def restart() -> None:
    """Start again, for a call from Python."""
    global _started  # noqa: PLW0603
    _started = time.perf_counter()


def elapsed() -> float:
    """Return the seconds since the start."""
    return time.perf_counter() - _started
