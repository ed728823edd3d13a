"""Who wants to hear that code is about to be compiled. Apart from the compiler, which is heavy to import."""

from __future__ import annotations

from collections.abc import Callable

_unheard: list[Callable[[], object]] = []


def at_first_build(notify: Callable[[], object]) -> None:
    """Call ``notify`` once, when a function is needed whose machine code is not on disk."""
    _unheard.append(notify)


def announce_build() -> None:
    """Call all that asked for it."""
    while _unheard:
        _unheard.pop()()
