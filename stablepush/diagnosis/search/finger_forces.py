"""What the force of each push says of the friction between fingers and slider, and whether the fingers slip there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood

#: Least slip: in its standard errors, and over the speed.
_SLIPS, _SLIP_SHARE = 4.0, 0.2
#: Fingers creep if they slip by this share of the way of a push. Trials give the same friction if none is off by the other share.
_CREEP, SAME = 0.02, 0.15
#: Friction that is suspected is less than the nominal one by this much at least.
CLEARLY_LESS = 0.1
#: So many trials whose fingers move suffice for a test of their friction.
_TESTABLE = 3
#: Angle (rad) by which the normals of a trial are off alike.
_TURNED = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class FingerForces:
    """The tangential over the normal force of trials (n,) in which fingers press on a face.

    Attributes
    ----------
    trial : array of int, shape (n,)
    order : array, shape (n,)
        Place of the trial in the log, from 0 to 1.
    slips, creeps : array of bool, shape (n,)
        Whether the fingers slip fast in some rows, or slowly over the whole push. Where they do neither they stick.
    ratio, error : array, shape (n,)
        Tangential over normal force, and its standard error: positive where it opposes the slip; the amount where fingers stick.
    """

    trial: np.ndarray
    order: FloatArray
    slips: BoolArray
    creeps: BoolArray
    ratio: FloatArray
    error: FloatArray

    @property
    def moving(self) -> BoolArray:
        """Trials (n,) whose fingers slip or creep."""
        return self.slips | self.creeps

    @property
    def agree(self) -> bool:
        """Whether all moving trials give the same friction, and no sticking one has a greater ratio."""
        return self._agree(self.moving)

    @property
    def informative(self) -> BoolArray:
        """Trials (n,) whose fingers slip fast; those whose fingers creep, which may stick as well, if there are no others."""
        return self.slips if self.slips.any() else self.creeps

    @property
    def informative_agree(self) -> bool:
        """Whether all :attr:`informative` trials give the same friction, and no other one has a greater ratio."""
        return self._agree(self.informative)

    def held_by_few(self, nominal: float | None) -> float | None:
        """Return the friction at which fingers moved although ``nominal`` friction would have held them, for plans to be safe.

        It is the largest ratio of trials whose fingers slip or creep, if no sticking one has a much greater ratio. None if that
        is not clearly less than ``nominal``, or if enough move for a test.
        """
        if self.moving.sum() >= _TESTABLE:
            return None
        held = float(self.ratio[~self.moving].max(initial=0.0))
        moved = float(self.ratio[self.moving].max(initial=0.0))
        if nominal is None or moved < (1 - SAME) * held or not 0 < max(moved, held) < nominal - CLEARLY_LESS:
            return None
        return max(moved, held)

    def _agree(self, shown: BoolArray) -> bool:
        ratios, others = self.ratio[shown], self.ratio[~shown]
        middle = float(np.median(ratios)) if len(ratios) else 0.0
        same = (np.abs(ratios - middle) < SAME * middle).all() and (others < (1 + SAME) * middle).all()
        return bool(middle > 0 and same)


def finger_forces(likelihood: Likelihood, fitted: Fitted) -> FingerForces | None:
    """Return what the trials of a log say of its fingers' friction; None without forces, or if no row shows the contact.

    What ``fitted`` effects of the sensors do to the force is taken back: they turn it away from the normal as friction would.
    """
    experiment, wrench = likelihood.experiment, likelihood.wrench
    if wrench is None:
        return None
    o, acting = experiment.observations, wrench.acting(fitted.values)
    rest = {id: v for id, v in acting.items() if experiment.effects[id].acts != "sensing"}
    noise = experiment.noise
    sensed = wrench.predict(fitted.loads, acting) - wrench.predict(fitted.loads, rest)
    normal = np.where(np.isfinite(o.normal[:, 0]), o.normal[:, 0], o.normal[:, 1])
    known = np.isfinite(normal).all(axis=1) & np.isfinite(o.slip)
    # two fingers on one face only
    both = np.isfinite(o.normal).all(axis=(1, 2))
    known &= ~both | (np.nansum(o.normal[:, 0] * o.normal[:, 1], axis=1) > 0.99)
    force = (o.wrench - sensed)[:, :2]
    along = (force * normal).sum(axis=1)
    across = force[:, 1] * normal[:, 0] - force[:, 0] * normal[:, 1]
    lever = np.linalg.norm(np.where(np.isfinite(o.place[:, 0]), o.place[:, 0], o.place[:, 1]), axis=1)
    jitter = np.hypot(1.05 * noise.position, noise.angle * lever)
    fast_rows = np.abs(o.slip) > np.maximum(_SLIPS * jitter / o.span, _SLIP_SHARE * o.speed)
    pressed = known & (along > 3 * noise.force)
    if not pressed.any():
        return None
    ratio = np.where(pressed, across / np.where(pressed, along, 1.0), 0.0)
    # noise of the force turns it, noise of the heading the normal
    slope = np.hypot(1.0, ratio)
    error = np.hypot(slope * noise.force / np.where(pressed, along, 1.0), slope**2 * noise.angle)
    found = []
    for trial in np.unique(o.trial[pressed]):
        rows = np.flatnonzero((o.trial == trial) & pressed)
        fast = rows[fast_rows[rows]]
        crept, way = float((o.slip[rows] * o.span[rows]).sum()), float((o.speed[rows] * o.span[rows]).sum())
        # steps from row to row add up to the first and the last place
        creeps = len(rows) > 2 and abs(crept) > max(_SLIPS * math.sqrt(2) * float(jitter[rows].max()), _CREEP * way)
        if len(fast):
            rows, value = fast, float(np.median(-np.sign(o.slip[fast]) * ratio[fast]))
        elif creeps:
            value = float(np.median(-np.sign(crept) * ratio[rows]))
        else:
            value = float(abs(np.median(ratio[rows])))
        slips = len(fast) > 0
        found.append((trial, o.order[rows[0]], slips, creeps and not slips, value, _of_median(error[rows], slope[rows])))
    trials, order, slip, creep, ratios, errors = zip(*found, strict=True)
    return FingerForces(
        np.array(trials, dtype=int), np.array(order), np.array(slip), np.array(creep), np.array(ratios), np.array(errors)
    )


def _of_median(errors: FloatArray, slopes: FloatArray) -> float:
    """Standard error of the median of ratios (n,), with what their normals are off alike."""
    scatter = 1.2533 * float(np.sqrt((errors**2).mean() / len(errors)))
    return math.hypot(scatter, _TURNED * float((slopes**2).mean()))
