"""Pictures of regions, contacts and plans. Figures are returned, or written as PNG; nothing is shown on a screen."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
