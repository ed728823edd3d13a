"""Whitened equations of a log, and how well effects fit them: joint fits by Gauss-Newton, and score tests."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import f as f_distribution

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.likelihood.forward import PARAMETERS
from stablepush.effects import FAMILIES, LabEffect

#: Degrees of freedom of the row errors (Student): rows that are far off count less.
_TAIL = 5.0
#: Directions of parameters whose information is this share of the greatest are not determined.
_RANK = 1e-9
#: Shares of a Gauss-Newton step that are tried until it helps.
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.02)
#: Mean square below which whitened residuals are rounding.
_ROUNDING = 1e-4
#: Median of the squares of unit Gaussian noise.
_MEDIAN = 0.455
#: Least logarithm of a p-value, where its formula underflows.
_LEAST_LOG = -500.0
#: Effects that are fitted, and numbers of their parameters.
SIZES: Mapping[str, int] = {**PARAMETERS, "contact-geometry": 1, "contact-friction": 1}
#: Half of the plausible range of the parameters as they are fitted.
RANGES: Mapping[str, float] = {
    "anisotropy-world": 0.2, "anisotropy-object": 0.2, "speed-dependence": 0.15, "spatial-variation": 1.0, "drift": 0.3,
    "pressure-shift": 0.01, "pressure-spread": 0.35, "tilt": 0.05, "inertia": 3.0, "force-bias": 1.0, "force-rotation": 0.3,
    "frame-offset": 0.01, "latency": 0.3, "contact-geometry": 0.01, "contact-friction": 0.4,
}  # fmt: skip
#: Effects by direction.
ANISOTROPIES = ("anisotropy-world", "anisotropy-object")
#: Effects that only reshape the surface in the body frame, and those of them that a refitted pressure takes in.
OF_BODY = ("pressure-shift", "pressure-spread", "anisotropy-object")
OF_PRESSURE = OF_BODY[:2]
Values = dict[str, FloatArray]
#: Terms of families are found within so many times half of their plausible range.
_FAR = 4.0


class Demands(NamedTuple):
    """Thresholds that an effect must pass to be named.

    ``gain``: least one-step decrease of the sum of squares over its scale, and least score statistic. ``density``: least increase
    of the log density of the trials, and ``errors``: the same in its standard errors over pushes. ``family_wise_p``: largest
    family-wise p-value of the statistic; it may be as large as ``waived_p`` if density and errors are ``certain`` times as large.
    """

    gain: float
    density: float
    errors: float
    family_wise_p: float
    certain: float = np.inf
    waived_p: float = 1.0

    @property
    def fewest_pushes(self) -> int:
        """Pushes that a log must have: n of them have 2ⁿ⁻¹ patterns of signs, and so no smaller p-value than one of these."""
        largest = self.waived_p if np.isfinite(self.certain) else self.family_wise_p
        return 1 + math.ceil(-math.log2(largest))


@dataclass(frozen=True, eq=False)
class Fitted:
    """Loads (k,) of the support points, parameters by effect, and what is left: residuals of all whitened rows and the log
    density of each trial. ``jackknife`` returns the covariance of the parameters; few fits are asked for it."""

    loads: FloatArray
    values: Values
    jackknife: Callable[[], FloatArray]
    residual: FloatArray
    density: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        return self.jackknife()

    @property
    def score(self) -> float:
        return float(self.density.sum())

    def errors_of(self, id: str) -> float:
        """How many of their standard errors the parameters of an effect are away from none."""
        first = 0
        for name, value in self.values.items():
            if name == id:
                block = self.covariance[first : first + len(value), first : first + len(value)]
                return float(np.sqrt(value @ np.linalg.pinv(block, rcond=_RANK, hermitian=True) @ value))
            first += len(value)
        return 0.0


@dataclass(frozen=True, slots=True, eq=False)
class ScoreTest:
    """What an effect that is not fitted would do.

    ``statistic``: of the trials' scores, about chi-squared with as many degrees as parameters when there is no effect; ``gain``:
    what the sum of squares, over its scale, would fall by; ``estimate`` (d,) of one step and its ``information`` (d, d);
    ``scores`` (trials, d) that are left after the step, and ``shares`` (trials, d, d) of the trials in the information.
    """

    statistic: float
    gain: float
    estimate: FloatArray
    information: FloatArray
    scores: FloatArray
    shares: FloatArray

    @classmethod
    def blind(cls, information: FloatArray, trial: np.ndarray) -> ScoreTest:
        """Of an effect that the log does not show."""
        d, trials = len(information), int(trial.max()) + 1 if len(trial) else 1
        return cls(0.0, 0.0, np.zeros(d), information, np.zeros((trials, d)), np.zeros((trials, d, d)))

    def under_none(self, signs: FloatArray) -> FloatArray:
        """Statistics (draws,) had the errors of the trials had other signs (draws, trials) and the effect been absent: a wild
        bootstrap of the scores, studentised in every draw."""
        total = self.shares.sum(axis=0)
        if not total.any():
            return np.zeros(len(signs))
        sums = signs @ self.scores
        steps = np.linalg.solve(total, sums.T).T
        left = signs[:, :, None] * self.scores - np.einsum("tij,nj->nti", self.shares, steps)
        return statistics(sums, left)

    def informative_trials(self) -> float:
        """Number of trials that carry the information: ``(Σ s)² / Σ s²`` of their shares in it (Satterthwaite 1946)."""
        total = self.shares.sum(axis=0)
        if not total.any():
            return 0.0
        share = np.einsum("ij,tji->t", np.linalg.inv(total), self.shares)
        return float(share.sum()) ** 2 / float((share**2).sum())

    def log_p(self, statistic: FloatArray | float) -> FloatArray:
        """Logarithm of the p-value of a statistic (any shape) by Hotelling's T²: the scatter of few trials is uncertain."""
        d = len(self.estimate)
        if not self.shares.any():
            return np.zeros(np.shape(statistic))
        trials = max(self.informative_trials(), d + 1.0)
        return np.maximum(f_distribution.logsf(np.asarray(statistic) / d, d, trials - d), _LEAST_LOG)


def statistics(sums: FloatArray, scores: FloatArray) -> FloatArray:
    """Return ``p' S⁻¹ p`` (draws,) of sums (draws, d) whose covariance is that of the scores (draws, trials, d) left."""
    d = sums.shape[1]
    active = np.maximum(2, (np.abs(scores).max(axis=2) > 0).sum(axis=1))
    spread = np.einsum("nti,ntj->nij", scores, scores) * (active / np.maximum(1, active - d))[:, None, None]
    return np.asarray(np.einsum("ni,nij,nj->n", sums, np.linalg.pinv(spread, rcond=_RANK, hermitian=True), sums))


class Equations(ABC):
    """Whitened rows of a log: measured less predicted for a surface (its ``loads``) and parameters of effects.

    Attributes
    ----------
    trial : array of int, shape (rows,)
        Of each row.
    push : array of int, shape (trials,)
        The same number for trials that repeat one push.
    nominal : array, shape (k,)
        Loads, or what stands for them, of the nominal surface.
    nuisance : tuple of str
        Effects that are always fitted, and never tested: what they act on is not known.
    steps, few, tolerance
        Gauss-Newton steps of a fit at most, of one that begins near, and the share by which a step must help.
    demands : Demands
    least_scale : float
        Mean square, in units of the noise, that residuals have at least: 1 where the noise is stated. What is smaller than the
        noise is no evidence: errors of the nominal surface are alike in pushes that are alike.
    about : Fitted, optional
        Where fits begin; the nominal surface without effects if not given.
    own : mapping of str to LabEffect
        Effects of a lab's own, by id.
    opened : set of str
        Effects that are fitted with the terms of their family (:data:`stablepush.effects.FAMILIES`).
    """

    trial: np.ndarray
    push: np.ndarray
    nominal: FloatArray
    nuisance: tuple[str, ...] = ()
    steps, few, tolerance = 12, 12, 1e-7
    about: Fitted | None = None
    opened: frozenset[str] = frozenset()
    aside: frozenset[str] = frozenset()
    own: Mapping[str, LabEffect] = MappingProxyType({})
    demands = Demands(18.0, 6.0, 2.0, 0.01)
    least_scale = _ROUNDING

    @abstractmethod
    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        """Whitened measured minus predicted rows."""

    @abstractmethod
    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        """Whitened derivatives (rows, size) of the prediction by the first parameters of an effect."""

    def size(self, id: str, whole: bool | None = None) -> int:
        """Return the number of an effect's parameters; with the terms of its family if ``whole``, or if it is opened."""
        if id in self.own:
            return self.own[id].parameter.size
        terms = id in self.opened if whole is None else whole
        return SIZES[id] + (len(FAMILIES[id].terms) if terms and id in FAMILIES else 0)

    @abstractmethod
    def base(self, values: Values, free: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Directions (k, q) in which loads may change, whitened columns (rows, q) of them, and their prior precision (q, q).

        ``free``: any pressure, else the nominal one, scaled if its friction is not known.
        """

    def scale_of(self, residual: FloatArray) -> float:
        """Robust mean square of whitened residuals, at least :attr:`least_scale`."""
        return robust_scale(residual, self.least_scale)

    def plausible(self, id: str) -> float:
        """Half of the plausible range of an effect's parameters, as they are fitted."""
        return self.own[id].plausible if id in self.own else RANGES[id]

    def settle(self, fitted: Fitted) -> None:
        """Let later fits begin at this one."""
        self.about = fitted

    def fit(self, effects: Sequence[str], free: bool, chosen: BoolArray | None = None, start: Fitted | None = None) -> Fitted:
        """Fit loads and the parameters of effects to the rows of ``chosen`` trials (all if not given), by Gauss-Newton.

        Rows count by Student weights. The result's residuals and densities are those of all rows. ``start``: a fit of the same
        effects to all trials, which is near.
        """
        use = np.ones(len(self.trial), dtype=bool) if chosen is None else chosen[self.trial]
        effects = [*effects, *(id for id in self.nuisance if id not in effects)]
        values: Values = {id: np.zeros(self.size(id)) for id in effects}
        loads = self.nominal.copy()
        begin = start or self.about
        if begin is not None:
            values |= {id: _of_size(value, self.size(id)) for id, value in begin.values.items() if id in values}
            loads = begin.loads.copy() if free or start else loads
        residual = self.residual(loads, values)
        for _ in range(self.steps if start is None else self.few):
            directions, base, precision = self.base(values, free)
            q = len(precision)
            design = np.concatenate((base, *(self.columns(id, loads, values, self.size(id)) for id in effects)), axis=1)
            scale = self.scale_of(residual[use])
            weights = student_weights(residual, scale) * use
            data = design.T @ (weights[:, None] * design)
            prior = np.zeros_like(data)
            prior[:q, :q] = precision * scale
            away = directions.T @ (self.nominal - loads)
            hessian = data + prior + 1e-12 * np.diag(np.diag(data + prior) + 1e-30)
            score = design.T @ (weights * residual)
            score[:q] += scale * (precision @ away)
            step = np.linalg.lstsq(hessian, score, rcond=1e-14)[0]
            before = after = _loss(residual[use], scale, away, precision)
            for share in _SHARES:
                new_loads = loads + share * (directions @ step[:q])
                ends = q + np.cumsum([0, *(self.size(id) for id in effects)])
                new_values = {
                    id: self.clipped(id, values[id] + share * step[i:j])
                    for id, i, j in zip(effects, ends[:-1], ends[1:], strict=True)
                }
                new_residual = self.residual(new_loads, new_values)
                after = _loss(new_residual[use], scale, directions.T @ (self.nominal - new_loads), precision)
                if after <= before:
                    loads, values, residual = new_loads, new_values, new_residual
                    break
            if before - after <= self.tolerance * max(before, 1.0):
                break

        def jackknife() -> FloatArray:
            return self._spread(design, data, prior, residual, use)[q:, q:]

        return Fitted(loads, values, jackknife, residual, self.density(residual, use))

    def clipped(self, id: str, value: FloatArray) -> FloatArray:
        """Values within what makes sense."""
        if id in self.own:
            return np.clip(value, self.own[id].parameter.least, self.own[id].parameter.most)
        return _clipped(id, value)

    def deviations(self, fitted: Fitted, free: bool) -> FloatArray:
        """Return what a fit leaves open of the loads: changes (k, q) of them, of one standard deviation each.

        What the rows show scatters from trial to trial (jackknife); of what they do not show the prior is left.
        """
        directions, base, precision = self.base(fitted.values, free)
        q, residual = len(precision), fitted.residual
        design = np.concatenate((base, *self._held(fitted)), axis=1)
        scale, use = self.scale_of(residual), np.ones(len(residual), dtype=bool)
        weights = student_weights(residual, scale)
        data = design.T @ (weights[:, None] * design)
        prior = np.zeros_like(data)
        prior[:q, :q] = precision * scale
        left = scale * np.linalg.pinv(data + prior, rcond=_RANK, hermitian=True)
        spread = (left + self._spread(design, data, prior, residual, use))[:q, :q]
        sizes, vectors = np.linalg.eigh(spread)
        return np.asarray(directions @ (vectors * np.sqrt(np.maximum(sizes, 0.0))))

    def _spread(
        self, design: FloatArray, data: FloatArray, prior: FloatArray, residual: FloatArray, use: BoolArray
    ) -> FloatArray:
        """Covariance of an estimate: how it scatters when a trial is left out (jackknife, one step for each trial).

        The slope that Student errors have is less than their weights (Huber 1981).
        """
        scale = self.scale_of(residual[use])
        ratio = residual**2 / scale
        weights = (_TAIL + 1) / (_TAIL + ratio) * use
        slope = max(0.1, float((weights * (_TAIL - ratio) / (_TAIL + ratio)).sum() / max(float(weights.sum()), 1e-30)))
        hessian = slope * data + prior
        hessian = hessian + 1e-12 * np.diag(np.diag(hessian) + 1e-30)
        rows = np.flatnonzero(use)[np.argsort(self.trial[use], kind="stable")]
        parts = np.split(rows, np.flatnonzero(np.diff(self.trial[rows])) + 1)
        squares = np.array([(weights[part, None] * design[part]).T @ design[part] for part in parts])
        scores = np.array([(weights[part] * residual[part]) @ design[part] for part in parts])
        counted = scores.any(axis=1)
        count = int(counted.sum())
        if not count:
            return np.zeros_like(hessian)
        # least squares, all trials at once: what has no curvature without a trial does not move
        sizes, vectors = np.linalg.eigh(hessian - slope * squares[counted])
        large = np.abs(sizes) > _RANK * np.abs(sizes).max(axis=1, keepdims=True)
        along = np.einsum("tji,tj->ti", vectors, scores[counted]) * large / np.where(large, sizes, 1.0)
        moved = np.einsum("tij,tj->ti", vectors, along)
        return np.asarray(moved.T @ moved * (count - 1) / max(1, count))

    def significantly_better(
        self, ahead: FloatArray, behind: FloatArray, errors: float | None = None, times: float = 1.0
    ) -> bool:
        """Tell whether one log density (trials,) beats another by what is demanded, over the scatter of pushes.

        Repeats of one push share what no fit has: they are judged together. No one push carries it: the greatest gain counts as
        much as the next. The scatter is that of the pushes that lose: a few that separate causes gain far more than others,
        which is no scatter.
        """
        n = min(len(ahead), len(behind))
        difference = np.sort(np.bincount(self.push[:n], ahead[:n] - behind[:n]))
        if len(difference) > 1:
            difference[-1] = difference[-2]
        error = float(np.sqrt(2 * np.square(np.minimum(difference, 0.0)).sum()))
        least = max(self.demands.density, (self.demands.errors if errors is None else errors) * error)
        return bool(difference.sum() > times * least)

    def density(self, residual: FloatArray, use: BoolArray) -> FloatArray:
        """Log density (trials,) of Student errors whose scale is that of the rows in use."""
        scale = self.scale_of(residual[use])
        return by_trial(self.trial, student_density(residual, scale)[:, None])[:, 0]

    @contextmanager
    def own_forms(self) -> Iterator[None]:
        """Fit effects in their own forms meanwhile, without the terms of their families: no simulation has these."""
        opened, about = self.opened, self.about
        self.opened, self.about = frozenset(), None
        try:
            yield
        finally:
            self.opened, self.about = opened, about

    def _held(self, fitted: Fitted) -> list[FloatArray]:
        """Columns of the effects of a fit."""
        return [self.columns(id, fitted.loads, fitted.values, len(value)) for id, value in fitted.values.items()]

    def tells(self, id: str) -> BoolArray:
        """Rows (n,) that count as evidence for an effect. The effect itself changes all rows."""
        return np.ones(len(self.trial), dtype=bool)

    def tests(self, fitted: Fitted, free: bool, candidates: Sequence[str], whole: bool = False) -> dict[str, ScoreTest]:
        """Test effects by one Gauss-Newton step, loads and the other effects refitted.

        Of an effect that is not fitted its own form is tested, or with ``whole`` that and its family; of one that is fitted the
        terms of its family.
        """
        residual = fitted.residual
        scale = self.scale_of(residual)
        weights = student_weights(residual, scale)
        _, base, precision = self.base(fitted.values, free)
        design = np.concatenate((base, *self._held(fitted)), axis=1)
        hessian = design.T @ (weights[:, None] * design)
        hessian[: len(precision), : len(precision)] += precision * scale
        hessian += 1e-12 * np.diag(np.diag(hessian) + 1e-30)
        found: dict[str, ScoreTest] = {}
        for id in candidates:
            known = 0 if id in self.nuisance else len(fitted.values.get(id, ()))
            columns = self.columns(id, fitted.loads, fitted.values, self.size(id, whole or known > 0))[:, known:]
            columns = np.where(self.tells(id)[:, None], columns, 0.0)
            size = columns.shape[1]
            clean = columns - design @ np.linalg.lstsq(hessian, design.T @ (weights[:, None] * columns), rcond=1e-14)[0]
            information = columns.T @ (weights[:, None] * clean)
            information = (information + information.T) / 2
            least = 1e-12 * max(1e-30, np.abs(columns).max(initial=0.0) ** 2)
            if id in self.nuisance or not np.isfinite(information).all() or np.linalg.eigvalsh(information)[0] <= least:
                found[id] = ScoreTest.blind(information / scale, self.trial)
                continue
            score = clean.T @ (weights * residual)
            estimate = np.linalg.solve(information, score)
            left = residual - clean @ estimate
            outer = (weights[:, None, None] * clean[:, :, None] * clean[:, None, :]).reshape(len(clean), -1)
            shares = by_trial(self.trial, outer).reshape(-1, size, size)
            scores = by_trial(self.trial, clean * (weights * left)[:, None])
            found[id] = ScoreTest(
                float(statistics(score[None], scores[None])[0]), float(score @ estimate) / scale, estimate, information / scale,
                scores, shares,
            )  # fmt: skip
        return found


def robust_scale(residual: FloatArray, least: float) -> float:
    """Robust mean square of residuals, in units of the noise, and at least ``least``."""
    return max(least, float(robust_variance(residual**2))) if len(residual) else 1.0


def student_weights(residual: FloatArray, scale: float) -> FloatArray:
    """Weights (n,) of residuals whose errors are Student's with this scale: rows that are far off count less."""
    return np.asarray((_TAIL + 1) / (_TAIL + residual**2 / scale))


def student_density(residual: FloatArray, scale: float) -> FloatArray:
    """Log density (n,) of residuals whose errors are Student's with this scale, but for a constant."""
    return np.asarray(-0.5 * (_TAIL + 1) * np.log1p(residual**2 / (_TAIL * scale)) - 0.5 * np.log(scale))


def robust_variance(squares: FloatArray, axis: int | None = None) -> Any:
    """Return the mean square of Gaussian noise whose squares have this median: a few that are far off do not count."""
    return np.median(squares, axis=axis) / _MEDIAN


def _loss(residual: FloatArray, scale: float, away: FloatArray, precision: FloatArray) -> float:
    """What a fit makes small: Student errors, and loads that are ``away`` from the nominal ones."""
    return float((_TAIL + 1) * np.log1p(residual**2 / (_TAIL * scale)).sum() + away @ precision @ away)


def _of_size(value: FloatArray, size: int) -> FloatArray:
    """Parameters, with zeros behind them or without the last of them."""
    return np.append(value, np.zeros(max(0, size - len(value))))[:size]


def _clipped(id: str, value: FloatArray) -> FloatArray:
    """Values within what makes sense."""
    own, terms = value[: SIZES[id]], value[SIZES[id] :]
    if len(terms):
        far = _FAR * FAMILIES[id].plausible
        return np.concatenate((_clipped(id, own), np.clip(terms, -far, far)))
    if id in ANISOTROPIES:
        size = float(np.hypot(*value))
        return value if size <= 0.6 else value * (0.6 / size)
    if id == "drift":
        return np.clip(value, -0.9, 5.0)
    if id == "pressure-spread":
        return np.clip(value, -0.8, 2.0)
    if id == "speed-dependence":
        return np.clip(value, -0.5, 0.5)
    return value


def by_trial(trial: np.ndarray, rows: FloatArray) -> FloatArray:
    """Sums (trials, d) of rows (n, d)."""
    count = int(trial.max()) + 1 if len(trial) else 1
    sums = [np.bincount(trial, rows[:, k], minlength=count) for k in range(rows.shape[1])]
    return np.array(sums, dtype=np.float64).reshape(rows.shape[1], count).T
