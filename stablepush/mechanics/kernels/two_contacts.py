"""Compiled: how a slider moves with two contacts closed: what holds it, and where on the line of twists that keep them closed one
or both slip."""

from __future__ import annotations

import math

from stablepush.core import inner
from stablepush.mechanics.kernels.contacts import LEFT, RIGHT, STICKING
from stablepush.mechanics.kernels.friction import load_of
from stablepush.mechanics.kernels.one_contact import MOST_STEPS, narrowed, next_place

#: Places along the slip of two contacts, over ten decades, between which roots are looked for.
_PLACES = 41


# Arrays are cleared entry by entry: whole-array statements make the build several times as long.


@inner
def clear_forces(force):  # type: ignore[no-untyped-def]
    for m in range(force.shape[0]):
        force[m, 0] = force[m, 1] = 0.0


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
def hold(touch, i, j, all_of_them, mu, length, load, work):  # type: ignore[no-untyped-def]
    """Whether two contacts, or all, can apply a load within their cones; ``work.force`` is its share of each.

    What they press against each other is not determined: the mean of the ways that use three edges of cones is taken.
    """
    clear_forces(work.force)
    count = touch.number[0] if all_of_them else 2
    for k in range(count):
        m = k if all_of_them else (i if k == 0 else j)
        _edge(touch, m, mu, length, work.rays, 2 * k)
        _edge(touch, m, -mu, length, work.rays, 2 * k + 1)
    fx, fy, fz = load[0], load[1], load[2] / length
    least = -1e-9 * math.sqrt(fx * fx + fy * fy + fz * fz)
    solutions = 0
    for a in range(2 * count):
        for b in range(a + 1, 2 * count):
            for c in range(b + 1, 2 * count):
                if not _shares_of_three(work.rays, a, b, c, fx, fy, fz, work.shares):
                    continue
                if min(work.shares[0], work.shares[1], work.shares[2]) < least:
                    continue
                solutions += 1
                for k in range(3):
                    e = a if k == 0 else (b if k == 1 else c)
                    m = e // 2 if all_of_them else (i if e < 2 else j)
                    work.force[m, 0] += work.shares[k] * work.rays[e, 0]
                    work.force[m, 1] += work.shares[k] * work.rays[e, 1]
    for m in range(touch.number[0]):
        work.force[m, 0] /= max(solutions, 1)
        work.force[m, 1] /= max(solutions, 1)
    return solutions > 0


@inner
def _rate(touch, m, twist, dt):  # type: ignore[no-untyped-def]
    """Speed (m/s) at which a contact opens, over a step: its gap counts."""
    vx = twist[0] - twist[2] * touch.point[m, 1] - touch.velocity[m, 0]
    vy = twist[1] + twist[2] * touch.point[m, 0] - touch.velocity[m, 1]
    return touch.normal[m, 0] * vx + touch.normal[m, 1] * vy + touch.gap[m] / dt


@inner
def others_open(touch, i, j, twist, dt, slack):  # type: ignore[no-untyped-def]
    opening = True
    for m in range(touch.number[0]):
        if m not in (i, j):
            opening = opening and _rate(touch, m, twist, dt) >= -slack
    return opening


@inner
def closing_line(touch, i, j, pushed, length, dt, line):  # type: ignore[no-untyped-def]
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
def both_stick_at(touch, i, j, line, speed, dt):  # type: ignore[no-untyped-def]
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
def load_on_line(table, at, line, s, twist, load):  # type: ignore[no-untyped-def]
    for q in range(3):
        twist[q] = line[0, q] + s * line[1, q]
    load_of(table, at, twist[0], twist[1], twist[2], load)


@inner
def _sliding_edge(touch, m, slip, tiny, mu, length, work, e):  # type: ignore[no-untyped-def]
    """Fill row ``e`` of ``work.rays`` with the edge of the cone of a contact that slips, against the slip, and note its mode."""
    _edge(touch, m, 0.0 if abs(slip) <= tiny else (-mu if slip > 0.0 else mu), length, work.rays, e)
    work.mode[m] = STICKING if abs(slip) <= tiny else (LEFT if slip > 0.0 else RIGHT)


@inner
def _one_of_two_sticks(table, at, touch, a, b, s, speed, mu, length, dt, slack, work):  # type: ignore[no-untyped-def]
    """Whether contact ``a`` can stick while ``b``, closed too, slips: at the place ``s`` of ``work.line``."""
    load, rays, shares = work.load, work.rays, work.shares
    load_on_line(table, at, work.line, s, work.twist, load)
    _edge(touch, a, mu, length, rays, 0)
    _edge(touch, a, -mu, length, rays, 1)
    _sliding_edge(touch, b, _slip(touch, b, work.line, s), 1e-12 * speed, mu, length, work, 2)
    if not _shares_of_three(rays, 0, 1, 2, load[0], load[1], load[2] / length, shares):
        return False
    if min(shares[0], shares[1], shares[2]) < -1e-9 * math.sqrt(load[0] ** 2 + load[1] ** 2):
        return False
    if not others_open(touch, a, b, work.twist, dt, slack):
        return False
    clear_forces(work.force)
    for q in range(2):
        work.force[a, q] = shares[0] * rays[0, q] + shares[1] * rays[1, q]
        work.force[b, q] = shares[2] * rays[2, q]
    work.mode[a] = STICKING
    return True


@inner
def _both_slip(table, at, touch, i, j, origin, direction, span, speed, mu, length, dt, slack, work):  # type: ignore[no-untyped-def]
    """Whether two closed contacts can both slip, somewhere on ``work.line`` from ``origin`` on for ``span`` (or to the far end,
    if it is not finite) in the direction ``direction``, where neither turns its slip round."""
    line, rays, load, twist = work.line, work.rays, work.load, work.twist
    far = math.isinf(span)
    middle = origin + direction * (speed if far else 0.5 * span)
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
        load_on_line(table, at, line, origin + direction * ahead, twist, load)
        f_ahead = ax * load[0] + ay * load[1] + az * load[2] / length
        if place and (f_ahead == 0.0 or (f_ahead > 0.0) != (f_behind > 0.0)):
            low, high, f_low, f_high, side = behind, ahead, f_behind, f_ahead, 0
            for turn in range(MOST_STEPS):
                slip = next_place(low, high, f_low, f_high, turn)
                load_on_line(table, at, line, origin + direction * slip, twist, load)
                value = ax * load[0] + ay * load[1] + az * load[2] / length
                size = abs(load[0]) + abs(load[1]) + abs(load[2]) / length
                if abs(value) <= 1e-13 * size or high - low <= 4e-16 * (low + high):
                    break
                low, high, f_low, f_high, side = narrowed(low, high, f_low, f_high, side, slip, value)
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
            if min(first, second) >= -1e-9 * size and others_open(touch, i, j, twist, dt, slack):
                clear_forces(work.force)
                for q in range(2):
                    work.force[i, q], work.force[j, q] = first * rays[0, q], second * rays[1, q]
                # what slips by rounding only, as without friction where nothing drives the slip, sticks
                if abs(_slip(touch, i, line, origin + direction * slip)) <= 1e-9 * speed:
                    work.mode[i] = STICKING
                if abs(_slip(touch, j, line, origin + direction * slip)) <= 1e-9 * speed:
                    work.mode[j] = STICKING
                return True
        behind, f_behind = ahead, f_ahead
    return False


@inner
def two_slide(table, at, touch, i, j, mu, length, dt, slack, work):  # type: ignore[no-untyped-def]
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
    if not apart:
        # one place: what slips could begin between two that differ by rounding
        first = second = 0.5 * (first + second)
    if math.isnan(first):
        first = second = 0.0
    low, high = min(first, second), max(first, second)
    if _both_slip(table, at, touch, i, j, high, 1.0, math.inf, speed, mu, length, dt, slack, work):
        return True
    if _both_slip(table, at, touch, i, j, low, -1.0, math.inf, speed, mu, length, dt, slack, work):
        return True
    return apart and _both_slip(table, at, touch, i, j, low, 1.0, high - low, speed, mu, length, dt, slack, work)
