"""Parquet tables with columns of numbers and words; complaints name row and column."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import LARGEST_MAGNITUDE, InputError, did_you_mean
from stablepush.io.tables import Column

#: Values of a column that are turned into words at a time: memory stays that of the table.
_AT_ONCE = 65536


def read_parquet(
    path: str | Path, *, required: Sequence[str], numbers: Sequence[str], filled: Sequence[str] = ()
) -> dict[str, Column]:
    """Read a Parquet file into columns, as :func:`stablepush.io.tables.read_table` does a CSV file; null is a blank.

    Needs the extra ``parquet``.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError("", "reading parquet needs pyarrow: pip install 'stablepush[parquet]'", file=path) from None
    try:
        # the file alone: read_table() would take words of its path for columns
        with pyarrow.parquet.ParquetFile(path) as file:
            table = file.read()
        table.validate(full=True)
    except (OSError, MemoryError, ValueError, pyarrow.ArrowException) as error:  # ValueError: names that are not UTF-8
        raise InputError("", f"expected Parquet: {' '.join(str(error).split())[:200]}", file=path) from None
    names = table.column_names
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"column {name}", "expected a column to stand once, found it twice", file=path)
    for name in required:
        if name not in names:
            others = [column for column in names if column not in required]
            raise InputError(f"column {name}", "missing column" + did_you_mean(name, others), file=path)
    columns: dict[str, Column] = {}
    for name in names:
        read = _numbers if name in numbers else _words
        columns[name] = read(table.column(name), name, str(path), name in filled)
    return columns


def _numbers(column: Any, name: str, file: str, filled: bool) -> Column:
    import pyarrow

    kinds = pyarrow.types
    if not any(is_kind(column.type) for is_kind in (kinds.is_integer, kinds.is_floating, kinds.is_decimal, kinds.is_null)):
        raise InputError(f"column {name}", "expected numbers", column.type, file=file)
    values = np.array(column.cast(pyarrow.float64(), safe=False).to_numpy(), dtype=np.float64)
    bad = np.flatnonzero(np.abs(values) > LARGEST_MAGNITUDE)
    if len(bad):
        raise InputError(
            f"row {bad[0] + 1}: column {name}",
            f"expected a finite magnitude of at most {LARGEST_MAGNITUDE:g} (SI units)",
            f"{values[bad[0]]:g}",
            file=file,
        )
    blank = np.flatnonzero(np.isnan(values))
    if filled and len(blank):
        raise InputError(f"row {blank[0] + 1}: column {name}", "expected a value", "a blank", file=file)
    return values


def _words(column: Any, name: str, file: str, filled: bool) -> Column:
    import pyarrow

    with suppress(pyarrow.ArrowException):
        # as Arrow writes it: times of day, say, that Python's types do not hold
        column = column.cast(pyarrow.string())
    words: dict[str, str] = {}
    values = np.empty(len(column), dtype=object)
    for start in range(0, len(column), _AT_ONCE):
        try:
            part = column.slice(start, _AT_ONCE).to_pylist()
        except (ValueError, LookupError, OverflowError, pyarrow.ArrowException):  # LookupError: time zones that are none
            raise InputError(f"column {name}", "expected words", column.type, file=file) from None
        for row, value in enumerate(part, start):
            word = "" if value is None else str(value).strip()
            # a word that stands in many rows is kept once
            values[row] = words.setdefault(word, word)
            if filled and not word:
                raise InputError(f"row {row + 1}: column {name}", "expected a value", "a blank", file=file)
    return values
