"""SOS-convexity as a linear matrix inequality, and the quadratic fit under it.

``H`` is SOS-convex when ``zᵀ∇²H(F)z = yᵀQy`` with ``Q ⪰ 0`` and ``y = z ⊗ (monomials of degree (d-2)/2 in F)``. Matching
monomials ``z_p z_q F^m`` gives one linear equation each: 36 for degree 4, 90 for degree 6. All ``Q`` that belong to one
polynomial form an affine space, so instead of carrying the equations we write ``Q = Q(a, s)`` with a basis ``s`` of the
equations' null space.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import scipy.linalg

from stablepush._arrays import FloatArray
from stablepush.errors import SolverError
from stablepush.models.monomials import UPPER, hessian_operator, monomial_exponents, monomial_index

#: Lower bound on the eigenvalues of Q, for loads scaled to a median length of one; |F|^4 has eigenvalues 4 to 12.
LEAST_EIGENVALUE = 1e-3

#: Solvers in the order they are tried, with their settings: the second takes over where the first fails, and the status
#: then names it.
_SOLVERS: tuple[tuple[str, dict[str, float]], ...] = (("CLARABEL", {}), ("SCS", {"eps": 1e-7, "max_iters": 50_000}))


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
    free = symmetric @ scipy.linalg.null_space(flat @ symmetric)
    return particular, free


@dataclass(frozen=True, slots=True, eq=False)
class SosSolution:
    """Coefficients (m,), Gram matrix ``Q`` (n, n), the solver's status and its own time in s."""

    coefficients: FloatArray
    gram: FloatArray
    status: str
    solve_time: float


class SosConvexProgram:
    """``minimise |L a|² - 2 q·a`` over SOS-convex polynomials: canonicalised once, solved again for new ``L`` and ``q``."""

    def __init__(self, degree: int) -> None:
        import cvxpy as cp

        particular, free = gram_parametrization(degree)
        size = round(len(particular) ** 0.5)
        count = particular.shape[1]
        self._particular, self._free, self._size = particular, free, size
        self._a = cp.Variable(count)
        self._s = cp.Variable(max(1, free.shape[1]))
        self._root = cp.Parameter((count, count))
        self._linear = cp.Parameter(count)
        free_columns = free if free.shape[1] else np.zeros((size * size, 1))
        gram = cp.reshape(particular @ self._a + free_columns @ self._s, (size, size), order="C")
        constraints = [(gram + gram.T) / 2 >> LEAST_EIGENVALUE * np.eye(size)]
        if not free.shape[1]:
            constraints.append(self._s == 0)
        self._problem = cp.Problem(cp.Minimize(cp.sum_squares(self._root @ self._a) - 2 * self._linear @ self._a), constraints)

    def solve(self, quadratic: FloatArray, linear: FloatArray) -> SosSolution:
        """Minimise ``aᵀ P a - 2 q·a`` for a positive definite ``P`` (m, m) and ``q`` (m,)."""
        # the scale of the objective is free: near one it suits the solvers' tolerances
        scale = float(np.trace(quadratic)) / len(quadratic)
        self._root.value = np.linalg.cholesky(quadratic / scale).T
        self._linear.value = linear / scale
        failures = []
        for name, settings in _SOLVERS:
            started = time.perf_counter()
            status = self._attempt(name, settings)
            if status in ("optimal", "optimal_inaccurate"):
                return self._solution(status if name == _SOLVERS[0][0] else f"{status} ({name})", started)
            failures.append(f"{name}: {status}")
        raise SolverError(f"SOS-convex fit: no solver found a solution ({', '.join(failures)})")

    def _attempt(self, name: str, settings: dict[str, float]) -> str:
        import cvxpy as cp

        try:
            # the status says it when a solution is inaccurate, and the certificate decides: no warning needed
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                self._problem.solve(solver=name, warm_start=False, **settings)
        except cp.error.SolverError:
            return "failed"
        return str(self._problem.status)

    def _solution(self, status: str, started: float) -> SosSolution:
        elapsed = time.perf_counter() - started
        a = np.asarray(self._a.value)
        gram = self._particular @ a
        if self._free.shape[1]:
            gram = gram + self._free @ np.asarray(self._s.value)
        stats: Any = self._problem.solver_stats
        in_solver = elapsed if stats is None or stats.solve_time is None else float(stats.solve_time)
        return SosSolution(a, gram.reshape(self._size, self._size), status, in_solver)


@cache
def sos_convex_program(degree: int) -> SosConvexProgram:
    """Return the program of a degree; its canonical form is kept for the process."""
    return SosConvexProgram(degree)
