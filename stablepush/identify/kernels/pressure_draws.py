"""Compiled loops over pressure distributions that are drawn: their scale and likelihood given pokes, their centre of pressure."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import compiled


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
