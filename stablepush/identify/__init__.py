"""Identification of limit surfaces from pairs of loads and slip twists."""

from stablepush.identify.certificate import Certificate, certify
from stablepush.identify.cross_validation import CrossValidation, cross_validate
from stablepush.identify.fit import LOSSES, MODELS, POLYNOMIALS, WITH_PRIOR, Fit, fit_limit_surface
from stablepush.identify.next_poke import Poke, poke_candidates, poke_outcome, rank_pokes
from stablepush.identify.online import OnlineEstimate, OnlineIdentifier
from stablepush.identify.pressure_grid import GridPressure, ellipsoid_from_pressure, fit_pressure_grid

__all__ = [
    "LOSSES",
    "MODELS",
    "POLYNOMIALS",
    "WITH_PRIOR",
    "Certificate",
    "CrossValidation",
    "Fit",
    "GridPressure",
    "OnlineEstimate",
    "OnlineIdentifier",
    "Poke",
    "certify",
    "cross_validate",
    "ellipsoid_from_pressure",
    "fit_limit_surface",
    "fit_pressure_grid",
    "poke_candidates",
    "poke_outcome",
    "rank_pokes",
]
