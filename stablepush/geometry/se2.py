"""Planar rigid motions SE(2): functions on poses and twists of shape (..., 3).

A pose ``(x, y, theta)`` places the body frame B in the world frame W; a twist ``(vx, vy, omega)`` is the velocity of the
origin of B, seen in B. Units: m, rad, m/s, rad/s. Everything broadcasts over leading axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray


def wrap_angle(angle: ArrayLike) -> FloatArray:
    """Return the angle (rad) moved by full turns into (-pi, pi].

    Angles up to 1e-9 rad above -pi become pi, and as much more than it: half a turn is one to the left, whatever its rounding.
    """
    turn = np.mod(np.pi - np.asarray(angle, dtype=np.float64), 2 * np.pi)
    return np.asarray(np.pi - np.where(turn > 2 * np.pi - 1e-9, turn - 2 * np.pi, turn))


def compose(first: ArrayLike, second: ArrayLike) -> FloatArray:
    """Return the pose ``first * second``: ``second`` is given in the frame of ``first``; theta is not wrapped."""
    a, b = np.broadcast_arrays(np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64))
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        (
            a[..., 0] + cos * b[..., 0] - sin * b[..., 1],
            a[..., 1] + sin * b[..., 0] + cos * b[..., 1],
            a[..., 2] + b[..., 2],
        ),
        axis=-1,
    )


def inverse(pose: ArrayLike) -> FloatArray:
    """Return the inverse pose: ``compose(pose, inverse(pose))`` is the identity."""
    p = np.asarray(pose, dtype=np.float64)
    cos, sin = np.cos(p[..., 2]), np.sin(p[..., 2])
    return np.stack((-cos * p[..., 0] - sin * p[..., 1], sin * p[..., 0] - cos * p[..., 1], -p[..., 2]), axis=-1)


def exp(twist: ArrayLike) -> FloatArray:
    """Return the pose reached from the identity by one unit of time at a constant body twist.

    ``p = [[a, -b], [b, a]] v`` with ``a = sin(omega)/omega``, ``b = (1 - cos(omega))/omega``; both are evaluated without
    cancellation for every ``omega``, zero included.
    """
    v = np.asarray(twist, dtype=np.float64)
    omega = v[..., 2]
    a = np.sinc(omega / np.pi)
    b = np.sin(omega / 2) * np.sinc(omega / (2 * np.pi))
    return np.stack((a * v[..., 0] - b * v[..., 1], b * v[..., 0] + a * v[..., 1], omega), axis=-1)


def log(pose: ArrayLike) -> FloatArray:
    """Return the constant body twist that reaches ``pose`` from the identity in one unit of time.

    The inverse of :func:`exp` for ``|theta| < 2 pi``; theta is taken as it stands, not wrapped.
    """
    p = np.asarray(pose, dtype=np.float64)
    half = p[..., 2] / 2
    # half * cot(half), which is 1 at zero
    a = np.cos(half) / np.sinc(half / np.pi)
    return np.stack((a * p[..., 0] + half * p[..., 1], -half * p[..., 0] + a * p[..., 1], p[..., 2]), axis=-1)


def transform_points(pose: ArrayLike, points: ArrayLike) -> FloatArray:
    """Return points (n, 2) of the frame ``pose`` (..., 3), seen in the frame that the pose is given in: (..., n, 2)."""
    p = np.asarray(pose, dtype=np.float64)[..., None, :]
    q = np.asarray(points, dtype=np.float64)
    cos, sin = np.cos(p[..., 2]), np.sin(p[..., 2])
    return np.stack(
        (
            p[..., 0] + cos * q[..., 0] - sin * q[..., 1],
            p[..., 1] + sin * q[..., 0] + cos * q[..., 1],
        ),
        axis=-1,
    )


def rotate_vectors(angle: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Return vectors (..., 2) turned counter-clockwise by ``angle`` (rad)."""
    v = np.asarray(vectors, dtype=np.float64)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack((cos * v[..., 0] - sin * v[..., 1], sin * v[..., 0] + cos * v[..., 1]), axis=-1)
