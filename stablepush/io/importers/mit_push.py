"""Pushes of the MIT data set (Yu, Bauza, Fazeli, Rodriguez, "More than a million ways to be pushed", IROS 2016).

One push a file, JSON or HDF5 with the same names: ``object_pose`` rows ``[t, x, y, theta]``, ``tip_pose`` rows ``[t, x, y, …]``,
both in the robot's frame (m, rad), ``ft_wrench`` rows ``[t, fx, fy, torque]`` (N, N·m); clocks of about 250 Hz in s since 1970.
A folder of files is one log. What the name of a file says, as in
``motion_surface=plywood_shape=hex_a=0_v=150_i=1.000_s=0.000_t=-0.349.json``, goes into ``trials.csv``.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError, StablepushWarning, UnavailableError, real_path
from stablepush.io.importers.registry import Source, name_of, within
from stablepush.io.importers.streams import Stream, on_one_clock, without_leaps
from stablepush.io.json_files import read_json
from stablepush.io.log_warnings import doubts
from stablepush.io.pushlog import PushLog, Rig
from stablepush.io.world import centered_rig, log_from_arrays
from stablepush.objects import Slider

#: Radius (m) of the tip; rows (Hz) of a log, means of the recording's.
_TIP, _RATE = 0.00475, 50.0
#: Names of the three streams, and the least numbers of a row.
_STREAMS = {"object_pose": 4, "tip_pose": 3, "ft_wrench": 4}
#: Largest time (s) between two samples.
_LARGEST_GAP = 0.1
_LOADS = ("fx", "fy", "tau")
#: Endings of the files.
_ENDINGS = (".json", ".h5", ".hdf5")
#: The parts of a name: column of ``trials.csv``, and its unit in SI.
_PARTS = {"a": ("acceleration", 1e-3), "v": ("speed", 1e-3), "i": ("edge", 1.0), "s": ("place", 1.0), "t": ("direction", 1.0)}


class MitPushes:
    """Importer of pushes of the MIT data set: kind ``mit-push``."""

    def find(self, root: Path) -> Iterator[Source]:
        if root.is_file():
            files = [root] if root.suffix.lower() in _ENDINGS and _labels(root) else []
        else:
            files = sorted(file for file in root.rglob("*surface=*") if file.suffix.lower() in _ENDINGS)
        for folder in dict.fromkeys(file.parent for file in files):
            # a file that is named stands for itself, a folder for all of its files
            place = root if root.is_file() else folder
            yield Source("mit-push", place, name_of(real_path(place)), {})

    def read(self, source: Source, slider: Slider | None) -> tuple[PushLog, list[str]]:
        if slider is None:
            raise InputError("--slider", "expected the outline in the frame of object_pose, as a slider/1 file", file=source.file)
        files = [source.file]
        if source.file.is_dir():
            files = sorted(file for file in source.file.glob("*surface=*") if file.suffix.lower() in _ENDINGS)
        rig, middle = centered_rig(Rig(slider, contact_kind="point", finger_radius=_TIP, extra={"source": {"kind": source.kind}}))
        notes, logs, numbers = [], [], []
        surfaces = {(_labels(file).get("surface"), _labels(file).get("shape")) for file in files}
        if len(surfaces) > 1:
            words = " and ".join(sorted(f"{shape} on {surface}" for surface, shape in surfaces))
            raise InputError("", "expected the pushes of one shape on one surface in a folder", words, file=source.file)
        for file in files:
            try:
                with within(file):
                    log, begin, lacking = _push(file, rig, middle)
                    logs.append((log, begin))
                    notes += lacking
                    numbers.append(_labels(file))
            except InputError as error:
                if len(files) == 1:
                    raise
                notes.append(f"skipped: {error}")
        if not logs:
            raise InputError("", f"expected at least one usable push, of {len(files)}: {notes[0]}", file=source.file)
        log = _joined(logs, numbers)
        return log, [*notes, *doubts(log)]


PUSHES = MitPushes()


def _push(file: Path, rig: Rig, middle: FloatArray) -> tuple[PushLog, float, list[str]]:
    """The log of one push, when its clock begins (s since 1970), and notes on its streams."""
    found = _json(file) if file.suffix.lower() == ".json" else _hdf5(file)
    streams = [
        Stream(name, found[name][:, 0], found[name][:, 1 : 4 if name != "tip_pose" else 3], 2 if name == "object_pose" else None)
        for name in _STREAMS
    ]
    body, tip, force = streams
    body, of_body = without_leaps(body, rig.slider.characteristic_length)
    force, of_force = without_leaps(force)
    t, (poses, tips, loads), notes = on_one_clock([body, tip, force], _RATE, _LARGEST_GAP)
    assert loads is not None and poses is not None
    with warnings.catch_warnings():
        # the sign of the forces is that of all pushes together: what looks wrong is told of the whole log
        warnings.simplefilter("ignore", StablepushWarning)
        log = log_from_arrays(rig, t - t[0], poses, loads[:, :2], tips, ["1"] * len(t), body_pose=middle, window=3 / _RATE)
    return log, float(t[0]), [f"{file.name}: {words}" for words in (*of_body, *of_force, *notes)]


def _joined(logs: list[tuple[PushLog, float]], labels: list[dict[str, str]]) -> PushLog:
    """One log of many pushes, in the order of their time."""
    order = np.argsort([begin for _, begin in logs], kind="stable")
    names = [str(k + 1) for k in range(len(logs))]
    trials: dict[str, Any] = {"trial": names, "start_time": [], "group": []}
    samples: dict[str, list[Any]] = {"trial": []}
    trials |= {column: [] for column, _ in _PARTS.values()}
    origin = min(begin for _, begin in logs)
    for name, k in zip(names, order, strict=True):
        log, begin = logs[k]
        trials["start_time"].append(begin - origin)
        # the same commanded push: repeats differ in nothing that a whole name says, but for its number
        whole = all(key in labels[k] for key in _PARTS)
        trials["group"].append(" ".join(f"{key}={labels[k][key]}" for key in _PARTS) if whole else "")
        for key, (column, unit) in _PARTS.items():
            trials[column].append(unit * float(labels[k][key]) if key in labels[k] else np.nan)
        trials["speed"][-1] = trials["speed"][-1] if trials["speed"][-1] > 0 else np.nan
        samples["trial"] += [name] * len(log.samples["t"])
        for column, values in log.samples.items():
            if column != "trial":
                samples.setdefault(column, []).extend(values.tolist())
    # the sign of the forces is that which does work on the slider, over all pushes together
    power = sum(np.nansum(np.multiply(samples[f], samples[v])) for f, v in zip(_LOADS, ("vx", "vy", "omega"), strict=True))
    if power < 0:
        samples |= {column: (-np.array(samples[column])).tolist() for column in _LOADS}
    # with the window of its twists
    return PushLog(logs[0][0].rig, trials, samples)


def _labels(file: Path) -> dict[str, str]:
    """What the name of a file says: words and numbers by their key."""
    words = file.name.removesuffix(file.suffix).split("=")
    # between two signs stand the value of the one and the key of the next
    values = [*(word.rpartition("_")[0] for word in words[1:-1]), words[-1]]
    found = {before.rpartition("_")[2]: value for before, value in zip(words[:-1], values, strict=True)} if words[1:] else {}
    for key in _PARTS:
        try:
            usable = math.isfinite(float(found.get(key, "0")))
        except ValueError:
            usable = False
        if not usable:
            del found[key]
    return found if "surface" in found else {}


def _json(file: Path) -> dict[str, FloatArray]:
    root = read_json(file)
    return {name: _rows(root[name].value, name, file) for name in _STREAMS}


def _hdf5(file: Path) -> dict[str, FloatArray]:
    try:
        import h5py
    except ImportError:
        raise UnavailableError("hdf5: expected the extra hdf5: pip install 'stablepush[hdf5]'") from None
    try:
        with h5py.File(file, "r") as data:
            found = {name: data[name][()] if name in data else None for name in _STREAMS}
    except (OSError, KeyError, AttributeError, TypeError) as error:
        raise InputError("", f"expected HDF5: {' '.join(str(error).split())[:200]}", file=file) from None
    return {name: _rows(value, name, file) for name, value in found.items()}


def _rows(value: Any, name: str, file: Path) -> FloatArray:
    """Rows (n, k) of finite numbers."""
    if value is None:
        raise InputError(name, "missing key", file=file)
    try:
        rows = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(name, "expected rows of numbers, all of one length", file=file) from None
    if rows.ndim != 2 or len(rows) < 2 or rows.shape[1] < _STREAMS[name]:
        raise InputError(
            name, f"expected two or more rows of at least {_STREAMS[name]} numbers", f"shape {rows.shape}", file=file
        )
    if not np.isfinite(rows).all():
        raise InputError(f"{name}[{int(np.argmin(np.isfinite(rows).all(axis=1)))}]", "expected finite numbers", file=file)
    return rows
