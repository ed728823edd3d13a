"""Ways to break a file: as bytes, as JSON, as a table, and as other people's recordings are broken."""

from __future__ import annotations

import contextlib
import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

#: What JSON values are replaced by.
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**63, -(2**70), 10**400, 0.5, -0.0, 1e-320, 1e-160, 1e-30, 1e-9, 1e6, 1e7, 1e300, float("nan"),
    float("inf"), -float("inf"), "", "nan", "1", "../../etc/passwd", "\u0000", "\ud800", "é" * 300, [], [[]], [None],
    [[1, 2], [3]], [1e-12, 1e-12], {}, {"format": "model/1"}, [[[[[[]]]]]], [0, 0], [[0, 0], [0, 0], [0, 0]],
)  # fmt: skip
#: What numbers, and all numbers of a list or an object, are multiplied by.
FACTORS = (-1, 0, 1e-160, 1e-12, 1e-9, 1e-6, 1e-3, 1e3, 1e6, 1 + 1e-12)
#: What cells of tables are replaced by.
CELLS = (
    "", " ", "nan", "inf", "-inf", "1e400", "1e7", "-1e7", "1e-320", "1e-160", "0", "-1", "1", "true", "0x10", "1_0",
    "١", "1,5", '"', '"1"', "=1+1",
    "\x00", "é", "None", "9" * 400, "1;2", "rest", "push", "-",
)  # fmt: skip
#: Bytes that are put in anywhere.
PIECES = (
    b"\x00", b"\xff", b"\xef\xbb\xbf", b"\r", b"\n\n", b'"', b",", b"[" * 300, b"{" * 300, b"}", b"NaN", b"Infinity", b"1e999",
    b"-", b"\\u0000", b"//", b"\xf0\x9f\x92\xa9", b" " * 5000, b"0" * 5000,
)  # fmt: skip


def changes(rng: np.random.Generator) -> int:
    """How many: mostly one, for the first that is refused hides the others."""
    return int(rng.choice((1, 2, 3), p=(0.7, 0.2, 0.1)))


def broken_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes changed, cut out, repeated or put in."""
    for _ in range(changes(rng)):
        at, end = sorted(int(i) for i in rng.integers(0, len(data) + 1, 2))
        kind = rng.integers(6)
        if kind == 0 and len(data):
            i = min(at, len(data) - 1)
            data = data[:i] + bytes([int(rng.integers(256))]) + data[i + 1 :]
        elif kind == 1:
            data = data[:at] + data[end:]
        elif kind == 2:
            data = data[:at]
        elif kind == 3:
            data = data[:end] + data[at:]
        else:
            data = data[:at] + PIECES[int(rng.integers(len(PIECES)))] + data[at:]
    return data


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths to all that is in a JSON value."""
    yield path
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield from places(child, (*path, key))


def scaled(value: Any, factor: float) -> Any:
    """A JSON value with all numbers in it times a factor."""
    if isinstance(value, dict):
        return {key: scaled(child, factor) for key, child in value.items()}
    if isinstance(value, list):
        return [scaled(child, factor) for child in value]
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e290
    return value * factor if is_number else value


def broken_json(data: bytes, rng: np.random.Generator) -> bytes:
    """Some values replaced, scaled with all in them, removed, repeated or swapped with others."""
    try:
        value = json.loads(data)
    except ValueError:
        return broken_bytes(data, rng)
    for _ in range(changes(rng)):
        paths = [p for p in places(value) if p]
        if not paths:
            break
        # by depth first: a file of a thousand coefficients has a handful of keys
        depth = int(rng.choice(sorted({len(p) for p in paths})))
        paths = [p for p in paths if len(p) == depth]
        path = paths[int(rng.integers(len(paths)))]
        parent = value
        for key in path[:-1]:
            parent = parent[key]
        key, kind = path[-1], rng.integers(7)
        old = parent[key]
        if kind == 0:
            del parent[key]
        elif kind in (1, 6):
            parent[key] = scaled(old, float(rng.choice(FACTORS)))
        elif kind == 2 and isinstance(parent, list):
            parent.insert(int(rng.integers(len(parent) + 1)), copy.deepcopy(old))
        elif kind == 3 and isinstance(parent, list):
            rng.shuffle(parent)
        else:
            parent[key] = copy.deepcopy(VALUES[int(rng.integers(len(VALUES)))])
    return json.dumps(value).encode("utf-8", "surrogatepass")


def broken_table(data: bytes, rng: np.random.Generator) -> bytes:
    """Some cells, rows, columns and line ends changed, and columns scaled."""
    text = data.decode("utf-8", "replace")
    rows = [line.split(",") for line in text.splitlines()] or [[""]]
    for _ in range(changes(rng)):
        i = int(rng.integers(len(rows))) if rng.random() < 0.8 else 0
        j = int(rng.integers(len(rows[i]))) if rows[i] else 0
        kind = rng.integers(9)
        if kind <= 2 and rows[i]:
            rows[i][j] = CELLS[int(rng.integers(len(CELLS)))]
        elif kind == 3:
            rows.insert(int(rng.integers(len(rows) + 1)), list(rows[i]))
        elif kind == 4 and len(rows) > 1:
            del rows[i]
        elif kind == 5:
            for row in rows:
                if j < len(row):
                    del row[j]
        elif kind == 6 and rows[i]:
            rows[i].append(rows[i][j])
        elif kind == 7:
            factor = float(rng.choice(FACTORS))
            for row in rows[1:]:
                with contextlib.suppress(ValueError, IndexError):
                    row[j] = repr(float(row[j]) * factor)
        elif len(rows) > 1:
            rows[1:] = [rows[1 + int(k)] for k in rng.permutation(len(rows) - 1)]
        if not rows:
            rows = [[""]]
    end = str(rng.choice(("\n", "\n", "\r\n", "\r")))
    return end.join(",".join(row) for row in rows).encode("utf-8", "surrogatepass")


def strange_table(data: bytes, rng: np.random.Generator) -> bytes:
    """A table as other people's recordings are: columns that stop, jump, go back, are far off or blank, rows that are doubled."""
    rows = [line.split(",") for line in data.decode("utf-8", "replace").splitlines()] or [[""]]
    for _ in range(changes(rng)):
        if len(rows) < 3:
            break
        j = int(rng.integers(max(1, len(rows[1]))))
        first, last = sorted(int(i) for i in rng.integers(1, len(rows) + 1, 2))
        kind = rng.integers(8)
        if kind == 0:
            rows[1:] = rows[:0:-1]
        elif kind == 1:
            rows[1:] = [row for row in rows[1:] for _ in range(2)]
        elif kind == 2:
            rows[first:last] = [["$\\frac{$", "\x1b[31m", "é" * 300][j % 3 :][:1] + row[1:] for row in rows[first:last]]
        for row in rows[first:last] if kind > 2 else ():
            if j < len(row):
                with contextlib.suppress(ValueError):
                    step = (None, None, None, 0.0, 1e3, -0.3, 2 * np.pi)[kind] if kind < 7 else None
                    stays = rows[first][j]
                    row[j] = "" if step is None else stays if step == 0.0 else repr(float(row[j]) + step)
    return "\n".join(",".join(row) for row in rows).encode("utf-8", "surrogatepass")


def broken(path: Path, rng: np.random.Generator) -> None:
    """Break a file in place, now as bytes, now as what it is, now as other people's are."""
    data = path.read_bytes()
    tables = (broken_table, strange_table)
    ways = {".json": broken_json, ".csv": tables[int(rng.integers(2))]}
    way = ways.get(path.suffix, broken_bytes) if rng.random() < 0.7 else broken_bytes
    path.write_bytes(way(data, rng))
