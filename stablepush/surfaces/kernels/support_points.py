"""Compiled friction of support points: the load of a twist, and the twist of a load. The only home of these sums."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import compiled, inner
from stablepush.surfaces.kernels.h_inv import CONVERGED, MOST_STEPS

#: Speed of a support point, for unit twists, that is zero but for rounding: the direction of its friction is not determined.
AT_REST = 1e-14


@inner
def load_of_points(points, loads, vx, vy, w, creep, rest):  # type: ignore[no-untyped-def]
    """Return ``Σ m_k (e_k, x_k × e_k)`` as ``(fx, fy, tau)``, with ``e_k = v_k/√(|v_k|² + creep²)``.

    ``v_k = (vx - w y_k, vy + w x_k)``; points slower than ``rest`` have none. With ``creep`` the friction of points that all but
    rest grows with their speed: no jump.
    """
    fx = fy = tau = 0.0
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        px, py = vx - w * y, vy + w * x
        speed = math.sqrt(px * px + py * py + creep * creep)
        if speed > rest:
            share = loads[k] / speed
            fx += share * px
            fy += share * py
            tau += share * (x * py - y * px)
    return fx, fy, tau


@compiled
def sum_loads(points, loads, twists, creep, rest, wrenches):  # type: ignore[no-untyped-def]
    """Fill ``wrenches`` (n, 3) with the loads of twists (n, 3)."""
    for q in range(twists.shape[0]):
        fx, fy, tau = load_of_points(points, loads, twists[q, 0], twists[q, 1], twists[q, 2], creep, rest)
        wrenches[q, 0], wrenches[q, 1], wrenches[q, 2] = fx, fy, tau


@inner
def loads_side_by_side(points, loads, vx, vy, w, fx, fy, tau):  # type: ignore[no-untyped-def]
    """Fill ``fx, fy, tau`` (n,) with the loads of unit twists ``vx, vy, w`` (n,), all of them at once."""
    fx[:] = 0.0
    fy[:] = 0.0
    tau[:] = 0.0
    for k in range(points.shape[0]):
        x, y, load = points[k, 0], points[k, 1], loads[k]
        if load != 0.0:
            # a loop over twists becomes vector instructions, one over points would not
            for q in range(fx.shape[0]):
                px, py = vx[q] - w[q] * y, vy[q] + w[q] * x
                speed = math.sqrt(px * px + py * py)
                share = load / speed if speed > AT_REST else 0.0
                fx[q] += share * px
                fy[q] += share * py
                tau[q] += share * (x * py - y * px)


@compiled
def sum_loads_of_many(points, loads, twists, wrenches):  # type: ignore[no-untyped-def]
    """Fill ``wrenches`` (m, 3, n) with the loads of unit twists (3, n) for m supports of k points each: (m, k, 2), (m, k)."""
    for m in range(points.shape[0]):
        into = wrenches[m]
        loads_side_by_side(points[m], loads[m], twists[0], twists[1], twists[2], into[0], into[1], into[2])


@compiled
def minimize_power(points, loads, wrenches, twists, powers, residuals):  # type: ignore[no-untyped-def]
    """Fill ``twists`` with the minimisers of ``h(V) = Σ m_k |v_k|`` on the plane ``F·V = 1``, and ``powers`` with ``h``.

    ``v_k = (V_x - y_k V_z, V_y + x_k V_z)``; the loads ``F`` (n, 3) are unit vectors. The objective is convex, with a kink at
    every twist that leaves a support point at rest. Such a twist is optimal where ``F`` points into the facet of that support
    point, which is tested first. Else the best kink has a direction of descent, and below its value the objective is smooth:
    damped Newton in the plane. Twists and ``h`` count from that kink, ``V = K + p A + q C`` in a basis of the plane, so
    that the friction of a support point which is nearly at rest keeps its digits.
    ``residuals`` holds the sine of the angle between ``F`` and the load of the twist.
    """
    count = points.shape[0]
    # the power of every kink (y_k, -x_k, 1), once for all queries
    kinks = np.zeros(count)
    for k in range(count):
        for i in range(count):
            vx, vy = points[k, 1] - points[i, 1], points[i, 0] - points[k, 0]
            kinks[k] += loads[i] * math.sqrt(vx * vx + vy * vy)
    # speeds of the support points by the kink
    speeds = np.empty(count)
    for n in range(wrenches.shape[0]):
        fx, fy, fz = wrenches[n, 0], wrenches[n, 1], wrenches[n, 2]
        best = math.inf
        best_k = -1
        for k in range(count):
            along = fx * points[k, 1] - fy * points[k, 0] + fz
            limit = 1e-14 * math.sqrt(points[k, 0] ** 2 + points[k, 1] ** 2 + 1.0)
            if abs(along) > limit and kinks[k] < best * abs(along) * (1.0 - 1e-12):
                best, best_k = kinks[k] / abs(along), k
        # K turns by kz about (x0, y0) and moves by (tx, ty)
        if best_k >= 0:
            x0, y0, tx, ty = points[best_k, 0], points[best_k, 1], 0.0, 0.0
            kz = 1.0 / (fx * y0 - fy * x0 + fz)
        else:
            x0, y0, tx, ty, kz = 0.0, 0.0, fx, fy, fz
        power = sx = sy = rest = 0.0
        for i in range(count):
            kx, ky = tx + kz * (y0 - points[i, 1]), ty + kz * (points[i, 0] - x0)
            speeds[i] = math.sqrt(kx * kx + ky * ky)
            power += loads[i] * speeds[i]
            if speeds[i] > 0.0:
                sx += loads[i] * kx / speeds[i]
                sy += loads[i] * ky / speeds[i]
            else:
                rest += loads[i]
        # basis of the plane F·V = 0
        if abs(fz) < 0.9:
            ax, ay, az = fy, -fx, 0.0
        else:
            ax, ay, az = 0.0, fz, -fy
        norm = math.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax / norm, ay / norm, az / norm
        cx, cy, cz = fy * az - fz * ay, fz * ax - fx * az, fx * ay - fy * ax
        p = q = 0.0
        if best_k >= 0:
            gx, gy = power * fx - sx, power * fy - sy
            pull = math.sqrt(gx * gx + gy * gy)
            # equal but for rounding where every turn up to a limit takes the same power: the point rests
            if pull <= rest * (1.0 + 1e-12):
                twists[n, 0], twists[n, 1], twists[n, 2] = kz * y0, -kz * x0, kz
                powers[n], residuals[n] = power, 0.0
                continue
            # from now on A moves the kink's support point along the pull, the steepest descent, and C moves it across: then only
            # one of the second derivatives may be huge
            a0, a1, c0, c1 = ax - y0 * az, ay + x0 * az, cx - y0 * cz, cy + x0 * cz
            determinant = (a0 * c1 - a1 * c0) * pull
            pa, pc = (c1 * gx - c0 * gy) / determinant, (a0 * gy - a1 * gx) / determinant
            qa, qc = -(c1 * gy + c0 * gx) / determinant, (a0 * gx + a1 * gy) / determinant
            az, cz = pa * az + pc * cz, qa * az + qc * cz
            ax, ay = gx / pull + y0 * az, gy / pull - x0 * az
            cx, cy = -gy / pull + y0 * cz, gx / pull - x0 * cz
            # leave the kink along A as far as the other support points' curvature there says; halve until h falls
            bend = 0.0
            for i in range(count):
                if speeds[i] > 0.0:
                    kx, ky = kz * (y0 - points[i, 1]), kz * (points[i, 0] - x0)
                    across_p = kx * (ay + points[i, 0] * az) - ky * (ax - points[i, 1] * az)
                    bend += loads[i] * across_p * across_p / (speeds[i] * speeds[i] * speeds[i])
            p = min((pull - rest) / bend, 1.0 / max(abs(fx), abs(fy), abs(fz))) if bend > 0.0 else 1.0
            for _ in range(200):
                more = 0.0
                for i in range(count):
                    x, y = points[i, 0], points[i, 1]
                    kx, ky, dx, dy = kz * (y0 - y), kz * (x - x0), p * (ax - y * az), p * (ay + x * az)
                    vx, vy = kx + dx, ky + dy
                    more += loads[i] * ((kx + vx) * dx + (ky + vy) * dy) / (speeds[i] + math.sqrt(vx * vx + vy * vy) + 1e-300)
                if more < 0.0:
                    break
                p *= 0.5
        old_p, old_q = p, q
        best_p, best_q = p, q
        merit = size = smallest = math.inf
        slope = step = dp = dq = 0.0
        stalled = 0
        for _ in range(MOST_STEPS):
            more = gp = gq = gx = gy = gz = 0.0
            hpp = hpq = hqq = 0.0
            for i in range(count):
                x, y = points[i, 0], points[i, 1]
                kx, ky = tx + kz * (y0 - y), ty + kz * (x - x0)
                ax_i, ay_i, cx_i, cy_i = ax - y * az, ay + x * az, cx - y * cz, cy + x * cz
                dx, dy = p * ax_i + q * cx_i, p * ay_i + q * cy_i
                vx, vy = kx + dx, ky + dy
                speed = math.sqrt(vx * vx + vy * vy) + 1e-300
                # |v| - |s| without the loss of digits
                more += loads[i] * ((kx + vx) * dx + (ky + vy) * dy) / (speeds[i] + speed)
                inverse = 1.0 / speed
                push = loads[i] * inverse
                vx, vy = vx * inverse, vy * inverse
                wx, wy = loads[i] * vx, loads[i] * vy
                gx += wx
                gy += wy
                gz += x * wy - y * wx
                gp += wx * ax_i + wy * ay_i
                gq += wx * cx_i + wy * cy_i
                # velocity of the support point across its own direction, per unit along either basis vector
                across_p, across_q = vx * ay_i - vy * ax_i, vx * cy_i - vy * cx_i
                hpp += push * across_p * across_p
                hpq += push * across_p * across_q
                hqq += push * across_q * across_q
            rx, ry, rz = gy * fz - gz * fy, gz * fx - gx * fz, gx * fy - gy * fx
            new_size = math.sqrt(rx * rx + ry * ry + rz * rz)
            residual = new_size / math.sqrt(gx * gx + gy * gy + gz * gz)
            if residual < smallest:
                if residual > 0.5 * smallest:
                    stalled += 1
                else:
                    stalled = 0
                smallest, best = residual, more
                best_p, best_q = p, q
            else:
                stalled += 1
            if smallest <= CONVERGED or (stalled > 8 and smallest <= 1e-11):
                break
            # Armijo; close to the minimum the differences of h drown in rounding and the gradient decides
            if not (more <= merit + 1e-4 * step * slope or (new_size <= 0.5 * size and more <= merit + 1e-13 * power)):
                step *= 0.5
                if step < 1e-18:
                    break
                p, q = old_p + step * dp, old_q + step * dq
                continue
            merit, size = more, new_size
            # each by itself: one may be huge, and must not drown the other
            hpp, hqq = 1.00000000000001 * hpp + 1e-300, 1.00000000000001 * hqq + 1e-300
            determinant = hpp * hqq - hpq * hpq
            dp = -(hqq * gp - hpq * gq) / determinant
            dq = -(hpp * gq - hpq * gp) / determinant
            slope = dp * gp + dq * gq
            old_p, old_q = p, q
            step = 1.0
            p, q = old_p + dp, old_q + dq
        twists[n, 0] = tx + kz * y0 + best_p * ax + best_q * cx
        twists[n, 1] = ty - kz * x0 + best_p * ay + best_q * cy
        twists[n, 2] = kz + best_p * az + best_q * cz
        powers[n], residuals[n] = power + best, smallest
