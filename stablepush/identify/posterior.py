"""Surfaces that pairs leave likely: an ensemble of SOS-convex polynomials with a fit."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray, in_threads
from stablepush.identify.estimator import Part, SquaredLoss, SquaredWeights, pseudo_twists
from stablepush.identify.moments import Moments

#: Surfaces of the ensemble that comes with a fit.
MEMBERS = 50
#: With a slider: pairs of its pressure that a member is fitted to, its own for each, so that members also differ where a
#: polynomial cannot follow the facets. Of 15, 30, 60 and 400 pairs, 15 to 30 gave about the right spread on simulated rigs.
PAIRS_OF_A_MEMBER = 20
#: Without a slider: the spread is this many times that of independent errors of the residuals' size, for what a polynomial cannot
#: follow is not independent from pair to pair. Measured on simulated rigs with 5 to 40 pokes, for which it hardly differs.
MISFIT = 2.9


def draw_coefficients(
    estimator: SquaredLoss, part: Part, weights: SquaredWeights, best: FloatArray, rho: float, seed: int
) -> list[FloatArray]:
    """Return coefficients of equally likely surfaces, all SOS-convex.

    With a slider: convex polynomials fitted to the ideal surfaces of the likely pressures. Each of these has been
    weighed by the pokes; weighing those in again would make the draws agree too much.

    Without: Laplace's approximation, widened by :data:`MISFIT`. The objective ``aᵀPa - 2q·a`` over twice its residual
    variance ``s²`` is the logarithm of a posterior with covariance ``s² P⁻¹``; draws of that are the minimisers for ``q + s
    P^(1/2) z`` with standard normal ``z``, each found under the convexity constraint (randomise, then optimise: Bardsley,
    Solonen, Haario and Laine 2014).
    """
    if weights.prior and part.pressures is not None:
        alone = SquaredWeights(0.0, 0.0, weights.prior)
        draws = part.pressures.wrenches(pseudo_twists(), rho)[:: max(1, len(part.pressures.loads) // MEMBERS)]
        rng = np.random.default_rng(seed)
        chosen = [(draw, rng.choice(len(draw), PAIRS_OF_A_MEMBER, replace=False)) for draw in draws[:MEMBERS]]

        def fitted(job: tuple[FloatArray, np.ndarray]) -> FloatArray:
            draw, rows = job
            pseudo = Moments.from_pairs(draw[rows], pseudo_twists()[rows], estimator.degree)
            return estimator.solve(part.with_pseudo(pseudo), alone).coefficients

        return in_threads(fitted, chosen)
    quadratic, linear = estimator.normal_equations(part, weights)
    # value of the objective with its constants: three residuals a pair and the penalty, which counts as much as the
    # coefficients take away
    residual = float(best @ quadratic @ best - 2 * linear @ best + weights.eta2 * part.pairs.count + part.penalty_constant)
    scatter = MISFIT * np.sqrt(max(residual, 0.0) / (3 * part.pairs.count))
    root = np.linalg.cholesky(quadratic)
    noise = np.random.default_rng(seed).standard_normal((MEMBERS, len(linear)))
    return in_threads(lambda z: estimator.minimize(quadratic, linear + scatter * root @ z).coefficients, list(noise))
