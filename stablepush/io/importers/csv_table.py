"""One CSV table of rows in the world, with a mapping that says which column is what and in which unit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError
from stablepush.geometry import rotate_vectors
from stablepush.io.importers.mapping import Mapping, mapping_of
from stablepush.io.importers.registry import Source, name_of, within
from stablepush.io.pushlog import OF_TRIALS, PushLog
from stablepush.io.tables import read_table
from stablepush.objects import Slider

#: Quantities of a table, and what their unit measures; ``trial`` is a name.
COLUMNS = {
    "t": "time", "x": "length", "y": "length", "theta": "angle", "tip_x": "length", "tip_y": "length", "tip_theta": "angle",
    "fx": "force", "fy": "force", "moment": "moment", "trial": "",
}  # fmt: skip
#: Units by what they measure, in SI.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "force": {"N": 1.0, "mN": 1e-3},
    "moment": {"N m": 1.0, "N mm": 1e-3},
}
#: Axes in which forces are: those of the world, or of the tip, which turn with its heading; its z is up, or down as of a flange.
FORCE_AXES = ("world", "tip", "tip-z-down")
_REQUIRED = ("t", "x", "y", "theta")
#: Columns of which none is given without the other.
_TOGETHER = (("fx", "fy"), ("fy", "fx"), ("tip_x", "tip_y"), ("tip_y", "tip_x"))


class CsvTables:
    """Importer of tables in the world frame: kind ``csv``."""

    needs_mapping = True
    suffixes = (".csv",)

    def find(self, root: Path) -> Iterator[Source]:
        files = [root] if root.is_file() else sorted(root.glob("*.csv"))
        return (Source("csv", file, name_of(file), {}) for file in files)

    def read(self, source: Source, slider: Slider | None) -> tuple[PushLog, list[str]]:
        mapping = mapping_of(source, slider, "columns", "units", "trial_columns", "force_axes")
        columns = _Columns.of(mapping)
        required = [*columns.named.values(), *columns.of_trials.values()]
        # a clock may count from 1970, which is more than a table of lengths and forces may hold
        numbers = [column for name, column in columns.named.items() if name not in ("trial", "t")]
        clock_name, trial_name = columns.named["t"], columns.named.get("trial")
        table, lines = read_table(source.file, required=required, numbers=numbers, filled=[clock_name], stamps=True)
        clock = np.array([_time(word, line, clock_name, source) for word, line in zip(table[clock_name], lines, strict=True)])
        poses, tips, forces, moments = columns.streams(table)
        if poses is None or not len(clock):
            raise InputError("", "expected at least one row", file=source.file)
        trials = None if trial_name is None else list(table[trial_name])
        if trials is not None and not any(trials):
            raise InputError(f"column {trial_name}", "expected a name in at least one row", file=source.file)
        try:
            log, notes = mapping.log(columns.scales["time"] * clock, poses, forces, tips, trials, moments)
        except InputError as error:
            place = error.place
            for what, column in (("times[", clock_name), ("trials[", trial_name)):
                if place.startswith(what):
                    place = f"line {lines[int(place[len(what) : -1])]}: column {column}"
            # what the mapping says is wrong there
            raise InputError(place, error.expected, error.got, file=error.file or source.file) from None
        if not columns.of_trials:
            return log, notes
        first = {name: rows[0] for name, rows in _rows_by_name(trials or []).items()}
        more = {
            name: [table[column][first[trial]] for trial in log.trials["trial"]] for name, column in columns.of_trials.items()
        }
        own = {**log.trials, **{name: _numbers(values) for name, values in more.items()}}
        with within(Path(mapping.root.file)):
            return PushLog(log.rig, own, log.samples), notes


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """What a mapping says of a table: columns by quantity, those of trials by their names in the log, factors to SI by what they
    measure, and the axes in which forces are."""

    named: dict[str, str]
    of_trials: dict[str, str]
    scales: dict[str, float]
    force_axes: str

    @classmethod
    def of(cls, mapping: Mapping) -> _Columns:
        """Read the columns of a mapping, and refuse those of which one is missing."""
        root, node = mapping.root, mapping.root["columns"]
        node.expect_keys(*COLUMNS)
        named = {name: node[name].text() for name in node.object() if name in COLUMNS}
        for name in _REQUIRED:
            node[name].text()
        scales = dict.fromkeys(UNITS, 1.0)
        units = root.get("units")
        if units is not None:
            units.expect_keys(*UNITS)
            scales |= {what: UNITS[what][units[what].text(tuple(UNITS[what]))] for what in units.object() if what in UNITS}
        axes = root.get("force_axes")
        frame = "world" if axes is None else axes.text(FORCE_AXES)
        if frame != "world" and "tip_theta" not in named:
            words = f"missing key: force_axes is {frame}, which needs the heading of the tool"
            raise InputError("columns.tip_theta", words, file=root.file)
        for name, needs in (*_TOGETHER, ("fx", "tip_x"), ("moment", "fx"), ("tip_theta", "tip_x")):
            if name in named and needs not in named:
                raise InputError(f"columns.{needs}", f"missing key: {name} is given, which needs it", file=root.file)
        own_node = root.get("trial_columns")
        own = {} if own_node is None else {name: own_node[name].text() for name in own_node.object()}
        if own and "trial" not in named:
            node["trial"]
        for name in own:
            if name in OF_TRIALS:
                raise InputError(f"trial_columns.{name}", "expected another name: it is the log's own", file=root.file)
        if "trial" in named and named["trial"] in [column for name, column in named.items() if name != "trial"]:
            raise InputError("columns.trial", "expected a column of its own", repr(named["trial"]), file=root.file)
        return cls(named, own, scales, frame)

    def _values(self, table: dict[str, Any], *names: str) -> FloatArray | None:
        if names[0] not in self.named:
            return None
        return np.column_stack([self.scales[COLUMNS[name]] * table[self.named[name]] for name in names])

    def streams(self, table: dict[str, Any]) -> tuple[FloatArray | None, FloatArray | None, FloatArray | None, FloatArray | None]:
        """Poses (n, 3), tips (n, 2) or (n, 3), forces (n, 2) and moments (n,) in W and SI; None for those that a table lacks."""
        poses = self._values(table, "x", "y", "theta")
        tips = self._values(table, "tip_x", "tip_y", *(["tip_theta"] if "tip_theta" in self.named else []))
        moments, forces = self._values(table, "moment"), self._values(table, "fx", "fy")
        if self.force_axes == "tip-z-down" and forces is not None:
            # x is the tip's, y its other side
            forces = forces * (1, -1)
            moments = None if moments is None else -moments
        if self.force_axes != "world" and forces is not None and tips is not None:
            forces = rotate_vectors(tips[:, 2], forces)
        return poses, tips, forces, None if moments is None else moments[:, 0]


TABLES = CsvTables()


def _rows_by_name(trials: list[str]) -> dict[str, list[int]]:
    rows: dict[str, list[int]] = {}
    for row, name in enumerate(trials):
        rows.setdefault(name, []).append(row)
    return rows


def _numbers(words: list[str]) -> list[Any]:
    """Numbers, if all words are some or blank; else the words."""
    try:
        return [float(word) if word else math.nan for word in words]
    except ValueError:
        return words


def _time(word: str, line: int, column: str, source: Source) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"line {line}: column {column}", "expected a finite number", repr(word[:40]), file=source.file)
    return value
