"""``pushlog/1``: pushes as a lab records them, read and written."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import (
    LEAST_POSITIVE,
    BoolArray,
    FloatArray,
    InputError,
    Node,
    PlausibilityWarning,
    note_finger,
    note_friction,
    note_gravity,
    note_headings,
    note_noise,
    note_push_speed,
    note_scene,
    note_time,
    read_only,
)
from stablepush.effects import effects_from_node
from stablepush.geometry import compose, inverse, log, wrap_angle
from stablepush.identify import SlipPairs
from stablepush.io.formats import model_or_path, model_to_json, slider_or_path, slider_to_json
from stablepush.io.json_files import read_json
from stablepush.io.parquet import read_parquet
from stablepush.io.special_files import require_file
from stablepush.io.tables import IS_FLAG, IS_POSITIVE, IS_SENSE, Column, read_table, table_text
from stablepush.io.writing import whole_folder, write_atomically, write_json
from stablepush.objects import Slider
from stablepush.surfaces import LimitSurface

#: Files of a log.
LOG_FILES = ("rig.json", "trials.csv", "samples.csv", "samples.parquet")
CONTACT_KINDS = ("point", "two-point", "held")
PHASES = ("rest", "approach", "push", "retract")

TRIAL_NUMBERS = ("start_time", "speed", "cor_x", "cor_y", "sense", "angle", "stable")
SAMPLE_NUMBERS = (
    *("t", "x", "y", "theta", "fx", "fy", "tau", "vx", "vy", "omega"),
    *("c1x", "c1y", "c2x", "c2y", "px", "py", "ptheta"),
)
#: Noise of the moment over that of the force, in m.
_MOMENT_ARM = 0.015
#: Loads (N, N·m) and motions (m, rad) up to these are none: rounding makes as much of a slider that rests.
_NO_LOAD, _NO_MOTION = 1e-9, 1e-9
#: Columns that tables must have.
OF_TRIALS, OF_SAMPLES = ("trial", "start_time"), ("trial", "t", "x", "y", "theta")
#: Columns of text; others that the format does not know are text if they hold any.
_TEXT = ("trial", "group", "phase")

#: A slider stands that is nearer to its end than this share of its way; the share of the rows of a push in which a slider that
#: slows down is so near; rows that may be so near in any push; the last rows, as a share, whose median is the end.
_STANDS, _LONG, _FEW, _LAST = 0.002, 0.15, 3, 10
#: Nearly all noise is less than this times the median second difference of three poses in a row.
_ROUGH = 1.4


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of one row: force (N), position (m), angle (rad)."""

    force: float
    position: float
    angle: float

    @property
    def moment(self) -> float:
        """Standard deviation of the moment (N·m), that of the force at an arm of 15 mm, as sensors of fingers have it."""
        return _MOMENT_ARM * self.force


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """What the operator believes about the rig: the nominal simulation.

    ``support_friction`` and ``contact_friction`` are coefficients, ``gravity`` in m/s², ``finger_radius`` in m; None is unknown.
    ``model``: the limit surface of the nominal simulation, in place of the slider's support.
    ``twist_window``: time (s) over which the log's twists are slopes of its poses; None if they are not, or nobody knows.
    ``extra`` keeps entries of ``rig.json`` that this version does not use, so that writing loses nothing.
    """

    slider: Slider
    contact_kind: str = "point"
    support_friction: float | None = None
    contact_friction: float | None = None
    gravity: float = 9.81
    finger_radius: float | None = None
    noise: Noise | None = None
    extra: Mapping[str, Any] | None = None
    model: LimitSurface | None = None
    twist_window: float | None = None


@dataclass(frozen=True, eq=False)
class PushLog:
    """A log of pushes: a rig, and two tables as mappings from column to array.

    ``trials`` has a row for each push, ``samples`` the rows of all pushes; columns may be given as anything that numpy takes, and
    are kept read-only: text (``trial``, ``group``, ``phase``) as object arrays with ``""`` for a blank, numbers as float arrays
    with NaN for a missing value. Units and frames are those of ``pushlog/1``: SI, poses in W, wrenches, twists and contact points
    in B.

    Raises
    ------
    InputError
        If a required column is missing, columns differ in length, a value is not a number, or a row belongs to no trial.
    """

    rig: Rig
    trials: Mapping[str, Any]
    samples: Mapping[str, Any]

    def __post_init__(self) -> None:
        object.__setattr__(self, "trials", _frozen(self.trials, "trials", OF_TRIALS, TRIAL_NUMBERS))
        object.__setattr__(self, "samples", _frozen(self.samples, "samples", OF_SAMPLES, SAMPLE_NUMBERS))
        strangers = set(self.samples["trial"]) - set(self.trials["trial"])
        if strangers:
            raise InputError("samples: column trial", "expected trials of trials", f"{min(strangers)[:40]!r}")

    def __len__(self) -> int:
        return len(self.trials["trial"])

    def __repr__(self) -> str:
        rows = len(self.samples["trial"])
        return f"PushLog({len(self)} trials, {rows} rows, columns {', '.join(self.samples)}; of trials {', '.join(self.trials)})"

    def rows(self, trial: str) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Return the rows (n,) of ``samples`` that belong to a trial, in the order of the file."""
        return self._rows_by_trial.get(trial, np.zeros(0, dtype=np.intp)).copy()

    @property
    def own_columns(self) -> list[str]:
        """A lab's own columns of ``trials``, which the format does not have."""
        return [name for name in self.trials if name not in (*OF_TRIALS, *TRIAL_NUMBERS, "group")]

    def columns(self, *names: str) -> FloatArray:
        """Return columns (n, k) of numbers of ``samples`` side by side; NaN where the log has no such column."""
        blank = np.full(len(self.samples["t"]), np.nan)
        return np.stack([np.asarray(self.samples.get(name, blank), dtype=np.float64) for name in names], axis=-1)

    def pairs(self) -> SlipPairs:
        """Return a load, a slip twist and the name of each trial that has them, as fits take them.

        Both are means over the trial's ``push`` rows that have forces; twists that the log does not hold are differences
        of the poses. A log without a ``phase`` column counts every row. Trials whose mean load or twist is missing or
        zero, below 1e-9 N and N·m, or 1e-9 m and rad over the trial, are left out.
        """
        loads = self.columns("fx", "fy", "tau")
        twists = self.twists()
        times = self.samples["t"]
        phase = self.samples.get("phase")
        pushed = np.ones(len(loads), dtype=bool) if phase is None else phase == "push"
        usable = pushed & np.isfinite(loads).all(axis=1)
        f, v, names = [], [], []
        for name, rows in self._rows_by_trial.items():
            kept = rows[usable[rows]]
            moving = kept[np.isfinite(twists[kept]).all(axis=1)]
            if not len(moving):
                continue
            load, twist = loads[kept].mean(axis=0), twists[moving].mean(axis=0)
            span = float(np.ptp(times[moving]))
            if np.abs(load).max() > _NO_LOAD and np.abs(twist).max() * max(span, 1.0) > _NO_MOTION:
                f.append(load)
                v.append(twist)
                names.append(name)
        return SlipPairs(np.reshape(f, (-1, 3)), np.reshape(v, (-1, 3)), names)

    def twists(self) -> FloatArray:
        """Return the body twists (n, 3) of all rows: as logged where they are, else differentiated from the poses.

        The twist between two rows is ``log(pose_i⁻¹ pose_{i+1})/dt``, exact for a constant body twist; a row takes the mean of
        its two neighbouring intervals weighted by their length, the ends their only one. NaN where a pose is missing, and for
        rows that are not :func:`distinct`.
        """
        poses = self.columns("x", "y", "theta")
        twists = self.columns("vx", "vy", "omega")
        lacking = np.asarray(~np.isfinite(twists).all(axis=1))
        twists[lacking] = np.nan
        if not lacking.any():
            return twists
        times = self.samples["t"]
        for rows in self._rows_by_trial.values():
            known = rows[np.isfinite(poses[rows]).all(axis=1)]
            known = known[np.argsort(times[known], kind="stable")]
            known = known[distinct(times[known])]
            if len(known) < 2:
                continue
            dt = np.diff(times[known])
            step = compose(inverse(poses[known[:-1]]), poses[known[1:]])
            # logs may keep theta within a turn: between two rows the slider takes the short way
            step[:, 2] = wrap_angle(step[:, 2])
            step = log(step)
            span = np.concatenate(([0.0], dt)) + np.concatenate((dt, [0.0]))
            total = np.concatenate((np.zeros((1, 3)), step)) + np.concatenate((step, np.zeros((1, 3))))
            own = lacking[known]
            twists[known[own]] = (total / span[:, None])[own]
        return twists

    @cached_property
    def _rows_by_trial(self) -> dict[str, np.ndarray[Any, np.dtype[np.intp]]]:
        names = self.samples["trial"]
        groups: dict[str, list[int]] = {name: [] for name in self.trials["trial"]}
        for row, name in enumerate(names):
            groups[name].append(row)
        return {name: np.array(rows, dtype=np.intp) for name, rows in groups.items()}


def end_of_motion(poses: FloatArray, length: float, few: int | None = None) -> int:
    """Return how many of the poses (n, 3) of a push, in the order of time, are there until the slider stands for good.

    All n, unless the rows in which it stands are many: a finger that has stopped may press on for a while, and the load of a
    slider that stands says nothing of its friction. ``length`` (m): an angle times it counts as a distance. What scatters about a
    smooth motion is noise of the tracker. ``few``: rows in which it stands that are not many; if not given, as many as a
    motion may have that slows down.
    """
    if not len(poses):
        return 0
    path = np.column_stack((poses[:, :2], length * np.unwrap(poses[:, 2])))
    apath = np.linalg.norm(path - np.median(path[-max(1, len(path) // _LAST) :], axis=0), axis=1)
    travel = float(apath.max())
    rough = float(np.median(np.linalg.norm(np.diff(path, 2, axis=0), axis=1))) if len(path) > 2 else 0.0
    near = max(_STANDS * travel, _ROUGH * rough)
    if near >= travel / 2:
        return len(path)
    end = int(np.flatnonzero(apath > near)[-1]) + 1
    # of a steady motion as many rows as twice that share of the path are near its end
    usual = (
        max(_FEW, max(_LONG, _LONG / 3 + 2 * near / travel) * len(path))
        if few is None
        else max(few, 2 * near / travel * len(path))
    )
    return end if len(path) - end > usual else len(path)


def distinct(times: FloatArray) -> BoolArray:
    """Say which of times (n,) are far enough after the one before them, 1e-9 s, to measure a motion; the first is unless NaN."""
    return np.asarray(np.diff(times, prepend=-np.inf) >= LEAST_POSITIVE)


def read_pushlog(path: str | Path) -> PushLog:
    """Read a ``pushlog/1`` folder.

    Raises :class:`InputError` with file, line and column, or key, for whatever breaks the format.
    """
    folder = Path(path)
    if not folder.is_dir():
        made = "; stablepush import makes one of other logs" if folder.is_file() else ""
        raise InputError("", f"expected a pushlog/1 folder with rig.json, trials.csv and samples.csv{made}", file=folder)
    for name in LOG_FILES:
        require_file(folder / name)
    rig = _rig_from_node(read_json(folder / "rig.json", "pushlog/1"), folder)
    trials, trial_lines = read_table(
        folder / "trials.csv",
        required=OF_TRIALS,
        numbers=TRIAL_NUMBERS,
        filled=("trial", "start_time"),
        rules={"sense": IS_SENSE, "stable": IS_FLAG, "speed": IS_POSITIVE},
    )
    samples, places, source = _read_samples(folder)
    _check_trials(trials, trial_lines, str(folder / "trials.csv"))
    _check_samples(samples, trials, places, source)
    _doubt(rig, trials, samples, folder, source)
    for table in (trials, samples):
        for column in table.values():
            # not to be copied
            column.flags.writeable = False
    return PushLog(rig, trials, samples)


def _doubt(rig: Rig, trials: Mapping[str, Column], samples: Mapping[str, Column], folder: Path, source: str) -> None:
    """Note what looks like another unit."""
    note_gravity(rig.gravity, f"{folder / 'rig.json'}: gravity")
    note_finger(rig.finger_radius or 0.0, f"{folder / 'rig.json'}: finger_radius")
    for name in ("support", "contact"):
        note_friction(getattr(rig, f"{name}_friction") or 0.0, f"{folder / 'rig.json'}: friction.{name}")
    if rig.noise is not None:
        note_noise(rig.noise.position, rig.noise.angle, f"{folder / 'rig.json'}: noise")
    within = samples["trial"][1:] == samples["trial"][:-1]
    back = np.flatnonzero(within & (np.diff(samples["t"]) < 0))
    if len(back):
        doubt = f"the time goes back within trial {samples['trial'][back[0]]}"
        warnings.warn(PlausibilityWarning(f"{source}: row {back[0] + 2}: column t", doubt), stacklevel=2)
    note_time(float(np.nanmax(samples["t"], initial=0.0)), f"{source}: column t")
    if "speed" in trials:
        note_push_speed(float(np.nanmax(trials["speed"], initial=0.0)), f"{folder / 'trials.csv'}: column speed")
    for name in ("x", "y", "px", "py"):
        if name in samples:
            note_scene(np.nan_to_num(samples[name]), f"{source}: column {name}")
    for name in ("theta", "ptheta"):
        if name in samples:
            note_headings(samples[name], f"{source}: column {name}")


def write_pushlog(log: PushLog, path: str | Path) -> None:
    """Write a ``pushlog/1`` folder. It appears as a whole; a log that is there is replaced as a whole.

    Raises :class:`InputError` for a folder that holds files that are no part of a log.
    """
    with whole_folder(path, *LOG_FILES) as place:
        write_atomically(place / "trials.csv", table_text(log.trials))
        write_atomically(place / "samples.csv", table_text(log.samples))
        write_json(place / "rig.json", rig_to_json(log.rig))


#: Keys of ``rig.json``, and keys that this project writes there for the record.
_OF_RIG = ("format", "slider", "friction", "gravity", "contact_kind", "finger_radius", "noise", "model", "twist_window")
_FOR_THE_RECORD = ("source", "effects")


def _rig_from_node(node: Node, folder: Path) -> Rig:
    node.expect_keys(*_OF_RIG, kept=_FOR_THE_RECORD)
    friction = node["friction"]
    friction.expect_keys("support", "contact")
    noise = node.get("noise")
    if noise is not None:
        noise.expect_keys("force", "position", "angle")
    radius = node.get("finger_radius")

    effects_from_node(node.get("effects"))
    slider, model = slider_or_path(node["slider"], folder), node.get("model")
    surface = None if model is None or model.value is None else model_or_path(model, folder)
    if surface is not None and not surface.is_dual:
        model.fail("expected a limit surface that has a load for every motion", surface.kind)  # type: ignore[union-attr]
    if surface is not None and surface.force_unit == "mu*N" and not (slider.mass and friction["support"].value):
        model.fail(  # type: ignore[union-attr]
            "expected forces in N, or slider.mass and friction.support", "forces in units of mu*N"
        )

    def or_null(child: Node) -> float | None:
        return None if child.value is None else child.number(at_least=0.0)

    return Rig(
        slider=slider,
        contact_kind=node["contact_kind"].text(CONTACT_KINDS),
        support_friction=None if friction["support"].value is None else friction["support"].zero_or_positive(),
        contact_friction=or_null(friction["contact"]),
        gravity=node["gravity"].number(positive=True),
        finger_radius=None if radius is None else or_null(radius),
        noise=None if noise is None else Noise(*(noise[key].number(at_least=0.0) for key in ("force", "position", "angle"))),
        extra={k: v for k, v in node.object().items() if k not in _OF_RIG},
        model=surface,
        twist_window=None if node.get("twist_window") is None else node["twist_window"].number(positive=True),
    )


def rig_to_json(rig: Rig) -> dict[str, Any]:
    """Return the ``rig.json`` of a rig."""
    noise = rig.noise
    return {
        "format": "pushlog/1",
        "slider": slider_to_json(rig.slider),
        "friction": {"support": rig.support_friction, "contact": rig.contact_friction},
        "gravity": rig.gravity,
        "contact_kind": rig.contact_kind,
        "finger_radius": rig.finger_radius,
        "noise": None if noise is None else {"force": noise.force, "position": noise.position, "angle": noise.angle},
        **({} if rig.model is None else {"model": model_to_json(rig.model)}),
        **({} if rig.twist_window is None else {"twist_window": rig.twist_window}),
        **(rig.extra or {}),
    }


def _read_samples(folder: Path) -> tuple[dict[str, Column], Callable[[int], str], str]:
    """Columns, what says the place of a row in the file, and the file."""
    table, parquet = folder / "samples.csv", folder / "samples.parquet"
    required, filled = OF_SAMPLES, ("trial", "t")
    if parquet.exists() and not table.exists():
        columns = read_parquet(parquet, required=required, numbers=SAMPLE_NUMBERS, filled=filled)
        return columns, lambda row: f"row {row + 1}", str(parquet)
    columns, lines = read_table(table, required=required, numbers=SAMPLE_NUMBERS, filled=filled)
    return columns, lambda row: f"line {lines[row]}", str(table)


def _check_trials(trials: Mapping[str, Column], lines: Sequence[int], source: str) -> None:
    if len(trials["trial"]) == 0:
        raise InputError("", "expected at least one trial", file=source)
    seen: dict[str, int] = {}
    for row, name in enumerate(trials["trial"]):
        if name in seen:
            raise InputError(
                f"line {lines[row]}: column trial", f"expected each trial once, {name[:40]!r} stands twice", file=source
            )
        seen[name] = row


def _check_samples(samples: Mapping[str, Column], trials: Mapping[str, Column], place: Callable[[int], str], source: str) -> None:
    if len(samples["trial"]) == 0:
        raise InputError("", "expected at least one row", file=source)
    known = set(trials["trial"])
    for row, name in enumerate(samples["trial"]):
        if name not in known:
            raise InputError(f"{place(row)}: column trial", "expected a trial of trials.csv", f"{name[:40]!r}", file=source)
    if "phase" in samples:
        for row, phase in enumerate(samples["phase"]):
            if phase and phase not in PHASES:
                raise InputError(
                    f"{place(row)}: column phase", f"expected {', '.join(PHASES)} or a blank", f"{phase[:40]!r}", file=source
                )


def _frozen(table: Mapping[str, Any], word: str, required: Sequence[str], numbers: Sequence[str]) -> dict[str, Column]:
    """Return a table with read-only columns of equal length: text as object arrays, numbers as float64."""
    for name in required:
        if name not in table:
            raise InputError(f"{word}: column {name}", "missing column")
    result = {name: _column(values, name in numbers, name in _TEXT, f"{word}: column {name}") for name, values in table.items()}
    rows = len(result[required[0]])
    for name, column in result.items():
        if len(column) != rows:
            raise InputError(f"{word}: column {name}", f"expected {rows} values, as many as trial has", len(column))
    return result


def _column(values: Any, is_number: bool, is_text: bool, place: str) -> Column:
    column = values if isinstance(values, np.ndarray) else np.asarray(values, dtype=object)
    if column.ndim != 1:
        raise InputError(place, "expected a list of values", f"an array of shape {column.shape}")
    is_text = is_text or (not is_number and any(isinstance(v, str) for v in column))
    if not column.flags.writeable and column.dtype == (object if is_text else np.float64):
        # as a log has it that was read
        return column
    if not is_text:
        try:
            return read_only(column)
        except (TypeError, ValueError, OverflowError):
            raise InputError(place, "expected numbers") from None
    words: dict[str, str] = {}
    missing = [v is None or (isinstance(v, float) and math.isnan(v)) for v in column]
    text = ["" if blank else words.setdefault(str(v), str(v)) for v, blank in zip(column.tolist(), missing, strict=True)]
    result = np.array(text, dtype=object)
    result.flags.writeable = False
    return result
