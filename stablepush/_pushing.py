"""Compiled: how a slider moves when a pusher of imposed motion touches it.

At an instant the slider's twist ``V`` and the contact forces ``f_i`` obey: the load ``F(V)`` of the table is ``Σ (f_i, p_i ×
f_i)``; no contact penetrates, ``g_i = n_i·(v(p_i) - u_i) >= 0`` with ``u_i`` the pusher's velocity there; open contacts (``g_i >
0``) have no force; sticking ones keep ``v = u`` with ``f`` in the friction cone; sliding ones have ``f`` on the edge of the cone
against the slip.

``F`` is monotone (the gradient of a convex power), so each combination of modes that is possible in the plane leaves at most one
number to be found: the turn about a sticking contact (the torque about it vanishes and grows with the turn), the slip of a single
contact (the force turns monotonically from where it sticks to the edge of its cone), or the slip of two contacts at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush._arrays import FloatArray
from stablepush._compiled import compiled, inner
from stablepush._table import Motion, load_of

#: Modes of a contact: open, sticking, the slider slipping to the left or right of the inward normal.
OPEN, STICKING, LEFT, RIGHT = 0, 1, 2, 3
#: Most contacts at once.
MOST_CONTACTS = 8
#: Iterations of a bracketed root.
_MOST_STEPS = 200
#: Places along the slip of two contacts, over ten decades, between which roots are looked for.
_PLACES = 41


class Pusher(NamedTuple):
    """Discs at ``fingers`` (k, 2) of ``radius`` (m), or a flat edge across the frame's origin from ``-half`` to ``half`` (m) in y
    if ``half`` is not zero, its ends being the fingers; all in the pusher's frame."""

    fingers: FloatArray
    radius: float
    half: float


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


@inner
def _between(low, high, f_low, f_high, turn):  # type: ignore[no-untyped-def]
    """The next place to look for a root that is bracketed: secant, every third time the middle."""
    if turn % 3 == 2:
        return 0.5 * (low + high)
    middle = (low * f_high - high * f_low) / (f_high - f_low)
    if not low < middle < high:
        middle = 0.5 * (low + high)
    return middle


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
    best, least = low, abs(f_low)
    side = 0
    for turn in range(_MOST_STEPS):
        middle = _between(low, high, f_low, f_high, turn)
        value = _torque_about(table, at, px, py, ux, uy, middle, load)
        if abs(value) < least:
            best, least = middle, abs(value)
        if abs(value) <= 1e-14 * size or high - low <= 4e-16 * (abs(low) + abs(high)):
            best = middle
            break
        if value > 0.0:
            high, f_high = middle, value
            if side == 1:
                f_low *= 0.5
            side = 1
        else:
            low, f_low = middle, value
            if side == -1:
                f_high *= 0.5
            side = -1
    _torque_about(table, at, px, py, ux, uy, best, load)
    return best


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
    speed = math.sqrt(ux * ux + uy * uy)
    low, f_low = 0.0, side * across + mu * normal
    high = 0.02 * speed
    f_high = f_low
    for _ in range(40):
        w = _turn_about(table, at, px, py, ux + side * high * tx, uy + side * high * ty, w, length, load)
        if math.isnan(w):
            return -1
        f_high = side * (tx * load[0] + ty * load[1]) + mu * (nx * load[0] + ny * load[1])
        if f_high >= 0.0:
            break
        low, f_low = high, f_high
        high *= 4.0
    if f_high < 0.0 or f_low > 0.0:
        return -1
    size = math.sqrt(load[0] ** 2 + load[1] ** 2) + 1e-300
    slip = high
    turned = 0
    for turn in range(_MOST_STEPS):
        slip = _between(low, high, f_low, f_high, turn)
        w = _turn_about(table, at, px, py, ux + side * slip * tx, uy + side * slip * ty, w, length, load)
        value = side * (tx * load[0] + ty * load[1]) + mu * (nx * load[0] + ny * load[1])
        if abs(value) <= 1e-13 * size or high - low <= 4e-16 * (low + high):
            break
        if value > 0.0:
            high, f_high = slip, value
            if turned == 1:
                f_low *= 0.5
            turned = 1
        else:
            low, f_low = slip, value
            if turned == -1:
                f_high *= 0.5
            turned = -1
    if nx * load[0] + ny * load[1] <= 0.0:
        return -1
    ux, uy = ux + side * slip * tx, uy + side * slip * ty
    twist[0], twist[1], twist[2] = ux + w * py, uy - w * px, w
    return LEFT if side > 0.0 else RIGHT


@inner
def _solve3(ax, ay, az, bx, by, bz, cx, cy, cz, fx, fy, fz, result):  # type: ignore[no-untyped-def]
    """Shares (3,) of three vectors that make up a fourth; False if they lie in a plane."""
    ux, uy, uz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    determinant = ax * ux + ay * uy + az * uz
    sizes = math.sqrt((ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz) * (cx * cx + cy * cy + cz * cz))
    if abs(determinant) <= 1e-12 * sizes:
        return False
    result[0] = (fx * ux + fy * uy + fz * uz) / determinant
    ux, uy, uz = fy * cz - fz * cy, fz * cx - fx * cz, fx * cy - fy * cx
    result[1] = (ax * ux + ay * uy + az * uz) / determinant
    ux, uy, uz = by * fz - bz * fy, bz * fx - bx * fz, bx * fy - by * fx
    result[2] = (ax * ux + ay * uy + az * uz) / determinant
    return True


@inner
def _hold(touch, i, j, mu, length, load, force):  # type: ignore[no-untyped-def]
    """Whether two contacts, or all if ``i`` is negative, can apply a load within their cones; shares it among them.

    What they press against each other is not determined: the mean of the ways that use three edges of cones is taken.
    """
    force[:] = 0.0
    shares = np.empty(3)
    members = np.array((i, j)) if i >= 0 else np.arange(touch.number[0])
    edges = 2 * len(members)
    ways = 0
    size = math.sqrt(load[0] ** 2 + load[1] ** 2 + (load[2] / length) ** 2)
    rays = np.empty((edges, 3))
    for e in range(edges):
        i = members[e // 2]
        side = mu if e % 2 == 0 else -mu
        nx, ny = touch.normal[i, 0], touch.normal[i, 1]
        rays[e, 0], rays[e, 1] = nx - side * ny, ny + side * nx
        rays[e, 2] = (touch.point[i, 0] * rays[e, 1] - touch.point[i, 1] * rays[e, 0]) / length
    for a in range(edges):
        for b in range(a + 1, edges):
            for c in range(b + 1, edges):
                if not _solve3(
                    rays[a, 0], rays[a, 1], rays[a, 2], rays[b, 0], rays[b, 1], rays[b, 2], rays[c, 0], rays[c, 1], rays[c, 2],
                    load[0], load[1], load[2] / length, shares,
                ):  # fmt: skip
                    continue
                if shares.min() < -1e-9 * size:
                    continue
                ways += 1
                for e, share in ((a, shares[0]), (b, shares[1]), (c, shares[2])):
                    force[members[e // 2], 0] += share * rays[e, 0]
                    force[members[e // 2], 1] += share * rays[e, 1]
    if ways > 0:
        force[:] /= ways
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
def _closing(touch, i, j, pushed, length, dt, base):  # type: ignore[no-untyped-def]
    """Twist next to ``pushed`` that closes the gaps of two contacts, and the direction that keeps them closed, unit in length.

    ``base`` (2, 3) takes both. False where both normals lie on one line.
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
    base[0, 0] = pushed[0] + p * ax + q * bx
    base[0, 1] = pushed[1] + p * ay + q * by
    base[0, 2] = pushed[2] + (p * az + q * bz) / length
    base[1, 0], base[1, 1], base[1, 2] = dx / size, dy / size, dz / size / length
    return True


@inner
def _two_slide(table, at, touch, i, j, mu, base, length, dt, slack, twist, load, force):  # type: ignore[no-untyped-def]
    """Twist and load with two contacts closed and sliding; returns 0 if there is none, else +1 or -1 along ``base[1]``."""
    shares = np.empty(2)
    speed = math.sqrt(base[0, 0] ** 2 + base[0, 1] ** 2 + (length * base[0, 2]) ** 2)
    for way in (1.0, -1.0):
        rays = np.empty((2, 3))
        for k, m in ((0, i), (1, j)):
            nx, ny = touch.normal[m, 0], touch.normal[m, 1]
            px, py = touch.point[m, 0], touch.point[m, 1]
            slip = way * (-ny * (base[1, 0] - base[1, 2] * py) + nx * (base[1, 1] + base[1, 2] * px))
            side = 0.0 if abs(slip) < 1e-12 else (-mu if slip > 0.0 else mu)
            rays[k, 0], rays[k, 1] = nx - side * ny, ny + side * nx
            rays[k, 2] = (px * rays[k, 1] - py * rays[k, 0]) / length
        ax = rays[0, 1] * rays[1, 2] - rays[0, 2] * rays[1, 1]
        ay = rays[0, 2] * rays[1, 0] - rays[0, 0] * rays[1, 2]
        az = rays[0, 0] * rays[1, 1] - rays[0, 1] * rays[1, 0]
        last, f_last = 0.0, 0.0
        for k in range(_PLACES):
            slip = speed * 10.0 ** (-6.0 + 10.0 * (k - 1) / (_PLACES - 2)) if k else 0.0
            load_of(table, at, base[0, 0] + way * slip * base[1, 0], base[0, 1] + way * slip * base[1, 1],
                    base[0, 2] + way * slip * base[1, 2], load)  # fmt: skip
            value = ax * load[0] + ay * load[1] + az * load[2] / length
            if k and (value == 0.0 or (value > 0.0) != (f_last > 0.0)):
                low, high, f_low, f_high = last, slip, f_last, value
                turned = 0
                for turn in range(_MOST_STEPS):
                    middle = _between(low, high, f_low, f_high, turn)
                    load_of(table, at, base[0, 0] + way * middle * base[1, 0], base[0, 1] + way * middle * base[1, 1],
                            base[0, 2] + way * middle * base[1, 2], load)  # fmt: skip
                    found = ax * load[0] + ay * load[1] + az * load[2] / length
                    size = abs(load[0]) + abs(load[1]) + abs(load[2]) / length
                    if abs(found) <= 1e-13 * size or high - low <= 4e-16 * (low + high):
                        break
                    if (found > 0.0) == (f_high > 0.0):
                        high, f_high = middle, found
                        if turned == 1:
                            f_low *= 0.5
                        turned = 1
                    else:
                        low, f_low = middle, found
                        if turned == -1:
                            f_high *= 0.5
                        turned = -1
                for q in range(3):
                    twist[q] = base[0, q] + way * middle * base[1, q]
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
                shares[0], shares[1] = (af * bb - bf * ab) / determinant, (bf * aa - af * ab) / determinant
                size = math.sqrt(load[0] ** 2 + load[1] ** 2)
                if shares.min() >= -1e-9 * size and _others_open(touch, i, j, twist, dt, slack):
                    force[:] = 0.0
                    for q in range(2):
                        force[i, q], force[j, q] = shares[0] * rays[0, q], shares[1] * rays[1, q]
                    return 1 if way > 0.0 else -1
            last, f_last = slip, value
    return 0


@inner
def _free_twist(table, at, twist, load):  # type: ignore[no-untyped-def]
    """Twist with no contact: at rest, or braked by friction over the step."""
    twist[:] = 0.0
    if table.inertia[0] > 0.0 and (at.vx != 0.0 or at.vy != 0.0 or at.omega != 0.0):
        # what friction takes of the last twist in the step; it does not turn it round
        load_of(table, at, at.vx, at.vy, at.omega, load)
        vx, vy = at.vx - at.dt * load[0] / table.inertia[0], at.vy - at.dt * load[1] / table.inertia[0]
        w = at.omega - at.dt * load[2] / table.inertia[1]
        if table.inertia[0] * (vx * at.vx + vy * at.vy) + table.inertia[1] * w * at.omega > 0.0:
            twist[0], twist[1], twist[2] = vx, vy, w
    load[:] = 0.0


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
    twist, load, force, base = work.twist, work.load, work.force, work.base
    answer.twist[:] = 0.0
    answer.load[:] = 0.0
    answer.force[:] = 0.0
    answer.mode[:] = OPEN
    _free_twist(table, at, twist, load)
    if _others_open(touch, -1, -1, twist, dt, slack):
        answer.twist[:] = twist
        answer.found[0] = 1
        return
    guess = pushed[2]
    # all stick: then pairs of several
    if k >= 2:
        for i in range(k):
            for j in range(i + 1, k):
                if not _closing(touch, i, j, pushed, length, dt, base):
                    continue
                if not _others_open(touch, i, j, base[0], dt, slack):
                    continue
                load_of(table, at, base[0, 0], base[0, 1], base[0, 2], load)
                held = _hold(touch, i, j, mu, length, load, force)
                if not held and k > 2 and i == 0 and j == 1:
                    held = _hold(touch, -1, -1, mu, length, load, force)
                if held:
                    found += 1
                    if found == 1:
                        answer.twist[:] = base[0]
                        answer.load[:] = load
                        for m in range(k):
                            answer.force[m] = force[m]
                            if force[m, 0] != 0.0 or force[m, 1] != 0.0:
                                answer.mode[m] = STICKING
                    if not every:
                        answer.found[0] = found
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
            mode = _one_contact(
                table, at, touch.point[i, 0], touch.point[i, 1], nx, ny, ux, uy, mu, guess, length, sliding, twist, load
            )
            if mode < 0 or (sliding and mode == STICKING) or not _others_open(touch, i, i, twist, dt, slack):
                continue
            found += 1
            if found == 1:
                answer.twist[:] = twist
                answer.load[:] = load
                answer.force[i, 0], answer.force[i, 1] = load[0], load[1]
                answer.mode[i] = mode
            if not every:
                answer.found[0] = found
                return
        if sliding:
            break
        for i in range(k):
            for j in range(i + 1, k):
                if not _closing(touch, i, j, pushed, length, dt, base):
                    continue
                way = _two_slide(table, at, touch, i, j, mu, base, length, dt, slack, twist, load, force)
                if way == 0:
                    continue
                found += 1
                if found == 1:
                    answer.twist[:] = twist
                    answer.load[:] = load
                    for m in (i, j):
                        answer.force[m] = force[m]
                        tx, ty = -touch.normal[m, 1], touch.normal[m, 0]
                        slip = tx * (base[1, 0] - base[1, 2] * touch.point[m, 1]) + ty * (
                            base[1, 1] + base[1, 2] * touch.point[m, 0]
                        )
                        answer.mode[m] = LEFT if slip * way > 0.0 else RIGHT
                if not every:
                    answer.found[0] = found
                    return
    answer.found[0] = found


class Work(NamedTuple):
    """Room for what is tried."""

    twist: FloatArray
    load: FloatArray
    force: FloatArray
    base: FloatArray


@inner
def _add(touch, px, py, nx, ny, gap, finger):  # type: ignore[no-untyped-def]
    m = touch.number[0]
    if m < MOST_CONTACTS:
        touch.point[m, 0], touch.point[m, 1] = px, py
        touch.normal[m, 0], touch.normal[m, 1] = nx, ny
        touch.gap[m], touch.finger[m] = gap, finger
        touch.number[0] = m + 1


@inner
def find_touch(outline, pusher, x, y, c, s, qx, qy, qc, qs, reach, touch):  # type: ignore[no-untyped-def]
    """Find the contacts of a slider at (x, y, c, s) with a pusher at (qx, qy, qc, qs), and those that may close within
    ``reach``."""
    touch.number[0] = 0
    n = outline.shape[0]
    # the pusher's frame in B
    fx, fy = c * (qx - x) + s * (qy - y), -s * (qx - x) + c * (qy - y)
    fc, fs = c * qc + s * qs, c * qs - s * qc
    radius = pusher.radius
    deepest = -max(radius, 2e-4)
    for k in range(pusher.fingers.shape[0]):
        a, b = pusher.fingers[k, 0], pusher.fingers[k, 1]
        cx, cy = fx + fc * a - fs * b, fy + fs * a + fc * b
        for e in range(n):
            ax, ay = outline[e, 0], outline[e, 1]
            ex, ey = outline[(e + 1) % n, 0] - ax, outline[(e + 1) % n, 1] - ay
            length = math.sqrt(ex * ex + ey * ey)
            ex, ey = ex / length, ey / length
            along = (cx - ax) * ex + (cy - ay) * ey
            # outside is to the right of an edge
            away = (cx - ax) * ey - (cy - ay) * ex
            gap = away - radius
            if 0.0 <= along <= length and deepest < gap <= reach:
                _add(touch, ax + along * ex, ay + along * ey, -ey, ex, gap, k)
            # the corner at the end of this edge, if it sticks out
            ox, oy = outline[(e + 2) % n, 0] - outline[(e + 1) % n, 0], outline[(e + 2) % n, 1] - outline[(e + 1) % n, 1]
            if ex * oy - ey * ox > 0.0 and along > length:
                dx, dy = outline[(e + 1) % n, 0] - cx, outline[(e + 1) % n, 1] - cy
                if dx * ox + dy * oy > 0.0:
                    far = math.sqrt(dx * dx + dy * dy)
                    if far - radius <= reach and far > 1e-12:
                        _add(touch, outline[(e + 1) % n, 0], outline[(e + 1) % n, 1], dx / far, dy / far, far - radius, k)
    if pusher.half > 0.0:
        # corners of the slider on the flat edge, which pushes along x
        for e in range(n):
            gx, gy = outline[e, 0] - fx, outline[e, 1] - fy
            along, across = fc * gx + fs * gy, -fs * gx + fc * gy
            if abs(across) < pusher.half and deepest < along <= reach:
                ax, ay = outline[e, 0] - outline[e - 1, 0], outline[e, 1] - outline[e - 1, 1]
                bx, by = outline[(e + 1) % n, 0] - outline[e, 0], outline[(e + 1) % n, 1] - outline[e, 1]
                if ax * by - ay * bx > 0.0:
                    _add(touch, outline[e, 0], outline[e, 1], fc, fs, along, 0 if across < 0.0 else 1)


@inner
def _velocities(touch, pushed):  # type: ignore[no-untyped-def]
    for m in range(touch.number[0]):
        touch.velocity[m, 0] = pushed[0] - pushed[2] * touch.point[m, 1]
        touch.velocity[m, 1] = pushed[1] + pushed[2] * touch.point[m, 0]


@inner
def _moved(x, y, c, s, vx, vy, w, dt):  # type: ignore[no-untyped-def]
    """Pose (x, y, cos, sin) after a body twist is followed for a time."""
    angle = w * dt
    half = angle / 2
    shrink = math.sin(half) / half if abs(half) > 1e-12 else 1.0
    a, b = shrink * math.cos(half), shrink * math.sin(half)
    dx, dy = dt * (a * vx - b * vy), dt * (b * vx + a * vy)
    cw, sw = math.cos(angle), math.sin(angle)
    return x + c * dx - s * dy, y + s * dx + c * dy, c * cw - s * sw, s * cw + c * sw


@inner
def _pushed_twist(x, y, c, s, qx, qy, qc, qs, ux, uy, w, result):  # type: ignore[no-untyped-def]
    """Twist in B of a slider stuck to a pusher whose twist in its own frame is (ux, uy, w)."""
    # velocity of the pusher's origin in B, then of the slider's origin
    vx, vy = qc * ux - qs * uy, qs * ux + qc * uy
    vx, vy = c * vx + s * vy, -s * vx + c * vy
    fx, fy = c * (qx - x) + s * (qy - y), -s * (qx - x) + c * (qy - y)
    result[0], result[1], result[2] = vx + w * fy, vy - w * fx, w


@compiled
def run(  # type: ignore[no-untyped-def]
    table,
    outline,
    pusher,
    mu,
    start,
    place,
    twists,
    durations,
    steps,
    length,
    poses,
    pushers,
    moves,
    loads,
    points,
    modes,
    forces,
    times,
    jams,
):
    """Follow a pusher through pieces of constant twist (n, 3), in ``steps`` (n,) even steps each; returns how many steps were
    made.

    A step takes the contacts' places and the load half way through it (the midpoint rule), and closes or keeps the gaps that its
    start has: what a step leaves of a gap, the next one takes back, so they do not add up. ``poses``, ``pushers`` (m + 1, 3); the
    rest has a row for each step: twists in B, loads in B, points (m, 2, 2) and modes (m, 2) and forces (m, 2, 2) of the fingers,
    times at its end, whether nothing was consistent.
    """
    room = MOST_CONTACTS
    touch = Touch(
        np.zeros(1, np.int64),
        np.zeros((room, 2)),
        np.zeros((room, 2)),
        np.zeros(room),
        np.zeros((room, 2)),
        np.zeros(room, np.int64),
    )
    before = Touch(
        np.zeros(1, np.int64),
        np.zeros((room, 2)),
        np.zeros((room, 2)),
        np.zeros(room),
        np.zeros((room, 2)),
        np.zeros(room, np.int64),
    )
    answer = Answer(np.zeros(3), np.zeros(3), np.zeros((room, 2)), np.zeros(room, np.int64), np.zeros(1, np.int64))
    work = Work(np.zeros(3), np.zeros(3), np.zeros((room, 2)), np.zeros((2, 3)))
    x, y, theta = start[0], start[1], start[2]
    c, s = math.cos(theta), math.sin(theta)
    qx, qy, phi = place[0], place[1], place[2]
    qc, qs = math.cos(phi), math.sin(phi)
    pushed = np.zeros(3)
    poses[0, 0], poses[0, 1], poses[0, 2] = x, y, theta
    pushers[0, 0], pushers[0, 1], pushers[0, 2] = qx, qy, phi
    vx = vy = omega = 0.0
    row = 0
    now = 0.0
    for piece in range(twists.shape[0]):
        ux, uy, uw = twists[piece, 0], twists[piece, 1], twists[piece, 2]
        dt = durations[piece] / steps[piece]
        far = 0.0
        for k in range(pusher.fingers.shape[0]):
            a, b = pusher.fingers[k, 0], pusher.fingers[k, 1]
            far = max(far, math.sqrt((ux - uw * b) ** 2 + (uy + uw * a) ** 2))
        reach = 2.0 * far * dt + 1e-7
        for _ in range(steps[piece]):
            # frames turn: the last twist, seen in B as it is now
            turn = -omega * dt
            ct, st = math.cos(turn), math.sin(turn)
            lx, ly = ct * vx - st * vy, st * vx + ct * vy
            mx, my, mc, ms, hx, hy, hc, hs = x, y, c, s, qx, qy, qc, qs
            for stage in range(2):
                find_touch(outline, pusher, mx, my, mc, ms, hx, hy, hc, hs, reach, touch)
                at = Motion(mx, my, mc, ms, lx, ly, omega, dt)
                _pushed_twist(mx, my, mc, ms, hx, hy, hc, hs, ux, uy, uw, pushed)
                _velocities(touch, pushed)
                if stage == 1:
                    # gaps are those of the start, of the same contact
                    for m in range(touch.number[0]):
                        for b in range(before.number[0]):
                            near = (touch.point[m, 0] - before.point[b, 0]) ** 2 + (touch.point[m, 1] - before.point[b, 1]) ** 2
                            aligned = touch.normal[m, 0] * before.normal[b, 0] + touch.normal[m, 1] * before.normal[b, 1]
                            if touch.finger[m] == before.finger[b] and near < 16 * reach * reach and aligned > 0.9:
                                touch.gap[m] = before.gap[b]
                respond(table, at, touch, pushed, mu, length, dt, False, answer, work)
                if touch.number[0] == 0 or stage == 1:
                    break
                mx, my, mc, ms = _moved(x, y, c, s, answer.twist[0], answer.twist[1], answer.twist[2], dt / 2)
                hx, hy, hc, hs = _moved(qx, qy, qc, qs, ux, uy, uw, dt / 2)
                before.number[0] = touch.number[0]
                before.point[:], before.normal[:] = touch.point, touch.normal
                before.gap[:], before.finger[:] = touch.gap, touch.finger
            vx, vy, omega = answer.twist[0], answer.twist[1], answer.twist[2]
            x, y, c, s = _moved(x, y, c, s, vx, vy, omega, dt)
            theta += omega * dt
            qx, qy, qc, qs = _moved(qx, qy, qc, qs, ux, uy, uw, dt)
            phi += uw * dt
            now += dt
            times[row] = now
            jams[row] = answer.found[0] == 0
            for q in range(3):
                moves[row, q], loads[row, q] = answer.twist[q], answer.load[q]
            points[row, :, :] = math.nan
            forces[row, :, :] = 0.0
            modes[row, :] = OPEN
            for m in range(touch.number[0]):
                f = touch.finger[m]
                if f < 2 and answer.mode[m] != OPEN:
                    points[row, f, 0], points[row, f, 1] = touch.point[m, 0], touch.point[m, 1]
                    modes[row, f] = answer.mode[m]
                    forces[row, f, 0] += answer.force[m, 0]
                    forces[row, f, 1] += answer.force[m, 1]
            row += 1
            poses[row, 0], poses[row, 1], poses[row, 2] = x, y, theta
            pushers[row, 0], pushers[row, 1], pushers[row, 2] = qx, qy, phi
    return row
