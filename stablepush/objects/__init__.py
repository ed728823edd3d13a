"""What is pushed and what pushes: slider, its support, contacts and their composite wrench cone.

Immutable values that check themselves. Imports ``core`` and ``geometry``.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
