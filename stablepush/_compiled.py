"""How inner loops are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

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
