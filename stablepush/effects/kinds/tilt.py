"""The table is not level."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray
from stablepush.effects.kind import PLACE, EffectKind, Family, Parameter, RigBounds


def slope_over_place(slope: Sequence[float], terms: Sequence[float], places: ArrayLike) -> FloatArray:
    """Return the slope (..., 2) of the table along x and y in rad at places (..., 2) in m in W; ``slope``: at the origin of W."""
    place = np.asarray(places, dtype=np.float64) / PLACE
    xx, xy, yy = (*terms, *[0.0] * 3)[:3]
    return np.asarray(slope) + place @ np.array([[xx, xy], [xy, yy]])


class Tilt(EffectKind):
    number, id = 8, "tilt"
    what = "the table is not level"
    needs = "headings that vary, forces, and rows at rest to separate it from a sensor bias"
    unseen = "needs headings that vary, the slider's mass, and forces or the friction of the support"
    remedy = (
        "level the table (the slope points downhill, 0.017 rad is one degree), or free a cable that pulls on the object; or "
        "correct the scene and plan with the tilt"
    )
    says = "The table falls by {slope} along x and y (negative: it rises)"
    parameters = (Parameter("slope", "rad in W", 0.0, -0.05, 0.05, 2, least=-0.5, most=0.5),)
    size, plausible, small, pose_step = 2, 0.05, 1e-3, 5e-3
    family = Family("place x, y in W over 0.15 m", ("x along x", "y along x and x along y", "y along y"), "rad", 0.05)
    slots, term_slots = (11, 13), (40, 43)
    pulls = planned = needs_weight = True
    engines, not_in_models = ("mujoco", "drake"), ("drake",)

    def table_fields(self, numbers: Mapping[str, Sequence[float]], weight: float, gyration: float) -> dict[str, Any]:
        return {"external_force": weight * np.asarray(numbers["slope"])}

    def largest(self, bounds: RigBounds) -> float:
        # no table is steeper than friction holds
        return bounds.support_friction or math.inf

    def where_pushed(self, estimates: Mapping[str, Any], terms: Sequence[float], places: FloatArray) -> str:
        middle = places.mean(axis=0)
        slopes = np.degrees(slope_over_place(estimates["slope"], terms, np.vstack((middle, places))))
        (x, y), (lx, ly), (hx, hy) = slopes[0] + 0.0, slopes.min(axis=0), slopes.max(axis=0)
        at = f"in the middle of the pushes (x {middle[0]:.2f} m, y {middle[1]:.2f} m)"
        return (
            f"the table falls by ({x:.2f}, {y:.2f}) deg along x and y {at}; over the pushes this ranges from {lx:.2f} to "
            f"{hx:.2f} deg along x and from {ly:.2f} to {hy:.2f} deg along y"
        )

    def remedy_in_form(self) -> str:
        return "look for a table that is not flat, or a cable that pulls at the object; plans take one slope for all places"
