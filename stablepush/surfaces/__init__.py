"""Limit surfaces: the loads of a sliding object, ``H(F) = 1``, and the twists that belong to them.

One file a surface, each with the methods of :class:`LimitSurface`; no fits. Imports ``objects`` and below.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
