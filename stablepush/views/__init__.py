"""Pages and pictures of what the other subpackages return. Nothing is computed here that a result does not hold.

Imports everything but ``cli``.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
