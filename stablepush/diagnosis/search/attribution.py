"""Which effects act: steps forward and back over the catalogue, judged by trials, with the surface refitted jointly."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely

from stablepush.core import FloatArray, first_least, order_with_ties
from stablepush.diagnosis.likelihood.equations import OF_PRESSURE, SIZES, Fitted, ScoreTest, Values
from stablepush.diagnosis.likelihood.system import IN_CLEARANCES, System
from stablepush.diagnosis.search.contact_friction import P_SLIP, ContactFriction, slip_friction
from stablepush.diagnosis.search.folds import folds_of, halves_of, predicted
from stablepush.diagnosis.search.plausibility import exceeds_model_error, identifiable, possible
from stablepush.diagnosis.search.reshaping import held_out_of_body, reshaping
from stablepush.effects import FAMILIES

#: Draws of the bootstrap of the greatest statistic.
_DRAWS = 999
#: Effects that may act together, and that are fitted in a step.
_MOST, _TRIED = 4, 4
#: Gains and scores (in log density) that differ by no more are alike.
_ALIKE = 1e-6
#: Alternatives are looked at if they gain at least this share of what the chosen effect gains.
_CONFOUNDED_GAIN = 0.5
#: An alternative that needs values beyond this many times half of their plausible range is none.
_MOST_PLAUSIBLE = 1.5
#: A cause that explains the log clearly better than a chosen one may have a family-wise p-value as large as this.
_P_BETTER = 0.05
#: Mean square of the residual clearances of the fingers, over their noise, from which two effects may hide each other.
_LACK = 4.0
#: Two effects at once must do so many times what one must.
_TWO = 2.0
#: A further cause must gain this share of what those before it explain: what an effect of another form leaves is not another's.
#: The latter share where one of those has shown that its form is another than the catalogue's.
_FURTHER, _BESIDE_FORMS = 0.03, 0.06
#: A part of a log would show an effect if that should gain so much there.
_SHOWS = 6.0
#: What a term of a family must gain more, and the largest logarithm of the p-value of all of them.
_CHARGE, _LOG_P = 4.0, math.log(1e-3)
#: An effect that is not so many of its standard errors from none is not named.
_VAGUE = 2.0
#: Standard errors of its own that an effect beside a nominal surface that was fitted to pokes must exceed: the pushes of a plan
#: are alike and share what the surface cannot take.
_ERRORS = 4.0
#: Effects that a refitted pressure cannot take in.
BEYOND_PRESSURE = tuple(id for id in SIZES if id not in OF_PRESSURE)


@dataclass(frozen=True, slots=True)
class Screening:
    """How an effect fared when the steps last tested it, beside the effects ``given``.

    ``gain`` and ``statistic`` as in :class:`ScoreTest`; ``family_wise_p``: how often some effect does as well where there is
    none; ``possible``: whether sign and size make sense; ``significantly_better``: whether the log density rises by enough over
    the scatter of pushes, None if it was not fitted.
    """

    given: tuple[str, ...]
    gain: float
    statistic: float
    family_wise_p: float
    possible: bool
    significantly_better: bool | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Attribution:
    """What acts on a log.

    ``chosen``: effects that act; ``confounded``: those that are confounded with one of them in this log, ``confounded_with``;
    ``free``: whether the refitted pressure is needed; ``final``: the fit with all of it; ``tests`` of all effects, each given
    the others that are chosen; ``scores`` by name: held-out log densities (trials,) of the nominal simulation and its
    refits; ``screened``: how effects fared that pressure cannot take in; ``single``: effects that stood out but act in one
    half of the pushes only, or not in all of several logs that would show them.
    """

    chosen: list[str]
    confounded: list[str]
    confounded_with: str
    recalibrated: bool
    free: bool
    final: Fitted
    tests: dict[str, ScoreTest]
    scores: dict[str, FloatArray]
    contact: ContactFriction | None
    screened: dict[str, Screening]
    single: Sequence[str] = ()

    @property
    def named(self) -> list[str]:
        """All effects that act."""
        slips = self.contact is not None and self.contact.p_value < P_SLIP and "contact-friction" not in self.chosen
        return [*self.chosen, "contact-friction"] if slips else list(self.chosen)

    def refit(self, system: System) -> Fitted:
        """Return the fit of any pressure, in place of a change of it that acts."""
        return system.fit([id for id in self.chosen if id not in OF_PRESSURE], True)

    def moves_freely(self, system: System) -> bool:
        """Whether the pressure has moved in another form than all of it alike: the shift beside a free pressure is arbitrary,
        and one that puts the centre of pressure outside the slider is impossible."""
        if "pressure-shift" not in self.chosen or self.free:
            return "pressure-shift" in self.chosen
        center = system.center + self.final.values["pressure-shift"][:2]
        return not shapely.MultiPoint(system.rig.slider.vertices).convex_hull.covers(shapely.Point(center))

    def slips(self, system: System) -> Values:
        """Return what the fingers' friction adds to the rig's, if it is known from forces and acts."""
        mu = system.rig.contact_friction
        if self.contact is None or mu is None or "contact-friction" not in self.named:
            return {}
        return {"contact-friction": self.contact.beside(mu)}


def beyond_pressure(system: System) -> tuple[str, ...]:
    """Effects that a refitted pressure cannot take in, those of the lab's own behind the catalogue's; none that was set aside."""
    return tuple(id for id in (*BEYOND_PRESSURE, *system.own) if id not in system.aside)


def attribute(system: System, progress: Callable[[str], None]) -> Attribution:
    """Find which effects act on a log."""
    chosen, current, screened = _steps(system, progress)
    single = [id for id in chosen if not _replicates(system, chosen, id)]
    # beside the others an effect may be left with values that are none, within their errors
    vague = [id for id in chosen if id not in system.opened and current.errors_of(id) < _VAGUE]
    if single or vague:
        chosen = [id for id in chosen if id not in (*single, *vague)]
        system.opened -= set(single)
        current = system.fit(chosen, True)
    chosen, current, rivals = _exchanged(system, chosen, current, screened)
    as_well = [rival for rival in rivals if rival.as_well]
    confounded_with = as_well[0].id if as_well else ""
    confounded = [rival.other for rival in as_well if rival.id == confounded_with]
    scores: dict[str, FloatArray] = {}
    recalibrated, free = False, True
    if system.has_surface:
        progress("held-out trials")
        folds = folds_of(system)
        scaled, refitted = (predicted(system, chosen, freely, folds) for freely in (False, True))
        scores = {"nominal": _nominal_density(system, chosen), "scaled": scaled.density, "free": refitted.density}
        certain = system.significantly_better(scores["free"], scores["scaled"])
        # which base the rest is judged on matters less than what is said: one standard error is enough
        free = system.significantly_better(scores["free"], scores["scaled"], 1.0)
        if free and chosen and system.has_wrench:
            # nor may a pressure that few pushes determine be far off in some rows, which a density of heavy tails forgives
            free = refitted.square < scaled.square
        recalibrated = certain or system.significantly_better(scores["scaled"], scores["nominal"])
        # beside a surface that was fitted to pokes no change of its shape is more than its error: a refit absorbs that
        if not chosen and not system.open_modes.size and (certain or system.rig.model is None):
            scores |= held_out_of_body(system, folds, certain)
            named, moved = reshaping(system, scores, certain)
            if named:
                chosen, confounded, free = named[:1], named[1:], False
                confounded_with = named[0]
            elif moved:
                # the pressure is fitted freely beside
                chosen = ["pressure-shift"]
    final = system.fit(chosen, free)
    small = [] if free else [id for id in chosen if not possible(system, id, final.values[id])]
    if small:
        # such an effect was large only where the surface was free to change
        chosen = [id for id in chosen if id not in small]
        system.opened -= set(small)
        confounded = [] if confounded_with in small else confounded
        final = system.fit(chosen, free)
    tests: dict[str, ScoreTest] = {}
    for id in chosen:
        # beside a free pressure nothing is left of what only moves it
        beside = free and id not in OF_PRESSURE
        others = system.fit([e for e in chosen if e != id], beside)
        tests |= system.tests(others, beside, [id], whole=id in system.opened)
    tests |= system.tests(final, free, [id for id in (*SIZES, *system.own) if id not in (*chosen, *confounded)])
    if confounded:
        # each in the place of the cause that it is confounded with
        tests |= system.tests(system.fit([e for e in chosen if e != confounded_with], free), free, confounded)
    return Attribution(
        chosen,
        confounded,
        confounded_with,
        recalibrated,
        free,
        final,
        tests,
        scores,
        slip_friction(system, final),
        screened,
        single,
    )


def _steps(system: System, progress: Callable[[str], None]) -> tuple[list[str], Fitted, dict[str, Screening]]:
    """Effects of table, contact and sensors that act: steps forward, then back, the surface refitted in each."""
    chosen: list[str] = []
    screened: dict[str, Screening] = {}
    demands, current = system.demands, system.fit([], True)
    explained = 0.0
    while len(chosen) < _MOST:
        progress(f"effects: {', '.join(chosen) or 'none yet'}")
        tests = system.tests(current, True, [id for id in beyond_pressure(system) if id not in chosen])
        family_wise_p = family_wise_p_values(tests)
        entering = []
        for id, test in tests.items():
            # factor on the thresholds of an effect whose family-wise p-value is too large
            waived = demands.certain if family_wise_p[id] <= demands.waived_p else np.inf
            times = 1.0 if family_wise_p[id] <= demands.family_wise_p else waived
            screening = Screening(
                tuple(chosen), test.gain, test.statistic, family_wise_p[id], possible(system, id, test.estimate)
            )
            screened[id] = screening
            least = max(demands.gain, _further(system) * explained)
            enough = min(screening.gain, screening.statistic) > least and times < np.inf
            beyond = screening.possible and exceeds_model_error(system, id, test.estimate, current)
            if enough and beyond and identifiable(system, id, test):
                entering.append((test.gain, id, times))
        fits = []
        # of effects that explain as much, which are one on this log, the first of the catalogue
        order = order_with_ties([-gain for gain, *_ in entering], _ALIKE)
        for _, id, times in [entering[k] for k in order[:_TRIED]]:
            fit = system.fit([*chosen, id], True)
            screened[id] = replace(
                screened[id], significantly_better=system.significantly_better(fit.density, current.density, times=times)
            )
            entered = screened[id].significantly_better and (system.rig.model is None or fit.errors_of(id) > _ERRORS)
            fits += [(fit, [id])] if entered else []
        candidates = fits or _masked(system, chosen, current)
        if not candidates:
            candidates, of_forms = _in_other_forms(system, chosen, current, explained)
            screened |= of_forms
        if not candidates:
            break
        current, added = candidates[first_least([-fit.score for fit, _ in candidates], _ALIKE)]
        explained += sum(screened[id].gain for id in added)
        chosen += added
        system.settle(current)
        current = _with_forms(system, chosen, system.fit(chosen, True))
    chosen, current = _needed(system, chosen, current, screened)
    return chosen, current, screened


def _needed(system: System, chosen: list[str], current: Fitted, screened: dict[str, Screening]) -> tuple[list[str], Fitted]:
    """The causes without which the others, with their fit, explain the log clearly less."""
    chosen = list(chosen)
    for id in list(chosen):
        if len(chosen) > 1:
            without = system.fit([e for e in chosen if e != id], True)
            if system.at_bound(id, current.values[id]) or not system.significantly_better(current.density, without.density):
                chosen.remove(id)
                system.opened -= {id}
                current = without
                test = system.tests(without, True, [id])[id]
                screened[id] = replace(
                    screened[id], given=tuple(chosen), gain=test.gain, statistic=test.statistic, significantly_better=False
                )
    return chosen, current


def _further(system: System) -> float:
    """Share of what is explained that a further cause must gain."""
    return _BESIDE_FORMS if system.opened else _FURTHER


def _replicates(system: System, chosen: Sequence[str], id: str) -> bool:
    """Whether an effect lowers the sum of squares in each half of the pushes, and in each log that would show it.

    With the scores and the information of the trials of a part, and the estimate of all, the sum of squares there must fall.
    """
    if not system.has_wrench:
        return True
    test = system.tests(system.fit([e for e in chosen if e != id], True), True, [id], whole=id in system.opened)[id]
    theta = test.estimate
    # scores are those that the step leaves
    score = test.scores + np.einsum("tij,j->ti", test.shares, theta)
    gain = 2 * score @ theta - np.einsum("i,tij,j->t", theta, test.shares, theta)
    expected = np.einsum("i,tij,j->t", theta, test.shares, theta)
    half = halves_of(system)[: len(gain)]
    parts = [half == k for k in range(2)]
    if system.logs > 1 and id not in system.each:
        parts += [system.log[: len(gain)] == k for k in range(system.logs)]
    # in the units of a gain
    scale = test.gain / max(float(expected.sum()), 1e-30)
    asked = [part for part in parts if scale * float(expected[part].sum()) > _SHOWS]
    return all(float(gain[part].sum()) > 0 for part in asked)


def _with_forms(system: System, chosen: Sequence[str], current: Fitted) -> Fitted:
    """The fit with the terms of the families of chosen effects, of those that need them: heredity, simple forms first.

    A form that the catalogue does not have leaves residuals that follow what the effect depends on; another effect would take
    them.
    """
    for id in chosen:
        if id in system.opened or id not in FAMILIES or not system.has_wrench:
            continue
        test = system.tests(current, True, [id])[id]
        terms = len(test.estimate)
        if (
            min(test.gain, test.statistic) <= system.demands.gain + _CHARGE * (terms - 1)
            or float(test.log_p(test.statistic)) > _LOG_P
        ):
            continue
        system.opened |= {id}
        fit = system.fit(chosen, True)
        if system.significantly_better(fit.density, current.density):
            current = fit
        else:
            system.opened -= {id}
    return current


def _in_other_forms(
    system: System, chosen: Sequence[str], current: Fitted, explained: float
) -> tuple[list[tuple[Fitted, list[str]]], dict[str, Screening]]:
    """The fit with an effect whose own form does not show, but whose family does, if there is any: the one that gains most; and
    how families fared whose effects were fitted."""
    # what a nominal surface that was fitted to pokes cannot take, many terms of some family can
    if not system.has_wrench or system.rig.model is not None:
        return [], {}
    asked = [id for id in FAMILIES if id not in chosen and id not in system.nuisance and id in beyond_pressure(system)]
    tests = system.tests(current, True, asked, whole=True)
    family_wise_p = family_wise_p_values(tests)
    passed = [
        id
        for id, test in tests.items()
        if min(test.gain, test.statistic)
        > max(system.demands.gain + _CHARGE * (len(test.estimate) - 1), _further(system) * explained)
        and family_wise_p[id] <= system.demands.family_wise_p
        and possible(system, id, test.estimate)
    ]
    screened = {}
    for id in sorted(passed, key=lambda id: -tests[id].gain)[:_TRIED]:
        system.opened |= {id}
        fit, test = system.fit([*chosen, id], True), tests[id]
        better = system.significantly_better(fit.density, current.density, times=_TWO)
        screened[id] = Screening(tuple(chosen), test.gain, test.statistic, family_wise_p[id], True, better)
        if better:
            return [(fit, [id])], screened
        system.opened -= {id}
    return [], screened


def _masked(system: System, chosen: list[str], current: Fitted) -> list[tuple[Fitted, list[str]]]:
    """Fits with two effects that hide each other in the clearances of the fingers, neither of which enters alone.

    Thicker fingers are farther from the outline, and a delay brings them seemingly nearer.
    """
    # unless the rig states its noise, the residual that noise leaves in the clearances is unknown
    if len(chosen) + 2 > _MOST or system.rig.noise is None or system.clearance_lack_of_fit(current) < _LACK:
        return []
    found = []
    asked = [id for id in IN_CLEARANCES if id not in chosen and id not in system.nuisance and id not in system.aside]
    for pair in combinations(asked, 2):
        both = system.fit([*chosen, *pair], True)
        makes_sense = all(possible(system, id, both.values[id]) for id in pair)
        if makes_sense and system.significantly_better(both.density, current.density, times=_TWO):
            found.append((both, list(pair)))
    return found


def family_wise_p_values(tests: Mapping[str, ScoreTest], seed: int = 0) -> dict[str, float]:
    """Return the family-wise p-value of each effect: how often, without effects, the smallest p-value of all is as small.

    The scores are linearised at the fit; trials keep their errors but for the sign, the same for all effects (the least
    p-value of Westfall and Young 1993 by the score bootstrap of Kline and Santos 2012). The signs of ``n`` trials that carry the
    information have ``2^(n-1)`` patterns apart from a common sign: no p-value is less than one of so many.
    """
    trials = max((len(test.scores) for test in tests.values()), default=0)
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), (_DRAWS, trials))
    least = np.zeros(_DRAWS)
    for test in tests.values():
        least = np.minimum(least, test.log_p(test.under_none(signs)))
    found = {id: float((1 + (least <= test.log_p(test.statistic)).sum()) / (1 + _DRAWS)) for id, test in tests.items()}
    return {id: max(p, min(1.0, 2.0 ** (1.0 - tests[id].informative_trials()))) for id, p in found.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Rival:
    """A cause ``other`` in the place of a chosen one, ``id``: the fit, its test and families (:attr:`System.opened`), and whether
    it explains the log clearly better, or about as well."""

    id: str
    other: str
    fit: Fitted
    screening: Screening
    opened: frozenset[str]
    better: bool
    as_well: bool


def _rivals(system: System, chosen: list[str], current: Fitted) -> list[_Rival]:
    """What would explain the log at least about as well in the place of a chosen cause."""
    found = []
    for id in chosen:
        others = [e for e in chosen if e != id]
        without = system.fit(others, True)
        tests = system.tests(without, True, [e for e in beyond_pressure(system) if e not in others])
        family_wise_p = family_wise_p_values(tests)
        for other in beyond_pressure(system):
            if other in chosen or tests[other].gain < _CONFOUNDED_GAIN * tests[id].gain:
                continue
            test = tests[other]
            if not possible(system, other, test.estimate):
                continue
            # what has more terms is compared with what may have them too
            before = system.opened
            if id in before and other in FAMILIES:
                system.opened |= {other}
            fit, opened = system.fit([*others, other], True), system.opened
            own = fit.values[other][: system.size(other, whole=False)]
            if float(np.linalg.norm(own)) <= _MOST_PLAUSIBLE * system.plausible(other):
                screening = Screening(tuple(others), test.gain, test.statistic, family_wise_p[other], True)
                better = (
                    min(test.gain, test.statistic) > system.demands.gain
                    and family_wise_p[other] <= _P_BETTER
                    and exceeds_model_error(system, other, test.estimate, without)
                    and identifiable(system, other, test)
                    and not system.at_bound(other, fit.values[other])
                    and fit.errors_of(other) >= (_VAGUE if system.rig.model is None else _ERRORS)
                    and system.significantly_better(fit.density, current.density)
                    and _replicates(system, [*others, other], other)
                )
                as_well = not system.significantly_better(current.density, fit.density)
                found.append(_Rival(id, other, fit, screening, opened - {id}, better, as_well))
            system.opened = before
    return found


def _exchanged(
    system: System, chosen: list[str], current: Fitted, screened: dict[str, Screening]
) -> tuple[list[str], Fitted, list[_Rival]]:
    """The chosen causes, their fit and rivals, after causes that explain the log clearly better have taken the place of others.

    The tests by which causes enter are linear: a cause may come first that is not the one.
    """
    rivals = _rivals(system, chosen, current)
    for _ in range(_MOST):
        better = [rival for rival in rivals if rival.better]
        if not better:
            break
        best = better[first_least([-rival.fit.score for rival in better], _ALIKE)]
        chosen = [best.other if id == best.id else id for id in chosen]
        current, system.opened = best.fit, best.opened
        screened[best.other] = replace(best.screening, significantly_better=True)
        chosen, current = _needed(system, chosen, current, screened)
        rivals = _rivals(system, chosen, current)
    return chosen, current, rivals


def _nominal_density(system: System, chosen: list[str]) -> FloatArray:
    """Log density (trials,) of the nominal loads, the friction as it is believed, with the effects fitted to a scaled surface."""
    fitted = system.fit(chosen, False)
    loads = system.nominal if system.known_scale else fitted.loads
    residual = system.residual(loads, fitted.values)
    return system.density(residual, np.ones(len(residual), dtype=bool))
