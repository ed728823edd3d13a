"""Reading JSON with errors that name the place, and writing files that are never half there."""

from __future__ import annotations

import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

from stablepush.core import InputError, Node

#: A JSON file larger than this is not one of ours; refusing it keeps memory bounded.
_LARGEST_FILE = 512 * 1024 * 1024


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
