"""The diagnosis of a log: where the gap lies, what causes it, how far a corrected simulation reduces it, what to try next."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from stablepush.core import FloatArray, InputError, PlausibilityWarning, one_blas_thread
from stablepush.diagnosis.judge.gap_reduction import HeldOut, hold_out, reductions
from stablepush.diagnosis.judge.negligible import negligible_causes
from stablepush.diagnosis.judge.ranking import UNSEEN, rank
from stablepush.diagnosis.judge.simulated import Comparison, compare, less_simulated
from stablepush.diagnosis.judge.verdicts import judge, leaves_lost_pushes, refit_leaves_noise, stands_clear
from stablepush.diagnosis.judge.where import localise, residuals
from stablepush.diagnosis.likelihood.determined import determined_rows
from stablepush.diagnosis.likelihood.equations import SIZES
from stablepush.diagnosis.likelihood.motions import Motions, motions_of
from stablepush.diagnosis.likelihood.replay import Replay, replays
from stablepush.diagnosis.likelihood.system import System, log_rows, system_of
from stablepush.diagnosis.likelihood.together import join, observe_each, together_of
from stablepush.diagnosis.remedy.corrected import corrections, in_own_forms, of_last_log
from stablepush.diagnosis.results import GapReduction, NextExperiment, RankedEffect, Verdict
from stablepush.diagnosis.rows.observations import Observations, heading, observe
from stablepush.diagnosis.rows.stopped_sensors import without_stopped
from stablepush.diagnosis.search.attribution import Attribution, attribute
from stablepush.diagnosis.search.contact_friction import slip_friction, suspected_friction
from stablepush.diagnosis.search.finger_forces import finger_forces
from stablepush.diagnosis.search.slip import friction_from_poses, without_contradiction
from stablepush.diagnosis.telling.evidence import evidence
from stablepush.diagnosis.telling.one_push import of_one_push
from stablepush.diagnosis.telling.report import GapReport, beside, without_causes
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
from stablepush.effects import CATALOGUE, LabEffect, applicable, lab_effects
from stablepush.io import PushLog, Rig, unit_doubts
from stablepush.objects import SupportDistribution
from stablepush.surfaces import IdealLimitSurface

#: Forces are turned round if this share of pushes has forces that oppose the motion, of so many at least.
_OPPOSED, _FEWEST = 0.8, 3
#: The note on forces that, over all rows, do work like those of a motor.
_DRIVEN = (
    "on the whole the forces oppose the motion, as no friction does, and no cause is looked for: look at the signs, axes and "
    "units of forces and poses"
)
#: A share below this goes without saying.
_TOLD_SHARE = 0.05


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
        return without_causes(log, name, Verdict.UNKNOWN, [], [], f"{turned[0].upper()}{turned[1:]}.", [turned], UNSEEN)
    of_lab = lab_effects(effects)
    own, untested = applicable(of_lab, log_rows(observations), [effect.id for effect in effects])
    system, pushes, left_out = _equations(log, observations, own, comparison, number)
    if comparison is not None and not system.has_wrench and not pushes:
        return _only_compared(log, name, comparison)
    found, held = _found(system, log, pushes, progress)
    trivial = negligible_causes(system, found, held, log, pushes)
    if trivial:
        # what it took may be the shape of the surface, which is judged where no other effect acts
        found, held = _found_without(trivial, system, found, log, pushes, progress)
    stand_ins = found.chosen if leaves_lost_pushes(system, found, held, pushes) else []
    if stand_ins:
        found, held = _found_without(stand_ins, system, found, log, pushes, progress)
    judged = judge(system, found, held, log, pushes, comparison is not None and comparison.is_off)
    verdict, reported = judged.verdict, judged.effects
    # a change of all friction alike leaves the surface's shape as it is
    fits = found.scores
    reshaped = verdict == "absorbed" or ("free" in fits and system.significantly_better(fits["free"], fits["scaled"]))
    progress("where the gap lies")
    ends, trials_of_errors = held.ends.get("before", np.zeros((0, 3))), np.array([push.trial for push in pushes], dtype=int)
    where = localise(system, residuals(system, held.wrenches.get("before"), ends, trials_of_errors, held.floors))
    ranking = rank(system, found, reported)
    # poses alone determine the shape of the surface, not its size
    sized = system.has_wrench or (system.has_surface and bool(system.moving_weight))
    surface = _beside_effects(system, found) if sized else None
    # a rig has fingers of one radius
    of_rig = [id for id in found.named if id != "contact-geometry" or all(observations.off)]
    simulated_as = in_own_forms(system, found, ranking, reported)
    dropped = set(reported) - set(simulated_as[2])
    report_effects = {
        entry.effect: of_last_log(entry, system)
        for entry in simulated_as[1]
        if entry.effect in of_rig and entry.effect in CATALOGUE and entry.effect not in dropped
    }
    notes = notes_on(log, system, found, reported, judged.share, judged.p_share, left_out)
    if not system.has_wrench:
        untested = dict.fromkeys(of_lab, "forces")
    notes += [f"{id} was not tested: it needs {needs}" for id, needs in untested.items()]
    if trivial:
        notes.append(f"not named: {' or '.join(trivial)}, for it changes loads and poses by next to nothing")
    if stand_ins:
        notes.append(f"not named: {' or '.join(stand_ins)}, for pushes that were lost end as far from where it puts them")
    if comparison is not None:
        notes = [*comparison.notes(), *notes]
    if verdict == "absorbed" and system.has_wrench and not refit_leaves_noise(system, held):
        notes.append("a refitted surface leaves more of the wrench than noise: it is nearer, but not all of the gap")
    unexplained_wrench = any(entry.channel == "wrench" for entry in judged.clear)
    if verdict == "unknown" and unexplained_wrench and not any(observations.group) and judged.share < _TOLD_SHARE and not where:
        notes.append(
            "no dependence on place, heading, order or speed was found: repeat three pushes five times each; if they scatter, "
            "state more noise in rig.json, if they agree, an effect is missing"
        )
    after = _next(system, found, reported, ranking)
    lost = {observations.names[k]: far for k, far in judged.lost.items()}
    informing, needed = len(np.unique(system.observations.trial)), system.demands.fewest_pushes
    few = (informing, needed) if system.has_wrench and informing < needed else None
    sentence = (
        unexplained(judged.clear, ranking, len(judged.slipping), len(log), bool(after.pushes), lost, few)
        if verdict == "unknown"
        else sentence_of(system, judged, ranking, found.final.loads)
    )
    if verdict == "none" and not system.has_wrench and not pushes:
        sentence = NOT_COMPARED
    if verdict == "unknown" and judged.unnamed and found.named:
        sentence += f" Not named: {', '.join(found.named)}, for {judged.unnamed}."
    still = observations.still
    if still:
        notes.append(still_note(still, len(log)))
    if judged.slipping:
        notes.append(slipping_note([observations.names[k] for k in judged.slipping], len(log)))
    determined = determined_rows(system) if system.has_wrench else np.ones(len(system.observations.time), dtype=bool)
    turning = int(np.count_nonzero(~determined))
    if _TOLD_SHARE * len(determined) < turning < len(determined):
        notes.append(turning_note(turning, len(determined)))
    forces = finger_forces(system, found.final)
    nominal, suspected = log.rig.contact_friction, None
    if forces is not None and comparison is None and "contact-friction" not in reported:
        suspected = suspected_friction(forces, nominal, verdict == "unknown")
    if suspected is not None and nominal is not None:
        notes.append(suspicion_note(suspected[0], nominal))
        sentence += f" But fingers slipped or crept as with friction {suspected[0]:.3g}, where {nominal:.3g} was assumed."
    report = GapReport(
        log=name,
        trials=len(log),
        channels=[entry.channel for entry in judged.reductions],
        verdict=verdict,
        named=reported,
        gap=judged.gaps,
        where=where,
        ranking=ranking,
        reductions=judged.reductions,
        worse=[entry.channel for entry in judged.reductions if entry.after > 1.02 * entry.before],
        next_experiment=after,
        sentence=sentence + (f" The object does not move in {len(still)} of {len(log)} pushes." if still else ""),
        notes=notes,
        rig=_completed(log.rig, system, found),
        surface=surface if comparison is None else None,
        effects=report_effects,
        corrected=[]
        if comparison is not None
        else corrections(system, *simulated_as, reshaped, verdict in ("absorbed", "unknown"), suspected),
        evidence=evidence(system, found, ranking, reported, judged.unnamed),
        residuals={k: system.observations.wrench - v for k, v in held.wrenches.items()},
        ends=held.ends,
        places=np.reshape([push.end for push in pushes], (-1, 3)),
        poses=system.observations.pose,
        loads=system.observations.wrench,
        headings=heading(system.observations),
        orders=system.observations.order,
        speeds=np.linalg.norm(system.observations.twist[:, :2], axis=1),
        row_names=[observations.names[k] for k in system.observations.trial],
        end_names=[observations.names[push.trial] for push in pushes],
        fingers=forces if "contact-friction" in found.named else None,
        signatures=signatures(system, found.final, reported),
        estimates=estimates(system, found.final) if found.final.values else None,
        determined=determined,
        times=system.observations.time,
        suspected_friction=None if suspected is None else suspected[0],
        friction_level=_level(system, found.final.loads) if comparison is None else None,
        apart=judged.apart,
        untested=untested,
        remedies={id: effect.remedy for id, effect in own.items() if effect.remedy},
    )
    return replace(report, sentence=f"{report.sentence} {beside(log.rig).capitalize()}.") if report.surface_beside else report


def _level(system: System, loads: FloatArray) -> float | None:
    """Friction of a fit over the believed one; None where none is believed, or of several logs."""
    if not (system.has_wrench and system.known_scale) or loads.shape != system.nominal.shape:
        return None
    return float(loads.sum() / system.nominal.sum())


def gap_reductions_with(log: PushLog, effects: list[str]) -> list[GapReduction]:
    """Return the gap reduction, as ``reductions`` of a report, when it is known which effects act."""
    observations = observe(log)
    if len(np.unique(observations.trial)) < 2:
        return []
    system, pushes, _ = _equations(log, observations)
    chosen = [id for id in effects if id in SIZES and (id != "contact-friction" or not system.has_wrench)]
    final = system.fit(chosen, True)
    contact = slip_friction(system, final) if "contact-friction" in effects else None
    found = Attribution(chosen, [], "", False, True, final, {}, {}, contact, {})
    return reductions(hold_out(system, found, log, pushes))


def _equations(
    log: PushLog,
    observations: Observations,
    own: Mapping[str, LabEffect] = MappingProxyType({}),
    comparison: Comparison | None = None,
    number: np.ndarray | None = None,
) -> tuple[System, list[Replay], int]:
    """The equations of a log, the pushes whose final poses are measurements, and how many others the log has."""
    replayed = replays(log, observations, whole=comparison is not None)
    trials = {push.trial for push in replayed}
    if comparison is not None:
        observations, replayed = less_simulated(comparison, observations, replayed)
    if replayed and not observations.has_wrench.any():
        motions = motions_of(observations, log.rig, replayed)
        return motions, motions.pushes, len(trials - {push.trial for push in motions.pushes})
    system = system_of(observations, log.rig, own) if number is None else together_of(observations, log.rig, number, own)
    pushes, system.final_pose_noise = system.predictable(replayed)
    return system, pushes, len(trials - {push.trial for push in pushes})


def _found(system: System, log: PushLog, pushes: list[Replay], progress: Callable[[str], None]) -> tuple[Attribution, HeldOut]:
    """What acts on a log, and every push as fits to the others predict it."""
    found = attribute(system, progress)
    found = without_contradiction(system, found, pushes)
    if "contact-friction" not in found.named:
        found = replace(found, contact=friction_from_poses(system, found, pushes) or found.contact)
    progress("gap reduction")
    return found, hold_out(system, found, log, pushes)


def _found_without(
    ids: Sequence[str],
    system: System,
    first: Attribution,
    log: PushLog,
    pushes: list[Replay],
    progress: Callable[[str], None],
) -> tuple[Attribution, HeldOut]:
    """What acts on a log if these effects of a ``first`` answer are set aside."""
    system.aside = system.aside.union(ids)
    found, held = _found(system, log, pushes, progress)
    return replace(found, screened={**first.screened, **found.screened}), held


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
    why = dict.fromkeys(CATALOGUE, "these pushes cannot tell causes apart")
    off = comparison.is_off or stands_clear(comparison.gap())
    return without_causes(
        log, name, Verdict.UNKNOWN if off else Verdict.NONE, [comparison.gap()], [comparison.reduction()],
        comparison.sentence(), comparison.notes(), why,
    )  # fmt: skip


def _beside_effects(system: System, found: Attribution) -> IdealLimitSurface:
    """The refitted surface, less a shift of the pressure that is an effect."""
    if not found.moves_freely(system):
        return system.surface(found.final.loads)
    refit = found.refit(system)
    surface, (offset, _) = system.surface(refit.loads), system.moved_center(refit.loads, system.deviations(refit, True))
    support = SupportDistribution(surface.support.points - offset, surface.support.weights)
    return IdealLimitSurface(support, surface.friction_load, surface.characteristic_length)


def _completed(rig: Rig, system: System, found: Attribution) -> Rig:
    """The rig, with the friction and radius of its fingers from the log where it has none."""
    mu, radius = rig.contact_friction, rig.finger_radius
    values = found.final.values
    if mu is None and found.contact is not None:
        mu = found.contact.estimate
    elif mu is None and "contact-friction" in values:
        mu = max(0.0, system.mu + float(values["contact-friction"][0]))
    if radius is None and system.observations.finger_radius is not None and "contact-geometry" in values:
        radius = max(0.0, system.observations.finger_radius + float(values["contact-geometry"][0]))
    # an estimate has no more digits than these
    return replace(rig, contact_friction=_rounded(mu), finger_radius=_rounded(radius))


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")


def _next(system: System, found: Attribution, effects: list[str], ranking: list[RankedEffect]) -> NextExperiment:
    """The pushes that best separate the two most probable causes."""
    likely = [*effects, *(entry.effect for entry in ranking if entry.identifiable)]
    # loads of straight pushes carry no information on contact friction, final poses of slanting ones do
    unseen = {"contact-friction"} if system.has_wrench else set()
    pair = list(dict.fromkeys(id for id in likely if id in SIZES and id not in unseen))[:2]
    if found.confounded:
        pair = [found.confounded_with, found.confounded[0]]
    if any(id in system.own for id in pair):
        why = f"{' and '.join(pair)} are told apart by pushes in which what the lab's own effect follows varies"
        return NextExperiment(pair, [], why)
    # without loads and final poses there is nothing to choose pushes by
    if len(pair) < 2 or unseen & set(pair) or not (system.has_wrench or isinstance(system, Motions)):
        why = "make more pushes, at varied headings, places, speeds and faces, in random order"
        return NextExperiment(pair, [], why)
    from stablepush.diagnosis.remedy.separation import separating_pushes

    others = [id for id in found.chosen if id not in pair]
    pushes = separating_pushes(system, {id: system.fit([*others, id], found.free) for id in pair})
    why = f"{pair[0]} and {pair[1]} predict readings that differ most here, at the sizes estimated from this log"
    if not pushes:
        why = (
            f"no straight push of an edge by this pusher tells {pair[0]} from {pair[1]}: their readings differ by less than the "
            "noise; use another pusher, or measure one of the effects separately"
        )
    return NextExperiment(pair, pushes, why)
