"""The diagnosis of a log: where the gap lies, what causes it, how far a corrected simulation reduces it, what to try next."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from stablepush.core import InputError, PlausibilityWarning, one_blas_thread
from stablepush.diagnosis.judge.diagnosis import Case, Diagnosis, diagnosis_of
from stablepush.diagnosis.judge.gap_reduction import HeldOut, hold_out, reductions
from stablepush.diagnosis.judge.negligible import negligible_causes
from stablepush.diagnosis.judge.other_simulator import Comparison, compare, less_simulated
from stablepush.diagnosis.judge.verdicts import judge, leaves_lost_pushes, stands_clear
from stablepush.diagnosis.likelihood.building import log_model
from stablepush.diagnosis.likelihood.experiment import log_rows
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.replay import replays
from stablepush.diagnosis.remedy.remedy import remedy_of
from stablepush.diagnosis.results import GapReduction, Verdict
from stablepush.diagnosis.rows.joined_logs import join, observe_each
from stablepush.diagnosis.rows.observations import Observations, observe
from stablepush.diagnosis.rows.stopped_sensors import without_stopped
from stablepush.diagnosis.search.attribution import Attribution, attribute
from stablepush.diagnosis.search.contact_friction import slip_friction
from stablepush.diagnosis.search.friction_from_poses import friction_from_poses, without_contradiction
from stablepush.diagnosis.telling.one_push import of_one_push
from stablepush.diagnosis.telling.report import GapReport, without_causes
from stablepush.diagnosis.telling.telling import report_of
from stablepush.effects import CATALOGUE, FINGER_FRICTION, LabEffect, applicable, lab_effects
from stablepush.io import PushLog, unit_doubts

#: Forces are turned round if this share of pushes has forces that oppose the motion, of this many at least.
_OPPOSED, _FEWEST = 0.8, 3
#: The note on forces that, over all rows, do work like those of a motor.
_DRIVEN = (
    "on the whole the forces oppose the motion, as no friction does, and no cause is looked for: look at the signs, axes and "
    "units of forces and poses"
)


def diagnose(
    log: PushLog | Sequence[PushLog],
    *,
    name: str | Sequence[str] = "",
    simulated: PushLog | None = None,
    effects: Sequence[LabEffect] = (),
    progress: Callable[[str], None] | None = None,
) -> GapReport:
    """Diagnose the gap between a log of real pushes and the nominal simulation that its rig describes.

    Parameters
    ----------
    log : PushLog or sequence of PushLog
        Several logs of one rig are diagnosed together: causes of the table, the sensors and the contact are shared, surfaces and
        drift are each log's own. A cause of which one log shows nothing, though it should, is not named. The corrected rig is
        that of the last log.
    name : str or sequence of str
        What the log, or each of them, is called in the report.
    simulated : PushLog, optional
        The same commands carried out by another simulator: its log is the nominal simulation. Trials match by ``group`` where
        both logs have it, else by ``trial``, rows by ``t``. An effect is what our model says it changes. The report then has no
        corrected rig: what differs is of the other simulator.
    effects : sequence of LabEffect, optional
        Effects of the lab's own, tested beside the catalogue and those that packages registered. They need a log with forces.
    progress : callable, optional
        Called with a few words on what is done.

    Returns
    -------
    GapReport
        A log of fewer than two pushes in which the slider moves gets the verdict ``"none"`` with a note that says so, or
        ``"unknown"`` if there are pushes that do not move it.
    """
    logs = [log] if isinstance(log, PushLog) else list(log) if isinstance(log, Sequence) else []
    strangers = [type(one).__name__ for one in logs if not isinstance(one, PushLog)]
    if strangers or not logs:
        raise InputError("log", "expected a PushLog, as of read_pushlog, or several", (strangers or [type(log).__name__])[0])
    if simulated is not None and not isinstance(simulated, PushLog):
        raise InputError("simulated", "expected a PushLog, as of read_pushlog", type(simulated).__name__)
    names = [name] if isinstance(name, str) else list(name or ())
    told: list[str] = []
    with one_blas_thread():
        for k, (one, words) in enumerate(map(without_stopped, logs)):
            logs[k], called = one, str(names[k]) if k < len(names) and names[k] else "log"
            for line in (*words, *unit_doubts(one)):
                told.append(f"{called}: {line}" if len(logs) > 1 else line)
                warnings.warn(PlausibilityWarning(called, line), stacklevel=2)
        if len(logs) > 1:
            report = _diagnose_together(logs, names, simulated, effects, progress)
        else:
            report = _diagnose(logs[0], names[0] if names else "", None, simulated, effects, progress)
    return replace(report, notes=[*told, *report.notes]) if told else report


def _diagnose_together(
    logs: Sequence[PushLog],
    names: Sequence[str],
    simulated: PushLog | None,
    effects: Sequence[LabEffect],
    progress: Callable[[str], None] | None,
) -> GapReport:
    if simulated is not None:
        raise InputError("simulated", "expected one log beside another simulator's", f"{len(logs)} logs")
    if not any(names):
        names = [f"log {k + 1}" for k in range(len(logs))]
    if len(names) != len(logs):
        raise InputError("name", f"expected a name for each of {len(logs)} logs", f"{len(names)}")
    joined, number = join(logs, names)
    report = _diagnose(joined, ", ".join(names), number, None, effects, progress)
    together = f"{len(logs)} logs, together: surface and drift are each log's own"
    forces = [
        name for name, log in zip(names, logs, strict=True) if np.isfinite(log.columns("fx", "fy", "tau")).all(axis=1).any()
    ]
    if not forces:
        together = f"{len(logs)} logs, together: without forces they share one surface"
    else:
        together += f"; the corrected rig is that of {forces[-1]}"
        without = [name for name in names if name not in forces]
        together += f"; {', '.join(without)} has no forces, and counts by its final poses alone" if without else ""
    notes = [together, *report.notes]
    if report.verdict == "unknown":
        notes.append("diagnose each log for itself: what acts in one of them is no cause that they share")
    return replace(report, logs=list(names), notes=notes)


def _diagnose(
    log: PushLog,
    name: str,
    number: np.ndarray | None,
    simulated: PushLog | None,
    effects: Sequence[LabEffect],
    progress: Callable[[str], None] | None,
) -> GapReport:
    """Diagnose a log, or joined logs: ``number`` (trials,) of the log of each trial."""
    progress = progress or (lambda _: None)
    progress("reading")
    case = _case(log, name, number, simulated, effects)
    if isinstance(case, GapReport):
        return case
    diagnosis = _judged(case, progress)
    return report_of(diagnosis, remedy_of(diagnosis))


def _case(
    log: PushLog, name: str, number: np.ndarray | None, simulated: PushLog | None, effects: Sequence[LabEffect]
) -> Case | GapReport:
    """The likelihood of a log and what belongs to it; the report of a log in which no cause can be told."""
    comparison = None if simulated is None else compare(log, simulated)
    if comparison is not None:
        if not comparison.can_name:
            return _only_compared(log, name, comparison)
        log = comparison.log
    observations = observe(log) if number is None else observe_each(log, number)
    if len(np.unique(observations.trial)) < 2:
        return of_one_push(log, name, observations) if comparison is None else _only_compared(log, name, comparison)
    turned = _turned_round(observations)
    if turned:
        return without_causes(log, name, Verdict.UNKNOWN, [], [], f"{turned[0].upper()}{turned[1:]}.", [turned])
    of_lab = lab_effects(effects)
    own, untested = applicable(of_lab, log_rows(observations), [effect.id for effect in effects])
    pushes = replays(log, observations, whole=comparison is not None)
    trials = {push.trial for push in pushes}
    if comparison is not None:
        observations, pushes = less_simulated(comparison, observations, pushes)
    likelihood, poses = log_model(observations, log.rig, pushes, own, number)
    if comparison is not None and likelihood.wrench is None and not poses.pushes:
        return _only_compared(log, name, comparison)
    left_out = len(trials - {push.trial for push in poses.pushes})
    if likelihood.wrench is None:
        untested = dict.fromkeys(of_lab, "forces")
    return Case(log, name, observations, poses, likelihood, comparison, untested, left_out)


def _judged(case: Case, progress: Callable[[str], None]) -> Diagnosis:
    """What acts on a log, and the verdict. A cause that no plan needs, or that leaves lost pushes where they are, is set aside:
    what it took may be the shape of the surface, which is judged where no other effect acts."""
    found, held = _found(case, progress)
    trivial = negligible_causes(found, held, case.log, case.poses)
    if trivial:
        found, held = _found(case, progress, found, trivial)
    stand_ins = found.chosen if leaves_lost_pushes(found, held, case.poses) else []
    if stand_ins:
        found, held = _found(case, progress, found, [*trivial, *stand_ins])
    is_off = case.comparison is not None and case.comparison.is_off
    judged = judge(found, held, case.log, case.poses, is_off)
    progress("where the gap lies")
    return diagnosis_of(case, found, held, judged, trivial, stand_ins)


def _found(
    case: Case, progress: Callable[[str], None], first: Attribution | None = None, aside: Sequence[str] = ()
) -> tuple[Attribution, HeldOut]:
    """What acts on a log, and every push as fits to the others predict it; without effects of a ``first`` answer that are set
    ``aside``."""
    found = attribute(case.likelihood, progress, frozenset(aside))
    found = without_contradiction(found, case.poses)
    if FINGER_FRICTION not in found.named:
        found = replace(found, contact=friction_from_poses(found, case.poses) or found.contact)
    if first is not None:
        found = replace(found, screened={**first.screened, **found.screened})
    progress("gap reduction")
    return found, hold_out(found, case.log, case.poses)


def gap_reductions_with(log: PushLog, effects: list[str]) -> list[GapReduction]:
    """Return the gap reduction, as ``reductions`` of a report, when it is known which effects act."""
    observations = observe(log)
    if len(np.unique(observations.trial)) < 2:
        return []
    likelihood, poses = log_model(observations, log.rig, replays(log, observations))
    fitted = [id for id in effects if CATALOGUE[id].size and (not CATALOGUE[id].by_slip or likelihood.wrench is None)]
    model = Model(tuple(fitted))
    final = likelihood.fit(model)
    contact = slip_friction(likelihood, final) if FINGER_FRICTION in effects else None
    found = Attribution(likelihood, model, [], "", False, final, {}, {}, contact, {})
    return reductions(hold_out(found, log, poses))


def _turned_round(observations: Observations) -> str:
    """What is to be said of forces that oppose the motion: friction never drives. Blank if most do not."""
    o = observations
    power = (o.wrench * o.twist).sum(axis=1)[o.has_wrench]
    names, rows = np.unique(o.trial[o.has_wrench], return_inverse=True)
    against = int((np.bincount(rows, power) < 0).sum()) if len(names) else 0
    if len(names) < _FEWEST or against < _OPPOSED * len(names):
        return _DRIVEN if float(power.sum()) < 0 else ""
    return (
        f"in {against} of {len(names)} pushes the force opposes the motion, as no push does: the sign of the forces seems to be "
        "turned round (expected: the force on the slider), and no cause is looked for"
    )


def _only_compared(log: PushLog, name: str, comparison: Comparison) -> GapReport:
    """How far a log is from another simulator's where no causes can be told."""
    why = "these pushes cannot tell causes apart"
    off = comparison.is_off or stands_clear(comparison.gap())
    return without_causes(
        log, name, Verdict.UNKNOWN if off else Verdict.NONE, [comparison.gap()], [comparison.reduction()],
        comparison.sentence(), comparison.notes(), why,
    )  # fmt: skip
