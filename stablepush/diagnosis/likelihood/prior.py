"""What is believed of the pressure under the slider before a log is seen: loads, in which directions they may change, how far.

With forces the loads are those of support points, with a Gaussian prior about the nominal ones that is wide along their scale.
Without forces they are a shift and stretches of the nominal pressure.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import nnls

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.nominal import unit_loads
from stablepush.objects import SupportDistribution
from stablepush.surfaces import IdealLimitSurface

#: Prior standard deviation of a load over the total, and of the scale of the nominal loads over one.
_SPREAD, _SCALE = 0.15, 1.0
#: Motions over which pressures are compared.
_MOTIONS = 150
#: Prior standard deviations of a shift of the pressure (over the radius of gyration) and of its stretches; differences for them.
_DEVIATIONS, STEPS = (0.2, 0.2, 0.2, 0.2, 0.2), (0.02, 0.02, 0.05, 0.05, 0.05)
#: Cells along each side in which the nominal pressure is gathered.
_CELLS = 5
#: A shift over the characteristic length, and each stretch of the pressure, may be as much as this.
_MOST_MOVED = 0.6


class Prior(ABC):
    """What stands for the surface.

    Attributes
    ----------
    nominal : array, shape (k,)
        Loads of the nominal surface.
    has_surface : bool
        Whether a log carries information on the surface.
    """

    nominal: FloatArray
    has_surface: bool
    deviations: ClassVar[tuple[float, ...]] = ()

    @abstractmethod
    def directions(self, free: bool) -> tuple[FloatArray | None, FloatArray]:
        """Return directions (k, q) in which loads may change, None if each may, and their prior precision (q, q)."""

    @abstractmethod
    def surfaces(self, loads: FloatArray) -> tuple[IdealLimitSurface, ...]:
        """Return the pressure of each log as a limit surface."""

    @abstractmethod
    def moved_center(self, loads: FloatArray, changes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far (2,) in m the centre of the last log's pressure is from the nominal one, and standard deviations (2,).

        ``changes``: of the loads, by one standard deviation each.
        """

    def of_last(self, loads: FloatArray) -> FloatArray:
        """Return the loads (k, ...) of the last log: all there are of one."""
        return loads

    def surface(self, loads: FloatArray) -> IdealLimitSurface:
        """Return the pressure of the last log as a limit surface."""
        return self.surfaces(loads)[-1]


@dataclass(frozen=True, eq=False)
class PointLoads(Prior):
    """Friction loads (N) of support points: those of several logs one behind the other, each with a pressure of its own."""

    experiment: Experiment
    nominal: FloatArray
    has_surface: bool = True

    def directions(self, free: bool) -> tuple[FloatArray | None, FloatArray]:
        if not self.has_surface:
            return np.zeros((len(self.nominal), 0)), np.zeros((0, 0))
        if self.experiment.logs == 1:
            return self._of_one(self.nominal, free)
        each = [self._of_one(self.experiment.loads_of(self.nominal, k), free) for k in range(self.experiment.logs)]
        precision = block_diag(*(p for _, p in each))
        return None if free else block_diag(*(d for d, _ in each)), precision

    def _of_one(self, nominal: FloatArray, free: bool) -> tuple[FloatArray | None, FloatArray]:
        total, size = float(nominal.sum()), float(np.linalg.norm(nominal))
        along = nominal / size
        if not free:
            directions = np.column_stack((along, self.experiment.open_modes))
            precision = np.eye(directions.shape[1])
            precision[0, 0] = 1.0 / (_SCALE * size) ** 2
            return directions, precision
        precision = (np.eye(len(along)) - np.outer(along, along)) / (_SPREAD * total) ** 2
        return None, precision + np.outer(along, along) / (_SCALE * size) ** 2

    def of_last(self, loads: FloatArray) -> FloatArray:
        return self.experiment.loads_of(loads, self.experiment.last)

    def surface(self, loads: FloatArray) -> IdealLimitSurface:
        return self._surface(self.of_last(loads))

    def surfaces(self, loads: FloatArray) -> tuple[IdealLimitSurface, ...]:
        return tuple(self._surface(self.experiment.loads_of(loads, k)) for k in range(self.experiment.logs))

    def moved_center(self, loads: FloatArray, changes: FloatArray) -> tuple[FloatArray, FloatArray]:
        points, nominal = self.experiment.points, self.of_last(self.nominal)
        loads, changes = self.of_last(loads), self.of_last(changes)
        center = loads @ points / loads.sum()
        off = center - nominal @ points / nominal.sum()
        spread = (changes.T @ points - np.outer(changes.sum(axis=0), center)) / loads.sum()
        return off, np.sqrt((spread**2).sum(axis=0))

    def _surface(self, loads: FloatArray) -> IdealLimitSurface:
        """The pressure of one log as a limit surface.

        Loads that came out negative have no meaning as pressure: those that are not negative and nearest to the same friction,
        over motions in all directions, take their place.
        """
        positive, points, rho = np.asarray(loads), self.experiment.points, self.experiment.rho
        if (positive < 0).any():
            rng = np.random.default_rng(0)
            twists = rng.normal(size=(_MOTIONS, 3)) / (1, 1, rho)
            rows = unit_loads(points, twists, rho)
            positive, _ = nnls(rows, rows @ loads)
        if (positive > 0).sum() < 2:
            # a log that carries no information on the pressure: a little of the nominal one keeps it a surface
            positive = positive + 1e-6 * np.abs(self.experiment.loads_of(self.nominal, self.experiment.last))
        carrying = positive > 0
        return IdealLimitSurface(SupportDistribution(points[carrying], positive[carrying]), float(positive.sum()), rho)


@dataclass(frozen=True, eq=False)
class MovedPressure(Prior):
    """The nominal pressure moved and stretched about its centre, an affine map: shift (2,) over ``rho``, and stretches along x,
    along y and askew."""

    pressure: IdealLimitSurface
    nominal: FloatArray
    has_surface: bool = True
    deviations = _DEVIATIONS

    @classmethod
    def of(cls, pressure: IdealLimitSurface) -> MovedPressure:
        """Return the prior about a pressure, of which few points stand for many."""
        support = _gathered(pressure.support)
        few = IdealLimitSurface(support, pressure.friction_load, pressure.characteristic_length)
        return cls(few, np.zeros(len(_DEVIATIONS)))

    def directions(self, free: bool) -> tuple[FloatArray | None, FloatArray]:
        count = len(self.nominal) if free else 0
        return np.eye(len(self.nominal))[:, :count], np.diag(1 / np.array(_DEVIATIONS)[:count] ** 2)

    def surfaces(self, loads: FloatArray) -> tuple[IdealLimitSurface, ...]:
        ideal, (x, y, along, across, askew) = self.pressure, np.clip(loads, -_MOST_MOVED, _MOST_MOVED)
        center, rho = ideal.support.center, ideal.characteristic_length
        stretch = np.array(((1 + along, askew), (askew, 1 + across)))
        points = center + rho * np.array((x, y)) + (ideal.support.points - center) @ stretch
        return (IdealLimitSurface(SupportDistribution(points, ideal.support.weights), ideal.friction_load, rho),)

    def moved_center(self, loads: FloatArray, changes: FloatArray) -> tuple[FloatArray, FloatArray]:
        # the first two loads are the shift over rho
        rho = self.pressure.characteristic_length
        return rho * np.clip(loads[:2], -_MOST_MOVED, _MOST_MOVED), rho * np.sqrt((changes[:2] ** 2).sum(axis=1))


def _gathered(support: SupportDistribution) -> SupportDistribution:
    """Return a few points for many: the centres of those that share a cell."""
    points, weights = support.points, support.weights
    if len(points) <= _CELLS**2:
        return support
    low = points.min(axis=0)
    cells = np.minimum((points - low) / np.maximum(np.ptp(points, axis=0), 1e-9) * _CELLS + 1e-9, _CELLS - 1).astype(int)
    _, cell = np.unique(cells @ (_CELLS, 1), return_inverse=True)
    total = np.bincount(cell, weights)
    centers = np.stack([np.bincount(cell, weights * points[:, k]) / total for k in range(2)], axis=-1)
    return SupportDistribution(centers, total)
