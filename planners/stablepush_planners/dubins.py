"""Shortest paths of bounded curvature between two poses without obstacles (Dubins 1957)."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import compiled, inner

#: Words of the six families: left and right turns at the least radius, and straight.
WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
#: The same as signs of curvature, a row a word.
CURVATURES = np.array([[{"L": 1.0, "S": 0.0, "R": -1.0}[letter] for letter in word] for word in WORDS])

_TURN = 2 * math.pi
#: Turns (rad) this close to a full one are rounding of none.
_ROUNDING = 1e-9
#: Slack of what must not be negative, and squared distance of the middles of two turning circles that are one, in radii: where
#: a goal lies exactly on a turn, rounding must not decide which words lead there.
_SLACK, _SAME_CIRCLE = 1e-12, 1e-12


@compiled
def dubins_lengths(x0, y0, t0, x1, y1, t1, radius, lengths):  # type: ignore[no-untyped-def]
    """Fill ``lengths`` (6, 3) for the words in :data:`WORDS`: angles (rad) for turns, length over radius for the straight.

    Words that do not lead there have infinite lengths. Closed forms in the frame of Shkel and Lumelsky (2001): distances in units
    of the radius, the goal on the x axis.
    """
    lengths[:] = math.inf
    dx, dy = (x1 - x0) / radius, (y1 - y0) / radius
    d = math.sqrt(dx * dx + dy * dy)
    bearing = math.atan2(dy, dx) if d > 0.0 else 0.0
    a, b = _mod(t0 - bearing), _mod(t1 - bearing)
    sa, ca, sb, cb = math.sin(a), math.cos(a), math.sin(b), math.cos(b)
    cab = math.cos(a - b)
    square = 2 + d * d - 2 * cab + 2 * d * (sa - sb)
    if square >= _SAME_CIRCLE:
        t = math.atan2(cb - ca, d + sa - sb)
        lengths[0, 0], lengths[0, 1], lengths[0, 2] = _mod(t - a), math.sqrt(square), _mod(b - t)
    else:
        lengths[0, 0], lengths[0, 1], lengths[0, 2] = _mod(b - a), 0.0, 0.0
    square = 2 + d * d - 2 * cab + 2 * d * (sb - sa)
    if square >= _SAME_CIRCLE:
        t = math.atan2(ca - cb, d - sa + sb)
        lengths[1, 0], lengths[1, 1], lengths[1, 2] = _mod(a - t), math.sqrt(square), _mod(t - b)
    else:
        lengths[1, 0], lengths[1, 1], lengths[1, 2] = _mod(a - b), 0.0, 0.0
    square = d * d - 2 + 2 * cab + 2 * d * (sa + sb)
    if square >= -_SLACK:
        p = math.sqrt(max(0.0, square))
        t = math.atan2(-ca - cb, d + sa + sb) - math.atan2(-2.0, p)
        lengths[2, 0], lengths[2, 1], lengths[2, 2] = _mod(t - a), p, _mod(t - b)
    square = d * d - 2 + 2 * cab - 2 * d * (sa + sb)
    if square >= -_SLACK:
        p = math.sqrt(max(0.0, square))
        t = math.atan2(ca + cb, d - sa - sb) - math.atan2(2.0, p)
        lengths[3, 0], lengths[3, 1], lengths[3, 2] = _mod(a - t), p, _mod(b - t)
    cosine = (6 - d * d + 2 * cab + 2 * d * (sa - sb)) / 8
    if abs(cosine) <= 1 + _SLACK:
        p = _TURN - math.acos(min(1.0, max(-1.0, cosine)))
        t = _mod(a - math.atan2(ca - cb, d - sa + sb) + p / 2)
        lengths[4, 0], lengths[4, 1], lengths[4, 2] = t, p, _mod(a - b - t + p)
    cosine = (6 - d * d + 2 * cab + 2 * d * (sb - sa)) / 8
    if abs(cosine) <= 1 + _SLACK:
        p = _TURN - math.acos(min(1.0, max(-1.0, cosine)))
        t = _mod(-a - math.atan2(ca - cb, d + sa - sb) + p / 2)
        lengths[5, 0], lengths[5, 1], lengths[5, 2] = t, p, _mod(b - a - t + p)


@inner
def _mod(angle):  # type: ignore[no-untyped-def]
    angle %= _TURN
    return 0.0 if _TURN - angle < _ROUNDING else angle
