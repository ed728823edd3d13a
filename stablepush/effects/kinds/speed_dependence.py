"""Support friction depends on speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray
from stablepush.effects.kind import FASTEST, SLOWEST, EffectKind, Family, Parameter, RigBounds

#: Largest slope that is fitted.
_MOST = 0.5


def friction_over_speed(slope: float, terms: Sequence[float], speeds: ArrayLike, reference: float) -> FloatArray:
    """Return friction (n,) at speeds (n,) in m/s, over that at the reference speed."""
    u = np.log(np.asarray(speeds, dtype=np.float64) / reference)
    cut = np.clip(u, SLOWEST, FASTEST)
    second, third = (*terms, 0.0, 0.0)[:2]
    return np.asarray((1 + slope * u) * (1 + cut**2 * (second + third * cut)))


class SpeedDependence(EffectKind):
    number, id = 3, "speed-dependence"
    what = "support friction depends on speed"
    needs = "forces at speeds that vary by a factor of three or more"
    unseen = "needs forces and pushes at different speeds"
    remedy = "push at the speed of the pokes; or stablepush correct, then plan again"
    says = "Support friction changes by {slope} for each e-fold of speed"
    parameters = (Parameter("slope", "1 per e-fold of speed", 0.0, -0.15, 0.15),)
    size, plausible, small = 1, 0.15, 0.01
    family = Family("u = ln(speed / 0.02 m/s)", ("u²", "u³"), "share of the friction", 0.1)
    slots, term_slots = (4, 5), (28, 30)
    on_points = depends_on_speed = planned = True
    curve = "speed"

    def table_fields(self, numbers: Mapping[str, Sequence[float]], weight: float, gyration: float) -> dict[str, Any]:
        return {"slope": numbers["slope"][0]}

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        return np.clip(value, -_MOST, _MOST)
