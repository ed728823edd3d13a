"""Support friction changes over the log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Family, Parameter, RigBounds

#: Least and largest rate that is fitted: some friction is left, and it is no more than sixfold.
_RATES = (-0.9, 5.0)


def friction_over_log(rate: float, terms: Sequence[float], orders: ArrayLike) -> FloatArray:
    """Return friction (n,) of pushes at places (n,) of the log, 0 to 1, over that of the first."""
    o = np.asarray(orders, dtype=np.float64)
    first, second, third = (*terms, 0.0, 0.0, 0.0)[:3]
    return np.asarray(1 + rate * o + 4 * o * (1 - o) * (first + (2 * o - 1) * (2 * second + (2 * o - 1) * 2 * third)))


class Drift(EffectKind):
    number, id = 5, "drift"
    what = "support friction changes over the log"
    needs = "forces over many trials, in random order"
    unseen = "needs forces over many trials"
    remedy = "wait until the surfaces have worn in, then poke again before planning"
    says = "Support friction changes by {rate} from the first to the last push"
    parameters = (Parameter("rate", "1, first to last trial", 0.0, -0.3, 0.3, least=-1.0, above=True),)
    size, plausible, small = 1, 0.3, 0.01
    family = Family(
        "place o of the push in the log, 0 to 1", ("4o(1-o)", "8o(1-o)(2o-1)", "8o(1-o)(2o-1)²"), "share of the friction", 0.3
    )
    slots, term_slots = (7, 8), (37, 40)
    per_log = varies = True
    curve = "log"
    engines, not_in_models = ("mujoco", "drake"), ("mujoco", "drake")

    @property
    def changes_plans(self) -> bool:
        # friction that is as much more everywhere leaves the stable pushes as they are
        return False

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        return np.clip(value, *_RATES)
