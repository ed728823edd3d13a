"""Which of the pushes that could be made next separate two causes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from stablepush.core import first_least
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.diagnosis.remedy.candidates import Candidates, final_poses_of, loads_of
from stablepush.objects import EdgePush

#: Pushes proposed, repeats of each, and the least difference of the sum of squares between the causes for which they are worth
#: making.
_PROPOSED, _TIMES, _SEPARATED = 8, 2, 10.0
#: Directions of parameters whose information is this share of the greatest are not determined.
_RANK = 1e-9
#: Pushes whose information differs by less than this share are alike.
_ALIKE = 1e-6


def separating_pushes(likelihood: Likelihood, causes: Mapping[str, Fitted]) -> list[EdgePush]:
    """Return pushes that separate two effects, each as it was fitted, the most informative first, each twice: the diagnosis
    believes no single push. None if not even all of them would.

    Chosen one by one so that what is left of the difference of the two predictions, over the noise, is largest when either effect
    takes what values suit it better, as far as the log lets it (the T-criterion of Atkinson and Fedorov 1975, linearised).

    They are straight, and ``expected`` has the differences of the readings: of loads (N) and of clearances between fingers and
    outline (m), or without forces of final poses (m; turns times the radius of gyration).
    """
    candidates: Candidates = loads_of(likelihood) if likelihood.pose is None else final_poses_of(likelihood, likelihood.pose)
    if not candidates.entries:
        return []
    predicted, slopes, known = [], [], []
    for id, fitted in causes.items():
        size = len(fitted.values[id])
        small = candidates.small(id) * np.eye(size)
        predicted.append(candidates.readings(id, fitted, np.zeros(size)))
        slopes.append(np.stack([(candidates.readings(id, fitted, s) - predicted[-1]) / s.max() for s in small], axis=-1))
        at = sum(len(fitted.values[k]) for k in list(fitted.values)[: list(fitted.values).index(id)])
        spread = fitted.covariance[at : at + size, at : at + size]
        known.append(np.linalg.pinv(spread, rcond=_RANK, hermitian=True))
    # what cannot be simulated with either effect, or with a little more of it, is of no use
    numbers = [part.reshape(len(part), -1) for part in (*predicted, *slopes)]
    usable = np.flatnonzero(np.isfinite(np.column_stack(numbers)).all(axis=1))
    predicted, slopes = [part[usable] for part in predicted], [part[usable] for part in slopes]
    difference = predicted[0] - predicted[1]
    squares = (difference**2).sum(axis=1)
    gradients = [np.einsum("nrd,nr->nd", slope, difference) for slope in slopes]
    grams = [np.einsum("nrd,nre->nde", slope, slope) for slope in slopes]
    chosen: list[int] = []
    total, separation, gathered, informed = 0.0, 0.0, [np.zeros(len(k)) for k in known], list(known)
    while len(chosen) < min(_PROPOSED // _TIMES, len(squares)):
        left = np.full(len(squares), np.inf)
        for gradient, gram, b, a in zip(gradients, grams, gathered, informed, strict=True):
            slope, information = b + _TIMES * gradient, a + _TIMES * gram
            taken = np.einsum("nd,nde,ne->n", slope, np.linalg.pinv(information, rcond=_RANK, hermitian=True), slope)
            left = np.minimum(left, total + _TIMES * squares - taken)
        left[chosen] = -np.inf
        # of equally informative pushes, as at mirrored places: the first
        best = first_least(-left, _ALIKE * max(float(left.max()), _SEPARATED))
        separation = float(left[best])
        chosen.append(best)
        total += _TIMES * float(squares[best])
        gathered = [b + _TIMES * gradient[best] for b, gradient in zip(gathered, gradients, strict=True)]
        informed = [a + _TIMES * gram[best] for a, gram in zip(informed, grams, strict=True)]
    if separation < _SEPARATED:
        return []
    pushes = [replace(candidates.entries[usable[i]], expected=candidates.expected(difference[i])) for i in chosen]
    return [push for push in pushes for _ in range(_TIMES)]
