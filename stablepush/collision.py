"""Collision of slider and pusher with obstacles and bounds, many poses at a time."""

from __future__ import annotations

import math
import time

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush._arrays import BoolArray, FloatArray
from stablepush.contact import PushContact
from stablepush.errors import OutOfTimeError
from stablepush.problem import PlanningProblem
from stablepush.se2 import compose, exp, transform_points

#: Bodies may overlap by this much (m): touching is no collision. Half of what the check allows, so that it never disagrees.
OVERLAP = 5e-7
#: Below this reach (m) a motion that is still not clear is given up: it slides along something.
_LEAST_REACH = 1e-7
#: Poses looked at for one motion before it is given up, and poses tested in one go.
_MOST_POSES, _BLOCK = 20_000, 4096
#: A motion is first cut into this many parts, and parts that are not clear into so many again.
_FIRST_PARTS, _PARTS = 8, 4


class FootprintChecker:
    """Tests poses of slider and docked pusher, as one rigid body, against the obstacles and bounds of a problem.

    A motion is declared free only if it is free between the tested poses too: each pose is tested with a reach that covers
    what any point of the body moves to the next one. Raises :class:`OutOfTimeError` once ``deadline`` (a value of
    :func:`time.perf_counter`) has passed.
    """

    def __init__(self, problem: PlanningProblem, contact: PushContact | None, deadline: float = math.inf) -> None:
        outlines = [problem.slider.vertices]
        if problem.pusher is not None and contact is not None:
            outlines.append(transform_points(contact.frame, problem.pusher))
        merged = shapely.union_all([shapely.Polygon(o) for o in outlines])
        shrunk = shapely.buffer(merged, -OVERLAP, join_style="mitre")
        self._parts = [shapely.get_coordinates(shapely.get_exterior_ring(part)) for part in shapely.get_parts(shrunk)]
        self._corners = np.concatenate(outlines)
        self._tree = shapely.STRtree([shapely.Polygon(o) for o in problem.obstacles])
        self._bounds = problem.bounds
        self._deadline = deadline

    def free(self, poses: ArrayLike, reach: ArrayLike = 0.0) -> BoolArray:
        """Return whether the body at poses (n, 3) stays farther than ``reach`` (m) from obstacles and bounds."""
        p = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        distance = np.broadcast_to(np.asarray(reach, dtype=np.float64), len(p))
        good = np.ones(len(p), dtype=bool)
        for start in range(0, len(p), _BLOCK):
            if time.perf_counter() > self._deadline:
                raise OutOfTimeError("collision tests: the deadline has passed")
            block = slice(start, start + _BLOCK)
            good[block] = self._block_is_free(p[block], distance[block])
        return good

    def _block_is_free(self, poses: FloatArray, distance: FloatArray) -> BoolArray:
        good = np.ones(len(poses), dtype=bool)
        if self._bounds is not None:
            corners = transform_points(poses, self._corners)
            low = corners.min(axis=1) - distance[:, None] >= self._bounds[:2] - OVERLAP
            high = corners.max(axis=1) + distance[:, None] <= self._bounds[2:] + OVERLAP
            good = low.all(axis=1) & high.all(axis=1)
        if len(self._tree.geometries):
            for part in self._parts:
                index = np.flatnonzero(good)
                footprints = shapely.polygons(transform_points(poses[index], part))
                hits = self._tree.query(footprints, predicate="dwithin", distance=distance[index])
                good[index[np.unique(hits[0])]] = False
        return good

    def point_speed(self, twist: ArrayLike) -> float:
        """Speed (m/s) of the fastest point of slider and pusher at a body twist (3,)."""
        v = np.asarray(twist, dtype=np.float64)
        corners = self._corners
        return float(np.hypot(v[0] - v[2] * corners[:, 1], v[1] + v[2] * corners[:, 0]).max())

    def samples(self, twist: ArrayLike, duration: float, step: float) -> tuple[FloatArray, float]:
        """Return relative poses (n, 3) along a push and the reach (m) that covers the way between them.

        The poses stand in the middle of equal parts in which no point of the body moves more than ``step`` (m).
        """
        v = np.asarray(twist, dtype=np.float64)
        way = self.point_speed(v) * duration
        count = max(1, math.ceil(way / step))
        times = (np.arange(count) + 0.5) * (duration / count)
        return exp(v * times[:, None]), way / count / 2

    def push_is_free(self, start: ArrayLike, twist: ArrayLike, duration: float) -> bool:
        """Return whether a push is surely free: parts of it that are not clear of everything are cut up again.

        A push that begins or ends in touch with something is found free; one that slides along it is not.
        """
        v = np.asarray(twist, dtype=np.float64)
        way = self.point_speed(v) * duration
        half = 0.5 / _FIRST_PARTS
        middles = (np.arange(_FIRST_PARTS) + 0.5) / _FIRST_PARTS
        looked_at = 0
        while True:
            poses = compose(start, exp(v * (middles * duration)[:, None]))
            near = ~self.free(poses, way * half)
            if not near.any():
                return True
            looked_at += len(poses)
            if looked_at > _MOST_POSES or way * half < _LEAST_REACH or not self.free(poses[near]).all():
                return False
            half /= _PARTS
            offsets = half * (2 * np.arange(_PARTS) + 1 - _PARTS)
            middles = (middles[near][:, None] + offsets).ravel()
