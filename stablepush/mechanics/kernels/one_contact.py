"""Compiled: how a slider moves with one contact closed: sticking, or slipping.

``F`` is monotone: the torque about a sticking contact vanishes at one turn and grows with it, the force of a slipping one turns
monotonically from where it sticks to the edge of its cone.
"""

from __future__ import annotations

import math

from stablepush.core import inner
from stablepush.mechanics.kernels.contacts import LEFT, RIGHT, STICKING
from stablepush.mechanics.kernels.friction import load_of

#: Iterations of a bracketed root.
MOST_STEPS = 200
#: Steps of Newton's method for a contact that slips, the residual at which it ends, and the share by which it differences.
_NEWTON_STEPS, _NEWTON_END, _DIFFERENCE = 12, 1e-13, 1e-7


@inner
def next_place(low, high, f_low, f_high, turn):  # type: ignore[no-untyped-def]
    """The next place to look for a root that is bracketed: secant, every third time the middle."""
    if turn % 3 == 2:
        return 0.5 * (low + high)
    middle = (low * f_high - high * f_low) / (f_high - f_low)
    if not low < middle < high:
        middle = 0.5 * (low + high)
    return middle


@inner
def narrowed(low, high, f_low, f_high, side, middle, value):  # type: ignore[no-untyped-def]
    """The bracket ``(low, high, f_low, f_high, side)`` with the value in its middle; an end that stays twice counts half (the
    Illinois rule)."""
    if value * f_low > 0.0:
        return middle, high, value, f_high * 0.5 if side == -1 else f_high, -1
    return low, middle, f_low * 0.5 if side == 1 else f_low, value, 1


@inner
def _torque_about(table, at, px, py, ux, uy, w, load):  # type: ignore[no-untyped-def]
    """Torque of the load about a contact that moves with (ux, uy) while the slider turns by w."""
    load_of(table, at, ux + w * py, uy - w * px, w, load)
    return load[2] - px * load[1] + py * load[0]


@inner
def _turn_about(table, at, px, py, ux, uy, guess, length, load):  # type: ignore[no-untyped-def]
    """The turn (rad/s) for which a contact that moves with (ux, uy) feels no torque, and its load in ``load``; NaN if none."""
    speed = math.sqrt(ux * ux + uy * uy)
    step = 0.05 * speed / length + 1e-3 * abs(guess) + 1e-12
    low = high = guess
    f_low = f_high = _torque_about(table, at, px, py, ux, uy, guess, load)
    size = math.sqrt(load[0] ** 2 + load[1] ** 2) * length + abs(load[2]) + 1e-300
    if abs(f_low) <= 1e-14 * size:
        return guess
    for _ in range(80):
        if f_low > 0.0:
            high, f_high = low, f_low
            low -= step
            f_low = _torque_about(table, at, px, py, ux, uy, low, load)
        elif f_high < 0.0:
            low, f_low = high, f_high
            high += step
            f_high = _torque_about(table, at, px, py, ux, uy, high, load)
        else:
            break
        step *= 4.0
    if f_low > 0.0 or f_high < 0.0:
        return math.nan
    best, least, side = low, abs(f_low), 0
    if f_high < least:
        best, least = high, f_high
    for turn in range(MOST_STEPS):
        if least <= 1e-14 * size or high - low <= 4e-16 * (abs(low) + abs(high)):
            break
        middle = next_place(low, high, f_low, f_high, turn)
        value = _torque_about(table, at, px, py, ux, uy, middle, load)
        if abs(value) < least:
            best, least = middle, abs(value)
        low, high, f_low, f_high, side = narrowed(low, high, f_low, f_high, side, middle, value)
    _torque_about(table, at, px, py, ux, uy, best, load)
    return best


@inner
def _slip_residuals(table, at, px, py, nx, ny, ux, uy, mu, side, w, slip, length, load):  # type: ignore[no-untyped-def]
    """Residuals of a turn ``w`` and a slip: torque about the contact over ``length``, and the edge of the cone."""
    torque = _torque_about(table, at, px, py, ux - side * slip * ny, uy + side * slip * nx, w, load)
    return torque / length, side * (nx * load[1] - ny * load[0]) + mu * (nx * load[0] + ny * load[1])


@inner
def _slip_by_newton(table, at, px, py, nx, ny, ux, uy, mu, side, guess, length, load):  # type: ignore[no-untyped-def]
    """Turn and slip of a contact that slides, from one that sticks; the slip is NaN where Newton's method does not get there, as
    where a support point all but rests."""
    speed = math.sqrt(ux * ux + uy * uy)
    w, slip = guess, 0.0
    torque, edge = _slip_residuals(table, at, px, py, nx, ny, ux, uy, mu, side, w, slip, length, load)
    for _ in range(_NEWTON_STEPS):
        size = math.sqrt(load[0] ** 2 + load[1] ** 2) + abs(load[2]) / length + 1e-300
        if abs(torque) + abs(edge) <= _NEWTON_END * size:
            return w, slip
        h = _DIFFERENCE * speed
        torque_w, edge_w = _slip_residuals(table, at, px, py, nx, ny, ux, uy, mu, side, w + h / length, slip, length, load)
        torque_s, edge_s = _slip_residuals(table, at, px, py, nx, ny, ux, uy, mu, side, w, slip + h, length, load)
        a, b, c, d = torque_w - torque, torque_s - torque, edge_w - edge, edge_s - edge
        determinant = a * d - b * c
        if determinant == 0.0:
            break
        turn, more = -(d * torque - b * edge) / determinant, -(a * edge - c * torque) / determinant
        least, share = abs(torque) + abs(edge), 1.0
        for _ in range(4):
            new_w, new_slip = w + share * turn * h / length, max(0.0, slip + share * more * h)
            torque, edge = _slip_residuals(table, at, px, py, nx, ny, ux, uy, mu, side, new_w, new_slip, length, load)
            if abs(torque) + abs(edge) < least:
                break
            share *= 0.25
        if not abs(torque) + abs(edge) < least:
            break
        w, slip = new_w, new_slip
    return w, math.nan


@inner
def _slip_by_brackets(table, at, px, py, nx, ny, ux, uy, mu, side, guess, length, load):  # type: ignore[no-untyped-def]
    """Turn and slip of a contact that slides, safe and slow: the slip is bracketed, and the turn of each slip; NaN if none."""
    tx, ty = -ny, nx
    w = _turn_about(table, at, px, py, ux, uy, guess, length, load)
    low, f_low = 0.0, side * (tx * load[0] + ty * load[1]) + mu * (nx * load[0] + ny * load[1])
    high, f_high = 0.02 * math.sqrt(ux * ux + uy * uy), f_low
    for _ in range(40):
        w = _turn_about(table, at, px, py, ux + side * high * tx, uy + side * high * ty, w, length, load)
        if math.isnan(w):
            return w, w
        f_high = side * (tx * load[0] + ty * load[1]) + mu * (nx * load[0] + ny * load[1])
        if f_high >= 0.0:
            break
        low, f_low = high, f_high
        high *= 4.0
    if f_high < 0.0 or f_low > 0.0:
        return w, math.nan
    slip, last = high, 0
    for turn in range(MOST_STEPS):
        slip = next_place(low, high, f_low, f_high, turn)
        w = _turn_about(table, at, px, py, ux + side * slip * tx, uy + side * slip * ty, w, length, load)
        value = side * (tx * load[0] + ty * load[1]) + mu * (nx * load[0] + ny * load[1])
        size = math.sqrt(load[0] ** 2 + load[1] ** 2) + 1e-300
        if abs(value) <= 1e-13 * size or high - low <= 4e-16 * (low + high):
            break
        low, high, f_low, f_high, last = narrowed(low, high, f_low, f_high, last, slip, value)
    return w, slip


@inner
def one_contact(table, at, px, py, nx, ny, ux, uy, mu, guess, length, sliding, twist, load):  # type: ignore[no-untyped-def]
    """Twist and load with one contact closed, whose pusher moves with (ux, uy); returns its mode, -1 if there is none.

    ``sliding`` lets it slide; else it sticks or there is no answer.
    """
    tx, ty = -ny, nx
    w = _turn_about(table, at, px, py, ux, uy, guess, length, load)
    if math.isnan(w):
        return -1
    normal, across = nx * load[0] + ny * load[1], tx * load[0] + ty * load[1]
    # also without friction, where a push through the centre needs none but for rounding
    if abs(across) <= mu * normal + 1e-12 * math.hypot(load[0], load[1]):
        twist[0], twist[1], twist[2] = ux + w * py, uy - w * px, w
        return STICKING
    if not sliding:
        return -1
    # the slider slips where friction cannot hold it: against the force that would be needed
    side = -1.0 if across > 0.0 else 1.0
    turn, slip = _slip_by_newton(table, at, px, py, nx, ny, ux, uy, mu, side, w, length, load)
    if math.isnan(slip):
        turn, slip = _slip_by_brackets(table, at, px, py, nx, ny, ux, uy, mu, side, w, length, load)
    if math.isnan(slip):
        return -1
    w = turn
    if nx * load[0] + ny * load[1] <= 0.0:
        return -1
    ux, uy = ux + side * slip * tx, uy + side * slip * ty
    twist[0], twist[1], twist[2] = ux + w * py, uy - w * px, w
    return LEFT if side > 0.0 else RIGHT
