"""Steps over the catalogue, forward and back: effects enter one by one, judged by trials, with the surface refitted jointly."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from stablepush.core import first_least, order_with_ties
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.score_test import ScoreTest
from stablepush.diagnosis.search.family_wise import family_wise_p_values
from stablepush.diagnosis.search.plausibility import exceeds_model_error, identifiable, possible
from stablepush.diagnosis.search.screening import Screening, beyond_pressure
from stablepush.effects import FITTED

#: Effects that may act together, and that are fitted in a step.
MOST, _TRIED = 4, 4
#: Gains and scores (in log density) that differ by no more are alike.
ALIKE = 1e-6
#: Mean square of the residual clearances of the fingers, over their noise, from which two effects may hide each other.
_LACK = 4.0
#: Multiple of the demands on one effect that two at once must pass.
_TWO = 2.0
#: A further cause must gain this share of what those before it explain: what an effect of another form leaves is not another's.
#: The latter share where one of those has shown that its form is another than the catalogue's.
_FURTHER, _BESIDE_FORMS = 0.03, 0.06
#: What a term of a family must gain more, and the largest logarithm of the p-value of all of them.
_CHARGE, _LOG_P = 4.0, math.log(1e-3)
#: Standard errors of its own that an effect beside a nominal surface that was fitted to pokes must exceed: the pushes of a plan
#: are alike and share what the surface cannot take.
ERRORS = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """Where the steps are: the likelihood, whose fits begin at what was found, the model, its fit, how effects fared, and what
    the log gained by those that entered."""

    likelihood: Likelihood
    model: Model
    fit: Fitted
    screened: Mapping[str, Screening]
    explained: float = 0.0

    @property
    def least_gain(self) -> float:
        """What a further cause must gain of what is explained."""
        return (_BESIDE_FORMS if self.model.families else _FURTHER) * self.explained

    def noting(self, screened: Mapping[str, Screening]) -> Search:
        """Return the search with how further effects fared."""
        return replace(self, screened={**self.screened, **screened})


def steps(likelihood: Likelihood, aside: frozenset[str], progress: Callable[[str], None]) -> Search:
    """Return the effects of table, contact and sensors that act; none that is set ``aside``."""
    at = Search(likelihood, Model(), likelihood.fit(Model()), {})
    while len(at.model.effects) < MOST:
        progress(f"effects: {', '.join(at.model.effects) or 'none yet'}")
        candidates, screened = _entering(at, aside)
        at = at.noting(screened)
        if not candidates:
            candidates = _hidden(at, aside)
        if not candidates:
            candidates, screened = _in_other_forms(at, aside)
            at = at.noting(screened)
        if not candidates:
            break
        fit, model = candidates[first_least([-fit.score for fit, _ in candidates], ALIKE)]
        added = [id for id in model.effects if id not in at.model.effects]
        explained = at.explained + sum(at.screened[id].gain for id in added)
        likelihood = at.likelihood.beginning_at(fit)
        at = _with_families(replace(at, likelihood=likelihood, model=model, fit=likelihood.fit(model), explained=explained))
    return needed(at)


Candidates = list[tuple[Fitted, Model]]


def _entering(at: Search, aside: frozenset[str]) -> tuple[Candidates, dict[str, Screening]]:
    """Fits with a further effect that passes all that is demanded, and how effects fared."""
    likelihood, model, demands = at.likelihood, at.model, at.likelihood.demands
    tests = likelihood.tests(at.fit, True, [id for id in beyond_pressure(likelihood, aside) if id not in model.effects])
    p, screened, entering = family_wise_p_values(tests), {}, []
    for id, test in tests.items():
        screened[id] = _screened(likelihood, model, id, test, p[id])
        times = _times(likelihood, p[id])
        enough = min(test.gain, test.statistic) > max(demands.gain, at.least_gain) and times < np.inf
        beyond = screened[id].possible and exceeds_model_error(likelihood, id, test.estimate, at.fit)
        if enough and beyond and identifiable(likelihood, id, test):
            entering.append((test.gain, id, times))
    fits = []
    # of effects that explain as much, which are one on this log, the first of the catalogue
    order = order_with_ties([-gain for gain, *_ in entering], ALIKE)
    for _, id, times in [entering[k] for k in order[:_TRIED]]:
        fit = likelihood.fit(model.plus(id))
        better = likelihood.significantly_better(fit.density, at.fit.density, times=times)
        screened[id] = replace(screened[id], significantly_better=better)
        if better and (likelihood.experiment.rig.model is None or fit.errors_of(id) > ERRORS):
            fits.append((fit, model.plus(id)))
    return fits, screened


def _screened(likelihood: Likelihood, model: Model, id: str, test: ScoreTest, p: float) -> Screening:
    return Screening(model.effects, test.gain, test.statistic, p, possible(likelihood, id, test.estimate))


def _times(likelihood: Likelihood, p: float) -> float:
    """Factor on the thresholds of an effect whose family-wise p-value is too large; infinite if it is far too large."""
    demands = likelihood.demands
    if p <= demands.family_wise_p:
        return 1.0
    return demands.certain if p <= demands.waived_p else math.inf


def needed(at: Search) -> Search:
    """Return the causes without which the others, with their fit, explain the log clearly less."""
    likelihood = at.likelihood
    for id in at.model.effects:
        if len(at.model.effects) > 1:
            model = at.model.without(id)
            without = likelihood.fit(model)
            bound = likelihood.at_bound(id, at.fit.values[id])
            if bound or not likelihood.significantly_better(at.fit.density, without.density):
                test = likelihood.tests(without, True, [id])[id]
                screening = replace(
                    at.screened[id], given=model.effects, gain=test.gain, statistic=test.statistic, significantly_better=False
                )
                at = replace(at, model=model, fit=without).noting({id: screening})
    return at


def _with_families(at: Search) -> Search:
    """The fit with the terms of the families of effects that need them: heredity, simple forms first.

    A form that the catalogue does not have leaves residuals that follow what the effect depends on; another effect would take
    them.
    """
    likelihood, demands = at.likelihood, at.likelihood.demands
    for id in at.model.effects:
        if id in at.model.families or likelihood.experiment.effects[id].family is None or likelihood.wrench is None:
            continue
        test = likelihood.tests(at.fit, True, [id])[id]
        least = demands.gain + _CHARGE * (len(test.estimate) - 1)
        if min(test.gain, test.statistic) <= least or float(test.log_p(test.statistic)) > _LOG_P:
            continue
        model = at.model.with_family(id)
        fit = likelihood.fit(model)
        if likelihood.significantly_better(fit.density, at.fit.density):
            at = replace(at, model=model, fit=fit)
    return at


def _in_other_forms(at: Search, aside: frozenset[str]) -> tuple[Candidates, dict[str, Screening]]:
    """The fit with an effect whose own form does not show, but whose family does, if there is any: the one that gains most; and
    how families fared whose effects were fitted."""
    likelihood, model, demands = at.likelihood, at.model, at.likelihood.demands
    # what a nominal surface that was fitted to pokes cannot take, many terms of some family can
    if likelihood.wrench is None or likelihood.experiment.rig.model is not None:
        return [], {}
    asked = [id for id in _with_a_family(likelihood, aside) if id not in model.effects]
    tests = likelihood.tests(at.fit, True, asked, whole=True)
    p = family_wise_p_values(tests)
    passed = [
        id
        for id, test in tests.items()
        if min(test.gain, test.statistic) > max(demands.gain + _CHARGE * (len(test.estimate) - 1), at.least_gain)
        and p[id] <= demands.family_wise_p
        and possible(likelihood, id, test.estimate)
    ]
    screened = {}
    for id in sorted(passed, key=lambda id: -tests[id].gain)[:_TRIED]:
        larger = model.plus(id).with_family(id)
        fit = likelihood.fit(larger)
        better = likelihood.significantly_better(fit.density, at.fit.density, times=_TWO)
        screened[id] = Screening(model.effects, tests[id].gain, tests[id].statistic, p[id], True, better)
        if better:
            return [(fit, larger)], screened
    return [], screened


def _with_a_family(likelihood: Likelihood, aside: frozenset[str]) -> Sequence[str]:
    """Effects that may act in other forms than the catalogue's."""
    effects, beyond = likelihood.experiment.effects, beyond_pressure(likelihood, aside)
    return [id for id in beyond if effects[id].family is not None and id not in likelihood.nuisance]


def _hidden(at: Search, aside: frozenset[str]) -> Candidates:
    """Fits with two effects that hide each other in the clearances of the fingers, neither of which enters alone.

    Thicker fingers are farther from the outline, and a delay brings them seemingly nearer.
    """
    likelihood, model = at.likelihood, at.model
    clearance = likelihood.clearance
    # unless the rig states its noise, the residual that noise leaves in the clearances is unknown
    if len(model.effects) + 2 > MOST or likelihood.experiment.rig.noise is None:
        return []
    if clearance.lack_of_fit(likelihood.rows_of(clearance, at.fit.residual)) < _LACK:
        return []
    unasked = {*model.effects, *likelihood.nuisance, *aside}
    asked = [id for id in FITTED if clearance.shows(id) and id not in unasked]
    found = []
    for pair in combinations(asked, 2):
        both = likelihood.fit(model.plus(*pair))
        are_possible = all(possible(likelihood, id, both.values[id]) for id in pair)
        if are_possible and likelihood.significantly_better(both.density, at.fit.density, times=_TWO):
            found.append((both, model.plus(*pair)))
    return found
