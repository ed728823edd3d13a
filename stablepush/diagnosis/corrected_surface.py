"""The friction of the support as plans need it: a pressure near the believed one that is nowhere negative, and its ensemble."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import nnls

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.attribution import folds_of
from stablepush.diagnosis.equations import OF_PRESSURE, Fitted, robust_scale, student_density, student_weights
from stablepush.diagnosis.system import System
from stablepush.objects import SupportDistribution
from stablepush.surfaces import IdealLimitSurface

#: Standard deviation of the load of a point about the believed one, over the mean load of a point: as a rule, and where pushes
#: that are left out of the fit are then predicted clearly better.
_SPREAD, _WIDER = 1.0, (4.0, 16.0)
#: Of the friction as a whole, over the believed one.
_SCALE = 1.0
#: How far members of the ensemble are from the best surface, over what they would be if pushes shared no errors: loads of pushes
#: beside those of a plan were off by 2.5 times the spread without it, over 19 simulated plans.
_SHARED = 2.0
#: Surfaces of the ensemble, and rounds in which rows that are far off come to count less.
_MEMBERS, _ROUNDS = 60, 4
#: Shares of the load below this are none.
_LEAST_SHARE = 1e-6


def corrected_surface(system: System, fitted: Fitted) -> IdealLimitSurface:
    """Return the friction of the support, beside the effects of a fit, as a pressure with an ensemble.

    The loads ``m >= 0`` (k,) of the support points have the least

        Σ w (y - G m)² / s + |m - m0|² / σ²

    with whitened wrenches ``y`` less the effects, weights ``w`` and scale ``s`` of Student errors, the believed loads ``m0`` and
    the mean load ``σ`` of a point. A plan has few pushes, and they are alike: loads that may be anything fit them, and say little
    of other pushes. Where no effect moves the points of a log, a shift of all of them is fitted first. Members of the ensemble
    have random weights of the pushes (Rubin 1981, *The Bayesian bootstrap*) and random ``m0``.

    Without forces the loads are the believed ones, and the ensemble is what the pokes behind them leave open.
    """
    rng, believed = np.random.default_rng(0), np.maximum(0.0, system.of_last(system.nominal))
    if system.has_wrench:
        if system.logs == 1 and not any(id in fitted.values for id in OF_PRESSURE):
            fitted = system.fit([*fitted.values, "pressure-shift"], False)
        shown = _Shown.by(system, fitted)
        prior = _Prior.of(believed, _spread(system, shown, believed))
        loads, weights = shown.fit(prior)
        drawn = [loads]
        for _ in range(_MEMBERS):
            of_push = rng.exponential(size=len(system.push))[system.push]
            drawn.append(shown.nearest(prior.moved(rng), weights * of_push[shown.trial]))
    else:
        left_open = system.open_modes @ rng.normal(size=(system.open_modes.shape[1], _MEMBERS))
        drawn = [believed, *np.maximum(0.0, believed[:, None] + left_open).T]
    rows = np.array(drawn)
    rows = np.maximum(0.0, rows[0] + _SHARED * (rows - rows[0]))
    carrying = rows.max(axis=0) > _LEAST_SHARE * float(rows[0].sum())
    points, rows = system.points[carrying], rows[:, carrying]
    center = system.center
    points = center + (1 + fitted.values.get("pressure-spread", np.zeros(1))[0]) * (points - center)
    points = points + fitted.values.get("pressure-shift", np.zeros(2))[:2]
    ensemble = rows[1:] if np.ptp(rows[1:], axis=0).any() else None
    return IdealLimitSurface(SupportDistribution(points, rows[0]), float(rows[0].sum()), system.rho, ensemble)


@dataclass(frozen=True, slots=True, eq=False)
class _Prior:
    """Normal distribution of loads (k,), in N, about a ``center``: each by ``spread``, all together by their own size."""

    center: FloatArray
    spread: float
    believed: FloatArray
    precision: FloatArray

    @classmethod
    def of(cls, believed: FloatArray, spread: float) -> _Prior:
        covariance = spread**2 * np.eye(len(believed)) + _SCALE**2 * np.outer(believed, believed)
        return cls(believed, spread, believed, np.asarray(np.linalg.inv(covariance), dtype=np.float64))

    def moved(self, rng: np.random.Generator) -> _Prior:
        """About a draw from it."""
        drawn = self.believed * (1 + _SCALE * rng.normal()) + self.spread * rng.normal(size=len(self.believed))
        return replace(self, center=drawn)


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """What a log shows of the loads: whitened wrenches (n,) less the effects, their slopes (n, k) and trials (n,)."""

    wrench: FloatArray
    slopes: FloatArray
    trial: np.ndarray

    @classmethod
    def by(cls, system: System, fitted: Fitted) -> _Shown:
        """Of the last log that is fitted."""
        matrix, _ = system.model.matrix(system.of_wrench(fitted.values))
        trial = system.observations.trial
        last = np.repeat(system.log[trial] == system.last, 3)
        slopes = system.white(matrix)
        # a model's friction beyond that of the points is theirs from now on
        wrench = fitted.residual[: len(slopes)] + slopes @ fitted.loads + system.white(system.model.beyond_points)
        own = system.of_last(slopes.T).T
        return cls(wrench[last], own[last], np.repeat(trial, 3)[last])

    def part(self, trials: BoolArray) -> _Shown:
        """Rows of chosen trials."""
        use = trials[self.trial]
        return _Shown(self.wrench[use], self.slopes[use], self.trial[use])

    def left(self, loads: FloatArray) -> FloatArray:
        """Whitened wrenches (n,) that loads leave."""
        return self.wrench - self.slopes @ loads

    def fit(self, prior: _Prior) -> tuple[FloatArray, FloatArray]:
        """Return the loads (k,) that are nearest to what is shown and to the prior, and the rows' weights (n,)."""
        loads, weights = prior.center, np.ones(len(self.wrench))
        for _ in range(_ROUNDS):
            left = self.left(loads)
            scale = robust_scale(left)
            weights = student_weights(left, scale) / scale
            loads = self.nearest(prior, weights)
        return loads, weights

    def nearest(self, prior: _Prior, weights: FloatArray) -> FloatArray:
        """Return the loads (k,) ``>= 0`` of the least weighted squares, with those of the prior."""
        weighted = weights[:, None] * self.slopes
        upper = cholesky(weighted.T @ self.slopes + prior.precision)
        wanted = solve_triangular(upper, weighted.T @ self.wrench + prior.precision @ prior.center, trans="T")
        return np.asarray(nnls(upper, wanted)[0])


def _spread(system: System, shown: _Shown, believed: FloatArray) -> float:
    """Standard deviation (N) of loads about the believed ones: larger than usual where pushes that are left out of the fit are
    then predicted clearly better."""
    folds, mean = folds_of(system), float(believed.sum()) / len(believed)

    def held_out(spread: float) -> FloatArray:
        found = np.zeros(len(folds))
        for k in np.unique(folds):
            known, test = shown.part(folds != k), shown.part(folds == k)
            if len(known.trial) and len(test.trial):
                loads, _ = known.fit(_Prior.of(believed, spread))
                density = student_density(test.left(loads), robust_scale(known.left(loads)))
                found += np.bincount(test.trial, density, minlength=len(folds))
        return found

    best = _SPREAD * mean
    score = held_out(best)
    for times in _WIDER:
        wider = held_out(times * mean)
        if system.significantly_better(wider, score):
            best, score = times * mean, wider
    return best
