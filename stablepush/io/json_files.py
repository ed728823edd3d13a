"""Reading JSON and text with errors that name the place."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

from stablepush.core import InputError, Node, without_collecting
from stablepush.io.special_files import refuse_endless

#: Files larger than this (bytes) are refused, whatever they are read from, so that memory is bounded. A number of a table takes 8
#: bytes there, one of JSON up to 32.
_LARGEST_FILE, _LARGEST_JSON = 512 * 2**20, 64 * 2**20
#: Characters that are read at a time.
_PART = 2**18
#: What a number has that may be too large: three digits of an exponent, or hundreds of others.
_MAY_OVERFLOW = re.compile(r"[eE][+]?[0-9]{3}|[0-9]{300}")


def read_json(path: str | Path, *formats: str) -> Node:
    """Read a JSON object; if ``formats`` are given its ``"format"`` must be one of them.

    Raises :class:`InputError` with the file and what was expected: line and column for what does not parse, the key for
    numbers that are not finite and for keys that stand twice.
    """
    name = str(path)
    text = read_text(path, _LARGEST_JSON)

    def reject_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) < len(pairs):
            seen: set[str] = set()
            twin = next(k for k, _ in pairs if k in seen or seen.add(k))  # type: ignore[func-returns-value]
            raise InputError(twin, "expected a key to stand once, found it twice", file=name)
        return result

    infinite: list[str] = []

    def note_constant(word: str) -> float:
        infinite.append(word)
        return float(word)

    try:
        with without_collecting():
            value = json.loads(text, object_pairs_hook=reject_twins, parse_constant=note_constant)
    except json.JSONDecodeError as error:
        raise InputError(f"line {error.lineno} column {error.colno}", f"expected JSON, {error.msg}", file=name) from None
    except RecursionError:
        raise InputError("", "expected JSON, the nesting is too deep", file=name) from None
    except InputError:
        raise
    except ValueError:  # an integer of thousands of digits
        raise InputError("", "expected JSON with numbers of ordinary length", file=name) from None
    root = Node(value, name)
    if infinite or _MAY_OVERFLOW.search(text):
        _reject_infinite(root)
    root.object()
    if formats:
        root["format"].text(formats)
    return root


def read_text(path: str | Path, most: int = _LARGEST_FILE) -> str:
    """Read a UTF-8 text file of at most so many characters; every failure is one line that names it."""
    parts, length = [], 0
    with open_text(path) as stream:
        while part := stream.read(_PART):
            parts.append(part)
            length += len(part)
            if length > most:
                raise InputError("", f"expected at most {most // 2**20} million characters", file=path)
    return "".join(parts)


@contextmanager
def open_text(path: str | Path, newline: str | None = None) -> Iterator[TextIO]:
    """Open a UTF-8 text file to be read; every failure, also while it is read, is one line that names it."""
    try:
        about = os.stat(path)
        refuse_endless(path)
        too_large = about.st_size > _LARGEST_FILE
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


def _reject_infinite(root: Node) -> None:
    """Refuse the first number, in the order of the file, that is not finite."""
    open_still = [(root, _entries(root.value))]
    while open_still:
        node, entries = open_still[-1]
        for key, value in entries:
            if isinstance(value, dict | list):
                child = node._child(key, value)
                open_still.append((child, _entries(value)))
                break
            if isinstance(value, float) and not math.isfinite(value):
                node._child(key, value).fail("expected a finite number", value)
        else:
            open_still.pop()


def _entries(value: Any) -> Iterator[tuple[Any, Any]]:
    return iter(value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ())
