"""The force sensor has a constant offset."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Family, Parameter

_HALF = "o - 1/2"


class ForceBias(EffectKind):
    number, id = 12, "force-bias"
    what = "constant offset of the force sensor"
    acts = "sensing"
    needs = "forces at headings that vary, and rows at rest"
    unseen = "needs forces and headings that vary"
    remedy = (
        "zero the force sensor before each push, or import rows at rest before each (zero_forces takes the offset off); fit "
        "again what was fitted to its readings, and plan again"
    )
    says = "The force sensor has an offset of {force} along x and y of the table; subtract it"
    parameters = (Parameter("force", "N in W", 0.0, -1.0, 1.0, 2),)
    size, plausible, small = 2, 1.0, 0.01
    family = Family(
        "place o of the push in the log, and heading of the tool",
        (f"({_HALF}) along x", f"({_HALF}) along y", "tool x", "tool y"), "N", 1.0,
    )  # fmt: skip
    slots, term_slots = (14, 16), (43, 47)
    engines = ("mujoco", "drake")

    def at_rest(self, late: FloatArray, heading: FloatArray) -> FloatArray:
        each, (c, s) = np.tile(np.eye(2), (len(late), 1, 1)), (np.cos(heading), np.sin(heading))
        turned: FloatArray = np.moveaxis(np.array(((c, -s), (s, c))), 2, 0)
        return np.concatenate((each, late[:, None, None] * each, turned), axis=2)
