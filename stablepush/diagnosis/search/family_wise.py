"""Family-wise p-values: how often noise alone makes some effect stand out as much."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stablepush.diagnosis.likelihood.score_test import ScoreTest

#: Draws of the bootstrap of the smallest p-value: p-values of a thousandth can be told.
_DRAWS = 999


def family_wise_p_values(tests: Mapping[str, ScoreTest], seed: int = 0) -> dict[str, float]:
    """Return the family-wise p-value of each effect: how often, without effects, the smallest p-value of all is as small.

    The scores are linearised at the fit; trials keep their errors but for the sign, the same for all effects (the least
    p-value of Westfall and Young 1993 by the score bootstrap of Kline and Santos 2012). The signs of ``n`` trials that carry the
    information have ``2^(n-1)`` patterns apart from a common sign: no p-value is less than one over their number.
    """
    trials = max((len(test.scores) for test in tests.values()), default=0)
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), (_DRAWS, trials))
    least = np.zeros(_DRAWS)
    for test in tests.values():
        least = np.minimum(least, test.log_p(test.under_none(signs)))
    found = {id: float((1 + (least <= test.log_p(test.statistic)).sum()) / (1 + _DRAWS)) for id, test in tests.items()}
    return {id: max(p, min(1.0, 2.0 ** (1.0 - tests[id].informative_trials()))) for id, p in found.items()}
