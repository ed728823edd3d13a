"""Which pushes of a contact may be used, and what they cost: what the surface calls stable, and what else is asked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, Deadline, FloatArray, OutOfTimeError
from stablepush.planning import PlanningProblem, PlanOptions, Push, PushLoads, loads_of, promised_region
from stablepush.stability import StabilityOracle, StableRegion

#: Pushes stay this far (rad) inside the stable set, so that the check, which allows 1e-6, never disagrees.
_INSIDE = 1e-7
#: Headings: from where (rad), and how far round.
_ALL_ROUND = (0.0, 2 * np.pi)
#: Twists asked at a time, between looks at the clock.
_BLOCK = 4096


class StableSet:
    """Body twists that may be used at a contact of a problem, and what they cost.

    Raises :class:`OutOfTimeError` once ``deadline`` has passed.
    """

    def __init__(
        self, problem: PlanningProblem, contact: int, options: PlanOptions | None = None, deadline: Deadline | None = None
    ) -> None:
        asked = PlanOptions() if options is None else options
        self.contact = contact
        self.loads = loads_of(problem)
        self.oracle = StabilityOracle(problem.surface, problem.contacts[contact])
        self._facets = problem.contacts[contact].cone(problem.surface.characteristic_length).normals[None]
        self._problem, self._least, self._deadline = problem, max(0.0, problem.min_margin) + _INSIDE, deadline or Deadline()
        given = asked.regions[contact] if asked.regions else None
        self._within = [] if given is None else [given]
        promised = promised_region(problem, contact, asked.region)
        if promised is not None:
            self._within.append(promised)
        self._weight, self._best = asked.margin_weight, 1.0
        if self._weight > 0:
            angles = float(problem.contacts[contact].frame[2]) + np.linspace(-np.pi / 2, np.pi / 2, 361)
            straight = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1)
            self._best = max(1e-6, float(self.oracle.margin(straight).max()))

    def accepts(self, twists: FloatArray, headings: ArrayLike = _ALL_ROUND) -> BoolArray:
        """Return whether body twists (n, 3) may be used.

        ``headings`` (n, 2) or (2,): where a push begins (rad in W), and by how much it turns; all headings if not given. They
        count where effects make loads depend on them.
        """
        if self.loads is not None:
            return self._along(twists, np.broadcast_to(np.asarray(headings, dtype=np.float64), (len(twists), 2)), self.loads)
        good = np.zeros(len(twists), dtype=bool)
        for start in range(0, len(twists), _BLOCK):
            if self._deadline.left() < 0:
                raise OutOfTimeError("primitives: the deadline has passed")
            block = slice(start, start + _BLOCK)
            good[block] = self.oracle.margin(twists[block]) >= self._least
        for region in self._within:
            assert isinstance(region, StableRegion), "regions of a level table are those of its scenarios"
            if good.any():
                good[good] = region.contains_twists(twists[good])
        return np.asarray(good)

    def _along(self, twists: FloatArray, headings: FloatArray, loads: PushLoads) -> BoolArray:
        """Whether body twists at the speed limit are stable all along the headings that they pass."""
        good = np.zeros(len(twists), dtype=bool)
        moving = np.flatnonzero(np.abs(twists).max(axis=1, initial=0.0) > 0)
        for start in range(0, len(moving), _BLOCK):
            if self._deadline.left() < 0:
                raise OutOfTimeError("primitives: the deadline has passed")
            rows = moving[start : start + _BLOCK]
            held = twists[rows] * (self._problem.speed / self._problem.push_speed(twists[rows]))[:, None]
            passed = loads.are_stable(held, headings[rows], np.zeros((len(rows), 1, 3)), self._facets, np.array((self._least,)))
            for region in self._within:
                assert not isinstance(region, StableRegion), "under effects regions depend on the heading"
                if passed.any():
                    passed[passed] = region.contains_pushes(held[passed], headings[rows][passed])
            good[rows] = passed
        return good

    def margin(self, push: Push) -> float:
        """Return the margin (rad) of a push: the least along it."""
        if self.loads is None:
            return float(self.oracle.margin(push.twist))
        return self.loads.least_margin(self._problem.contacts[self.contact], push)

    def costs(self, twists: FloatArray) -> FloatArray:
        """Return what body twists (n, 3), each held for a unit of its own time, cost in s at the speed limit."""
        times = self._problem.push_speed(twists) / self._problem.speed
        if self._weight == 0 or not len(twists):
            return times
        margins = self.oracle.margin(twists)
        return np.asarray(times * (1 + self._weight * np.clip(1 - margins / self._best, 0, 1)))
