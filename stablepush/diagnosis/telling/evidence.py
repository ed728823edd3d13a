"""The evidence for and against each effect of the catalogue, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from stablepush.diagnosis.likelihood.likelihood import Demands
from stablepush.diagnosis.results import RankedEffect, readable
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.search.contact_friction import P_SLIP
from stablepush.diagnosis.search.screening import Screening
from stablepush.effects import FINGER_FRICTION

#: Contact friction that differs with so small a p-value does so clearly, though it need not be named.
_UNSURE = 0.02


class Evidence(NamedTuple):
    """Clauses for and against an effect; or why it is not identifiable from the log."""

    supporting: list[str]
    opposing: list[str]
    unseen: str = ""


def not_identifiable(reason: str) -> Evidence:
    """Evidence of an effect that is not identifiable from a log."""
    return Evidence([], [], f"not identifiable from this log: {reason}")


def evidence(found: Attribution, ranking: Sequence[RankedEffect], effects: list[str], why: str) -> dict[str, Evidence]:
    """Return the evidence for and against each effect of a ranking.

    ``effects``: those that the verdict names; ``why`` it does not name others that act.
    """
    # whether the measured shape of the surface is another, not its size alone
    likelihood, kinds = found.likelihood, found.likelihood.experiment.effects
    reshaped = "free" in found.scores and likelihood.significantly_better(found.scores["free"], found.scores["scaled"])
    result = {}
    for entry in ranking:
        id = entry.effect
        acts = id in (*found.named, *found.confounded)
        if not entry.identifiable and not acts:
            clauses = not_identifiable(entry.reason or "")
        elif kinds[id].by_slip and found.contact is not None:
            clauses = _of_slip(found)
        elif not kinds[id].size:
            clauses = _of_surface(found, reshaped)
        elif acts:
            clauses = _of_acting(id, found)
        else:
            clauses = _of_others(id, found, reshaped)
        if acts and id not in effects:
            clauses.opposing.append(why)
        result[id] = clauses
    return result


def _of_slip(found: Attribution) -> Evidence:
    contact, nominal = found.contact, found.likelihood.experiment.rig.contact_friction
    assert contact is not None
    assert nominal is not None
    words = f"the {contact.readings} of {contact.trials} pushes give {contact.in_words}; {readable(nominal)} was assumed"
    if FINGER_FRICTION in found.named:
        return Evidence([f"{words}, p {contact.p_value:.1g}"], [])
    unsure = f"p {contact.p_value:.1g}, above the limit of {P_SLIP:g}"
    return Evidence([], [f"{words}, {unsure if contact.p_value < _UNSURE else 'no significant difference'}"])


def _of_surface(found: Attribution, reshaped: bool) -> Evidence:
    shape = f"a refitted pressure changes the log density of held-out pushes by {_held_out(found, 'free')}"
    if reshaped:
        return Evidence([shape], ["a change of the pressure would explain it as well"])
    pressure, friction = _held_out(found, "free"), _held_out(found, "scaled")
    words = "neither another pressure nor another friction predicts held-out pushes significantly better"
    return Evidence([], [f"{words} (log density {pressure} and {friction})"])


def _of_acting(id: str, found: Attribution) -> Evidence:
    """Of an effect that acts, or may act in the place of one that does."""
    clauses = Evidence([], [])
    if id in found.scores:
        clauses.supporting.append(_of_held_out(id, found))
    else:
        gain = readable(found.tests[id].gain)
        if id in found.confounded:
            clauses.supporting.append(f"in the place of {found.confounded_with}, {_GAINS} {gain}")
        else:
            clauses.supporting.append(f"{_beside([e for e in found.chosen if e != id])}{_GAINS} {gain}")
            screening = found.screened.get(id)
            if screening is not None and screening.significantly_better:
                certain = screening.family_wise_p <= found.likelihood.demands.family_wise_p
                times = "" if certain else f"{found.likelihood.demands.certain:g} times "
                clauses.supporting.append(
                    f"most pushes speak for it: when it was found, their log density rose by more than {times}the threshold"
                )
                words = f"when it was found, its family-wise p-value was {_p(screening.family_wise_p)}"
                (clauses.supporting if certain else clauses.opposing).append(words)
    apart = (found.confounded_with, *found.confounded)
    alike = [other for other in apart if other != id]
    if found.confounded and id in apart:
        clauses.opposing.append(f"{' and '.join(alike)} would explain the log about equally well")
    return clauses


def _of_others(id: str, found: Attribution, reshaped: bool) -> Evidence:
    """Of an effect that is not found to act."""
    screening = found.screened.get(id)
    if id in found.likelihood.nuisance:
        return Evidence([], [], "the rig does not state it: it is fitted with the rest and cannot be judged")
    if id in found.scores:
        return Evidence([], [_of_held_out(id, found)])
    if screening is not None:
        words = f"{_beside(screening.given)}{_GAINS} {readable(screening.gain)}"
        if not found.free:
            words += " after the pressure is refitted"
        return Evidence([], [f"{words}: {_failed(screening, found.likelihood.demands)}"])
    if reshaped:
        return Evidence([], ["a refitted pressure explains what it would change"])
    return Evidence([], ["a refitted pressure does not predict held-out pushes significantly better than the nominal one"])


#: Over the scatter that is left.
_GAINS = "the sum of squares falls by"


def _beside(others: Sequence[str]) -> str:
    return f"with {' and '.join(others)} fitted already, " if others else ""


def _failed(screening: Screening, demands: Demands) -> str:
    """Why an effect did not enter, or did not stay."""
    least = demands.gain
    if screening.gain <= least:
        return f"{readable(least)} is needed"
    if screening.statistic <= least:
        return f"but by few pushes: the statistic over pushes is {readable(screening.statistic)}, {readable(least)} is needed"
    if not screening.possible:
        return "but it is too small to matter, of a sign that it cannot have, or larger than any"
    if screening.significantly_better is False:
        if screening.family_wise_p > demands.family_wise_p:
            return f"but its family-wise p-value is {_p(screening.family_wise_p)}"
        return "but the log density does not rise significantly over its scatter between pushes"
    if screening.family_wise_p > demands.family_wise_p:
        return f"but its family-wise p-value is {_p(screening.family_wise_p)}"
    return "but other effects explain the gap better"


def _p(value: float) -> str:
    """A p-value that a bootstrap gave."""
    return "below 0.002" if value < 0.002 else f"{value:.{3 if value < 0.1 else 2}f}"


def _of_held_out(id: str, found: Attribution) -> str:
    words = f"the log density of held-out pushes changes by {_held_out(found, id, 'scaled')} with it"
    return f"{words}, by {_held_out(found, 'free', 'scaled')} with any pressure"


def _held_out(found: Attribution, name: str, base: str = "") -> str:
    """What the log density of held-out trials gains, with its sign."""
    base = base or {"free": "scaled", "scaled": "nominal"}[name]
    # trials at the end in which nothing moves have no density by the nominal simulation
    n = min(len(found.scores[name]), len(found.scores[base]))
    gain = float((found.scores[name][:n] - found.scores[base][:n]).sum())
    return f"+{readable(gain)}" if gain > 0 else readable(gain)
