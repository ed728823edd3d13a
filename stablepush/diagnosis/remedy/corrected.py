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
from stablepush.diagnosis.likelihood.equations import OF_PRESSURE, Fitted
from stablepush.diagnosis.likelihood.system import System
from stablepush.diagnosis.remedy.corrected_surface import Base, corrected_surface
from stablepush.diagnosis.results import RankedEffect
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.effects import CATALOGUE, Effect, KnownEffect
from stablepush.planning import Correction
from stablepush.surfaces import LimitSurface

#: Standard error of the friction of fingers, over itself, where there is a gap that nothing named explains. Fingers of 0.5 to
#: 0.75 of their believed friction often slip in none of a few plans; 30 % to either side cost half a per cent of a plan's time.
_UNSHOWN = 0.15
#: Effects that are no entry of ``effects``: surface and contact hold them.
_FOLDED = (*OF_PRESSURE, "contact-friction", "contact-geometry", "frame-offset", "model-capacity")


def in_own_forms(
    system: System, found: Attribution, ranking: Sequence[RankedEffect], effects: list[str]
) -> tuple[Attribution, Sequence[RankedEffect], list[str]]:
    """Return what was found, its ranking and the named effects as simulations and plans can have them: in their own forms.

    They are fitted without the terms of their families. An effect of which nothing is then left is dropped, and a force sensor
    whose axes are uneven: an angle alone would take up some of that.
    """
    if not system.opened:
        return found, ranking, effects
    formed = system.opened
    with system.own_forms():
        found = replace(found, final=system.fit(found.chosen, found.free))
        uneven = {entry.effect for entry in ranking if uneven_axes(entry) is not None}
        effects = [id for id in effects if id not in formed or not (id in uneven or _holds_zero(found.final, id))]
        return found, rank(system, found, effects), effects


def corrections(
    system: System,
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
    with system.own_forms():
        found_rigs = _corrections(system, found, ranking, effects, refitted)
    nominal = system.rig.contact_friction
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


def _corrections(
    system: System, found: Attribution, ranking: Sequence[RankedEffect], effects: Sequence[str], refitted: bool
) -> list[Correction]:
    if not found.confounded or found.confounded_with not in effects:
        return [_correction(system, found, found.final, effects, ranking, 1.0, refitted)]
    probable = {entry.effect: max(entry.probability, 1e-3) for entry in ranking}
    others = [id for id in effects if id != found.confounded_with and id not in found.confounded]
    causes = [found.confounded_with, *found.confounded]
    total, result = sum(probable[id] for id in causes), []
    for id in causes:
        fitted = system.fit([*(e for e in found.chosen if e != found.confounded_with), id], found.free)
        # parameters of this fit: those of the ranking were fitted with the other cause
        beside = rank(system, replace(found, final=fitted), [id, *others])
        result.append(_correction(system, found, fitted, [id, *others], beside, probable[id] / total, refitted))
    return result


def _correction(
    system: System,
    found: Attribution,
    fitted: Fitted,
    effects: Sequence[str],
    ranking: Sequence[RankedEffect],
    probability: float,
    refitted: bool,
) -> Correction:
    rig, values = system.rig, fitted.values
    friction, error = None, None
    # what a fit takes for friction that is not stated is no estimate of it
    if found.contact is not None and ("contact-friction" in effects or rig.contact_friction is None):
        friction, error = found.contact.last
    elif "contact-friction" in effects and "contact-friction" in values and rig.contact_friction is not None:
        friction = max(0.0, system.mu + float(values["contact-friction"][0]))
        error = _error(system, fitted, "contact-friction")
    if not friction:
        # no plan pushes without friction
        friction, error = None, None
    radius = None
    if "contact-geometry" in effects and "contact-geometry" in values and all(system.observations.off):
        radius = max(0.0, (system.observations.finger_radius or 0.0) + float(values["contact-geometry"][0]))
    tracker = values["frame-offset"][:2] if "frame-offset" in effects and "frame-offset" in values else None
    known = {entry.effect: entry for entry in ranking}
    # effects of a lab's own are in no catalogue: a scene cannot hold them
    others = [id for id in effects if id not in _FOLDED and id in CATALOGUE and known[id].parameters]
    return Correction(
        probability=probability,
        surface=_surface(system, found, fitted, effects, refitted),
        contact_friction=friction,
        contact_friction_error=error,
        finger_radius=radius,
        tracker_offset=tracker,
        effects=tuple(
            KnownEffect(Effect(id, of_last_log(known[id], system)), None if id in system.each else _covariance(known[id]))
            for id in others
        ),
    )


def of_last_log(entry: RankedEffect, system: System) -> dict[str, Any]:
    """Return the estimates of an effect by parameter; of one that each log has of its own, those of the last."""
    if entry.effect not in system.each:
        return entry.estimates
    return {name: value[system.last] for name, value in entry.estimates.items()}


def _surface(system: System, found: Attribution, fitted: Fitted, effects: Sequence[str], refitted: bool) -> LimitSurface | None:
    """The friction of the support, if it is now believed to be another; else the rig's model, None if it has none.

    A pressure that has moved need not have done so in a form of the catalogue: a refit of any pressure may be nearer.
    A model of few pokes is fitted anew beside effects that change plans: a log says more of it. None where a log without forces
    does not show how much friction there is.
    """
    moved = [id for id in OF_PRESSURE if id in effects and id in fitted.values]
    sized = system.has_wrench or (system.has_surface and bool(system.moving_weight))
    plans = any(id in CATALOGUE and CATALOGUE[id].acts != "sensing" for id in effects)
    anew = refitted or moved or (plans and system.has_wrench and bool(system.open_modes.size))
    if not (anew and sized):
        return system.rig.model
    if not moved:
        return corrected_surface(system, Base(fitted, found.free))
    refit = Base(found.refit(system), True, found.scores.get("free"))
    if found.moves_freely(system):
        return corrected_surface(system, refit)
    return corrected_surface(system, Base(fitted, found.free, found.scores.get(moved[0])), refit)


def _error(system: System, fitted: Fitted, id: str) -> float:
    """Standard error of an effect of one parameter."""
    names = list(fitted.values)
    at = sum(len(fitted.values[name]) for name in names[: names.index(id)])
    return float(np.sqrt(max(0.0, fitted.covariance[at, at])))


def _covariance(entry: RankedEffect) -> FloatArray:
    """Covariance (k, k) of the parameters, from their intervals."""
    low, high = (np.concatenate([np.reshape(p.ci95, (-1, 2))[:, k] for p in entry.parameters.values()]) for k in (0, 1))
    return np.diag(((high - low) / (2 * 1.96)) ** 2)
