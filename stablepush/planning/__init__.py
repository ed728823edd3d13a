"""From a scene to a plan: the problem, its plan, the registry of planners, the check.

Planners are found by their entry points; the check shares nothing with them. Imports ``io`` and below.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
