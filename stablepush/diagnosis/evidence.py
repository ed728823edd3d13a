"""What speaks for each effect of the catalogue, and what against it, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from stablepush.diagnosis.attribution import P_SLIP, Attribution, Screening
from stablepush.diagnosis.results import RankedEffect
from stablepush.diagnosis.system import System

#: Contact friction that differs with so small a p-value does so clearly, though it need not be named.
_UNSURE = 0.02


class Evidence(NamedTuple):
    """Clauses that speak for an effect, and against it; or why a log cannot judge it."""

    supporting: list[str]
    opposing: list[str]
    unseen: str = ""


def cannot_show(reason: str) -> Evidence:
    """Evidence of an effect that a log cannot show."""
    return Evidence([], [], f"this log cannot show it: {reason}")


def evidence(
    system: System, found: Attribution, ranking: Sequence[RankedEffect], effects: list[str], why: str
) -> dict[str, Evidence]:
    """Return what speaks for and against each effect of a ranking.

    ``effects``: those that the verdict names; ``why`` it does not name others that act.
    """
    # whether the measured shape of the surface is another, not its size alone
    reshaped = "free" in found.scores and system.better(found.scores["free"], found.scores["scaled"])
    result = {}
    for entry in ranking:
        id = entry.effect
        acts = id in (*found.named, *found.rivals)
        if not entry.identifiable and not acts:
            said = cannot_show(entry.reason or "")
        elif id == "contact-friction" and system.has_wrench:
            said = _of_slip(system, found)
        elif id == "model-capacity":
            said = _of_surface(found, reshaped)
        elif acts:
            said = _of_acting(id, system, found)
        else:
            said = _of_others(id, system, found, reshaped)
        if acts and id not in effects:
            said.opposing.append(why)
        result[id] = said
    return result


def _of_slip(system: System, found: Attribution) -> Evidence:
    contact, nominal = found.contact, system.rig.contact_friction
    assert contact is not None
    assert nominal is not None
    words = (
        f"forces of {contact.trials} pushes whose fingers slip say {readable(contact.estimate)} "
        f"where the rig has {readable(nominal)}"
    )
    if "contact-friction" in found.named:
        return Evidence([f"{words}, p {contact.p_value:.1g}"], [])
    unsure = f"p {contact.p_value:.1g}: not sure enough, {P_SLIP:g} is the most"
    return Evidence([], [f"{words}, {unsure if contact.p_value < _UNSURE else 'which is no clear difference'}"])


def _of_surface(found: Attribution, reshaped: bool) -> Evidence:
    shape = f"a refitted pressure changes the log density of held-out pushes by {_held_out(found, 'free')}"
    if reshaped:
        return Evidence([shape], ["a change of the pressure would do the same"])
    return Evidence([], [f"{shape}, no clear gain; another friction with the nominal pressure, by {_held_out(found, 'scaled')}"])


def _of_acting(id: str, system: System, found: Attribution) -> Evidence:
    """Of an effect that acts, or may act in the place of one that does."""
    said = Evidence([], [])
    if id in found.scores:
        said.supporting.append(_of_held_out(id, found))
    else:
        gain = readable(found.tests[id].gain)
        if id in found.rivals:
            said.supporting.append(f"in the place of {found.rivalled}, {_FALLS} {gain}")
        else:
            said.supporting.append(f"{_beside([e for e in found.chosen if e != id])}{_FALLS} {gain}")
            screening = found.screened.get(id)
            if screening is not None and screening.better:
                sure = screening.chance <= system.demands.chance
                times = "" if sure else f"{system.demands.sure:g} times "
                said.supporting.append(
                    f"when it was found, the log density rose by more than {times}what its scatter between pushes asks for"
                )
                share = _share(screening.chance)
                words = f"when it was found, some effect did as well by chance in {share} of logs that have no effect"
                (said.supporting if sure else said.opposing).append(words)
    apart = (found.rivalled, *found.rivals)
    alike = [other for other in apart if other != id]
    if found.rivals and id in apart:
        said.opposing.append(f"{' and '.join(alike)} would explain the log about as well")
    return said


def _of_others(id: str, system: System, found: Attribution, reshaped: bool) -> Evidence:
    """Of an effect that is not found to act."""
    screening = found.screened.get(id)
    if id in system.nuisance:
        return Evidence([], [], "it is fitted along, since the rig does not say what it is, and cannot be judged")
    if id in found.scores:
        return Evidence([], [_of_held_out(id, found)])
    if screening is not None:
        words = f"{_beside(screening.given)}{_FALLS} {readable(screening.gain)}"
        if not found.free:
            words += " once the pressure takes what it can"
        return Evidence([], [f"{words}: {_failed(screening, system)}"])
    if reshaped:
        return Evidence([], ["a refitted pressure takes in what it would do"])
    return Evidence([], ["a refitted pressure predicts held-out pushes not clearly better than the nominal one"])


_FALLS = "the sum of squares, over the scatter that is left, falls by"


def _beside(others: Sequence[str]) -> str:
    return f"beside {' and '.join(others)}, " if others else ""


def _failed(screening: Screening, system: System) -> str:
    """Why an effect did not enter, or did not stay."""
    least = system.demands.gain
    if screening.gain <= least:
        return f"too little, {readable(least)} is the least"
    if screening.statistic <= least:
        return f"but its statistic over pushes is {readable(screening.statistic)}, {readable(least)} is the least"
    if not screening.possible:
        return "but it is too small to matter, or of a sign that it cannot have"
    if screening.better is False:
        return "but the log density rises by too little over its scatter between pushes"
    if screening.chance > system.demands.chance:
        return f"but some effect does as well by chance in {_share(screening.chance)} of logs that have no effect"
    return "but others explain more"


def _share(chance: float) -> str:
    """A share that a bootstrap gave."""
    return "less than 0.2 %" if chance < 0.002 else f"{100 * chance:.{1 if chance < 0.1 else 0}f} %"


def readable(value: float) -> str:
    """A number with four digits, or with all that stand before its point: 12345, not 1.234e+04."""
    return f"{value:.4g}" if abs(value) < 9999.5 else f"{value:.0f}"


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
