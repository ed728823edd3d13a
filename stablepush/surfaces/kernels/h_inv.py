"""Compiled ``H_inv`` of polynomial surfaces, and directions of their gradients. Callers check the arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from stablepush.core import compiled, inlined

#: Direction residual at which the Newton iteration stops; the rounding of the gradient itself is of this size.
CONVERGED = 1e-13
#: Largest direction residual that passes as converged.
TOLERANCE = 1e-9
#: A well-scaled surface takes 5 to 6 steps; a facet with curvature 1e-9 of its neighbourhood took fewer than 60.
MOST_STEPS = 300
#: Twists of a block, the fewest that are worth one, and Newton steps in blocks.
LANES, FEWEST_LANES, LANE_STEPS = 64, 10, 8


@inlined
def load_on_surface(degree, hessian, axes, vx, vy, vz, powers, form):  # type: ignore[no-untyped-def]
    """Return ``argmax V·F`` over ``H <= 1`` for a twist normalised by ``rho``, as ``(fx, fy, fz)``, and ``|∇H/|∇H| - V|``.

    The load is the minimiser of ``H(F) - V·F``, scaled onto the level set. ``hessian`` (6, n): second derivatives as forms of
    degree ``d - 2``. By Euler's identity for homogeneous functions they give the rest: ``∇H = ∇²H F/(d-1)``, ``H = ∇H·F/d``.
    Damped Newton: the objective is convex with one minimiser, so every step along the Newton direction that passes the line
    search comes closer, from any start. ``axes`` holds the squared half axes of an ellipsoid that has the size of the surface;
    its inverse is the first guess, scaled onto the ray's minimum. ``powers`` (3, d - 1), its first column 1, and ``form`` (n,)
    are working memory.
    """
    order = degree - 2
    count = degree * (degree - 1) // 2
    scale = 1.0 / (degree - 1)
    # by the largest entry first: squares of tiny and of huge twists must not leave the range of floats
    largest = max(abs(vx), abs(vy), abs(vz))
    vx, vy, vz = vx / largest, vy / largest, vz / largest
    norm = math.sqrt(vx * vx + vy * vy + vz * vz)
    vx, vy, vz = vx / norm, vy / norm, vz / norm
    x, y, z = axes[0] * vx, axes[1] * vy, axes[2] * vz
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
            s_order = 1.0
            for _ in range(order):
                s_order *= s
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
    return level * fx, level * fy, level * fz, best


@inlined
def _second_derivatives(degree, hessian, x, y, z):  # type: ignore[no-untyped-def]
    """Return the entries xx, xy, xz, yy, yz, zz of the second derivatives at a point."""
    hxx = hxy = hxz = hyy = hyz = hzz = 0.0
    order, m = degree - 2, 0
    # loops of constant length: they unroll, and what powers have in common is worked out once
    for i in range(order, -1, -1):
        for j in range(order - i, -1, -1):
            c = 1.0
            for _ in range(i):
                c *= x
            for _ in range(j):
                c *= y
            for _ in range(order - i - j):
                c *= z
            hxx += hessian[0, m] * c
            hxy += hessian[1, m] * c
            hxz += hessian[2, m] * c
            hyy += hessian[3, m] * c
            hyz += hessian[4, m] * c
            hzz += hessian[5, m] * c
            m += 1
    return hxx, hxy, hxz, hyy, hyz, hzz


@inlined
def _start_lanes(degree, hessian, axes, lanes):  # type: ignore[no-untyped-def]
    """Make the twists in rows 0 to 2 of a block unit, and fill rows 3 to 5 with first guesses of their loads."""
    root = degree - 1
    for k in range(LANES):
        vx, vy, vz = lanes[k], lanes[LANES + k], lanes[2 * LANES + k]
        scale = 1.0 / max(abs(vx), abs(vy), abs(vz))
        vx, vy, vz = scale * vx, scale * vy, scale * vz
        scale = 1.0 / math.sqrt(vx * vx + vy * vy + vz * vz)
        vx, vy, vz = scale * vx, scale * vy, scale * vz
        x, y, z = axes[0] * vx, axes[1] * vy, axes[2] * vz
        hxx, hxy, hxz, hyy, hyz, hzz = _second_derivatives(degree, hessian, x, y, z)
        gx, gy, gz = hxx * x + hxy * y + hxz * z, hxy * x + hyy * y + hyz * z, hxz * x + hyz * y + hzz * z
        # the ray's minimum lies at a root of this, which is near to 1: Newton
        power = root * (vx * x + vy * y + vz * z) / (gx * x + gy * y + gz * z)
        s = 1.0
        for _ in range(3):
            lower = 1.0
            for _ in range(root - 1):
                lower *= s
            s = ((root - 1) * s + power / lower) / root
        lanes[k], lanes[LANES + k], lanes[2 * LANES + k] = vx, vy, vz
        lanes[3 * LANES + k], lanes[4 * LANES + k], lanes[5 * LANES + k] = s * x, s * y, s * z


@inlined
def _step_lanes(degree, hessian, lanes):  # type: ignore[no-untyped-def]
    """Take a Newton step on the loads of a block that are not there yet; return how many those are.

    Row 6 gets the residual before the step, row 7 the value, row 8 the least leading minor of the second derivatives. That is
    above 0 at a minimum; a surface that is not convex has other places with the same gradient.
    """
    scale, left = 1.0 / (degree - 1), 0
    for k in range(LANES):
        vx, vy, vz = lanes[k], lanes[LANES + k], lanes[2 * LANES + k]
        x, y, z = lanes[3 * LANES + k], lanes[4 * LANES + k], lanes[5 * LANES + k]
        hxx, hxy, hxz, hyy, hyz, hzz = _second_derivatives(degree, hessian, x, y, z)
        gx = scale * (hxx * x + hxy * y + hxz * z)
        gy = scale * (hxy * x + hyy * y + hyz * z)
        gz = scale * (hxz * x + hyz * y + hzz * z)
        norm = 1.0 / math.sqrt(gx * gx + gy * gy + gz * gz)
        ex, ey, ez = gx * norm - vx, gy * norm - vy, gz * norm - vz
        residual = math.sqrt(ex * ex + ey * ey + ez * ez)
        lanes[6 * LANES + k], lanes[7 * LANES + k] = residual, (gx * x + gy * y + gz * z) / degree
        rx, ry, rz = gx - vx, gy - vy, gz - vz
        # by cofactors: without a branch
        cxx, cxy, cxz = hyy * hzz - hyz * hyz, hxz * hyz - hxy * hzz, hxy * hyz - hxz * hyy
        cyy, cyz, czz = hxx * hzz - hxz * hxz, hxy * hxz - hxx * hyz, hxx * hyy - hxy * hxy
        there = residual <= CONVERGED
        determinant = hxx * cxx + hxy * cxy + hxz * cxz
        lanes[8 * LANES + k] = min(hxx, czz, determinant)
        step = 0.0 if there else 1.0 / determinant
        left += 0 if there else 1
        lanes[3 * LANES + k] = x - step * (cxx * rx + cxy * ry + cxz * rz)
        lanes[4 * LANES + k] = y - step * (cxy * rx + cyy * ry + cyz * rz)
        lanes[5 * LANES + k] = z - step * (cxz * rx + cyz * ry + czz * rz)
    return left


@cache
def polynomial_inverter(degree: int) -> Callable[..., Any]:
    """Return the kernel of ``H_inv`` for a degree, which is a constant of its code: the loops over monomials unroll.

    Twists are worked on in blocks whose loops the compiler turns into vector instructions: plain Newton, without line search or
    branches. What it does not bring to :data:`CONVERGED` goes through :func:`load_on_surface`.
    """

    @compiled
    def invert_polynomial(hessian, rho, twists, axes, wrenches):  # type: ignore[no-untyped-def]
        """Fill ``wrenches`` (n, 3) with the loads of twists (n, 3), which need not be of unit length; return the worst residual
        and how many miss :data:`TOLERANCE`."""
        powers, form = np.ones((3, degree - 1)), np.empty(degree * (degree - 1) // 2)
        # rows of one array, at constant distances: the compiler sees that they do not overlap
        lanes = np.empty(9 * LANES)
        worst, missed, count = 0.0, 0, twists.shape[0]
        for first in range(0, count, LANES):
            here = min(LANES, count - first)
            # the compiler does not unroll the monomials of higher degrees
            in_lanes = degree <= 4 and here >= FEWEST_LANES
            if in_lanes:
                for k in range(LANES):
                    # places that are left over repeat the last twist
                    q = first + min(k, here - 1)
                    lanes[k], lanes[LANES + k], lanes[2 * LANES + k] = twists[q, 0], twists[q, 1], rho * twists[q, 2]
                _start_lanes(degree, hessian, axes, lanes)
                for _ in range(LANE_STEPS):
                    if _step_lanes(degree, hessian, lanes) == 0:
                        break
            for k in range(here):
                q = first + k
                fx, fy, fz = lanes[3 * LANES + k], lanes[4 * LANES + k], lanes[5 * LANES + k]
                residual, value = lanes[6 * LANES + k], lanes[7 * LANES + k]
                if in_lanes and residual <= CONVERGED and value > 0.0 and lanes[8 * LANES + k] > 0.0:
                    value **= -1.0 / degree
                    fx, fy, fz = value * fx, value * fy, value * fz
                else:
                    fx, fy, fz, residual = load_on_surface(
                        degree, hessian, axes, twists[q, 0], twists[q, 1], rho * twists[q, 2], powers, form
                    )
                wrenches[q, 0], wrenches[q, 1], wrenches[q, 2] = fx, fy, rho * fz
                worst = max(worst, residual)
                if not residual <= TOLERANCE:
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
