"""Compiled ``exp`` of SE(2)."""

from __future__ import annotations

import math

from stablepush.core import inner


@inner
def exp_of(vx, vy, omega, duration):  # type: ignore[no-untyped-def]
    """Return ``exp(twist * duration)``, the pose that a constant body twist leads to, as ``(x, y, angle)``."""
    angle = omega * duration
    half = angle / 2
    # sin(angle)/angle and (1 - cos(angle))/angle without cancellation
    shrink = math.sin(half) / half if abs(half) > 1e-12 else 1.0
    a, b = shrink * math.cos(half), shrink * math.sin(half)
    return duration * (a * vx - b * vy), duration * (b * vx + a * vy), angle
