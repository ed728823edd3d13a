"""Friction of the fingers from the forces of all pushes: fingers that slip show it, those that stick bound it from below.

The ratio ``r`` of tangential to normal force of a trial is Student-distributed about the friction ``mu`` where fingers slip.
Where they stick it is at most ``mu``. Where they creep it may be either. A few trials may say anything. ``mu`` is one number, or
changes in a straight line from the first push of the log to the last. This is a censored regression (Tobin 1958).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.diagnosis.results import readable
from stablepush.diagnosis.search.finger_forces import CLEARLY_LESS, SAME, FingerForces, finger_forces

#: Degrees of freedom of the ratios' scatter.
_FREEDOM = 4
#: Share of trials whose fingers slip that are at the edge of the cone, and of those that creep; of those that stick, but are
#: beyond it; and the density of ratios that say nothing.
_AT_EDGE, _CREEPING, _BEYOND, _ANY = 0.9, 0.3, 0.02, 0.05
#: Friction, its change over the log and its scatter between trials as they are before any force is seen: medians (of the first it
#: is what the rig has, else this), and standard deviations, of logarithms but for that of the change.
_FRICTION, _CHANGE, _SCATTER = (0.5, 0.7), 0.3, (0.025, 0.7)
#: The first grid: friction from the lowest to the highest, and up to a multiple of the largest ratio and of the rig's friction;
#: change and scatter; and refinements of the grid about the best.
_LOWEST, _HIGHEST, _HIGHER = 0.005, 1.6, 2.0
_CHANGES, _SCATTERS = np.linspace(-1.2, 1.2, 13), np.geomspace(0.006, 0.12, 6)
_FINER = 6
#: How often the grid of the interval is narrowed to what is not negligible (log density), and its values then.
_NARROWER, _NEGLIGIBLE, _FINE = 3, -9.0, (41, 15, 9)
#: Least friction of a straight line.
_LEAST = 0.002
#: A trial informs if it raises the log density by this. Least number of those that do, and their multiple of those that speak
#: against it; for a change, their least number and the share of the log that they span.
_INFORMS, _FEWEST_TRIALS, _AGAINST, _FEWEST_OF_CHANGE, _OVER = 1.0, 3, 3, 5, 0.3
#: Friction opposes true slip: where it does in a smaller share of the trials, the slip is noise.
_OPPOSED = 0.8
#: Least slipping trials that decide by their median; within this many standard errors of the rig's friction it is that.
_DECIDE, _NEAR = 5, 2.0
#: Standard error, over itself, of a friction at which a few fingers moved.
_FEW_ERROR = 0.05
#: Contact friction is off if it differs by at least this much in the trials that inform, with so small a p-value.
_MU, P_SLIP = 0.03, 1e-3
#: Least standard error over the friction.
_LEAST_ERROR = 0.02
#: Standard errors to either side of a 95 % interval.
NORMAL = 1.96


@dataclass(frozen=True, slots=True, eq=False)
class ContactFriction:
    """Friction between pusher and slider in the middle of the log, its 95 % interval, trials behind it, p-value of the rig's
    friction, which readings show it, and what it gains from the first push to the last, with its standard error."""

    estimate: float
    interval: tuple[float, float]
    trials: int
    p_value: float
    readings: str = "forces"
    change: float = 0.0
    change_error: float = 0.0

    @property
    def error(self) -> float:
        """Standard error towards less friction. Fingers that stick leave open how much more it is."""
        return max((self.estimate - self.interval[0]) / NORMAL, _LEAST_ERROR * self.estimate)

    @property
    def in_words(self) -> str:
        """The friction, and how it changes over the log."""
        if not self.change:
            return readable(self.estimate)
        return f"{readable(self.at(0.0))} in the first push to {readable(self.at(1.0))} in the last"

    @property
    def form(self) -> dict[str, Any] | None:
        """The change over the log, as the terms of a family are told; None if the friction is one number."""
        if not self.change:
            return None
        reach = NORMAL * self.change_error
        return {
            "covariate": "place o of the push in the log, 0 to 1",
            "basis": ["o - 1/2"],
            "coefficients": [self.change],
            "ci95": [[self.change - reach, self.change + reach]],
            "unit": "1",
        }

    def at(self, order: float) -> float:
        """Return the friction at a place in the log, 0 to 1."""
        return max(0.0, self.estimate + self.change * (order - 0.5))

    @property
    def last(self) -> tuple[float, float]:
        """Friction at the end of the log, and its standard error."""
        return self.at(1.0), float(np.hypot(self.error, self.change_error / 2))

    def beside(self, nominal: float) -> FloatArray:
        """Return the value of the effect, (1,) or (2,): what it adds to the rig's friction, and its change if it has one."""
        return np.array([self.estimate - nominal, self.change] if self.change else [self.estimate - nominal])


def slip_friction(likelihood: Likelihood, fitted: Fitted) -> ContactFriction | None:
    """Return the friction of the fingers from the forces of a log; None if too few trials show any."""
    forces = finger_forces(likelihood, fitted)
    return None if forces is None else friction_of(forces, likelihood.experiment.rig.contact_friction)


def friction_of(forces: FingerForces, nominal: float | None) -> ContactFriction | None:
    """Return the friction of the fingers, with the p-value of the rig's ``nominal`` one; None if too few trials show any.

    The p-value is that of the likelihood ratio. It is 1 where few trials inform, or where the friction is as good as the nominal.
    """
    model = _Model(forces, nominal)
    slipping, moving = int(forces.slips.sum()), int(forces.moving.sum())
    constant = model.best(changes=False)
    line = model.best(changes=True)
    better = 2 * (model.posterior(line) - model.posterior(constant))
    others = [constant] if nominal is None else [constant, np.array((nominal, 0.0, line[2]))]
    found, terms = constant, 1
    if chi2.sf(better, 1) < P_SLIP and model.shows_change(line, others):
        found, terms = line, 2
    p, count = 1.0, moving if slipping >= _FEWEST_TRIALS or forces.agree else 0
    opposed = slipping == 0 or float((forces.ratio[forces.slips] > 0).mean()) >= _OPPOSED
    if nominal is not None and opposed:
        none = model.best_scatter(nominal)
        gains = model.terms(found) - model.terms(np.array((nominal, 0.0, found[2])))
        informing, against = gains > _INFORMS, int((gains < -_INFORMS).sum())
        below = forces.ratio < (1 - SAME) * model.friction(found)
        if (forces.creeps & below).sum() > (forces.creeps & ~below).sum():
            # soft contacts creep under any load: these do not show where fingers slip
            informing = informing & ~forces.creeps
        off = np.abs(model.friction(found)[informing] - nominal)
        enough = informing.sum() >= max(_FEWEST_TRIALS, _AGAINST * against)
        # friction that scatters from push to push is steeper than the nominal one in some
        enough = enough and (terms == 2 or not _agree(forces.ratio[forces.slips], nominal))
        if enough and float(np.median(off)) > _MU:
            p = float(chi2.sf(2 * (model.posterior(found) - model.posterior(none)), terms))
            count = int(informing.sum())
    if count < _FEWEST_TRIALS or not opposed:
        return None
    (low, high), of_change = model.spread(terms == 2)
    friction, change = float(found[0]), float(found[1])
    return ContactFriction(friction, (min(low, friction), max(high, friction)), count, p, "forces", change, of_change)


def suspected_friction(forces: FingerForces, nominal: float | None, unexplained: bool) -> tuple[float, float] | None:
    """Return a friction of the fingers below ``nominal``, and its standard error, for plans to be safe; None if there is none.

    Pushes do not show it clearly enough for a name. It is what the few pushes held in which fingers moved. If more moved and a
    gap is left ``unexplained``, it is what their forces give, whatever the p-value, if that interval lies below ``nominal``.
    """
    few = forces.held_by_few(nominal)
    if few is not None:
        return few, _FEW_ERROR * few
    found = friction_of(forces, nominal) if unexplained and nominal is not None else None
    if found is None or nominal is None or found.interval[1] >= nominal or found.estimate >= nominal - CLEARLY_LESS:
        return None
    return found.estimate, found.error


class _Model:
    """Log densities of trials (n,) under parameters (..., 3): friction in the middle of the log, its change over the log, and its
    scatter between trials."""

    def __init__(self, forces: FingerForces, nominal: float | None) -> None:
        self._forces = forces
        self._middle = _FRICTION[0] if nominal is None else max(nominal, _LEAST)
        most = max(_HIGHEST, _HIGHER * float(np.abs(forces.ratio).max(initial=0.0)), _HIGHER * self._middle)
        self._tried = (np.geomspace(min(_LOWEST, self._middle), most, 40), _CHANGES, _SCATTERS)

    def friction(self, parameters: FloatArray) -> FloatArray:
        """Friction (..., n) of each trial."""
        at = parameters[..., :1] + parameters[..., 1:2] * (self._forces.order - 0.5)
        return np.maximum(at, _LEAST)

    def terms(self, parameters: FloatArray) -> FloatArray:
        """Log density (..., n) of each trial."""
        f = self._forces
        mu, scatter = self.friction(parameters), np.hypot(f.error, parameters[..., 2:])
        there = _density((f.ratio - mu) / scatter) / scatter
        below = _share((mu - np.abs(f.ratio)) / scatter)
        slipping = _AT_EDGE * there + _ANY
        creeping = np.where(f.ratio > 0, _CREEPING * there + (1 - _CREEPING - 2 * _ANY) * below, 0.0) + _ANY
        sticking = (1 - _BEYOND) * below + _BEYOND
        return np.log(np.where(f.slips, slipping, np.where(f.creeps, creeping, sticking)))

    def posterior(self, parameters: FloatArray) -> FloatArray:
        """Log density (...) of all trials, and of the parameters themselves."""
        friction, change, scatter = np.moveaxis(np.asarray(parameters), -1, 0)
        own = (np.log(friction / self._middle) / _FRICTION[1]) ** 2 + (change / _CHANGE) ** 2
        own = own + (np.log(scatter / _SCATTER[0]) / _SCATTER[1]) ** 2
        return np.asarray(self.terms(np.asarray(parameters)).sum(axis=-1) - own / 2)

    def shows_change(self, line: FloatArray, others: list[FloatArray]) -> bool:
        """Whether enough trials, over enough of the log, are nearer to a straight line than to one of other frictions."""
        least = np.min([self.terms(other) for other in others], axis=0)
        at = self._forces.order[self.terms(line) - least > _INFORMS]
        possible = abs(float(line[1])) < _CHANGES[-1]
        return possible and len(at) >= _FEWEST_OF_CHANGE and float(np.ptp(at)) >= _OVER

    def _axes(self, changes: bool) -> list[FloatArray]:
        """Values of each parameter that are tried."""
        friction, change, scatter = self._tried
        return [friction, change if changes else np.zeros(1), scatter]

    def best(self, changes: bool) -> FloatArray:
        """Parameters (3,) of the greatest density: the best of a grid, made finer about it."""
        axes = self._axes(changes)
        for k in range(_FINER + 1):
            grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            at = np.unravel_index(int(np.argmax(self.posterior(grid))), grid.shape[:-1])
            found = grid[at]
            if k < _FINER:
                axes = [_about(axis, int(i)) for axis, i in zip(axes, at, strict=True)]
        return np.asarray(found)

    def best_scatter(self, nominal: float) -> FloatArray:
        """Parameters (3,) with the nominal friction and the scatter that is best for it."""
        scatters = np.geomspace(_SCATTERS[0], _SCATTERS[-1], 60)
        grid = np.column_stack((np.full(60, max(nominal, _LEAST)), np.zeros(60), scatters))
        return np.asarray(grid[int(np.argmax(self.posterior(grid)))])

    def spread(self, changes: bool) -> tuple[tuple[float, float], float]:
        """Return the 95 % interval of the friction in the middle of the log, and the standard deviation of its change, from the
        density over a grid that holds all but a little of it."""
        axes = self._axes(changes)
        for k in range(_NARROWER + 1):
            density = self.posterior(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
            density = density - density.max()
            if k < _NARROWER:
                held = [np.flatnonzero(np.moveaxis(density, i, 0).reshape(len(axis), -1).max(axis=1) > _NEGLIGIBLE)
                        for i, axis in enumerate(axes)]  # fmt: skip
                axes = [
                    axis if len(axis) == 1 else np.linspace(axis[max(at[0] - 1, 0)], axis[min(at[-1] + 1, len(axis) - 1)], n)
                    for axis, at, n in zip(axes, held, _FINE, strict=True)
                ]
        weights = np.exp(density)
        weights /= weights.sum()
        of_friction, of_change = weights.sum(axis=(1, 2)), weights.sum(axis=(0, 2))
        # half of a value's weight lies below it
        below = np.cumsum(of_friction) - of_friction / 2
        low, high = np.interp((0.025, 0.975), below, axes[0])
        mean = float(of_change @ axes[1])
        return (float(low), float(high)), float(np.sqrt(of_change @ (axes[1] - mean) ** 2))


def _agree(ratios: FloatArray, nominal: float) -> bool:
    """Whether enough ratios (n,) of slipping trials have a median that may be the nominal friction."""
    if len(ratios) < _DECIDE:
        return False
    middle = float(np.median(ratios))
    error = 1.2533 * 1.4826 * float(np.median(np.abs(ratios - middle))) / np.sqrt(len(ratios))
    return bool(abs(middle - nominal) < _NEAR * error)


def _about(axis: FloatArray, at: int) -> FloatArray:
    """Five values from the neighbour below a value of an axis to that above."""
    if len(axis) == 1:
        return axis
    return np.linspace(axis[max(at - 1, 0)], axis[min(at + 1, len(axis) - 1)], 5)


def _density(z: FloatArray) -> FloatArray:
    """Density of Student's distribution of four degrees of freedom."""
    return np.asarray(0.375 * (1 + z**2 / _FREEDOM) ** -2.5)


def _share(z: FloatArray) -> FloatArray:
    """Share of Student's distribution of four degrees of freedom below z."""
    s = z / np.sqrt(_FREEDOM + z**2)
    return np.asarray(0.5 + 0.75 * (s - s**3 / 3))
