"""Compiled: the load that it takes to move a slider over a table, point by point or by a polynomial limit surface."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray, compiled, inner
from stablepush.surfaces.kernels import load_of_points, load_on_surface

#: Slower points, in shares of the speed of the fastest, have friction in proportion to their speed: no jump where one rests.
_CREEP = 1e-8
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
    ``body_anisotropy``, ``world_anisotropy`` (3,): ``xx, xy, yy`` of ``M_o`` in B and of ``A_w`` in W; ``gradient`` (2,) in 1/m
    in W; ``external_force`` (2,): force (N) in W that acts on the centre of mass besides the pusher's; ``inertia`` (2,): mass
    (kg) and moment of inertia (kg m²) that count; ``degree``, ``hessian`` (6, m), ``half_axes`` (3,) squared, ``factor`` and
    ``rho``: the polynomial, for loads over ``factor`` (N) normalised by ``rho`` (m).
    """

    points: FloatArray
    loads: FloatArray
    nominal_points: FloatArray
    nominal_loads: FloatArray
    body_anisotropy: tuple[float, float, float]
    world_anisotropy: tuple[float, float, float]
    isotropic: bool
    gradient: tuple[float, float]
    slope: float
    reference: float
    scale: float
    external_force: tuple[float, float]
    inertia: tuple[float, float]
    degree: int
    hessian: FloatArray
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
def share_at_place(x, y, gx, gy):  # type: ignore[no-untyped-def]
    """Friction at a place (m in W) over that at the origin, ``1 + g·x``; where it falls over the table it ends at none."""
    return max(0.0, 1.0 + gx * x + gy * y)


@inner
def share_at_speed(speed, slope, reference):  # type: ignore[no-untyped-def]
    """Friction at a speed over that at a reference speed (m/s), ``1 + slope ln(speed/reference)``, within bounds."""
    return max(_LEAST_SHARE, 1.0 + slope * math.log(max(_SLOWEST, speed) / reference))


@inner
def joint_anisotropy(world, body, c, s):  # type: ignore[no-untyped-def]
    """Entries ``xx, xy, yy`` of ``M = A_w M_o A_w`` in B, of a slider turned by (c, s); ``world``: of ``A_w`` in W, ``body``: of
    ``M_o`` in B. A point of friction 1 that moves by ``w`` takes the force ``M w/√(w·M w)``."""
    a, b, d = world
    axx = c * c * a + 2 * c * s * b + s * s * d
    axy = c * s * (d - a) + (c * c - s * s) * b
    ayy = s * s * a - 2 * c * s * b + c * c * d
    oxx, oxy, oyy = body
    pxx, pxy = axx * oxx + axy * oxy, axx * oxy + axy * oyy
    pyx, pyy = axy * oxx + ayy * oxy, axy * oxy + ayy * oyy
    return pxx * axx + pxy * axy, pxx * axy + pxy * ayy, pyx * axy + pyy * ayy


@inner
def friction_at(ux, uy, x, y, m, isotropic, gradient, slope, reference, creep):  # type: ignore[no-untyped-def]
    """The force of a point of unit friction, in B, and the share of it that place and speed leave. The rig, plans and the
    diagnosis have it from here.

    ``(ux, uy)``: its velocity over the table (m/s) in B; ``(x, y)``: its place in W; ``m``: entries ``xx, xy, yy`` of the joint
    anisotropy in B (:func:`joint_anisotropy`); ``creep``: square of a speed below which friction goes with the speed.
    """
    share = 1.0
    if gradient[0] != 0.0 or gradient[1] != 0.0:
        share = share_at_place(x, y, gradient[0], gradient[1])
    square = ux * ux + uy * uy
    if slope != 0.0:
        share *= share_at_speed(math.sqrt(square), slope, reference)
    if not isotropic:
        square = m[0] * ux * ux + 2 * m[1] * ux * uy + m[2] * uy * uy
        ux, uy = m[0] * ux + m[1] * uy, m[1] * ux + m[2] * uy
    size = share / math.sqrt(square + creep)
    return size * ux, size * uy, share


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
    m = (1.0, 0.0, 1.0)
    if not table.isotropic:
        m = joint_anisotropy(table.world_anisotropy, table.body_anisotropy, at.cos, at.sin)
    for k in range(n):
        x, y = table.points[k, 0], table.points[k, 1]
        at_x, at_y = at.x + at.cos * x - at.sin * y, at.y + at.sin * x + at.cos * y
        ex, ey, _ = friction_at(
            vx - w * y, vy + w * x, at_x, at_y, m, table.isotropic, table.gradient, table.slope, table.reference, creep
        )
        ex, ey = table.loads[k] * ex, table.loads[k] * ey
        fx += ex
        fy += ey
        tau += x * ey - y * ex
    return fx, fy, tau


@inner
def load_of(table, at, vx, vy, w, load):  # type: ignore[no-untyped-def]
    """Fill ``load`` (3,), in B, with the load that a body twist takes: friction, minus the external force, plus inertia."""
    if table.degree > 0 and (vx != 0.0 or vy != 0.0 or w != 0.0):
        powers, form = np.ones((3, table.degree - 1)), np.empty(table.hessian.shape[1])
        fx, fy, fz, _ = load_on_surface(table.degree, table.hessian, table.half_axes, vx, vy, table.rho * w, powers, form)
        load[0], load[1], load[2] = table.factor * fx, table.factor * fy, table.factor * table.rho * fz
    else:
        load[0] = load[1] = load[2] = 0.0
    if table.points.shape[0] > 0:
        fx, fy, tau = _friction_of_points(table, at, vx, vy, w)
        load[0] += fx
        load[1] += fy
        load[2] += tau
        if table.degree > 0:
            fx, fy, tau = load_of_points(table.nominal_points, table.nominal_loads, vx, vy, w, 1e-150, 0.0)
            load[0] -= fx
            load[1] -= fy
            load[2] -= tau
    load[0] *= table.scale
    load[1] *= table.scale
    load[2] *= table.scale
    load[0] -= at.cos * table.external_force[0] + at.sin * table.external_force[1]
    load[1] -= -at.sin * table.external_force[0] + at.cos * table.external_force[1]
    if table.inertia[0] > 0.0 and at.dt > 0.0:
        load[0] += table.inertia[0] * (vx - at.vx) / at.dt
        load[1] += table.inertia[0] * (vy - at.vy) / at.dt
        load[2] += table.inertia[1] * (w - at.omega) / at.dt


@inner
def load_held(table, x, y, theta, vx, vy, w, load):  # type: ignore[no-untyped-def]
    """Fill ``load`` (3,), in B, with the load of a body twist that is held: the mass is kept on its arc."""
    load_of(table, Motion(x, y, math.cos(theta), math.sin(theta), 0.0, 0.0, 0.0, 0.0), vx, vy, w, load)
    load[0] -= table.inertia[0] * w * vy
    load[1] += table.inertia[0] * w * vx


@compiled
def loads_at(table, poses, twists, loads):  # type: ignore[no-untyped-def]
    """Fill loads (n, 3) of held body twists (n, 3) at poses (n, 3)."""
    for i in range(twists.shape[0]):
        load_held(table, poses[i, 0], poses[i, 1], poses[i, 2], twists[i, 0], twists[i, 1], twists[i, 2], loads[i])
