"""A plan in time: poses and velocities of slider and pusher at a uniform step, from rest to rest, as CSV.

Scenes and plans place a pusher by the frame of its contact points; trajectories and logs by that of the centres of its fingers,
which lies behind it by the radius of the fingers where they have one normal: ``pusher = docked * (-finger_radius, 0, 0)``. Both
are on the slider's pose: ``docked = slider * contact.frame`` (:func:`finger_frame`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError, brief, check_array, check_number, note_tool
from stablepush.geometry import compose, normalize_twist, transform_points, unit, wrap_angle
from stablepush.io import read_table, table_text, write_atomically
from stablepush.objects import PushContact
from stablepush.planning.alignment import clearance
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult, Push, Transfer

#: Unit twists of pushes in a row that differ by no more than this (rad) are passed without a stop.
PASSES = 0.1
#: What the pusher does: it comes to the first contact, pushes, changes the contact, and goes back from the last.
PHASES = ("approach", "push", "transfer", "retract")
#: Shares of the standoff that are tried, the first that is free counts.
_SHARES = (1.0, 0.75, 0.5, 0.25, 0.1)

_NUMBERS = ("t", "x", "y", "theta", "px", "py", "ptheta", "pvx", "pvy", "pomega")
_TOOL = ("tx", "ty", "tz", "qx", "qy", "qz", "qw")
#: Samples that a trajectory may have.
_MOST_SAMPLES = 5_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Samples of a plan.

    ``t`` (n,) in s, a uniform step; ``slider`` (n, 3): poses of B in W; ``pusher`` (n, 3): poses of the frame of the fingers'
    centres in W; ``velocity`` (n, 3): of that frame, in W (m/s, rad/s); ``phase`` (n,): words of :data:`PHASES`; ``segment`` and
    ``contact`` (n,): numbers of the segment and of the contact at which the pusher is docked, -1 where it is not.
    """

    t: FloatArray
    slider: FloatArray
    pusher: FloatArray
    velocity: FloatArray
    phase: np.ndarray
    segment: FloatArray
    contact: FloatArray

    def __repr__(self) -> str:
        return brief(self)

    def __post_init__(self) -> None:
        for column in fields(self):
            getattr(self, column.name).setflags(write=False)

    def tool_poses(self, height: float = 0.0, tool: ArrayLike = (0, 0, 0, 0, 0, 0, 1)) -> FloatArray:
        """Return poses (n, 7) in W, ``x, y, z`` in m and a quaternion ``x, y, z, w``, of a frame that is fixed to the pusher.

        Parameters
        ----------
        height : float
            Of the pusher's frame above the table, in m.
        tool : array-like, shape (7,)
            Pose of the wanted frame (a flange, a tool centre point) in that of the pusher, whose z axis points up.
        """
        # slow to import, and needed here only
        from scipy.spatial.transform import Rotation

        place = check_array(tool, "tool", (7,))
        if not place[3:].any():
            raise InputError("tool", "expected a quaternion that is not zero, after x, y, z")
        note_tool((height, *place[:3]), "tool, height")
        turn = Rotation.from_euler("z", self.pusher[:, 2:])
        origin = np.column_stack((self.pusher[:, :2], np.full(len(self.t), check_number(height, "height"))))
        quaternions = (turn * Rotation.from_quat(place[3:])).as_quat()
        # q and -q are the same turn: neighbours have the same sign
        flips = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0)
        quaternions[1:] *= np.cumprod(flips)[:, None]
        return np.column_stack((origin + turn.apply(place[:3]), quaternions))


def finger_frame(contact: PushContact, finger_radius: float) -> FloatArray:
    """Return the pose (3,) in B of the frame of the fingers' centres: their midpoint, behind that of the contact points."""
    return compose(contact.frame, np.array((-_behind(contact, finger_radius), 0.0, 0.0)))


def _behind(contact: PushContact, finger_radius: float) -> float:
    """How far (m) the midpoint of the fingers' centres lies behind that of the contact points: less for unlike normals."""
    return finger_radius * float(np.linalg.norm(contact.normals.mean(axis=0)))


def sample_plan(
    problem: PlanningProblem,
    result: PlanResult,
    rate: float = 50.0,
    acceleration: float = 0.1,
    *,
    jerk: float = 1.0,
    speed: float = math.inf,
    standoff: float = 0.02,
) -> Trajectory:
    """Return the poses and velocities of slider and pusher over time.

    The pusher comes straight to the first contact, and goes straight back from the last. It rests where the unit twist of the
    slider jumps by more than :data:`PASSES`, and at the corners of its path in a change of contact; blended corners are passed.
    Between rests, the path length of the fastest point, of the slider's outline and the pusher's frame, follows the quickest
    profile from rest to rest within the limits (Ruckig, Berscheid and Kroeger 2021). So the clock may run longer than the plan's.

    Parameters
    ----------
    rate : float
        Samples a second.
    acceleration, jerk : float
        Largest acceleration (m/s²) and jerk (m/s³) along that path; infinite: no limit. A push is quasi-static where the
        acceleration is small against ``mu g`` of the support.
    speed : float
        Largest speed (m/s) of that point; the plan's if that is less.
    standoff : float
        Distance (m) of approach and retract: longer if the start is more uncertain, shorter where obstacles or bounds limit it.

    Raises
    ------
    InputError
        If the plan is not solved, is not one for this problem, or has a change of contact without a path.
    """
    if not result.solved:
        raise InputError("plan", f"expected a solved plan, its status is {result.status}")
    _require_fit(problem, result)
    hertz = check_number(rate, "rate", positive=True)
    asked = {"acceleration": acceleration, "jerk": jerk, "speed": speed}
    limits = {name: value if value == math.inf else check_number(value, name, positive=True) for name, value in asked.items()}
    away = check_number(standoff, "standoff", at_least=0.0)
    legs = list(_legs(problem, result, away))
    laws = [_rest_to_rest(leg.length, min(leg.speed, limits["speed"]), limits) for leg in legs]
    ends = np.cumsum([law[0] for law in laws] + _waits(result, legs, [law[0] for law in laws]))
    if ends[-1] * hertz > _MOST_SAMPLES:
        raise InputError(
            "rate",
            f"expected at most {_MOST_SAMPLES} samples in all: the motion takes {ends[-1]:.3g} s, at {hertz:g} samples a second",
        )
    # a whole number of steps, also when it is more by rounding
    t = np.arange(math.ceil(ends[-1] * hertz - 1e-9) + 1) / hertz
    # the end is of the last leg that takes time
    which = np.minimum(np.searchsorted(ends, t, side="right"), np.searchsorted(ends, ends[-1]))
    table = np.empty((len(t), 9))
    numbers = np.empty((len(t), 2))
    for k in np.unique(which):
        rows = np.flatnonzero(which == k)
        begin = float(ends[k - 1]) if k else 0.0
        done, pace = np.array([laws[k][1](now - begin) for now in t[rows]]).T
        table[rows, :3], table[rows, 3:6], table[rows, 6:], numbers[rows] = legs[k].states(done, pace)
    for column in (2, 5):
        # from the first heading on they go on beyond half a turn: a controller that interpolates must not turn back
        table[:, column] = np.unwrap(np.concatenate((wrap_angle(table[:1, column]), table[1:, column])))
    phase = np.array([legs[k].phase for k in which])
    return Trajectory(t, table[:, :3], table[:, 3:6], table[:, 6:], phase, numbers[:, 0], numbers[:, 1])


States = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class _Leg:
    """A motion from rest to rest in segment ``number``: ``length`` (m) of the path of its fastest point, ``speed`` (m/s) at most.

    ``states`` gives poses of slider and pusher, velocities of the pusher and numbers of segment and contact, after path
    lengths (n,) at speeds (n,) in m/s.
    """

    phase: str
    number: int
    length: float
    speed: float
    states: Callable[[FloatArray, FloatArray], States]


def _rest_to_rest(length: float, speed: float, limits: dict[str, float]) -> tuple[float, Callable[[float], tuple[float, float]]]:
    """Duration (s) of a path, and path length (m) and speed (m/s) at a time."""
    import ruckig

    if length <= 0:
        return 0.0, lambda _: (0.0, 0.0)
    asked, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    asked.current_position, asked.target_position = [0.0], [length]
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = [speed], [limits["acceleration"]], [limits["jerk"]]
    ruckig.Ruckig(1).calculate(asked, found)

    def at(now: float) -> tuple[float, float]:
        if now >= found.duration:
            return length, 0.0
        position, pace, _ = found.at_time(max(now, 0.0))
        return min(max(position[0], 0.0), length), max(pace[0], 0.0)

    return found.duration, at


def _waits(result: PlanResult, legs: Sequence[_Leg], times: Sequence[float]) -> FloatArray:
    """Times (s) that the pusher rests after each leg: a change of contact takes what the plan says, or longer."""
    waits = np.zeros(len(legs))
    for number, segment in enumerate(result.segments):
        rows = [k for k, leg in enumerate(legs) if leg.number == number and leg.phase == "transfer"]
        if isinstance(segment, Transfer) and rows:
            waits[rows[-1]] = max(0.0, segment.duration - sum(times[k] for k in rows))
    return waits


def _legs(problem: PlanningProblem, result: PlanResult, standoff: float) -> Iterator[_Leg]:
    pose, first = problem.start, result.segments[0]
    contact = first.contact if isinstance(first, Push) else first.source
    away = max(standoff, clearance(problem, problem.contacts[contact]) + 1e-3) if any(problem.uncertainty.start) else standoff
    yield _straight(problem, pose, contact, away, "approach", 0)
    for run in _runs(problem, result):
        segment = result.segments[run[0]]
        if isinstance(segment, Push):
            pushes = [s for s in result.segments[run[0] : run[-1] + 1] if isinstance(s, Push)]
            yield _pushing(problem, run[0], pushes)
            pose, contact = pushes[-1].end, segment.contact
        else:
            yield from _transfer(problem, run[0], segment, pose)
            contact = segment.target
    yield _straight(problem, pose, contact, standoff, "retract", len(result.segments) - 1)


def _runs(problem: PlanningProblem, result: PlanResult) -> list[list[int]]:
    """Numbers of segments that are passed without a stop."""
    rho, runs = problem.surface.characteristic_length, [[0]]
    for number in range(1, len(result.segments)):
        before, segment = result.segments[number - 1 : number + 1]
        passes = False
        if isinstance(segment, Push) and isinstance(before, Push) and before.contact == segment.contact:
            u, v = (unit(normalize_twist(s.twist, rho)) for s in (before, segment))
            passes = float(np.linalg.norm(u - v)) <= PASSES
        if passes:
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs


def _pushing(problem: PlanningProblem, first: int, pushes: Sequence[Push]) -> _Leg:
    docked = finger_frame(problem.contacts[pushes[0].contact], problem.finger_radius)
    twists = np.array([push.twist for push in pushes])
    fingers = np.hypot(twists[:, 0] - twists[:, 2] * docked[1], twists[:, 1] + twists[:, 2] * docked[0])
    speeds = np.maximum(problem.push_speed(twists), fingers)
    ends = np.cumsum(speeds * [push.duration for push in pushes])

    def states(done: FloatArray, pace: FloatArray) -> States:
        which = np.minimum(np.searchsorted(ends, done, side="right"), len(pushes) - 1)
        slider, velocity = np.empty((len(done), 3)), np.empty((len(done), 3))
        for k in np.unique(which):
            rows = np.flatnonzero(which == k)
            behind = done[rows] - (ends[k - 1] if k else 0.0)
            slider[rows] = pushes[k].poses(np.minimum(behind / speeds[k], pushes[k].duration))
            slider[rows[behind >= ends[k] - (ends[k - 1] if k else 0.0)]] = pushes[k].end
            # of B, turned into W
            vx, vy, omega = pushes[k].twist / speeds[k]
            c, s = np.cos(slider[rows, 2]), np.sin(slider[rows, 2])
            velocity[rows] = pace[rows, None] * np.column_stack((c * vx - s * vy, s * vx + c * vy, np.full(len(rows), omega)))
        pusher = compose(slider, docked)
        arm = pusher[:, :2] - slider[:, :2]
        velocity[:, :2] += velocity[:, 2:] * np.column_stack((-arm[:, 1], arm[:, 0]))
        numbers = np.column_stack((first + which, np.full(len(done), pushes[0].contact)))
        return slider, pusher, velocity, numbers

    return _Leg("push", first, float(ends[-1]), float(speeds.min()), states)


def _line(
    problem: PlanningProblem, pose: FloatArray, a: FloatArray, b: FloatArray, phase: str, number: int, radii: tuple[float, float]
) -> _Leg:
    """A straight path of the docked frame from one pose (3,) to another while the slider rests; the heading turns evenly.

    ``radii``: how far (m) the fingers' centres lie behind it, at both ends.
    """
    step = np.array((*(b[:2] - a[:2]), float(wrap_angle(b[2] - a[2]))))
    length = float(np.hypot(*step[:2])) + _turning_radius(problem) * abs(float(step[2])) + abs(radii[1] - radii[0])

    def states(done: FloatArray, pace: FloatArray) -> States:
        share = (done / length if length else np.ones(len(done)))[:, None]
        docked = a + share * step
        rate = (pace / length if length else np.zeros(len(done)))[:, None]
        ahead = np.column_stack((np.cos(docked[:, 2]), np.sin(docked[:, 2])))
        arm = -(radii[0] + share * (radii[1] - radii[0])) * ahead
        pusher = np.column_stack((docked[:, :2] + arm, docked[:, 2]))
        velocity = rate * step
        velocity[:, :2] -= rate * (radii[1] - radii[0]) * ahead
        velocity[:, :2] += velocity[:, 2:] * np.column_stack((-arm[:, 1], arm[:, 0]))
        return np.tile(pose, (len(done), 1)), pusher, velocity, np.tile((number, -1.0), (len(done), 1))

    return _Leg(phase, number, length, problem.speed, states)


def _straight(problem: PlanningProblem, pose: FloatArray, contact: int, standoff: float, phase: str, number: int) -> _Leg:
    docked = compose(pose, problem.contacts[contact].frame)
    ahead = np.array((math.cos(docked[2]), math.sin(docked[2]), 0.0))
    away = docked - _free_distance(problem, pose, contact, ahead[:2], standoff) * ahead
    ends = (away, docked) if phase == "approach" else (docked, away)
    behind = _behind(problem.contacts[contact], problem.finger_radius)
    return _line(problem, pose, *ends, phase, number, (behind, behind))


def _free_distance(problem: PlanningProblem, pose: FloatArray, contact: int, ahead: FloatArray, standoff: float) -> float:
    """How far (m), up to the standoff, the docked pusher can go back without hitting anything."""
    # points get a small width, or the swept area of one finger would be empty
    filled = problem.docked_outlines(problem.contacts[contact]) or [problem.contacts[contact].points]
    placed = transform_points(pose, np.concatenate(filled))
    # what only touches does not hit
    around = [*problem.obstacles, transform_points(pose, problem.slider.vertices)]
    obstacles = shapely.buffer(shapely.union_all([shapely.Polygon(o) for o in around]), -1e-6)
    for share in _SHARES:
        both = np.concatenate((placed, placed - share * standoff * ahead))
        swept = shapely.buffer(shapely.convex_hull(shapely.MultiPoint(both)), 1e-9)
        inside = problem.bounds is None or shapely.box(*problem.bounds).buffer(1e-6).covers(swept)
        if inside and not shapely.intersects(swept, obstacles):
            return share * standoff
    return 0.0


def _transfer(problem: PlanningProblem, number: int, segment: Transfer, pose: FloatArray) -> Iterator[_Leg]:
    path = segment.pusher_path
    if not len(path):
        raise InputError(f"segments[{number}].pusher_path", "expected a path: the pusher would jump from contact to contact")
    first, last = (_behind(problem.contacts[k], problem.finger_radius) for k in (segment.source, segment.target))
    behind = np.linspace(first, last, len(path)).tolist()
    for (a, b), radii in zip(pairwise(path), pairwise(behind), strict=True):
        yield _line(problem, pose, a, b, "transfer", number, radii)


def _turning_radius(problem: PlanningProblem) -> float:
    """Of the point (m) of the pusher that turning about the docked frame moves most."""
    corners = [problem.finger_radius, *(np.hypot(*(contact.points - contact.frame[:2]).T).max() for contact in problem.contacts)]
    if problem.pusher is not None:
        corners.append(np.hypot(*problem.pusher.T).max())
    return max(float(max(corners)), 1e-3 * problem.slider.radius)


def _require_fit(problem: PlanningProblem, result: PlanResult) -> None:
    """Refuse a plan whose segments make no sense for a problem; whether it is right is for the check to say."""
    pose = problem.start
    count = len(problem.contacts)
    if not result.segments:
        raise InputError("segments", "expected at least one")
    for number, segment in enumerate(result.segments):
        place = f"segments[{number}]"
        contacts = (segment.contact,) if isinstance(segment, Push) else (segment.source, segment.target)
        if not all(0 <= c < count for c in contacts):
            raise InputError(place, f"expected contacts from 0 to {count - 1}", f"{', '.join(map(str, contacts))}")
        if segment.duration < 0 or (isinstance(segment, Push) and not segment.twist.any()):
            raise InputError(place, "expected a duration >= 0 and a twist that is not zero")
        if isinstance(segment, Push):
            away = np.abs((*(segment.start[:2] - pose[:2]), float(wrap_angle(segment.start[2] - pose[2]))))
            if away.max() > 1e-6:
                raise InputError(
                    f"{place}.start", f"expected where the slider stands, {pose.tolist()}: is the plan for this scene?"
                )
            pose = segment.end


def pusher_in_transfer(problem: PlanningProblem, transfer: Transfer, pose: FloatArray, share: FloatArray) -> FloatArray:
    """Return the poses (n, 3) of the pusher at shares (n,) of its path; a path that is not given jumps at its end."""
    path = transfer.pusher_path
    if not len(path):
        ends = [compose(pose, problem.contacts[k].frame) for k in (transfer.source, transfer.target)]
        return np.where(share[:, None] < 1, ends[0], ends[1])
    heading = path[0, 2] + np.concatenate(((0.0,), np.cumsum(wrap_angle(np.diff(path[:, 2])))))
    # turning on the spot takes its time, too
    radius = 0.0 if problem.pusher is None else float(np.linalg.norm(problem.pusher, axis=1).max())
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T) + radius * np.abs(np.diff(heading))
    along = np.concatenate(((0.0,), np.cumsum(steps)))
    at = share * along[-1]
    return np.stack([np.interp(at, along, column) for column in (path[:, 0], path[:, 1], heading)], axis=-1)


def save_trajectory(trajectory: Trajectory, path: str | Path, tool_poses: FloatArray | None = None) -> None:
    """Write a trajectory as CSV.

    Columns: ``t``, ``x, y, theta`` of the slider, ``px, py, ptheta`` of the pusher, ``pvx, pvy, pomega`` of the pusher in W,
    ``phase``, ``segment``, ``contact``; with :meth:`Trajectory.tool_poses` also ``tx, ty, tz, qx, qy, qz, qw``.
    """
    values = (trajectory.t, *trajectory.slider.T, *trajectory.pusher.T, *trajectory.velocity.T)
    table = dict(zip(_NUMBERS, values, strict=True))
    table |= {
        "phase": trajectory.phase.astype(object),
        "segment": trajectory.segment.astype(int),
        "contact": trajectory.contact.astype(int),
    }
    if tool_poses is not None:
        table |= dict(zip(_TOOL, tool_poses.T, strict=True))
    write_atomically(Path(path), table_text(table))


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory that :func:`save_trajectory` wrote."""
    numbers = (*_NUMBERS, "segment", "contact")
    table, _ = read_table(Path(path), required=(*numbers, "phase"), numbers=numbers, filled=numbers)
    columns = np.array([np.asarray(table[name], dtype=np.float64) for name in numbers])
    phase = np.asarray(table["phase"], dtype=str)
    for row in np.flatnonzero(~np.isin(phase, PHASES))[:1]:
        raise InputError(f"line {row + 2}, column phase", f"expected {', '.join(PHASES)}", repr(str(phase[row])), file=path)
    return Trajectory(columns[0], columns[1:4].T, columns[4:7].T, columns[7:10].T, phase, columns[10], columns[11])
