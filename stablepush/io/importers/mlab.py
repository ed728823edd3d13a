"""Raw logs of the Manipulation Lab's pushing robot (Zhou et al. 2016): single pokes and two-finger rotations.

Both are whitespace-separated text: a count; then for each push the tracked pose of the slider before and after (x y z in mm,
quaternion w x y z), a count and rows ``t fx fy`` of the force sensor (epoch s, N), a count and rows ``t x y z qw qx qy qz`` of
the robot (mm). A two-finger log has a neighbour that lists the commanded actions. The slider is a right triangle with
legs of 150 mm; its tracked frame sits in the corner with the right angle, its COM at (50, 50) mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import LARGEST_MAGNITUDE, FloatArray, InputError, real_path
from stablepush.geometry import compose, exp, inverse, rotate_vectors, transform_points, wrap_angle, wrench_from_force
from stablepush.io.importers.registry import Source, name_of
from stablepush.io.json_files import read_text
from stablepush.io.pushlog import PushLog, Rig
from stablepush.objects import Slider, SupportDistribution

#: Legs of the triangle and its COM, from the right-angle corner (m); mass (kg).
_LEG = 0.150
_COM = np.array((0.050, 0.050))
_MASS = 1.508
#: Coefficient of friction of fingers and slider, taped on both sides, as the paper measured it.
_CONTACT_FRICTION = 1.0
#: Coefficient of support friction: mean friction force over weight on each surface.
_SUPPORT_FRICTION = {"wood": 0.34, "board": 0.28}
#: Speed of a poke (m/s) and half the distance of the two fingers (m), as the paper gives them.
_POKE_SPEED = 0.0025
_HALF_SPACING = 0.025
#: The sensor's axes in the robot's frame; a reflection, for the sensor hangs upside down.
_SENSOR = np.sqrt(0.5) * np.array(((1.0, 1.0), (1.0, -1.0)))
#: Spacing (m) of the points that stand for even pressure.
_PATCH_SPACING = 0.01
#: A tracked pose tilted by more than this (rad) off the table is a failure of the tracker.
_LARGEST_TILT = math.radians(20)
#: A two-finger push counts as stable below these errors of the final pose: heading (rad), along the normal and along
#: the edge (m).
_STABLE_LIMITS = (math.radians(0.95), 0.002, 0.010)
#: Columns of a row that are lengths, forces or quaternions, by the number of its columns; others begin with epoch seconds.
_LIMITED = {7: slice(0, None), 3: slice(1, None), 8: slice(1, None)}
_ROBOT_ROW = 8
#: Two-finger logs whose folder name is not the surface and support that were under the slider, by the time of the log.
_RELABELLED = {
    "Sun Sep  6 15:08:02 2015": ("poster", "30_90_30_30_30_90"),
    "Sun Sep  6 14:36:57 2015": ("wood", "30_90_30_30_30_90"),
    "Sun Sep  6 15:53:10 2015": ("poster", "patch"),
}


@dataclass(frozen=True, slots=True, eq=False)
class RawPush:
    """One record: tracked poses before and after (7,), force rows (n, 3), robot rows (m, 8), as in the file."""

    before: FloatArray
    after: FloatArray
    forces: FloatArray
    robot: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Action:
    """A commanded two-finger rotation, in the corner frame: m and rad."""

    point: FloatArray
    cor: FloatArray
    normal: FloatArray
    angle: float
    approach: float


@dataclass(frozen=True, slots=True)
class LabLogs:
    """Importer of one kind of the laboratory's logs; their labels are ``surface`` and ``arrangement`` of the support."""

    kind: str

    def find(self, root: Path) -> Iterator[Source]:
        """Return the logs of this kind, by their first lines and their names."""
        files = [root] if root.is_file() else sorted(root.rglob("*.txt"))
        # their logs are text files: a CSV table is somebody else's
        files = [file for file in files if file.suffix.lower() != ".csv"]
        return (_name_source(self.kind, f) for f in files if _kind_of(f, f == root) == self.kind)

    def read(self, source: Source, slider: Slider | None) -> tuple[PushLog, list[str]]:
        """Return a log with the laboratory's triangle, or with another slider."""
        surface, arrangement = source.labels["surface"], source.labels["arrangement"]
        rig = Rig(
            slider=triangle_slider(arrangement) if slider is None else slider,
            contact_kind="point" if self.kind == "mlab-poke" else "two-point",
            support_friction=_SUPPORT_FRICTION.get(surface),
            contact_friction=_CONTACT_FRICTION,
            extra={"source": {"kind": source.kind, "surface": surface, "arrangement": arrangement}},
        )
        pushes, notes = read_raw(source.file)
        if self.kind == "mlab-poke":
            trials, samples, more = _poke_tables(pushes)
        else:
            trials, samples, more = _rotation_tables(pushes, read_actions(_actions_file(source.file)))
        notes += more
        if not trials["trial"]:
            raise InputError("", "expected at least one usable push", file=source.file)
        return PushLog(rig, trials, samples), [f"{source.file}: {note}" for note in notes]


POKES, ROTATIONS = LabLogs("mlab-poke"), LabLogs("mlab-stable")


def triangle_slider(arrangement: str) -> Slider:
    """Return the lab's triangle with the support that a folder name lists; no support if the name lists none.

    ``x1_x2_x3_y1_y2_y3`` are three screws in mm from the corner; their loads follow from the COM. ``patch`` is even pressure.
    """
    outline = np.array(((0.0, 0.0), (_LEG, 0.0), (0.0, _LEG))) - _COM
    return Slider(outline, _MASS, _support(arrangement, outline))


def _support(arrangement: str, outline: FloatArray) -> SupportDistribution | None:
    if arrangement == "patch":
        even = SupportDistribution.from_polygon(outline, _PATCH_SPACING)
        # corners without load: what can press on the table is the whole outline, not the hull of the cells' centres
        return SupportDistribution(np.vstack((even.points, outline)), np.concatenate((even.weights, np.zeros(3))))
    coordinates = _coordinates(arrangement)
    if coordinates is None:
        return None
    points = np.array(coordinates).reshape(2, 3).T / 1000 - _COM
    # three unknown loads: their sum, and the moments about the COM
    try:
        loads = np.linalg.solve(np.vstack((np.ones(3), points.T)), (1.0, 0.0, 0.0))
    except np.linalg.LinAlgError:
        # screws on a line
        return None
    # a screw that carries nothing may carry less by rounding
    return SupportDistribution(points, np.maximum(loads, 0.0)) if loads.min() >= -1e-9 else None


def _coordinates(arrangement: str) -> list[float] | None:
    parts = arrangement.split("_")
    try:
        values = [float(p) for p in parts]
    except ValueError:
        return None
    return values if len(values) == 6 else None


def _kind_of(file: Path, explicit: bool) -> str | None:
    """Tell the kind of a file from its name and first lines; a file that is given directly is never skipped silently."""
    if "pushaction" in file.name:
        return None
    if not explicit and file.stat().st_size == 0:
        return None
    try:
        with open(file, encoding="utf-8") as stream:
            head = [line.split() for line in (stream.readline(400) for _ in range(4))]
    except (OSError, UnicodeDecodeError):
        head = []
    fits = [len(line) for line in head] == [1, 7, 7, 1] and all(_is_number(cell) for line in head for cell in line)
    if not fits and not explicit:
        return None
    return "mlab-stable" if "_sensor" in file.name else "mlab-poke"


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _actions_file(file: Path) -> Path:
    return file.with_name(file.name.replace("_sensor", "_pushaction"))


def _name_source(kind: str, file: Path) -> Source:
    folder = real_path(file).parent.name
    surface, _, rest = folder.partition("_")
    if kind == "mlab-stable":
        surface, rest, name = "poster", folder, f"poster_{name_of(Path(folder))}_stable"
        for stamp, (told, arrangement) in _RELABELLED.items():
            if stamp in file.name:
                surface, rest, name = told, arrangement, f"{told}_{arrangement}_stable"
    elif surface == "wood":
        name = name_of(Path(folder))
    elif folder == "patch" or _coordinates(folder) is not None:
        surface, rest, name = "board", folder, f"board_{folder}"
    else:
        surface, rest, name = "", folder, name_of(Path(folder))
    return Source(kind, file, name, {"surface": surface, "arrangement": rest})


def read_raw(file: Path) -> tuple[list[RawPush], list[str]]:
    """Read the records of a raw log; a log that ends early gives the whole records and a note."""
    lines = _lines(file)
    _, declared = _numbers(next(lines), file, 1)
    pushes: list[RawPush] = []
    notes: list[str] = []
    try:
        for _ in range(int(declared[0])):
            before = _numbers(next(lines), file, 7)[1]
            after = _numbers(next(lines), file, 7)[1]
            forces = _block(lines, file, 3)
            robot = _block(lines, file, 8)
            pushes.append(RawPush(before, after, forces, robot))
    except StopIteration:
        notes.append(f"declares {int(declared[0])} pushes and ends after {len(pushes)}")
    if not pushes:
        raise InputError("", "expected at least one whole record", file=file)
    return pushes, notes


def read_actions(file: Path) -> list[Action]:
    """Read the commanded two-finger rotations."""
    lines = _lines(file)
    _, count = _numbers(next(lines), file, 1)
    actions: list[Action] = []
    try:
        for _ in range(int(count[0])):
            number, kind = next(lines)
            if kind != "TwoPointRotation":
                raise InputError(f"line {number}", "expected TwoPointRotation", f"{kind[:40]!r}", file=file)
            point, cor, normal = (_numbers(next(lines), file, 3)[1] for _ in range(3))
            angle, approach = _numbers(next(lines), file, 2)[1]
            actions.append(Action(point[:2] / 1000, cor[:2] / 1000, normal[:2], math.radians(angle), approach / 1000))
    except StopIteration:
        raise InputError("", f"expected {int(count[0])} actions, the file ends in number {len(actions) + 1}", file=file) from None
    return actions


def _lines(file: Path) -> Iterator[tuple[int, str]]:
    text = read_text(file)
    lines = ((n, line.strip()) for n, line in enumerate(text.splitlines(), 1))
    kept = ((n, line) for n, line in lines if line)
    first = next(kept, None)
    if first is None:
        raise InputError("line 1", "expected the number of pushes, the file is empty", file=file)
    yield first
    yield from kept


def _numbers(line: tuple[int, str], file: Path, count: int) -> tuple[int, FloatArray]:
    number, text = line
    cells = text.split()
    try:
        values = np.array([float(c) for c in cells])
    except ValueError:
        values = np.full(1, np.nan)
    if len(cells) != count or not np.isfinite(values).all():
        raise InputError(f"line {number}", f"expected {count} finite number{'s' * (count > 1)}", f"{text[:60]!r}", file=file)
    if count in _LIMITED and np.abs(values[_LIMITED[count]]).max() > LARGEST_MAGNITUDE:
        raise InputError(f"line {number}", f"expected magnitudes of at most {LARGEST_MAGNITUDE:g}", f"{text[:60]!r}", file=file)
    if count == _ROBOT_ROW and not 0.5 < np.linalg.norm(values[4:]) < 2.0:
        raise InputError(f"line {number}", "expected a quaternion in the last four numbers", f"{text[:60]!r}", file=file)
    if count == 1 and (values[0] < 0 or values[0] != int(values[0])):
        raise InputError(f"line {number}", "expected a count", f"{text[:60]!r}", file=file)
    return number, values


def _block(lines: Iterator[tuple[int, str]], file: Path, width: int) -> FloatArray:
    count = int(_numbers(next(lines), file, 1)[1][0])
    rows = [_numbers(next(lines), file, width)[1] for _ in range(count)]
    return np.array(rows).reshape(-1, width)


def _heading(quaternions: FloatArray) -> FloatArray:
    """Yaw (...) of quaternions (..., 4) w x y z of any length: the turn about z in the swing-twist split, ``2 atan2(z, w)``."""
    return np.asarray(wrap_angle(2 * np.arctan2(quaternions[..., 3], quaternions[..., 0])))


def _com_pose(tracked: FloatArray) -> tuple[FloatArray, float]:
    """Pose (3,) of B in W (m, rad) from a tracked corner pose (7,), and its tilt off the table (rad).

    The COM is carried along in 3-D and then projected: with the tracker's tilt of up to a degree that is 0.1 mm.
    """
    norm = float(np.linalg.norm(tracked[3:]))
    if not 0.5 < norm < 2.0:  # what some trackers write when they see nothing
        return np.full(3, np.nan), math.pi
    w, x, y, z = tracked[3:] / norm
    columns = np.array(((1 - 2 * (y * y + z * z), 2 * (x * y - w * z)), (2 * (x * y + w * z), 1 - 2 * (x * x + z * z))))
    com = tracked[:2] / 1000 + columns @ _COM
    tilt = math.acos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0))
    return np.array((*com, float(_heading(tracked[3:])))), tilt


def _poke_tables(pushes: list[RawPush]) -> tuple[dict[str, Any], dict[str, Any], list[str]]:
    """Reduce pokes as the paper's authors do, so that a trial's means over its push rows are their (F, V) pair.

    Forces are turned from the sensor into the world by the robot's yaw and taken relative to the first sample, which is
    before contact. Push rows are the samples from 30 % of the poke on whose force is at least the mean force; over them
    the slider goes evenly from the pose before to the pose after. The twist of every push row is the displacement, seen
    in B as it stood before the poke, over the time of the push rows: a poke turns the slider by a few degrees, and
    within it only the ends are measured.

    The pairs that the authors stored differ by up to 0.0014 deg in the twist and 5 mN (0.07 deg) in the load: they take
    the robot's yaw from its quaternion, rounded to three decimals, by way of a rotation matrix that is not normalised.
    """
    trials: dict[str, Any] = {key: [] for key in ("trial", "start_time", "group", "speed")}
    columns = (
        "trial", "t", "x", "y", "theta", "fx", "fy", "tau", "vx", "vy", "omega", "c1x", "c1y", "px", "py", "phase",
    )  # fmt: skip
    samples: dict[str, Any] = {key: [] for key in columns}
    notes: list[str] = []
    origin = min((p.forces[0, 0] for p in pushes if len(p.forces)), default=0.0)
    for number, push in enumerate(pushes, 1):
        (before, tilt_0), (after, tilt_1) = _com_pose(push.before), _com_pose(push.after)
        if wrong := _what_is_wrong(push):
            notes.append(f"push {number}: left out, {wrong}")
            continue
        if max(tilt_0, tilt_1) > _LARGEST_TILT:
            notes.append(f"push {number}: left out, the tracked pose is tilted by {math.degrees(max(tilt_0, tilt_1)):.0f} deg")
            continue
        after[2] = before[2] + wrap_angle(after[2] - before[2])
        n = len(push.forces)
        seconds = push.forces[:, 0]
        sensed = -push.forces[:, 1:] @ _SENSOR.T
        sensed = sensed - sensed[0]
        strong = (sensed**2).sum(axis=1) >= (sensed.mean(axis=0) ** 2).sum()
        kept = np.flatnonzero((np.arange(1, n + 1) >= math.ceil(0.3 * n)) & strong)
        if not len(kept):
            notes.append(f"push {number}: left out, no force stands out")
            continue
        robot_path = np.column_stack((push.robot[:, 1:3] / 1000, np.unwrap(_heading(push.robot[:, 4:]))))
        robot = _interpolate(seconds, push.robot[:, 0], robot_path)
        share = np.clip((np.arange(n) - kept[0]) / max(1, kept[-1] - kept[0]), 0.0, 1.0)
        share[kept] = np.linspace(0.0, 1.0, len(kept))
        poses = before + share[:, None] * (after - before)
        force = rotate_vectors(robot[:, 2] - poses[:, 2], sensed)
        finger = transform_points(inverse(poses), robot[:, None, :2])[:, 0]
        wrench = wrench_from_force(finger, force)
        phase = np.full(n, "", dtype=object)
        phase[: kept[0]], phase[kept[-1] + 1 :], phase[kept] = "approach", "retract", "push"
        duration = max(seconds[kept[-1]] - seconds[kept[0]], 1e-3)
        motion = compose(inverse(before), after) / duration
        twist = np.full((n, 3), np.nan)
        twist[kept] = motion
        trials["trial"].append(str(number))
        trials["start_time"].append(seconds[0] - origin)
        trials["group"].append("")
        trials["speed"].append(_POKE_SPEED)
        rows = (seconds - seconds[0], *poses.T, *wrench.T, *twist.T, *finger.T, *robot.T[:2], phase)
        samples["trial"].extend([str(number)] * n)
        for key, values in zip(columns[1:], rows, strict=True):
            samples[key].extend(values)
    return trials, samples, notes


def _what_is_wrong(push: RawPush) -> str:
    """Why the record of a poke shows no load and no motion; empty if it does."""
    if len(push.forces) < 10 or len(push.robot) < 2:
        return "expected at least 10 force and 2 robot rows"
    if wrong := _unusable(push):
        return wrong
    if push.robot[0, 0] > push.forces[-1, 0] or push.robot[-1, 0] < push.forces[0, 0]:
        return "forces and robot were recorded at different times"
    if not np.ptp(push.forces[:, 1:], axis=0).any():
        return "its forces do not change: is the sensor stuck?"
    return ""


def _unusable(push: RawPush) -> str:
    """Why a record says nothing of a push, be it of pokes or of rotations: its clock, its robot or its tracker; else empty."""
    for name, stamps in (("forces", push.forces[:, 0]), ("robot", push.robot[:, 0])):
        if (back := -float(np.diff(stamps).min(initial=0.0))) > 0:
            return f"expected stamps that grow, those of the {name} go back by {back:.3g} s"
    if len(push.robot) > 1 and not np.ptp(push.robot[:, 1:3], axis=0).any():
        return "the robot does not move: did its record stop?"
    if np.array_equal(push.before, push.after):
        return "its poses before and after are the same: did the tracker freeze, or the finger miss?"
    return ""


def _interpolate(at: FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    """Linear interpolation of rows (n, k), and linear extrapolation beyond the ends."""
    i = np.clip(np.searchsorted(times, at) - 1, 0, len(times) - 2)
    span = times[i + 1] - times[i]
    share = np.divide(at - times[i], span, out=np.zeros_like(at), where=span > 0)
    return np.asarray(values[i] + share[:, None] * (values[i + 1] - values[i]))


def _rotation_tables(pushes: list[RawPush], actions: list[Action]) -> tuple[dict[str, Any], dict[str, Any], list[str]]:
    """Two-finger rotations: commanded motion, poses before and after, the robot's path, and whether the push held.

    A push held when the slider ended where the command would have carried it: heading, and the push point's error along
    the normal and along the edge, within the limits. Forces are not kept: they cover the first half of the path at most, and
    the sensor has no reading before contact to refer to.
    """
    trial_keys = ("trial", "start_time", "group", "cor_x", "cor_y", "sense", "angle", "stable")
    trials: dict[str, Any] = {key: [] for key in trial_keys}
    columns = ("trial", "t", "x", "y", "theta", "c1x", "c1y", "c2x", "c2y", "px", "py", "phase")
    samples: dict[str, Any] = {key: [] for key in columns}
    notes = ["forces left out: they cover only part of a push and lack a reading without load"]
    if len(actions) != len(pushes):
        notes.append(f"{len(actions)} actions for {len(pushes)} pushes: the first {min(len(actions), len(pushes))} are used")
    starts = [p.robot[0, 0] if len(p.robot) else p.forces[0, 0] if len(p.forces) else np.nan for p in pushes]
    origin = float(np.nanmin(starts)) if np.isfinite(starts).any() else 0.0
    for number, (push, action, start) in enumerate(zip(pushes, actions, starts, strict=False), 1):
        (before, tilt_0), (after, tilt_1) = _com_pose(push.before), _com_pose(push.after)
        if wrong := _unusable(push):
            notes.append(f"push {number}: left out, {wrong}")
            continue
        tracked = (tilt_0 <= _LARGEST_TILT, tilt_1 <= _LARGEST_TILT)
        if not all(tracked):
            notes.append(f"push {number}: a tracked pose is tilted by {math.degrees(max(tilt_0, tilt_1)):.0f} deg and left out")
        cor, point, normal = action.cor - _COM, action.point - _COM, action.normal
        edge = np.array((-normal[1], normal[0]))
        stable = np.nan
        # a pose after the push that is tilted off the table is no measurement, but nor is it where the command leads
        if tracked[0]:
            expected = compose(before, exp(np.array((cor[1], -cor[0], 1.0)) * action.angle))
            error = compose(inverse(expected), after)
            slip = transform_points(error, point[None])[0] - point
            errors = (abs(float(wrap_angle(error[2]))), abs(slip @ normal), abs(slip @ edge))
            stable = float(all(m < limit for m, limit in zip(errors, _STABLE_LIMITS, strict=True)))
        trials["trial"].append(str(number))
        trials["start_time"].append(start - origin if math.isfinite(start) else float(number))
        trials["group"].append("")
        for key, value in zip(trial_keys[3:], (*cor, np.sign(action.angle), action.angle, stable), strict=True):
            trials[key].append(value)
        fingers = (*(point - _HALF_SPACING * edge), *(point + _HALF_SPACING * edge))
        seconds = push.robot[:, 0] - start if len(push.robot) else np.empty(0)
        blank = (np.nan,) * 3
        rows: list[tuple[Any, ...]] = [(0.0, *(before if tracked[0] else blank), *fingers, np.nan, np.nan, "rest")]
        rows += [
            (t, *blank, *(np.nan,) * 4, x / 1000, y / 1000, "push") for t, (x, y) in zip(seconds, push.robot[:, 1:3], strict=True)
        ]
        end = seconds[-1] if len(seconds) else 0.0
        rows.append((end, *(after if tracked[1] else blank), *(np.nan,) * 6, "retract"))
        samples["trial"].extend([str(number)] * len(rows))
        for key, values in zip(columns[1:], zip(*rows, strict=True), strict=True):
            samples[key].extend(values)
    return trials, samples, notes
