"""Monomials of three variables: exponents, values, and the operator from coefficients to second derivatives.

A homogeneous polynomial of degree ``d`` is ``H(F) = sum_m a_m x^i y^j z^k`` with ``i + j + k = d``; there are
``(d + 1)(d + 2)/2`` monomials, ordered by falling ``i``, then falling ``j``.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from stablepush.core import FloatArray, InputError

#: Rows and columns of the upper triangle of a 3x3 matrix, in the order used for second derivatives.
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def monomial_exponents(degree: int) -> NDArray[np.int64]:
    """Return the exponents (m, 3) of all monomials of three variables of the given degree, in the library's order."""
    if degree < 0:
        raise InputError("degree", "expected a number >= 0", degree)
    return _exponents(degree).copy()


@cache
def _exponents(degree: int) -> NDArray[np.int64]:
    rows = [(i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)]
    return np.array(rows, dtype=np.int64)


@cache
def _index(degree: int) -> dict[tuple[int, int, int], int]:
    return {(int(i), int(j), int(k)): m for m, (i, j, k) in enumerate(_exponents(degree))}


def monomial_index(degree: int, exponents: tuple[int, int, int]) -> int:
    """Return the place of a monomial in the order of :func:`monomial_exponents`."""
    return _index(degree)[exponents]


def monomials(points: FloatArray, degree: int) -> FloatArray:
    """Return all monomials (..., m) of the given degree at points (..., 3)."""
    powers = np.ones((degree + 1, *points.shape))
    for p in range(degree):
        powers[p + 1] = powers[p] * points
    i, j, k = _exponents(degree).T
    product = powers[i, ..., 0] * powers[j, ..., 1] * powers[k, ..., 2]
    return np.asarray(np.moveaxis(product, 0, -1))


@cache
def hessian_operator(degree: int) -> FloatArray:
    """Return ``T`` (6, n, m): ``T @ a`` holds the second derivatives of ``sum a_m F^m`` as forms of degree ``d - 2``.

    Rows follow :data:`UPPER`; columns the monomials of degree ``d - 2``.
    """
    exponents = _exponents(degree)
    operator = np.zeros((6, len(_exponents(degree - 2)), len(exponents)))
    for m, exponent in enumerate(exponents):
        for row, (p, q) in enumerate(UPPER):
            lowered = exponent.copy()
            factor = lowered[p]
            lowered[p] -= 1
            factor *= lowered[q]
            lowered[q] -= 1
            if factor > 0:
                i, j, k = (int(e) for e in lowered)
                operator[row, monomial_index(degree - 2, (i, j, k)), m] = factor
    operator.flags.writeable = False
    return operator


@cache
def gradient_operator(degree: int) -> FloatArray:
    """Return ``T`` (3, n, m): ``T @ a`` holds the gradient of ``sum a_m F^m`` as forms of degree ``d - 1``."""
    exponents = _exponents(degree)
    operator = np.zeros((3, len(_exponents(degree - 1)), len(exponents)))
    for m, exponent in enumerate(exponents):
        for axis in range(3):
            if exponent[axis] > 0:
                lowered = exponent.copy()
                lowered[axis] -= 1
                i, j, k = (int(e) for e in lowered)
                operator[axis, monomial_index(degree - 1, (i, j, k)), m] = exponent[axis]
    operator.flags.writeable = False
    return operator


def gradient_rows(points: FloatArray, degree: int) -> FloatArray:
    """Return ``G`` (..., 3, m): ``G @ a`` is the gradient of ``sum a_m F^m`` at points (..., 3)."""
    return np.asarray(np.einsum("...n,anm->...am", monomials(points, degree - 1), gradient_operator(degree), optimize=True))


@cache
def bombieri_norms(degree: int) -> FloatArray:
    """Return ``b`` (m,): ``Σ b_m a_m²`` is the square of Bombieri's norm, which does not change when the axes are turned.

    ``b_m = i! j! k! / d!`` (Beauzamy, Bombieri, Enflo, Montgomery 1990).
    """
    factorial = np.concatenate(([1.0], np.cumprod(np.arange(1.0, degree + 1))))
    norms = factorial[_exponents(degree)].prod(axis=1) / factorial[degree]
    norms.flags.writeable = False
    return np.asarray(norms)


def substitution(matrix: FloatArray, degree: int) -> FloatArray:
    """Return ``T`` (m, m): ``T a`` are the coefficients of ``y -> H(matrix @ y)`` if ``a`` are those of ``H``."""
    # both sides are polynomials of y: agreeing at enough points they agree
    points = _general_points(degree)
    return np.asarray(np.linalg.lstsq(monomials(points, degree), monomials(points @ matrix.T, degree))[0])


@cache
def _general_points(degree: int) -> FloatArray:
    points = np.random.default_rng(0).normal(size=(4 * len(_exponents(degree)), 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)
