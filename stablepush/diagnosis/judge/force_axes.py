"""A force sensor whose axes differ in gain or are not square, told from one that is only mounted at an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stablepush.diagnosis.results import RankedEffect
from stablepush.effects import CATALOGUE

#: Least half difference of the gains, over their mean, and how many half widths of its 95 % interval it must be.
_LEAST, _CLEAR = 0.02, 2.0


@dataclass(frozen=True, slots=True)
class ForceAxes:
    """Readings ``(R(angle) + S) F`` of forces ``F`` in W, with ``S`` symmetric and without trace.

    ``ratio`` of the largest gain to the least, ``direction`` (rad) of the largest in the axes of the readings, ``angle`` (rad) by
    which readings are turned.
    """

    ratio: float
    direction: float
    angle: float

    def __str__(self) -> str:
        # a direction and its opposite are one axis
        along = math.degrees(self.direction) % 180.0
        along = 0.0 if round(along) == 180 else along
        return (
            f"reads {self.ratio:.3g} times as much along {along:.0f} deg of the table as across it, "
            f"and is turned by {math.degrees(self.angle) + 0.0:.1f} deg"
        )


def uneven_axes(entry: RankedEffect | None) -> ForceAxes | None:
    """Return what a force sensor does to forces, if more than to turn them; None if the log does not show that it does.

    ``S = r ((cos 2φ, sin 2φ), (sin 2φ, -cos 2φ))`` beside a rotation has the gains ``1 ± r``, the larger one along
    ``φ + angle/2`` of the readings.
    """
    if entry is None or not CATALOGUE[entry.effect].of_axes or entry.form is None or "angle" not in entry.parameters:
        return None
    stretch, shear = entry.form["coefficients"][:2]
    size = math.hypot(stretch, shear)
    width = max(high - low for low, high in entry.form["ci95"][:2]) / 2
    if size < max(_LEAST, _CLEAR * width):
        return None
    angle = float(entry.estimates["angle"])
    return ForceAxes((1 + size) / (1 - min(size, 0.99)), (math.atan2(shear, stretch) + angle) / 2, angle)
