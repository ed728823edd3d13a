"""CSV tables with columns of numbers and words; complaints name line and column."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import LARGEST_MAGNITUDE, LEAST_POSITIVE, InputError, did_you_mean
from stablepush.io.json_files import open_text

Column = np.ndarray[Any, np.dtype[Any]]

#: What a number must satisfy, and how to say so.
Rule = tuple[Callable[[float], bool], str]
IS_SENSE: Rule = (lambda value: value in (1.0, -1.0), "1 or -1")
IS_FLAG: Rule = (lambda value: value in (0.0, 1.0), "1 or 0")
IS_POSITIVE: Rule = (lambda value: value >= LEAST_POSITIVE, f"a number > 0, at least {LEAST_POSITIVE:g}")


def read_table(
    path: str | Path,
    *,
    required: Sequence[str],
    numbers: Sequence[str],
    filled: Sequence[str] = (),
    rules: Mapping[str, Rule] | None = None,
    stamps: bool = False,
) -> tuple[dict[str, Column], Sequence[int]]:
    """Read a CSV file with a header into columns; also returns the line of the file that each row ends in.

    Columns named in ``numbers`` hold floats (blank: NaN); all others hold text (blank: ``""``). ``required`` columns must be
    there, ``filled`` ones must not have blanks; ``rules`` are what the numbers of a column must obey.
    ``stamps``: a row may end after its first cell, the time; its other values are missing.
    """
    name = str(path)
    columns: list[Any] = []
    lines = array("q")
    # a word that stands in many rows is kept once
    words: dict[str, str] = {}
    with open_text(path, newline="") as stream:
        # strict: a quote that is opened and never closed must not swallow the rest of the file
        reader = csv.reader(stream, strict=True)
        try:
            header = [cell.strip() for cell in next(reader, [])]
            _check_header(header, required, name)
            kinds = [column not in numbers for column in header]
            must = [column in filled for column in header]
            columns = [[] if is_word else array("d") for is_word in kinds]
            for row in reader:
                if not "".join(row).strip():
                    continue
                lines.append(reader.line_num)
                if stamps and len(row) == 1:
                    row.extend([""] * (len(header) - 1))
                if len(row) != len(header):
                    raise InputError(
                        f"line {reader.line_num}: column {header[min(len(row), len(header) - 1)]}",
                        f"expected {len(header)} cells",
                        len(row),
                        file=name,
                    )
                for i, cell in enumerate(map(str.strip, row)):
                    if not cell and must[i]:
                        raise InputError(f"line {reader.line_num}: column {header[i]}", "expected a value", "a blank", file=name)
                    value = words.setdefault(cell, cell) if kinds[i] else _number(cell, name, reader.line_num, header[i])
                    rule = (rules or {}).get(header[i])
                    if rule and cell and not rule[0](value):  # type: ignore[arg-type]
                        raise InputError(
                            f"line {reader.line_num}: column {header[i]}", f"expected {rule[1]}", cell[:40], file=name
                        )
                    columns[i].append(value)
        except csv.Error as error:
            raise InputError(f"line {reader.line_num}", f"expected CSV, {error}", file=name) from None
    table = {
        column: np.array(values, dtype=object) if is_word else np.frombuffer(values) if len(values) else np.zeros(0)
        for column, values, is_word in zip(header, columns, kinds, strict=True)
    }
    return table, lines


def _check_header(header: list[str], required: Sequence[str], name: str) -> None:
    if not any(header):
        raise InputError("line 1", "expected a header of column names", file=name)
    seen: set[str] = set()
    for column in header:
        if column in seen or seen.add(column):  # type: ignore[func-returns-value]
            raise InputError(f"line 1: column {column}", "expected a column to stand once, found it twice", file=name)
    missing = [column for column in required if column not in header]
    if missing:
        other = next((sign for sign in (";", "\t") if sign in header[0]), None) if len(header) == 1 else None
        others = [column for column in header if column not in required]
        hint = did_you_mean(missing[0], others) if other is None else f": separate columns by commas, not by {other!r}"
        raise InputError(f"line 1: column {missing[0]}", f"missing column{hint}", file=name)


def _number(cell: str, name: str, line: int, column: str) -> float:
    if not cell:
        return math.nan
    try:
        # float() takes underscores and other scripts' digits, which no CSV writer produces
        value = float(cell) if cell.isascii() and "_" not in cell else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"line {line}: column {column}",
            "expected a finite number, or a blank for a missing value",
            repr(cell[:40]),
            file=name,
        )
    if abs(value) > LARGEST_MAGNITUDE:
        raise InputError(
            f"line {line}: column {column}",
            f"expected a magnitude of at most {LARGEST_MAGNITUDE:g} (SI units)",
            cell[:40],
            file=name,
        )
    return value


def table_text(columns: Mapping[str, Column]) -> str:
    """Return the CSV text of columns of equal length; NaN becomes a blank, floats keep every digit."""
    stream = io.StringIO()
    cells = [
        values.tolist() if values.dtype == object else [_cell(v) for v in values.tolist()]
        for values in (np.asarray(c) for c in columns.values())
    ]
    # a lone carriage return ends a row for readers, and is not quoted by the writer
    returns = any("\r" in str(cell) for column in cells for cell in column if isinstance(cell, str))
    writer = csv.writer(stream, lineterminator="\n", quoting=csv.QUOTE_ALL if returns else csv.QUOTE_MINIMAL)
    writer.writerow(columns)
    writer.writerows(zip(*cells, strict=True))
    return stream.getvalue()


def _cell(value: float) -> str:
    if isinstance(value, float):
        if math.isnan(value):
            return ""
        if value.is_integer() and abs(value) < 1e15:
            return str(int(value))
    return repr(value)
