"""Shared by all subpackages: errors, checked arrays, compiled functions, time limits, work side by side.

Nothing here knows of pushing. It imports no other subpackage.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
