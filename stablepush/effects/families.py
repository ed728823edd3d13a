"""Forms of effects beyond the catalogue's own: a few terms of what an effect depends on, to be added to it.

Reality does not know the catalogue's formulas: friction may wear out faster at first, differ over the table in patches, or
depend on direction as a weave does. The catalogue's form is the first term of a low-order basis, and these are the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray

#: Unit (m) of places in the terms, and of logarithms of speed beyond which terms do not grow further, below and above.
PLACE, SLOWEST, FASTEST = 0.15, -2.5, 1.5


@dataclass(frozen=True, slots=True)
class Family:
    """Terms that may be added to the form of an effect.

    ``covariate``: what the effect depends on; ``terms``: in words, one for each coefficient; ``unit`` of the coefficients;
    ``plausible``: half of the range in which they are found.
    """

    covariate: str
    terms: tuple[str, ...]
    unit: str
    plausible: float


def _families() -> dict[str, Family]:
    waves = ("cos 4φ", "sin 4φ", "cos 6φ", "sin 6φ")
    half = "o - 1/2"
    return {
        "anisotropy-world": Family("direction φ of motion in W", waves, "share of the friction", 0.1),
        "anisotropy-object": Family("direction φ of motion in B", waves, "share of the friction", 0.1),
        "speed-dependence": Family("u = ln(speed / 0.02 m/s)", ("u²", "u³"), "share of the friction", 0.1),
        "spatial-variation": Family(
            "place x, y in W over 0.15 m", ("x²", "xy", "y²", "x³", "x²y", "xy²", "y³"), "share of the friction", 0.2
        ),
        "drift": Family(
            "place o of the push in the log, 0 to 1", ("4o(1-o)", "8o(1-o)(2o-1)", "8o(1-o)(2o-1)²"), "share of the friction", 0.3
        ),
        "tilt": Family("place x, y in W over 0.15 m", ("x along x", "y along x and x along y", "y along y"), "rad", 0.05),
        "force-bias": Family(
            "place o of the push in the log, and heading of the tool",
            (f"({half}) along x", f"({half}) along y", "tool x", "tool y"), "N", 1.0,
        ),
        "force-rotation": Family(
            "axes of the sensor, and place o of the push in the log", ("stretch along x", "shear", f"turn ({half})"), "1", 0.3
        ),
        "frame-offset": Family("place o of the push in the log", (f"({half}) along x", f"({half}) along y"), "m", 0.01),
        "latency": Family("place o of the push in the log", (half,), "s", 0.3),
        "contact-geometry": Family("place o of the push in the log", (half,), "m", 0.01),
    }  # fmt: skip


#: Families by the id of the effect whose form they extend; an effect that is not listed has one form.
FAMILIES: Mapping[str, Family] = MappingProxyType(_families())


def friction_over_direction(ratio: float, direction: float, terms: Sequence[float], angles: ArrayLike) -> FloatArray:
    """Return friction (n,) along motions in directions (n,) in rad, over its mean, of an anisotropy and its waves."""
    phi, size = np.asarray(angles, dtype=np.float64), (ratio**2 - 1) / (ratio**2 + 1)
    own = np.sqrt(1 + size * np.cos(2 * (phi - direction))) / (1 - size**2) ** 0.25
    a4, b4, a6, b6 = (*terms, 0.0, 0.0, 0.0, 0.0)[:4]
    return np.asarray(own + a4 * np.cos(4 * phi) + b4 * np.sin(4 * phi) + a6 * np.cos(6 * phi) + b6 * np.sin(6 * phi))


def friction_over_speed(slope: float, terms: Sequence[float], speeds: ArrayLike, reference: float) -> FloatArray:
    """Return friction (n,) at speeds (n,) in m/s, over that at the reference speed."""
    u = np.log(np.asarray(speeds, dtype=np.float64) / reference)
    cut = np.clip(u, SLOWEST, FASTEST)
    second, third = (*terms, 0.0, 0.0)[:2]
    return np.asarray((1 + slope * u) * (1 + cut**2 * (second + third * cut)))


def friction_over_place(gradient: Sequence[float], terms: Sequence[float], places: ArrayLike) -> FloatArray:
    """Return friction (...) at places (..., 2) in m in W, over that at the origin of W."""
    place = np.asarray(places, dtype=np.float64)
    x, y = place[..., 0] / PLACE, place[..., 1] / PLACE
    xx, xy, yy, xxx, xxy, xyy, yyy = (*terms, *[0.0] * 7)[:7]
    more = xx * x * x + xy * x * y + yy * y * y + x * x * (xxx * x + xxy * y) + y * y * (xyy * x + yyy * y)
    return np.asarray((1 + place @ np.asarray(gradient)) * (1 + more))


def slope_over_place(slope: Sequence[float], terms: Sequence[float], places: ArrayLike) -> FloatArray:
    """Return the slope (..., 2) of the table along x and y in rad at places (..., 2) in m in W; ``slope``: at the origin of W."""
    place = np.asarray(places, dtype=np.float64) / PLACE
    xx, xy, yy = (*terms, *[0.0] * 3)[:3]
    return np.asarray(slope) + place @ np.array([[xx, xy], [xy, yy]])


def friction_over_log(rate: float, terms: Sequence[float], orders: ArrayLike) -> FloatArray:
    """Return friction (n,) of pushes at places (n,) of the log, 0 to 1, over that of the first."""
    o = np.asarray(orders, dtype=np.float64)
    first, second, third = (*terms, 0.0, 0.0, 0.0)[:3]
    return np.asarray(1 + rate * o + 4 * o * (1 - o) * (first + (2 * o - 1) * (2 * second + (2 * o - 1) * 2 * third)))
