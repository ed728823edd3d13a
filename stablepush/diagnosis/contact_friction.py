"""Friction of the fingers from trials that slip: the direction of the force while they do."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import binom, norm, t as student

from stablepush.core import FloatArray
from stablepush.diagnosis.equations import Fitted
from stablepush.diagnosis.system import System
from stablepush.effects import CATALOGUE

#: Slip counts from so many of its own standard errors, and from this share of the speed.
_SLIPS, _SLIP_SHARE, _OPPOSED = 4.0, 0.2, 0.8
#: Standard errors to either side of a 95 % interval.
_NORMAL = 1.96
#: Fingers creep if they slip by this share of the way of a push. Trials give the same friction if none is off by the other share,
#: and so many are needed.
_CREEP, _SAME, _FEWEST_TRIALS = 0.02, 0.15, 3
#: A force is steeper than friction allows by so many standard errors, of which this is the angle (rad) by which normals are off.
_STEEPER, _TURNED = 4.0, 0.01
#: Contact friction is off if it differs by at least this much, with so small a p-value.
_MU, P_SLIP = 0.03, 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ContactFriction:
    """Friction between pusher and slider: estimate, standard error, trials that slip, p-value, and which readings show it."""

    estimate: float
    error: float
    trials: int
    p_value: float
    readings: str = "forces"

    @property
    def interval(self) -> list[float]:
        """The 95 % interval: the scatter of trials where forces alone give it, else what else fits as well."""
        times = float(student.ppf(0.975, self.trials - 1)) if self.readings == "forces" else _NORMAL
        return [max(0.0, self.estimate - times * self.error), self.estimate + times * self.error]


def slip_friction(system: System, fitted: Fitted) -> ContactFriction | None:
    """Friction of the contact from the direction of the force while fingers slip; None if too few trials do, or forces lack.

    Slip shows in single rows, or where it creeps in a whole push. Trials whose fingers creep count where too few slip fast, and
    only if all give the same friction, which no trial exceeds. A force that is steeper than the rig's friction allows shows by
    itself that friction is higher.
    """
    slip = slipping(system, fitted)
    if slip is None:
        return None
    nominal = system.rig.contact_friction
    ratios = np.array(list(slip.fast.values()))
    found = None
    # friction opposes true slip: where it often does not, the slip is noise
    if len(ratios) >= _FEWEST_TRIALS and (ratios > 0).mean() >= _OPPOSED:
        found = _of_ratios(ratios, nominal)
    elif slip.agree and len(slip.ratios) >= _FEWEST_TRIALS:
        found = _of_ratios(np.array(list(slip.ratios.values())), nominal)
    # forces of a median that agrees with the rig speak against it
    if nominal is not None and (found is None or (found.p_value > P_SLIP and found.interval[0] > nominal)):
        return _steeper(slip, nominal) or found
    return found


def _steeper(slip: Slip, nominal: float) -> ContactFriction | None:
    """Friction from forces that are steeper than the rig's friction allows, each clearly by its own error; None if too few are.

    The p-value is that of so many among all trials that slip.
    """
    trials = list(slip.ratios)
    clear = [k for k in trials if slip.ratios[k] - nominal > _STEEPER * slip.errors[k]]
    ratios = np.array([slip.ratios[k] for k in clear])
    if len(clear) < _FEWEST_TRIALS or slip.most > (1 + _SAME) * float(np.median(ratios)):
        return None
    # those that are not clear may creep without slipping
    top = ratios[ratios > (1 - _SAME) * ratios.max()]
    if len(top) < _FEWEST_TRIALS:
        return None
    p = float(binom.sf(len(clear) - 1, len(trials), norm.sf(_STEEPER)))
    found = _of_ratios(top, nominal)
    return replace(found, p_value=p) if found.p_value < 1 else None


def _of_ratios(ratios: FloatArray, nominal: float | None) -> ContactFriction:
    """Friction from that of each trial (n,), and whether it is another than the rig's."""
    estimate = float(np.median(ratios))
    deviation = max(1e-4, 1.4826 * float(np.median(np.abs(ratios - estimate))))
    error = 1.2533 * deviation / np.sqrt(len(ratios))
    off = 0.0 if nominal is None else abs(estimate - nominal)
    p = float(2 * student.sf(off / error, len(ratios) - 1)) if off > _MU else 1.0
    return ContactFriction(estimate, error, len(ratios), p)


@dataclass(frozen=True, slots=True, eq=False)
class Slip:
    """Friction by trial where fingers slip: ``fast`` in single rows, ``creeping`` in a whole push; ``most``: of the other trials,
    the greatest median of the tangential over the normal force; ``errors``: standard errors of the former, by trial."""

    fast: dict[int, float]
    creeping: dict[int, float]
    most: float
    errors: dict[int, float]

    @property
    def ratios(self) -> dict[int, float]:
        return {**self.creeping, **self.fast}

    @property
    def agree(self) -> bool:
        """Whether all trials give the same friction, and no sticking one has a greater tangential over its normal force."""
        ratios = np.array(list(self.ratios.values()))
        middle = float(np.median(ratios)) if len(ratios) else 0.0
        return bool(middle > 0 and (np.abs(ratios - middle) < _SAME * middle).all() and self.most < (1 + _SAME) * middle)


def _of_median(errors: FloatArray, slopes: FloatArray) -> float:
    """Standard error of the median of ratios (n,), with what their normals are off alike."""
    scatter = 1.2533 * float(np.sqrt((errors**2).mean() / len(errors)))
    return math.hypot(scatter, _TURNED * float((slopes**2).mean()))


def slipping(system: System, fitted: Fitted) -> Slip | None:
    """Return the trials whose fingers slip against the object; None without forces, or if no row shows the contact.

    What ``fitted`` effects of the sensors do to the force is taken back: they turn it away from the normal as friction would.
    """
    o = system.observations
    if not system.has_wrench:
        return None
    acting = system.of_wrench(fitted.values)
    rest = {id: v for id, v in acting.items() if (system.own.get(id) or CATALOGUE[id]).acts != "sensing"}
    sensed = system.model.predict(fitted.loads, acting) - system.model.predict(fitted.loads, rest)
    normal = np.where(np.isfinite(o.normal[:, 0]), o.normal[:, 0], o.normal[:, 1])
    known = np.isfinite(normal).all(axis=1) & np.isfinite(o.slip)
    # two fingers on one face only
    both = np.isfinite(o.normal).all(axis=(1, 2))
    known &= ~both | (np.nansum(o.normal[:, 0] * o.normal[:, 1], axis=1) > 0.99)
    force = (o.wrench - sensed)[:, :2]
    along = (force * normal).sum(axis=1)
    across = force[:, 1] * normal[:, 0] - force[:, 0] * normal[:, 1]
    lever = np.linalg.norm(np.where(np.isfinite(o.place[:, 0]), o.place[:, 0], o.place[:, 1]), axis=1)
    jitter = np.hypot(1.05 * system.noise.position, system.noise.angle * lever)
    fast_rows = np.abs(o.slip) > np.maximum(_SLIPS * jitter / o.span, _SLIP_SHARE * o.speed)
    pressed = known & (along > 3 * system.noise.force)
    if not pressed.any():
        return None
    ratio = np.where(pressed, across / np.where(pressed, along, 1.0), 0.0)
    # noise of the force turns it, noise of the heading the normal
    slope = np.hypot(1.0, ratio)
    error = np.hypot(slope * system.noise.force / np.where(pressed, along, 1.0), slope**2 * system.noise.angle)
    found, most = Slip({}, {}, 0.0, {}), 0.0
    for trial in np.unique(o.trial[pressed]):
        rows = np.flatnonzero((o.trial == trial) & pressed)
        fast = rows[fast_rows[rows]]
        if len(fast):
            found.fast[int(trial)] = float(np.median(-np.sign(o.slip[fast]) * ratio[fast]))
            found.errors[int(trial)] = _of_median(error[fast], slope[fast])
            continue
        crept, way = float((o.slip[rows] * o.span[rows]).sum()), float((o.speed[rows] * o.span[rows]).sum())
        # steps from row to row add up to the first and the last place
        if len(rows) > 2 and abs(crept) > max(_SLIPS * math.sqrt(2) * float(jitter[rows].max()), _CREEP * way):
            found.creeping[int(trial)] = float(np.median(-np.sign(crept) * ratio[rows]))
            found.errors[int(trial)] = _of_median(error[rows], slope[rows])
        else:
            most = max(most, float(abs(np.median(ratio[rows]))))
    return replace(found, most=most) if found.ratios else None
