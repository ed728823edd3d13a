"""Compiled: the rollout of a slider under the imposed motion of a pusher, with contacts that close and open."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray, compiled, inner
from stablepush.geometry.kernels import exp_of
from stablepush.mechanics.kernels.contact_law import respond
from stablepush.mechanics.kernels.contacts import MOST_CONTACTS, OPEN
from stablepush.mechanics.kernels.friction import Motion

#: How deep (m) a finger without a radius may be in the slider before its contact is lost.
_DEEP = 2e-4
#: A finger with no larger radius (m) is a point.
_POINT = 1e-5
#: A finger less deep (m) than this behind an edge touches it wherever it moves.
_SHALLOW = 1e-6
#: How far (m) beyond its ends a flat pusher is touched by corners, and how far from corners its ends touch edges.
_OVERLAP = 1e-9
#: Depths (m) that differ by less are the same.
_SAME = 1e-9


class Pusher(NamedTuple):
    """Discs at ``fingers`` (k, 2) of ``radius`` (m), or a flat edge across the frame's origin from ``-half`` to ``half`` (m) in y
    if ``half`` is not zero, its ends being the fingers; all in the pusher's frame."""

    fingers: FloatArray
    radius: float
    half: float


@inner
def _add(touch, px, py, nx, ny, gap, finger):  # type: ignore[no-untyped-def]
    m = touch.number[0]
    if m < MOST_CONTACTS:
        touch.point[m, 0], touch.point[m, 1] = px, py
        touch.normal[m, 0], touch.normal[m, 1] = nx, ny
        touch.gap[m], touch.finger[m] = gap, finger
        touch.number[0] = m + 1


@inner
def _overrun(outline, e, deep, overlap):  # type: ignore[no-untyped-def]
    """How far (m) beyond the two ends of an edge a point touches it that is ``deep`` behind: behind an inner corner its foot may
    miss both edges."""
    n = outline.shape[0]
    ax, ay, bx, by = outline[e, 0], outline[e, 1], outline[(e + 1) % n, 0], outline[(e + 1) % n, 1]
    before = (ax - outline[e - 1, 0]) * (by - ay) - (ay - outline[e - 1, 1]) * (bx - ax)
    after = (bx - ax) * (outline[(e + 2) % n, 1] - by) - (by - ay) * (outline[(e + 2) % n, 0] - bx)
    return 2.0 * deep if before < 0.0 else -overlap, 2.0 * deep if after < 0.0 else -overlap


@inner
def find_touch(outline, pusher, x, y, c, s, qx, qy, qc, qs, pushed, reach, touch):  # type: ignore[no-untyped-def]
    """Find the contacts of a slider at (x, y, c, s) with a pusher at (qx, qy, qc, qs), and those that may close within
    ``reach``; ``pushed`` is the twist of a slider that is stuck to the pusher."""
    touch.number[0] = 0
    n = outline.shape[0]
    # the pusher's frame in B
    fx, fy = c * (qx - x) + s * (qy - y), -s * (qx - x) + c * (qy - y)
    fc, fs = c * qc + s * qs, c * qs - s * qc
    radius = pusher.radius
    # where a corner of the slider and an end of a flat edge pass each other, it is the corner that touches the edge
    overlap = _OVERLAP if pusher.half > 0.0 else 0.0
    deepest = -max(radius, _DEEP, 2.0 * reach) - _SAME
    for k in range(pusher.fingers.shape[0]):
        a, b = pusher.fingers[k, 0], pusher.fingers[k, 1]
        cx, cy = fx + fc * a - fs * b, fy + fs * a + fc * b
        # a disc that a step has left a little inside touches the edges that its centre is not behind; a point came through the
        # edge that it moves into and is least deep behind
        ux, uy = pushed[0] - pushed[2] * cy, pushed[1] + pushed[2] * cx
        shallowest, inside = -math.inf, False
        for e in range(n):
            ax, ay = outline[e, 0], outline[e, 1]
            ex, ey = outline[(e + 1) % n, 0] - ax, outline[(e + 1) % n, 1] - ay
            length = math.sqrt(ex * ex + ey * ey)
            if (ay > cy) != (outline[(e + 1) % n, 1] > cy) and cx < ax + ex * (cy - ay) / ey:
                inside = not inside
            gap = ((cx - ax) * ey - (cy - ay) * ex) / length - radius
            first = last = -overlap
            if gap < 0.0 and radius <= _POINT:
                first, last = _overrun(outline, e, -gap, overlap)
            near = -first <= ((cx - ax) * ex + (cy - ay) * ey) / length <= length + last
            if near and gap <= _SHALLOW and (gap > -_SHALLOW or ex * uy - ey * ux > 0.0):
                shallowest = max(shallowest, gap)
        for e in range(n):
            ax, ay = outline[e, 0], outline[e, 1]
            ex, ey = outline[(e + 1) % n, 0] - ax, outline[(e + 1) % n, 1] - ay
            length = math.sqrt(ex * ex + ey * ey)
            ex, ey = ex / length, ey / length
            along = (cx - ax) * ex + (cy - ay) * ey
            # outside is to the right of an edge
            away = (cx - ax) * ey - (cy - ay) * ex
            gap = away - radius
            first = last = -overlap
            if gap < 0.0 and radius <= _POINT:
                first, last = _overrun(outline, e, -gap, overlap)
            near = -first <= along <= length + last and deepest < gap <= reach
            through = away > -_SAME or (inside and gap >= shallowest - _SAME)
            if near and (gap > -_SHALLOW or (through and ex * uy - ey * ux > 0.0)):
                _add(touch, ax + along * ex, ay + along * ey, -ey, ex, gap, k)
            # the corner at the end of this edge, if it sticks out; the corners of a flat edge meet edges, or are met by them
            if radius == 0.0:
                continue
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
            if abs(across) <= pusher.half + overlap and deepest < along <= reach:
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
    dx, dy, angle = exp_of(vx, vy, w, dt)
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
    touch,
    before,
    solution,
    work,
):
    """Follow a pusher through pieces of constant twist (n, 3), in ``steps`` (n,) even steps each; returns how many steps were
    made.

    A step takes the contacts' places and the load half way through it (the midpoint rule), and closes or keeps the gaps that its
    start has: what a step leaves of a gap, the next one takes back, so they do not add up. ``poses``, ``pushers`` (m + 1, 3); the
    rest has a row for each step: twists in B, loads in B, points (m, 2, 2) and modes (m, 2) and forces (m, 2, 2) of the fingers,
    times at its end, whether nothing was consistent. ``touch``, ``before``, ``solution`` and ``work`` are workspace.
    """
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
                _pushed_twist(mx, my, mc, ms, hx, hy, hc, hs, ux, uy, uw, pushed)
                find_touch(outline, pusher, mx, my, mc, ms, hx, hy, hc, hs, pushed, reach, touch)
                at = Motion(mx, my, mc, ms, lx, ly, omega, dt)
                _velocities(touch, pushed)
                if stage == 1:
                    # gaps are those of the start, of the same contact
                    for m in range(touch.number[0]):
                        for b in range(before.number[0]):
                            near = (touch.point[m, 0] - before.point[b, 0]) ** 2 + (touch.point[m, 1] - before.point[b, 1]) ** 2
                            aligned = touch.normal[m, 0] * before.normal[b, 0] + touch.normal[m, 1] * before.normal[b, 1]
                            if touch.finger[m] == before.finger[b] and near < 16 * reach * reach and aligned > 0.9:
                                touch.gap[m] = before.gap[b]
                respond(table, at, touch, pushed, mu, length, dt, False, solution, work)
                if touch.number[0] == 0 or stage == 1:
                    break
                mx, my, mc, ms = _moved(x, y, c, s, solution.twist[0], solution.twist[1], solution.twist[2], dt / 2)
                hx, hy, hc, hs = _moved(qx, qy, qc, qs, ux, uy, uw, dt / 2)
                before.number[0] = touch.number[0]
                for m in range(touch.number[0]):
                    before.gap[m], before.finger[m] = touch.gap[m], touch.finger[m]
                    for q in range(2):
                        before.point[m, q], before.normal[m, q] = touch.point[m, q], touch.normal[m, q]
            vx, vy, omega = solution.twist[0], solution.twist[1], solution.twist[2]
            x, y, c, s = _moved(x, y, c, s, vx, vy, omega, dt)
            theta += omega * dt
            qx, qy, qc, qs = _moved(qx, qy, qc, qs, ux, uy, uw, dt)
            phi += uw * dt
            now += dt
            times[row] = now
            jams[row] = solution.found[0] == 0
            for q in range(3):
                moves[row, q], loads[row, q] = solution.twist[q], solution.load[q]
            for k in range(2):
                modes[row, k] = OPEN
                for q in range(2):
                    points[row, k, q], forces[row, k, q] = math.nan, 0.0
            for m in range(touch.number[0]):
                f = touch.finger[m]
                if f < 2 and solution.mode[m] != OPEN:
                    points[row, f, 0], points[row, f, 1] = touch.point[m, 0], touch.point[m, 1]
                    modes[row, f] = solution.mode[m]
                    forces[row, f, 0] += solution.force[m, 0]
                    forces[row, f, 1] += solution.force[m, 1]
            row += 1
            poses[row, 0], poses[row, 1], poses[row, 2] = x, y, theta
            pushers[row, 0], pushers[row, 1], pushers[row, 2] = qx, qy, phi
    return row
