"""Whether an effect could be as large as it was found: its sign and size, the errors of a fitted model, the design of the log."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.equations import ANISOTROPIES, OF_BODY, Fitted, ScoreTest
from stablepush.diagnosis.likelihood.system import System
from stablepush.effects import FAMILIES

#: Effects count from this share of half of their plausible range; anisotropy from where the contact models of two simulators
#: differ, a shift of the pressure from 0.8 mm and a spread from 5 %: feet and fingers that give make 0.4 mm and 3 % of them.
_LEAST = 0.03
_LEAST_OF: Mapping[str, float] = {
    "anisotropy-world": 0.12, "anisotropy-object": 0.12, "pressure-shift": 0.08, "pressure-spread": 0.14,
}  # fmt: skip
#: No grain is stronger: friction 1.7 times as large along it as across.
_MOST_GRAIN = 0.5
#: Effects whose estimates are more uncertain than this share of half of their range cannot be seen in a log.
_BLIND = 0.5
#: What an effect beside a nominal surface that was fitted to pokes must exceed. One that reshapes the surface: a share of half of
#: its plausible range. All: standard deviations of the surface's ensemble, which is too narrow after few pokes.
_OF_A_MODEL, _OF_ITS_ENSEMBLE = 0.3, 6.0


def possible(system: System, id: str, estimate: FloatArray) -> bool:
    """Whether an estimate has the sign that the effect must have, and a size that matters."""
    count = system.size(id, whole=False)
    own, terms = estimate[:count], estimate[count:]
    size = float(np.linalg.norm(own)) / system.plausible(id)
    if len(terms):
        size = max(size, float(np.linalg.norm(terms)) / FAMILIES[id].plausible)
    if id in ANISOTROPIES and float(np.linalg.norm(own)) > _MOST_GRAIN:
        # pushes in one direction show friction as a whole: a grain of any size would fit them
        return False
    return size > _LEAST_OF.get(id, _LEAST) and not (id in ("inertia", "latency") and estimate[0] < 0)


def exceeds_model_error(system: System, id: str, estimate: FloatArray, fitted: Fitted) -> bool:
    """Whether an effect is beyond what pokes leave open of the nominal surface that was fitted to them.

    Each mode of the model's ensemble is what it would be as the effect: the least squares projection on its columns. Pushes
    whose headings hardly vary do not tell an effect of the table, or of the sensors, from the surface either.
    """
    if system.rig.model is None:
        return True
    if id in OF_BODY and (system.open_modes.size or float(np.linalg.norm(estimate)) <= _OF_A_MODEL * system.plausible(id)):
        return False
    changes = system.of_modes(fitted.values)
    columns = system.columns(id, fitted.loads, fitted.values, len(estimate))[: len(changes)]
    if not (changes.any() and columns.any()):
        return True
    modes = np.linalg.lstsq(columns, changes, rcond=None)[0]
    spread = modes @ modes.T
    return float(estimate @ np.linalg.pinv(spread, hermitian=True) @ estimate) > _OF_ITS_ENSEMBLE**2


def identifiable(system: System, id: str, test: ScoreTest) -> bool:
    """Whether the pushes of a log, by their design, determine an effect to better than a share of its plausible range."""
    least = float(np.linalg.eigvalsh(test.information)[0])
    return least > (_BLIND * system.plausible(id)) ** -2
