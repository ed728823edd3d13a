"""The convex programs of a fit: canonicalised once for a degree and a loss, then solved again with new numbers."""

from __future__ import annotations

import threading
import time
import warnings
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
import scipy.sparse

from stablepush.core import FloatArray, SolverError
from stablepush.identify.moments import Moments, gradient_across
from stablepush.identify.sos import gram_parametrization
from stablepush.surfaces import bombieri_norms, monomial_exponents, monomials

#: Lower bound on the eigenvalues of Q, for loads scaled to a median length of one; |F|^4 has eigenvalues 4 to 12.
LEAST_EIGENVALUE = 1e-3
#: The same under the norm loss. Where the penalty outweighs the data the coefficients collapse towards zero, and what is left of
#: them still has directions, between which the authors' validation chooses: a floor would replace them by its own.
LEAST_EIGENVALUE_NORM = 0.0
#: But for the last solve: a bound of this share of the largest coefficient leaves room for a proof of convexity. On the bound of
#: zero itself the sign of an eigenvalue is what the solver leaves, and differs between processors.
PROVABLE = 1e-6

#: Solvers in the order they are tried, with their settings: the second takes over where the first fails, and the status
#: then names it.
_SOLVERS: tuple[tuple[str, dict[str, float]], ...] = (("CLARABEL", {}), ("SCS", {"eps": 1e-7, "max_iters": 50_000}))


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Coefficients (m,), Gram matrix ``Q`` (n, n) of a convex one, the solver's status and its own time in s."""

    coefficients: FloatArray
    gram: FloatArray | None
    status: str
    solve_time: float
    #: whether the first solver failed
    taken_over: bool = False


class _Program:
    """Coefficients ``a``, convex by a matrix ``Q(a, s) ⪰ floor`` if asked for, and the solvers."""

    def __init__(self, degree: int, convex: bool, floor: float) -> None:
        import cvxpy as cp

        self._convex = convex
        self._a = cp.Variable(len(monomial_exponents(degree)))
        self._constraints: list[Any] = []
        if convex:
            particular, free = gram_parametrization(degree)
            size = round(len(particular) ** 0.5)
            gram = particular @ self._a
            if free.shape[1]:
                self._s = cp.Variable(free.shape[1])
                gram = gram + free @ self._s
            gram = cp.reshape(gram, (size, size), order="C")
            self._gram = (gram + gram.T) / 2
            self._floor = cp.Parameter(nonneg=True, value=floor)
            self._constraints.append(self._gram >> self._floor * np.eye(size))

    def _pose(self, objective: Any) -> None:
        import cvxpy as cp

        self._problem = cp.Problem(cp.Minimize(objective), self._constraints)

    def _solve(self, solvers: tuple[tuple[str, dict[str, float]], ...] = _SOLVERS) -> Estimate:
        failures: list[str] = []
        for name, settings in solvers:
            started = time.perf_counter()
            status = self._attempt(name, settings)
            if status in ("optimal", "optimal_inaccurate"):
                elapsed = time.perf_counter() - started
                stats: Any = self._problem.solver_stats
                return Estimate(
                    np.asarray(self._a.value),
                    np.asarray(self._gram.value) if self._convex else None,
                    status if name == _SOLVERS[0][0] else f"{status} ({name})",
                    elapsed if stats is None or stats.solve_time is None else float(stats.solve_time),
                    taken_over=bool(failures),
                )
            failures.append(f"{name}: {status}")
        raise SolverError(f"fit: no solver found a solution ({', '.join(failures)})")

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


class SquaredProgram(_Program):
    """``minimise aᵀ P a - 2 q·a`` over SOS-convex polynomials.

    A fit solves it hundreds of times for 15 coefficients, and the modelling layer then takes longer than the solver: Clarabel is
    handed its standard form, ``½xᵀPx + q·x`` with ``b - Ax`` in the cone, of which only ``P`` and ``q`` change. Should it
    fail, SCS takes over through cvxpy.
    """

    def __init__(self, degree: int) -> None:
        import cvxpy as cp

        super().__init__(degree, True, LEAST_EIGENVALUE)
        count = self._a.size
        self._alone = threading.Lock()
        self._root = cp.Parameter((count, count))
        self._linear = cp.Parameter(count)
        self._pose(cp.sum_squares(self._root @ self._a) - 2 * self._linear @ self._a)
        particular, free = gram_parametrization(degree)
        self._map = np.concatenate((particular, free), axis=1)
        self._size = round(len(particular) ** 0.5)
        # the solver's vector of a symmetric matrix: columns of its upper triangle, off the diagonal times sqrt 2
        columns, rows = np.tril_indices(self._size)
        scale = np.where(rows == columns, 1.0, np.sqrt(2.0))
        entries = self._map.reshape(self._size, self._size, -1)
        entries = (entries + entries.transpose(1, 0, 2)) / 2
        self._matrix = scipy.sparse.csc_matrix(-scale[:, None] * entries[rows, columns])
        self._bound = np.where(rows == columns, -LEAST_EIGENVALUE, 0.0)
        # the upper triangle of the coefficients' block of P, column by column
        self._columns, self._rows = np.tril_indices(count)
        self._ends = np.concatenate((np.cumsum(np.arange(count + 1)), np.full(free.shape[1], len(self._rows))))

    def solve(self, quadratic: FloatArray, linear: FloatArray) -> Estimate:
        """Solve for a positive definite ``P`` (m, m) and ``q`` (m,)."""
        # the scale of the objective is free: near one it suits the solvers' tolerances
        scale = float(np.trace(quadratic)) / len(quadratic)
        direct = self._direct(quadratic / scale, linear / scale)
        if direct is not None:
            return direct
        # one at a time: the parameters are those of the program
        with self._alone:
            self._root.value = _factor(quadratic / scale)
            self._linear.value = linear / scale
            return replace(self._solve(_SOLVERS[1:]), taken_over=True)

    def _direct(self, quadratic: FloatArray, linear: FloatArray) -> Estimate | None:
        import clarabel

        count, total = len(linear), self._map.shape[1]
        values = 2 * quadratic[self._rows, self._columns]
        curvature = scipy.sparse.csc_matrix((values, self._rows, self._ends), shape=(total, total))
        slope = np.zeros(total)
        slope[:count] = -2 * linear
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        cones = [clarabel.PSDTriangleConeT(self._size)]
        problem = (curvature, slope, self._matrix, self._bound, cones, settings)
        solution = clarabel.DefaultSolver(*problem).solve()
        status = {"Solved": "optimal", "AlmostSolved": "optimal_inaccurate"}.get(str(solution.status))
        x = np.array(solution.x)
        if status is None or not np.isfinite(x).all():
            return None
        gram = (self._map @ x).reshape(self._size, self._size)
        return Estimate(x[:count], (gram + gram.T) / 2, status, float(solution.solve_time))


class NormProgram(_Program):
    """``minimise w_reg |a| + w_force |ξ| + w_slip |δ|`` over SOS-convex polynomials: norms where the paper has squares, as in
    the authors' code for convex quartics.

    ``ξ_i = H(F_i) - 1`` and ``δ_i = ∇H(F_i) - s_i V_i`` with a free scale ``s_i``, which is the part of the gradient across the
    measured twist. The authors ask for positive scales. Here they are free, which leaves the data as moments; the two differ
    only where the fitted gradient opposes a measured twist, an outlier.
    """

    def __init__(self, degree: int) -> None:
        import cvxpy as cp

        super().__init__(degree, True, LEAST_EIGENVALUE_NORM)
        count = self._a.size
        self._size = cp.Parameter(nonneg=True)
        self._level = cp.Parameter((count + 1, count))
        self._level_target = cp.Parameter(count + 1)
        self._slip = cp.Parameter((count, count))
        self._pose(
            self._size * cp.norm(self._a) + cp.norm(self._level @ self._a - self._level_target) + cp.norm(self._slip @ self._a)
        )

    def solve(self, moments: Moments, w_reg: float, w_force: float, w_slip: float, floor: float = 0.0) -> Estimate:
        """Solve for the moments of some pairs, with a lower bound on the eigenvalues of ``Q``."""
        self._floor.value = floor
        joint = np.block([[moments.level, -moments.target[:, None]], [-moments.target[None, :], np.array([[moments.count]])]])
        root = _root(joint) * w_force
        self._size.value = w_reg
        self._level.value = root[:, :-1]
        self._level_target.value = -root[:, -1]
        self._slip.value = _root(moments.slip) * w_slip
        return self._solve()


class SumOfNormsProgram(_Program):
    """``minimise w_reg |a| + w_force Σ |ξ_i| + w_slip Σ |δ_i|``, each pair with a norm of its own.

    So the authors' code fits the polynomial of degree 4 that need not be convex, and the quadratic: many pairs are then left with
    no residual at all. ``ξ_i`` and ``δ_i`` as in :class:`NormProgram`. ``|a|`` of a quadratic ``FᵀAF`` is Frobenius' norm
    of ``A``, and its gradient is taken as ``AF``, half of what it is.
    """

    def __init__(self, degree: int, convex: bool, pairs: int) -> None:
        import cvxpy as cp

        super().__init__(degree, convex, LEAST_EIGENVALUE_NORM)
        count = self._a.size
        self._size = cp.Parameter(nonneg=True)
        self._across, self._level = cp.Parameter((3 * pairs, count)), cp.Parameter((pairs, count))
        # no parameter meets another one in a product: only then is the problem canonicalised once
        self._level_target = cp.Parameter(pairs)
        # Frobenius' norm of a quadratic's matrix is Bombieri's; |a| of degree 4 is the plain norm of the coefficients
        size = np.sqrt(bombieri_norms(2)) if degree == 2 else np.ones(count)
        self._gradient_factor = 0.5 if degree == 2 else 1.0
        slip = cp.reshape(self._across @ self._a, (pairs, 3), order="C")
        self._pose(
            self._size * cp.norm(cp.multiply(size, self._a))
            + cp.norm1(self._level @ self._a - self._level_target)
            + cp.sum(cp.norm(slip, axis=1))
        )
        self._degree = degree

    def solve(
        self, loads: FloatArray, directions: FloatArray, w_reg: float, w_force: float, w_slip: float, floor: float = 0.0
    ) -> Estimate:
        """Solve for normalised loads (n, 3) and unit normalised twists (n, 3), with a lower bound on the eigenvalues of ``Q``."""
        if self._convex:
            self._floor.value = floor
        across = gradient_across(loads, directions, self._degree)
        self._across.value = self._gradient_factor * w_slip * across.reshape(-1, across.shape[-1])
        self._level.value = w_force * monomials(loads, self._degree)
        self._level_target.value = np.full(len(loads), w_force)
        self._size.value = w_reg
        return self._solve()


def _factor(quadratic: FloatArray) -> FloatArray:
    """Upper factor ``R`` with ``RᵀR`` the matrix; a matrix that is positive definite but for rounding is taken as it is."""
    try:
        return np.asarray(np.linalg.cholesky(quadratic).T)
    except np.linalg.LinAlgError:
        return _root(quadratic)


def _root(gram: FloatArray) -> FloatArray:
    """Square root ``R`` with ``RᵀR`` the positive semidefinite ``gram``, which may be singular."""
    values, vectors = np.linalg.eigh(gram)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


@cache
def squared_program(degree: int) -> SquaredProgram:
    """Return the program of a degree; its canonical form is kept for the process."""
    return SquaredProgram(degree)


@cache
def norm_program(degree: int) -> NormProgram:
    """Return the program of a degree; its canonical form is kept for the process."""
    return NormProgram(degree)


@lru_cache(maxsize=16)
def sum_of_norms_program(degree: int, convex: bool, pairs: int) -> SumOfNormsProgram:
    """Return the program of a degree and a number of pairs; the canonical forms of the last few are kept."""
    return SumOfNormsProgram(degree, convex, pairs)
