"""All effects of the catalogue, most probable first: parameters with intervals, and what a log cannot show."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.results import ParameterEstimate, RankedEffect
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.search.plausibility import identifiable
from stablepush.effects import EffectKind

#: Evidence for an effect, the lesser of its statistic and its gain, at which it is as probable as not, and over which odds grow
#: by e: for effects that are not named, and for those that are. Found on simulated logs apart from those that are reported.
_EVEN, _ODDS = 18.0, 3.0
_EVEN_CHOSEN, _ODDS_CHOSEN = 21.0, 4.0
#: What the probability of an effect is worth that is not named, if it is below the last: of 144 that had 0.05 to 0.3 by their
#: evidence alone, in 400 logs of other engines, two acted.
_NOT_NAMED, _MOST = 0.1, 0.3
#: Probability that the nominal surface cannot take the measured shape where a refit is needed, and where it is not: of simulated
#: logs where it is not one in five hundred has facets.
_FACETS = (0.3, 0.01)
#: What the jackknife is short of; found likewise.
_SHORT = 1.15


def _parameters(kind: EffectKind, value: FloatArray, errors: FloatArray) -> dict[str, ParameterEstimate]:
    """Parameters of the catalogue, with 95 % intervals, from those that are fitted."""
    units = {parameter.name: parameter.unit for parameter in kind.parameters}
    found = {}
    for name, (estimate, low, high) in kind.estimates(value, errors).items():
        pairs = [list(p) for p in zip(low, high, strict=True)] if isinstance(estimate, list) else [low, high]
        found[name] = ParameterEstimate(estimate, pairs, units[name])
    return found


def rank(found: Attribution, effects: list[str]) -> list[RankedEffect]:
    """Return the effects of the catalogue, the most probable first; ``effects``: those that the verdict names."""
    likelihood, kinds = found.likelihood, found.likelihood.experiment.effects
    # confounded causes share the probability of the one that was fitted
    apart = (found.confounded_with, *found.confounded) if found.confounded else ()
    shared = _of_fit(found.confounded_with, found, effects)[0] / len(apart) if apart else 0.0
    entries = []
    for id, kind in kinds.items():
        if kind.by_slip and (likelihood.wrench is not None or found.contact is not None):
            entry = _of_slip(found)
        elif not kind.size:
            # a refitted surface takes it: nothing speaks for it but that another surface fits better
            seen = likelihood.prior.has_surface and "free" in found.scores
            recalibrated = found.recalibrated and not found.chosen
            entry = ((_FACETS[0] if recalibrated else _FACETS[1]) if seen else 0.02, {}, seen)
        else:
            entry = _of_fit(id, found, effects)
        probability, parameters, seen = entry
        # a log shows what is named from it
        seen = seen or id in effects
        if id in apart:
            probability = shared
        elif id not in effects and probability < _MOST:
            probability *= _NOT_NAMED
        reason = None if seen else _unseen(kind, found)
        form = _form(id, found) if id in found.final.values else None
        if kind.by_slip and found.contact is not None and id in found.named:
            form = found.contact.form
        entries.append(RankedEffect(id, float(np.clip(probability, 1e-4, 0.999)), parameters, seen, reason, form))
    return sorted(entries, key=lambda entry: -entry.probability)


def _unseen(kind: EffectKind, found: Attribution) -> str:
    """Why a log cannot show an effect."""
    contact = found.contact
    if kind.by_slip and contact is not None:
        slip = f"{contact.readings} of {contact.trials} pushes give {contact.in_words}"
        return f"needs the friction that the rig believes the fingers have; {slip}"
    return kind.unseen


Entry = tuple[float, dict[str, ParameterEstimate], bool]


def _of_slip(found: Attribution) -> Entry:
    """Friction at the fingers, from the forces of those that slip."""
    contact = found.contact
    if contact is None or found.likelihood.experiment.rig.contact_friction is None:
        return 0.02, {}, False
    probability = 1 - min(1.0, 50 * contact.p_value) if contact.p_value < 1 else 0.02
    return probability, {"mu": ParameterEstimate(contact.estimate, list(contact.interval), "1")}, True


def _of_fit(id: str, found: Attribution, effects: list[str]) -> Entry:
    """An effect that is fitted, or tested beside those that are."""
    likelihood, experiment = found.likelihood, found.likelihood.experiment
    test, size, kind = found.tests[id], experiment.size(id), experiment.effects[id]
    values = np.linalg.eigvalsh(test.information)
    # vaguer than any value of the effect is the same as not known at all
    deviation = np.full(size, 1 / math.sqrt(max(values[0], kind.plausible**-2)))
    blind = not identifiable(likelihood, id, test)
    estimate = test.estimate
    if id in found.final.values:
        estimate = found.final.values[id]
        deviation = _deviations(found, id)[:size]
        if kind.moves_center and found.moves_freely:
            refit = found.refit
            shift, changes = estimate[:2], likelihood.deviations(refit, True)
            estimate, deviation = likelihood.prior.moved_center(refit.loads, changes)
            if not found.free:
                # the form fits, too, with an impossible shift: what they differ by tells how far neither is the pressure
                deviation = np.hypot(deviation, (shift - estimate) / 2)
    deviation = np.hypot(_SHORT * deviation, kind.systematic * float(np.linalg.norm(estimate[:size])))
    parameters = _parameters(kind, np.asarray(estimate[:size] + _believed(kind, experiment)), deviation)
    evidence = min(test.statistic, test.gain) - 2 * (len(test.estimate) - 1)
    if id in found.chosen:
        probability = min(0.99, max(0.5, _logistic((evidence - _EVEN_CHOSEN) / _ODDS_CHOSEN)))
    else:
        probability = _logistic((evidence - _EVEN) / _ODDS)
        # not more than what a refit takes in, the nearer to it the more evidence there is
        probability = probability if id in effects else min(probability, _MOST * (1 - 1 / (1 + max(2.0, evidence))))
    return probability, parameters, not blind or (kind.by_slip and id in likelihood.nuisance)


def _believed(kind: EffectKind, experiment: Experiment) -> float:
    """The rig's value that an effect changes; 0 if it changes none."""
    if kind.by_slip:
        return experiment.mu
    return (experiment.observations.finger_radius or 0.0) if kind.of_radius else 0.0


def _deviations(found: Attribution, id: str) -> FloatArray:
    """Standard deviations of all parameters of an effect that is fitted."""
    before = list(found.final.values)[: list(found.final.values).index(id)]
    at = sum(len(found.final.values[k]) for k in before)
    return np.sqrt(np.maximum(np.diag(found.final.covariance)[at : at + len(found.final.values[id])], 0.0))


def _form(id: str, found: Attribution) -> dict[str, Any] | None:
    """The terms of its family with which an effect was fitted, beside its own form, with their coefficients; None if none, or
    if each of several logs has its own."""
    experiment = found.likelihood.experiment
    value, family, size = found.final.values[id], experiment.effects[id].family, experiment.size(id)
    if len(value) == size or family is None or experiment.per_log(id):
        return None
    terms = value[size:]
    deviations = _SHORT * _deviations(found, id)[size:]
    return {
        "covariate": family.covariate,
        "basis": list(family.terms),
        "coefficients": terms.tolist(),
        "ci95": np.column_stack((terms - 1.96 * deviations, terms + 1.96 * deviations)).tolist(),
        "unit": family.unit,
    }


def _logistic(value: float) -> float:
    return 1 / (1 + math.exp(-max(-30.0, min(30.0, value))))
