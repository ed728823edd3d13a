"""Friction of the fingers from where pushes end: a finger that slips although it should stick loses the slider by centimetres.

That is an inequality: no row shows it as long as fingers stick, and a small change of the friction changes nothing. So friction
is scanned, not fitted by steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.likelihood.final_pose import FinalPoses
from stablepush.diagnosis.likelihood.nominal import Nominal
from stablepush.diagnosis.likelihood.replay import Replay
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.search.contact_friction import NORMAL, ContactFriction
from stablepush.diagnosis.search.finger_forces import finger_forces
from stablepush.effects import FINGER_FRICTION

#: Friction that the forces of few trials show must differ by so much, and leave less than this share of the squares; and its
#: standard error over itself.
_CLEARLY, _AGREES, _ROUGHLY = 0.1, 0.5, 0.05
#: Coefficients of the first grid, number of refinements about the best, and values of each finer grid.
_TRIED = np.geomspace(0.05, 1.5, 18)
_ROUNDS, _FINER = 3, 5
#: Members of a model's ensemble with which friction is scanned, values of each scan, and its reach as a factor on the best.
_MEMBERS, _SEARCHED, _FARTHER = 6, 7, 1.8
#: Scan about the friction that forces show: reach in its standard errors, and number of values.
_REACH, _NEAR = 3.0, 25
#: A final pose is off from this multiple of its noise, with what a wrong friction of the table makes of it,
#: a share of the slider's radius.
_OFF, _WRONG = 5.0, 0.02
#: So many pushes must be off, of which friction must leave less than this share of the squares; no push may get much worse.
_LEAST, _LEFT, _WORSE = 2, 0.15, 2.0
#: Fingers that are aside (m) instead must explain the pushes this many times worse.
_ASIDE, _OTHERWISE = np.linspace(-0.006, 0.006, 9), 3.0
#: Error over its noise of a push that cannot be simulated.
_LOST = 1e6
#: The p-value that is given: the errors are tens of times the noise.
_P_VALUE = 1e-6


def _robust(sizes: FloatArray) -> float:
    """Loss of errors (n,) over their noise: a push that is lost either way counts little more than one that is far off."""
    return float(np.log1p(np.nan_to_num(sizes, nan=_LOST) ** 2).sum())


def friction_from_poses(found: Attribution, poses: FinalPoses) -> ContactFriction | None:
    """Return the friction with which simulated pushes end where they were measured, if that of the rig is clearly another.

    None unless most of what several pushes are off by goes away with another friction, and not with fingers that are aside.
    """
    experiment = poses.experiment
    nominal = experiment.rig.contact_friction
    pushes, noise = all_pushes(poses)
    if nominal is None or not pushes:
        return None
    final = found.final
    values = {id: value for id, value in final.values.items() if id != FINGER_FRICTION}

    def sizes(mu: float, aside: float = 0.0, believed: Nominal | None = None) -> FloatArray:
        moved = [replace(push, pusher=push.pusher.moved(aside)) for push in pushes] if aside else pushes
        friction = {FINGER_FRICTION: np.array([mu - experiment.mu])}
        errors = poses.errors(moved, final.loads, {**values, **friction}, believed)
        return np.nan_to_num(np.linalg.norm(errors, axis=1) / noise, nan=_LOST)

    def loss(mu: float, believed: Nominal | None = None) -> float:
        return _robust(sizes(mu, believed=believed))

    def least_aside(chosen: BoolArray) -> float:
        """Sum of squares that fingers aside, instead of another friction, leave of some pushes."""
        return min(float((sizes(nominal, float(a))[chosen] ** 2).sum()) for a in _ASIDE if a)

    before = sizes(nominal)
    off = before > _OFF
    seen = finger_forces(found.likelihood, final)
    if seen is not None and seen.informative_agree and off.any():
        # few fingers slip fast enough for their forces alone to tell, but the object ends where that friction takes it
        trials = seen.trial[seen.informative]
        told = off & np.isin([push.trial for push in pushes], trials)
        shown = float(np.median(seen.ratio[seen.informative]))
        # where a push that is lost ends hangs on the third digit of the friction: then that with which it ends best
        reach = _REACH * float(seen.error[seen.informative].max())
        for mu in (shown, _scanned(loss, shown + reach * np.linspace(-1, 1, _NEAR))[0]):
            after = sizes(mu)
            # the force of a single push might be turned by fingers that are aside
            alone = len(trials) == 1 and (not told.any() or least_aside(told) <= float((after[told] ** 2).sum()))
            agrees = float((after[off] ** 2).sum()) < _AGREES * float((before[off] ** 2).sum())
            if abs(shown - nominal) > _CLEARLY and abs(mu - nominal) > _CLEARLY and agrees and not alone:
                error = float(np.hypot(_ROUGHLY * mu, (mu - shown) / 2))
                return _with_error(mu, error, len(trials), "forces and final poses")
    if len({push.trial for push, is_off in zip(pushes, off, strict=True) if is_off}) < _LEAST:
        return None
    best, tried = _scanned(loss, _TRIED)
    after = sizes(best)
    least = float((after[off] ** 2).sum())
    if least > _LEFT * float((before[off] ** 2).sum()) or (after > np.maximum(_WORSE * before, _OFF)).any():
        return None
    if least_aside(off) < _OTHERWISE * least:
        return None
    # above the friction at which all fingers stick any fits as well
    near = [mu for mu, found_loss in tried if found_loss <= min(found_loss for _, found_loss in tried) + 1.0]
    mu, spread = _over_ensemble(experiment.believed, loss, best)
    error = float(np.hypot(max(0.5 * (max(near) - min(near)), 0.02 * best), spread))
    return _with_error(mu, error, int(off.sum()), "final poses")


def _over_ensemble(believed: Nominal, loss: Callable[..., float], best: float) -> tuple[float, float]:
    """Return the mean friction over the likely surfaces of the rig's model, and its standard deviation: which push is lost hangs
    on the surface as well. Each has the friction with which poses end best, and counts by how well they then do: ``loss`` is
    minus the logarithm of a Cauchy density. The ``best`` friction, and 0, without such surfaces."""
    model = believed.model
    members = () if model is None else model.members()
    if model is None or not members:
        return best, 0.0
    grid = best * np.geomspace(1 / _FARTHER, _FARTHER, _SEARCHED)
    found = []
    for member in (model, *members[:: -(-len(members) // _MEMBERS)]):
        of_member = partial(loss, believed=replace(believed, model=member))
        mu, tried = _scanned(of_member, grid, rounds=1)
        found.append((mu, min(size for _, size in tried)))
    frictions, losses = np.array(found).T
    weights = np.exp(losses.min() - losses)
    weights /= weights.sum()
    mean = float(weights @ frictions)
    return mean, float(np.sqrt(weights @ (frictions - mean) ** 2))


def _scanned(loss: Callable[[float], float], grid: FloatArray, rounds: int = _ROUNDS) -> tuple[float, list[tuple[float, float]]]:
    """Return the friction of the least loss on a grid that is made finer about it, and all that were tried with their losses."""
    grid = np.maximum(grid, _TRIED[0])
    tried: list[tuple[float, float]] = []
    for _ in range(rounds + 1):
        losses = np.array([loss(float(mu)) for mu in grid])
        tried += zip(grid.tolist(), losses.tolist(), strict=True)
        at = int(np.argmin(losses))
        best = float(grid[at])
        grid = np.geomspace(grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)], _FINER)
    return best, tried


def _with_error(mu: float, error: float, trials: int, readings: str) -> ContactFriction:
    """A friction of few trials, with what else fits as well."""
    interval = (max(0.0, mu - NORMAL * error), mu + NORMAL * error)
    return ContactFriction(mu, interval, trials, _P_VALUE, readings)


def all_pushes(poses: FinalPoses) -> tuple[list[Replay], FloatArray]:
    """Return all pushes, also those whose final pose cannot be predicted, and the noise (n,) of their final poses in m, with what
    the friction of the table may be wrong by."""
    noise = np.linalg.norm(np.concatenate((poses.noise, poses.lost_noise)), axis=1)
    return [*poses.pushes, *poses.lost], np.hypot(noise, _WRONG * poses.experiment.rig.slider.radius)


def lost_pushes(poses: FinalPoses) -> dict[int, float]:
    """Return trials that end far from where the nominal simulation has them, whatever the noise, and how far (m)."""
    pushes, noise = all_pushes(poses)
    if not pushes:
        return {}
    away = np.linalg.norm(poses.errors(pushes, poses.prior.nominal, {}), axis=1)
    return {push.trial: float(size) for push, size, far in zip(pushes, away, away > _OFF * noise, strict=True) if far}


def without_contradiction(found: Attribution, poses: FinalPoses) -> Attribution:
    """Return what was found, friction of slipping fingers taken back if with it pushes end farther from where they were measured.

    A few rows of force may look like slip; fingers of such friction would slip in other pushes, too.
    """
    contact, nominal = found.contact, poses.experiment.rig.contact_friction
    if contact is None or nominal is None or not poses.pushes or FINGER_FRICTION not in found.named:
        return found
    noise = np.linalg.norm(poses.noise, axis=1)

    def loss(friction: FloatArray) -> float:
        values = {**found.final.values, FINGER_FRICTION: friction}
        return _robust(np.linalg.norm(poses.errors(poses.pushes, found.final.loads, values), axis=1) / noise)

    holds = loss(contact.beside(poses.experiment.mu)) <= loss(np.zeros(1))
    return found if holds else replace(found, contact=replace(contact, p_value=1.0))
