"""Whether an effect could be as large as it was found: its sign and size, the errors of a fitted model, the design of the log."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.diagnosis.likelihood.score_test import ScoreTest

#: Effects whose estimates are more uncertain than this share of half of their range cannot be seen in a log.
_BLIND = 0.5
#: What an effect beside a nominal surface that was fitted to pokes must exceed. One that reshapes the surface: a share of half of
#: its plausible range. All: standard deviations of the surface's ensemble, which is too narrow after few pokes.
_OF_A_MODEL, _OF_ITS_ENSEMBLE = 0.3, 6.0


def possible(likelihood: Likelihood, id: str, estimate: FloatArray) -> bool:
    """Whether an estimate has the sign that the effect must have, and a size that matters."""
    kind, count = likelihood.experiment.effects[id], likelihood.experiment.size(id)
    own, terms = estimate[:count], estimate[count:]
    size = float(np.linalg.norm(own)) / kind.plausible
    if len(terms) and kind.family is not None:
        size = max(size, float(np.linalg.norm(terms)) / kind.family.plausible)
    return size > kind.least and kind.is_possible(own)


def exceeds_model_error(likelihood: Likelihood, id: str, estimate: FloatArray, fitted: Fitted) -> bool:
    """Whether an effect is beyond what pokes leave open of the nominal surface that was fitted to them.

    Each mode of the model's ensemble is what it would be as the effect: the least squares projection on its columns. Pushes
    whose headings hardly vary do not tell an effect of the table, or of the sensors, from the surface either.
    """
    experiment, wrench = likelihood.experiment, likelihood.wrench
    if experiment.rig.model is None:
        return True
    kind = experiment.effects[id]
    small = float(np.linalg.norm(estimate)) <= _OF_A_MODEL * kind.plausible
    if kind.reshapes and (experiment.open_modes.size or small):
        return False
    if wrench is None:
        return True
    changes, columns = wrench.of_modes(fitted.values), wrench.columns(id, fitted.loads, fitted.values, len(estimate))
    if not (changes.any() and columns.any()):
        return True
    modes = np.linalg.lstsq(columns, changes, rcond=None)[0]
    spread = modes @ modes.T
    return float(estimate @ np.linalg.pinv(spread, hermitian=True) @ estimate) > _OF_ITS_ENSEMBLE**2


def identifiable(likelihood: Likelihood, id: str, test: ScoreTest) -> bool:
    """Whether the pushes of a log, by their design, determine an effect to better than a share of its plausible range."""
    least = float(np.linalg.eigvalsh(test.information)[0])
    return least > (_BLIND * likelihood.experiment.effects[id].plausible) ** -2
