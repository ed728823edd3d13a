"""All effects of the catalogue, most probable first: parameters with intervals, and what a log cannot show."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.equations import SIZES
from stablepush.diagnosis.likelihood.system import System
from stablepush.diagnosis.results import ParameterEstimate, RankedEffect
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.search.plausibility import identifiable
from stablepush.effects import CATALOGUE, FAMILIES

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
#: What the jackknife is short of, and the share of an estimate that it may be off beside its scatter, since rows are means over
#: parts of pushes; found likewise.
_SHORT = 1.15
_OTHERS = 0.01
_SYSTEMATIC = {"inertia": 0.2}
UNSEEN = {
    "anisotropy-world": "needs forces, or pushes that slip, in several directions over the table",
    "anisotropy-object": "needs forces, or pushes that slip, in several directions of the slider",
    "speed-dependence": "needs forces and pushes at different speeds",
    "spatial-variation": "needs forces, or pushes that slip, at different places",
    "drift": "needs forces over many trials",
    "pressure-shift": "needs forces and moments, or pushes that turn the slider",
    "pressure-spread": "needs moments of turning pushes",
    "tilt": "needs headings that vary, the slider's mass, and forces or the friction of the support",
    "inertia": "needs forces while the speed changes",
    "force-bias": "needs forces and headings that vary",
    "force-rotation": "needs forces in directions that vary against the motion",
    "frame-offset": "needs moments, or fingers on several faces",
    "latency": "needs poses of pusher and slider at different speeds",
    "contact-geometry": "needs poses of the pusher, the radius of its fingers, and forces or pushes of several faces",
    "contact-friction": "needs forces of three pushes whose fingers slip, or press beyond the friction cone",
    "model-capacity": "needs forces of motions all round the limit surface",
}


def _parameters(system: System, id: str, value: FloatArray, errors: FloatArray) -> dict[str, ParameterEstimate]:
    """Parameters of the catalogue, with 95 % intervals, from those that are fitted."""
    own = system.own.get(id)
    of_effect = CATALOGUE[id].parameters if own is None else (own.parameter,)
    known = {p.name: p for p in of_effect}

    def entry(name: str, estimate: Any, low: Any, high: Any) -> dict[str, ParameterEstimate]:
        pairs = [list(p) for p in zip(low, high, strict=True)] if isinstance(estimate, list) else [low, high]
        return {name: ParameterEstimate(estimate, pairs, known[name].unit)}

    if id in ("anisotropy-world", "anisotropy-object"):
        size, error = float(np.hypot(*value)), float(np.sqrt((errors**2).mean()))
        direction = 0.5 * math.atan2(float(value[1]), float(value[0]))
        spread = min(math.pi / 2, 0.98 * error / max(size, 1e-9))

        def ratio(d: float) -> float:
            d = min(max(d, 0.0), 0.9)
            return math.sqrt((1 + d) / (1 - d))

        found = entry("ratio", ratio(size), ratio(size - 1.96 * error), ratio(size + 1.96 * error))
        return found | entry("direction", direction, direction - spread, direction + spread)
    name = of_effect[0].name
    shift = 1.0 if id == "pressure-spread" else 0.0
    # not beyond what makes sense
    least, most = known[name].least, known[name].most
    estimates, low, high = (np.clip(value + shift + k * errors, least, most).tolist() for k in (0.0, -1.96, 1.96))
    if len(estimates) == 1:
        return entry(name, estimates[0], low[0], high[0])
    return entry(name, estimates, low, high)


def rank(system: System, found: Attribution, effects: list[str]) -> list[RankedEffect]:
    """Return the effects of the catalogue, the most probable first; ``effects``: those that the verdict names."""
    # confounded causes share the probability of the one that was fitted
    apart = (found.confounded_with, *found.confounded) if found.confounded else ()
    shared = _of_fit(found.confounded_with, system, found, effects)[0] / len(apart) if apart else 0.0
    entries = []
    for id in (*CATALOGUE, *system.own):
        if id == "contact-friction" and (system.has_wrench or found.contact is not None):
            entry = _of_slip(system, found)
        elif id == "model-capacity":
            # a refitted surface takes it: nothing speaks for it but that another surface fits better
            seen = system.has_surface and "free" in found.scores
            recalibrated = found.recalibrated and not found.chosen
            entry = ((_FACETS[0] if recalibrated else _FACETS[1]) if seen else 0.02, {}, seen)
        else:
            entry = _of_fit(id, system, found, effects)
        probability, parameters, seen = entry
        # a log shows what is named from it
        seen = seen or id in effects
        if id in apart:
            probability = shared
        elif id not in effects and probability < _MOST:
            probability *= _NOT_NAMED
        reason = None if seen else system.own[id].needs if id in system.own else _unseen(id, found)
        form = _form(id, system, found) if id in found.final.values else None
        if id == "contact-friction" and found.contact is not None and id in found.named:
            form = found.contact.form
        entries.append(RankedEffect(id, float(np.clip(probability, 1e-4, 0.999)), parameters, seen, reason, form))
    return sorted(entries, key=lambda entry: -entry.probability)


def _unseen(id: str, found: Attribution) -> str:
    """Why a log cannot show an effect."""
    contact = found.contact
    if id == "contact-friction" and contact is not None:
        slip = f"{contact.readings} of {contact.trials} pushes give {contact.in_words}"
        return f"needs the friction that the rig believes the fingers have; {slip}"
    return UNSEEN[id]


Entry = tuple[float, dict[str, ParameterEstimate], bool]


def _of_slip(system: System, found: Attribution) -> Entry:
    """Friction at the fingers, from the forces of those that slip."""
    contact = found.contact
    if contact is None or system.rig.contact_friction is None:
        return 0.02, {}, False
    probability = 1 - min(1.0, 50 * contact.p_value) if contact.p_value < 1 else 0.02
    return probability, {"mu": ParameterEstimate(contact.estimate, list(contact.interval), "1")}, True


def _of_fit(id: str, system: System, found: Attribution, effects: list[str]) -> Entry:
    """An effect that is fitted, or tested beside those that are."""
    test, size = found.tests[id], system.size(id, whole=False)
    values = np.linalg.eigvalsh(test.information)
    # vaguer than any value of the effect is the same as not known at all
    deviation = np.full(size, 1 / math.sqrt(max(values[0], system.plausible(id) ** -2)))
    blind = not identifiable(system, id, test)
    estimate = test.estimate
    if id in found.final.values:
        estimate = found.final.values[id]
        deviation = _deviations(found, id)[:size]
        if id == "pressure-shift" and found.moves_freely(system):
            refit = found.refit(system)
            shift, (estimate, deviation) = estimate[:2], system.moved_center(refit.loads, system.deviations(refit, True))
            if not found.free:
                # the form fits, too, with an impossible shift: what they differ by tells how far neither is the pressure
                deviation = np.hypot(deviation, (shift - estimate) / 2)
    deviation = np.hypot(_SHORT * deviation, _SYSTEMATIC.get(id, _OTHERS) * float(np.linalg.norm(estimate[:size])))
    nominal = {"contact-geometry": system.observations.finger_radius, "contact-friction": system.mu}
    parameters = _parameters(system, id, np.asarray(estimate[:size] + (nominal.get(id) or 0.0)), deviation)
    evidence = min(test.statistic, test.gain) - 2 * (len(test.estimate) - 1)
    if id in found.chosen:
        probability = min(0.99, max(0.5, _logistic((evidence - _EVEN_CHOSEN) / _ODDS_CHOSEN)))
    else:
        probability = _logistic((evidence - _EVEN) / _ODDS)
        # not more than what a refit takes in, the nearer to it the more evidence there is
        probability = probability if id in effects else min(probability, _MOST * (1 - 1 / (1 + max(2.0, evidence))))
    return probability, parameters, not blind or (id == "contact-friction" and id in system.nuisance)


def _deviations(found: Attribution, id: str) -> FloatArray:
    """Standard deviations of all parameters of an effect that is fitted."""
    before = list(found.final.values)[: list(found.final.values).index(id)]
    at = sum(len(found.final.values[k]) for k in before)
    return np.sqrt(np.maximum(np.diag(found.final.covariance)[at : at + len(found.final.values[id])], 0.0))


def _form(id: str, system: System, found: Attribution) -> dict[str, Any] | None:
    """The terms of its family with which an effect was fitted, beside its own form, with their coefficients; None if none, or
    if each of several logs has its own."""
    value, size = found.final.values[id], system.size(id, whole=False)
    if len(value) == size or size > SIZES.get(id, size):
        return None
    family, terms = FAMILIES[id], value[size:]
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
