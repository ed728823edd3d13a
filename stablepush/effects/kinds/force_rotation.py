"""The force sensor is mounted at an angle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from stablepush.effects.kind import EffectKind, Family, Parameter, RigBounds


class ForceRotation(EffectKind):
    number, id = 13, "force-rotation"
    what = "force sensor mounted at an angle"
    acts = "sensing"
    needs = "forces in many directions, and motions of the slider"
    unseen = "needs forces in directions that vary against the motion"
    remedy = "turn the readings of the force sensor back by the angle; fit again what was fitted to them, and plan again"
    says = "The force sensor is turned by {angle}"
    parameters = (Parameter("angle", "rad", 0.0, -0.3, 0.3),)
    size, plausible, small = 1, 0.3, 0.005
    family = Family(
        "axes of the sensor, and place o of the push in the log", ("stretch along x", "shear", "turn (o - 1/2)"), "1", 0.3
    )
    slots, term_slots = (16, 17), (47, 50)
    of_axes = True
    import_key = "force_angle"
    engines = ("mujoco", "drake")

    def largest(self, bounds: RigBounds) -> float:
        return 0.5 * math.pi

    def import_value(self, estimates: Mapping[str, Any], was: Any) -> str:
        return f"{estimates['angle'] + (was or 0.0):.4f}"
