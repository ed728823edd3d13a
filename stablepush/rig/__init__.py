"""A simulated laboratory: pushes that are carried out under effects and noise, and logged.

Commands, plans as commands, execution in open and closed loop. Imports ``planning`` and below.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
