"""How a slider moves: quasi-static pushing with contact modes, free sliding, eigen-directions.

Physics of one motion, without logs and noise. Imports ``surfaces`` and below.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
