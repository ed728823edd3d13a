"""What the scripts of this folder share: the lab's logs, the authors' splits, intervals, published numbers.

``DATA`` is a clone of the authors' repository (github.com/robinzhoucmu/MLab_EXP), or a folder that holds such files under
``raw/``. The published numbers are read from ``DATA/published.json`` (means and 95 % intervals behind the paper's figures and
tables) and the hand labels, which ``tables.py`` needs, from ``DATA/labels.csv`` (columns ``log, action, stable``).

Intervals are over splits or trials. Splits of the same few logs overlap, so the intervals are for a mean over these logs, not for
another object.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from tqdm import tqdm

import stablepush as sp
from stablepush.core.parallel import run_parallel
from stablepush.geometry.planar import angle_between, normalize_twist, unit
from stablepush.io.importers import Source, find_sources, import_source

RHO = 0.05
#: Contact friction that the authors' code uses in the stability tables (the paper says 1.0).
MU = 0.95
#: The models of the paper.
PUBLISHED = ("poly4-cvx", "poly4", "quadratic", "gp")


def parser(text: str | None, data: bool = True) -> argparse.ArgumentParser:
    """Return the arguments that all scripts take."""
    arguments = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    if data:
        arguments.add_argument("data", type=Path, metavar="DATA", help="clone of the authors' repository, or a folder with raw/")
    arguments.add_argument("--published", type=Path, help="JSON of published numbers (DATA/published.json)")
    arguments.add_argument("--jobs", type=int, default=2, help="processes")
    arguments.add_argument("--scheduler", help="Dask cluster that does the work instead; it has to find this folder's modules")
    arguments.add_argument("-o", "--output", type=Path, default=Path("paper"), help="folder for figures and numbers")
    return arguments


def published(options: argparse.Namespace) -> dict:
    """Return the published numbers, or nothing where there is no file."""
    file = options.published or (options.data / "published.json" if "data" in options else None)
    return json.loads(file.read_text(encoding="utf-8")) if file is not None and file.is_file() else {}


@cache
def pokes(data: Path, surface: str) -> dict[str, tuple[np.ndarray, np.ndarray, sp.Slider]]:
    """Return loads, twists and slider of every poking log on ``"wood"`` or ``"board"`` with three support points."""
    found = {}
    for source in _sources(data, "mlab-poke"):
        if source.labels["surface"] == surface and source.labels["arrangement"] != "patch":
            found[source.labels["arrangement"]] = _pairs(source)
    return dict(sorted(found.items()))


@cache
def pokes_as_commanded(data: Path, arrangement: str) -> tuple[np.ndarray, np.ndarray, sp.Slider, list[sp.EdgePush]]:
    """Return loads, twists, slider and what was commanded, contact point and finger heading, for the pokes of a log on wood."""
    wanted = {"surface": "wood", "arrangement": arrangement}
    (source,) = [s for s in _sources(data, "mlab-poke") if s.labels == wanted]
    log, _ = import_source(source)
    loads, twists, names = log.pairs()
    commands = []
    for trial in names:
        rows = log.rows(trial)
        rows = rows[log.samples["phase"][rows] == "push"]
        theta = log.samples["theta"][rows[0]]
        route = np.array([log.samples[axis][rows[-1]] - log.samples[axis][rows[0]] for axis in ("px", "py")])
        turn = np.array(((np.cos(theta), np.sin(theta)), (-np.sin(theta), np.cos(theta))))
        heading = unit(turn @ route)
        point = np.array([log.samples[axis][rows[0]] for axis in ("c1x", "c1y")])
        ends = [log.rig.slider.edge(i) for i in range(len(log.rig.slider.vertices))]
        normals = [unit(np.array((start[1] - end[1], end[0] - start[0]))) for start, end in ends]
        edge = int(np.argmin([abs((point - ends[i][0]) @ normals[i]) for i in range(len(ends))]))
        # the finger was where it was measured, a little beside the outline that is believed
        direction = float(np.arctan2(normals[edge][0] * heading[1] - normals[edge][1] * heading[0], normals[edge] @ heading))
        commands.append(sp.EdgePush(edge, math.dist(point, ends[edge][0]), point, normals[edge], direction))
    return loads, twists, log.rig.slider, commands


@cache
def patch_pokes(data: Path) -> tuple[np.ndarray, np.ndarray, sp.Slider]:
    """Return loads, twists and slider of the pokes on wood with full contact."""
    (source,) = [s for s in _sources(data, "mlab-poke") if s.labels["surface"] == "wood" and s.labels["arrangement"] == "patch"]
    return _pairs(source)


@cache
def labelled_rotations(data: Path) -> dict[str, tuple[list[sp.PushContact], np.ndarray, np.ndarray]]:
    """Return contacts, twists and hand labels of every two-finger log that has labels, by arrangement."""
    labels: dict[str, dict[str, bool]] = {}
    with open(data / "labels.csv", encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            labels.setdefault(row["log"], {})[row["action"]] = row["stable"] == "1"
    found = {}
    for source in _sources(data, "mlab-stable"):
        marks_of_log = next((marks for log, marks in labels.items() if source.file.name.startswith(log)), None)
        if marks_of_log is None:
            continue
        log, _ = import_source(source)
        contacts, twists, stable = [], [], []
        for i, trial in enumerate(log.trials["trial"]):
            row = log.rows(trial)[0]
            ends = np.array([[log.samples[f"c{k}{axis}"][row] for axis in "xy"] for k in (1, 2)])
            along = ends[1] - ends[0]
            # the slider is counter-clockwise: its inside lies to the left of an edge that runs that way
            inward = np.array((-along[1], along[0])) / np.linalg.norm(along)
            middle = ends.mean(axis=0)
            inward = inward if (log.rig.slider.vertices.mean(axis=0) - middle) @ inward > 0 else -inward
            contacts.append(sp.PushContact(ends, [inward, inward], MU))
            sense, cor = log.trials["sense"][i], (log.trials["cor_x"][i], log.trials["cor_y"][i])
            twists.append((sense * cor[1], -sense * cor[0], sense))
            stable.append(marks_of_log[trial])
        found[source.labels["arrangement"]] = (contacts, np.array(twists), np.array(stable))
    return found


def _sources(data: Path, kind: str) -> list[Source]:
    return find_sources(data / "raw" if (data / "raw").is_dir() else data, kind)


def _pairs(source: Source) -> tuple[np.ndarray, np.ndarray, sp.Slider]:
    log, _ = import_source(source)
    loads, twists, _ = log.pairs()
    return loads, twists, log.rig.slider


def fit_as_published(
    loads: np.ndarray, twists: np.ndarray, train: np.ndarray, validation: np.ndarray, model: str, rho: float = RHO
) -> sp.Fit:
    """Fit as the authors' code does: norm loss, weights chosen on the held-out pairs, no refit on them."""
    rows = np.concatenate((train, validation))
    validation_indices = np.arange(len(train), len(rows))
    return sp.fit_limit_surface(
        loads[rows], twists[rows], model, characteristic_length=rho, loss="norm", validation_indices=validation_indices
    )


def run_all(function: Callable, jobs: list[tuple], options: argparse.Namespace) -> list:
    """Return ``function(*job)`` of every job, computed side by side, with a progress bar for who watches."""
    done = run_parallel(function, jobs, options.jobs, scheduler=options.scheduler)
    return list(tqdm(done, total=len(jobs), desc=function.__name__, disable=None, leave=False))


def angle_error(surface: sp.LimitSurface, loads: np.ndarray, twists: np.ndarray, rho: float = RHO) -> float:
    """Return the mean angle (deg) between predicted and measured twists, in ``(vx, vy, rho omega)``."""
    angles = angle_between(normalize_twist(surface.twist(loads), rho), normalize_twist(twists, rho))
    return float(np.degrees(angles.mean()))


def matlab_permutation(state: np.random.RandomState, count: int) -> np.ndarray:
    """Return MATLAB's ``randperm(count)``, from 0, for the generator that ``rng(seed)`` starts: the order of ``count``
    uniform numbers."""
    return np.argsort(state.random_sample(count), kind="stable")


def interval(values: np.ndarray) -> tuple[float, float]:
    """Return the mean over the first axis and half its 95 % interval."""
    v = np.asarray(values, dtype=float)
    return float(v.mean()), float(1.96 * v.std(ddof=1) / np.sqrt(len(v)))


def agrees(ours: tuple[float, float], theirs: tuple[float, float]) -> bool:
    """Return whether two means differ by less than the 95 % interval of their difference."""
    return abs(ours[0] - theirs[0]) <= np.hypot(ours[1], theirs[1])
