"""Compiled loops over pressure distributions that are drawn: their scale and likelihood given pokes, their centre of pressure."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import compiled
from stablepush.surfaces.kernels import loads_side_by_side

#: Turns of expectation maximisation.
TURNS = 6


@compiled
def weigh(points, shares, possible, twists, loads, weights, error, scales, likelihoods):  # type: ignore[no-untyped-def]
    """Fill ``scales`` (m,) and ``likelihoods`` (m,) of draws with points (m, k, 2) and shares (m, k), given loads (n, 3).

    ``twists`` (3, q n): the q twists that each pair may have had, those of the first choice before those of the second.
    The likelihood of a pair is the mean, with ``weights`` (q,), over its twists of a Student density of the load's error with
    four degrees of freedom, of scale ``error * |F|``; the scale is found by expectation maximisation (which twist it was, and
    how much of an outlier). Draws that are not ``possible`` (m,) have no likelihood.
    """
    n, q = loads.shape[0], weights.shape[0]
    fx, fy, tau = np.empty(q * n), np.empty(q * n), np.empty(q * n)
    product, square = np.empty((q, n)), np.empty((q, n))
    sizes, per_error = np.empty(n), np.empty(n)
    density, above, below = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        sizes[i] = loads[i, 0] ** 2 + loads[i, 1] ** 2 + loads[i, 2] ** 2
        per_error[i] = 1.0 / (error * error * sizes[i])
    for d in range(points.shape[0]):
        if not possible[d]:
            scales[d], likelihoods[d] = 1.0, -math.inf
            continue
        loads_side_by_side(points[d], shares[d], twists[0], twists[1], twists[2], fx, fy, tau)
        for k in range(q):
            for i in range(n):
                x, y, z = fx[k * n + i], fy[k * n + i], tau[k * n + i]
                product[k, i] = x * loads[i, 0] + y * loads[i, 1] + z * loads[i, 2]
                square[k, i] = max(x * x + y * y + z * z, 1e-300)
        up = low = 0.0
        for i in range(n):
            up += product[0, i]
            low += square[0, i]
        scale = max(up / low, 1e-12)
        for turn in range(TURNS):
            density[:] = 0.0
            above[:] = 0.0
            below[:] = 0.0
            for k in range(q):
                weight = 128.0 * weights[k]
                for i in range(n):
                    # |F - sP|² = |F|² - 2 s F·P + s²|P|²
                    miss = (sizes[i] - 2 * scale * product[k, i] + scale * scale * square[k, i]) * per_error[i]
                    rest = 1.0 / (4.0 + max(miss, 0.0))
                    # (1 + miss/4)^(-7/2) but for a constant
                    dense = weight * rest * rest * rest * math.sqrt(rest)
                    density[i] += dense
                    above[i] += dense * rest * product[k, i]
                    below[i] += dense * rest * square[k, i]
            if turn < TURNS - 1:
                up = low = 0.0
                for i in range(n):
                    share = 1.0 / (max(density[i], 1e-300) * sizes[i])
                    up += share * above[i]
                    low += share * below[i]
                scale = max(up / low, 1e-12)
        total = 0.0
        for i in range(n):
            total += math.log(max(density[i], 1e-300))
        scales[d], likelihoods[d] = scale, total


@compiled
def tilt_shares(points, raw, active, centers, tolerance, steps, shares, good):  # type: ignore[no-untyped-def]
    """Fill ``shares`` (m, k) with ``q ∝ raw exp(λ·(x - c))`` of mean zero in ``x - c``; ``good`` (m,) tells where there is
    such a tilt.

    Newton on the convex ``log Σ raw exp(λ·(x - c))``, whose gradient is the mean; a tilt that runs away leaves one point:
    such a draw does not surround its centre. Lengths are in units of the outline's radius.
    """
    logs = np.empty(points.shape[1])
    for d in range(points.shape[0]):
        lx = ly = 0.0
        good[d] = False
        for k in range(points.shape[1]):
            if active[d, k]:
                logs[k] = math.log(raw[d, k])
        for _ in range(steps):
            largest = -np.inf
            for k in range(points.shape[1]):
                if active[d, k]:
                    value = logs[k] + lx * (points[d, k, 0] - centers[d, 0]) + ly * (points[d, k, 1] - centers[d, 1])
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
