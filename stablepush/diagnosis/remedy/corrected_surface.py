"""The friction of the support as plans need it: a pressure near the believed one that is nowhere negative, and its ensemble."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.diagnosis.likelihood.robust import robust_scale, student_density, student_weights
from stablepush.diagnosis.search.folds import folds_of
from stablepush.effects import in_order
from stablepush.objects import SupportDistribution
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Standard deviation of the load of a point about the believed one, over the mean load of a point: as a rule, and where pushes
#: that are left out of the fit are then predicted clearly better.
_SPREAD, _WIDER = 1.0, (4.0, 16.0)
#: Of the friction as a whole, over what the fit has for it.
_SCALE = 0.3
#: How far members of the ensemble are from the best surface, over what they would be if pushes of a plan shared no errors.
_SHARED = 2.0
#: Surfaces of the ensemble, and rounds in which rows that are far off come to count less.
_MEMBERS, _ROUNDS = 60, 4
#: Shares of the load below this are none.
_LEAST_SHARE = 1e-6


class Base(NamedTuple):
    """A fit that a corrected surface starts from. ``free``: with any pressure; ``density`` (trials,): the log density of each
    trial by fits to other pushes, for comparison with another base."""

    fitted: Fitted
    free: bool
    density: FloatArray | None = None


def corrected_surface(likelihood: Likelihood, base: Base, refit: Base | None = None) -> IdealLimitSurface:
    """Return the friction of the support, beside the effects of a fit, as a pressure with an ensemble.

    With forces the loads ``m >= 0`` (k,) of the support points have the least

        Σ w (y - G m)² / s + (m - m0)' C⁻¹ (m - m0),    C = σ² I + (0.3)² m0 m0'

    with whitened wrenches ``y`` less the effects, weights ``w`` and scale ``s >= 1`` of Student errors, and the believed loads
    ``m0``, as large as the fit has them. ``σ`` is the mean load of a point, or 4 or 16 times that if pushes that are left out are
    then predicted clearly better. A plan has few pushes, and they are alike: loads that may be anything fit them, and say little
    of other pushes. Members of the ensemble have random weights of the pushes (Rubin 1981, *The Bayesian bootstrap*) and random
    ``m0``, and are then twice as far from the best loads, for pushes of a plan share errors.

    Without forces the loads are those of points whose friction is nearest to that of the fit.

    A fit may move the pressure in a form of the catalogue. A ``refit`` of any pressure takes its place if it predicts left-out
    pushes better. With forces both predict them by the loads above. Without forces the ensemble has the width of the refit's
    either way: a form has none of its own.
    """
    if likelihood.wrench is not None:
        fits = [_Loads.by(likelihood, each.fitted) for each in (base, refit) if each is not None]
        loads = max(fits, key=lambda each: float(each.score.sum()))
        fitted, (best, members) = loads.fitted, loads.with_ensemble(likelihood)
    else:
        fitted, (best, members) = _by_poses(likelihood, base, refit)
    carrying = np.maximum(best, members.max(axis=0)) > _LEAST_SHARE * float(best.sum())
    center = likelihood.experiment.center
    points = likelihood.experiment.points[carrying]
    moved = [kind for id, kind in likelihood.experiment.effects.items() if kind.reshapes == "pressure" and id in fitted.values]
    for kind in in_order(moved):
        points = kind.pressed(points, center, kind.numbers(fitted.values[kind.id]))
    best, members = best[carrying], members[:, carrying]
    ensemble = members if np.ptp(members, axis=0).any() else None
    return IdealLimitSurface(SupportDistribution(points, best), float(best.sum()), likelihood.experiment.rho, ensemble)


def _by_poses(likelihood: Likelihood, base: Base, refit: Base | None) -> tuple[Fitted, tuple[FloatArray, FloatArray]]:
    """From final poses: the fit that is taken, the loads (k,) of points with its friction, and the loads (m, k) of the
    ensemble."""
    fitted = base.fitted
    if refit is not None and refit.density is not None and base.density is not None:
        fitted = refit.fitted if refit.density.sum() > base.density.sum() else fitted
    rng, believed = np.random.default_rng(0), likelihood.experiment.believed
    design, twists = believed.design(likelihood.experiment.points)
    model = believed.points if believed.model is None else believed.model
    unit = 1.0 if believed.model is None else believed.load

    def friction(surface: LimitSurface, unit: float = 1.0) -> FloatArray:
        return np.asarray(unit * surface.wrench(twists) / (1, 1, likelihood.experiment.rho)).ravel()

    beyond = friction(model, unit) - friction(likelihood.prior.surface(likelihood.prior.nominal))

    def points(loads: FloatArray) -> FloatArray:
        return np.asarray(nnls(design, friction(likelihood.prior.surface(loads)) + beyond)[0])

    widest = refit or base
    deviations = _SHARED * likelihood.deviations(widest.fitted, widest.free)
    draws = rng.normal(size=(_MEMBERS, deviations.shape[1]))
    return fitted, (points(fitted.loads), np.array([points(fitted.loads + deviations @ draw) for draw in draws]))


@dataclass(frozen=True, slots=True, eq=False)
class _Prior:
    """Normal distribution of loads (k,), in N, about a ``center``: each by ``spread``, all together by a share of their sum."""

    believed: FloatArray
    spread: float
    shift: FloatArray | float = 0.0

    def rows(self) -> FloatArray:
        """Return ``(R, R c)`` (k, k + 1) of the precision ``R'R`` and the center ``c``."""
        size = float(np.linalg.norm(self.believed))
        along = self.believed / size
        share = 1 - self.spread / np.hypot(self.spread, _SCALE * size)
        root = (np.eye(len(along)) - share * np.outer(along, along)) / self.spread
        return np.column_stack((root, root @ (self.believed + self.shift)))

    def moved(self, rng: np.random.Generator) -> _Prior:
        """About a draw from it."""
        drawn = self.believed * _SCALE * rng.normal() + self.spread * rng.normal(size=len(self.believed))
        return replace(self, shift=drawn)


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """What a log shows of the loads: whitened wrenches (n,) less the effects, their slopes (n, k) and trials (n,)."""

    wrench: FloatArray
    slopes: FloatArray
    trial: np.ndarray

    @classmethod
    def by(cls, likelihood: Likelihood, fitted: Fitted) -> _Shown:
        """Of the last log that is fitted."""
        channel = likelihood.wrench
        assert channel is not None
        matrix, _ = channel.matrix(fitted.values)
        trial = likelihood.experiment.observations.trial
        last = np.repeat(likelihood.experiment.log[trial] == likelihood.experiment.last, 3)
        slopes = channel.white(matrix)
        # a model's friction beyond that of the points is theirs from now on
        wrench = fitted.residual[: len(slopes)] + slopes @ fitted.loads + channel.white(channel.beyond_points)
        own = likelihood.prior.of_last(slopes.T).T
        return cls(wrench[last], own[last], np.repeat(trial, 3)[last])

    def part(self, trials: BoolArray) -> _Shown:
        """Rows of chosen trials."""
        use = trials[self.trial]
        return _Shown(self.wrench[use], self.slopes[use], self.trial[use])

    def left(self, loads: FloatArray) -> FloatArray:
        """Whitened wrenches (n,) that loads leave."""
        return self.wrench - self.slopes @ loads

    def scale(self, loads: FloatArray) -> float:
        """Mean square of what loads leave: no less than noise, which few rows may seem to have."""
        return robust_scale(self.left(loads), 1.0)

    def fit(self, prior: _Prior) -> tuple[FloatArray, FloatArray]:
        """Return the loads (k,) that are nearest to what is shown and to the prior, and the rows' weights (n,)."""
        loads, weights = prior.believed, np.ones(len(self.wrench))
        for _ in range(_ROUNDS):
            scale = self.scale(loads)
            weights = student_weights(self.left(loads), scale) / scale
            loads = _least(self.root(prior, weights))
        return loads, weights

    def root(self, prior: _Prior, weights: FloatArray) -> FloatArray:
        """Triangular rows (k + 1, k + 1) of the same weighted squares as all rows and those of the prior; wrenches are the last
        column."""
        rows = np.sqrt(weights)[:, None] * np.column_stack((self.slopes, self.wrench))
        return np.asarray(np.linalg.qr(np.concatenate((rows, prior.rows())))[1])


def _least(root: FloatArray) -> FloatArray:
    """Loads (k,) ``>= 0`` of the least squares."""
    return np.asarray(nnls(root[:, :-1], root[:, -1])[0])


@dataclass(frozen=True, slots=True, eq=False)
class _Loads:
    """What a log shows of the loads beside the effects of a fit, and what is believed of them. ``score``: log density (trials,)
    of trials that are left out."""

    fitted: Fitted
    shown: _Shown
    prior: _Prior
    score: FloatArray

    @classmethod
    def by(cls, likelihood: Likelihood, fitted: Fitted) -> _Loads:
        nominal = np.maximum(0.0, likelihood.prior.of_last(likelihood.prior.nominal))
        believed = nominal * max(0.01, float(likelihood.prior.of_last(fitted.loads).sum() / nominal.sum()))
        shown = _Shown.by(likelihood, fitted)
        spread, score = _spread(likelihood, shown, believed)
        return cls(fitted, shown, _Prior(believed, spread), score)

    def with_ensemble(self, likelihood: Likelihood) -> tuple[FloatArray, FloatArray]:
        """Loads (k,) and those (m, k) of the ensemble."""
        rng, shown, prior = np.random.default_rng(0), self.shown, self.prior
        best, weights = shown.fit(prior)
        root = shown.root(prior, weights)[:, :-1]
        members = []
        for _ in range(_MEMBERS):
            of_push = rng.exponential(size=len(likelihood.experiment.push))[likelihood.experiment.push]
            member = _least(shown.root(prior.moved(rng), weights * of_push[shown.trial]))
            # what is less than no load counts as in the fit
            members.append(nnls(root, root @ (best + _SHARED * (member - best)))[0])
        return best, np.array(members)


def _spread(likelihood: Likelihood, shown: _Shown, believed: FloatArray) -> tuple[float, FloatArray]:
    """Standard deviation (N) of loads about the believed ones, and the log density (trials,) of trials that are left out of the
    fit: larger than usual where they are then predicted clearly better."""
    folds, mean = folds_of(likelihood.experiment), float(believed.sum()) / len(believed)

    def held_out(spread: float) -> FloatArray:
        found = np.zeros(len(folds))
        for k in np.unique(folds):
            known, test = shown.part(folds != k), shown.part(folds == k)
            if len(known.trial) and len(test.trial):
                loads, _ = known.fit(_Prior(believed, spread))
                density = student_density(test.left(loads), known.scale(loads))
                found += np.bincount(test.trial, density, minlength=len(folds))
        return found

    best = _SPREAD * mean
    score = held_out(best)
    for times in _WIDER:
        wider = held_out(times * mean)
        if not likelihood.significantly_better(wider, score):
            break
        best, score = times * mean, wider
    return best, score
