"""Compiled inner loops of the limit surfaces. Arrays are contiguous float64 and checked by the callers."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from stablepush.core import compiled

#: Direction residual at which the Newton iteration stops; the rounding of the gradient itself is of this size.
CONVERGED = 1e-13
#: Largest direction residual that passes as converged.
TOLERANCE = 1e-9
#: Speed of a support point, for unit twists, that is zero but for rounding.
AT_REST = 1e-14
#: A well-scaled surface takes 5 to 6 steps; a facet with curvature 1e-9 of its neighbourhood took fewer than 60.
MOST_STEPS = 300


@cache
def polynomial_inverter(degree: int) -> Callable[..., Any]:
    """Return the kernel of ``H_inv`` for a degree, which is a constant of its code: the loops over monomials unroll."""
    order = degree - 2
    count = degree * (degree - 1) // 2

    @compiled
    def invert_polynomial(hessian, rho, twists, start, wrenches):  # type: ignore[no-untyped-def]
        """Fill ``wrenches`` (n, 3) with ``argmax V·F`` over ``H <= 1`` and return the worst ``|∇H/|∇H| - V|`` and how many miss.

        Twists ``(vx, vy, omega)`` and wrenches ``(fx, fy, tau)`` carry units and are normalised by ``rho``; twists need not be of
        unit length. The load is the minimiser of ``H(F) - V·F``, scaled onto the level set.

        ``hessian`` (6, n): second derivatives as forms of degree ``d - 2``. By Euler's identity for homogeneous functions they
        give the rest: ``∇H = ∇²H F/(d-1)``, ``H = ∇H·F/d``. Damped Newton: the objective is convex with one minimiser, so every
        step along the Newton direction that passes the line search comes closer, from any start. ``start`` (3,) holds the squared
        half axes of an ellipsoid that has the size of the surface; its inverse is the first guess, scaled onto the ray's minimum.
        """
        form = np.empty(count)
        powers = np.ones((3, order + 1))
        scale = 1.0 / (degree - 1)
        worst = 0.0
        missed = 0
        for q in range(twists.shape[0]):
            vx, vy, vz = twists[q, 0], twists[q, 1], rho * twists[q, 2]
            # by the largest entry first: squares of tiny and of huge twists must not leave the range of floats
            largest = max(abs(vx), abs(vy), abs(vz))
            vx, vy, vz = vx / largest, vy / largest, vz / largest
            norm = math.sqrt(vx * vx + vy * vy + vz * vz)
            vx, vy, vz = vx / norm, vy / norm, vz / norm
            x, y, z = start[0] * vx, start[1] * vy, start[2] * vz
            # the state at the accepted point; ``merit`` is the objective, ``size`` the squared norm of its gradient
            merit = size = math.inf
            dx = dy = dz = slope = 0.0
            bx, by, bz = x, y, z
            step = 0.0
            best = math.inf
            fx, fy, fz, level = x, y, z, 1.0
            stalled = 0
            for iteration in range(MOST_STEPS):
                # second derivatives, gradient and value at (x, y, z)
                for p in range(order):
                    powers[0, p + 1] = powers[0, p] * x
                    powers[1, p + 1] = powers[1, p] * y
                    powers[2, p + 1] = powers[2, p] * z
                m = 0
                for i in range(order, -1, -1):
                    for j in range(order - i, -1, -1):
                        form[m] = powers[0, i] * powers[1, j] * powers[2, order - i - j]
                        m += 1
                hxx = hxy = hxz = hyy = hyz = hzz = 0.0
                for m in range(count):
                    c = form[m]
                    hxx += hessian[0, m] * c
                    hxy += hessian[1, m] * c
                    hxz += hessian[2, m] * c
                    hyy += hessian[3, m] * c
                    hyz += hessian[4, m] * c
                    hzz += hessian[5, m] * c
                gx = scale * (hxx * x + hxy * y + hxz * z)
                gy = scale * (hxy * x + hyy * y + hyz * z)
                gz = scale * (hxz * x + hyz * y + hzz * z)
                value = (gx * x + gy * y + gz * z) / degree
                power = vx * x + vy * y + vz * z
                if iteration == 0 and value > 0.0:
                    # minimum of s^d H - s V·F along the ray of the first guess
                    s = (power / (degree * value)) ** scale
                    x, y, z = s * x, s * y, s * z
                    power *= s
                    s_order = s**order
                    hxx, hxy, hxz = s_order * hxx, s_order * hxy, s_order * hxz
                    hyy, hyz, hzz = s_order * hyy, s_order * hyz, s_order * hzz
                    s_order *= s
                    gx, gy, gz = s_order * gx, s_order * gy, s_order * gz
                    value *= s_order * s
                # how far the direction of the gradient is from the twist
                norm = gx * gx + gy * gy + gz * gz
                if norm > 0.0:
                    norm = 1.0 / math.sqrt(norm)
                    ex, ey, ez = gx * norm - vx, gy * norm - vy, gz * norm - vz
                    residual = math.sqrt(ex * ex + ey * ey + ez * ez)
                else:
                    residual = 2.0
                if residual < best and value > 0.0:
                    if residual > 0.5 * best:
                        stalled += 1
                    else:
                        stalled = 0
                    best = residual
                    fx, fy, fz = x, y, z
                    level = value
                else:
                    stalled += 1
                if best <= CONVERGED or (stalled > 8 and best <= 1e-11):
                    break
                rx, ry, rz = gx - vx, gy - vy, gz - vz
                new_merit = value - power
                new_size = rx * rx + ry * ry + rz * rz
                # Armijo on the objective; close to the minimum its differences drown in rounding and the gradient decides
                accepted = new_merit <= merit + 1e-4 * step * slope or new_size <= 0.25 * size
                if not accepted:
                    step *= 0.5
                    if step < 1e-18:
                        break
                    x, y, z = bx + step * dx, by + step * dy, bz + step * dz
                    continue
                merit, size = new_merit, new_size
                # Newton direction; the shift keeps the factors positive on facets and where a surface is not convex
                shift = 1e-15 * (abs(hxx) + abs(hyy) + abs(hzz)) + 1e-300
                for _ in range(60):
                    d1 = hxx + shift
                    if d1 > 0.0:
                        d1 = 1.0 / d1
                        l21 = hxy * d1
                        l31 = hxz * d1
                        d2 = hyy + shift - l21 * hxy
                        if d2 > 0.0:
                            d2 = 1.0 / d2
                            t = hyz - l31 * hxy
                            l32 = t * d2
                            d3 = hzz + shift - l31 * hxz - l32 * t
                            if d3 > 0.0:
                                break
                    shift = shift * 10.0
                u1 = -rx
                u2 = -ry - l21 * u1
                u3 = (-rz - l31 * u1 - l32 * u2) / d3
                dz = u3
                dy = u2 * d2 - l32 * dz
                dx = u1 * d1 - l21 * dy - l31 * dz
                slope = dx * rx + dy * ry + dz * rz
                bx, by, bz = x, y, z
                step = 1.0
                x, y, z = bx + dx, by + dy, bz + dz
            level **= -1.0 / degree
            wrenches[q, 0], wrenches[q, 1], wrenches[q, 2] = level * fx, level * fy, rho * level * fz
            worst = max(worst, best)
            if not best <= TOLERANCE:
                missed += 1
        return worst, missed

    return invert_polynomial


@compiled
def unit_gradients(forms, exponents, points, result):  # type: ignore[no-untyped-def]
    """Fill ``result`` (n, 3) with directions of gradients at unit points (n, 3); zero where the gradient is.

    ``forms`` (3, m): the gradient's coefficients, ``exponents`` (m, 3) of its monomials.
    """
    count = exponents.shape[0]
    order = exponents[0].sum()
    powers = np.ones((3, order + 1))
    for q in range(points.shape[0]):
        for axis in range(3):
            for p in range(order):
                powers[axis, p + 1] = powers[axis, p] * points[q, axis]
        gx = gy = gz = 0.0
        for m in range(count):
            value = powers[0, exponents[m, 0]] * powers[1, exponents[m, 1]] * powers[2, exponents[m, 2]]
            gx += forms[0, m] * value
            gy += forms[1, m] * value
            gz += forms[2, m] * value
        # by the largest entry first: squares of tiny and of huge gradients must not leave the range of floats
        largest = max(abs(gx), abs(gy), abs(gz))
        if largest > 0.0:
            gx, gy, gz = gx / largest, gy / largest, gz / largest
            largest = math.sqrt(gx * gx + gy * gy + gz * gz)
            result[q, 0], result[q, 1], result[q, 2] = gx / largest, gy / largest, gz / largest
        else:
            result[q, 0], result[q, 1], result[q, 2] = gx, gy, gz


@compiled
def sum_loads(points, loads, twists, wrenches):  # type: ignore[no-untyped-def]
    """Fill ``wrenches`` with ``Σ m_k (e_k, x_k × e_k)`` of unit twists, all normalised by the characteristic length."""
    for q in range(twists.shape[0]):
        vx, vy, vz = twists[q, 0], twists[q, 1], twists[q, 2]
        fx = fy = fz = 0.0
        for k in range(points.shape[0]):
            x, y = points[k, 0], points[k, 1]
            px, py = vx - y * vz, vy + x * vz
            speed = math.sqrt(px * px + py * py)
            # a point this slow is at rest to rounding: the direction of its friction is not determined
            if speed > AT_REST:
                share = loads[k] / speed
                fx += share * px
                fy += share * py
                fz += share * (x * py - y * px)
        wrenches[q, 0], wrenches[q, 1], wrenches[q, 2] = fx, fy, fz


@compiled
def sum_loads_of_many(points, loads, twists, wrenches):  # type: ignore[no-untyped-def]
    """Fill ``wrenches`` (m, n, 3) like :func:`sum_loads` for m supports of k points each: (m, k, 2), (m, k)."""
    for m in range(points.shape[0]):
        for q in range(twists.shape[0]):
            vx, vy, vz = twists[q, 0], twists[q, 1], twists[q, 2]
            fx = fy = fz = 0.0
            for k in range(points.shape[1]):
                if loads[m, k] > 0.0:
                    x, y = points[m, k, 0], points[m, k, 1]
                    px, py = vx - y * vz, vy + x * vz
                    speed = math.sqrt(px * px + py * py)
                    if speed > AT_REST:
                        share = loads[m, k] / speed
                        fx += share * px
                        fy += share * py
                        fz += share * (x * py - y * px)
            wrenches[m, q, 0], wrenches[m, q, 1], wrenches[m, q, 2] = fx, fy, fz


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
            # leave the kink along A as far as the other support points' curvature there tells; halve until h falls
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


@compiled
def fit_scales(predicted, loads, weights, error, scales, likelihoods):  # type: ignore[no-untyped-def]
    """Fill ``scales`` (m,) and ``likelihoods`` (m,) of predicted loads (m, n, q, 3) against measured ones (n, 3).

    The likelihood of a pair is the mean, with ``weights`` (q,), over the q twists that it may have had of a Student density
    of the load's error with four degrees of freedom, of scale ``error * |F|``; the scale is found by expectation maximisation
    (which twist it was, and how much of an outlier).
    """
    m, n, q = predicted.shape[0], predicted.shape[1], predicted.shape[2]
    sizes = np.empty(n)
    for i in range(n):
        sizes[i] = loads[i, 0] ** 2 + loads[i, 1] ** 2 + loads[i, 2] ** 2
    product, square, density, shrink = np.empty((n, q)), np.empty((n, q)), np.empty(q), np.empty(q)
    for d in range(m):
        above = below = 0.0
        for i in range(n):
            for k in range(q):
                x, y, z = predicted[d, i, k, 0], predicted[d, i, k, 1], predicted[d, i, k, 2]
                product[i, k] = x * loads[i, 0] + y * loads[i, 1] + z * loads[i, 2]
                # a draw that is not possible predicts no load at all; its likelihood then is that of no load
                square[i, k] = max(x * x + y * y + z * z, 1e-300)
            above += product[i, 0]
            below += square[i, 0]
        scale = max(above / below, 1e-12)
        for turn in range(6):
            above = below = total = 0.0
            for i in range(n):
                sum_density = 0.0
                for k in range(q):
                    # |F - sP|² = |F|² - 2 s F·P + s²|P|²
                    miss = (sizes[i] - 2 * scale * product[i, k] + scale * scale * square[i, k]) / (error * error * sizes[i])
                    miss = max(miss, 0.0)
                    rest = 1.0 / (4.0 + miss)
                    # (1 + miss/4)^(-7/2) but for a constant
                    density[k] = weights[k] * 128.0 * rest * rest * rest * math.sqrt(rest)
                    shrink[k] = rest / sizes[i]
                    sum_density += density[k]
                sum_density = max(sum_density, 1e-300)
                for k in range(q):
                    w = density[k] / sum_density * shrink[k]
                    above += w * product[i, k]
                    below += w * square[i, k]
                total += math.log(sum_density)
            if turn < 5:
                scale = max(above / below, 1e-12)
        scales[d], likelihoods[d] = scale, total


@compiled
def tilt_shares(points, raw, active, centers, tolerance, steps, shares, good):  # type: ignore[no-untyped-def]
    """Fill ``shares`` (m, k) with ``q ∝ raw exp(λ·(x - c))`` of mean zero in ``x - c``; ``good`` (m,) tells where there is
    such a tilt.

    Newton on the convex ``log Σ raw exp(λ·(x - c))``, whose gradient is the mean; a tilt that runs away leaves one point:
    such a draw does not surround its centre. Lengths are in units of the outline's radius.
    """
    for d in range(points.shape[0]):
        lx = ly = 0.0
        good[d] = False
        for _ in range(steps):
            largest = -np.inf
            for k in range(points.shape[1]):
                if active[d, k]:
                    value = math.log(raw[d, k]) + lx * (points[d, k, 0] - centers[d, 0]) + ly * (points[d, k, 1] - centers[d, 1])
                    shares[d, k] = value
                    largest = max(largest, value)
            total = mean_x = mean_y = 0.0
            for k in range(points.shape[1]):
                if active[d, k]:
                    shares[d, k] = math.exp(shares[d, k] - largest)
                    total += shares[d, k]
                    mean_x += shares[d, k] * (points[d, k, 0] - centers[d, 0])
                    mean_y += shares[d, k] * (points[d, k, 1] - centers[d, 1])
                else:
                    shares[d, k] = 0.0
            mean_x /= total
            mean_y /= total
            xx = yy = 1e-12
            xy = 0.0
            for k in range(points.shape[1]):
                shares[d, k] /= total
                x, y = points[d, k, 0] - centers[d, 0] - mean_x, points[d, k, 1] - centers[d, 1] - mean_y
                xx += shares[d, k] * x * x
                yy += shares[d, k] * y * y
                xy += shares[d, k] * x * y
            if max(abs(mean_x), abs(mean_y)) < tolerance:
                good[d] = True
                break
            determinant = xx * yy - xy * xy + 1e-24
            step_x, step_y = (xy * mean_y - yy * mean_x) / determinant, (xy * mean_x - xx * mean_y) / determinant
            length = math.sqrt(step_x * step_x + step_y * step_y)
            if length > 2.0:
                step_x *= 2.0 / length
                step_y *= 2.0 / length
            lx += step_x
            ly += step_y
        if not good[d]:
            shares[d, :] = 0.0
