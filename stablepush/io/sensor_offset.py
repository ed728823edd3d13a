"""What a force sensor reads that touches nothing: its offset, which is taken off the readings of each push."""

from __future__ import annotations

import warnings
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from stablepush.core import BoolArray, FloatArray, StablepushWarning
from stablepush.geometry import rotate_vectors, wrap_angle

#: Least rows at rest from which an offset is taken.
LEAST_REST = 3
#: A tip that is so much farther (m) from the outline than in a push touches nothing.
_CLEAR = 1e-3
#: A finger presses on from the push before if it reads what it read at the end of that, up to this share of the load.
_PRESSES = 0.3
#: Tools whose headings (rad) differ by more show whether the offset turns with them: it does unless that leaves so many times
#: what an offset that is fixed in the world leaves, and what rests scatter by.
_TURNED, _CLEARLY = 0.2, 3.0


@dataclass(frozen=True, slots=True, eq=False)
class _Spell:
    """Medians of readings ``(fx, fy, moment)`` in W: at rest, and at the end of the push behind it; NaN where rows are too few.

    ``row``: the first, of the record. ``heading``: of the tool, rad; NaN if unknown. ``clear``: whether the tip was away from the
    outline. ``scatter``: standard error of the force at rest, N.
    """

    row: int
    heading: float
    rest: FloatArray
    end: FloatArray
    clear: bool
    scatter: float

    @property
    def is_known(self) -> bool:
        return bool(np.isfinite(self.rest[:2]).all())


def is_clear(away: FloatArray, pushes: BoolArray) -> BoolArray:
    """Rows (n,) in which a finger is farther from the outline, ``away`` in m, than it usually is in rows that push."""
    near = away[pushes & np.isfinite(away)]
    return np.asarray(away > max(0.0, float(np.median(near))) + _CLEAR) if len(near) else np.zeros(len(away), dtype=bool)


def zeroed(
    readings: FloatArray,
    away: FloatArray,
    heading: FloatArray | None,
    trials: Sequence[np.ndarray[Any, np.dtype[np.intp]]],
    phases: Sequence[np.ndarray[Any, np.dtype[np.object_]]],
) -> tuple[FloatArray, list[int]]:
    """Return readings ``(fx, fy, moment)`` (n, 3) in W less the offset of the sensor in each trial, and the first and last rows
    of rests beside the trials.

    A trial without rest has the offset of the last rest before it, else of the first after it, or 0. Rows without a trial in
    which the tip is clear of the outline are rest, too. Rows at rest in which a finger presses on that stopped at the end of the
    push before become ``approach``. ``away``: clearances (n,) in m of the finger; ``heading`` (n,) of the tool, if
    it is known: the offset turns with it, in a push as well, unless rests at different headings agree better without.
    """
    turned = np.full(len(readings), np.nan) if heading is None else heading
    known, pushes = np.asarray(np.isfinite(readings[:, :2]).all(axis=1)), np.zeros(len(readings), dtype=bool)
    spells, lonely = [], np.ones(len(readings), dtype=bool)
    for rows, phase in zip(trials, phases, strict=True):
        pushes[rows[phase == "push"]], lonely[rows] = True, False
    for rows, phase in zip(trials, phases, strict=True):
        rest, push = (rows[known[rows] & (phase == word)] for word in ("rest", "push"))
        if not (phase == "push").any():
            # a finger may press a slider that does not move
            rest = rest[is_clear(away, pushes)[rest]]
        # on the way to another contact the tool may turn
        rest = rest[~(np.abs(wrap_angle(turned[rest] - turned[rest[-1:]])) > _TURNED)]
        clear = bool(is_clear(away[rows], phase == "push")[np.isin(rows, rest)].any())
        end = _middle(readings, push[-LEAST_REST:])
        spells.append(_spell(int(rows[0]), turned, readings, rest, end, clear))
    free = np.flatnonzero(lonely & known & is_clear(away, pushes))
    rests = [rows for rows in np.split(free, 1 + np.flatnonzero(np.diff(free) > 1)) if len(rows)]
    for rows in rests:
        if len(rows) >= LEAST_REST:
            spells.append(_spell(int(rows[0]), turned, readings, rows, np.full(3, np.nan), True))
    found, result = _at_rest(spells, len(trials), phases), readings.copy()
    turns = _turns_with_tool(found)
    if not turns:
        words = "readings at rest show that the offset of the force sensor does not turn with the tool: it is taken as fixed in W"
        warnings.warn(StablepushWarning(words), stacklevel=3)
    headings = turned if turns else np.full(len(readings), np.nan)
    begins = [spell.row for spell in found]
    for spell, rows in zip(spells, trials, strict=False):
        # the last before it that shows the offset, itself if it does; else the first
        last = max(0, bisect_right(begins, spell.row) - 1)
        for other in found[last : last + 1]:
            # a moment that no rest shows is not taken off
            result[rows] -= np.nan_to_num(_turned(other, headings[rows]))
    beside = {spell.row for spell in spells[len(trials) :]} & set(begins)
    return result, [int(row) for rows in rests if int(rows[0]) in beside for row in (rows[0], rows[-1])]


def _spell(
    row: int, heading: FloatArray, readings: FloatArray, rest: np.ndarray[Any, np.dtype[np.intp]], end: FloatArray, clear: bool
) -> _Spell:
    """A spell of rows at ``rest``."""
    middle = _middle(readings, rest)
    off = np.linalg.norm(readings[rest, :2] - middle[:2], axis=1)
    # of a median, from the median of what single readings are off by
    scatter = 1.2533 * float(np.median(off)) / np.sqrt(len(rest)) if len(rest) and np.isfinite(off).all() else 0.0
    return _Spell(row, _middle(_unwrapped(heading[rest]), np.arange(len(rest))), middle, end, clear, float(scatter))


def _unwrapped(headings: FloatArray) -> FloatArray:
    """Headings (n,) within half a turn of the first that is known."""
    known = headings[np.isfinite(headings)]
    return headings if not len(known) else known[0] + wrap_angle(headings - known[0])


def _at_rest(spells: list[_Spell], trials: int, phases: Sequence[np.ndarray[Any, np.dtype[np.object_]]]) -> list[_Spell]:
    """Spells that show the offset, in the order of the record; rests of trials in which a finger presses become ``approach``."""
    order = sorted(range(len(spells)), key=lambda k: spells[k].row)
    offset = next((spells[k].rest for k in order if k < trials and spells[k].clear and spells[k].is_known), np.full(3, np.nan))
    previous, result = np.full(3, np.nan), []
    for k in order:
        spell = spells[k]
        if spell.is_known:
            # a finger that has stopped reads what it read at the end of the push before, and not the offset
            gap = float(np.linalg.norm((previous - offset)[:2]))
            if float(np.linalg.norm((spell.rest - previous)[:2])) < _PRESSES * gap:
                if k < trials:
                    phases[k][phases[k] == "rest"] = "approach"
            else:
                result.append(spell)
                offset = spell.rest
        previous = spell.end if k < trials else previous
    return result


def _turns_with_tool(found: Sequence[_Spell]) -> bool:
    """Whether the offset turns with the tool, as nearly all do: unless rests at other headings clearly agree better without."""
    fixed, turning, scatter = [], [], []
    for one, other in pairwise(found):
        if abs(wrap_angle(other.heading - one.heading)) > _TURNED:
            fixed.append(float(np.linalg.norm((other.rest - one.rest)[:2])))
            turning.append(float(np.linalg.norm(other.rest[:2] - _turned(one, np.array((other.heading,)))[0, :2])))
            scatter.append(float(np.hypot(one.scatter, other.scatter)))
    return sum(turning) <= _CLEARLY * max(sum(fixed), sum(scatter))


def _turned(spell: _Spell, headings: FloatArray) -> FloatArray:
    """What a sensor reads (n, 3) at rest when its tool has other headings (n,) in rad; NaN: the same."""
    forces = np.broadcast_to(spell.rest[:2], (len(headings), 2))
    turned = rotate_vectors(np.nan_to_num(headings - spell.heading), forces)
    return np.column_stack((turned, np.full(len(headings), spell.rest[2])))


def _middle(values: FloatArray, rows: np.ndarray[Any, np.dtype[np.intp]]) -> Any:
    """Medians over rows of what is known; NaN where they are too few."""
    columns = values[rows][:, None].T if values.ndim == 1 else values[rows].T
    found = [np.median(known) if len(known := column[np.isfinite(column)]) >= LEAST_REST else np.nan for column in columns]
    return np.array(found) if values.ndim > 1 else found[0]
