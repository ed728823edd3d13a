"""A diagnosis carried back into a problem: plans are then made for the rig as it is."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
import shapely

from stablepush.core import FloatArray, InputError, PlanWarning
from stablepush.effects import CATALOGUE, KnownEffect
from stablepush.geometry import compose
from stablepush.io import Rig
from stablepush.objects import PushContact, Slider
from stablepush.planning.correction import Correction, SavedDiagnosis, likeliest, load_diagnosis
from stablepush.planning.problem import PlanningProblem, require_problem
from stablepush.planning.uncertainty import Uncertainty

#: Distance between outlines, over the radius, from which on sliders are not the same.
_OTHER = 0.1
#: The warning of a correction by a diagnosis that is "unknown".
_UNEXPLAINED = (
    "the diagnosis is unknown: its surface is fitted to the log, but something else is wrong, which no probability of a plan "
    "counts; settle the cause first, or try a plan's pushes one by one"
)
#: What is not drawn of each alternative: the rest is in the uncertainty.
_NOT_DRAWN = {"finger_radius": None, "contact_offset": None, "tracker_offset": None}
#: Standard errors on each side of a friction, and the least and most relative half-width that is left uncertain.
_ERRORS, _LEAST_WIDTH, _MOST_WIDTH = 2.0, 0.05, 0.9


class Diagnosed(Protocol):
    """What a diagnosis returns, as far as it matters here."""

    @property
    def corrected(self) -> Sequence[Correction]: ...
    @property
    def rig(self) -> Rig: ...


def correct(problem: PlanningProblem, report: Diagnosed | SavedDiagnosis | Sequence[Correction] | str | Path) -> PlanningProblem:
    """Return a problem with what a diagnosis found of the rig.

    - The limit surface, with its ensemble, takes the place of the problem's. Pressure that has shifted is part of it.
    - Friction of the fingers takes the place of that of all contacts, and two standard errors of it, at least 5 %, that of
      ``uncertainty.contact_friction``. Where a gap is not explained and no push has shown that friction, it stays, and is
      uncertain by 30 %.
    - ``finger_radius``, and fingers that are aside: contacts move along the y axis of their frames.
    - ``support_friction``, if the problem states none and its surface is in units of ``mu*N``: what the log's rig states, or the
      diagnosis found instead.
    - A tracker whose origin is off the centre of mass by ``d`` (in B) saw start and goal there: poses ``p`` become ``p * (-d)``.
    - ``effects``: what depends on heading, place, speed or time is added to the problem's, in place of that of the same id, and
      planned with. Effects of sensors are kept and change no plan.
    - Where causes cannot be separated, the problem takes the most probable one, and all of them as ``alternatives``: plans then
      succeed over all of them by their probability. By how much causes place slider or fingers otherwise goes into
      ``uncertainty``.

    A log of the corrected problem corrects it again: a diagnosis is carried into the problem that its log was made with, once.

    Parameters
    ----------
    problem : PlanningProblem
    report : GapReport, sequence of Correction, or path of a ``diagnosis/1``
        A diagnosis that is "unknown" is warned of (:class:`PlanWarning`): what is not explained is in no probability of a plan.

    Raises
    ------
    InputError
        If the diagnosis corrects nothing: a log of fewer than two pushes; or if it is of a slider of another outline.
    """
    require_problem(problem)
    if isinstance(report, str | Path):
        report = load_diagnosis(report)
    corrections, diagnosed, verdict, support_friction = _read(report)
    if verdict == "unknown":
        warnings.warn(PlanWarning(_UNEXPLAINED), stacklevel=2)
    if diagnosed is not None and _apart(diagnosed, problem.slider) > _OTHER * problem.slider.radius:
        file = report.path if isinstance(report, SavedDiagnosis) else ""
        raise InputError("slider", "expected a diagnosis of the scene's slider, its log has one of another outline", file=file)
    best = likeliest(corrections)
    contacts = [_moved(contact, best.contact_offset) for contact in problem.contacts]
    uncertainty = problem.uncertainty
    if best.contact_friction is not None:
        contacts = [PushContact(c.points, c.normals, best.contact_friction) for c in contacts]
    uncertainty = _of_friction(uncertainty, best, max(contact.mu for contact in contacts))
    start, goal = problem.start, problem.goal
    if best.tracker_offset is not None:
        back = np.array((*-best.tracker_offset, 0.0))
        start, goal = compose(start, back), compose(goal, back)
    effects = _with(problem.effects, best.effects)
    total = sum(entry.probability for entry in corrections)
    alternatives = []
    if len(corrections) > 1:
        uncertainty = _widened(uncertainty, best, problem.finger_radius, corrections)
        alternatives = [
            replace(entry, probability=entry.probability / total, effects=_with(problem.effects, entry.effects), **_NOT_DRAWN)
            for entry in corrections
        ]
    surface = best.surface or problem.surface
    # a slope needs newtons: the rig of the log says how many there are in a surface of no pokes
    sized = surface.force_unit == "N" or problem.support_friction is not None
    return problem.with_changes(
        surface=surface,
        support_friction=problem.support_friction if sized else support_friction or None,
        contacts=contacts,
        start=start,
        goal=goal,
        uncertainty=uncertainty,
        finger_radius=problem.finger_radius if best.finger_radius is None else best.finger_radius,
        effects=effects,
        alternatives=tuple(alternatives),
    )


def _read(
    report: Diagnosed | SavedDiagnosis | Sequence[Correction],
) -> tuple[Sequence[Correction], Slider | None, str, float | None]:
    """What is corrected, the slider of the log, the verdict and the support friction, where the report has them."""
    if isinstance(report, SavedDiagnosis):
        return report.corrected, report.slider, report.verdict, report.support_friction
    corrections, rig = getattr(report, "corrected", report), getattr(report, "rig", None)
    if not isinstance(corrections, Sequence):
        raise InputError("report", "expected a diagnosis, corrections or the path of a diagnosis/1", type(report).__name__)
    found = getattr(report, "support_friction", None)
    if rig is None:
        return corrections, None, "", found
    return corrections, rig.slider, str(getattr(report, "verdict", "")), found or rig.support_friction


def _apart(a: Slider, b: Slider) -> float:
    """How far (m) the outlines of two sliders are from each other."""
    return float(shapely.hausdorff_distance(a.polygon, b.polygon))


def _with(known: Sequence[KnownEffect], found: Sequence[KnownEffect]) -> tuple[KnownEffect, ...]:
    """Effects in the order of the catalogue; what was found takes the place of what was known."""
    by_id = {entry.effect.id: entry for entry in (*known, *found)}
    return tuple(by_id[id] for id in CATALOGUE if id in by_id)


def _moved(contact: PushContact, aside: float | None) -> PushContact:
    if not aside:
        return contact
    theta = float(contact.frame[2])
    across: FloatArray = aside * np.array((-math.sin(theta), math.cos(theta)))
    return PushContact(contact.points + across, contact.normals, contact.mu)


def _of_friction(uncertainty: Uncertainty, found: Correction, mu: float) -> Uncertainty:
    """What is left uncertain of the friction ``mu`` of the fingers: more than before where it was not estimated."""
    own = uncertainty.relative_friction
    if found.contact_friction_error is None:
        return uncertainty if found.contact_friction is None else replace(uncertainty, contact_friction=max(_LEAST_WIDTH, own))
    least = own if found.contact_friction is None else _LEAST_WIDTH
    return replace(uncertainty, contact_friction=max(least, min(_ERRORS * found.contact_friction_error / mu, _MOST_WIDTH)))


def _widened(uncertainty: Uncertainty, best: Correction, radius: float, corrections: Sequence[Correction]) -> Uncertainty:
    """Where the slider and the fingers are by the other causes is uncertain by the most probable one."""
    weights = np.array([entry.probability for entry in corrections])

    def deviation(off: list[FloatArray]) -> float:
        squares = np.array([float(np.sum(np.square(d))) for d in off])
        return float(np.sqrt(weights @ squares / weights.sum()))

    def origin(entry: Correction) -> FloatArray:
        return np.zeros(2) if entry.tracker_offset is None else entry.tracker_offset

    def thickness(entry: Correction) -> FloatArray:
        return np.array((radius if entry.finger_radius is None else entry.finger_radius,))

    apart = deviation([origin(entry) - origin(best) for entry in corrections]) / math.sqrt(2)
    apart = math.hypot(apart, deviation([thickness(entry) - thickness(best) for entry in corrections]))
    aside = max(abs((entry.contact_offset or 0.0) - (best.contact_offset or 0.0)) for entry in corrections)
    position, heading = uncertainty.start
    return replace(uncertainty, start=(math.hypot(position, apart), heading), contact_place=uncertainty.contact_place + aside)
