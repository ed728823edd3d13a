"""Which effects act: steps forward and back over the catalogue, judged by trials, with the surface refitted jointly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from stablepush._arrays import FloatArray
from stablepush.diagnosis.system import OF_BODY, SIZES, Fitted, System
from stablepush.se2 import rotate_vectors

#: An effect steps in if its statistic is this improbable without it, and the sum of squares over its scale falls by this much.
_P_ENTER, _GAIN = 1e-4, 12.0
#: What an effect must add to the log density, and how many standard errors over trials that must be.
_DENSITY, _ERRORS = 6.0, 2.0
#: Effects that may act together.
_MOST = 4
#: Alternatives are looked at if they gain at least this share of what the chosen effect gains.
_RIVAL = 0.5
#: Parts into which trials fall for held-out judgements.
FOLDS = 5
#: Slip counts from so many of its own standard errors, and from this share of the speed.
_SLIPS, _SLIP_SHARE, _OPPOSED = 4.0, 0.2, 0.8
#: Contact friction is off if it differs by at least this much.
_MU = 0.03
#: Effects that act on the table, the contact or the sensors, so that a refitted surface cannot take them.
OUTSIDE_BODY = tuple(id for id in SIZES if id not in OF_BODY)


@dataclass(frozen=True, slots=True, eq=False)
class ContactFriction:
    """Friction between pusher and slider from rows in which fingers slip: estimate, standard error, trials that slip, p-value."""

    estimate: float
    error: float
    trials: int
    p_value: float


@dataclass(frozen=True, slots=True, eq=False)
class Attribution:
    """What acts on a log.

    ``chosen``: effects that act; ``rivals``: those that the log cannot tell from one of them; ``free``: whether the refitted
    pressure is needed; ``final``: the fit with all of it; ``tests``: statistic, gain, estimate and information of all effects,
    each given the others that are chosen; ``scores`` by name: held-out log densities (trials,) of the nominal simulation and its
    refits.
    """

    chosen: list[str]
    rivals: list[str]
    absorbed: bool
    free: bool
    final: Fitted
    tests: dict[str, tuple[float, float, FloatArray, FloatArray]]
    scores: dict[str, FloatArray]
    contact: ContactFriction | None


def folds_of(system: System, seed: int = 0) -> np.ndarray:
    """Number of the fold of each trial; trials of one group stay together."""
    groups = system.observations.group
    keys = [g if g else f"trial {k}" for k, g in enumerate(groups)]
    names = list(dict.fromkeys(keys))
    order = np.random.default_rng(seed).permutation(len(names))
    fold = {names[i]: rank % FOLDS for rank, i in enumerate(order)}
    return np.array([fold[key] for key in keys])


def held_out(system: System, effects: Sequence[str], free: bool, folds: np.ndarray) -> FloatArray:
    """Log density (trials,) of each trial by a fit to the other folds."""
    result = np.zeros(len(folds))
    for k in range(FOLDS):
        test = folds == k
        if test.any() and not test.all():
            density = system.fit(effects, free, ~test).density
            result[: len(density)][test[: len(density)]] = density[test[: len(density)]]
    return result


def attribute(system: System, said: Callable[[str], None]) -> Attribution:
    """Find which effects act on a log."""
    chosen: list[str] = []
    current = system.fit([], True)
    for _ in range(_MOST):
        said(f"effects: {', '.join(chosen) or 'none yet'}")
        tests = system.tests(current, True, [id for id in OUTSIDE_BODY if id not in chosen])
        entering = [
            id
            for id, (statistic, gain, _, _) in tests.items()
            if gain > _GAIN and chi2.sf(statistic, SIZES[id]) < _P_ENTER and _possible(id, tests[id][2])
        ]
        tried = [(system.fit([*chosen, id], True), id) for id in sorted(entering, key=lambda id: -tests[id][1])[:4]]
        tried = [(fitted, id) for fitted, id in tried if _better(fitted.density, current.density)]
        if not tried:
            break
        current, best = max(tried, key=lambda pair: pair[0].score)
        chosen.append(best)
    for id in list(chosen):
        if len(chosen) > 1:
            without = system.fit([e for e in chosen if e != id], True)
            if not _better(current.density, without.density):
                chosen.remove(id)
                current = without
    rivals = _rivals(system, chosen, current)
    folds = folds_of(system)
    scores: dict[str, FloatArray] = {}
    absorbed, free = False, True
    if system.has_wrench:
        said("held-out trials")
        nominal = _nominal_density(system, chosen)
        scores = {
            "nominal": nominal,
            "scaled": held_out(system, chosen, False, folds),
            "free": held_out(system, chosen, True, folds),
        }
        sure = _better(scores["free"], scores["scaled"])
        # which base the rest is judged on matters less than what is said: one standard error is enough
        free = _better(scores["free"], scores["scaled"], 1.0)
        absorbed = sure or _better(scores["scaled"], scores["nominal"])
        if sure and not chosen:
            body = {id: held_out(system, [id], False, folds) for id in OF_BODY}
            scores |= body
            best = max(body, key=lambda id: body[id].sum())
            enough = [id for id in OF_BODY if not _better(scores["free"], body[id]) and _better(body[id], scores["scaled"])]
            if best in enough:
                chosen, free = [best], False
                rivals = [id for id in enough if id != best and not _better(body[best], body[id])]
    final = system.fit(chosen, free)
    tests = {}
    for id in SIZES:
        if id in chosen:
            others = system.fit([e for e in chosen if e != id], free)
            tests |= system.tests(others, free, [id])
    tests |= system.tests(final, free, [id for id in SIZES if id not in chosen])
    # what a sensor is mounted at turns the force away from the normal as friction would
    turn = float(final.values["force-rotation"][0]) if "force-rotation" in final.values else 0.0
    return Attribution(chosen, rivals, absorbed, free, final, tests, scores, slip_friction(system, turn))


def _possible(id: str, estimate: FloatArray) -> bool:
    """Whether an estimate has the sign that the effect must have."""
    return not (id in ("inertia", "latency") and estimate[0] < 0)


def _better(ahead: FloatArray, behind: FloatArray, errors: float = _ERRORS) -> bool:
    """Whether one log density (trials,) beats another by enough, over the scatter of trials."""
    n = min(len(ahead), len(behind))
    difference = ahead[:n] - behind[:n]
    error = float(difference.std(ddof=1) * np.sqrt(n)) if n > 1 else 0.0
    return bool(difference.sum() > max(_DENSITY, errors * error))


def _rivals(system: System, chosen: list[str], current: Fitted) -> list[str]:
    """Effects that would explain the log about as well in the place of a chosen one."""
    found: list[str] = []
    for id in chosen:
        others = [e for e in chosen if e != id]
        without = system.fit(others, True)
        tests = system.tests(without, True, [e for e in OUTSIDE_BODY if e not in others])
        for rival in OUTSIDE_BODY:
            if rival in chosen or tests[rival][1] < _RIVAL * tests[id][1] or not _possible(rival, tests[rival][2]):
                continue
            if not _better(current.density, system.fit([*others, rival], True).density):
                found.append(rival)
    return list(dict.fromkeys(found))


def _nominal_density(system: System, chosen: list[str]) -> FloatArray:
    """Log density (trials,) of the nominal loads, the friction as it is believed, with the effects fitted to a scaled surface."""
    fitted = system.fit(chosen, False)
    loads = system.nominal if system.known_scale else fitted.loads
    residual = system.residual(loads, fitted.values)
    return system._density(residual, np.ones(len(residual), dtype=bool))


def slip_friction(system: System, turn: float = 0.0) -> ContactFriction | None:
    """Friction of the contact from the direction of the force while fingers slip; None if too few trials do, or forces lack.

    ``turn``: angle (rad) by which the sensor turns forces.
    """
    o, rig = system.observations, system.rig
    if not system.has_wrench:
        return None
    normal = np.where(np.isfinite(o.normal[:, 0]), o.normal[:, 0], o.normal[:, 1])
    known = np.isfinite(normal).all(axis=1) & np.isfinite(o.slip)
    # two fingers on one face only
    both = np.isfinite(o.normal).all(axis=(1, 2))
    known &= ~both | (np.nansum(o.normal[:, 0] * o.normal[:, 1], axis=1) > 0.99)
    force = rotate_vectors(-turn, o.wrench[:, :2])
    along = (force * normal).sum(axis=1)
    across = force[:, 1] * normal[:, 0] - force[:, 0] * normal[:, 1]
    lever = np.linalg.norm(np.where(np.isfinite(o.place[:, 0]), o.place[:, 0], o.place[:, 1]), axis=1)
    jitter = np.hypot(1.05 * system.noise.position, system.noise.angle * lever) / o.span
    sure = np.abs(o.slip) > np.maximum(_SLIPS * jitter, _SLIP_SHARE * o.speed)
    rows = np.flatnonzero(known & sure & (along > 3 * system.noise.force))
    if not len(rows):
        return None
    ratio = -np.sign(o.slip[rows]) * across[rows] / along[rows]
    names = np.unique(o.trial[rows])
    by_trial = np.array([np.median(ratio[o.trial[rows] == t]) for t in names])
    # friction opposes true slip: where it often does not, the slip is noise
    if len(names) < 3 or (by_trial > 0).mean() < _OPPOSED:
        return None
    estimate = float(np.median(by_trial))
    deviation = max(1e-4, 1.4826 * float(np.median(np.abs(by_trial - estimate))))
    error = 1.2533 * deviation / np.sqrt(len(names))
    if rig.contact_friction is None:
        return ContactFriction(estimate, error, len(names), 1.0)
    off = abs(estimate - rig.contact_friction)
    p = float(2 * student.sf(off / error, len(names) - 1)) if off > _MU else 1.0
    return ContactFriction(estimate, error, len(names), p)
