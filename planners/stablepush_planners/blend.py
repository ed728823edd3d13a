"""Turn from one twist to the next gradually: corners of a path are replaced by short pushes whose twists lie between."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import FloatArray
from stablepush.geometry import compose, exp, inverse, log, normalize_twist, unit, wrap_angle
from stablepush.planning import PASSES, PlanningProblem, SweptBody
from stablepush_planners.shorten import TimedTwist
from stablepush_planners.stable_set import StableSet

#: Twists of neighbouring parts of a blend differ by this much (rad); corners below it need no blend.
_PART = 0.5 * PASSES
#: Newton steps that lead a blend back to the pose where its corner ended, and how close (m, rad).
_STEPS, _CLOSE = 20, 1e-12


def blended(
    problem: PlanningProblem, stable: StableSet, swept: SweptBody, start: FloatArray, pushes: list[TimedTwist], rate: float
) -> tuple[list[TimedTwist], int]:
    """Return a path of one contact whose unit twist turns by at most ``rate`` (rad/s) at its corners, and the corners left.

    The unit twist is that of ``(vx, vy, rho omega)``: near and far COR and translations count alike. About a corner between
    pushes ``a`` and ``b`` the last of ``a`` and the first of ``b`` make place for parts whose unit twists lie evenly on the great
    circle from one to the other. What that changes of the end pose is taken back by the least change of all parts, in
    proportion to their time. A corner is left as it is, for the slider to stop at, where its pushes are too short, or where a
    part would not be stable or free.
    """
    rho = problem.surface.characteristic_length
    result: list[TimedTwist] = []
    left = 0
    pose, (twist, duration) = start, pushes[0]
    for following in pushes[1:]:
        # half of the next push is kept for the corner at its other end
        last = following is pushes[-1]
        share = 1.0 if last else 0.5
        corner = _corner(problem, (twist, duration), (following[0], share * following[1]), rate, rho)
        good = corner is not None and _usable(problem, stable, swept, pose, corner)
        if corner is None or not good:
            left += int(_turn(twist, following[0], rho) > PASSES)
            result.append((twist, duration))
            pose = compose(pose, exp(twist * duration))
            twist, duration = following
            continue
        result += corner[:-1]
        for part, time in corner[:-1]:
            pose = compose(pose, exp(part * time))
        twist, duration = corner[-1]
        if not last:
            # the rest of the push stands between this corner and the next
            result.append((twist, duration))
            pose = compose(pose, exp(twist * duration))
            twist, duration = following[0], (1 - share) * following[1]
    result.append((twist, duration))
    return result, left


def _turn(a: FloatArray, b: FloatArray, rho: float) -> float:
    """Angle (rad) between unit twists."""
    u, v = unit(normalize_twist(a, rho)), unit(normalize_twist(b, rho))
    return 2 * math.atan2(float(np.linalg.norm(u - v)), float(np.linalg.norm(u + v)))


def _corner(problem: PlanningProblem, first: TimedTwist, second: TimedTwist, rate: float, rho: float) -> list[TimedTwist] | None:
    """Parts of a blend with the ends of the two pushes about it, or None if they are too short for it."""
    angle = _turn(first[0], second[0], rho)
    if angle <= _PART:
        return None
    time = angle / rate
    if min(first[1], second[1]) <= 0.51 * time:
        return None
    u, v = unit(normalize_twist(first[0], rho)), unit(normalize_twist(second[0], rho))
    count = math.ceil(angle / _PART)
    share = (np.arange(count) + 0.5)[:, None] / count
    between = (np.sin((1 - share) * angle) * u + np.sin(share * angle) * v) / math.sin(angle) / (1, 1, rho)
    between *= (problem.speed / problem.push_speed(between))[:, None]
    times = np.concatenate(((first[1] - time / 2,), np.full(count, time / count), (second[1] - time / 2,)))
    arcs = np.concatenate((first[0][None], between, second[0][None])) * times[:, None]
    target = compose(exp(first[0] * first[1]), exp(second[0] * second[1]))
    closed = _closed(arcs, times, target, rho)
    if closed is None:
        return None
    spent = problem.push_speed(closed) / problem.speed
    return [(arc / t, float(t)) for arc, t in zip(closed, spent, strict=True)]


def _closed(arcs: FloatArray, times: FloatArray, target: FloatArray, rho: float) -> FloatArray | None:
    """Change motions (n, 3) the least, in proportion to their times, so that they lead to a pose."""
    scale = np.array((1.0, 1.0, rho))
    weights = np.repeat(times, 3) ** 2
    for _ in range(_STEPS):
        error = _pose_error(arcs, target) * scale
        if np.abs(error).max() < _CLOSE:
            return arcs
        slope = np.empty((3, arcs.size))
        for k in range(arcs.size):
            moved = arcs.copy()
            moved.flat[k] += 1e-7
            slope[:, k] = (_pose_error(moved, target) * scale - error) / 1e-7
        square = (slope * weights) @ slope.T
        arcs = arcs - (weights * (slope.T @ np.linalg.solve(square, error))).reshape(arcs.shape)
    return None


def _pose_error(arcs: FloatArray, target: FloatArray) -> FloatArray:
    """Motion from a pose to where motions (n, 3) lead."""
    pose = np.zeros(3)
    for arc in arcs:
        pose = compose(pose, exp(arc))
    offset = compose(inverse(target), pose)
    offset[2] = wrap_angle(offset[2])
    return log(offset)


def _usable(problem: PlanningProblem, stable: StableSet, swept: SweptBody, pose: FloatArray, parts: list[TimedTwist]) -> bool:
    """Whether all parts of a blend are stable and free of collision."""
    twists = np.array([twist for twist, _ in parts])
    starts = [pose]
    for twist, time in parts[:-1]:
        starts.append(compose(starts[-1], exp(twist * time)))
    turns = [twist[2] * time for twist, time in parts]
    if not stable.accepts(twists, np.column_stack((np.array(starts)[:, 2], turns))).all():
        return False
    return bool(swept.pushes_are_free(np.array(starts), twists, np.array([time for _, time in parts])).all())
