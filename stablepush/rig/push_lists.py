"""Lists of pushes as CSV files: written for a lab, read for a rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from stablepush.core import FloatArray, InputError, note_cors, note_distance, note_heading, note_push_speed
from stablepush.geometry import twist_from_cor
from stablepush.io import IS_POSITIVE, IS_SENSE, Column, read_table, table_text, write_atomically
from stablepush.objects import EdgePush, Slider
from stablepush.planning import PlanningProblem
from stablepush.rig.commands import Command, contact_push

#: Columns that a push of an edge and a rotation about a centre must have, and those that only one of them may have.
_EDGE, _ROTATION = ("edge", "along"), ("cor_x", "cor_y", "sense", "angle")
_EDGE_ONLY, _BOTH = ("direction", "way", "width", "cor_x", "cor_y", "sense"), ("x", "y", "theta", "speed", "group")

#: Columns of arguments that have another name.
_COLUMNS = {"arc_length": "along", "distance": "way"}
T = TypeVar("T")


def write_pushes(pushes: Sequence[EdgePush], path: str | Path) -> None:
    """Write a list of pushes as CSV, a line each, which :func:`read_pushes` and ``stablepush simulate`` read.

    Columns: ``edge, along, direction, way, width, cor_x, cor_y, sense, x, y, theta, speed, group`` (m, rad, m/s); those that no
    push has are left out.
    """
    rows = [push.to_json() for push in pushes]
    table = {}
    for name in (*_EDGE, *_EDGE_ONLY, *_BOTH):
        if any(name in row for row in rows):
            blank = "" if name == "group" else math.nan
            table[name] = np.array([row.get(name, blank) for row in rows], dtype=object if name == "group" else None)
    write_atomically(path, table_text(table))


def read_pushes(path: str | Path, slider: Slider) -> list[EdgePush]:
    """Read a list of pushes of the edges of a slider (CSV, a line each): columns as :func:`write_pushes` has them.

    Only ``edge`` and ``along`` must be there. A blank means what a missing column does: straight along the normal for 0.03 m at
    0.02 m/s, by one finger, from where the slider lies.
    """
    table, lines = _read(path, slider, slider.characteristic_length)
    if "edge" not in table:
        raise InputError("line 1", f"expected the columns {', '.join(_EDGE)}", file=path)
    return _rows(path, table, lines, lambda row: _edge_push(table, row, slider, np.full(3, math.nan), 0.02))


def read_commands(path: str | Path, problem: PlanningProblem, radius: float) -> list[EdgePush | Command]:
    """Read a list of pushes (CSV, a line each) for the slider and the contacts of a problem.

    Pushes of edges have the columns that :func:`read_pushes` reads. Rotations by a contact of the problem have ``cor_x, cor_y,
    sense, angle`` (m in B; 1 or -1; rad) and, if wanted, ``contact``: its number. Both may have ``x, y, theta``, where the slider
    is reset (blank: the problem's start), ``speed`` in m/s, that of the finger or of the fastest point of the outline (blank: the
    problem's), and ``group``, the same for repeats.

    Parameters
    ----------
    path : path
    problem : PlanningProblem
    radius : float
        Of the fingers, in m.
    """
    table, lines = _read(path, problem.slider, problem.surface.characteristic_length)
    if "edge" in table:
        return _rows(path, table, lines, lambda row: _edge_push(table, row, problem.slider, problem.start, problem.speed))
    return _rows(path, table, lines, lambda row: _rotation(table, row, problem, radius))


def _read(path: str | Path, slider: Slider, rho: float) -> tuple[dict[str, Column], Sequence[int]]:
    """Columns of a list, all of which are known, and the line of each row; notes what looks like another unit."""
    table, lines = read_table(
        path,
        required=(),
        numbers=(*_EDGE, *_ROTATION, *_EDGE_ONLY, "contact", "x", "y", "theta", "speed"),
        filled=_EDGE,
        rules={"sense": IS_SENSE, "angle": IS_POSITIVE, "way": IS_POSITIVE, "speed": IS_POSITIVE},
    )
    turning = set(_ROTATION) <= set(table)
    if turning == (set(_EDGE) <= set(table)):
        raise InputError(
            "line 1",
            f"expected the columns {', '.join(_EDGE)} of pushes of edges or {', '.join(_ROTATION)} of rotations",
            file=path,
        )
    known = {*_BOTH, *((*_ROTATION, "contact") if turning else (*_EDGE, *_EDGE_ONLY))}
    for name in table:
        if name not in known and not name.startswith("expected_"):
            what = "rotations" if turning else "pushes of edges"
            raise InputError(f"line 1: column {name}", f"not known for {what}", file=path)
    if not lines:
        raise InputError("", "expected at least one push", file=path)
    for name in ("direction", "angle", "theta"):
        for value in table.get(name, ()):
            note_heading(float(np.nan_to_num(value)), f"{path}: column {name}", math.pi)
    for name in ("x", "y", "way"):
        for value in table.get(name, ()):
            note_distance(abs(float(np.nan_to_num(value))), slider.radius, f"{path}: column {name}")
    if "speed" in table:
        note_push_speed(float(np.nanmax(table["speed"], initial=0.0)), f"{path}: column speed")
    if turning:
        for name in _ROTATION:
            blanks = np.flatnonzero(np.isnan(table[name]))
            if len(blanks):
                raise InputError(f"line {lines[blanks[0]]}: column {name}", "expected a value", "a blank", file=path)
        note_cors(np.stack((table["cor_x"], table["cor_y"]), axis=-1), rho, f"{path}: columns cor_x, cor_y")
    return table, lines


def _rows(path: str | Path, table: dict[str, Column], lines: Sequence[int], make: Callable[[int], T]) -> list[T]:
    """What is made of each row; errors name its line."""
    made = []
    for row, line in enumerate(lines):
        try:
            made.append(make(row))
        except InputError as error:
            place = _COLUMNS.get(error.place, error.place)
            named = f"column {place}" if place in table else place
            raise InputError(f"line {line}: {named}", error.expected, error.got, file=path) from None
    return made


def _cell(table: dict[str, Column], name: str, row: int, otherwise: float) -> float:
    """A number of the table; what stands for it where the column or the cell is missing."""
    value = float(table[name][row]) if name in table else math.nan
    return otherwise if math.isnan(value) else value


def _numbers(table: dict[str, Column], names: Sequence[str], row: int, otherwise: FloatArray) -> FloatArray:
    return np.array([_cell(table, name, row, float(value)) for name, value in zip(names, otherwise, strict=True)])


def _whole(table: dict[str, Column], name: str, row: int, count: int) -> int:
    value = _cell(table, name, row, 0.0)
    if not value.is_integer() or not 0 <= value < count:
        raise InputError(name, f"expected a whole number from 0 to {count - 1}", f"{value:g}")
    return int(value)


def _group(table: dict[str, Column], row: int) -> str:
    return str(table["group"][row]) if "group" in table else ""


def _edge_push(table: dict[str, Column], row: int, slider: Slider, otherwise: FloatArray, speed: float) -> EdgePush:
    """A push of a row; ``otherwise``: where the slider starts if the row does not say, NaN for where it lies."""
    cor = _numbers(table, ("cor_x", "cor_y"), row, np.full(2, math.nan))
    start = _numbers(table, ("x", "y", "theta"), row, otherwise)
    return EdgePush.on_edge(
        slider,
        _whole(table, "edge", row, len(slider.vertices)),
        _cell(table, "along", row, 0.0),
        direction=_cell(table, "direction", row, 0.0),
        distance=_cell(table, "way", row, 0.03),
        speed=_cell(table, "speed", row, speed),
        width=_cell(table, "width", row, 0.0),
        cor=None if np.isnan(cor).all() else cor,
        sense=_cell(table, "sense", row, math.nan),
        start=None if np.isnan(start).all() else start,
        group=_group(table, row),
    )


def _rotation(table: dict[str, Column], row: int, problem: PlanningProblem, radius: float) -> Command:
    contact = problem.contacts[_whole(table, "contact", row, len(problem.contacts))]
    twist = twist_from_cor((table["cor_x"][row], table["cor_y"][row]), table["sense"][row])
    speed = _cell(table, "speed", row, problem.speed)
    twist = twist * (speed / float(problem.push_speed(twist)))
    return contact_push(
        contact,
        twist,
        float(table["angle"][row]) / abs(float(twist[2])),
        radius=radius,
        pose=_numbers(table, ("x", "y", "theta"), row, problem.start),
        reset=True,
        speed=speed,
        group=_group(table, row),
    )
