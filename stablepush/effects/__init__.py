"""The catalogue of effects that a simulation may lack: parameters, units, ranges.

What an effect is, not what it does; ``rig`` applies it, ``diagnosis`` looks for it. A lab adds its own. Imports ``core``.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
