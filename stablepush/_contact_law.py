"""Compiled: how a slider moves at an instant under contacts whose places move as a pusher does.

The slider's twist ``V`` and the contact forces ``f_i`` obey: the load ``F(V)`` of the table is ``Σ (f_i, p_i × f_i)``; no contact
penetrates, ``g_i = n_i·(v(p_i) - u_i) >= 0`` with ``u_i`` the pusher's velocity there; open contacts (``g_i > 0``) have no force;
sticking ones keep ``v = u`` with ``f`` in the friction cone; sliding ones have ``f`` on the edge of the cone against the slip.

``F`` is monotone (the gradient of a convex power), so each combination of modes that is possible in the plane leaves at most one
number to be found: the turn about a sticking contact (the torque about it vanishes and grows with the turn), the slip of a
single contact (the force turns monotonically from where it sticks to the edge of its cone), or where on the line of twists that
close two contacts these slip, both or one of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush._arrays import FloatArray
from stablepush._compiled import compiled, inner
from stablepush._table import load_of

#: Modes of a contact: open, sticking, the slider slipping to the left or right of the inward normal.
OPEN, STICKING, LEFT, RIGHT = 0, 1, 2, 3
#: Most contacts at once.
MOST_CONTACTS = 8
#: Iterations of a bracketed root.
_MOST_STEPS = 200
#: Steps of Newton's method for a contact that slips, the residual at which it ends, and the share by which it differences.
_NEWTON_STEPS, _NEWTON_END, _DIFFERENCE = 12, 1e-13, 1e-7
#: Places along the slip of two contacts, over ten decades, between which roots are looked for.
_PLACES = 41


class Touch(NamedTuple):
    """Contacts of an instant, the first ``number[0]`` rows: points and inward normals in B, gaps (m), the pusher's velocity there
    in B, and which finger or end it is."""

    number: np.ndarray
    point: FloatArray
    normal: FloatArray
    gap: FloatArray
    velocity: FloatArray
    finger: np.ndarray


class Answer(NamedTuple):
    """Twist (3,) in B, load (3,), forces (k, 2) and modes (k,) of the contacts; ``found`` (1,): how many combinations of modes
    are consistent: one is the rule, none is a jam."""

    twist: FloatArray
    load: FloatArray
    force: FloatArray
    mode: np.ndarray
    found: np.ndarray


class Work(NamedTuple):
    """Room for what is tried: twist (3,), load (3,), forces (k, 2) and modes (k,), a line of twists (2, 3), edges of cones
    (2 k, 3), shares (3,)."""

    twist: FloatArray
    load: FloatArray
    force: FloatArray
    mode: np.ndarray
    line: FloatArray
    rays: FloatArray
    shares: FloatArray


def new_touch() -> Touch:
    """Return room for contacts."""
    k = MOST_CONTACTS
    return Touch(np.zeros(1, np.int64), np.zeros((k, 2)), np.zeros((k, 2)), np.zeros(k), np.zeros((k, 2)), np.zeros(k, np.int64))


def new_answer() -> Answer:
    """Return room for an answer."""
    k = MOST_CONTACTS
    return Answer(np.zeros(3), np.zeros(3), np.zeros((k, 2)), np.zeros(k, np.int64), np.zeros(1, np.int64))


def new_work() -> Work:
    """Return room for what is tried."""
    k = MOST_CONTACTS
    modes = np.zeros(k, np.int64)
    return Work(np.zeros(3), np.zeros(3), np.zeros((k, 2)), modes, np.zeros((2, 3)), np.zeros((2 * k, 3)), np.zeros(3))


# Arrays are copied and cleared entry by entry: whole-array statements make the build several times as long.


@inner
def _clear_forces(force):  # type: ignore[no-untyped-def]
    for m in range(force.shape[0]):
        force[m, 0] = force[m, 1] = 0.0


@inner
def _middle(low, high, f_low, f_high, turn):  # type: ignore[no-untyped-def]
    """The next place to look for a root that is bracketed: secant, every third time the middle."""
    if turn % 3 == 2:
        return 0.5 * (low + high)
    middle = (low * f_high - high * f_low) / (f_high - f_low)
    if not low < middle < high:
        middle = 0.5 * (low + high)
    return middle


@inner
def _narrowed(low, high, f_low, f_high, side, middle, value):  # type: ignore[no-untyped-def]
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
    for turn in range(_MOST_STEPS):
        if least <= 1e-14 * size or high - low <= 4e-16 * (abs(low) + abs(high)):
            break
        middle = _middle(low, high, f_low, f_high, turn)
        value = _torque_about(table, at, px, py, ux, uy, middle, load)
        if abs(value) < least:
            best, least = middle, abs(value)
        low, high, f_low, f_high, side = _narrowed(low, high, f_low, f_high, side, middle, value)
    _torque_about(table, at, px, py, ux, uy, best, load)
    return best


@inner
def _slip_residuals(table, at, px, py, nx, ny, ux, uy, mu, side, w, slip, length, load):  # type: ignore[no-untyped-def]
    """What the load of a turn ``w`` and a slip misses by: torque about the contact over ``length``, and the edge of the cone."""
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
    for turn in range(_MOST_STEPS):
        slip = _middle(low, high, f_low, f_high, turn)
        w = _turn_about(table, at, px, py, ux + side * slip * tx, uy + side * slip * ty, w, length, load)
        value = side * (tx * load[0] + ty * load[1]) + mu * (nx * load[0] + ny * load[1])
        size = math.sqrt(load[0] ** 2 + load[1] ** 2) + 1e-300
        if abs(value) <= 1e-13 * size or high - low <= 4e-16 * (low + high):
            break
        low, high, f_low, f_high, last = _narrowed(low, high, f_low, f_high, last, slip, value)
    return w, slip


@inner
def _one_contact(table, at, px, py, nx, ny, ux, uy, mu, guess, length, sliding, twist, load):  # type: ignore[no-untyped-def]
    """Twist and load with one contact closed, whose pusher moves with (ux, uy); returns its mode, -1 if there is none.

    ``sliding`` lets it slide; else it sticks or there is no answer.
    """
    tx, ty = -ny, nx
    w = _turn_about(table, at, px, py, ux, uy, guess, length, load)
    if math.isnan(w):
        return -1
    normal, across = nx * load[0] + ny * load[1], tx * load[0] + ty * load[1]
    if abs(across) <= mu * normal * (1.0 + 1e-12):
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


@inner
def _edge(touch, m, side, length, rays, e):  # type: ignore[no-untyped-def]
    """Fill row ``e`` of ``rays`` with the wrench ``(fx, fy, tau/length)`` of unit normal force and tangential force ``side``."""
    nx, ny = touch.normal[m, 0], touch.normal[m, 1]
    rays[e, 0], rays[e, 1] = nx - side * ny, ny + side * nx
    rays[e, 2] = (touch.point[m, 0] * rays[e, 1] - touch.point[m, 1] * rays[e, 0]) / length


@inner
def _shares_of_three(rays, a, b, c, fx, fy, fz, shares):  # type: ignore[no-untyped-def]
    """Shares (3,) of three rows that make up a vector; False if they lie in a plane."""
    ax, ay, az = rays[a, 0], rays[a, 1], rays[a, 2]
    bx, by, bz = rays[b, 0], rays[b, 1], rays[b, 2]
    cx, cy, cz = rays[c, 0], rays[c, 1], rays[c, 2]
    ux, uy, uz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    determinant = ax * ux + ay * uy + az * uz
    sizes = math.sqrt((ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz) * (cx * cx + cy * cy + cz * cz))
    if abs(determinant) <= 1e-12 * sizes:
        return False
    shares[0] = (fx * ux + fy * uy + fz * uz) / determinant
    ux, uy, uz = fy * cz - fz * cy, fz * cx - fx * cz, fx * cy - fy * cx
    shares[1] = (ax * ux + ay * uy + az * uz) / determinant
    ux, uy, uz = by * fz - bz * fy, bz * fx - bx * fz, bx * fy - by * fx
    shares[2] = (ax * ux + ay * uy + az * uz) / determinant
    return True


@inner
def _hold(touch, i, j, all_of_them, mu, length, load, work):  # type: ignore[no-untyped-def]
    """Whether two contacts, or all, can apply a load within their cones; ``work.force`` is its share of each.

    What they press against each other is not determined: the mean of the ways that use three edges of cones is taken.
    """
    _clear_forces(work.force)
    count = touch.number[0] if all_of_them else 2
    for k in range(count):
        m = k if all_of_them else (i if k == 0 else j)
        _edge(touch, m, mu, length, work.rays, 2 * k)
        _edge(touch, m, -mu, length, work.rays, 2 * k + 1)
    fx, fy, fz = load[0], load[1], load[2] / length
    least = -1e-9 * math.sqrt(fx * fx + fy * fy + fz * fz)
    ways = 0
    for a in range(2 * count):
        for b in range(a + 1, 2 * count):
            for c in range(b + 1, 2 * count):
                if not _shares_of_three(work.rays, a, b, c, fx, fy, fz, work.shares):
                    continue
                if min(work.shares[0], work.shares[1], work.shares[2]) < least:
                    continue
                ways += 1
                for k in range(3):
                    e = a if k == 0 else (b if k == 1 else c)
                    m = e // 2 if all_of_them else (i if e < 2 else j)
                    work.force[m, 0] += work.shares[k] * work.rays[e, 0]
                    work.force[m, 1] += work.shares[k] * work.rays[e, 1]
    for m in range(touch.number[0]):
        work.force[m, 0] /= max(ways, 1)
        work.force[m, 1] /= max(ways, 1)
    return ways > 0


@inner
def _rate(touch, m, twist, dt):  # type: ignore[no-untyped-def]
    """Speed (m/s) at which a contact opens, over a step: its gap counts."""
    vx = twist[0] - twist[2] * touch.point[m, 1] - touch.velocity[m, 0]
    vy = twist[1] + twist[2] * touch.point[m, 0] - touch.velocity[m, 1]
    return touch.normal[m, 0] * vx + touch.normal[m, 1] * vy + touch.gap[m] / dt


@inner
def _others_open(touch, i, j, twist, dt, slack):  # type: ignore[no-untyped-def]
    opening = True
    for m in range(touch.number[0]):
        if m not in (i, j):
            opening = opening and _rate(touch, m, twist, dt) >= -slack
    return opening


@inner
def _closing(touch, i, j, pushed, length, dt, line):  # type: ignore[no-untyped-def]
    """Twist next to ``pushed`` that closes the gaps of two contacts, and the direction that keeps them closed, unit in length.

    ``line`` (2, 3) takes both. False where both normals lie on one line.
    """
    ax, ay = touch.normal[i, 0], touch.normal[i, 1]
    az = (touch.point[i, 0] * ay - touch.point[i, 1] * ax) / length
    bx, by = touch.normal[j, 0], touch.normal[j, 1]
    bz = (touch.point[j, 0] * by - touch.point[j, 1] * bx) / length
    dx, dy, dz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    size = math.sqrt(dx * dx + dy * dy + dz * dz)
    if size < 1e-9:
        return False
    aa, ab, bb = ax * ax + ay * ay + az * az, ax * bx + ay * by + az * bz, bx * bx + by * by + bz * bz
    ra, rb = -_rate(touch, i, pushed, dt), -_rate(touch, j, pushed, dt)
    determinant = aa * bb - ab * ab
    p, q = (ra * bb - rb * ab) / determinant, (rb * aa - ra * ab) / determinant
    line[0, 0] = pushed[0] + p * ax + q * bx
    line[0, 1] = pushed[1] + p * ay + q * by
    line[0, 2] = pushed[2] + (p * az + q * bz) / length
    line[1, 0], line[1, 1], line[1, 2] = dx / size, dy / size, dz / size / length
    return True


@inner
def _slip(touch, m, line, s):  # type: ignore[no-untyped-def]
    """Speed at which the slider slips to the left of a contact's normal at a place of a line of twists."""
    px, py = touch.point[m, 0], touch.point[m, 1]
    w = line[0, 2] + s * line[1, 2]
    vx = line[0, 0] + s * line[1, 0] - w * py - touch.velocity[m, 0]
    vy = line[0, 1] + s * line[1, 1] + w * px - touch.velocity[m, 1]
    return touch.normal[m, 0] * vy - touch.normal[m, 1] * vx


@inner
def _sticks_at(touch, m, line, speed):  # type: ignore[no-untyped-def]
    """Place of a line of twists at which a contact does not slip; NaN if there is none."""
    here = _slip(touch, m, line, 0.0)
    slope = (_slip(touch, m, line, speed) - here) / speed
    return -here / slope if abs(slope) > 1e-12 else math.nan


@inner
def _both_stick_at(touch, i, j, line, speed, dt):  # type: ignore[no-untyped-def]
    """Place of a line of twists at which two contacts do not slip; NaN if there is none.

    Where they close gaps in this step they may slip a little meanwhile, no faster than they close.
    """
    first, second = _sticks_at(touch, i, line, speed), _sticks_at(touch, j, line, speed)
    first = second if math.isnan(first) else first
    second = first if math.isnan(second) else second
    if math.isnan(first):
        return 0.0
    closing = (abs(touch.gap[i]) + abs(touch.gap[j])) / dt
    return 0.5 * (first + second) if abs(first - second) <= closing + 1e-9 * speed else math.nan


@inner
def _load_on_line(table, at, line, s, twist, load):  # type: ignore[no-untyped-def]
    for q in range(3):
        twist[q] = line[0, q] + s * line[1, q]
    load_of(table, at, twist[0], twist[1], twist[2], load)


@inner
def _sliding_edge(touch, m, slip, tiny, mu, length, work, e):  # type: ignore[no-untyped-def]
    """Fill row ``e`` of ``work.rays`` with the edge of the cone of a contact that slips, against the slip, and note its mode."""
    _edge(touch, m, 0.0 if abs(slip) <= tiny else (-mu if slip > 0.0 else mu), length, work.rays, e)
    work.mode[m] = LEFT if slip > 0.0 else RIGHT


@inner
def _one_of_two_sticks(table, at, touch, a, b, s, speed, mu, length, dt, slack, work):  # type: ignore[no-untyped-def]
    """Whether contact ``a`` can stick while ``b``, closed too, slips: at the place ``s`` of ``work.line``."""
    load, rays, shares = work.load, work.rays, work.shares
    _load_on_line(table, at, work.line, s, work.twist, load)
    _edge(touch, a, mu, length, rays, 0)
    _edge(touch, a, -mu, length, rays, 1)
    _sliding_edge(touch, b, _slip(touch, b, work.line, s), 1e-12 * speed, mu, length, work, 2)
    if not _shares_of_three(rays, 0, 1, 2, load[0], load[1], load[2] / length, shares):
        return False
    if min(shares[0], shares[1], shares[2]) < -1e-9 * math.sqrt(load[0] ** 2 + load[1] ** 2):
        return False
    if not _others_open(touch, a, b, work.twist, dt, slack):
        return False
    _clear_forces(work.force)
    for q in range(2):
        work.force[a, q] = shares[0] * rays[0, q] + shares[1] * rays[1, q]
        work.force[b, q] = shares[2] * rays[2, q]
    work.mode[a] = STICKING
    return True


@inner
def _both_slip(table, at, touch, i, j, origin, way, span, speed, mu, length, dt, slack, work):  # type: ignore[no-untyped-def]
    """Whether two closed contacts can both slip, somewhere on ``work.line`` from ``origin`` on for ``span`` (or to the far end,
    if it is not finite) in the direction ``way``, where neither turns its slip round."""
    line, rays, load, twist = work.line, work.rays, work.load, work.twist
    far = math.isinf(span)
    middle = origin + way * (speed if far else 0.5 * span)
    _sliding_edge(touch, i, _slip(touch, i, line, middle), 1e-12 * speed, mu, length, work, 0)
    _sliding_edge(touch, j, _slip(touch, j, line, middle), 1e-12 * speed, mu, length, work, 1)
    # the load lies in the plane of the two edges
    ax = rays[0, 1] * rays[1, 2] - rays[0, 2] * rays[1, 1]
    ay = rays[0, 2] * rays[1, 0] - rays[0, 0] * rays[1, 2]
    az = rays[0, 0] * rays[1, 1] - rays[0, 1] * rays[1, 0]
    behind, f_behind = 0.0, 0.0
    for place in range(_PLACES):
        if far:
            ahead = speed * 10.0 ** (-6.0 + 10.0 * (place - 1) / (_PLACES - 2)) if place else 0.0
        else:
            ahead = span * place / (_PLACES - 1)
        _load_on_line(table, at, line, origin + way * ahead, twist, load)
        f_ahead = ax * load[0] + ay * load[1] + az * load[2] / length
        if place and (f_ahead == 0.0 or (f_ahead > 0.0) != (f_behind > 0.0)):
            low, high, f_low, f_high, side = behind, ahead, f_behind, f_ahead, 0
            for turn in range(_MOST_STEPS):
                slip = _middle(low, high, f_low, f_high, turn)
                _load_on_line(table, at, line, origin + way * slip, twist, load)
                value = ax * load[0] + ay * load[1] + az * load[2] / length
                size = abs(load[0]) + abs(load[1]) + abs(load[2]) / length
                if abs(value) <= 1e-13 * size or high - low <= 4e-16 * (low + high):
                    break
                low, high, f_low, f_high, side = _narrowed(low, high, f_low, f_high, side, slip, value)
            # shares of the two edges, by least squares
            aa = ab = bb = af = bf = 0.0
            for q in range(3):
                f = load[q] / length if q == 2 else load[q]
                aa += rays[0, q] * rays[0, q]
                ab += rays[0, q] * rays[1, q]
                bb += rays[1, q] * rays[1, q]
                af += rays[0, q] * f
                bf += rays[1, q] * f
            determinant = aa * bb - ab * ab
            first, second = (af * bb - bf * ab) / determinant, (bf * aa - af * ab) / determinant
            size = math.sqrt(load[0] ** 2 + load[1] ** 2)
            if min(first, second) >= -1e-9 * size and _others_open(touch, i, j, twist, dt, slack):
                _clear_forces(work.force)
                for q in range(2):
                    work.force[i, q], work.force[j, q] = first * rays[0, q], second * rays[1, q]
                return True
        behind, f_behind = ahead, f_ahead
    return False


@inner
def _two_slide(table, at, touch, i, j, mu, length, dt, slack, work):  # type: ignore[no-untyped-def]
    """Whether two closed contacts can move on along ``work.line`` with one of them or both slipping; twist, load, forces and
    modes in ``work``."""
    line = work.line
    speed = math.sqrt(line[0, 0] ** 2 + line[0, 1] ** 2 + (length * line[0, 2]) ** 2) + 1e-300
    # a contact that closes in this step moves along as it does: then not both stop slipping at one place of the line
    first, second = _sticks_at(touch, i, line, speed), _sticks_at(touch, j, line, speed)
    apart = abs(first - second) > 1e-9 * speed
    if apart or math.isnan(first) or math.isnan(second):
        if not math.isnan(first) and _one_of_two_sticks(table, at, touch, i, j, first, speed, mu, length, dt, slack, work):
            return True
        if not math.isnan(second) and _one_of_two_sticks(table, at, touch, j, i, second, speed, mu, length, dt, slack, work):
            return True
    first = second if math.isnan(first) else first
    second = first if math.isnan(second) else second
    if math.isnan(first):
        first = second = 0.0
    low, high = min(first, second), max(first, second)
    if _both_slip(table, at, touch, i, j, high, 1.0, math.inf, speed, mu, length, dt, slack, work):
        return True
    if _both_slip(table, at, touch, i, j, low, -1.0, math.inf, speed, mu, length, dt, slack, work):
        return True
    return apart and _both_slip(table, at, touch, i, j, low, 1.0, high - low, speed, mu, length, dt, slack, work)


@inner
def _free_twist(table, at, twist, load):  # type: ignore[no-untyped-def]
    """Twist with no contact: at rest, or braked by friction over the step."""
    twist[0] = twist[1] = twist[2] = 0.0
    if table.inertia[0] > 0.0 and (at.vx != 0.0 or at.vy != 0.0 or at.omega != 0.0):
        # what friction takes of the last twist in the step; it does not turn it round
        load_of(table, at, at.vx, at.vy, at.omega, load)
        vx, vy = at.vx - at.dt * load[0] / table.inertia[0], at.vy - at.dt * load[1] / table.inertia[0]
        w = at.omega - at.dt * load[2] / table.inertia[1]
        if table.inertia[0] * (vx * at.vx + vy * at.vy) + table.inertia[1] * w * at.omega > 0.0:
            twist[0], twist[1], twist[2] = vx, vy, w
    load[0] = load[1] = load[2] = 0.0


@inner
def _first_answer(found, twist, load, answer):  # type: ignore[no-untyped-def]
    """Count an answer; whether it is the first, which is kept: its twist and load."""
    answer.found[0] = found
    if found > 1:
        return False
    for q in range(3):
        answer.twist[q], answer.load[q] = twist[q], load[q]
    return True


@compiled
def respond(table, at, touch, pushed, mu, length, dt, every, answer, work):  # type: ignore[no-untyped-def]
    """Fill ``answer`` with how the slider moves: ``pushed`` (3,) is the twist it would have if it were stuck to the pusher.

    Sticking comes before sliding, more contacts before fewer. ``every`` counts all combinations of modes that are consistent;
    else the first ends the search. Without any the slider stays, jammed.
    """
    k = touch.number[0]
    speed = 0.0
    for m in range(k):
        speed = max(speed, math.sqrt(touch.velocity[m, 0] ** 2 + touch.velocity[m, 1] ** 2))
    slack = 1e-9 * speed + 1e-13
    found = 0
    twist, load, force, line = work.twist, work.load, work.force, work.line
    _free_twist(table, at, twist, load)
    _clear_forces(answer.force)
    for m in range(MOST_CONTACTS):
        answer.mode[m] = OPEN
    free = _others_open(touch, -1, -1, twist, dt, slack)
    if not free:
        twist[0] = twist[1] = twist[2] = 0.0
    _first_answer(1 if free else 0, twist, load, answer)
    if free:
        return
    # all stick: pairs of several
    for i in range(k):
        for j in range(i + 1, k):
            if not _closing(touch, i, j, pushed, length, dt, line):
                continue
            place = _both_stick_at(touch, i, j, line, speed + length * abs(pushed[2]) + 1e-300, dt)
            if math.isnan(place):
                continue
            _load_on_line(table, at, line, place, twist, load)
            if not _others_open(touch, i, j, twist, dt, slack):
                continue
            held = _hold(touch, i, j, False, mu, length, load, work)
            if not held and k > 2 and i == 0 and j == 1:
                held = _hold(touch, i, j, True, mu, length, load, work)
            if not held:
                continue
            found += 1
            if _first_answer(found, twist, load, answer):
                for m in range(k):
                    answer.force[m, 0], answer.force[m, 1] = force[m, 0], force[m, 1]
                    if force[m, 0] != 0.0 or force[m, 1] != 0.0:
                        answer.mode[m] = STICKING
            if not every:
                return
    # one contact: first sticking, then sliding
    for sliding in (False, True):
        for i in range(k):
            nx, ny = touch.normal[i, 0], touch.normal[i, 1]
            back = touch.gap[i] / dt
            ux, uy = touch.velocity[i, 0] - back * nx, touch.velocity[i, 1] - back * ny
            if ux * nx + uy * ny <= 0.0:
                # nothing presses here
                continue
            px, py = touch.point[i, 0], touch.point[i, 1]
            mode = _one_contact(table, at, px, py, nx, ny, ux, uy, mu, pushed[2], length, sliding, twist, load)
            if mode < 0 or (sliding and mode == STICKING) or not _others_open(touch, i, i, twist, dt, slack):
                continue
            found += 1
            if _first_answer(found, twist, load, answer):
                answer.force[i, 0], answer.force[i, 1] = load[0], load[1]
                answer.mode[i] = mode
            if not every:
                return
        if sliding:
            break
        for i in range(k):
            for j in range(i + 1, k):
                if not _closing(touch, i, j, pushed, length, dt, line):
                    continue
                if not _two_slide(table, at, touch, i, j, mu, length, dt, slack, work):
                    continue
                found += 1
                if _first_answer(found, twist, load, answer):
                    for side in range(2):
                        m = i if side == 0 else j
                        answer.force[m, 0], answer.force[m, 1] = force[m, 0], force[m, 1]
                        answer.mode[m] = work.mode[m]
                if not every:
                    return
