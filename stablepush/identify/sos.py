"""SOS-convexity as linear equations between the coefficients and a Gram matrix.

``H`` is SOS-convex when ``zᵀ∇²H(F)z = yᵀQy`` with ``Q ⪰ 0`` and ``y = z ⊗ (monomials of degree (d-2)/2 in F)``. Matching
monomials ``z_p z_q F^m`` gives one linear equation each: 36 for degree 4, 90 for degree 6. All ``Q`` that belong to one
polynomial form an affine space, so instead of carrying the equations we write ``Q = Q(a, s)`` with a basis ``s`` of the
equations' null space.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from stablepush.core import FloatArray
from stablepush.surfaces import UPPER, hessian_operator, monomial_exponents, monomial_index


@cache
def gram_equations(degree: int) -> tuple[FloatArray, FloatArray]:
    """Return ``E`` (k, n, n) and ``T`` (k, m): ``Q`` belongs to the coefficients ``a`` iff ``<E_k, Q> = (T a)_k`` for every k.

    The rows of ``E`` are symmetric and orthogonal to each other.
    """
    basis = monomial_exponents((degree - 2) // 2)
    size = len(basis)
    per_entry = len(monomial_exponents(degree - 2))
    equations = np.zeros((len(UPPER) * per_entry, 3 * size, 3 * size))
    for row, (p, q) in enumerate(UPPER):
        for b, c in product(range(size), repeat=2):
            i, j, k = (int(e) for e in basis[b] + basis[c])
            equation = row * per_entry + monomial_index(degree - 2, (i, j, k))
            # half on either side of the diagonal keeps every equation symmetric
            equations[equation, p * size + b, q * size + c] += 0.5
            equations[equation, q * size + c, p * size + b] += 0.5
    targets = hessian_operator(degree).reshape(len(equations), -1)
    return equations, targets


def project_gram(gram: FloatArray, coefficients: FloatArray, degree: int) -> FloatArray:
    """Return the matrix nearest to ``gram`` that belongs exactly (to rounding) to the polynomial."""
    equations, targets = gram_equations(degree)
    flat = equations.reshape(len(equations), -1)
    symmetric = (gram + gram.T) / 2
    miss = targets @ coefficients - flat @ symmetric.ravel()
    # orthogonal rows: the least-norm correction needs no solve
    correction = (miss / (flat**2).sum(axis=1)) @ flat
    return np.asarray(symmetric + correction.reshape(gram.shape))


@cache
def gram_parametrization(degree: int) -> tuple[FloatArray, FloatArray]:
    """Return ``P`` (n*n, m) and ``N`` (n*n, f): every ``Q`` of a polynomial is ``P a + N s``, flattened."""
    equations, targets = gram_equations(degree)
    flat = equations.reshape(len(equations), -1)
    particular = flat.T @ (targets / (flat**2).sum(axis=1)[:, None])
    n = equations.shape[1]
    rows, columns = np.triu_indices(n)
    symmetric = np.zeros((n * n, len(rows)))
    for c, (i, j) in enumerate(zip(rows, columns, strict=True)):
        symmetric[i * n + j, c] = symmetric[j * n + i, c] = 1.0
    free = symmetric @ _null_space(flat @ symmetric)
    return particular, free


def _null_space(matrix: FloatArray) -> FloatArray:
    """Orthonormal basis (n, f) of the null space of a matrix (m, n) with one entry a column, as a Gram entry is of one monomial.

    Each row has its own columns; a reflection that takes the row to the first of them takes the others to vectors at right angles
    to it. Written down, the basis is the same on every machine, and so are the steps of the solver.
    """
    found = []
    for row in matrix:
        mine = np.flatnonzero(row)
        unit = row[mine] / np.linalg.norm(row[mine])
        mirror = unit.copy()
        mirror[0] += np.copysign(1.0, unit[0])
        reflection = np.eye(len(mine)) - np.outer(mirror, mirror) / (1 + abs(unit[0]))
        basis = np.zeros((matrix.shape[1], len(mine) - 1))
        basis[mine] = reflection[:, 1:]
        found.append(basis)
    return np.concatenate(found, axis=1)
