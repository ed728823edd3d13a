"""What a diagnosis says in words: its sentence, and its notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stablepush.diagnosis.attribution import Attribution
from stablepush.diagnosis.equations import robust_variance
from stablepush.diagnosis.results import ChannelGap, GapReduction, RankedEffect, readable
from stablepush.diagnosis.system import System
from stablepush.effects import CATALOGUE
from stablepush.io import PushLog

#: Effects that are another in each log.
_EACH_LOG = ("drift", "pressure-shift", "pressure-spread", "anisotropy-object")
#: Trials and effects that a sentence lists at most, and the least probability of an effect that one lists.
_LISTED, _LIKELY = 3, 0.005
#: A sentence compares a size with the noise if it is so many times as large: means over pushes may be off by less.
_LARGER = 1.2
#: Whitened residuals of a row that is an outlier, and the share of rows that may be outliers.
_OUTLIER, _FEW = 6.0, 0.1
#: A sentence names a channel whose gap is reduced by more than this share.
_REPORTED = 0.05
#: And if the gap itself becomes smaller by this factor: where it is within the noise its share is anything.
_NEARER = 1.02


def sentence_of(
    system: System,
    verdict: str,
    effects: list[str],
    ranking: list[RankedEffect],
    reductions: list[GapReduction],
    touch: float,
    noise: bool,
) -> str:
    forces = system.has_wrench
    # of the first channel that comes nearer: a cause need not show in all
    shares = {f"the {e.channel}": e.closed for e in reductions if e.before > _NEARER * e.after} | {"how fingers touch": touch}
    sizes = {f"the {entry.channel}": entry for entry in reductions}
    nearer = [(channel, share) for channel, share in shares.items() if share > _REPORTED]
    if effects and all(id in CATALOGUE and CATALOGUE[id].acts == "contact" for id in effects):
        # what the fingers do decides where the object goes
        nearer.sort(key=lambda entry: entry[0] != "the pose")
    how = ""
    if nearer:
        channel, share = nearer[0]
        how = f"; {100 * share:.0f} % of the mean square gap in {channel} is explained on held-out trials"
        if channel in sizes:
            entry = sizes[channel]
            # final poses in mm, the rest as it is
            factor, unit = (1000, " mm") if entry.unit == "m" else (1, "" if entry.unit == "1" else f" {entry.unit}")
            before, after, floor = (f"{factor * size:.3g}" for size in (entry.before, entry.after, entry.floor))
            how += f": the root mean square falls from {before} to {after}{unit}, the noise floor is {floor}"
    known = {entry.effect: entry for entry in ranking}
    words = []
    for id in effects:
        what = system.own[id].what if id in system.own else CATALOGUE[id].what
        numbers = "; ".join(f"{name} {value}" for name, value in known[id].parameters.items())
        words.append(f"{id} ({what}{f': {numbers}' if numbers else ''})")
    if verdict == "none":
        if not forces:
            carried = any(entry.channel in ("stability", "pose") for entry in reductions)
            seen = "No cause stands out from the scatter of the poses" if carried else "Nothing stands out"
            return f"{seen}; without forces little more is identifiable."
        if not noise:
            return (
                "The nominal simulation fits as well as one with a refitted pressure, and no cause stands out from the scatter."
            )
        return "The nominal simulation fits within the noise."
    if verdict == "absorbed":
        return f"The surface and friction differ from the nominal ones, and no other cause stands out{how}."
    if verdict == "named":
        return f"{'; '.join(words)}{how}."
    if verdict == "ambiguous":
        return f"In this log {' and '.join(effects)} are confounded{how}."
    raise AssertionError(verdict)


def unexplained(
    off: list[ChannelGap], ranking: list[RankedEffect], slipping: int, pushes: int, tells: bool, lost: Mapping[int, float]
) -> str:
    """What stands clear of the noise, and what is most likely, where no effect explains the gap."""
    sizes = [
        f"the {entry.channel} is off by {readable(entry.nominal)} {entry.unit}, "
        + (
            f"noise explains {readable(entry.noise_floor)}"
            if entry.nominal > _LARGER * entry.noise_floor
            else f"in whole pushes by more than noise explains (p {entry.p_lack_of_fit:.1g})"
        )
        for entry in off
    ]
    words = ["No effect of the catalogue explains the gap" + (f": {', '.join(sizes)}" if sizes else "")]
    if slipping:
        words.append(f"fingers slipped in {slipping} of {pushes} pushes that should stick")
    if lost:
        most = 1000 * max(lost.values())
        words.append(f"{len(lost)} of {pushes} pushes ended up to {most:.3g} mm from where the nominal simulation has them")
    likely = [f"{e.effect} ({e.probability:.2f})" for e in ranking if e.identifiable and e.probability >= _LIKELY][:_LISTED]
    if likely:
        words.append(f"most likely {', '.join(likely)}")
    else:
        words.append("wrong friction of the fingers or a misplaced contact is likely" if slipping else "no effect is likely")
    return "; ".join(words) + (". The pushes of the next experiment would tell." if tells else ".")


def notes_on(
    log: PushLog, system: System, found: Attribution, effects: list[str], share: float, p_share: float, left_out: int
) -> list[str]:
    notes = []
    rig = log.rig
    if (rig.extra or {}).get("effects"):
        notes.append("rig.json has effects: they are not part of the nominal simulation")
    if rig.noise is None:
        notes.append("rig.json has no noise: it was estimated from the residuals of a fit with a free pressure")
    if not system.has_wrench:
        notes.append("no forces: only what shows in the poses is identifiable")
    if not any(len(rows) for _, rows in system.clearance_rows):
        notes.append("no finger poses to compare with the outline: no clearances to show latency and contact geometry")
    elif rig.finger_radius is None:
        radius = system.observations.finger_radius or 0.0
        notes.append(
            f"rig.json has no finger radius: {1000 * radius:.2g} mm was used, the median distance of the fingers from the outline"
        )
    if left_out:
        notes.append(
            f"final poses of {left_out} pushes were not used: they cannot be simulated, or noise of the start dominates them"
        )
    far = _outliers(system, found)
    if far.any():
        pushes = len(np.unique(system.observations.trial[far]))
        notes.append(
            f"forces of {np.count_nonzero(far)} of {far.size} rows, in {pushes} of {len(log)} pushes, are off by more than "
            f"{_OUTLIER:g} times their noise: look at them before anything else, they may be outliers of the sensor"
        )
    if not any(system.observations.group):
        notes.append("no repeated pushes: the repeatability is unknown")
    if system.has_wrench and not system.known_scale:
        notes.append("support friction or mass unknown: the nominal friction load was scaled to fit the log")
    if share > 0.05:
        notes.append(
            f"a Gaussian process of place, heading, order and speed could explain up to {100 * share:.0f} % of the residuals "
            f"(p {p_share:.2f})"
        )
    own = [id for id in found.named if id in system.own]
    if own:
        notes.append(f"{', '.join(own)} is the lab's own: it is in no corrected rig or scene")
    formed = [id for id in found.named if id in system.opened]
    if formed:
        notes.append(
            f"extra terms fitted for {', '.join(formed)} are in the ranking, but in no corrected rig or scene, because they are "
            "not simulated"
        )
    off = system.observations.off
    if "contact-geometry" in effects and not all(off):
        side = ("left", "right")[off.index(1.0)]
        notes.append(
            f"the radius is that of the {side} finger alone, seen along the push: the other is as in rig.json; "
            "the corrected rig, which has one radius for both, does not include it"
        )
    for id in found.single:
        if system.logs > 1:
            notes.append(f"{id} does not act in all logs that would show it, so it is not named")
        else:
            notes.append(
                f"{id} acts in only one half of the pushes, so it is not named; diagnose a second log together with this one"
            )
    if found.confounded and system.logs == 1:
        causes = [found.confounded_with, *found.confounded]
        alone = [id for id in causes if id in _EACH_LOG]
        if alone and len(alone) < len(causes):
            others = ", ".join(id for id in causes if id not in alone)
            notes.append(
                f"a second log would separate {', '.join(alone)} from {others}: the former may vary between logs, the latter not"
            )
    if found.contact is not None:
        contact = found.contact
        notes.append(
            f"friction at the fingers from {contact.readings} of {contact.trials} trials that slip: {contact.estimate:.4g}"
        )
    return notes


def _outliers(system: System, found: Attribution) -> np.ndarray:
    """Which rows (n,) have forces far off, where these are few."""
    if not system.has_wrench:
        return np.zeros(0, dtype=bool)
    rows = found.final.residual[: 3 * len(system.observations.time)].reshape(-1, 3)
    unit = max(1.0, float(np.sqrt(robust_variance(rows**2))))
    far = np.asarray(np.abs(rows).max(axis=1) > _OUTLIER * unit)
    return far if far.mean() < _FEW else np.zeros_like(far)


def slipping_note(names: Sequence[str], pushes: int) -> str:
    """Which of so many pushes slipped though the nominal simulation calls them stable."""
    more = "" if len(names) <= _LISTED else f" and {len(names) - _LISTED} more"
    return (
        f"fingers slipped in {len(names)} of {pushes} pushes that the nominal simulation calls stable "
        f"({', '.join(names[:_LISTED])}{more}): the friction of the fingers is wrong, or the contact misplaced"
    )
