"""Values of a JSON file together with their places."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, TypeVar

import numpy as np

from stablepush.core.arrays import FloatArray, check_array, check_number, check_zero_or_positive
from stablepush.core.errors import InputError, PlausibilityWarning
from stablepush.core.words import closest, did_you_mean

_T = TypeVar("_T")

#: Keys that are alike by this ratio of difflib are meant to be the same.
_CLOSE = 0.75
#: So many unknown keys of an object are named.
_TOLD = 10


@dataclass(frozen=True, slots=True)
class Node:
    """A value of a JSON file together with its place, so that every complaint can name it."""

    value: Any
    file: str
    place: str = ""

    def fail(self, expected: str, got: object = None) -> NoReturn:
        """Raise an error that names file and key, and what was expected."""
        raise InputError(self.place or "top level", expected, got, file=self.file)

    def _child(self, key: str | int, value: Any) -> Node:
        place = f"{self.place}[{key}]" if isinstance(key, int) else f"{self.place}.{key}" if self.place else key
        return Node(value, self.file, place)

    def __getitem__(self, key: str) -> Node:
        """The value of a key that must be there."""
        self.object()
        if key not in self.value:
            self._child(key, None).fail("missing key")
        return self._child(key, self.value[key])

    def without(self, key: str) -> Node:
        """The same object less a key, which need not be there."""
        self.object()
        return Node({name: value for name, value in self.value.items() if name != key}, self.file, self.place)

    def get(self, key: str) -> Node | None:
        """The value of a key, or None if it is absent or null."""
        self.object()
        if self.value.get(key) is None:
            return None
        return self._child(key, self.value[key])

    def object(self) -> dict[str, Any]:
        if not isinstance(self.value, dict):
            self.fail("expected an object", describe(self.value))
        return self.value  # type: ignore[no-any-return]

    def expect_keys(self, *known: str, kept: Sequence[str] = ()) -> None:
        """Refuse a key that is close to a known one that is missing; note any other that nothing reads.

        ``kept``: keys that nothing reads, and that this project writes for the record.
        """
        unread = [key for key in self.object() if key not in known and key not in kept]
        missing = [key for key in known if key not in self.value]
        for key in unread:
            meant = closest(key, missing, _CLOSE)
            if meant:
                self._child(key, None).fail(f'unknown key, did you mean "{meant}"?')
        for key in unread[:_TOLD]:
            more = f", and {len(unread) - _TOLD} more" if len(unread) > _TOLD and key == unread[_TOLD - 1] else ""
            doubt = PlausibilityWarning(self._child(key, None).place, f"unknown key, ignored{more}", file=self.file)
            warnings.warn(doubt, stacklevel=3)

    def require(self, *keys: str) -> None:
        """Refuse an object without some of these keys, and name all that are missing."""
        missing = [key for key in keys if key not in self.object()]
        if missing:
            first, *others = missing
            self._child(first, None).fail(f"missing key{'; also missing: ' if others else ''}{', '.join(others)}")

    def items(self) -> Iterator[Node]:
        """The entries of a list."""
        if not isinstance(self.value, list):
            self.fail("expected a list", describe(self.value))
        return (self._child(i, entry) for i, entry in enumerate(self.value))

    def text(self, choices: tuple[str, ...] = ()) -> str:
        if not isinstance(self.value, str):
            self.fail("expected a string", describe(self.value))
        if choices and self.value not in choices:
            self.fail(
                f"expected {' or '.join(json.dumps(c) for c in choices)}",
                f"{describe(self.value)}{did_you_mean(self.value, choices)}",
            )
        return self.value  # type: ignore[no-any-return]

    def number(self, *, at_least: float | None = None, positive: bool = False) -> float:
        if isinstance(self.value, bool) or not isinstance(self.value, (int, float)):
            self.fail("expected a number", describe(self.value))
        return self.checked(lambda: check_number(self.value, "", at_least=at_least, positive=positive))

    def zero_or_positive(self) -> float:
        """A number that is zero, for none of it, or large enough to divide by."""
        number = self.number()
        return self.checked(lambda: check_zero_or_positive(number, ""))

    def integer(self, *, at_least: int = 0) -> int:
        if isinstance(self.value, bool) or not isinstance(self.value, int):
            self.fail("expected a whole number", describe(self.value))
        if self.value < at_least:
            self.fail(f"expected a whole number >= {at_least}", describe(self.value))
        return self.value  # type: ignore[no-any-return]

    def array(self, *shape: int | None) -> FloatArray:
        """The value as a float array of the given shape (None matches any length)."""
        self._check_entries(self.value, shape)
        if self.value == [] and len(shape) > 1:
            return np.empty((0, *(n or 0 for n in shape[1:])))
        return self.checked(lambda: check_array(self.value, "", shape))

    def _check_entries(self, value: Any, shape: tuple[int | None, ...]) -> None:
        if not shape:
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                self.fail("expected a number", describe(value))
            return
        if not isinstance(value, list):
            self.fail("expected a list", describe(value))
        if shape[0] is not None and len(value) != shape[0]:
            self.fail(f"expected {shape[0]} numbers", len(value))
        for i, entry in enumerate(value):
            self._child(i, entry)._check_entries(entry, shape[1:])

    def checked(self, build: Callable[[], _T]) -> _T:
        """Run a check or constructor of the library and add file and key to its error."""
        try:
            return build()
        except InputError as error:
            raise error.within(self.place or "top level", file=self.file) from None

    def built(self, build: Callable[[], _T], name: str = "") -> _T:
        """Run a constructor, and add file and key to its errors and warnings; ``name`` is what it calls this value."""
        try:
            with warnings.catch_warnings(record=True) as doubts:
                warnings.simplefilter("always")
                result = build()
        except InputError as error:
            raise InputError(self._place_of(error.place, name), error.expected, error.got, file=self.file) from None
        for doubt in doubts:
            message = doubt.message
            if isinstance(message, PlausibilityWarning) and not message.file:
                message = PlausibilityWarning(self._place_of(message.place, name), message.doubt, file=self.file)
            warnings.warn(message, doubt.category, stacklevel=3)
        return result

    def _place_of(self, place: str, name: str) -> str:
        """The key in this file of what a constructor calls ``place``: ``name`` and a field of it, or a field."""
        if name and place.startswith(f"{name}."):
            key = place.removeprefix(f"{name}.")
            return f"{self.place}.{key}" if self.place else key
        return ": ".join(filter(None, (self.place, place)))


def describe(value: Any) -> str:
    """A short text of a JSON value for a message."""
    text = json.dumps(value, default=str) if not isinstance(value, float) or math.isfinite(value) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
