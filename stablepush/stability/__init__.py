"""Which pushes are stable: the oracle of one twist, the exact regions of all twists.

Lynch and Mason's region, all pressures, probabilities, where to push. Imports ``surfaces`` and below.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
