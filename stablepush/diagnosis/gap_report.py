"""The diagnosis of a log: where the gap lies, which effect causes it, how far it shrinks, and what to try next."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.diagnosis.attribution import Attribution, attribute
from stablepush.diagnosis.equations import SIZES
from stablepush.diagnosis.motions import motions_of
from stablepush.diagnosis.observations import heading, observe
from stablepush.diagnosis.replay import replays
from stablepush.diagnosis.shrink import ends_are_off, explains_most, gap, hold_out, shrink
from stablepush.diagnosis.system import System, system_of
from stablepush.diagnosis.where import Finding, flexible_share, localise
from stablepush.effects import CATALOGUE
from stablepush.errors import InputError
from stablepush.logs import PushLog
from stablepush.models import IdealLimitSurface

VERDICTS = ("none", "absorbed", "named", "ambiguous", "unknown")
#: What is left counts as unknown if so much of it follows place, heading, order or speed, and it is so much larger than the
#: noise.
_UNKNOWN_SHARE, _UNKNOWN_P, _UNKNOWN_SIZE = 0.25, 0.03, 1.3
#: Residuals so many times the noise are no fit, whatever they follow.
_MISFIT = 4.0
#: Statistic of an effect at which it is as probable as not, and over which odds grow by e.
_EVEN, _ODDS = 18.0, 3.0
#: Effects whose estimates are more uncertain than this share of their range cannot be seen in a log.
_BLIND = 0.5
#: Half of the plausible range of the parameters as they are fitted.
_RANGES = {
    "anisotropy-world": 0.2, "anisotropy-object": 0.2, "speed-dependence": 0.15, "spatial-variation": 1.0, "drift": 0.3,
    "pressure-shift": 0.01, "pressure-spread": 0.35, "tilt": 0.05, "inertia": 3.0, "force-bias": 1.0, "force-rotation": 0.3,
    "frame-offset": 0.01, "latency": 0.3, "contact-geometry": 0.01, "contact-friction": 0.4,
}  # fmt: skip
_UNSEEN = {
    "anisotropy-world": "needs forces and pushes in several directions over the table",
    "anisotropy-object": "needs forces and pushes in several directions of the slider",
    "speed-dependence": "needs forces and pushes at different speeds",
    "spatial-variation": "needs forces and pushes at different places",
    "drift": "needs forces over many trials",
    "pressure-shift": "needs forces and moments",
    "pressure-spread": "needs moments of turning pushes",
    "tilt": "needs forces, headings that vary, and the slider's mass",
    "inertia": "needs forces while the speed changes",
    "force-bias": "needs forces and headings that vary",
    "force-rotation": "needs forces in directions that vary against the motion",
    "frame-offset": "needs moments, or fingers on several faces",
    "latency": "needs poses of pusher and slider at different speeds",
    "contact-geometry": "needs poses of the pusher and the radius of its fingers",
    "contact-friction": "needs forces while fingers slip along a face",
    "model-capacity": "needs forces of motions all round the limit surface",
}


@dataclass(frozen=True, slots=True, eq=False)
class GapReport:
    """The answer to a log; :meth:`to_json` gives ``diagnosis/1``.

    ``surface``: the mended limit surface (None without forces); ``effects``: what acts with its values, as the catalogue has
    them.
    """

    log: str
    trials: int
    channels: list[str]
    verdict: str
    named: list[str]
    gap: list[dict[str, Any]]
    where: list[Finding]
    ranking: list[dict[str, Any]]
    shrink: list[dict[str, Any]]
    worse: list[str]
    next_experiment: dict[str, Any]
    sentence: str
    notes: list[str]
    surface: IdealLimitSurface | None
    effects: dict[str, dict[str, Any]]
    residuals: dict[str, FloatArray] = field(repr=False)
    ends: dict[str, FloatArray] = field(repr=False)
    places: FloatArray = field(repr=False)
    poses: FloatArray = field(repr=False)
    loads: FloatArray = field(repr=False)
    headings: FloatArray = field(repr=False)
    orders: FloatArray = field(repr=False)

    def to_json(self) -> dict[str, Any]:
        """Return the ``diagnosis/1`` of the report."""
        return {
            "format": "diagnosis/1",
            "log": self.log,
            "trials": self.trials,
            "channels": self.channels,
            "gap": self.gap,
            "where": [
                {
                    "channel": f.channel, "component": f.component, "covariate": f.covariate,
                    "share": round(f.share, 4), "p_value": round(f.p_value, 4), "plot": None,
                }
                for f in self.where
            ],
            "verdict": self.verdict,
            "effects": self.named,
            "ranking": self.ranking,
            "shrink": self.shrink,
            "worse": self.worse,
            "next_experiment": self.next_experiment,
            "sentence": self.sentence,
            "notes": self.notes,
        }  # fmt: skip


def diagnose(log: PushLog, *, name: str = "", progress: Callable[[str], None] | None = None) -> GapReport:
    """Diagnose the gap between a log of real pushes and the nominal simulation that its rig describes.

    Parameters
    ----------
    log : PushLog
    name : str
        What the log is called in the report.
    progress : callable, optional
        Called with a few words on what is done.

    Returns
    -------
    GapReport
        A log of fewer than two pushes in which the slider moves gets the verdict ``"none"`` with a note that says so.
    """
    if not isinstance(log, PushLog):
        raise InputError(f"log: expected a PushLog, as of read_pushlog, got {type(log).__name__}")
    said = progress or (lambda _: None)
    said("reading")
    observations = observe(log)
    if len(np.unique(observations.trial)) < 2:
        return _too_little(log, name)
    pushes = replays(log, observations)
    all_pushes = len(pushes)
    forces = bool(observations.has_wrench.any())
    system: System
    if pushes and not forces:
        system = motions = motions_of(observations, log.rig, pushes)
        pushes = motions.pushes
    else:
        system = system_of(observations, log.rig)
        pushes = system.predictable(pushes)
    found = attribute(system, said)
    said("how far the gap shrinks")
    named = found.named
    held = hold_out(system, found, log, pushes)
    share, p_share, size = 0.0, 1.0, 0.0
    if system.has_wrench:
        left = system.observations.wrench - held.wrenches["after"]
        white = system.white(left).reshape(-1, 3)
        size = float(np.sqrt(np.median(white**2) / 0.455))
        share, p_share = flexible_share(system, white)
    unknown = share > _UNKNOWN_SHARE and p_share < _UNKNOWN_P and size > _UNKNOWN_SIZE
    if unknown and not explains_most(held):
        verdict, effects = "unknown", []
    elif found.rivals:
        verdict, effects = "ambiguous", list(dict.fromkeys([*named, *found.rivals]))
    elif named:
        verdict, effects = "named", named
    else:
        verdict, effects = ("absorbed" if found.absorbed else "none"), []
        # rows that hardly any model fits, and not because of a few of them; ends that are far off in many pushes
        if size > _MISFIT or (not forces and ends_are_off(held)):
            verdict = "unknown"
    said("where the gap lies")
    where = localise(system, system.observations.wrench - held.wrenches["before"]) if system.has_wrench else []
    closed = shrink(held)
    ranking = _ranking(system, found, effects)
    # poses alone tell the shape of the surface, not its size
    sized = system.has_wrench or (system.has_surface and bool(system.moving_weight))
    surface = system.surface(found.final.loads) if sized else None
    report_effects = {entry["effect"]: _plain(entry) for entry in ranking if entry["effect"] in effects}
    notes = _notes(log, system, found, share, p_share, all_pushes - len(pushes))
    return GapReport(
        log=name,
        trials=len(log),
        channels=[entry["channel"] for entry in closed],
        verdict=verdict,
        named=effects,
        gap=gap(system, held, pushes),
        where=where,
        ranking=ranking,
        shrink=closed,
        worse=[entry["channel"] for entry in closed if entry["after"] > 1.02 * entry["before"]],
        next_experiment=_next(system, found, effects, ranking),
        sentence=_sentence(verdict, effects, closed, system.has_wrench, log.rig.noise is not None),
        notes=notes,
        surface=surface,
        effects=report_effects,
        residuals={k: system.observations.wrench - v for k, v in held.wrenches.items()},
        ends=held.ends,
        places=np.reshape([push.end for push in pushes], (-1, 3)),
        poses=system.observations.pose,
        loads=system.observations.wrench,
        headings=heading(system.observations),
        orders=system.observations.order,
    )


def _too_little(log: PushLog, name: str) -> GapReport:
    """The answer to a log that can show nothing."""
    words = "the log has fewer than two pushes in which the slider is seen to move: nothing can be said"
    ranking = [
        {"effect": id, "probability": 0.02, "parameters": {}, "identifiable": False, "reason": _UNSEEN[id]} for id in CATALOGUE
    ]
    nothing = np.zeros((0, 3))
    after = {"separates": [], "pushes": [], "why": "more pushes in headings, places, speeds and faces that vary, in random order"}
    return GapReport(
        name, len(log), [], "none", [], [], [], ranking, [], [], after, f"{words[0].upper()}{words[1:]}.", [words], None, {}, {},
        {}, nothing, nothing, nothing, np.zeros(0), np.zeros(0),
    )  # fmt: skip


def _parameters(id: str, value: FloatArray, errors: FloatArray) -> dict[str, dict[str, Any]]:
    """Parameters of the catalogue, with 95 % intervals, from those that are fitted."""
    units = {p.name: p.unit for p in CATALOGUE[id].parameters}

    def entry(name: str, estimate: Any, low: Any, high: Any) -> dict[str, dict[str, Any]]:
        pairs = [list(p) for p in zip(low, high, strict=True)] if isinstance(estimate, list) else [low, high]
        return {name: {"estimate": estimate, "ci95": pairs, "unit": units[name]}}

    if id in ("anisotropy-world", "anisotropy-object"):
        size, error = float(np.hypot(*value)), float(np.sqrt((errors**2).mean()))
        direction = 0.5 * math.atan2(float(value[1]), float(value[0]))
        spread = min(math.pi / 2, 0.98 * error / max(size, 1e-9))

        def ratio(d: float) -> float:
            d = min(max(d, 0.0), 0.9)
            return math.sqrt((1 + d) / (1 - d))

        found = entry("ratio", ratio(size), ratio(size - 1.96 * error), ratio(size + 1.96 * error))
        return found | entry("direction", direction, direction - spread, direction + spread)
    name = CATALOGUE[id].parameters[0].name
    shift = 1.0 if id == "pressure-spread" else 0.0
    estimates = (value + shift).tolist()
    low, high = (value + shift - 1.96 * errors).tolist(), (value + shift + 1.96 * errors).tolist()
    if len(estimates) == 1:
        return entry(name, estimates[0], low[0], high[0])
    return entry(name, estimates, low, high)


def _ranking(system: System, found: Attribution, effects: list[str]) -> list[dict[str, Any]]:
    errors: dict[str, FloatArray] = {}
    at = 0
    for id in found.final.values:
        deviation = np.sqrt(np.maximum(np.diag(found.final.covariance), 0.0))
        errors[id] = deviation[at : at + SIZES[id]]
        at += SIZES[id]
    entries = []
    for id in CATALOGUE:
        probability, parameters, identifiable = 0.02, {}, False
        reason: str | None = _UNSEEN[id]
        if id == "contact-friction" and system.has_wrench:
            contact = found.contact
            if contact is not None and system.rig.contact_friction is not None:
                interval = [contact.estimate - 1.96 * contact.error, contact.estimate + 1.96 * contact.error]
                parameters = {"mu": {"estimate": contact.estimate, "ci95": interval, "unit": "1"}}
                identifiable, reason = True, None
                probability = 1 - min(1.0, 50 * contact.p_value) if contact.p_value < 1 else 0.02
        elif id == "model-capacity":
            if system.has_surface and "free" in found.scores:
                identifiable, reason = True, None
                probability = 0.3 if found.absorbed and not found.chosen else 0.05
        else:
            test = found.tests[id]
            estimate = test.estimate
            values = np.linalg.eigvalsh(test.information)
            blind = bool(values[0] <= 0 or 1 / math.sqrt(values[0]) > _BLIND * _RANGES[id])
            identifiable, reason = not blind, _UNSEEN[id] if blind else None
            if id in found.final.values:
                estimate, deviation = found.final.values[id], errors[id]
            else:
                deviation = np.full(SIZES[id], 1 / math.sqrt(values[0]) if values[0] > 0 else _RANGES[id])
            if id == "contact-geometry":
                estimate = estimate + (system.observations.finger_radius or 0.0)
            if id == "contact-friction":
                estimate = estimate + (system.rig.contact_friction or 0.0)
            parameters = _parameters(id, np.asarray(estimate), np.asarray(deviation))
            evidence = min(test.statistic, test.gain) - 2 * (SIZES[id] - 1)
            probability = 1 / (1 + math.exp(-max(-30.0, min(30.0, (evidence - _EVEN) / _ODDS))))
            if id in found.chosen:
                probability = max(probability, 0.9)
            elif id not in effects:
                probability = min(probability, 0.3)
        if id in effects and len(found.rivals):
            probability = min(
                probability, 1 / (1 + len(found.rivals)) if id in (*found.rivals, *found.chosen[-1:]) else probability
            )
        entries.append(
            {
                "effect": id,
                "probability": float(np.clip(probability, 0.001, 0.999)),
                "parameters": parameters,
                "identifiable": identifiable,
                "reason": reason,
            }
        )
    return sorted(entries, key=lambda entry: -entry["probability"])


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    return {name: parameter["estimate"] for name, parameter in entry["parameters"].items()}


def _next(system: System, found: Attribution, effects: list[str], ranking: list[dict[str, Any]]) -> dict[str, Any]:
    """The pushes that best separate the two causes most in play."""
    likely = [*effects, *(entry["effect"] for entry in ranking if entry["identifiable"])]
    pair = list(dict.fromkeys(id for id in likely if id in SIZES))[:2]
    if len(pair) < 2 or not system.has_wrench:
        why = "more pushes in headings, places, speeds and faces that vary, in random order"
        return {"separates": pair, "pushes": [], "why": why}
    from stablepush.diagnosis.candidates import separating_pushes

    values = {id: found.final.values.get(id, found.tests[id].estimate) for id in pair}
    pushes = separating_pushes(system, found.final.loads, values)
    why = f"{pair[0]} and {pair[1]} predict loads that differ most here, at the sizes estimated from this log"
    return {"separates": pair, "pushes": pushes, "why": why}


def _sentence(verdict: str, effects: list[str], shrink: list[dict[str, Any]], forces: bool, noise: bool) -> str:
    closed = next((entry for entry in shrink if entry["channel"] == "wrench"), shrink[0] if shrink else None)
    how = (
        ""
        if closed is None
        else f"; {100 * closed['closed']:.0f} % of the gap in the {closed['channel']} closes on held-out trials"
    )
    words = [CATALOGUE[id].what for id in effects]
    if verdict == "none":
        if not forces:
            seen = "Pushes end where the nominal simulation says, within their scatter" if shrink else "Nothing stands out"
            return f"{seen}; without forces little more can be said."
        if not noise:
            return "The nominal simulation fits as well as any pressure would, and no cause stands out of the scatter."
        return "The nominal simulation fits within the noise."
    if verdict == "absorbed":
        return f"The surface and friction differ from the nominal ones, and no other cause stands out{how}."
    if verdict == "named":
        return f"{'; '.join(f'{id} ({what})' for id, what in zip(effects, words, strict=True))}{how}."
    if verdict == "ambiguous":
        return f"This log cannot tell {' from '.join(effects)}{how}."
    return "A gap stays that no effect of the catalogue explains."


def _notes(log: PushLog, system: System, found: Attribution, share: float, p_share: float, left_out: int) -> list[str]:
    notes = []
    rig = log.rig
    if rig.noise is None:
        notes.append("the rig does not say how noisy it is: what a free pressure leaves was taken for noise")
    if not system.has_wrench:
        notes.append("no forces: only what shows in the poses can be said")
    if not any(len(rows) for _, rows in system.gap_rows):
        notes.append("no poses of fingers to compare with the outline: latency and contact geometry cannot be seen there")
    elif rig.finger_radius is None:
        radius = system.observations.finger_radius or 0.0
        notes.append(f"the rig does not say how thick fingers are: {1000 * radius:.2g} mm, as they usually are from the outline")
    if left_out:
        notes.append(f"{left_out} pushes end where noise takes them, such as past a corner: they were left out of the poses")
    if not any(system.observations.group):
        notes.append("no repeated pushes: the scatter of repeats is not known")
    if system.has_wrench and not system.known_scale:
        notes.append("friction of the support or mass unknown: the nominal load was scaled to the log")
    if share > 0.05:
        notes.append(
            f"a Gaussian process of place, heading, order and speed could explain up to {100 * share:.0f} % of what is left "
            f"(p {p_share:.2f})"
        )
    if found.contact is not None:
        notes.append(f"friction at the fingers from {found.contact.trials} trials that slip: {found.contact.estimate:.3f}")
    return notes
