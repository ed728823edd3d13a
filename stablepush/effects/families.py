"""Forms of effects beyond the catalogue's own: a few terms of what an effect depends on, to be added to it.

Reality does not know the catalogue's formulas: friction may wear out faster at first, differ over the table in patches, or
depend on direction as a weave does. The catalogue's form is the first term of a low-order basis, and these are the next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

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
