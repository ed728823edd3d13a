"""Score tests: what an effect that is not fitted would do, judged by the scatter of trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from stablepush.core import FloatArray

#: Directions of parameters whose information is this share of the greatest are not determined: below it a double has no digits.
RANK = 1e-9
#: Least logarithm of a p-value, where its formula underflows.
_LEAST_LOG = -500.0


@dataclass(frozen=True, slots=True, eq=False)
class ScoreTest:
    """What an effect that is not fitted would do.

    ``statistic``: of the trials' scores, about chi-squared with as many degrees as parameters when there is no effect; ``gain``:
    what the sum of squares, over its scale, would fall by; ``estimate`` (d,) of one step and its ``information`` (d, d);
    ``scores`` (trials, d) that are left after the step, and ``shares`` (trials, d, d) of the trials in the information.
    """

    statistic: float
    gain: float
    estimate: FloatArray
    information: FloatArray
    scores: FloatArray
    shares: FloatArray

    @classmethod
    def blind(cls, information: FloatArray, trial: np.ndarray) -> ScoreTest:
        """Of an effect that the log does not show."""
        d, trials = len(information), int(trial.max()) + 1 if len(trial) else 1
        return cls(0.0, 0.0, np.zeros(d), information, np.zeros((trials, d)), np.zeros((trials, d, d)))

    def under_none(self, signs: FloatArray) -> FloatArray:
        """Statistics (draws,) had the errors of the trials had other signs (draws, trials) and the effect been absent: a wild
        bootstrap of the scores, studentised in every draw."""
        total = self.shares.sum(axis=0)
        if not total.any():
            return np.zeros(len(signs))
        sums = signs @ self.scores
        steps = np.linalg.solve(total, sums.T).T
        left = signs[:, :, None] * self.scores - np.einsum("tij,nj->nti", self.shares, steps)
        return statistics(sums, left)

    def informative_trials(self) -> float:
        """Number of trials that carry the information: ``(Σ s)² / Σ s²`` of their shares in it (Satterthwaite 1946)."""
        total = self.shares.sum(axis=0)
        if not total.any():
            return 0.0
        share = np.einsum("ij,tji->t", np.linalg.inv(total), self.shares)
        return float(share.sum()) ** 2 / float((share**2).sum())

    def log_p(self, statistic: FloatArray | float) -> FloatArray:
        """Logarithm of the p-value of a statistic (any shape) by Hotelling's T²: the scatter of few trials is uncertain."""
        d = len(self.estimate)
        if not self.shares.any():
            return np.zeros(np.shape(statistic))
        trials = max(self.informative_trials(), d + 1.0)
        return np.maximum(f_distribution.logsf(np.asarray(statistic) / d, d, trials - d), _LEAST_LOG)


def statistics(sums: FloatArray, scores: FloatArray) -> FloatArray:
    """Return ``p' S⁻¹ p`` (draws,) of sums (draws, d) whose covariance is that of the scores (draws, trials, d) left."""
    d = sums.shape[1]
    active = np.maximum(2, (np.abs(scores).max(axis=2) > 0).sum(axis=1))
    spread = np.einsum("nti,ntj->nij", scores, scores) * (active / np.maximum(1, active - d))[:, None, None]
    return np.asarray(np.einsum("ni,nij,nj->n", sums, np.linalg.pinv(spread, rcond=RANK, hermitian=True), sums))
