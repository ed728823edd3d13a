"""Motions in the plane: poses of SE(2), twists, wrenches and centres of rotation (COR).

Functions of arrays, shape (..., 3); no values of their own. Imports ``core``.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
