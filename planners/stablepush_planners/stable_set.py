"""Which pushes of a contact may be used: what the surface calls stable, with a margin, and what else is asked."""

from __future__ import annotations

import math
import time

import numpy as np

from stablepush._arrays import BoolArray, FloatArray
from stablepush.all_pressure import all_pressure_region
from stablepush.conservative import lynch_mason_region
from stablepush.errors import OutOfTimeError
from stablepush.oracle import StabilityOracle
from stablepush.problem import PlanningProblem
from stablepush.region import StableRegion

#: Pushes stay this far (rad) inside the stable set, so that the check, which allows 1e-6, never disagrees.
_INSIDE = 1e-7
#: Twists asked at a time, between looks at the clock.
_BLOCK = 4096
#: Regions that hold for every pressure, in addition to the surface's own.
_PROMISED = {"all-pressure": all_pressure_region, "conservative": lynch_mason_region}


class StableSet:
    """Body twists that may be used at a contact of a problem.

    ``region`` is one of :data:`stablepush.planning.REGIONS`; ``margin`` (rad) is asked in addition to the problem's own. Raises
    :class:`OutOfTimeError` once ``deadline`` (a value of :func:`time.perf_counter`) has passed.
    """

    def __init__(
        self, problem: PlanningProblem, contact: int, region: str = "model", deadline: float = math.inf, margin: float = 0.0
    ) -> None:
        self.contact = contact
        self.oracle = StabilityOracle(problem.surface, problem.contacts[contact])
        self._least = max(0.0, problem.min_margin, margin) + _INSIDE
        self._deadline = deadline
        self._promised: StableRegion | None = None
        if region in _PROMISED:
            self._promised = _PROMISED[region](problem.slider, problem.contacts[contact])

    def accepts(self, twists: FloatArray) -> BoolArray:
        """Return whether body twists (n, 3) may be used."""
        good = np.zeros(len(twists), dtype=bool)
        for start in range(0, len(twists), _BLOCK):
            if time.perf_counter() > self._deadline:
                raise OutOfTimeError("primitives: the deadline has passed")
            block = slice(start, start + _BLOCK)
            good[block] = self.oracle.margin(twists[block]) >= self._least
        if self._promised is not None:
            good &= self._promised.contains_twists(twists)
        return np.asarray(good)
