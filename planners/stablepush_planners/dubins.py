"""Shortest paths of bounded curvature between two poses without obstacles (Dubins 1957)."""

from __future__ import annotations

import math

#: Words of the six families: left and right turns at the least radius, and straight.
WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")

_TURN = 2 * math.pi
#: Turns (rad) this close to a full one are rounding of none.
_ROUNDING = 1e-9


def dubins_paths(
    start: tuple[float, float, float], goal: tuple[float, float, float], radius: float
) -> list[tuple[str, tuple[float, float, float]]]:
    """Return all feasible words with their three lengths: angles (rad) for turns, length over radius for the straight.

    Closed forms in the frame of Shkel and Lumelsky (2001): distances in units of the radius, the goal on the x axis.
    """
    dx, dy = (goal[0] - start[0]) / radius, (goal[1] - start[1]) / radius
    d = math.hypot(dx, dy)
    bearing = math.atan2(dy, dx) if d > 0 else 0.0
    a, b = _mod(start[2] - bearing), _mod(goal[2] - bearing)
    sa, ca, sb, cb = math.sin(a), math.cos(a), math.sin(b), math.cos(b)
    cab = math.cos(a - b)
    found: list[tuple[str, tuple[float, float, float]]] = []

    square = 2 + d * d - 2 * cab + 2 * d * (sa - sb)
    if square >= 0:
        t = math.atan2(cb - ca, d + sa - sb)
        found.append(("LSL", (_mod(t - a), math.sqrt(square), _mod(b - t))))
    square = 2 + d * d - 2 * cab + 2 * d * (sb - sa)
    if square >= 0:
        t = math.atan2(ca - cb, d - sa + sb)
        found.append(("RSR", (_mod(a - t), math.sqrt(square), _mod(t - b))))
    square = d * d - 2 + 2 * cab + 2 * d * (sa + sb)
    if square >= 0:
        p = math.sqrt(square)
        t = math.atan2(-ca - cb, d + sa + sb) - math.atan2(-2.0, p)
        found.append(("LSR", (_mod(t - a), p, _mod(t - b))))
    square = d * d - 2 + 2 * cab - 2 * d * (sa + sb)
    if square >= 0:
        p = math.sqrt(square)
        t = math.atan2(ca + cb, d - sa - sb) - math.atan2(2.0, p)
        found.append(("RSL", (_mod(a - t), p, _mod(b - t))))
    cosine = (6 - d * d + 2 * cab + 2 * d * (sa - sb)) / 8
    if abs(cosine) <= 1:
        p = _TURN - math.acos(cosine)
        t = _mod(a - math.atan2(ca - cb, d - sa + sb) + p / 2)
        found.append(("RLR", (t, p, _mod(a - b - t + p))))
    cosine = (6 - d * d + 2 * cab + 2 * d * (sb - sa)) / 8
    if abs(cosine) <= 1:
        p = _TURN - math.acos(cosine)
        t = _mod(-a - math.atan2(ca - cb, d + sa - sb) + p / 2)
        found.append(("LRL", (t, p, _mod(b - a - t + p))))
    return found


def _mod(angle: float) -> float:
    angle = math.fmod(angle, _TURN)
    if angle < 0:
        angle += _TURN
    return 0.0 if _TURN - angle < _ROUNDING else angle
