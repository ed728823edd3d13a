"""Compiled loops of regions: charts of the sphere of unit twists, lower convex envelopes."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
