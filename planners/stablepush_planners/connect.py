"""Join two poses by a few stable pushes of one contact, without search; and shorten a path by such joints."""

from __future__ import annotations

import math
import time

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.collision import FootprintChecker
from stablepush.problem import PlanningProblem
from stablepush.se2 import compose, exp, inverse, log, wrap_angle
from stablepush_planners.dubins import dubins_paths
from stablepush_planners.primitives import Steering

#: A push: body twist at the speed limit, and its duration in s.
TimedTwist = tuple[FloatArray, float]

#: Turning radii that joints try, in units of the tightest: slower to turn, but the outline swings out less.
_RADII = (1.0, 2.0, 4.0, 8.0)
#: Candidates whose collisions are looked at, quickest first.
_TRIED = 3


class Connector:
    """Joins poses with the pushes of one contact."""

    def __init__(self, problem: PlanningProblem, steer: Steering, body: FootprintChecker) -> None:
        self._problem, self._steer, self._body = problem, steer, body
        turns = [steer.twist(sign * 1.0 / (steer.radius * m)) for m in _RADII for sign in (1, -1)]
        good = np.asarray(steer.accept(np.array(turns)), dtype=bool).reshape(-1, 2)
        self._radii = [steer.radius * m for m, pair in zip(_RADII, good, strict=True) if pair.all()]

    def timed(self, twist: FloatArray, amount: float) -> TimedTwist:
        """Return a push that follows ``twist`` for ``amount`` units of its own time, at the speed limit."""
        pace = self._problem.speed / float(self._problem.push_speed(twist))
        return twist * pace, amount / pace

    def is_free(self, start: FloatArray, push: TimedTwist) -> bool:
        """Return whether a push is free of collision."""
        return self._body.push_is_free(start, *push)

    def join(self, start: FloatArray, goal: FloatArray, most: float = math.inf) -> tuple[float, list[TimedTwist]] | None:
        """Return the time (s) and pushes of the quickest free joint between two poses, if one takes less than ``most``."""
        found = [c for c in self._candidates(start, goal) if c[0] < most]
        for cost, pushes in sorted(found, key=lambda c: c[0])[:_TRIED]:
            pose = start
            for push in pushes:
                if not self.is_free(pose, push):
                    break
                pose = compose(pose, exp(push[0] * push[1]))
            else:
                return cost, pushes
        return None

    def _candidates(self, start: FloatArray, goal: FloatArray) -> list[tuple[float, list[TimedTwist]]]:
        """One push, if it is stable, and the Dubins words of the reference point."""
        candidates = []
        offset = compose(inverse(start), goal)
        offset[2] = wrap_angle(offset[2])
        direct = log(offset)
        if np.abs(direct).max() > 1e-9 and bool(self._steer.accept(direct[None])[0]):
            push = self.timed(direct, 1.0)
            candidates.append((push[1], [push]))
        x0, y0, t0 = (float(v) for v in compose(start, self._steer.frame))
        x1, y1, t1 = (float(v) for v in compose(goal, self._steer.frame))
        for radius in self._radii:
            ahead = {letter: self._steer.twist(k / radius) for letter, k in (("L", 1.0), ("R", -1.0), ("S", 0.0))}
            for word, lengths in dubins_paths((x0, y0, t0), (x1, y1, t1), radius):
                pushes = [
                    self.timed(ahead[letter], length * radius)
                    for letter, length in zip(word, lengths, strict=True)
                    if length * radius > 1e-9
                ]
                if pushes:
                    candidates.append((sum(d for _, d in pushes), pushes))
        return candidates


def shorten(connector: Connector, start: FloatArray, pushes: list[TimedTwist], pieces: int, deadline: float) -> list[TimedTwist]:
    """Return a path between the same poses that takes no longer: the quickest way over joints between poses of the path.

    Dynamic programming over ``pieces`` poses spread along the path and the ends of its pushes; the path itself always stays
    one of the ways, also when the deadline cuts the work short.
    """
    total = sum(d for _, d in pushes)
    poses, times, legs = [start], [0.0], [None]
    pose, now = start, 0.0
    for twist, duration in pushes:
        count = max(1, round(pieces * duration / total))
        for i in range(count):
            share = duration / count
            poses.append(compose(pose, exp(twist * (share * (i + 1)))))
            times.append(now + share * (i + 1))
            legs.append((twist, share))  # type: ignore[arg-type]
        pose, now = poses[-1], now + duration
    best = [0.0] + [math.inf] * (len(poses) - 1)
    ways: list[tuple[int, list[TimedTwist]]] = [(0, [])] * len(poses)
    for j in range(1, len(poses)):
        leg = legs[j]
        assert leg is not None
        best[j], ways[j] = best[j - 1] + leg[1], (j - 1, [leg])
        for i in range(j - 1):
            if time.perf_counter() > deadline:
                break
            joint = connector.join(poses[i], poses[j], best[j] - best[i] - 1e-9)
            if joint is not None:
                best[j], ways[j] = best[i] + joint[0], (i, joint[1])
    result: list[TimedTwist] = []
    j = len(poses) - 1
    while j > 0:
        i, part = ways[j]
        result = part + result
        j = i
    return result
