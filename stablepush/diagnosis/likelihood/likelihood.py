"""How probable the rows of a log are: joint fits of loads and effects by Gauss-Newton, score tests, log densities of trials.

Rows of a trial share errors that no formula has: every judgement treats trials, not rows, as independent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.likelihood.channel import Channel, Values
from stablepush.diagnosis.likelihood.clearance import Clearance
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.final_pose import FinalPose
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.prior import Prior
from stablepush.diagnosis.likelihood.robust import TAIL, by_trial, robust_scale, student_density, student_weights
from stablepush.diagnosis.likelihood.score_test import RANK, ScoreTest, statistics
from stablepush.diagnosis.likelihood.wrench import Wrench

#: Shares of a Gauss-Newton step that are tried until it helps.
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.02)
#: What keeps an equation solvable whose parameters no row shows, over its diagonal.
_RIDGE = 1e-12
#: A value is at its bound from this share of it.
_AT_BOUND = 0.05


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


class Solver(NamedTuple):
    """Gauss-Newton steps of a fit at most, of one that begins near, and the share by which a step must help."""

    steps: int = 12
    few: int = 12
    tolerance: float = 1e-7


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
                return float(np.sqrt(value @ np.linalg.pinv(block, rcond=RANK, hermitian=True) @ value))
            first += len(value)
        return 0.0


_C = TypeVar("_C", bound=Channel)


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Channels of a log under a prior of the surface. It has no state: the same calls give the same answers.

    Attributes
    ----------
    experiment : Experiment
    channels : tuple of Channel
    prior : Prior
    nuisance : tuple of str
        Effects that are always fitted, and never tested: what they act on is not known.
    demands : Demands
    solver : Solver
    least_scale : float
        Mean square, in units of the noise, that residuals have at least: 1 where the noise is stated. What is smaller than the
        noise is no evidence: errors of the nominal surface are alike in pushes that are alike.
    about : Fitted, optional
        Where fits begin; the nominal surface without effects if not given.
    first : Likelihood, optional
        The likelihood before other fits were begun at (:meth:`beginning_at`).
    """

    experiment: Experiment
    channels: tuple[Channel, ...]
    prior: Prior
    nuisance: tuple[str, ...]
    demands: Demands
    solver: Solver
    least_scale: float
    about: Fitted | None = None
    first: Likelihood | None = None
    _fits: dict[Any, Fitted] = field(default_factory=dict, repr=False)

    def _channel(self, kind: type[_C]) -> _C | None:
        return next((channel for channel in self.channels if isinstance(channel, kind)), None)

    @cached_property
    def wrench(self) -> Wrench | None:
        """The channel of the loads; None without forces."""
        return self._channel(Wrench)

    @cached_property
    def clearance(self) -> Clearance:
        """The channel of the distances between fingers and outline."""
        found = self._channel(Clearance)
        assert found is not None
        return found

    @cached_property
    def pose(self) -> FinalPose | None:
        """The channel of the final poses, in a log without forces."""
        return self._channel(FinalPose)

    @cached_property
    def trial(self) -> np.ndarray:
        """Trial (rows,) of each whitened row."""
        return np.concatenate([channel.trial for channel in self.channels]).astype(int)

    def rows_of(self, channel: Channel, rows: FloatArray) -> FloatArray:
        """Return those of all whitened rows that are a channel's."""
        at = sum(len(other.trial) for other in self.channels[: self.channels.index(channel)])
        return rows[at : at + len(channel.trial)]

    def beginning_at(self, fitted: Fitted) -> Likelihood:
        """Return the likelihood whose fits begin at this one."""
        return replace(self._about(fitted), first=self.first or self)

    def anew_at(self, fitted: Fitted) -> Likelihood:
        """Return the likelihood whose fits begin at this one, also when others are begun at later."""
        return replace(self._about(fitted), first=None)

    def _about(self, fitted: Fitted) -> Likelihood:
        channels = tuple(channel.about(fitted.loads, fitted.values) for channel in self.channels)
        return replace(self, channels=channels, about=fitted, _fits={})

    @property
    def from_nominal(self) -> Likelihood:
        """The likelihood whose fits begin at the nominal surface; those of final poses begin where their slopes are of."""
        return self if self.about is None or self.pose is not None else replace(self, about=None, _fits={})

    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return whitened measured minus predicted rows of all channels."""
        return np.concatenate([channel.residual(loads, values) for channel in self.channels])

    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        """Return whitened derivatives (rows, size) of the prediction by the first numbers of an effect."""
        return np.concatenate([channel.columns(id, loads, values, size) for channel in self.channels])

    def _base(self, values: Values, free: bool) -> tuple[FloatArray | None, FloatArray, FloatArray]:
        """Directions (k, q) of the loads (None: each), whitened columns (rows, q) of them, and their prior precision (q, q)."""
        directions, precision = self.prior.directions(free)
        count = len(self.prior.nominal)
        return directions, np.concatenate([c.by_loads(values, directions, count) for c in self.channels]), precision

    def tells(self, id: str) -> BoolArray:
        """Return which rows count as evidence for an effect."""
        return np.concatenate([channel.tells(id) for channel in self.channels])

    def scale_of(self, residual: FloatArray) -> float:
        """Robust mean square of whitened residuals, at least :attr:`least_scale`."""
        return robust_scale(residual, self.least_scale)

    def fit(self, model: Model, chosen: BoolArray | None = None, start: Fitted | None = None) -> Fitted:
        """Fit loads and the numbers of effects to the rows of ``chosen`` trials (all if not given), by Gauss-Newton.

        Rows count by Student weights. The result's residuals and densities are those of all rows. ``start``: a fit of the same
        effects to all trials, which is near. Final poses depend nonlinearly on effects and surface, and a step may lead away from
        where a smaller model fits: such logs are fitted from several starts, of which the one counts that fits best.
        """
        if start is not None:
            return self._fit(model, chosen, start)
        key = model, None if chosen is None else chosen.tobytes()
        if key not in self._fits:
            tried = self._fits_from_starts(model, chosen) if self.pose is not None else [self._fit(model, chosen)]
            self._fits[key] = max(tried, key=lambda fitted: _density_of(fitted, chosen))
        return self._fits[key]

    def _fits_from_starts(self, model: Model, chosen: BoolArray | None) -> Iterator[Fitted]:
        """Fits from where they begin; of effects on a free surface from the fit without the last of them, and from where they are
        on a fixed one; and of what lacks effects of the fit that was begun at from where fits began before."""
        effects, free = model.effects, model.free
        if self.first is None and free and effects:
            yield self._fit(model, chosen, self.fit(model.of(effects[:-1]), chosen))
        else:
            yield self._fit(model, chosen)
        if self.first is None and free and (effects or self.nuisance):
            yield self._fit(model, chosen, self._fit(model.on(False), chosen))
        if self.first is not None and self.about is not None and not set(self.about.values) <= {*effects, *self.nuisance}:
            yield self.first.fit(model, chosen)

    def _fit(self, model: Model, chosen: BoolArray | None, start: Fitted | None = None) -> Fitted:
        use = np.ones(len(self.trial), dtype=bool) if chosen is None else chosen[self.trial]
        effects = [*model.effects, *(id for id in self.nuisance if id not in model.effects)]
        sizes = [self.experiment.size(id, id in model.families) for id in effects]
        values: Values = {id: np.zeros(size) for id, size in zip(effects, sizes, strict=True)}
        loads = self.prior.nominal.copy()
        begin = start or self.about
        if begin is not None:
            values |= {id: _of_size(begin.values[id], len(value)) for id, value in values.items() if id in begin.values}
            loads = begin.loads.copy() if model.free or start else loads
        residual = self.residual(loads, values)
        for _ in range(self.solver.steps if start is None else self.solver.few):
            directions, base, precision = self._base(values, model.free)
            q = len(precision)
            design = np.concatenate((base, *(self.columns(id, loads, values, len(values[id])) for id in effects)), axis=1)
            scale = self.scale_of(residual[use])
            weights = student_weights(residual, scale) * use
            data = design.T @ (weights[:, None] * design)
            prior = np.zeros_like(data)
            prior[:q, :q] = precision * scale
            away = _along(directions, self.prior.nominal - loads)
            hessian = data + prior + _RIDGE * np.diag(np.diag(data + prior) + 1e-30)
            score = design.T @ (weights * residual)
            score[:q] += scale * (precision @ away)
            step = np.linalg.lstsq(hessian, score, rcond=1e-14)[0]
            before = after = _loss(residual[use], scale, away, precision)
            ends = q + np.cumsum([0, *sizes])
            for share in _SHARES:
                new_loads = loads + share * (step[:q] if directions is None else directions @ step[:q])
                new_values = {
                    id: self.experiment.clipped(id, values[id] + share * step[i:j])
                    for id, i, j in zip(effects, ends[:-1], ends[1:], strict=True)
                }
                new_residual = self.residual(new_loads, new_values)
                after = _loss(new_residual[use], scale, _along(directions, self.prior.nominal - new_loads), precision)
                if after <= before:
                    loads, values, residual = new_loads, new_values, new_residual
                    break
            if before - after <= self.solver.tolerance * max(before, 1.0):
                break

        def jackknife() -> FloatArray:
            return self._spread(design, data, prior, residual, use)[q:, q:]

        return Fitted(loads, values, jackknife, residual, self.density(residual, use))

    def deviations(self, fitted: Fitted, free: bool) -> FloatArray:
        """Return what a fit leaves open of the loads: changes (k, q) of them, of one standard deviation each.

        What the rows show scatters from trial to trial (jackknife); of what they do not show the prior is left.
        """
        directions, base, precision = self._base(fitted.values, free)
        q, residual = len(precision), fitted.residual
        design = np.concatenate((base, *self._held(fitted)), axis=1)
        scale, use = self.scale_of(residual), np.ones(len(residual), dtype=bool)
        weights = student_weights(residual, scale)
        data = design.T @ (weights[:, None] * design)
        prior = np.zeros_like(data)
        prior[:q, :q] = precision * scale
        left = scale * np.linalg.pinv(data + prior, rcond=RANK, hermitian=True)
        spread = (left + self._spread(design, data, prior, residual, use))[:q, :q]
        sizes, vectors = np.linalg.eigh(spread)
        changes = vectors * np.sqrt(np.maximum(sizes, 0.0))
        return np.asarray(changes if directions is None else directions @ changes)

    def _spread(
        self, design: FloatArray, data: FloatArray, prior: FloatArray, residual: FloatArray, use: BoolArray
    ) -> FloatArray:
        """Covariance of an estimate: how it scatters when a trial is left out (jackknife, one step for each trial).

        The slope that Student errors have is less than their weights (Huber 1981).
        """
        scale = self.scale_of(residual[use])
        ratio = residual**2 / scale
        weights = (TAIL + 1) / (TAIL + ratio) * use
        slope = max(0.1, float((weights * (TAIL - ratio) / (TAIL + ratio)).sum() / max(float(weights.sum()), 1e-30)))
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
        large = np.abs(sizes) > RANK * np.abs(sizes).max(axis=1, keepdims=True)
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
        difference = np.sort(np.bincount(self.experiment.push[:n], ahead[:n] - behind[:n]))
        if len(difference) > 1:
            difference[-1] = difference[-2]
        error = float(np.sqrt(2 * np.square(np.minimum(difference, 0.0)).sum()))
        least = max(self.demands.density, (self.demands.errors if errors is None else errors) * error)
        return bool(difference.sum() > times * least)

    def density(self, residual: FloatArray, use: BoolArray) -> FloatArray:
        """Log density (trials,) of Student errors whose scale is that of the rows in use."""
        scale = self.scale_of(residual[use])
        return by_trial(self.trial, student_density(residual, scale)[:, None])[:, 0]

    def at_bound(self, id: str, value: FloatArray) -> bool:
        """Whether a fitted effect is as large as this rig can have it: what would need more is another cause."""
        own = float(np.linalg.norm(value[: self.experiment.size(id)]))
        return own > (1 - _AT_BOUND) * self.experiment.effects[id].largest(self.experiment.bounds)

    def _held(self, fitted: Fitted) -> list[FloatArray]:
        """Columns of the effects of a fit."""
        return [self.columns(id, fitted.loads, fitted.values, len(value)) for id, value in fitted.values.items()]

    def tests(self, fitted: Fitted, free: bool, candidates: Sequence[str], whole: bool = False) -> dict[str, ScoreTest]:
        """Test effects by one Gauss-Newton step, loads and the other effects refitted.

        Of an effect that is not fitted its own form is tested, or with ``whole`` that and its family; of one that is fitted the
        terms of its family.
        """
        residual = fitted.residual
        scale = self.scale_of(residual)
        weights = student_weights(residual, scale)
        _, base, precision = self._base(fitted.values, free)
        design = np.concatenate((base, *self._held(fitted)), axis=1)
        hessian = design.T @ (weights[:, None] * design)
        hessian[: len(precision), : len(precision)] += precision * scale
        hessian += 1e-12 * np.diag(np.diag(hessian) + 1e-30)
        found: dict[str, ScoreTest] = {}
        for id in candidates:
            known = 0 if id in self.nuisance else len(fitted.values.get(id, ()))
            columns = self.columns(id, fitted.loads, fitted.values, self.experiment.size(id, whole or known > 0))[:, known:]
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


def _density_of(fitted: Fitted, chosen: BoolArray | None) -> float:
    """Log density of the trials that a fit was made to."""
    density = fitted.density
    return float((density if chosen is None else density[chosen[: len(density)]]).sum())


def _along(directions: FloatArray | None, loads: FloatArray) -> FloatArray:
    """Loads (k,) along directions (k, q); themselves if there are none."""
    return loads if directions is None else directions.T @ loads


def _loss(residual: FloatArray, scale: float, away: FloatArray, precision: FloatArray) -> float:
    """What a fit makes small: Student errors, and loads that are ``away`` from the nominal ones."""
    return float((TAIL + 1) * np.log1p(residual**2 / (TAIL * scale)).sum() + away @ precision @ away)


def _of_size(value: FloatArray, size: int) -> FloatArray:
    """Numbers, with zeros behind them or without the last of them."""
    return np.append(value, np.zeros(max(0, size - len(value))))[:size]
