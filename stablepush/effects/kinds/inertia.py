"""The push is not quasi-static."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Parameter, RigBounds

#: Times the known mass of the slider that what resists acceleration may be.
_HEAVIER = 2.0


class Inertia(EffectKind):
    number, id = 9, "inertia"
    what = "the push is not quasi-static"
    acts = "inertia"
    needs = "forces while pushes speed up or slow down"
    unseen = "needs forces while the speed changes"
    remedy = "push slower, or with less acceleration (stablepush trajectory --acceleration)"
    says = "Pushes are not quasi-static: a mass of {mass} resists"
    parameters = (Parameter("mass", "kg", 0.0, 0.0, 3.0, least=0.0),)
    size, plausible, small = 1, 3.0, 0.05
    # rows are means over parts of a push, in which the acceleration changes
    systematic = 0.2
    slots = (13, 14)
    planned = needs_weight = True

    def table_fields(self, numbers: Mapping[str, Sequence[float]], weight: float, gyration: float) -> dict[str, Any]:
        mass = numbers["mass"][0]
        return {"inertia": (mass, mass * gyration**2)}

    def largest(self, bounds: RigBounds) -> float:
        return _HEAVIER * bounds.mass if bounds.mass else math.inf

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        return np.maximum(value, 0.0)

    def is_possible(self, own: FloatArray) -> bool:
        return bool(own[0] >= 0)
