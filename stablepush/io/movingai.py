"""Grid maps of the Moving AI Lab as obstacles (format: Sturtevant, Benchmarks for Grid-Based Pathfinding, 2012)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from stablepush.core import FloatArray, InputError, check_number
from stablepush.io.json_files import read_text

#: Terrain that can be passed: ground and swamp. Out of bounds, trees and water cannot.
_FREE = frozenset(".GS")
_BLOCKED = frozenset("@OTW")


def load_movingai_map(path: str | Path, cell: float) -> tuple[list[FloatArray], tuple[float, float, float, float]]:
    """Read a ``.map`` file as rectangles and bounds.

    Parameters
    ----------
    path : path
    cell : float
        Width of a cell in m.

    Returns
    -------
    obstacles : list of array, shape (4, 2)
        Rectangles in W (m) that cover the blocked cells and no other; the map's first row is at the top.
    bounds : tuple
        ``(0, 0, width, height)`` in m.

    Raises
    ------
    InputError
        With file and line, if the file is not such a map.
    """
    width = check_number(cell, "cell", positive=True)
    lines = read_text(Path(path)).splitlines()

    def fail(line: int, words: str) -> None:
        raise InputError(f"line {line}", words, file=path)

    size: dict[str, int] = {}
    for number, (name, line) in enumerate(zip(("type", "height", "width", "map"), [*lines, "", "", "", ""], strict=False), 1):
        words = line.split()
        if not words or words[0] != name:
            fail(number, f"expected {name!r}, got {line[:40]!r}")
        if name in ("height", "width"):
            if len(words) != 2 or not re.fullmatch(r"[0-9]{1,6}", words[1]) or not 0 < int(words[1]) <= 100_000:
                fail(number, f"expected {name!r} and a whole number from 1 to 100000, got {line[:40]!r}")
            size[name] = int(words[1])
    rows = lines[4 : 4 + size["height"]]
    if len(rows) < size["height"]:
        fail(len(lines), f"expected {size['height']} rows, found {len(rows)}")
    blocked = np.zeros((size["height"], size["width"]), dtype=bool)
    for k, row in enumerate(rows):
        if len(row) != size["width"]:
            fail(k + 5, f"expected {size['width']} cells, found {len(row)}")
        for j, sign in enumerate(row):
            if sign not in _FREE and sign not in _BLOCKED:
                fail(k + 5, f"column {j + 1}: expected one of {''.join(sorted(_FREE | _BLOCKED))}, got {sign!r}")
        blocked[size["height"] - 1 - k] = [sign in _BLOCKED for sign in row]
    obstacles = [np.array(((x0, y0), (x1, y0), (x1, y1), (x0, y1))) * width for x0, y0, x1, y1 in _rectangles(blocked)]
    return obstacles, (0.0, 0.0, size["width"] * width, size["height"] * width)


def _rectangles(blocked: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Cover the true cells of a grid by rectangles ``(x0, y0, x1, y1)``: runs of a row that go on in the rows above."""
    found = []
    open_runs: dict[tuple[int, int], int] = {}
    for y in range(len(blocked) + 1):
        runs: set[tuple[int, int]] = set()
        if y < len(blocked):
            edges = np.flatnonzero(np.diff(np.concatenate(((0,), blocked[y].astype(np.int8), (0,)))))
            runs = {(int(a), int(b)) for a, b in edges.reshape(-1, 2)}
        for run in [run for run in open_runs if run not in runs]:
            found.append((run[0], open_runs.pop(run), run[1], y))
        for run in runs:
            open_runs.setdefault(run, y)
    return found
