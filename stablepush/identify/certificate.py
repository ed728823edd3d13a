"""Proof, checked without a solver, that a polynomial is SOS-convex."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.identify.sos import gram_equations, project_gram


@dataclass(frozen=True, slots=True, eq=False)
class Certificate:
    """``zᵀ∇²H z = yᵀQy`` with ``Q`` positive definite.

    ``min_eigenvalue`` is the smallest eigenvalue of ``Q``, ``residual`` the largest error of the monomial equations (both in the
    units of the coefficients), ``rounding`` a bound on what the two can do to the smallest eigenvalue. The polynomial is
    certified when the eigenvalue exceeds that bound.
    """

    gram: FloatArray
    min_eigenvalue: float
    residual: float
    rounding: float

    @property
    def sos_convex(self) -> bool:
        """True if the certificate proves SOS-convexity."""
        return self.min_eigenvalue > self.rounding

    def in_units(self, factor: float) -> Certificate:
        """Return the certificate of the coefficients times ``factor`` (> 0)."""
        return Certificate(self.gram * factor, self.min_eigenvalue * factor, self.residual * factor, self.rounding * factor)

    def to_json(self) -> dict[str, Any]:
        """Return the ``certificate`` entry of ``model/1``."""
        return {
            "sos_convex": self.sos_convex,
            "min_eigenvalue": self.min_eigenvalue,
            "residual": self.residual,
            "gram": self.gram.tolist(),
        }


def certify(coefficients: FloatArray, gram: FloatArray, degree: int) -> Certificate:
    """Check that ``gram`` (n, n) proves the polynomial SOS-convex, after moving it onto the monomial equations.

    The move is a least-norm correction, so what a solver left over in the equations is taken off the eigenvalue, not
    hidden: a matrix whose correction is larger than its smallest eigenvalue fails.
    """
    exact = project_gram(gram, coefficients, degree)
    equations, targets = gram_equations(degree)
    residual = float(np.abs(np.tensordot(equations, exact, 2) - targets @ coefficients).max())
    eigenvalues = np.linalg.eigvalsh(exact)
    # a residual r in one equation moves Q by at most r in Frobenius norm, all of them by r sqrt(k); eigvalsh is backward stable
    rounding = residual * np.sqrt(len(equations)) + 1e-14 * float(np.abs(eigenvalues).max()) * len(exact)
    return Certificate(exact, float(eigenvalues[0]), residual, float(rounding))
