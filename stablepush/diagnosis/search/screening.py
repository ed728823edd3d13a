"""How effects fare in the search: tests of one, halves of the pushes in which it must act."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.search.folds import halves_of
from stablepush.effects import FITTED

#: A part of a log would show an effect if that should gain so much there.
_SHOWS = 6.0


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


def beyond_pressure(likelihood: Likelihood, aside: frozenset[str] = frozenset()) -> tuple[str, ...]:
    """Effects that a refitted pressure cannot take in, the lab's own behind the catalogue's; none that is set ``aside``."""
    effects = likelihood.experiment.effects
    own = [id for id, kind in effects.items() if kind.of_lab]
    return tuple(id for id in (*FITTED, *own) if effects[id].reshapes != "pressure" and id not in aside)


def replicates(likelihood: Likelihood, model: Model, id: str) -> bool:
    """Whether an effect lowers the sum of squares in each half of the pushes, and in each log that would show it.

    With the scores and the information of the trials of a part, and the estimate of all, the sum of squares there must fall.
    """
    experiment = likelihood.experiment
    if likelihood.wrench is None:
        return True
    others = likelihood.fit(model.without(id))
    test = likelihood.tests(others, True, [id], whole=id in model.families)[id]
    theta = test.estimate
    # scores are those that the step leaves
    score = test.scores + np.einsum("tij,j->ti", test.shares, theta)
    gain = 2 * score @ theta - np.einsum("i,tij,j->t", theta, test.shares, theta)
    expected = np.einsum("i,tij,j->t", theta, test.shares, theta)
    half = halves_of(experiment)[: len(gain)]
    parts = [half == k for k in range(2)]
    if experiment.logs > 1 and not experiment.per_log(id):
        parts += [experiment.log[: len(gain)] == k for k in range(experiment.logs)]
    # in the units of a gain
    scale = test.gain / max(float(expected.sum()), 1e-30)
    asked = [part for part in parts if scale * float(expected[part].sum()) > _SHOWS]
    return all(float(gain[part].sum()) > 0 for part in asked)
