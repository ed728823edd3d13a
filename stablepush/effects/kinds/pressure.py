"""The pressure under the slider is elsewhere: its centre has moved, or it is nearer to or farther from its centre."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stablepush.core import LEAST_POSITIVE, EffectError, FloatArray
from stablepush.effects.kind import EffectKind, Parameter, RigBounds

if TYPE_CHECKING:
    from stablepush.objects import Slider

#: Least and largest change of the width that is fitted.
_WIDTHS = (-0.8, 2.0)


class PressureShift(EffectKind):
    number, id = 6, "pressure-shift"
    what = "centre of pressure away from the nominal"
    needs = "pushes whose line of force misses the centre of mass, with forces or motions of the slider"
    unseen = "needs forces and moments, or pushes that turn the slider"
    remedy = "stablepush correct, then plan again: the corrected surface has it"
    says = "The centre of pressure lies {offset} along x and y of the slider from the nominal one"
    parameters = (Parameter("offset", "m in B", 0.0, -0.01, 0.01, 2),)
    size, plausible, small, pose_step = 2, 0.01, 2e-4, 1e-3
    # feet and fingers that give make half of it
    least = 0.08
    moves_center = True
    # a spread scales about the nominal centre
    rank = 1
    slots = (8, 10)
    reshapes, on_points, planned, varies = "pressure", True, True, True
    engines = ("mujoco", "drake")

    def pressed(self, points: FloatArray, center: FloatArray, numbers: Mapping[str, Sequence[float]]) -> FloatArray:
        return points + np.asarray(numbers["offset"])

    def require_on(self, slider: Slider, center: FloatArray, numbers: Mapping[str, Sequence[float]]) -> None:
        import shapely

        hull = shapely.Polygon(slider.vertices).convex_hull.buffer(-LEAST_POSITIVE)
        if not hull.contains(shapely.Point(center + np.asarray(numbers["offset"]))):
            raise EffectError("effect pressure-shift: offset", "expected a centre of pressure that stays under the slider")

    def largest(self, bounds: RigBounds) -> float:
        return bounds.radius


class PressureSpread(EffectKind):
    number, id = 7, "pressure-spread"
    what = "pressure nearer to or farther from its centre"
    needs = "turns and straight pushes, with forces or motions of the slider"
    unseen = "needs moments of turning pushes"
    remedy = "stablepush correct, then plan again: the corrected surface has it"
    says = "The pressure is {scale} times as wide as the nominal one"
    parameters = (Parameter("scale", "1", 1.0, 0.7, 1.4, least=0.0, above=True),)
    size, plausible, small, pose_step = 1, 0.35, 0.01, 0.05
    # feet and fingers that give make half of it
    least = 0.14
    slots = (10, 11)
    reshapes, on_points, planned, varies = "pressure", True, True, True
    engines = ("mujoco", "drake")

    def pressed(self, points: FloatArray, center: FloatArray, numbers: Mapping[str, Sequence[float]]) -> FloatArray:
        return center + numbers["scale"][0] * (points - center)

    def numbers(self, value: FloatArray) -> dict[str, Sequence[float]]:
        return {"scale": (1 + float(value[0]),)}

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        return np.clip(value, *_WIDTHS)
