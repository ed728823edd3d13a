"""Causes that would explain a log in the place of those that were found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stablepush.core import first_least
from stablepush.diagnosis.likelihood.likelihood import Fitted
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.search.family_wise import family_wise_p_values
from stablepush.diagnosis.search.plausibility import exceeds_model_error, identifiable, possible
from stablepush.diagnosis.search.screening import Screening, beyond_pressure, replicates
from stablepush.diagnosis.search.steps import ALIKE, ERRORS, MOST, Search, needed

#: Alternatives are looked at if they gain at least this share of what the chosen effect gains.
_CONFOUNDED_GAIN = 0.5
#: Largest size of an alternative, over half of its plausible range.
_MOST_PLAUSIBLE = 1.5
#: A cause that explains the log clearly better than a chosen one may have a family-wise p-value as large as this.
_P_BETTER = 0.05
#: Least size of a named effect, in its standard errors.
VAGUE = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Alternative:
    """A cause ``other`` in the place of a chosen one, ``id``: the model, its fit and test, and whether it explains the log
    clearly better, or about as well."""

    id: str
    other: str
    model: Model
    fit: Fitted
    screening: Screening
    better: bool
    as_well: bool


def alternatives(at: Search, aside: frozenset[str]) -> list[Alternative]:
    """Return what would explain the log at least about as well in the place of a chosen cause."""
    return [found for id in at.model.effects for found in _in_place_of(id, at, aside)]


def _in_place_of(id: str, at: Search, aside: frozenset[str]) -> Sequence[Alternative]:
    likelihood, effects = at.likelihood, at.likelihood.experiment.effects
    others = at.model.without(id)
    without = likelihood.fit(others)
    asked = [e for e in beyond_pressure(likelihood, aside) if e not in others.effects]
    tests = likelihood.tests(without, True, asked)
    p, found = family_wise_p_values(tests), []
    for other in beyond_pressure(likelihood, aside):
        if other in at.model.effects or tests[other].gain < _CONFOUNDED_GAIN * tests[id].gain:
            continue
        test = tests[other]
        if not possible(likelihood, other, test.estimate):
            continue
        model = others.plus(other)
        # what has more terms is compared with what may have them too
        if id in at.model.families and effects[other].family is not None:
            model = model.with_family(other)
        fit = likelihood.fit(model)
        own = fit.values[other][: likelihood.experiment.size(other)]
        if float(np.linalg.norm(own)) > _MOST_PLAUSIBLE * effects[other].plausible:
            continue
        better = (
            min(test.gain, test.statistic) > likelihood.demands.gain
            and p[other] <= _P_BETTER
            and exceeds_model_error(likelihood, other, test.estimate, without)
            and identifiable(likelihood, other, test)
            and not likelihood.at_bound(other, fit.values[other])
            and fit.errors_of(other) >= (VAGUE if likelihood.experiment.rig.model is None else ERRORS)
            and likelihood.significantly_better(fit.density, at.fit.density)
            and replicates(likelihood, model, other)
        )
        as_well = not likelihood.significantly_better(at.fit.density, fit.density)
        screening = Screening(others.effects, test.gain, test.statistic, p[other], True)
        found.append(Alternative(id, other, model, fit, screening, better, as_well))
    return found


def exchanged(at: Search, aside: frozenset[str]) -> tuple[Search, list[Alternative]]:
    """Return the search, and the alternatives, after causes that explain the log clearly better have taken the place of others.

    The tests by which causes enter are linear: a cause may come first that is not the one.
    """
    found = alternatives(at, aside)
    for _ in range(MOST):
        better = [alternative for alternative in found if alternative.better]
        if not better:
            break
        best = better[first_least([-alternative.fit.score for alternative in better], ALIKE)]
        effects = [best.other if id == best.id else id for id in at.model.effects]
        screened = {best.other: replace(best.screening, significantly_better=True)}
        at = needed(replace(at, model=best.model.of(effects), fit=best.fit).noting(screened))
        found = alternatives(at, aside)
    return at, found
