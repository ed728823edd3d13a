"""Limit surfaces: the loads during slip, and the twists that belong to them."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from stablepush._arrays import FloatArray
from stablepush.models.gp import GaussianProcessSurface, KernelSum
from stablepush.models.ideal import IdealLimitSurface
from stablepush.models.monomials import monomial_exponents
from stablepush.models.polynomial import PolynomialLimitSurface


@runtime_checkable
class LimitSurface(Protocol):
    """What every limit surface offers; all methods take and return arrays (..., 3) in B."""

    @property
    def characteristic_length(self) -> float:
        """``rho`` in m."""

    @property
    def force_unit(self) -> str:
        """``"N"`` or ``"mu*N"``."""

    def value(self, wrenches: ArrayLike) -> FloatArray:
        """``H(F)``: 1 on the surface."""

    def twist(self, wrenches: ArrayLike) -> FloatArray:
        """Slip twists of wrenches, of unit length in ``(vx, vy, rho*omega)``."""

    def wrench(self, twists: ArrayLike) -> FloatArray:
        """``H_inv``: loads on the surface for twists."""


def ensemble_of(surface: LimitSurface) -> list[PolynomialLimitSurface]:
    """Return the surfaces that the data of a fit leave likely; none for a surface without an ensemble."""
    return surface.members() if isinstance(surface, PolynomialLimitSurface) else []


__all__ = [
    "GaussianProcessSurface",
    "IdealLimitSurface",
    "KernelSum",
    "LimitSurface",
    "PolynomialLimitSurface",
    "ensemble_of",
    "monomial_exponents",
]
