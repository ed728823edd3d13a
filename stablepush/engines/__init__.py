"""Executors in MuJoCo and in Drake: a slider on feet, and fingers that follow given poses.

They import nothing of the library, so that what they show of plans and trajectories owes nothing to what made these.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
