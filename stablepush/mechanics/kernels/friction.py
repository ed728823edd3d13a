"""Compiled: the load that it takes to move a slider over a table, point by point or by a polynomial limit surface."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray, inner

#: Slower points, in shares of the speed of the fastest, have friction in proportion to their speed: no jump where one rests.
_CREEP = 1e-8
#: Newton steps of the inverse of a polynomial surface, and the residual at which they end.
_MOST_STEPS, _CONVERGED = 100, 1e-13
#: Speeds (m/s) below which a point's friction depends on speed no more, and the least share of it that is left.
_SLOWEST, _LEAST_SHARE = 1e-5, 0.05


class Table(NamedTuple):
    """Friction between a slider and a table, and what else its motion takes.

    Coulomb friction of point ``k``, with ``w`` its velocity over the table, seen in B: ``f = share m_k M w/√(w·M w)``, ``M =
    A_w²`` for anisotropy of the table, turned into B, ``A_w M_o A_w`` with that of the slider; ``share = scale (1 + g·x)(1 +
    slope ln(|w|/reference))``. With a degree, friction is ``scale H_inv(V)`` of a polynomial limit surface, and of points only
    what differs from the friction of the nominal ones.

    Few of the fields are arrays, for each costs time in every call of compiled code that passes it on.

    ``points`` (n, 2) in B, ``loads`` (n,) in N, ``nominal_points``, ``nominal_loads`` of those that a polynomial stands for;
    ``of_slider``, ``of_table`` (3,): ``xx, xy, yy`` of ``M_o`` in B and of ``A_w`` in W; ``gradient`` (2,) in 1/m in W; ``pull``
    (2,): force (N) in W that acts on the centre of mass besides the pusher's; ``inertia`` (2,): mass (kg) and moment of inertia
    (kg m²) that count; ``degree``, ``hessian`` (6, m), ``exponents`` (m, 3), ``half_axes`` (3,) squared, ``factor`` and ``rho``:
    the polynomial, for loads over ``factor`` (N) normalised by ``rho`` (m).
    """

    points: FloatArray
    loads: FloatArray
    nominal_points: FloatArray
    nominal_loads: FloatArray
    of_slider: tuple[float, float, float]
    of_table: tuple[float, float, float]
    isotropic: bool
    gradient: tuple[float, float]
    slope: float
    reference: float
    scale: float
    pull: tuple[float, float]
    inertia: tuple[float, float]
    degree: int
    hessian: FloatArray
    exponents: np.ndarray
    half_axes: tuple[float, float, float]
    factor: float
    rho: float


class Motion(NamedTuple):
    """Where the slider is: pose in W as (x, y, cos, sin); what it did: its last twist, seen in B, and the time (s) since."""

    x: float
    y: float
    cos: float
    sin: float
    vx: float
    vy: float
    omega: float
    dt: float


@inner
def _friction_of_points(table, at, vx, vy, w):  # type: ignore[no-untyped-def]
    """Load of the points, with all that changes their friction."""
    fx = fy = tau = 0.0
    fastest = 0.0
    n = table.points.shape[0]
    for k in range(n):
        px, py = vx - w * table.points[k, 1], vy + w * table.points[k, 0]
        fastest = max(fastest, px * px + py * py)
    if fastest == 0.0:
        return 0.0, 0.0, 0.0
    creep = fastest * (_CREEP * _CREEP)
    plain = table.isotropic
    mxx, mxy, myy = 1.0, 0.0, 1.0
    if not plain:
        # A_w in B, then M = A_w M_o A_w
        c, s = at.cos, at.sin
        a, b, d = table.of_table[0], table.of_table[1], table.of_table[2]
        axx = c * c * a + 2 * c * s * b + s * s * d
        axy = c * s * (d - a) + (c * c - s * s) * b
        ayy = s * s * a - 2 * c * s * b + c * c * d
        oxx, oxy, oyy = table.of_slider[0], table.of_slider[1], table.of_slider[2]
        pxx, pxy = axx * oxx + axy * oxy, axx * oxy + axy * oyy
        pyx, pyy = axy * oxx + ayy * oxy, axy * oxy + ayy * oyy
        mxx, mxy, myy = pxx * axx + pxy * axy, pxx * axy + pxy * ayy, pyx * axy + pyy * ayy
    gx = at.cos * table.gradient[0] + at.sin * table.gradient[1]
    gy = -at.sin * table.gradient[0] + at.cos * table.gradient[1]
    g0 = 1.0 + table.gradient[0] * at.x + table.gradient[1] * at.y
    for k in range(n):
        x, y = table.points[k, 0], table.points[k, 1]
        px, py = vx - w * y, vy + w * x
        # friction that falls over the table ends at none
        share = table.loads[k] * max(0.0, g0 + gx * x + gy * y)
        if table.slope != 0.0:
            speed = max(_SLOWEST, math.sqrt(px * px + py * py))
            share *= max(_LEAST_SHARE, 1.0 + table.slope * math.log(speed / table.reference))
        if plain:
            share /= math.sqrt(px * px + py * py + creep)
        else:
            px, py, square = mxx * px + mxy * py, mxy * px + myy * py, mxx * px * px + 2 * mxy * px * py + myy * py * py
            share /= math.sqrt(square + creep)
        fx += share * px
        fy += share * py
        tau += share * (x * py - y * px)
    return fx, fy, tau


@inner
def _nominal_friction(points, loads, vx, vy, w):  # type: ignore[no-untyped-def]
    """Load of isotropic, even friction at points."""
    fx = fy = tau = 0.0
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        px, py = vx - w * y, vy + w * x
        share = loads[k] / math.sqrt(px * px + py * py + 1e-300)
        fx += share * px
        fy += share * py
        tau += share * (x * py - y * px)
    return fx, fy, tau


@inner
def _friction_of_polynomial(table, vx, vy, w, load):  # type: ignore[no-untyped-def]
    """``H_inv``: the minimiser of ``H(F) - V·F`` by damped Newton, scaled onto ``H = 1``."""
    vz = table.rho * w
    norm = math.sqrt(vx * vx + vy * vy + vz * vz)
    if norm == 0.0:
        load[0] = load[1] = load[2] = 0.0
        return
    vx, vy, vz = vx / norm, vy / norm, vz / norm
    x, y, z = table.half_axes[0] * vx, table.half_axes[1] * vy, table.half_axes[2] * vz
    degree = table.degree
    count = table.exponents.shape[0]
    merit = math.inf
    bx, by, bz = x, y, z
    dx = dy = dz = slope = step = 0.0
    value = 1.0
    best = math.inf
    fx, fy, fz, level = x, y, z, 1.0
    for iteration in range(_MOST_STEPS):
        hxx = hxy = hxz = hyy = hyz = hzz = 0.0
        for m in range(count):
            c = x ** table.exponents[m, 0] * y ** table.exponents[m, 1] * z ** table.exponents[m, 2]
            hxx += table.hessian[0, m] * c
            hxy += table.hessian[1, m] * c
            hxz += table.hessian[2, m] * c
            hyy += table.hessian[3, m] * c
            hyz += table.hessian[4, m] * c
            hzz += table.hessian[5, m] * c
        gx = (hxx * x + hxy * y + hxz * z) / (degree - 1)
        gy = (hxy * x + hyy * y + hyz * z) / (degree - 1)
        gz = (hxz * x + hyz * y + hzz * z) / (degree - 1)
        value = (gx * x + gy * y + gz * z) / degree
        if iteration == 0 and value > 0.0:
            # the minimum along the ray of the first guess
            s = ((vx * x + vy * y + vz * z) / (degree * value)) ** (1.0 / (degree - 1))
            x, y, z = s * x, s * y, s * z
            t = s ** (degree - 2)
            hxx, hxy, hxz, hyy, hyz, hzz = t * hxx, t * hxy, t * hxz, t * hyy, t * hyz, t * hzz
            gx, gy, gz, value = t * s * gx, t * s * gy, t * s * gz, t * s * s * value
        size = math.sqrt(gx * gx + gy * gy + gz * gz) + 1e-300
        ex, ey, ez = gx / size - vx, gy / size - vy, gz / size - vz
        residual = math.sqrt(ex * ex + ey * ey + ez * ez)
        if residual < best and value > 0.0:
            best, fx, fy, fz, level = residual, x, y, z, value
        if best <= _CONVERGED:
            break
        rx, ry, rz = gx - vx, gy - vy, gz - vz
        new = value - (vx * x + vy * y + vz * z)
        # near the minimum differences of the objective drown in rounding: full steps then
        if not (new <= merit + 1e-4 * step * slope or best < 1e-6):
            step *= 0.5
            if step < 1e-12:
                break
            x, y, z = bx + step * dx, by + step * dy, bz + step * dz
            continue
        merit = new
        shift = 1e-14 * (abs(hxx) + abs(hyy) + abs(hzz)) + 1e-300
        hxx += shift
        hyy += shift
        hzz += shift
        c00, c01, c02 = hyy * hzz - hyz * hyz, hxz * hyz - hxy * hzz, hxy * hyz - hxz * hyy
        c11, c12, c22 = hxx * hzz - hxz * hxz, hxy * hxz - hxx * hyz, hxx * hyy - hxy * hxy
        determinant = hxx * c00 + hxy * c01 + hxz * c02
        if determinant == 0.0:
            break
        dx = -(c00 * rx + c01 * ry + c02 * rz) / determinant
        dy = -(c01 * rx + c11 * ry + c12 * rz) / determinant
        dz = -(c02 * rx + c12 * ry + c22 * rz) / determinant
        slope = dx * rx + dy * ry + dz * rz
        if not slope < 0.0:
            dx, dy, dz = -rx, -ry, -rz
            slope = -(rx * rx + ry * ry + rz * rz)
        bx, by, bz = x, y, z
        step = 1.0
        x, y, z = bx + dx, by + dy, bz + dz
    t = table.factor * level ** (-1.0 / degree)
    load[0], load[1], load[2] = t * fx, t * fy, t * table.rho * fz


@inner
def load_of(table, at, vx, vy, w, load):  # type: ignore[no-untyped-def]
    """Fill ``load`` (3,), in B, with what the pusher has to apply for a body twist: friction, less the pull, and inertia."""
    if table.degree > 0:
        _friction_of_polynomial(table, vx, vy, w, load)
    else:
        load[0] = load[1] = load[2] = 0.0
    if table.points.shape[0] > 0:
        fx, fy, tau = _friction_of_points(table, at, vx, vy, w)
        load[0] += fx
        load[1] += fy
        load[2] += tau
        if table.degree > 0:
            fx, fy, tau = _nominal_friction(table.nominal_points, table.nominal_loads, vx, vy, w)
            load[0] -= fx
            load[1] -= fy
            load[2] -= tau
    load[0] *= table.scale
    load[1] *= table.scale
    load[2] *= table.scale
    load[0] -= at.cos * table.pull[0] + at.sin * table.pull[1]
    load[1] -= -at.sin * table.pull[0] + at.cos * table.pull[1]
    if table.inertia[0] > 0.0 and at.dt > 0.0:
        load[0] += table.inertia[0] * (vx - at.vx) / at.dt
        load[1] += table.inertia[0] * (vy - at.vy) / at.dt
        load[2] += table.inertia[1] * (w - at.omega) / at.dt
