"""A plan in time: poses of slider and pusher at a fixed rate, under a limit on speed and on acceleration; as CSV."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stablepush._arrays import FloatArray, check_number, read_only
from stablepush.errors import InputError
from stablepush.files import write_atomically
from stablepush.logs.table import read_table, table_text
from stablepush.path import PlanResult, Push, Transfer
from stablepush.problem import PlanningProblem
from stablepush.se2 import compose, wrap_angle

_COLUMNS = ("t", "segment", "contact", "x", "y", "theta", "px", "py", "ptheta")
#: Samples that a trajectory may have.
_MOST_SAMPLES = 5_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Samples of a plan.

    ``t`` (n,) in s from its start; ``segment`` and ``contact`` (n,): numbers of the segment and of the contact at which the
    pusher is docked, -1 on its way between two; ``slider`` (n, 3): poses of B in W; ``pusher`` (n, 3): poses of its frame in W.
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

    Without an acceleration the pushes run at the speed limit from end to end, as the plan has them. With one, each starts and
    ends at rest: no point of the slider's outline exceeds ``acceleration`` (m/s²) along its way, nor the speed limit. A push is
    quasi-static where that is small against ``mu g`` of the support.

    Parameters
    ----------
    rate : float
        Samples a second; the ends of the segments are samples too.
    acceleration : float, optional

    Raises
    ------
    InputError
        If the plan is not solved.
    """
    if not result.solved:
        raise InputError(f"plan: expected a solved plan, its status is {result.status}")
    hertz = check_number(rate, "rate", above=0.0)
    limit = None if acceleration is None else check_number(acceleration, "acceleration", above=0.0)
    pose, now, count = problem.start, 0.0, 0
    parts: list[FloatArray] = []
    for number, segment in enumerate(result.segments):
        speed = float(problem.push_speed(segment.twist)) if isinstance(segment, Push) else 0.0
        length = segment.duration if limit is None or not speed else ramped_duration(segment.duration, speed, limit)
        samples = max(1, math.ceil(length * hertz))
        count += samples
        if count > _MOST_SAMPLES:
            raise InputError(f"rate: expected at most {_MOST_SAMPLES} samples in all, at {hertz:g} a second there are more")
        # the first sample of a segment is the last of the one before
        t = np.linspace(0.0, length, samples + 1)[0 if number == 0 else 1 :]
        rows = np.empty((len(t), 9))
        rows[:, 0], rows[:, 1] = now + t, number
        if isinstance(segment, Push):
            way = t if limit is None or not speed else ramp(t, segment.duration, speed, limit)
            rows[:, 2], rows[:, 3:6] = segment.contact, segment.poses(way)
            rows[:, 6:9] = compose(rows[:, 3:6], problem.contacts[segment.contact].frame)
            pose = segment.end
        else:
            rows[:, 2], rows[:, 3:6] = -1, pose
            rows[:, 6:9] = _on_the_way(problem, segment, pose, t / length if length > 0 else np.ones(len(t)))
            rows[-1, 2] = segment.target
        parts.append(rows)
        now += length
    table = np.concatenate(parts)
    table[:, 5], table[:, 8] = wrap_angle(table[:, 5]), wrap_angle(table[:, 8])
    return _trajectory(table.T)


def ramped_duration(duration: float, speed: float, acceleration: float) -> float:
    """Return how long (s) a way of ``duration`` at ``speed`` takes from rest to rest: ``d + v/a``, or ``2 sqrt(v d/a)`` if it is
    too short to reach the speed."""
    rise = speed / acceleration
    return duration + rise if duration >= rise else 2 * math.sqrt(rise * duration)


def ramp(t: FloatArray, duration: float, speed: float, acceleration: float) -> FloatArray:
    """Return the way (n,), as time at full speed, that is behind at times ``t`` (n,) of a motion from rest to rest."""
    rise = speed / acceleration
    total = ramped_duration(duration, speed, acceleration)
    up = min(rise, total / 2)
    # mirrored in the middle: the second half is the first, backwards
    early = np.minimum(t, total - t)
    way = np.where(early <= up, early**2 / (2 * rise), up**2 / (2 * rise) + (early - up) * up / rise)
    return np.asarray(np.where(t <= total / 2, way, duration - way))


def _on_the_way(problem: PlanningProblem, transfer: Transfer, pose: FloatArray, share: FloatArray) -> FloatArray:
    """Poses (n, 3) of the pusher at shares (n,) of its path; a path that is not given jumps at its end."""
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
