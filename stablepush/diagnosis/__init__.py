"""Where simulation and reality differ, which effect explains it, and gap reduction.

Reads a log and returns a :class:`GapReport`; no pictures here. Imports ``rig`` and below, never a label.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
