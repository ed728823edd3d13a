"""How inner loops are compiled."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba import njit
from numba.core import event

#: Multiply-adds may be fused, which only makes them more accurate; nothing else of fast maths, for NaN must stay NaN.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}, "no_cfunc_wrapper": True}


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile on first call; keep the machine code on disk unless no place can be written."""
    try:
        return njit(cache=True, **_OPTIONS)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # numba found neither the package nor the user's cache folder writable
        return njit(**_OPTIONS)(function)  # type: ignore[no-any-return]


def inner(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that only compiled code may call: without the door to Python, which takes long to build.

    Calling it from Python crashes the process.
    """
    try:
        return njit(cache=True, no_cpython_wrapper=True, **_OPTIONS)(function)  # type: ignore[no-any-return]
    except RuntimeError:
        return njit(no_cpython_wrapper=True, **_OPTIONS)(function)  # type: ignore[no-any-return]


class _Builds(event.Listener):  # type: ignore[misc]
    """Times the outermost of nested builds."""

    def __init__(self, tell: Callable[[float], None]) -> None:
        self._tell, self._depth, self._began = tell, 0, 0.0

    def on_start(self, _: Any) -> None:
        if self._depth == 0:
            self._began = time.perf_counter()
        self._depth += 1

    def on_end(self, _: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._tell(time.perf_counter() - self._began)


@contextmanager
def when_built(tell: Callable[[float], None]) -> Iterator[None]:
    """Call ``tell`` with the time in s whenever code was built in the block: after an install, not when it is read from disk."""
    with event.install_listener("numba:compile", _Builds(tell)):
        yield
