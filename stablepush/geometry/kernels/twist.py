"""The way of a constant body twist, compiled."""

from __future__ import annotations

import math

from stablepush.core import inner


@inner
def way_of(vx, vy, omega, duration):  # type: ignore[no-untyped-def]
    """Where a body twist leads in a time, seen from where it began: ``exp(twist * duration)`` as ``(x, y, angle)``."""
    angle = omega * duration
    half = angle / 2
    # sin(angle)/angle and (1 - cos(angle))/angle without cancellation
    shrink = math.sin(half) / half if abs(half) > 1e-12 else 1.0
    a, b = shrink * math.cos(half), shrink * math.sin(half)
    return duration * (a * vx - b * vy), duration * (b * vx + a * vy), angle
