"""Identification poke by poke, for surfaces that change as the object moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stablepush._arrays import FloatArray, check_number, check_vectors
from stablepush.errors import InputError
from stablepush.identify.certificate import Certificate, certify
from stablepush.identify.estimator import MIDDLE, sphere_power
from stablepush.identify.moments import Moments
from stablepush.identify.program import squared_program
from stablepush.models import PolynomialLimitSurface
from stablepush.models.monomials import bombieri_norms
from stablepush.planar import normalize_twist, normalize_wrench, unit

METHODS = ("moments", "projected-gradient")


@dataclass(frozen=True, slots=True, eq=False)
class OnlineEstimate:
    """The surface after a poke, with its proof of convexity.

    ``surprise`` (rad): angle between the twist of this poke and the one that the surface before it predicted; ``memory``:
    pokes that count, older ones in part.
    """

    surface: PolynomialLimitSurface
    certificate: Certificate
    surprise: float
    memory: float


class OnlineIdentifier:
    """Follows an SOS-convex limit surface through a stream of pokes.

    ``"moments"``: every update solves ``minimise |a - a0|² + Σ_i λ^(n-i) (eta1 α_i + eta2 β_i)`` exactly: the sums are two
    Gram matrices and a vector that fade by the forgetting factor ``λ``, so that an update costs the same after a million
    pokes. ``a0`` is the unit sphere, in Bombieri's norm. ``"projected-gradient"``: one step along the gradient of the newest
    poke's loss, then the nearest SOS-convex polynomial (the way that Zhou et al. 2016, section III-C, point to); without
    memory of its own, its step decides what it forgets.

    Parameters
    ----------
    characteristic_length : float
        ``rho`` in m.
    forgetting : float
        ``λ`` in (0, 1]: a poke counts for ``λ`` of what it did before the next one; memory is ``1/(1 - λ)`` pokes. 1 forgets
        nothing.
    degree : int
        Even degree, 2 or more.
    eta1, eta2 : float
        Weights of slip and level residuals, for loads whose first has length one.
    method : {"moments", "projected-gradient"}
    step : float
        Of the projected gradient, as a share of the largest stable one.
    """

    def __init__(
        self,
        characteristic_length: float,
        *,
        forgetting: float = 0.95,
        degree: int = 4,
        eta1: float = MIDDLE,
        eta2: float = MIDDLE,
        method: str = "moments",
        step: float = 0.3,
    ) -> None:
        if method not in METHODS:
            raise InputError(f"method: expected one of {', '.join(METHODS)}, got {method!r}")
        if degree not in (2, 4, 6):
            raise InputError(f"degree: expected 2, 4 or 6, got {degree}")
        self._rho = check_number(characteristic_length, "characteristic_length", above=0.0)
        self._forgetting = check_number(forgetting, "forgetting", above=0.0, largest=1.0)
        self._eta1, self._eta2 = check_number(eta1, "eta1", above=0.0), check_number(eta2, "eta2", above=0.0)
        self._step = check_number(step, "step", above=0.0, largest=1.0)
        self._degree, self._method = degree, method
        self._scale: float | None = None
        self._moments = Moments.none(degree)
        self._coefficients = sphere_power(degree)

    def update(self, wrench: ArrayLike, twist: ArrayLike) -> OnlineEstimate:
        """Take in a poke's load (3,) ``(fx, fy, tau)`` and slip twist (3,) in B, and return the surface with it."""
        f, v = check_vectors(wrench, "wrench", 3), check_vectors(twist, "twist", 3)
        if f.shape != (3,) or v.shape != (3,) or not f.any() or not v.any():
            raise InputError("wrench, twist: expected one load and one twist that are not zero, each of shape (3,)")
        load = normalize_wrench(f, self._rho)
        if self._scale is None:
            # H is homogeneous: any fixed scale serves, and the first poke's keeps loads near one
            self._scale = float(np.linalg.norm(load))
        load, direction = load / self._scale, unit(normalize_twist(v, self._rho))
        predicted = PolynomialLimitSurface(self._coefficients, self._degree, 1.0).twist(load)
        surprise = float(np.arccos(np.clip(unit(predicted) @ direction, -1, 1)))
        newest = Moments.from_pairs(load[None], direction[None], self._degree)
        self._moments = self._moments * self._forgetting + newest
        if self._method == "moments":
            stiffness, pull = self._sphere()
            solution = squared_program(self._degree).solve(
                stiffness + self._eta1 * self._moments.slip + self._eta2 * self._moments.level,
                pull + self._eta2 * self._moments.target,
            )
        else:
            # loss aᵀPa - 2q·a of the newest poke; steps up to 1/λ_max(P) cannot overshoot
            quadratic, linear = newest.slip + newest.level, newest.target
            gradient = quadratic @ self._coefficients - linear
            moved = self._coefficients - self._step * gradient / float(np.linalg.eigvalsh(quadratic)[-1])
            solution = squared_program(self._degree).solve(np.eye(len(moved)), moved)
        self._coefficients = solution.coefficients
        assert solution.gram is not None
        certificate = certify(solution.coefficients, solution.gram, self._degree)
        surface = PolynomialLimitSurface(
            solution.coefficients * self._scale ** (-self._degree),
            self._degree,
            self._rho,
            certificate=certificate.in_units(self._scale ** (-self._degree)).to_json(),
            provenance={"model": f"poly{self._degree}-cvx", "method": self._method, "forgetting": self._forgetting},
        )
        return OnlineEstimate(surface, certificate, surprise, self._moments.count)

    def _sphere(self) -> tuple[FloatArray, FloatArray]:
        norms = bombieri_norms(self._degree)
        return np.diag(norms), norms * sphere_power(self._degree)
