"""Support friction differs over the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray
from stablepush.effects.kind import PLACE, EffectKind, Family, Parameter, RigBounds

#: Share of the friction that a gradient takes at most where the log has pushes.
_TAKES = 0.95


def friction_over_place(gradient: Sequence[float], terms: Sequence[float], places: ArrayLike) -> FloatArray:
    """Return friction (...) at places (..., 2) in m in W, over that at the origin of W."""
    place = np.asarray(places, dtype=np.float64)
    x, y = place[..., 0] / PLACE, place[..., 1] / PLACE
    xx, xy, yy, xxx, xxy, xyy, yyy = (*terms, *[0.0] * 7)[:7]
    more = xx * x * x + xy * x * y + yy * y * y + x * x * (xxx * x + xxy * y) + y * y * (xyy * x + yyy * y)
    return np.asarray((1 + place @ np.asarray(gradient)) * (1 + more))


class SpatialVariation(EffectKind):
    number, id = 4, "spatial-variation"
    what = "support friction differs over the table"
    needs = "places on the table that vary, and forces, or pushes that slip"
    unseen = "needs forces, or pushes that slip, at different places"
    remedy = "clean the table; or stablepush correct, then plan again within the bounds"
    says = "Support friction rises by {gradient} along x and y of the table"
    parameters = (Parameter("gradient", "1/m in W", 0.0, -1.0, 1.0, 2),)
    size, plausible, small, pose_step = 2, 1.0, 0.05, 0.2
    family = Family(
        "place x, y in W over 0.15 m", ("x²", "xy", "y²", "x³", "x²y", "xy²", "y³"), "share of the friction", 0.2
    )  # fmt: skip
    slots, term_slots = (5, 7), (30, 37)
    on_points = planned = True
    curve = "place"

    def table_fields(self, numbers: Mapping[str, Sequence[float]], weight: float, gyration: float) -> dict[str, Any]:
        return {"gradient": numbers["gradient"]}

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        lowest = -float((bounds.places @ value).min(initial=0.0))
        return value * (_TAKES / max(lowest, _TAKES))

    def where_pushed(self, estimates: Mapping[str, Any], terms: Sequence[float], places: FloatArray) -> str:
        middle = places.mean(axis=0)
        shares = friction_over_place(estimates["gradient"], terms, np.vstack((middle, places)))
        low, high = (f"{share:.2f}" for share in (shares.min() / shares[0], shares.max() / shares[0]))
        at = f"in the middle of the pushes (x {middle[0]:.2f} m, y {middle[1]:.2f} m)"
        return f"over the pushes support friction is {low} to {high} times its value {at}"
