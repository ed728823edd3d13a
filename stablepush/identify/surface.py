"""Coefficients of scaled loads to surfaces in newtons."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stablepush.core import LARGEST_MAGNITUDE, FloatArray, StablepushWarning
from stablepush.identify.certificate import Certificate
from stablepush.surfaces import PolynomialLimitSurface

#: Unit of forces over the friction force.
FORCE_UNIT = "mu*N"


def surface_from_scaled(
    coefficients: FloatArray,
    degree: int,
    rho: float,
    force_scale: float | None,
    *,
    certificate: Certificate | None = None,
    ensemble: Sequence[FloatArray] = (),
    provenance: Mapping[str, Any],
) -> PolynomialLimitSurface:
    """Return the surface whose coefficients are given for loads in units of ``force_scale`` (N).

    Without a scale, or where coefficients for newtons would be larger than a file may hold, the surface keeps the unit that
    it has and says so (``"mu*N"``); the latter gives a :class:`StablepushWarning`. A covariance that is larger, as its entries
    grow with their square, is left out: the ensemble carries the same information.
    """
    factor, force_unit = (1.0, FORCE_UNIT) if force_scale is None else (force_scale ** (-degree), "N")
    largest = factor * max(np.abs(a).max() for a in (coefficients, *ensemble))
    if force_scale is not None and largest > LARGEST_MAGNITUDE:
        words = (
            f"loads of {force_scale:.2g} N are too small for coefficients of degree {degree} in N: the surface is in units of "
            f"the friction force ({FORCE_UNIT}), H = 1 at loads that are divided by {force_scale:.4g} N"
        )
        warnings.warn(StablepushWarning(words), stacklevel=3)
        factor, force_unit = 1.0, FORCE_UNIT
    members = factor * np.array(ensemble) if len(ensemble) else None
    covariance = None if members is None else np.cov(members, rowvar=False)
    if covariance is not None and np.abs(covariance).max() > LARGEST_MAGNITUDE:
        covariance = None
    return PolynomialLimitSurface(
        factor * coefficients,
        degree,
        rho,
        force_unit=force_unit,
        certificate=None if certificate is None else certificate.in_units(factor).to_json(),
        covariance=covariance,
        ensemble=members,
        provenance={**provenance, "force_scale_N": force_scale},
    )
