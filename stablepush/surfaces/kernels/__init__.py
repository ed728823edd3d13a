"""Compiled inner loops of surfaces: ``H_inv`` and the sums of friction over support points, the only home of each."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
