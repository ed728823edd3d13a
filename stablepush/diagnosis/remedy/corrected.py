"""What a diagnosis found, as plans need it: the surface with what is uncertain of it, the contact, and the other effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from stablepush.core import FloatArray
from stablepush.diagnosis.judge.force_axes import uneven_axes
from stablepush.diagnosis.judge.ranking import rank
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.likelihood import Fitted
from stablepush.diagnosis.remedy.corrected_surface import Base, corrected_surface
from stablepush.diagnosis.results import RankedEffect
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.effects import FINGER_FRICTION, Effect, EffectKind, KnownEffect
from stablepush.planning import Correction
from stablepush.surfaces import LimitSurface

#: Standard error of the friction of fingers, over itself, where there is a gap that nothing named explains. Fingers of 0.5 to
#: 0.75 of their believed friction often slip in none of a few plans; 30 % to either side cost half a per cent of a plan's time.
_UNSHOWN = 0.15


def in_own_forms(
    found: Attribution, ranking: Sequence[RankedEffect], effects: list[str]
) -> tuple[Attribution, Sequence[RankedEffect], list[str]]:
    """Return what was found, its ranking and the named effects as simulations and plans can have them: in their own forms.

    They are fitted without the terms of their families. An effect of which nothing is then left is dropped, and a force sensor
    whose axes are uneven: an angle alone would take up some of that.
    """
    formed = found.model.families
    if not formed:
        return found, ranking, effects
    own = found.in_own_forms
    uneven = {entry.effect for entry in ranking if uneven_axes(entry) is not None}
    effects = [id for id in effects if id not in formed or not (id in uneven or _holds_zero(own.final, id))]
    return own, rank(own, effects), effects


def corrections(
    found: Attribution,
    ranking: Sequence[RankedEffect],
    effects: Sequence[str],
    refitted: bool,
    unexplained: bool,
    suspected: tuple[float, float] | None = None,
) -> list[Correction]:
    """Return the rigs that a diagnosis leaves possible, each with its probability; all :func:`in_own_forms`.

    One, or one for each of the causes that cannot be separated. ``refitted``: the shape of the nominal surface does not fit,
    another one takes its place. ``unexplained``: there is a gap, and no effect is named; friction of the fingers that no push
    has shown is then less certain than it was. ``suspected``: friction of the fingers that pushes do not
    show clearly enough for a name, and its standard error.
    """
    found_rigs = _corrections(found.in_own_forms, ranking, effects, refitted)
    nominal = found.likelihood.experiment.rig.contact_friction
    if suspected is not None:
        # what holds with less friction holds with more
        friction, error = suspected
        return [replace(rig, contact_friction=friction, contact_friction_error=error) for rig in found_rigs]
    if not unexplained or nominal is None:
        return found_rigs
    return [replace(rig, contact_friction_error=_UNSHOWN * nominal) for rig in found_rigs]


def _holds_zero(fitted: Fitted, id: str) -> bool:
    """Whether no effect lies within the 95 % region of an effect's estimate."""
    before = list(fitted.values)[: list(fitted.values).index(id)] if id in fitted.values else []
    value = fitted.values.get(id, np.zeros(0))
    at = sum(len(fitted.values[k]) for k in before)
    spread = fitted.covariance[at : at + len(value), at : at + len(value)]
    return bool(len(value)) and float(value @ np.linalg.pinv(spread) @ value) < chi2.ppf(0.95, len(value))


def _corrections(found: Attribution, ranking: Sequence[RankedEffect], effects: Sequence[str], refitted: bool) -> list[Correction]:
    if not found.confounded or found.confounded_with not in effects:
        return [_correction(found, found.final, effects, ranking, 1.0, refitted)]
    probable = {entry.effect: max(entry.probability, 1e-3) for entry in ranking}
    others = [id for id in effects if id != found.confounded_with and id not in found.confounded]
    causes = [found.confounded_with, *found.confounded]
    total, result = sum(probable[id] for id in causes), []
    for id in causes:
        model = found.model.without(found.confounded_with).plus(id)
        fitted = found.likelihood.fit(model)
        # parameters of this fit: those of the ranking were fitted with the other cause
        beside = rank(replace(found, final=fitted), [id, *others])
        result.append(_correction(found, fitted, [id, *others], beside, probable[id] / total, refitted))
    return result


def _correction(
    found: Attribution,
    fitted: Fitted,
    effects: Sequence[str],
    ranking: Sequence[RankedEffect],
    probability: float,
    refitted: bool,
) -> Correction:
    experiment = found.likelihood.experiment
    kinds, values = experiment.effects, fitted.values
    friction, error = _finger_friction(found, fitted, effects)
    known = {entry.effect: entry for entry in ranking}
    # effects of a lab's own are in no catalogue: a scene cannot hold them
    others = [id for id in effects if not (_folded(kinds[id]) or kinds[id].of_lab) and known[id].parameters]
    radius, offset = None, None
    for id in (id for id in effects if id in values):
        if kinds[id].of_radius and all(experiment.observations.off):
            radius = max(0.0, (experiment.observations.finger_radius or 0.0) + float(values[id][0]))
        if kinds[id].moves_tracker:
            offset = values[id][:2]
    return Correction(
        probability=probability,
        surface=_surface(found, fitted, effects, refitted),
        contact_friction=friction,
        contact_friction_error=error,
        finger_radius=radius,
        tracker_offset=offset,
        effects=tuple(
            KnownEffect(
                Effect(id, of_last_log(known[id], experiment)), None if experiment.per_log(id) else _covariance(known[id])
            )
            for id in others
        ),
    )


def _folded(kind: EffectKind) -> bool:
    """Whether an effect is no entry of ``effects``: surface, contact or goal hold it."""
    return bool(kind.instead) or kind.reshapes == "pressure" or kind.moves_tracker


def _finger_friction(found: Attribution, fitted: Fitted, effects: Sequence[str]) -> tuple[float | None, float | None]:
    """Friction of the fingers, and its standard error, where they are another or were not known."""
    experiment, values = found.likelihood.experiment, fitted.values
    nominal, friction, error = experiment.rig.contact_friction, None, None
    # what a fit takes for friction that is not stated is no estimate of it
    if found.contact is not None and (FINGER_FRICTION in effects or nominal is None):
        friction, error = found.contact.last
    elif FINGER_FRICTION in effects and FINGER_FRICTION in values and nominal is not None:
        friction = max(0.0, experiment.mu + float(values[FINGER_FRICTION][0]))
        error = _error(fitted, FINGER_FRICTION)
    # no plan pushes without friction
    return (friction, error) if friction else (None, None)


def of_last_log(entry: RankedEffect, experiment: Experiment) -> dict[str, Any]:
    """Return the estimates of an effect by parameter; of one that each log has of its own, those of the last."""
    if not experiment.per_log(entry.effect):
        return entry.estimates
    return {name: value[experiment.last] for name, value in entry.estimates.items()}


def _surface(found: Attribution, fitted: Fitted, effects: Sequence[str], refitted: bool) -> LimitSurface | None:
    """The friction of the support, if it is now believed to be another; else the rig's model, None if it has none.

    A pressure that has moved need not have done so in a form of the catalogue: a refit of any pressure may be nearer.
    A model of few pokes is fitted anew beside effects that change plans: a log says more of it. None where a log without forces
    does not show how much friction there is.
    """
    likelihood, experiment = found.likelihood, found.likelihood.experiment
    has_wrench, kinds = likelihood.wrench is not None, experiment.effects
    moved = [id for id in effects if kinds[id].reshapes == "pressure" and id in fitted.values]
    sized = has_wrench or (likelihood.prior.has_surface and bool(experiment.moving_weight))
    plans = any(not kinds[id].of_lab and kinds[id].acts != "sensing" for id in effects)
    anew = refitted or moved or (plans and has_wrench and bool(experiment.open_modes.size))
    if not (anew and sized):
        return experiment.rig.model
    if not moved:
        return corrected_surface(likelihood, Base(fitted, found.free))
    refit = Base(found.refit, True, found.scores.get("free"))
    if found.moves_freely:
        return corrected_surface(likelihood, refit)
    return corrected_surface(likelihood, Base(fitted, found.free, found.scores.get(moved[0])), refit)


def _error(fitted: Fitted, id: str) -> float:
    """Standard error of an effect of one parameter."""
    names = list(fitted.values)
    at = sum(len(fitted.values[name]) for name in names[: names.index(id)])
    return float(np.sqrt(max(0.0, fitted.covariance[at, at])))


def _covariance(entry: RankedEffect) -> FloatArray:
    """Covariance (k, k) of the parameters, from their intervals."""
    low, high = (np.concatenate([np.reshape(p.ci95, (-1, 2))[:, k] for p in entry.parameters.values()]) for k in (0, 1))
    return np.diag(((high - low) / (2 * 1.96)) ** 2)
