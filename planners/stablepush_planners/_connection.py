"""Connections: Dubins paths of a contact's reference point from one pose to another, free of collision."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import BoolArray, FloatArray, compiled, inner
from stablepush.geometry.kernels import exp_of
from stablepush.planning.kernels import push_is_free
from stablepush_planners.dubins import CURVATURES, dubins_lengths

#: Costs (s) below this are of no path, turns (rad) below this none, and costs that differ by this share are the same: which of
#: two mirrored paths is taken must not hang on rounding.
_NO_COST, _NO_TURN, _ALIKE = 1e-9, 1e-9, 1e-9


class Connections(NamedTuple):
    """Dubins paths by contact: frame of the reference point in B (3,), radii (m, zero for none), times and costs (s/m) of left,
    straight and right, and in which equal parts of all headings each of them is stable (contacts, radii, 3, parts); one part
    where headings do not matter."""

    frames: FloatArray
    radii: FloatArray
    paces: FloatArray
    prices: FloatArray
    stable: BoolArray


@inner
def turn_twist(frame, curvature):  # type: ignore[no-untyped-def]
    """Body twist of unit speed of the reference point, turning with a curvature (1/m)."""
    return math.cos(frame[2]) + curvature * frame[1], math.sin(frame[2]) - curvature * frame[0], curvature


@compiled
def stable_along(parts, heading, turn):  # type: ignore[no-untyped-def]
    """Whether all parts (n,) of the headings that an arc passes, from ``heading`` by ``turn``, are marked."""
    count = parts.shape[0]
    if count == 1:
        return parts[0]
    low, high = min(heading, heading + turn), max(heading, heading + turn)
    size = 2 * math.pi / count
    # an arc that ends where a part does needs no more of it
    first, last = math.floor(low / size + 1e-9), math.ceil(high / size - 1e-9) - 1
    held = True
    for k in range(first, max(first, last) + 1):
        held = held and parts[k % count]
    return held


@compiled
def moved(x, y, theta, vx, vy, omega, duration):  # type: ignore[no-untyped-def]
    """Pose after a body twist is followed for a time."""
    dx, dy, angle = exp_of(vx, vy, omega, duration)
    c, s = math.cos(theta), math.sin(theta)
    return x + c * dx - s * dy, y + s * dx + c * dy, theta + angle


@compiled
def connect(connections, world, body, contact, x, y, theta, gx, gy, gt, most, lengths, pieces):  # type: ignore[no-untyped-def]
    """Cheapest free Dubins word of the reference point between two poses that costs less than ``most``; its cost (s).

    ``pieces`` (3, 4) receives body twists and durations; ``lengths`` (6, 3) is workspace.
    """
    frame = connections.frames[contact]
    c0, s0, c1, s1 = math.cos(theta), math.sin(theta), math.cos(gt), math.sin(gt)
    x0, y0 = x + c0 * frame[0] - s0 * frame[1], y + s0 * frame[0] + c0 * frame[1]
    x1, y1 = gx + c1 * frame[0] - s1 * frame[1], gy + s1 * frame[0] + c1 * frame[1]
    best = math.inf
    radii = connections.radii.shape[1]
    # no path is shorter than the straight line
    least = math.inf
    for r in range(radii):
        if connections.radii[contact, r] > 0.0:
            for p in range(3):
                least = min(least, connections.prices[contact, r, p])
    if least * math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2) >= most:
        return best
    costs = np.full((radii, 6), math.inf)
    straight = False
    for r in range(radii):
        radius = connections.radii[contact, r]
        if radius <= 0.0:
            continue
        dubins_lengths(x0, y0, theta + frame[2], x1, y1, gt + frame[2], radius, lengths)
        for w in range(6):
            if CURVATURES[w, 1] == 0.0 and lengths[w, 0] + lengths[w, 2] <= _NO_TURN:
                # one line, whatever the radius and the turns that it is without
                if straight:
                    continue
                straight = True
            cost = 0.0
            for p in range(3):
                cost += lengths[w, p] * radius * connections.prices[contact, r, int(1 - CURVATURES[w, p])]
            if cost > _NO_COST:
                costs[r, w] = cost
    # the cheapest first, of those as cheap as each other the tighter turns and the earlier word
    for _ in range(4):
        found, word, which = most, -1, -1
        for r in range(radii):
            for w in range(6):
                if costs[r, w] < found * (1.0 - _ALIKE):
                    found, word, which = costs[r, w], w, r
        if word < 0:
            break
        costs[which, word] = math.inf
        radius = connections.radii[contact, which]
        dubins_lengths(x0, y0, theta + frame[2], x1, y1, gt + frame[2], radius, lengths)
        px, py, pt = x, y, theta
        good = True
        for p in range(3):
            curvature = CURVATURES[word, p] / radius
            pace = connections.paces[contact, which, int(1 - CURVATURES[word, p])]
            vx, vy, omega = turn_twist(frame, curvature)
            duration = lengths[word, p] * radius * pace
            pieces[p, 0], pieces[p, 1], pieces[p, 2], pieces[p, 3] = vx / pace, vy / pace, omega / pace, duration
            if duration > 0.0:
                parts = connections.stable[contact, which, int(1 - CURVATURES[word, p])]
                if not stable_along(parts, pt, omega / pace * duration):
                    good = False
                    break
                c, s = math.cos(pt), math.sin(pt)
                if not push_is_free(world, body, px, py, c, s, vx / pace, vy / pace, omega / pace, duration):
                    good = False
                    break
                px, py, pt = moved(px, py, pt, vx / pace, vy / pace, omega / pace, duration)
        if good:
            best = found
            break
    return best
