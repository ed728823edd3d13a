"""Twists, wrenches and rotation centres (CORs) in the body frame B: functions on arrays.

A twist is ``(vx, vy, omega)`` (m/s, rad/s), a wrench ``(fx, fy, tau)`` (N, N·m) with the torque about the origin of B, a COR
a point ``(c_x, c_y)`` (m) with a sense, +1 for counter-clockwise. The characteristic length ``rho`` (m) gives all three
components of a twist or wrench one unit (Erdmann 1994): ``(vx, vy, rho*omega)``, ``(fx, fy, tau/rho)``.
"""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, check_sense, check_vectors


def twist_from_cor(cors: ArrayLike, sense: ArrayLike) -> FloatArray:
    """Return twists (..., 3) of unit angular speed about CORs (..., 2): ``V = sense * (c_y, -c_x, 1)``."""
    c = check_vectors(cors, "cors", 2)
    s = check_sense(sense)
    c_x, c_y, s = np.broadcast_arrays(c[..., 0], c[..., 1], s)
    return np.stack((s * c_y, -s * c_x, s), axis=-1)


def cor_from_twist(twists: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the COR (..., 2) and sense (...) of twists (..., 3): ``c = (-vy, vx)/omega``.

    A translation has its COR at infinity: the coordinates are infinite or undefined (``inf``/``nan``) and the sense is 0.
    """
    v = check_vectors(twists, "twists", 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        cors = np.stack((-v[..., 1] / v[..., 2], v[..., 0] / v[..., 2]), axis=-1)
    return cors, np.sign(v[..., 2])


def point_velocity(twists: ArrayLike, points: ArrayLike) -> FloatArray:
    """Return the velocity (..., n, 2) of body points (n, 2): ``v + omega * (-y, x)``."""
    v = np.asarray(twists, dtype=np.float64)[..., None, :]
    p = np.asarray(points, dtype=np.float64)
    return np.stack((v[..., 0] - v[..., 2] * p[..., 1], v[..., 1] + v[..., 2] * p[..., 0]), axis=-1)


def wrench_from_force(points: ArrayLike, forces: ArrayLike) -> FloatArray:
    """Return the wrench (..., 3) of forces (..., 2) acting at points (..., 2): ``(f, p_x f_y - p_y f_x)``."""
    p = np.asarray(points, dtype=np.float64)
    f = np.asarray(forces, dtype=np.float64)
    tau = p[..., 0] * f[..., 1] - p[..., 1] * f[..., 0]
    return np.concatenate((np.broadcast_to(f, (*tau.shape, 2)), tau[..., None]), axis=-1)


def transport_wrench(wrenches: ArrayLike, pose: ArrayLike) -> FloatArray:
    """Return wrenches given in the frame ``pose`` (its pose in A), seen in A with the torque about the origin of A."""
    w = np.asarray(wrenches, dtype=np.float64)
    p = np.asarray(pose, dtype=np.float64)
    cos, sin = np.cos(p[..., 2]), np.sin(p[..., 2])
    fx = cos * w[..., 0] - sin * w[..., 1]
    fy = sin * w[..., 0] + cos * w[..., 1]
    return np.stack(np.broadcast_arrays(fx, fy, w[..., 2] + p[..., 0] * fy - p[..., 1] * fx), axis=-1)


def transport_twist(twists: ArrayLike, pose: ArrayLike) -> FloatArray:
    """Return twists given in the frame ``pose`` (its pose in A), seen in A at the origin of A, so that power is kept."""
    v = np.asarray(twists, dtype=np.float64)
    p = np.asarray(pose, dtype=np.float64)
    cos, sin = np.cos(p[..., 2]), np.sin(p[..., 2])
    vx = cos * v[..., 0] - sin * v[..., 1] + v[..., 2] * p[..., 1]
    vy = sin * v[..., 0] + cos * v[..., 1] - v[..., 2] * p[..., 0]
    return np.stack(np.broadcast_arrays(vx, vy, v[..., 2]), axis=-1)


def normalize_wrench(wrenches: ArrayLike, rho: float) -> FloatArray:
    """Return ``(fx, fy, tau/rho)``."""
    return np.asarray(wrenches, dtype=np.float64) * np.array((1.0, 1.0, 1.0 / rho))


def normalize_twist(twists: ArrayLike, rho: float) -> FloatArray:
    """Return ``(vx, vy, rho*omega)``."""
    return np.asarray(twists, dtype=np.float64) * np.array((1.0, 1.0, rho))


def unit(vectors: ArrayLike) -> FloatArray:
    """Return vectors scaled to length one along the last axis; zero vectors stay zero."""
    v = np.asarray(vectors, dtype=np.float64)
    # scaling by the largest entry first keeps tiny and huge vectors from underflow and overflow in the square
    # component by component: numpy is slow to reduce a short last axis
    size = np.abs(v)
    largest = reduce(np.maximum, (size[..., k] for k in range(v.shape[-1])))[..., None]
    v = np.divide(v, largest, out=np.zeros_like(v), where=largest > 0)
    norm = np.sqrt(reduce(np.add, (v[..., k] * v[..., k] for k in range(v.shape[-1]))))[..., None]
    return np.divide(v, norm, out=np.zeros_like(v), where=norm > 0)


def angle_between(first: ArrayLike, second: ArrayLike) -> FloatArray:
    """Return the angle (rad) between vectors (..., 3), exact also where arccos loses half the digits."""
    a, b = unit(first), unit(second)
    return np.asarray(2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)))
