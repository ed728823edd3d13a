"""The data of a fit, reduced to moments: two Gram matrices and a vector, whatever the number of pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stablepush.core import FloatArray
from stablepush.surfaces import gradient_rows, monomials


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Sums over pairs for the paper's objective (its equations 4 to 6).

    ``slip`` (m, m): ``Σ α_i = aᵀ slip a`` with ``α = |∇H - (∇H·V)V|²``; ``level`` (m, m) and ``target`` (m,): ``Σ β_i = aᵀ
    level a - 2 target·a + count`` with ``β = (H - 1)²``. Moments of disjoint sets add, and fade by a factor.
    """

    slip: FloatArray
    level: FloatArray
    target: FloatArray
    count: float

    @classmethod
    def from_pairs(cls, loads: FloatArray, directions: FloatArray, degree: int, weights: FloatArray | None = None) -> Moments:
        """Reduce normalised loads (n, 3) and unit normalised twists (n, 3), each pair counted ``weights`` (n,) times."""
        root = np.ones(len(loads)) if weights is None else np.sqrt(weights)
        values = monomials(loads, degree) * root[:, None]
        across = (gradient_across(loads, directions, degree) * root[:, None, None]).reshape(-1, values.shape[-1])
        return cls(across.T @ across, values.T @ values, root @ values, float(root @ root))

    @classmethod
    def none(cls, degree: int) -> Moments:
        """Return the moments of no pair."""
        m = (degree + 1) * (degree + 2) // 2
        return cls(np.zeros((m, m)), np.zeros((m, m)), np.zeros(m), 0.0)

    def rescaled(self, factor: float, degree: int) -> Moments:
        """Return the moments of the same pairs with their loads times ``factor``."""
        once = factor**degree
        return Moments(self.slip * factor ** (2 * degree - 2), self.level * once**2, self.target * once, self.count)

    def __add__(self, other: Moments) -> Moments:
        return Moments(self.slip + other.slip, self.level + other.level, self.target + other.target, self.count + other.count)

    def __mul__(self, factor: float) -> Moments:
        return Moments(self.slip * factor, self.level * factor, self.target * factor, self.count * factor)


def gradient_across(loads: FloatArray, directions: FloatArray, degree: int) -> FloatArray:
    """Return rows (n, 3, m) that take coefficients to the part of ``∇H(F_i)`` across the measured twist ``V_i``."""
    gradient = gradient_rows(loads, degree)
    along = np.einsum("ni,nim->nm", directions, gradient)
    return np.asarray(gradient - directions[:, :, None] * along[:, None, :])
