"""Identification poke by poke, for surfaces that change as the object moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import (
    LARGEST_MAGNITUDE,
    FloatArray,
    InputError,
    SolverError,
    check_choice,
    check_number,
    check_vectors,
)
from stablepush.geometry import angle_between, normalize_twist, normalize_wrench, unit
from stablepush.identify.certificate import Certificate, certify
from stablepush.identify.estimator import MIDDLE, sphere_penalty, sphere_power
from stablepush.identify.moments import Moments
from stablepush.identify.pairs import LEAST_FORCE
from stablepush.identify.program import squared_program
from stablepush.identify.surface import surface_from_scaled
from stablepush.surfaces import PolynomialLimitSurface, gradient_rows

METHODS = ("moments", "projected-gradient")
#: Pokes whose median size starts the scale.
FIRST_POKES = 5
#: Size over the scale beyond which a load loses weight.
LARGEST_SIZE = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class OnlineEstimate:
    """The surface after a poke, with its proof of convexity.

    ``certificate`` is for loads of mean size one; ``innovation`` (rad) is the angle between the twist of this poke and the one
    that the surface before it predicted; ``effective_sample_size`` the number of pokes that count, older ones in part (of no use
    to the projected gradient).
    """

    surface: PolynomialLimitSurface
    certificate: Certificate
    innovation: float
    effective_sample_size: float


class OnlineIdentifier:
    """Follows an SOS-convex limit surface through a stream of pokes.

    ``"moments"``: every update solves ``minimise |a - a0|² + Σ_i λ^(n-i) (eta1 α_i + eta2 β_i)`` exactly: the sums are two
    Gram matrices and a vector that fade by the forgetting factor ``λ``, so that an update costs the same after a million
    pokes. ``a0`` is the unit sphere, in Bombieri's norm. ``"projected-gradient"``: one step along the gradient of the newest
    poke's loss, then the nearest SOS-convex polynomial (the direction that Zhou et al. 2016, section III-C, point to); its step
    size sets how fast older pokes are forgotten.

    Parameters
    ----------
    characteristic_length : float
        ``rho`` in m.
    forgetting_factor : float
        ``λ`` in (0, 1]: each new poke multiplies the weight of the older ones by ``λ``; the effective sample size tends to
        ``1/(1 - λ)`` pokes. 1 keeps all pokes.
    degree : int
        Even degree, 2 or more.
    eta1, eta2 : float
        Weights of slip and level residuals, for loads of mean size one.
    method : {"moments", "projected-gradient"}
    step : float
        Of the projected gradient, as a share of the one that would minimise the newest poke's loss along its steepest axis.
    """

    def __init__(
        self,
        characteristic_length: float,
        *,
        forgetting_factor: float = 0.95,
        degree: int = 4,
        eta1: float = MIDDLE,
        eta2: float = MIDDLE,
        method: str = "moments",
        step: float = 0.3,
    ) -> None:
        check_choice(method, "method", METHODS)
        if not isinstance(degree, int) or degree not in (2, 4, 6):
            raise InputError("degree", "expected 2, 4 or 6", repr(degree))
        self._rho = check_number(characteristic_length, "characteristic_length", positive=True)
        self._forgetting_factor = check_number(forgetting_factor, "forgetting_factor", positive=True, largest=1.0)
        self._eta1, self._eta2 = check_number(eta1, "eta1", positive=True), check_number(eta2, "eta2", positive=True)
        self._step = check_number(step, "step", positive=True, largest=1.0)
        self._degree, self._method = degree, method
        self._log_scale, self._effective_sample_size = 0.0, 0.0
        self._first: list[tuple[FloatArray, FloatArray]] = []
        self._moments = Moments.none(degree)
        self._coefficients = sphere_power(degree)

    def update(self, wrench: ArrayLike, twist: ArrayLike) -> OnlineEstimate:
        """Take in a poke's load (3,) ``(fx, fy, tau)`` and slip twist (3,) in B, and return the surface with it."""
        f, v = check_vectors(wrench, "wrench", 3), check_vectors(twist, "twist", 3)
        if f.shape != (3,) or v.shape != (3,) or not f.any() or not v.any():
            raise InputError("wrench, twist", "expected one load and one twist that are not zero, each of shape (3,)")
        load, direction = normalize_wrench(f, self._rho), unit(normalize_twist(v, self._rho))
        largest = float(np.abs(load).max())
        if not LEAST_FORCE <= largest <= LARGEST_MAGNITUDE:
            raise InputError("wrench", f"expected a load of {LEAST_FORCE:g} to {LARGEST_MAGNITUDE:g} N", f"{largest:g} N")
        size = float(np.linalg.norm(load))
        slip = gradient_rows(load / size, self._degree) @ self._coefficients
        innovation = float(angle_between(slip, direction))
        effective_sample_size = 1 + self._forgetting_factor * self._effective_sample_size
        first = self._first
        if len(first) < FIRST_POKES:
            # the penalty and the weights are meant for loads of size one; a median of a few is not ruled by one bad poke
            first = [*first, (load, direction)]
            log_scale = float(np.median([np.log(np.linalg.norm(f)) for f, _ in first]))
            newest = self._reduced(load, direction, log_scale)
            moments = Moments.none(self._degree)
            for f, v in first:
                moments = moments * self._forgetting_factor + self._reduced(f, v, log_scale)
        else:
            # from then on the scale follows as a geometric mean that fades like the rest
            log_scale = self._log_scale + (np.log(size) - self._log_scale) / effective_sample_size
            newest = self._reduced(load, direction, log_scale)
            faded = self._moments * self._forgetting_factor
            moments = faded.rescaled(float(np.exp(self._log_scale - log_scale)), self._degree) + newest
        scale = float(np.exp(log_scale))
        if self._method == "moments":
            stiffness, linear_term, _ = sphere_penalty(self._degree)
            quadratic = stiffness + self._eta1 * moments.slip + self._eta2 * moments.level
            solution = squared_program(self._degree).solve(quadratic, linear_term + self._eta2 * moments.target)
        else:
            # loss aᵀPa - 2q·a of the newest poke, whose gradient is 2(Pa - q): steps of 1/λ_max(P) along Pa - q reach its minimum
            before = (
                self._coefficients * np.exp(self._degree * (log_scale - self._log_scale))
                if self._effective_sample_size
                else self._coefficients
            )
            quadratic = newest.slip + newest.level
            downhill = newest.target - quadratic @ before
            moved = before + self._step * downhill / float(np.linalg.eigvalsh(quadratic)[-1])
            solution = squared_program(self._degree).solve(np.eye(len(moved)), moved)
        if solution.gram is None:
            raise SolverError("online fit: the solver gave no proof of convexity")
        certificate = certify(solution.coefficients, solution.gram, self._degree)
        # nothing of this object has changed so far: a poke that could not be used leaves it as it was
        self._moments, self._coefficients = moments, solution.coefficients
        self._log_scale, self._effective_sample_size, self._first = log_scale, effective_sample_size, first
        surface = surface_from_scaled(
            solution.coefficients,
            self._degree,
            self._rho,
            scale,
            certificate=certificate,
            provenance={"model": f"poly{self._degree}-cvx", "method": self._method, "forgetting": self._forgetting_factor},
        )
        return OnlineEstimate(surface, certificate, innovation, effective_sample_size)

    def _reduced(self, load: FloatArray, direction: FloatArray, log_scale: float) -> Moments:
        """Moments of one poke. Residuals grow like the d-th power of a load: one that is too large counts for less, so that
        its pull is bounded; too small ones have bounded residuals as it is."""
        scaled = load / np.exp(log_scale)
        excess = max(1.0, float(np.linalg.norm(scaled)) / LARGEST_SIZE)
        return Moments.from_pairs(scaled[None], direction[None], self._degree, np.array([excess ** (-2 * self._degree)]))
