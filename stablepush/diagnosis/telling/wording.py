"""What a diagnosis says in words: its sentence, and its notes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from stablepush.core import FloatArray, some_of
from stablepush.diagnosis.judge.force_axes import uneven_axes
from stablepush.diagnosis.judge.verdicts import Judgement
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.robust import robust_variance
from stablepush.diagnosis.results import (
    ChannelGap,
    GapReduction,
    ParameterEstimate,
    RankedEffect,
    shown_unit,
    size_in_words,
)
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.effects import CATALOGUE, Parameter
from stablepush.io import PushLog, Rig

#: Trials and effects that a sentence lists at most, and the least probability of an effect that one lists.
_LISTED, _LIKELY = 3, 0.005
#: Least ratio of a size to the noise for a sentence to compare them: means over pushes may be off by less.
_LARGER = 1.2
#: A share below this goes without saying.
_TOLD_SHARE = 0.05
#: Whitened residuals of a row that is an outlier, and the share of rows that may be outliers.
_OUTLIER, _FEW = 6.0, 0.1
#: Share of the pushes that may hold outliers of the sensor.
_FEW_PUSHES = 0.25
#: Pushes are named if there are no more.
_NAMED_PUSHES = 3
#: Rows that tell what a push has in common.
_OF_PUSH = 3
#: A sentence names a channel whose gap is reduced by more than this share.
_REPORTED = 0.05
#: And if the gap itself becomes smaller by this factor: where it is within the noise its share is anything.
_NEARER = 1.02
#: A refitted surface does much of what a correction does from this share of it.
_MUCH = 0.5
#: Least ratio of what a correction leaves to the floor, to be reported.
_LEFT = 2.0
#: An interval whose middle is so far from the estimate, over its half width, is told by its ends.
_LOPSIDED = 0.2
#: The sentence on a log without forces that has no push to simulate.
NOT_COMPARED = (
    "No push could be simulated, so nothing was compared: a log without forces needs the poses of the pusher, and with two "
    "fingers the distance between them (finger_distance of the import)."
)
#: A power of ten that rounding has just missed is one.
_LAST_BIT = 1e-9
#: Channels as a sentence has them.
_ERRORS_OF = {
    "wrench": "the error of the wrench", "twist": "the error of the direction of motion",
    "pose": "the error of the final pose, push by push,", "stability": "the share of wrong labels of stability",
}  # fmt: skip
#: Changes of the friction below this (%) count as zero.
_ALIKE = 0.5
#: Units of parameters as people say them: factor and unit.
_SHOWN = {
    "m": (1e3, " mm"), "rad": (180 / math.pi, " deg"), "s": (1e3, " ms"), "kg": (1.0, " kg"), "N": (1.0, " N"), "1": (1.0, ""),
    "1/m": (100.0, " % per m"), "1 per e-fold of speed": (100.0, " %"), "1, first to last trial": (100.0, " %"),
    "support": (1.0, " points"), "degree": (1.0, ""),
}  # fmt: skip


def sentence_of(likelihood: Likelihood, judged: Judgement, ranking: list[RankedEffect], loads: FloatArray) -> str:
    """The answer in a sentence: which cause is present, with its numbers, and how far the gap falls once that is corrected.

    ``loads`` (k,): friction loads (N) of the points, refitted.
    """
    verdict, known = judged.verdict, {entry.effect: entry for entry in ranking}
    refitted = {gap.channel: gap.refitted for gap in judged.gaps} if judged.effects else {}
    nearer = _nearer(judged.effects, judged.reductions, judged.touch, refitted)
    causes = {id: _cause(likelihood, known[id]) for id in judged.effects}
    if verdict == "none":
        if likelihood.wrench is None:
            carried = any(entry.channel in ("stability", "pose") for entry in judged.reductions)
            seen = "No cause stands out from the scatter of the poses" if carried else "Nothing stands out"
            return f"{seen}; without forces little more is identifiable."
        if likelihood.experiment.rig.noise is None:
            return (
                "The nominal simulation fits as well as one with a refitted pressure, and no cause stands out from the scatter."
            )
        return "The nominal simulation fits within the noise."
    if verdict == "absorbed":
        return f"{_friction(likelihood, loads, judged.reductions)}, and no other cause stands out{nearer}."
    certain = "; ".join(words for id, words in causes.items() if id not in judged.apart)
    if verdict == "named":
        return f"{certain}{nearer}."
    if verdict == "ambiguous":
        numbered = "; ".join(f"({number}) {causes[id]}" for number, id in enumerate(judged.apart, 1))
        named = " from ".join(judged.apart)
        if certain:
            return f"{certain}. Besides, this log cannot tell {named}; one alone would explain what is left: {numbered}{nearer}."
        return f"This log cannot tell {named}; one alone would explain it: {numbered}{nearer}."
    raise AssertionError(verdict)


def _friction(likelihood: Likelihood, loads: FloatArray, reductions: Sequence[GapReduction]) -> str:
    """How the friction of a refitted surface differs from the nominal one."""
    if likelihood.wrench is None:
        return "The friction under the object differs from the nominal one"
    total, nominal = float(likelihood.prior.of_last(loads).sum()), float(likelihood.prior.of_last(likelihood.prior.nominal).sum())
    size = f"{total:.3g} N in all" + (
        f", a coefficient of {total / likelihood.experiment.weight:.3g}" if likelihood.experiment.weight else ""
    )
    change = 100 * (total / nominal - 1)
    if not likelihood.experiment.known_scale:
        return f"The friction under the object differs from the nominal one ({size})"
    more = f"{abs(change):.2g} % {'more' if change > 0 else 'less'} than believed"
    told = "which is as believed" if abs(change) < _ALIKE else more
    # what explains the gap is where the friction acts, unless the change of its size is half as large as the gap or more
    gap = next((math.sqrt(max(0.0, e.before**2 - e.after**2)) for e in reductions if e.channel == "wrench"), 0.0)
    if abs(change) < _ALIKE or abs(total - nominal) < _MUCH * gap:
        return f"The friction under the object is spread otherwise than the nominal one ({size}, {told})"
    return f"The friction under the object differs from the nominal one ({size}, {told})"


def _nearer(effects: Sequence[str], reductions: Sequence[GapReduction], touch: float, refitted: Mapping[str, float]) -> str:
    """How far the correction reduces the gap, of the channel that the causes act on, or else in which it shows best. What a
    refit of the surface without any cause leaves (by channel) is told where it does much of that."""
    certain = {e.channel for e in reductions if e.ci95[0] > 0} | {"touch"}
    shares = [(e.channel, e.closed) for e in reductions if e.before > _NEARER * e.after] + [("touch", touch)]
    shares = [(channel, share) for channel, share in shares if share > _REPORTED]
    # the channel in which it shows best, one whose share is known; of those that are alike, the first
    shares.sort(key=lambda entry: (entry[0] not in certain, -round(entry[1], 1)))
    # but the one that the causes act on, where that is known to be nearer
    shares.sort(key=lambda entry: entry[0] != _acts_on(effects) or entry[0] not in certain)
    # a gap within the noise is none, if there is another
    gaps = {e.channel for e in reductions if e.before > e.noise_floor} | {"touch"}
    shares.sort(key=lambda entry: entry[0] not in gaps)
    if not shares:
        return ""
    channel, share = shares[0]
    explained = f"{100 * share:.0f} % of the mean square gap"
    if channel == "touch":
        return f"; so corrected, {explained} in how fingers touch is explained"
    entry = next(e for e in reductions if e.channel == channel)
    factor, unit = shown_unit(entry.unit)
    before, after, floor = (f"{factor * size:.3g}" for size in (entry.before, entry.after, entry.noise_floor))
    left = entry.after / entry.noise_floor if entry.noise_floor > 0 else 0.0
    more = f", what is left is {left:.0f} times the floor" if left > _LEFT else ""
    others = [e for e in reductions if e.channel != channel and e.after > _LEFT * e.noise_floor > 0]
    for other in others:
        least = other.after / other.noise_floor
        part = f"of {_ERRORS_OF[other.channel]} {100 * other.closed:.0f} %"
        none = f"{_ERRORS_OF[other.channel]} does not become smaller"
        more += f"; {part if round(100 * other.closed) > 0 else none}, what is left is {least:.0f} times the floor"
    alone = refitted.get(channel)
    much = alone is not None and entry.before**2 - alone**2 > _MUCH * (entry.before**2 - entry.after**2)
    # what a sensor reads wrongly moves no object: a refit is credited with all that it explains
    read = all(id in CATALOGUE and CATALOGUE[id].acts == "sensing" for id in effects)
    if alone is not None and much and (alone > entry.after or read):
        by_refit = 100 * share * min(1.0, (entry.before**2 - alone**2) / (entry.before**2 - entry.after**2))
        explained, more = explained + " is explained", f", {by_refit:.0f} % by refitting the surface alone{more}"
    else:
        explained += " is explained"
    return (
        f"; so corrected, {_ERRORS_OF[channel]} on pushes left out of the fit falls from {before} to {after}{unit} rms "
        f"({'within the noise' if entry.within_noise else f'floor {floor}{unit}'}): {explained}{more}"
    )


def _acts_on(effects: Sequence[str]) -> str:
    """The channel that effects of the catalogue act on, if it is the same for all; else blank."""
    # what the fingers do decides where the object goes
    channels = {CATALOGUE[id].shows_in if id in CATALOGUE else "" for id in effects}
    return channels.pop() if len(channels) == 1 else ""


def _cause(likelihood: Likelihood, entry: RankedEffect) -> str:
    """What acts, with the numbers of its parameters."""
    id = entry.effect
    experiment, kind = likelihood.experiment, likelihood.experiment.effects[id]
    if kind.of_lab:
        numbers = "; ".join(f"{name} {value}" for name, value in entry.parameters.items())
        return f"{id} ({kind.what}{f': {numbers}' if numbers else ''})"
    axes = uneven_axes(entry)
    if axes is not None:
        return f"{id}: the force sensor {axes}"
    if entry.form is not None:
        # the values of its parameters may be those at the origin of W, which may be far away
        places = experiment.observations.pose[:, :2]
        there = kind.where_pushed(entry.estimates, entry.form["coefficients"], places)
        if there:
            return f"{id}: {there}"
    if not entry.parameters or entry.by_terms:
        # the terms of its family say what its own form does not
        form = ", in a form that the catalogue does not have" if entry.form is not None else ""
        return f"{id}: {kind.what}{form}"
    words = kind.says.format(**{p.name: estimate_in_words(p, entry.parameters[p.name]) for p in kind.parameters})
    rig = experiment.rig
    believed = rig.contact_friction if kind.by_slip else rig.finger_radius if kind.of_radius else None
    if believed is not None:
        factor, unit = _SHOWN[kind.parameters[0].unit.partition(" ")[0]]
        words += f", where {factor * believed:.3g}{unit} was assumed"
    if kind.reshapes == "pressure" and rig.model is None and rig.slider.support is None:
        words += ", where an even pressure under the outline was assumed"
    if kind.by_slip and entry.form is not None:
        words += f"; it changes by {entry.form['coefficients'][0]:+.2g} over the log"
    return f"{id}: {words[0].lower()}{words[1:]}"


def estimate_in_words(parameter: Parameter, found: ParameterEstimate) -> str:
    """Estimates with the half width of their 95 % intervals, or the intervals that are lopsided, in units that people use."""
    factor, unit = _SHOWN.get(parameter.unit) or _SHOWN[parameter.unit.partition(" ")[0]]
    values = factor * np.atleast_1d(np.asarray(found.estimate, dtype=np.float64))
    bounds = factor * np.reshape(found.ci95, (-1, 2))
    half = float(np.ptp(bounds, axis=1).max()) / 2
    # as many decimals as two digits of the uncertainty have
    decimals = int(np.clip(1 - math.floor(math.log10(half) + _LAST_BIT), 0, 6)) if half > 0 else 3
    # no minus before nothing
    numbers = [f"{round(value, decimals) + 0.0:.{decimals}f}" for value in values]
    if len(numbers) > 1:
        return f"({', '.join(numbers)}) ± {half:.{decimals}f}{unit} (95 %)"
    low, high = bounds[0]
    if abs((low + high) / 2 - values[0]) > _LOPSIDED * half:
        ends = " to ".join(f"{round(end, decimals) + 0.0:.{decimals}f}" for end in (low, high))
        return f"{numbers[0]}{unit} (95 %: {ends})"
    return f"{numbers[0]} ± {half:.{decimals}f}{unit} (95 %)"


def _few(names: Sequence[str]) -> str:
    """The names of pushes, in brackets, if they are few."""
    return f" ({', '.join(names)})" if len(names) <= _NAMED_PUSHES else ""


def unexplained(
    off: list[ChannelGap],
    ranking: list[RankedEffect],
    slipping: int,
    pushes: int,
    tells: bool,
    lost: Mapping[str, float],
    few: tuple[int, int] | None,
) -> str:
    """What stands clear of the noise, and what is most likely, where no effect explains the gap.

    ``few``: pushes with forces that the log has, and that it must have before a cause of the table or the sensors can be named;
    None if it has enough.
    """
    sizes = [
        f"the {entry.channel} is off by {size_in_words(entry.nominal, entry.unit)}, "
        + (
            f"noise explains {size_in_words(entry.noise_floor, entry.unit, named=False)}"
            if entry.nominal > _LARGER * entry.noise_floor
            else f"which noise may explain in a row, but not in the means of pushes (p {max(entry.p_lack_of_fit, 1e-6):.1g})"
        )
        for entry in off
    ]
    words = ["No effect of the catalogue is shown to explain the gap" + (f": {', '.join(sizes)}" if sizes else "")]
    if slipping:
        words.append(f"fingers slipped in {slipping} of {pushes} pushes that should stick")
    if lost:
        most = 1000 * max(lost.values())
        words.append(
            f"{len(lost)} of {pushes} pushes{_few(list(lost))} ended up to {most:.3g} mm from where "
            "the nominal simulation has them"
        )
    # that a refit fits better is told elsewhere, and is no cause
    fitted = [e for e in ranking if e.effect not in CATALOGUE or CATALOGUE[e.effect].size]
    causes = [e for e in fitted if e.identifiable and e.probability >= _LIKELY]
    likely = [f"{e.effect} ({e.probability:.2f})" for e in causes[:_LISTED]]
    if likely:
        words.append(f"most likely {', '.join(likely)}")
    else:
        words.append(
            "wrong friction of the fingers or a misplaced contact is likely"
            if slipping
            else f"no effect of the catalogue has a probability above {100 * _LIKELY:g} %"
        )
    if few is not None:
        too_few = f"{few[0]} pushes with forces are too few to name a cause of the table or the sensors: {few[1]} are needed"
        return f"{'; '.join(words)}. {too_few}."
    return "; ".join(words) + (". The pushes of the next experiment would tell." if tells else ".")


def notes_on(log: PushLog, found: Attribution, effects: list[str], share: float, p_share: float, left_out: int) -> list[str]:
    """What is to be known of a log and what was found on it."""
    return [
        *_notes_on_rig(log.rig, found.likelihood),
        *_notes_on_rows(log, found, share, p_share, left_out),
        *_notes_on_causes(found, effects),
    ]


def _notes_on_rig(rig: Rig, likelihood: Likelihood) -> list[str]:
    """What the log or its rig does not say."""
    notes = []
    if (rig.extra or {}).get("effects"):
        notes.append("rig.json has effects: they are not part of the nominal simulation")
    if rig.noise is None:
        notes.append("rig.json has no noise: it was estimated from the residuals of a fit with a free pressure")
    if likelihood.wrench is None:
        notes.append("no forces: only what shows in the poses is identifiable")
    if not likelihood.clearance.is_seen:
        notes.append("no finger poses to compare with the outline: no clearances to show latency and contact geometry")
    elif rig.finger_radius is None:
        radius = 1000 * (likelihood.experiment.observations.finger_radius or 0.0)
        notes.append(
            f"rig.json has no finger radius: {radius:.2g} mm was used, the median distance of the fingers from the outline"
        )
    return notes


def _notes_on_rows(log: PushLog, found: Attribution, share: float, p_share: float, left_out: int) -> list[str]:
    """What stands out of the rows."""
    likelihood, notes = found.likelihood, []
    o = likelihood.experiment.observations
    if left_out:
        notes.append(
            f"the final pose{'s' if left_out > 1 else ''} of {left_out} push{'es were' if left_out > 1 else ' was'} not used: "
            "it cannot be simulated, or noise of the start dominates it"
        )
    far = _outliers(found)
    if far.any():
        pushes = [o.names[k] for k in np.unique(o.trial[far])]
        cause = (
            "they may be outliers of the sensor, or something acts there that no effect of the catalogue describes"
            if len(pushes) > _FEW_PUSHES * len(log)
            else "look at them first, they may be outliers of the sensor"
        )
        notes.append(
            f"forces of {np.count_nonzero(far)} of {far.size} rows, in {len(pushes)} of {len(log)} pushes{_few(pushes)}, "
            f"miss the fit by more than {_OUTLIER:g} times the usual residual: {cause}"
        )
    if not any(o.group):
        notes.append("no repeated pushes: the repeatability is unknown")
    if likelihood.wrench is not None and not likelihood.experiment.known_scale:
        notes.append("support friction or mass unknown: the nominal friction load was scaled to fit the log")
    if share > _TOLD_SHARE:
        notes.append(
            f"a Gaussian process of place, heading, order and speed could explain up to {100 * share:.0f} % of the residuals "
            f"(p {p_share:.2f})"
        )
    return notes


def _notes_on_causes(found: Attribution, effects: list[str]) -> list[str]:
    """What is to be known of the causes."""
    experiment, notes = found.likelihood.experiment, []
    kinds, off = experiment.effects, experiment.observations.off
    own = [id for id in found.named if kinds[id].of_lab]
    if own:
        notes.append(f"{', '.join(own)} is the lab's own: it is in no corrected rig or scene")
    formed = [id for id in found.named if id in found.model.families]
    if formed:
        notes.append(
            f"extra terms fitted for {', '.join(formed)} are in the ranking, but in no corrected rig or scene, because they are "
            "not simulated"
        )
    if not all(off) and any(kinds[id].of_radius for id in effects):
        side = ("left", "right")[off.index(1.0)]
        notes.append(
            f"the radius is that of the {side} finger alone, seen along the push: the other is as in rig.json; "
            "the corrected rig, which has one radius for both, does not include it"
        )
    for id in found.single:
        if experiment.logs > 1:
            notes.append(f"{id} does not act in all logs that would show it, so it is not named")
        else:
            notes.append(
                f"{id} acts in only one half of the pushes, so it is not named; diagnose a second log together with this one"
            )
    causes = [found.confounded_with, *found.confounded] if found.confounded and experiment.logs == 1 else []
    alone = [id for id in causes if kinds[id].varies]
    if alone and len(alone) < len(causes):
        others = ", ".join(id for id in causes if id not in alone)
        notes.append(
            f"a second log would separate {', '.join(alone)} from {others}: the former may vary between logs, the latter not"
        )
    if found.contact is not None:
        contact = found.contact
        notes.append(f"friction of the fingers from {contact.readings} of {contact.trials} pushes: {contact.in_words}")
    return notes


def _outliers(found: Attribution) -> np.ndarray:
    """Which rows (n,) have forces far off from those of their push, where these are few."""
    likelihood, o = found.likelihood, found.likelihood.experiment.observations
    if likelihood.wrench is None:
        return np.zeros(0, dtype=bool)
    rows = likelihood.rows_of(likelihood.wrench, found.final.residual).reshape(-1, 3).copy()
    for k in np.unique(o.trial):
        mine = np.flatnonzero(o.trial == k)
        if len(mine) >= _OF_PUSH:
            rows[mine] -= np.median(rows[mine], axis=0)
    unit = max(1.0, float(np.sqrt(robust_variance(rows**2))))
    far = np.asarray(np.abs(rows).max(axis=1) > _OUTLIER * unit)
    return far if far.mean() < _FEW else np.zeros_like(far)


def still_note(names: Sequence[str], pushes: int) -> str:
    """Which pushes, of the number of all, did not move the object."""
    return (
        f"the object does not move in {len(names)} of {pushes} pushes ({some_of(names)}), which are left out: "
        "if a plan was carried out, it had lost the object before"
    )


def turning_note(turning: int, rows: int) -> str:
    """How many rows do not count in the errors of the wrench."""
    return (
        f"the motion of {turning} of {rows} rows does not determine the load, within the noise: they are slow, or turn about a "
        "support point. The errors of the wrench leave them out"
    )


def suspicion_note(friction: float, nominal: float) -> str:
    """The note on fingers that moved in too few pushes for their friction to be named."""
    return (
        f"fingers slipped or crept at a tangential force of {friction:.3g} of the normal one, where friction of {nominal:.3g} "
        f"would hold them. Too few pushes show it for a name, but a corrected scene takes {friction:.3g}: "
        "a plan for less friction holds with more"
    )


def slipping_note(names: Sequence[str], pushes: int) -> str:
    """Which pushes, of the number of all, slipped though the nominal simulation calls them stable."""
    return (
        f"fingers slipped in {len(names)} of {pushes} pushes that the nominal simulation calls stable ({some_of(names)}): "
        "the friction of the fingers is wrong, or the contact misplaced"
    )
