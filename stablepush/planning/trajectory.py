"""A plan in time: poses of slider and pusher at a fixed rate, under a limit on speed and on acceleration; as CSV."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stablepush.core import FloatArray, InputError, check_number, read_only
from stablepush.geometry import compose, normalize_twist, unit, wrap_angle
from stablepush.io import read_table, table_text, write_atomically
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.result import PlanResult, Push, Transfer

#: Unit twists of pushes in a row that differ by no more than this (rad) are passed without a stop.
PASSES = 0.1

_COLUMNS = ("t", "segment", "contact", "x", "y", "theta", "px", "py", "ptheta")
#: Samples that a trajectory may have.
_MOST_SAMPLES = 5_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Samples of a plan.

    ``t`` (n,) in s from its start; ``segment`` and ``contact`` (n,): numbers of the segment and of the contact at which the
    pusher is docked, -1 in transfer between two; ``slider`` (n, 3): poses of B in W; ``pusher`` (n, 3): poses of its frame in W.
    """

    t: FloatArray
    segment: FloatArray
    contact: FloatArray
    slider: FloatArray
    pusher: FloatArray


def sample_plan(
    problem: PlanningProblem, result: PlanResult, rate: float = 50.0, acceleration: float | None = None
) -> Trajectory:
    """Return the poses of slider and pusher over time.

    Without an acceleration the pushes run at the speed limit from end to end, as the plan has them. With one, the slider starts
    and ends at rest, and rests where the unit twist jumps by more than :data:`PASSES`: blended corners are passed. No point of
    its outline then speeds up along its path by more than ``acceleration`` (m/s²), nor exceeds the speed limit. A push is
    quasi-static where that is small against ``mu g`` of the support.

    Parameters
    ----------
    rate : float
        Samples a second; the ends of the segments are samples too.
    acceleration : float, optional

    Raises
    ------
    InputError
        If the plan is not solved, or not one for this problem.
    """
    if not result.solved:
        raise InputError("plan", f"expected a solved plan, its status is {result.status}")
    _require_fit(problem, result)
    hertz = check_number(rate, "rate", positive=True)
    limit = None if acceleration is None else check_number(acceleration, "acceleration", positive=True)
    law = _TimeLaw(problem, result, limit)
    if law.ends[-1] * hertz > _MOST_SAMPLES:
        raise InputError("rate", f"expected at most {_MOST_SAMPLES} samples in all, at {hertz:g} a second there are more")
    pose, begin = problem.start, 0.0
    parts: list[FloatArray] = []
    for number, segment in enumerate(result.segments):
        end = float(law.ends[number])
        # a whole number of steps, also when it is more by rounding
        samples = max(1, math.ceil((end - begin) * hertz - 1e-9))
        # the first sample of a segment is the last of the one before
        t = np.linspace(begin, end, samples + 1)[0 if number == 0 else 1 :]
        rows = np.empty((len(t), 9))
        rows[:, 0], rows[:, 1] = t, number
        if isinstance(segment, Push):
            done = np.clip(law.behind(number, t), 0.0, segment.duration)
            done[-1] = segment.duration
            rows[:, 2], rows[:, 3:6] = segment.contact, segment.poses(done)
            rows[:, 6:9] = compose(rows[:, 3:6], problem.contacts[segment.contact].frame)
            pose = segment.end
        else:
            rows[:, 2], rows[:, 3:6] = -1, pose
            share = (t - begin) / (end - begin) if end > begin else np.ones(len(t))
            rows[:, 6:9] = pusher_in_transfer(problem, segment, pose, share)
            rows[-1, 2] = segment.target
        parts.append(rows)
        begin = end
    table = np.concatenate(parts)
    table[:, 5], table[:, 8] = wrap_angle(table[:, 5]), wrap_angle(table[:, 8])
    return _trajectory(table.T)


class _TimeLaw:
    """When the segments of a plan end, and how far each is at a time."""

    def __init__(self, problem: PlanningProblem, result: PlanResult, limit: float | None) -> None:
        self._durations = np.array([segment.duration for segment in result.segments])
        self._limit = limit
        #: first and last of the segments that are passed without a stop, by segment, and the speed (m/s) of the fastest point
        self._runs: list[tuple[int, int]] = []
        self._speeds = [float(problem.push_speed(s.twist)) if isinstance(s, Push) else 0.0 for s in result.segments]
        rho = problem.surface.characteristic_length
        for number, segment in enumerate(result.segments):
            before = result.segments[number - 1] if number else None
            first = number
            if isinstance(segment, Push) and isinstance(before, Push) and before.contact == segment.contact:
                u, v = (unit(normalize_twist(s.twist, rho)) for s in (before, segment))
                if float(np.linalg.norm(u - v)) <= PASSES:
                    first = self._runs[-1][0]
            self._runs = [(a, number) if a == first else (a, b) for a, b in self._runs] + [(first, number)]
        self.ends = np.cumsum(self._durations)
        if limit is not None:
            now = 0.0
            for first, last in dict.fromkeys(self._runs):
                behind = np.cumsum(self._durations[first : last + 1])
                if isinstance(result.segments[first], Push):
                    behind = ramp_times(behind, float(behind[-1]), max(self._speeds[first : last + 1]), limit)
                self.ends[first : last + 1] = now + behind
                now = float(self.ends[last])

    def behind(self, number: int, t: FloatArray) -> FloatArray:
        """Return what of a push, as time (n,) at full speed, is behind at times (n,)."""
        first, last = self._runs[number] if self._limit is not None else (number, number)
        begin = float(self.ends[first - 1]) if first else 0.0
        if self._limit is None:
            return np.asarray(t - begin)
        total, before = float(self._durations[first : last + 1].sum()), float(self._durations[first:number].sum())
        return ramp(t - begin, total, max(self._speeds[first : last + 1]), self._limit) - before


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


def ramped_duration(duration: float, speed: float, acceleration: float) -> float:
    """Return how long (s) a motion of ``duration`` at ``speed`` takes from rest to rest.

    ``d + v/a``, or ``2 sqrt(v d/a)`` if it is too short to reach the speed.
    """
    rise = speed / acceleration
    return duration + rise if duration >= rise else 2 * math.sqrt(rise * duration)


def ramp_times(done: FloatArray, duration: float, speed: float, acceleration: float) -> FloatArray:
    """Return the times (n,) at which travels (n,), as times at full speed, are behind: the inverse of :func:`ramp`."""
    rise = speed / acceleration
    total = ramped_duration(duration, speed, acceleration)
    up = min(rise, total / 2)
    early = np.minimum(done, duration - done)
    slow = up**2 / (2 * rise)
    t = np.where(early <= slow, np.sqrt(2 * rise * np.maximum(early, 0.0)), up + (early - slow) * rise / up)
    return np.asarray(np.where(done <= duration / 2, t, total - t))


def ramp(t: FloatArray, duration: float, speed: float, acceleration: float) -> FloatArray:
    """Return the travel (n,), as time at full speed, that is behind at times ``t`` (n,) of a motion from rest to rest."""
    rise = speed / acceleration
    total = ramped_duration(duration, speed, acceleration)
    up = min(rise, total / 2)
    # mirrored in the middle: the second half is the first, backwards
    early = np.minimum(t, total - t)
    done = np.where(early <= up, early**2 / (2 * rise), up**2 / (2 * rise) + (early - up) * up / rise)
    return np.asarray(np.where(t <= total / 2, done, duration - done))


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


def save_trajectory(trajectory: Trajectory, path: str | Path) -> None:
    """Write a trajectory as CSV: ``t, segment, contact, x, y, theta`` of the slider and ``px, py, ptheta`` of the pusher."""
    values = (trajectory.t, trajectory.segment, trajectory.contact, *trajectory.slider.T, *trajectory.pusher.T)
    write_atomically(Path(path), table_text(dict(zip(_COLUMNS, values, strict=True))))


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory that :func:`save_trajectory` wrote."""
    table, _ = read_table(Path(path), required=_COLUMNS, numbers=_COLUMNS, filled=_COLUMNS)
    return _trajectory(np.array([np.asarray(table[name], dtype=np.float64) for name in _COLUMNS]))


def _trajectory(columns: FloatArray) -> Trajectory:
    t, segment, contact = (read_only(c.copy()) for c in columns[:3])
    return Trajectory(t, segment, contact, read_only(columns[3:6].T.copy()), read_only(columns[6:].T.copy()))
