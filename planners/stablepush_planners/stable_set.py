"""Which pushes of a contact may be used, and what they cost: what the surface calls stable, and what else is asked."""

from __future__ import annotations

import numpy as np

from stablepush.core import BoolArray, Deadline, FloatArray, InputError, OutOfTimeError
from stablepush.planning import PlanningProblem, PlanOptions, promised_region
from stablepush.stability import StabilityOracle

#: Pushes stay this far (rad) inside the stable set, so that the check, which allows 1e-6, never disagrees.
_INSIDE = 1e-7
#: Twists asked at a time, between looks at the clock.
_BLOCK = 4096
#: Slack of a share of surfaces: k of n must pass for p = k/n.
_SLACK = 1e-9


class StableSet:
    """Body twists that may be used at a contact of a problem, and what they cost.

    Raises :class:`OutOfTimeError` once ``deadline`` has passed, and :class:`InputError` if a probability is asked of a surface
    without an ensemble.
    """

    def __init__(
        self, problem: PlanningProblem, contact: int, options: PlanOptions | None = None, deadline: Deadline | None = None
    ) -> None:
        asked = PlanOptions() if options is None else options
        self.contact = contact
        self.oracle = StabilityOracle(problem.surface, problem.contacts[contact])
        self._problem, self._least, self._deadline = problem, max(0.0, problem.min_margin) + _INSIDE, deadline or Deadline()
        self._within = [asked.regions[contact]] if asked.regions else []
        promised = promised_region(problem, contact, asked.region)
        if promised is not None:
            self._within.append(promised)
        self._members: list[StabilityOracle] = []
        self._votes = asked.probability
        if asked.probability > 0:
            members = problem.surface.members()
            if not members:
                raise InputError("probability", "expected a limit surface with an ensemble, as a fit leaves it")
            self._members = [StabilityOracle(member, problem.contacts[contact]) for member in members]
        self._weight, self._best = asked.margin_weight, 1.0
        if self._weight > 0:
            angles = float(problem.contacts[contact].frame[2]) + np.linspace(-np.pi / 2, np.pi / 2, 361)
            straight = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1)
            self._best = max(1e-6, float(self.oracle.margin(straight).max()))

    def accepts(self, twists: FloatArray) -> BoolArray:
        """Return whether body twists (n, 3) may be used."""
        good = np.zeros(len(twists), dtype=bool)
        for start in range(0, len(twists), _BLOCK):
            if self._deadline.left() < 0:
                raise OutOfTimeError("primitives: the deadline has passed")
            block = slice(start, start + _BLOCK)
            good[block] = self.oracle.margin(twists[block]) >= self._least
        for region in self._within:
            if good.any():
                good[good] = region.contains_twists(twists[good])
        if self._members and good.any():
            votes = np.zeros(good.sum())
            for member in self._members:
                if self._deadline.left() < 0:
                    raise OutOfTimeError("primitives: the deadline has passed")
                votes += member.is_stable(twists[good])
            good[good] = votes >= (self._votes - _SLACK) * len(self._members)
        return np.asarray(good)

    def costs(self, twists: FloatArray) -> FloatArray:
        """Return what body twists (n, 3), each held for a unit of its own time, cost in s at the speed limit."""
        times = self._problem.push_speed(twists) / self._problem.speed
        if self._weight == 0 or not len(twists):
            return times
        margins = self.oracle.margin(twists)
        return np.asarray(times * (1 + self._weight * np.clip(1 - margins / self._best, 0, 1)))
