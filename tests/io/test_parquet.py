"""Samples as Parquet: the same log as CSV, and complaints that name row and column."""

from __future__ import annotations

import datetime
import decimal

import numpy as np
import pytest

import stablepush as sp
from stablepush.demo import demo_pokes

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")


@pytest.fixture
def folder(tmp_path):
    """A log with a word of a path in it that looks like a column."""
    folder = tmp_path / "trial=7" / "log"
    sp.write_pushlog(demo_pokes(6), folder)
    return folder


def table_of(folder):
    columns = sp.read_pushlog(folder).samples
    return pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})


def replaced(folder, table):
    (folder / "samples.csv").unlink(missing_ok=True)
    pq.write_table(table, folder / "samples.parquet")
    return sp.read_pushlog(folder)


@pytest.mark.parametrize("integers", [False, True])
def test_parquet_is_read_as_csv(folder, integers):
    log, table = sp.read_pushlog(folder), table_of(folder)
    if integers:
        # as pandas writes numbers of trials, and words of few kinds
        at = table.schema.names.index("trial")
        table = table.set_column(at, "trial", table["trial"].cast(pa.int64()))
        at = table.schema.names.index("phase")
        table = table.set_column(at, "phase", table["phase"].dictionary_encode())
    again = replaced(folder, table)
    assert list(again.samples) == list(log.samples)
    for name, values in log.samples.items():
        assert np.array_equal(values, again.samples[name], equal_nan=values.dtype != object), name
    for one, other in zip(log.pairs()[:2], again.pairs()[:2], strict=True):
        assert np.array_equal(one, other)


def test_csv_comes_first(folder):
    table = table_of(folder)
    pq.write_table(table.slice(0, 1), folder / "samples.parquet")
    assert len(sp.read_pushlog(folder).samples["t"]) == table.num_rows


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("x", "1", "column x: expected numbers, got string"),
        ("x", True, "column x: expected numbers, got bool"),
        ("x", datetime.datetime(2026, 1, 1), "column x: expected numbers, got timestamp"),
        ("x", [1.0], "column x: expected numbers, got list"),
        ("fx", 1e300, r"row 1: column fx: expected a finite magnitude of at most 1e\+06"),
        ("fx", -float("inf"), "row 1: column fx: expected a finite"),
        ("t", float("nan"), "row 1: column t: expected a value, got a blank"),
        ("trial", " ", "row 1: column trial: expected a value, got a blank"),
        ("trial", [1], r"row 1: column trial: expected a trial of trials.csv, got '\[1\]'"),
        ("trial", b"\xff", "row 1: column trial: expected a trial of trials.csv"),
        ("trial", "nobody's", "row 1: column trial: expected a trial of trials.csv"),
        ("phase", "shove", "row 1: column phase: expected rest, approach, push"),
    ],
)
def test_wrong_columns_are_refused_with_their_place(folder, name, value, complaint):
    table = table_of(folder)
    wrong = table.set_column(table.schema.names.index(name), name, pa.array([value] * table.num_rows))
    with pytest.raises(sp.InputError, match=complaint) as caught:
        replaced(folder, wrong)
    assert str(caught.value).startswith(str(folder / "samples.parquet"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [decimal.Decimal("0.01"), np.float16(0.01), 0, None])
def test_numbers_of_any_kind_are_taken(folder, value):
    table = table_of(folder)
    other = table.set_column(table.schema.names.index("x"), "x", pa.array([value] * table.num_rows))
    expected = np.full(table.num_rows, np.nan if value is None else float(value))
    np.testing.assert_array_equal(replaced(folder, other).samples["x"], expected)


@pytest.mark.parametrize(
    "column",
    [
        pa.array([1_700_000_000_000_000_001], pa.timestamp("ns")),
        pa.array([1], pa.duration("ns")),
        pa.array([1], pa.time64("ns")),
        pa.array([2**31 - 1], pa.date32()),
        pa.array([1], pa.timestamp("us", tz="Nowhere/Town")),
        pa.array([[1, 2]]),
        pa.array([{"a": 1}]),
        pa.array([b"\xff"]),
    ],
    ids=lambda column: str(column.type),
)
def test_columns_that_nobody_asked_for_never_crash(folder, column):
    table = table_of(folder)
    extra = pa.concat_arrays([column] * table.num_rows)
    try:
        log = replaced(folder, table.append_column("stamp", extra))
    except sp.InputError as error:
        assert "samples.parquet: column stamp: expected words" in str(error)
    else:
        assert all(isinstance(word, str) and word for word in log.samples["stamp"])


def test_missing_and_double_columns_and_what_is_no_parquet_are_refused(folder):
    table = table_of(folder)
    with pytest.raises(sp.InputError, match="column theta: missing column"):
        replaced(folder, table.drop_columns(["theta"]))
    double = pa.Table.from_arrays([*table.columns, table["t"]], names=[*table.schema.names, "t"])
    with pytest.raises(sp.InputError, match="column t: expected a column to stand once"):
        replaced(folder, double)
    for data in (b"", b"PAR1", b"trial,t\n1,0\n", b"PAR1" + bytes(100) + b"PAR1"):
        (folder / "samples.parquet").write_bytes(data)
        with pytest.raises(sp.InputError, match=r"samples\.parquet: expected Parquet") as caught:
            sp.read_pushlog(folder)
        assert "\n" not in str(caught.value)


def test_without_pyarrow_the_extra_is_named(folder, monkeypatch):
    replaced(folder, table_of(folder))
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(sp.InputError, match=r"pip install 'stablepush\[parquet\]'"):
        sp.read_pushlog(folder)
