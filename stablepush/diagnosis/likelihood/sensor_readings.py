"""Compiled: what a sensor at the pusher reads for the motions of a log, with effects, linear in the support's loads."""

from __future__ import annotations

import math

from stablepush.core import compiled, inner
from stablepush.effects import FASTEST, PLACE, SLOWEST
from stablepush.geometry.kernels import exp_of
from stablepush.mechanics.kernels import friction_at, joint_anisotropy

#: Square of the speed (m/s) of a point below which its friction goes with its speed: far below any that moves.
_CREEP = 1e-18


@inner
def _principal(a, b):  # type: ignore[no-untyped-def]
    """Entries ``xx, xy, yy`` of ``A`` and of ``A²``: friction along its principal axes, over the geometric mean. Its squares,
    over their own mean, are ``1 ± √(a² + b²)``, the greater along ``atan2(b, a)/2``."""
    share = min(math.sqrt(a * a + b * b), 1.0 - 1e-6)
    mean = (1.0 - share * share) ** 0.25
    great, small = math.sqrt(1.0 + share), math.sqrt(1.0 - share)
    middle, half = 0.5 * (great + small) / mean, 1.0 / ((great + small) * mean)
    square = mean * mean
    return (middle + half * a, half * b, middle - half * a), ((1.0 + a) / square, b / square, (1.0 - a) / square)


@inner
def _waves(ex, ey, c, s, theta, at):  # type: ignore[no-untyped-def]
    """What the force of unit friction along a unit velocity has more, of a power that has ``Σ a cos kφ + b sin kφ`` more, k 4
    and 6; the force of a convex set of forces: (power, slope of it) along and to the left. ``φ`` in axes turned by (c, s)."""
    x, y = c * ex + s * ey, c * ey - s * ex
    c2, s2 = x * x - y * y, 2 * x * y
    c4, s4 = c2 * c2 - s2 * s2, 2 * c2 * s2
    c6, s6 = c4 * c2 - s4 * s2, s4 * c2 + c4 * s2
    power = theta[at] * c4 + theta[at + 1] * s4 + theta[at + 2] * c6 + theta[at + 3] * s6
    slope = 4 * (theta[at + 1] * c4 - theta[at] * s4) + 6 * (theta[at + 3] * c6 - theta[at + 2] * s6)
    return power * ex - slope * ey, power * ey + slope * ex


@inner
def _share_over_place(x, y, theta):  # type: ignore[no-untyped-def]
    x, y = x / PLACE, y / PLACE
    return (
        theta[30] * x * x + theta[31] * x * y + theta[32] * y * y
        + x * x * (theta[33] * x + theta[34] * y) + y * y * (theta[35] * x + theta[36] * y)
    )  # fmt: skip


@compiled
def read(  # type: ignore[no-untyped-def]
    points, center, inertia, weight, reference, order, pose, twist, acceleration, place, tool, theta, loads, matrix, constant
):
    """Fill ``constant`` (n, 3) with the readings for friction ``loads`` (k,), in the tracked frame.

    With ``matrix`` (n, 3, k), if it has rows, the readings are split: ``matrix`` takes those for unit loads of each point and
    ``constant`` what does not depend on loads. ``theta``: anisotropy of the table (2), of the slider (2), speed, gradient (2),
    drift, shift (2), spread, slope of the table (2), mass, bias (2), angle of the sensor, offset of the frame (2), delay; then
    the terms of families (:data:`stablepush.effects.FAMILIES`) of the table's anisotropy, the slider's, speed, place, drift,
    slope, bias, angle, delay and offset. All 0 without effects. ``tool`` (n,): heading of the pusher, which carries the sensor.
    """
    split = matrix.shape[0] > 0
    table, _ = _principal(theta[0], theta[1])
    _, body = _principal(theta[2], theta[3])
    isotropic = theta[0] == 0.0 and theta[1] == 0.0 and theta[2] == 0.0 and theta[3] == 0.0
    for i in range(pose.shape[0]):
        x, y, angle = pose[i, 0], pose[i, 1], pose[i, 2]
        vx, vy, w = twist[i, 0], twist[i, 1], twist[i, 2]
        c, s = math.cos(angle), math.sin(angle)
        measured_c, measured_s = c, s
        late = order[i] - 0.5
        delay = theta[19] + late * theta[50]
        if delay != 0.0:
            # where the slider is now, from the pose and the motion of a little before
            dx, dy, turn = exp_of(vx, vy, w, delay)
            x, y, angle = x + c * dx - s * dy, y + s * dx + c * dy, angle + turn
            c, s = math.cos(angle), math.sin(angle)
            vx, vy, w = vx + delay * acceleration[i, 0], vy + delay * acceleration[i, 1], w + delay * acceleration[i, 2]
        ox, oy = theta[17] + late * theta[51], theta[18] + late * theta[52]
        x, y = x - c * ox + s * oy, y - s * ox - c * oy
        vx, vy = vx + w * oy, vy - w * ox
        m = joint_anisotropy(table, body, c, s)
        hump = 4 * order[i] * (1.0 - order[i])
        scale = 1.0 + theta[7] * order[i] + hump * (theta[37] + 4 * late * (theta[38] + 2 * late * theta[39]))
        waves_w = theta[20] != 0.0 or theta[21] != 0.0 or theta[22] != 0.0 or theta[23] != 0.0
        waves_b = theta[24] != 0.0 or theta[25] != 0.0 or theta[26] != 0.0 or theta[27] != 0.0
        over_place = False
        for q in range(30, 37):
            over_place = over_place or theta[q] != 0.0
        # from a load at the origin of B to the reading: turned into W, moved to the sensor, heading it, moved to the tracked
        # origin, turned into the tracked frame
        arm_x, arm_y = x - place[i, 0], y - place[i, 1]
        back_x, back_y = place[i, 0] - pose[i, 0], place[i, 1] - pose[i, 1]
        cs, ss = math.cos(theta[16] + late * theta[49]), math.sin(theta[16] + late * theta[49])
        fx = fy = tau = 0.0
        for k in range(points.shape[0]):
            px = center[0] + (1.0 + theta[10]) * (points[k, 0] - center[0]) + theta[8]
            py = center[1] + (1.0 + theta[10]) * (points[k, 1] - center[1]) + theta[9]
            ux, uy = vx - w * py, vy + w * px
            at_x, at_y = x + c * px - s * py, y + s * px + c * py
            ex, ey, share = friction_at(ux, uy, at_x, at_y, m, isotropic, (theta[5], theta[6]), theta[4], reference, _CREEP)
            # terms of families, which no simulation has
            speed = math.sqrt(ux * ux + uy * uy + _CREEP)
            if waves_w:
                # from B into W the angle is greater by the heading
                mx, my = _waves(ux / speed, uy / speed, c, -s, theta, 20)
                ex, ey = ex + share * mx, ey + share * my
            if waves_b:
                mx, my = _waves(ux / speed, uy / speed, 1.0, 0.0, theta, 24)
                ex, ey = ex + share * mx, ey + share * my
            more = scale
            if theta[28] != 0.0 or theta[29] != 0.0:
                u = min(FASTEST, max(SLOWEST, math.log(speed / reference)))
                more *= max(0.05, 1.0 + u * u * (theta[28] + theta[29] * u))
            if over_place:
                more *= max(0.05, 1.0 + _share_over_place(at_x, at_y, theta))
            ex, ey = more * ex, more * ey
            if split:
                matrix[i, 0, k], matrix[i, 1, k], matrix[i, 2, k] = ex, ey, px * ey - py * ex
            else:
                fx += loads[k] * ex
                fy += loads[k] * ey
                tau += loads[k] * (px * ey - py * ex)
        # the slope pulls, and the mass that speeds up holds back
        sx = theta[11] + (theta[40] * x + theta[41] * y) / PLACE
        sy = theta[12] + (theta[41] * x + theta[42] * y) / PLACE
        fx -= weight * (c * sx + s * sy)
        fy -= weight * (-s * sx + c * sy)
        mass = theta[13]
        fx += mass * (acceleration[i, 0] - w * vy)
        fy += mass * (acceleration[i, 1] + w * vx)
        tau += mass * inertia * acceleration[i, 2]
        for k in range(-1, points.shape[0] if split else 0):
            if k >= 0:
                fx, fy, tau = matrix[i, 0, k], matrix[i, 1, k], matrix[i, 2, k]
            gx, gy = c * fx - s * fy, s * fx + c * fy
            moment = tau + arm_x * gy - arm_y * gx
            gx, gy = (
                cs * gx - ss * gy + theta[47] * gx + theta[48] * gy,
                ss * gx + cs * gy + theta[48] * gx - theta[47] * gy,
            )
            if k < 0:
                ct, st = math.cos(tool[i]), math.sin(tool[i])
                gx += theta[14] + late * theta[43] + ct * theta[45] - st * theta[46]
                gy += theta[15] + late * theta[44] + st * theta[45] + ct * theta[46]
            tau = moment + back_x * gy - back_y * gx
            fx, fy = measured_c * gx + measured_s * gy, -measured_s * gx + measured_c * gy
            if k < 0:
                constant[i, 0], constant[i, 1], constant[i, 2] = fx, fy, tau
            else:
                matrix[i, 0, k], matrix[i, 1, k], matrix[i, 2, k] = fx, fy, tau
