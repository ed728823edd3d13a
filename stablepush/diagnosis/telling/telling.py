"""From a diagnosis and its remedy to the report: all words are made here."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.judge.diagnosis import Diagnosis
from stablepush.diagnosis.judge.verdicts import refit_leaves_noise
from stablepush.diagnosis.remedy.remedy import Remedy
from stablepush.diagnosis.rows.observations import heading
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.telling.evidence import evidence
from stablepush.diagnosis.telling.report import GapReport, beside
from stablepush.diagnosis.telling.signatures import estimates, signatures
from stablepush.diagnosis.telling.wording import (
    NOT_COMPARED,
    notes_on,
    sentence_of,
    slipping_note,
    still_note,
    suspicion_note,
    turning_note,
    unexplained,
)
from stablepush.effects import FINGER_FRICTION

#: A share below this goes without saying.
_TOLD_SHARE = 0.05
#: A channel whose error grows by less than this factor is as good as before.
_WORSE = 1.02


def report_of(diagnosis: Diagnosis, remedy: Remedy) -> GapReport:
    """Return the report of a diagnosis."""
    found, held, judged = diagnosis.found, diagnosis.held, diagnosis.judged
    o, likelihood = found.likelihood.experiment.observations, found.likelihood
    pushes, names = diagnosis.case.poses.pushes, diagnosis.case.observations.names
    suspected = diagnosis.suspected
    report = GapReport(
        log=diagnosis.case.name,
        trials=len(diagnosis.case.log),
        channels=[entry.channel for entry in judged.reductions],
        verdict=judged.verdict,
        named=judged.effects,
        gap=judged.gaps,
        where=diagnosis.where,
        ranking=diagnosis.ranking,
        reductions=judged.reductions,
        worse=[entry.channel for entry in judged.reductions if entry.after > _WORSE * entry.before],
        next_experiment=remedy.after,
        sentence=_sentence(diagnosis, remedy),
        notes=_notes(diagnosis),
        rig=remedy.rig,
        surface=remedy.surface,
        effects=remedy.effects,
        corrected=remedy.corrected,
        evidence=evidence(found, diagnosis.ranking, judged.effects, judged.unnamed),
        residuals={k: o.wrench - v for k, v in held.wrenches.items()},
        ends=held.ends,
        places=np.reshape([push.end for push in pushes], (-1, 3)),
        poses=o.pose,
        loads=o.wrench,
        headings=heading(o),
        orders=o.order,
        speeds=np.linalg.norm(o.twist[:, :2], axis=1),
        row_names=[names[k] for k in o.trial],
        end_names=[names[push.trial] for push in pushes],
        fingers=diagnosis.fingers if FINGER_FRICTION in found.named else None,
        signatures=signatures(likelihood, found.final, judged.effects),
        estimates=estimates(likelihood, found.final) if found.final.values else None,
        determined=_determined(diagnosis),
        times=o.time,
        suspected_friction=None if suspected is None else suspected[0],
        friction_level=_level(found) if diagnosis.case.comparison is None else None,
        apart=judged.apart,
        untested=dict(diagnosis.case.untested),
        remedies=_remedies(diagnosis),
    )
    return replace(report, sentence=f"{report.sentence} {beside(report.rig).capitalize()}.") if report.surface_beside else report


def _determined(diagnosis: Diagnosis) -> Any:
    """Rows (n,) whose motion determines the load; all without forces."""
    wrench = diagnosis.found.likelihood.wrench
    count = len(diagnosis.found.likelihood.experiment.observations.time)
    return np.ones(count, dtype=bool) if wrench is None else wrench.determined


def _remedies(diagnosis: Diagnosis) -> dict[str, str]:
    """What effects of the lab's own say to do."""
    effects = diagnosis.found.likelihood.experiment.effects
    return {id: kind.remedy for id, kind in effects.items() if kind.of_lab and kind.remedy}


def _level(found: Attribution) -> float | None:
    """Friction of a fit over the believed one; None where none is believed, or without forces."""
    likelihood, loads = found.likelihood, found.final.loads
    nominal: FloatArray = likelihood.prior.nominal
    if likelihood.wrench is None or not likelihood.experiment.known_scale:
        return None
    return float(loads.sum() / nominal.sum())


def _sentence(diagnosis: Diagnosis, remedy: Remedy) -> str:
    """The answer, in a few sentences."""
    case, found, judged = diagnosis.case, diagnosis.found, diagnosis.judged
    likelihood = found.likelihood
    words = _verdict_in_words(diagnosis, remedy)
    if judged.verdict == "none" and likelihood.wrench is None and not case.poses.pushes:
        words = NOT_COMPARED
    if judged.verdict == "unknown" and judged.unnamed and found.named:
        words += f" Not named: {', '.join(found.named)}, for {judged.unnamed}."
    nominal = case.log.rig.contact_friction
    if diagnosis.suspected is not None and nominal is not None:
        words += f" But fingers slipped or crept as with friction {diagnosis.suspected[0]:.3g}, where {nominal:.3g} was assumed."
    still = case.observations.still
    return words + (f" The object does not move in {len(still)} of {len(case.log)} pushes." if still else "")


def _verdict_in_words(diagnosis: Diagnosis, remedy: Remedy) -> str:
    case, found, judged = diagnosis.case, diagnosis.found, diagnosis.judged
    likelihood, names = found.likelihood, case.observations.names
    if judged.verdict != "unknown":
        return sentence_of(likelihood, judged, diagnosis.ranking, found.final.loads)
    informing = len(np.unique(likelihood.experiment.observations.trial))
    needed = likelihood.demands.fewest_pushes
    few = (informing, needed) if likelihood.wrench is not None and informing < needed else None
    lost = {names[k]: far for k, far in judged.lost.items()}
    return unexplained(judged.clear, diagnosis.ranking, len(judged.slipping), len(case.log), bool(remedy.after.pushes), lost, few)


def _notes(diagnosis: Diagnosis) -> list[str]:
    """What else is to be said, in the order in which it matters."""
    case, found, judged = diagnosis.case, diagnosis.found, diagnosis.judged
    names, pushes = case.observations.names, len(case.log)
    notes = notes_on(case.log, found, judged.effects, judged.share, judged.p_share, case.left_out)
    notes += [f"{id} was not tested: it needs {needs}" for id, needs in case.untested.items()]
    if diagnosis.trivial:
        notes.append(f"not named: {' or '.join(diagnosis.trivial)}, for it changes loads and poses by next to nothing")
    if diagnosis.stand_ins:
        stand_ins = " or ".join(diagnosis.stand_ins)
        notes.append(f"not named: {stand_ins}, for pushes that were lost end as far from where it puts them")
    if case.comparison is not None:
        notes = [*case.comparison.notes(), *notes]
    notes += _notes_on_the_gap(diagnosis)
    if case.observations.still:
        notes.append(still_note(case.observations.still, pushes))
    if judged.slipping:
        notes.append(slipping_note([names[k] for k in judged.slipping], pushes))
    determined = _determined(diagnosis)
    turning = int(np.count_nonzero(~determined))
    if _TOLD_SHARE * len(determined) < turning < len(determined):
        notes.append(turning_note(turning, len(determined)))
    nominal = case.log.rig.contact_friction
    if diagnosis.suspected is not None and nominal is not None:
        notes.append(suspicion_note(diagnosis.suspected[0], nominal))
    return notes


def _notes_on_the_gap(diagnosis: Diagnosis) -> list[str]:
    """What a refit leaves, and what to do where nothing explains the gap."""
    found, judged = diagnosis.found, diagnosis.judged
    likelihood, notes = found.likelihood, []
    if judged.verdict == "absorbed" and likelihood.wrench is not None and not refit_leaves_noise(likelihood, diagnosis.held):
        notes.append("a refitted surface leaves more of the wrench than noise: it is nearer, but not all of the gap")
    unexplained_wrench = judged.verdict == "unknown" and any(entry.channel == "wrench" for entry in judged.clear)
    repeats = any(diagnosis.case.observations.group)
    if unexplained_wrench and not repeats and judged.share < _TOLD_SHARE and not diagnosis.where:
        notes.append(
            "no dependence on place, heading, order or speed was found: repeat three pushes five times each; if they scatter, "
            "state more noise in rig.json, if they agree, an effect is missing"
        )
    return notes
