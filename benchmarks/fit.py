"""What one identification costs: 24 settings in 5 folds and the final fit, against calling cvxpy afresh each time.

    python benchmarks/fit.py [--pairs 40]

Both solve the same 121 problems on the same pairs, with Clarabel: this library reduces the pairs to moments and fills them
into a program that was canonicalised once; the other writes the paper's problem down in cvxpy each time, with a 9 x 9
semidefinite matrix and 36 equations. Their coefficients are compared. The first call, which canonicalises, is timed on its own.
"""

from __future__ import annotations

import argparse
import time
from itertools import product

import cvxpy as cp
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import unit
from stablepush.identify.estimator import SquaredLoss, SquaredWeights
from stablepush.identify.pairs import Pairs
from stablepush.identify.program import LEAST_EIGENVALUE
from stablepush.identify.sos import gram_equations
from stablepush.surfaces.monomials import gradient_rows, monomials

SETTINGS = [SquaredWeights(a, b) for a, b in product((0.1, 1.0, 10.0, 100.0), (0.1, 0.5, 1.0, 2.0, 4.0, 8.0))]


def pairs_of(count: int) -> Pairs:
    """Return noisy pairs of a slider on three feet."""
    rng = np.random.default_rng(0)
    truth = sp.IdealLimitSurface(sp.SupportDistribution(((-0.02, -0.02), (0.04, -0.02), (-0.02, 0.04)), (1, 1, 1)), 5.0, 0.05)
    twists = unit(rng.normal(size=(count, 3))) / (1, 1, 0.05)
    loads = truth.wrench(twists) + 0.3 * rng.normal(size=(count, 3)) * (1, 1, 0.05)
    return Pairs.from_data(loads, twists, None, 0.05)


def afresh(pairs: Pairs, weights: SquaredWeights) -> np.ndarray:
    """Write the paper's problem down in cvxpy and solve it."""
    equations, targets = gram_equations(4)
    a, q = cp.Variable(15), cp.Variable((9, 9), symmetric=True)
    gradient = gradient_rows(pairs.loads, 4)
    along = np.einsum("ni,nim->nm", pairs.directions, gradient)
    across = (gradient - pairs.directions[:, :, None] * along[:, None, :]).reshape(-1, 15)
    level = monomials(pairs.loads, 4) @ a - 1
    loss = cp.sum_squares(a) + weights.eta1 * cp.sum_squares(across @ a) + weights.eta2 * cp.sum_squares(level)
    constraints = [cp.trace(e @ q) == t @ a for e, t in zip(equations, targets, strict=True)]
    constraints.append(q >> LEAST_EIGENVALUE * np.eye(9))
    cp.Problem(cp.Minimize(loss), constraints).solve(solver=cp.CLARABEL)
    return np.asarray(a.value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=40)
    pairs = pairs_of(parser.parse_args().pairs)
    folds = np.array_split(np.random.default_rng(1).permutation(len(pairs)), 5)
    estimator = SquaredLoss(4, True, None, False, "zero")
    parts = [pairs.take(np.setdiff1d(np.arange(len(pairs)), fold)) for fold in folds]
    jobs = [(part, weights) for part in parts for weights in SETTINGS] + [(pairs, SETTINGS[12])]

    # the first solve of a process canonicalises: on its own
    started = time.perf_counter()
    estimator.minimize(np.eye(15), np.zeros(15))
    first = time.perf_counter() - started

    started = time.perf_counter()
    reduced = {id(part): estimator.prepare(part) for part in (*parts, pairs)}
    solutions = [estimator.solve(reduced[id(part)], weights) for part, weights in jobs]
    took = time.perf_counter() - started

    started = time.perf_counter()
    theirs = [afresh(part, weights) for part, weights in jobs]
    other = time.perf_counter() - started
    worst = max(np.abs(a.coefficients - b).max() / np.abs(b).max() for a, b in zip(solutions, theirs, strict=True))
    in_solver = 1e3 * sum(s.solve_time for s in solutions) / len(jobs)
    print(f"{len(pairs)} pairs, {len(jobs)} problems")
    print(f"stablepush:   {1e3 * took:7.0f} ms, {1e3 * took / len(jobs):6.2f} ms a problem, {in_solver:.2f} of it in the solver")
    print(f"cvxpy afresh: {1e3 * other:7.0f} ms, {1e3 * other / len(jobs):6.2f} ms a problem")
    print(f"ratio: {other / took:.1f}; once for a process, to canonicalise: {1e3 * first:.0f} ms")
    print(f"largest difference of a coefficient, of the largest: {worst:.1e}")


if __name__ == "__main__":
    main()
