"""Estimators of the coefficients: the paper's squared loss with what may stand in for data, and its authors' norm loss.

An estimator turns pairs into a part (their moments, and what prior knowledge says given these pairs) and solves for the
coefficients under candidate weights, between which validation chooses.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any, Protocol

import numpy as np

from stablepush.core import FloatArray, read_only
from stablepush.geometry import angle_between, unit
from stablepush.identify.moments import Moments
from stablepush.identify.pairs import Pairs
from stablepush.identify.pressure import PressureEnsemble, PressureSampler
from stablepush.identify.program import Estimate, norm_program, squared_program, sum_of_norms_program
from stablepush.surfaces import bombieri_norms, gradient_rows, monomials, substitution

#: Candidate weights of slip and level residuals against the distance from the ellipsoid, for loads of median length one: from
#: an ellipsoid that outweighs the pairs to one that only settles what they leave open, as noise-free pairs want it.
ETA_1 = (0.1, 1.0, 10.0, 100.0, 1000.0)
ETA_2 = (0.1, 1.0, 10.0, 100.0, 1000.0)
MIDDLE = 10.0

#: With a slider: weight (in pairs) of the pseudo pairs of its likely pressures, the candidate weights of a measured pair beside
#: it, and the weight of either against the distance from the ellipsoid. Measured pairs have shaped the pressures already, so
#: zero is a candidate.
PRIOR_PAIRS, PAIR_WEIGHTS, PRIOR_SCALE = 10.0, (0.0, 0.1, 0.3, 1.0, 3.0), 1e4
#: Twists at which the likely pressures are asked for their loads.
PSEUDO_PAIRS = 400

#: Weights of level residuals and of |a| in the authors' code, for loads in N; slip residuals have weight one.
W_FORCE = (0.1, 0.5, 1.0, 2.0, 4.0, 8.0)
W_REG = (0.1, 2.0, 8.0, 16.0)

#: Degrees of freedom of the Student distribution that robust weights assume, and the least scatter (rad) that they do.
ROBUST_FREEDOM, LEAST_SCATTER = 4.0, np.radians(2.0)


class Estimator(Protocol):
    """Pairs to parts, parts to coefficients."""

    @property
    def candidates(self) -> Sequence[Any]:
        """Weights to choose from."""

    @property
    def with_prior(self) -> int:
        """The first so many candidates use the slider."""

    @property
    def default(self) -> int:
        """Index of the candidate to use where there are too few pairs to choose."""

    @property
    def solves_side_by_side(self) -> bool:
        """Whether several threads may solve at once."""

    def of_folds(self) -> Estimator:
        """Return an estimator for the folds, which only choose the weights."""

    def prepare(self, pairs: Pairs) -> Any:
        """Reduce pairs to what solving needs."""

    def solve(self, part: Any, weights: Any) -> Estimate:
        """Return the coefficients."""


@dataclass(frozen=True, slots=True)
class SquaredWeights:
    """Weights of slip and level residuals of measured pairs, and of the prior in pairs (0: none)."""

    eta1: float
    eta2: float
    prior: float = 0.0


@dataclass(frozen=True, slots=True)
class NormWeights:
    """Weights of level residuals and of |a| under the norm loss."""

    w_force: float
    w_reg: float
    prior: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Some of the pairs, reduced: their moments, the shrinkage, and pseudo pairs from the pressures that they leave likely.

    ``stiffness`` (m, m), ``linear_term`` (m,): the penalty ``|a - a0|²`` is
    ``aᵀ stiffness a - 2 linear_term·a + penalty_constant``.
    ``pair_weights`` (n,): robust weights of the pairs. ``rows``: the pairs themselves, for a loss that moments do not determine.
    """

    pairs: Moments
    stiffness: FloatArray
    linear_term: FloatArray
    penalty_constant: float
    pair_weights: FloatArray
    pseudo: Moments | None = None
    pressures: PressureEnsemble | None = None
    rows: Pairs | None = None

    def with_pseudo(self, pseudo: Moments) -> Part:
        """Return the part with other pseudo pairs."""
        return replace(self, pseudo=pseudo)


class SquaredLoss:
    """``minimise |a - a0|² + Σ_i (eta1 α_i + eta2 β_i)``: the paper's loss, with a choice of what coefficients shrink to.

    ``shrink="zero"``: ``a0 = 0`` and the Euclidean norm, as published. ``shrink="ellipsoid"``: ``a0`` is the power of an
    ellipsoid that is fitted to the same pairs, and the norm is Bombieri's in coordinates in which that ellipsoid is the unit
    sphere, so that the penalty does not depend on the axes of B or on ``rho``. A quadratic shrinks to the unit sphere.
    """

    #: The solver of its program is handed its own copy of the problem, and releases the interpreter.
    solves_side_by_side = True

    def __init__(self, degree: int, convex: bool, sampler: PressureSampler | None, robust: bool, shrink: str) -> None:
        plain = [SquaredWeights(a, b) for a, b in product(ETA_1, ETA_2)]
        prior = [SquaredWeights(PRIOR_SCALE * w, PRIOR_SCALE * w, PRIOR_PAIRS) for w in PAIR_WEIGHTS]
        self.candidates: Sequence[SquaredWeights] = [*prior, *plain] if sampler is not None else plain
        self.with_prior = len(prior) if sampler is not None else 0
        self.default = 0 if sampler is not None else plain.index(SquaredWeights(MIDDLE, MIDDLE))
        self.degree = degree
        self._convex, self._sampler, self._robust, self._shrink = convex, sampler, robust, shrink

    def of_folds(self) -> SquaredLoss:
        """Return an estimator with half as many draws of the pressure.

        On 123 simulated rigs the surfaces were as good: 5.40 and 5.43 degrees off after 10 pokes, 4.74 and 4.74 after 20, 4.40
        and 4.41 after 40, with all and with half of the draws in the folds.
        """
        result = copy.copy(self)
        result._sampler = None if self._sampler is None else self._sampler.of_folds()
        return result

    def prepare(self, pairs: Pairs) -> Part:
        """Reduce pairs; draws pressures, fits the ellipsoid and finds robust weights where those are used."""
        stiffness, linear_term, constant = self._penalty(pairs)
        moments = Moments.from_pairs(pairs.loads, pairs.directions, self.degree)
        weights = np.ones(len(pairs))
        if self._robust and len(pairs):
            for _ in range(2):
                part = Part(moments, stiffness, linear_term, constant, weights)
                fitted = self.solve(part, SquaredWeights(MIDDLE, MIDDLE)).coefficients
                weights = robust_weights(fitted, pairs, self.degree)
                moments = Moments.from_pairs(pairs.loads, pairs.directions, self.degree, weights)
        pressures = pseudo = None
        if self._sampler is not None:
            pressures = self._sampler.posterior(pairs.loads, pairs.directions, pairs.rho)
            # the ideal surface is linear in the pressure: the mean of the loads is that of the mean pressure
            pseudo = Moments.from_pairs(pressures.wrenches(pseudo_twists(), pairs.rho).mean(axis=0), pseudo_twists(), self.degree)
        return Part(moments, stiffness, linear_term, constant, weights, pseudo, pressures)

    def solve(self, part: Part, weights: SquaredWeights) -> Estimate:
        """Return the coefficients under ``weights``."""
        quadratic, linear = self.normal_equations(part, weights)
        return self.minimize(quadratic, linear)

    def normal_equations(self, part: Part, weights: SquaredWeights) -> tuple[FloatArray, FloatArray]:
        """Return ``P`` (m, m) and ``q`` (m,) of the objective ``aᵀ P a - 2 q·a``."""
        quadratic = part.stiffness + weights.eta1 * part.pairs.slip + weights.eta2 * part.pairs.level
        linear = part.linear_term + weights.eta2 * part.pairs.target
        if weights.prior and part.pseudo is not None:
            share = PRIOR_SCALE * weights.prior / part.pseudo.count
            quadratic = quadratic + share * (part.pseudo.slip + part.pseudo.level)
            linear = linear + share * part.pseudo.target
        return quadratic, linear

    def minimize(self, quadratic: FloatArray, linear: FloatArray) -> Estimate:
        """Minimise ``aᵀ P a - 2 q·a``, over SOS-convex polynomials if the model is convex."""
        if self._convex:
            return squared_program(self.degree).solve(quadratic, linear)
        started = time.perf_counter()
        coefficients = np.asarray(np.linalg.solve(quadratic, linear), dtype=np.float64)
        return Estimate(coefficients, None, "solved", time.perf_counter() - started)

    def _penalty(self, pairs: Pairs) -> tuple[FloatArray, FloatArray, float]:
        count = len(bombieri_norms(self.degree))
        if self._shrink == "zero":
            return np.eye(count), np.zeros(count), 0.0
        stiffness, linear_term, constant = sphere_penalty(self.degree)
        if self.degree == 2:
            return stiffness, linear_term, constant
        # the coefficients in coordinates in which the ellipsoid is the unit sphere are T a
        whitened = substitution(_ellipsoid_axes(pairs), self.degree)
        return whitened.T @ stiffness @ whitened, whitened.T @ linear_term, constant


class NormLoss:
    """The loss of the authors' code, for loads in N.

    ``minimise w_reg |a| + w_force |ξ| + |δ|`` for SOS-convex polynomials of degree 4 and more (:class:`NormProgram`), and
    ``w_reg |a| + w_force Σ |ξ_i| + Σ |δ_i|`` for the quadratic and what need not be convex (:class:`SumOfNormsProgram`).
    """

    #: One program, whose parameters are set for each solve.
    solves_side_by_side = False

    def __init__(self, degree: int, convex: bool, force_scale: float) -> None:
        self.candidates: Sequence[NormWeights] = [NormWeights(a, b) for a, b in product(W_FORCE, W_REG)]
        self.with_prior = 0
        self.default = self.candidates.index(NormWeights(1.0, 2.0))
        self._degree, self.convex, self._force_scale = degree, convex, force_scale

    def of_folds(self) -> NormLoss:
        """Return itself: nothing is drawn."""
        return self

    def prepare(self, pairs: Pairs) -> Part:
        """Reduce pairs to moments; they are kept too, for sums of norms."""
        moments = Moments.from_pairs(pairs.loads, pairs.directions, self._degree)
        m = len(moments.target)
        return Part(moments, np.zeros((m, m)), np.zeros(m), 0.0, np.ones(len(pairs)), rows=pairs)

    def solve(self, part: Part, weights: NormWeights, floor: float = 0.0) -> Estimate:
        """Return the coefficients under ``weights``, of convex ones with a lower bound on the eigenvalues of their ``Q``."""
        # H of loads in N has coefficients a / scale^d, and gradients smaller by the scale
        scale = self._force_scale
        w_reg = weights.w_reg / scale**self._degree
        if self.convex and self._degree > 2:
            return norm_program(self._degree).solve(part.pairs, w_reg, weights.w_force, 1 / scale, floor)
        assert part.rows is not None, "prepare() keeps the pairs"
        program = sum_of_norms_program(self._degree, self.convex, len(part.rows))
        return program.solve(part.rows.loads, part.rows.directions, w_reg, weights.w_force, 1 / scale, floor)


def robust_weights(coefficients: FloatArray, pairs: Pairs, degree: int) -> FloatArray:
    """Weights (n,) of pairs under a Student error of slip direction and level, with the scatter taken from their medians.

    ``w = (f + 3)/(f + r²/s² + e²/t²)`` with ``f`` degrees of freedom, ``r`` the angle between predicted and measured twist
    and ``e`` the relative error of the load's size (iteratively reweighted least squares, Lange et al. 1989).
    """
    angle = angle_between(gradient_rows(pairs.loads, degree) @ coefficients, pairs.directions)
    level = np.maximum(monomials(pairs.loads, degree) @ coefficients, 1e-6) ** (1 / degree) - 1
    # medians of a Rayleigh and of a half-normal variate of unit scale: 1.177 and 0.674
    angle_scale = max(float(np.median(angle)) / 1.177, LEAST_SCATTER)
    level_scale = max(float(np.median(np.abs(level))) / 0.674, LEAST_SCATTER)
    miss = (angle / angle_scale) ** 2 + (level / level_scale) ** 2
    return np.asarray((ROBUST_FREEDOM + 3) / (ROBUST_FREEDOM + miss))


def _ellipsoid_axes(pairs: Pairs) -> FloatArray:
    """Matrix (3, 3) that takes the unit sphere to the ellipsoid fitted to the pairs: ``A^(-1/2)`` for ``FᵀAF = 1``."""
    quadratic = SquaredLoss(2, True, None, False, "ellipsoid")
    xx, xy, xz, yy, yz, zz = quadratic.solve(quadratic.prepare(pairs), SquaredWeights(MIDDLE, MIDDLE)).coefficients
    values, vectors = np.linalg.eigh(np.array(((xx, xy / 2, xz / 2), (xy / 2, yy, yz / 2), (xz / 2, yz / 2, zz))))
    return np.asarray(vectors / np.sqrt(values) @ vectors.T)


def sphere_penalty(degree: int) -> tuple[FloatArray, FloatArray, float]:
    """Return ``S, p, c``: Bombieri's distance of ``a`` from ``|F|^d`` is ``aᵀSa - 2p·a + c``, squared."""
    norms, sphere = bombieri_norms(degree), sphere_power(degree)
    return np.diag(norms), norms * sphere, float(norms @ sphere**2)


@cache
def sphere_power(degree: int) -> FloatArray:
    """Coefficients of ``|F|^d``."""
    # |F|^d has the value one wherever |F| = 1: enough points of the sphere settle it
    points = unit(np.random.default_rng(0).normal(size=(200, 3)))
    return read_only(np.asarray(np.linalg.lstsq(monomials(points, degree), np.ones(len(points)))[0], dtype=np.float64))


@cache
def pseudo_twists() -> FloatArray:
    """Unit normalised twists (n, 3) at which pressures are asked for their loads."""
    return read_only(unit(np.random.default_rng(0).normal(size=(PSEUDO_PAIRS, 3))))
