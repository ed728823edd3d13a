"""Old names of arguments and attributes, which work for one more version."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
C = TypeVar("C", bound=type)


def renamed(**names: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Let a function take old names of keyword arguments, with a :class:`DeprecationWarning`: ``renamed(old="new")``."""

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @wraps(function)
        def call(*args: P.args, **given: P.kwargs) -> T:
            for old in names.keys() & given.keys():
                warnings.warn(f"{function.__qualname__}: {old} is now {names[old]}", DeprecationWarning, stacklevel=2)
                given[names[old]] = given.pop(old)
            return function(*args, **given)

        return call

    return decorate


def renamed_fields(**names: str) -> Callable[[C], C]:
    """Let a class take old names of arguments and give old names of attributes, with a :class:`DeprecationWarning`."""

    def decorate(cls: C) -> C:
        def reader(old: str, new: str) -> property:
            def read(self: Any) -> Any:
                warnings.warn(f"{cls.__name__}: {old} is now {new}", DeprecationWarning, stacklevel=2)
                return getattr(self, new)

            return property(read, doc=f"Deprecated name of ``{new}``.")

        cls.__init__ = renamed(**names)(cls.__init__)  # type: ignore[misc]
        for old, new in names.items():
            setattr(cls, old, reader(old, new))
        return cls

    return decorate
