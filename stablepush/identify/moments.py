"""The data of a fit, reduced to moments: two Gram matrices and a vector, whatever the number of pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.models.monomials import gradient_rows, monomials


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Sums over pairs for the paper's objective (its equations 4 to 6).

    ``slip`` (m, m): ``Σ α_i = aᵀ slip a`` with ``α = |∇H - (∇H·V)V|²``; ``level`` (m, m) and ``target`` (m,): ``Σ β_i = aᵀ
    level a - 2 target·a + count`` with ``β = (H - 1)²``. Moments of disjoint sets add.
    """

    slip: FloatArray
    level: FloatArray
    target: FloatArray
    count: int

    @classmethod
    def from_pairs(cls, loads: FloatArray, directions: FloatArray, degree: int) -> Moments:
        """Reduce normalised loads (n, 3) and unit normalised twists (n, 3)."""
        gradient = gradient_rows(loads, degree)
        along = np.einsum("ni,nim->nm", directions, gradient)
        across = (gradient - directions[:, :, None] * along[:, None, :]).reshape(-1, gradient.shape[-1])
        values = monomials(loads, degree)
        return cls(across.T @ across, values.T @ values, values.sum(axis=0), len(loads))

    def __add__(self, other: Moments) -> Moments:
        return Moments(self.slip + other.slip, self.level + other.level, self.target + other.target, self.count + other.count)
