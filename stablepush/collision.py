"""Collision of slider and pusher with obstacles and bounds, many poses at a time."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush._arrays import BoolArray, FloatArray
from stablepush.contact import PushContact
from stablepush.problem import PlanningProblem
from stablepush.se2 import compose, exp, transform_points

#: Free motions keep this distance (m): plans are checked to 1e-6 m, and rounding must not decide.
CLEARANCE = 2e-6


class FootprintChecker:
    """Tests poses of slider and docked pusher, as one rigid body, against the obstacles and bounds of a problem.

    A motion is declared free only if it is free between the tested poses too: each pose is tested with a reach that covers
    what any point of the body moves to the next one.
    """

    def __init__(self, problem: PlanningProblem, contact: PushContact | None) -> None:
        outlines = [problem.slider.vertices]
        if problem.pusher is not None and contact is not None:
            outlines.append(transform_points(contact.frame, problem.pusher))
        merged = shapely.union_all([shapely.Polygon(o) for o in outlines])
        parts = shapely.get_parts(merged)
        self._parts = [shapely.get_coordinates(shapely.get_exterior_ring(part)) for part in parts]
        self._corners = np.concatenate(outlines)
        self._tree = shapely.STRtree([shapely.Polygon(o) for o in problem.obstacles])
        self._bounds = problem.bounds

    def free(self, poses: ArrayLike, reach: ArrayLike = 0.0) -> BoolArray:
        """Return whether the body at poses (n, 3) stays farther than ``reach`` (m) from obstacles and bounds."""
        p = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        distance = np.broadcast_to(np.asarray(reach, dtype=np.float64) + CLEARANCE, len(p))
        good = np.ones(len(p), dtype=bool)
        if self._bounds is not None:
            corners = transform_points(p, self._corners)
            low = corners.min(axis=1) - distance[:, None] >= self._bounds[:2] - 2 * CLEARANCE
            high = corners.max(axis=1) + distance[:, None] <= self._bounds[2:] + 2 * CLEARANCE
            good = low.all(axis=1) & high.all(axis=1)
        if len(self._tree.geometries):
            for part in self._parts:
                index = np.flatnonzero(good)
                footprints = shapely.polygons(transform_points(p[index], part))
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
        count = max(1, int(np.ceil(way / step)))
        times = (np.arange(count) + 0.5) * (duration / count)
        return exp(v * times[:, None]), way / count / 2

    def push_is_free(self, start: ArrayLike, twist: ArrayLike, duration: float, step: float, finest: float) -> bool:
        """Return whether a push is surely free; what is not at ``step`` (m) is looked at again down to ``finest`` (m)."""
        while True:
            relative, reach = self.samples(twist, duration, step)
            poses = compose(start, relative)
            if self.free(poses, reach).all():
                return True
            if step <= finest or not self.free(poses).all():
                return False
            step /= 4
