"""Identification: from pairs of loads and slip twists to a limit surface, its certificate and its ensemble.

Programs, estimators, the slider as prior knowledge, the next poke. Imports ``surfaces`` and below.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
