"""What follows from a diagnosis: the corrected rig, its effects and surface, and the pushes to make next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from stablepush.diagnosis.judge.diagnosis import Diagnosis
from stablepush.diagnosis.remedy.corrected import corrections, in_own_forms, of_last_log
from stablepush.diagnosis.results import NextExperiment
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.effects import CATALOGUE, FITTED
from stablepush.io import Rig
from stablepush.objects import SupportDistribution
from stablepush.planning import Correction
from stablepush.surfaces import IdealLimitSurface


@dataclass(frozen=True, slots=True, eq=False)
class Remedy:
    """What to simulate and to plan with, and what to measure.

    ``rig``: with the friction and the radius of the fingers as the log has them where they were not known; ``surface``: the
    refitted limit surface without the effects; ``effects``: with their values, as the catalogue has them; ``corrected``: the rigs
    that are possible, for plans; ``after``: the next experiment.
    """

    rig: Rig
    surface: IdealLimitSurface | None
    effects: dict[str, dict[str, Any]]
    corrected: list[Correction]
    after: NextExperiment


def remedy_of(diagnosis: Diagnosis) -> Remedy:
    """Return what follows from a diagnosis. A comparison with another simulator's log corrects no rig."""
    found, verdict, reported = diagnosis.found, diagnosis.judged.verdict, diagnosis.judged.effects
    likelihood, experiment = found.likelihood, found.likelihood.experiment
    own, ranking, simulated = in_own_forms(found, diagnosis.ranking, reported)
    dropped = set(reported) - set(simulated)
    # a rig has fingers of one radius
    one_alone = not all(diagnosis.case.observations.off)
    kinds = experiment.effects
    of_rig = [id for id in found.named if not (one_alone and kinds[id].of_radius)]
    effects = {
        entry.effect: of_last_log(entry, experiment)
        for entry in ranking
        if entry.effect in of_rig and entry.effect in CATALOGUE and entry.effect not in dropped
    }
    rig, after = _completed(diagnosis.case.log.rig, found), _next_experiment(diagnosis)
    if diagnosis.case.comparison is not None:
        return Remedy(rig, None, effects, [], after)
    # poses alone determine the shape of the surface, not its size
    sized = likelihood.wrench is not None or (likelihood.prior.has_surface and bool(experiment.moving_weight))
    unexplained = verdict in ("absorbed", "unknown")
    corrected = corrections(own, ranking, simulated, diagnosis.reshaped, unexplained, diagnosis.suspected)
    return Remedy(rig, _beside_effects(found) if sized else None, effects, corrected, after)


def _beside_effects(found: Attribution) -> IdealLimitSurface:
    """The refitted surface, less a shift of the pressure that is an effect."""
    prior = found.likelihood.prior
    if not found.moves_freely:
        return prior.surface(found.final.loads)
    refit = found.refit
    surface = prior.surface(refit.loads)
    offset, _ = prior.moved_center(refit.loads, found.likelihood.deviations(refit, True))
    support = SupportDistribution(surface.support.points - offset, surface.support.weights)
    return IdealLimitSurface(support, surface.friction_load, surface.characteristic_length)


def _completed(rig: Rig, found: Attribution) -> Rig:
    """The rig, with the friction and radius of its fingers from the log where it has none."""
    mu, radius, experiment = rig.contact_friction, rig.finger_radius, found.likelihood.experiment
    if mu is None and found.contact is not None:
        mu = found.contact.estimate
    for id, value in found.final.values.items():
        kind = experiment.effects[id]
        if kind.by_slip and mu is None:
            mu = max(0.0, experiment.mu + float(value[0]))
        seen = experiment.observations.finger_radius
        if kind.of_radius and radius is None and seen is not None:
            radius = max(0.0, seen + float(value[0]))
    # an estimate has no more digits than these
    return replace(rig, contact_friction=_rounded(mu), finger_radius=_rounded(radius))


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")


def _next_experiment(diagnosis: Diagnosis) -> NextExperiment:
    """The pushes that best separate the two most probable causes."""
    found, likelihood = diagnosis.found, diagnosis.found.likelihood
    pair = _most_probable(diagnosis)
    if any(likelihood.experiment.effects[id].of_lab for id in pair):
        why = f"{' and '.join(pair)} are told apart by pushes in which what the lab's own effect follows varies"
        return NextExperiment(pair, [], why)
    # without loads and final poses there is nothing to choose pushes by
    if len(pair) < 2 or _unseen(diagnosis, pair) or (likelihood.wrench is None and likelihood.pose is None):
        why = "make more pushes, at varied headings, places, speeds and faces, in random order"
        return NextExperiment(pair, [], why)
    from stablepush.diagnosis.remedy.separation import separating_pushes

    others = found.model.without(*pair)
    # each in the form in which it was found
    fits = {id: likelihood.fit(replace(others.plus(id), families=found.model.families)) for id in pair}
    pushes = separating_pushes(likelihood, fits)
    why = f"{pair[0]} and {pair[1]} predict readings that differ most here, at the sizes estimated from this log"
    if not pushes:
        why = (
            f"no straight push of an edge by this pusher tells {pair[0]} from {pair[1]}: their readings differ by less than the "
            "noise; use another pusher, or measure one of the effects separately"
        )
    return NextExperiment(pair, pushes, why)


def _most_probable(diagnosis: Diagnosis) -> list[str]:
    """The two causes to tell apart."""
    found = diagnosis.found
    if found.confounded:
        return [found.confounded_with, found.confounded[0]]
    likely = [*diagnosis.judged.effects, *(entry.effect for entry in diagnosis.ranking if entry.identifiable)]
    fitted = [id for id in dict.fromkeys(likely) if id in FITTED]
    return [id for id in fitted if not _unseen(diagnosis, [id])][:2]


def _unseen(diagnosis: Diagnosis, effects: Sequence[str]) -> bool:
    """Whether loads of straight pushes carry no information on some effect: friction of the fingers, of which final poses of
    slanting ones have some."""
    return diagnosis.found.likelihood.wrench is not None and any(CATALOGUE[id].by_slip for id in effects if id in CATALOGUE)
