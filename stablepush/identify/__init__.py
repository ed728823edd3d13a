"""Identification of limit surfaces from pairs of loads and slip twists."""

from stablepush.identify.certificate import Certificate, certify
from stablepush.identify.fit import MODELS, Fit, fit_limit_surface

__all__ = ["MODELS", "Certificate", "Fit", "certify", "fit_limit_surface"]
