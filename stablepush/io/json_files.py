"""Reading JSON with errors that name the place, and writing files that are never half there."""

from __future__ import annotations

import difflib
import json
import math
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TextIO, TypeVar

from stablepush.core import FloatArray, InputError, PlausibilityWarning, check_array, check_number, check_zero_or_positive

_T = TypeVar("_T")

#: A JSON file larger than this is not one of ours; refusing it keeps memory bounded.
_LARGEST_FILE = 512 * 1024 * 1024
#: Keys that are alike by this ratio of difflib are meant to be the same.
_CLOSE = 0.75


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
        for key in self.object():
            if key in known or key in kept:
                continue
            lacking = {_plain(k): k for k in known if k not in self.value}
            close = difflib.get_close_matches(_plain(key), lacking, 1, _CLOSE)
            if close:
                meant = lacking[close[0]]
                self._child(key, None).fail(f'unknown key, did you mean "{meant}"?')
            warnings.warn(PlausibilityWarning(self._child(key, None).place, "unknown key, ignored", file=self.file), stacklevel=3)

    def items(self) -> Iterator[Node]:
        """The entries of a list."""
        if not isinstance(self.value, list):
            self.fail("expected a list", describe(self.value))
        return (self._child(i, entry) for i, entry in enumerate(self.value))

    def text(self, choices: tuple[str, ...] = ()) -> str:
        if not isinstance(self.value, str):
            self.fail("expected a string", describe(self.value))
        if choices and self.value not in choices:
            self.fail(f"expected {' or '.join(json.dumps(c) for c in choices)}", describe(self.value))
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
            import numpy as np

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
        """Run a check or constructor of the library and put file and key before its complaint."""
        try:
            return build()
        except InputError as error:
            raise error.within(self.place or "top level", file=self.file) from None

    def built(self, build: Callable[[], _T], name: str = "") -> _T:
        """Run a constructor, and put file and key before what it refuses or doubts; ``name`` is what it calls this value."""
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


def _plain(key: str) -> str:
    """A key as it is compared: in small letters, words joined by an underscore."""
    return key.strip().lower().replace("-", "_").replace(" ", "_")


def describe(value: Any) -> str:
    """A short text of a JSON value for a message."""
    text = json.dumps(value) if not isinstance(value, float) or math.isfinite(value) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read_json(path: str | Path, *formats: str) -> Node:
    """Read a JSON object; if ``formats`` are given its ``"format"`` must be one of them.

    Raises :class:`InputError` with the file and what was expected: line and column for what does not parse, the key for
    numbers that are not finite and for keys that stand twice.
    """
    name = str(path)
    text = read_text(path)

    def reject_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) < len(pairs):
            seen: set[str] = set()
            twin = next(k for k, _ in pairs if k in seen or seen.add(k))  # type: ignore[func-returns-value]
            raise InputError(twin, "expected a key to stand once, found it twice", file=name)
        return result

    try:
        value = json.loads(text, object_pairs_hook=reject_twins)
    except json.JSONDecodeError as error:
        raise InputError(f"line {error.lineno} column {error.colno}", f"expected JSON, {error.msg}", file=name) from None
    except RecursionError:
        raise InputError("", "expected JSON, the nesting is too deep", file=name) from None
    except InputError:
        raise
    except ValueError:  # an integer of thousands of digits
        raise InputError("", "expected JSON with numbers of ordinary length", file=name) from None
    root = Node(value, name)
    _reject_infinite(root)
    root.object()
    if formats:
        root["format"].text(formats)
    return root


def read_text(path: str | Path) -> str:
    """Read a UTF-8 text file; every failure is one line that names it."""
    with open_text(path) as stream:
        return stream.read()


@contextmanager
def open_text(path: str | Path, newline: str | None = None) -> Iterator[TextIO]:
    """Open a UTF-8 text file to be read; every failure, also while it is read, is one line that names it."""
    try:
        too_large = os.path.getsize(path) > _LARGEST_FILE
        stream = open(path, encoding="utf-8-sig", newline=newline)  # noqa: SIM115 (closed below)
    except ValueError as error:  # a NUL in the path
        raise InputError("", f"cannot read: {error}", file=repr(str(path))) from None
    except OSError as error:
        raise InputError("", f"cannot read: {error.strerror or error}", file=path) from None
    with stream:
        if too_large:
            raise InputError("", f"expected a file of at most {_LARGEST_FILE // 2**20} MB", file=path)
        try:
            yield stream
        except UnicodeDecodeError:
            raise InputError(_first_bad_byte(path), "expected UTF-8 text", file=path) from None
        except OSError as error:
            raise InputError("", f"cannot read: {error.strerror or error}", file=path) from None


def _first_bad_byte(path: str | Path) -> str:
    """Where a file stops being UTF-8; what is no file cannot be read twice."""
    with suppress(OSError):
        if os.path.isfile(path):
            try:
                Path(path).read_bytes().decode()
            except UnicodeDecodeError as error:
                return f"byte {error.start}"
    return ""


def _reject_infinite(node: Node) -> None:
    stack = [node]
    while stack:
        current = stack.pop()
        value = current.value
        if isinstance(value, float) and not math.isfinite(value):
            current.fail("expected a finite number", value)
        elif isinstance(value, dict):
            stack.extend(current._child(k, v) for k, v in reversed(value.items()))
        elif isinstance(value, list):
            stack.extend(current._child(i, v) for i, v in reversed(list(enumerate(value))))


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file as a whole or not at all: into a neighbour first, then renamed over the target."""
    target = Path(path)
    data = content.encode() if isinstance(content, str) else content
    temporary = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            raise InputError("", "cannot write: is a directory", file=target)
        if target.exists() and not target.is_file():  # a pipe or a terminal takes what it gets
            target.write_bytes(data)
            return
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=".stablepush-")
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        # mkstemp makes private files; give the mode that open() would have given
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
        temporary = None
    except OSError as error:
        raise InputError("", f"cannot write: {error.strerror or error}", file=target) from None
    finally:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)


@contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """Give a place for files that all appear at ``path`` when the block ends well, and not at all when it does not."""
    target = Path(path)
    staging = None
    try:
        if target.exists() and not target.is_dir():
            raise InputError("", "cannot write: exists and is not a folder", file=target)
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(dir=target.parent, prefix=".stablepush-"))
        yield staging
        target.mkdir(exist_ok=True)
        for file in sorted(staging.iterdir()):
            os.replace(file, target / file.name)
    except OSError as error:
        raise InputError("", f"cannot write: {error.strerror or error}", file=target) from None
    finally:
        if staging is not None:
            shutil.rmtree(staging, ignore_errors=True)


def write_json(path: str | Path, value: Any) -> None:
    """Write JSON with full precision; NaN and infinity are a bug of the caller."""
    write_atomically(path, json.dumps(value, indent=1, allow_nan=False) + "\n")
