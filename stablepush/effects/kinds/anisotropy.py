"""Support friction depends on direction: over the table, or fixed in the slider."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Family, Parameter, RigBounds

#: Largest size of the lobes that is fitted (friction twice as large along as across), that tables and intervals have, and that is
#: believed: pushes in one direction show friction as a whole, a grain of any size would fit them.
_FITTED, _MOST, _BELIEVED = 0.6, 0.9, 0.5
#: The range of directions (rad), and terms beside the two lobes.
_HALF = math.pi / 2
_RATIO = Parameter("ratio", "1", 1.0, 1.0, 1.5, least=1.0)
_WAVES = ("cos 4φ", "sin 4φ", "cos 6φ", "sin 6φ")


def principal(ratio: float, direction: float) -> np.ndarray:
    """Friction over its mean (geometric, 2 x 2) that is ``ratio`` times as large along ``direction`` (rad) as across it."""
    c, s = math.cos(direction), math.sin(direction)
    turn = np.array(((c, -s), (s, c)))
    return np.asarray(turn @ np.diag((math.sqrt(ratio), 1 / math.sqrt(ratio))) @ turn.T)


def friction_over_direction(ratio: float, direction: float, terms: Sequence[float], angles: ArrayLike) -> FloatArray:
    """Return friction (n,) along motions in directions (n,) in rad, over its mean, of an anisotropy and its waves."""
    phi, size = np.asarray(angles, dtype=np.float64), (ratio**2 - 1) / (ratio**2 + 1)
    own = np.sqrt(1 + size * np.cos(2 * (phi - direction))) / (1 - size**2) ** 0.25
    a4, b4, a6, b6 = (*terms, 0.0, 0.0, 0.0, 0.0)[:4]
    return np.asarray(own + a4 * np.cos(4 * phi) + b4 * np.sin(4 * phi) + a6 * np.cos(6 * phi) + b6 * np.sin(6 * phi))


def _ratio(size: float) -> float:
    size = min(max(size, 0.0), _MOST)
    return math.sqrt((1 + size) / (1 - size))


class _Anisotropy(EffectKind):
    """Fitted are lobes ``(a, b)``: squares of the frictions are ``1 ± √(a² + b²)`` over their mean, the greater along
    ``atan2(b, a)/2``."""

    size, plausible, small, pose_step = 2, 0.2, 0.01, 0.05
    # the contact models of two simulators differ by as much
    least = 0.12
    two_lobed = on_points = planned = True
    axes = ""

    def table_fields(self, numbers: Mapping[str, Sequence[float]], weight: float, gyration: float) -> dict[str, Any]:
        return {self.axes: principal(numbers["ratio"][0], numbers["direction"][0])}

    def numbers(self, value: FloatArray) -> dict[str, Sequence[float]]:
        a, b = value[:2]
        return {"ratio": (_ratio(float(np.hypot(a, b))),), "direction": (0.5 * math.atan2(b, a),)}

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        size = float(np.hypot(*value))
        return value if size <= _FITTED else value * (_FITTED / size)

    def is_possible(self, own: FloatArray) -> bool:
        return float(np.linalg.norm(own)) <= _BELIEVED

    def estimates(self, value: FloatArray, errors: FloatArray) -> dict[str, tuple[Any, Any, Any]]:
        size, error = float(np.hypot(*value)), float(np.sqrt((errors**2).mean()))
        direction = 0.5 * math.atan2(float(value[1]), float(value[0]))
        spread = min(_HALF, 0.98 * error / max(size, 1e-9))
        ratios = (_ratio(size), _ratio(size - 1.96 * error), _ratio(size + 1.96 * error))
        return {"ratio": ratios, "direction": (direction, direction - spread, direction + spread)}


class AnisotropyWorld(_Anisotropy):
    number, id = 1, "anisotropy-world"
    what = "support friction depends on direction over the table"
    needs = "headings of the slider over the table that vary, and forces, or pushes that slip"
    unseen = "needs forces, or pushes that slip, in several directions over the table"
    remedy = (
        "stablepush correct, then plan again: plans reckon with it at every heading; or plan along one principal direction "
        "of the friction"
    )
    says = "Support friction is {ratio} times as large along {direction} of the table as across it"
    parameters = (_RATIO, Parameter("direction", "rad in W", 0.0, -_HALF, _HALF))
    family = Family("direction φ of motion in W", _WAVES, "share of the friction", 0.1)
    slots, term_slots = (0, 2), (20, 24)
    axes, curve = "world_anisotropy", "direction in W"
    engines, not_in_models = ("mujoco",), ("mujoco",)


class AnisotropyObject(_Anisotropy):
    number, id = 2, "anisotropy-object"
    what = "support friction depends on direction, fixed in the slider"
    needs = "pushes in many directions of the slider, and forces, or pushes that slip"
    unseen = "needs forces, or pushes that slip, in several directions of the slider"
    remedy = "stablepush correct, then plan again; look at the feet for a worn or ribbed one"
    says = "Support friction is {ratio} times as large along {direction} of the slider as across it"
    parameters = (_RATIO, Parameter("direction", "rad in B", 0.0, -_HALF, _HALF))
    family = Family("direction φ of motion in B", _WAVES, "share of the friction", 0.1)
    slots, term_slots = (2, 4), (24, 28)
    axes, curve = "body_anisotropy", "direction in B"
    reshapes, varies = "body", True
