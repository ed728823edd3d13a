"""Readers of laboratories' own formats, one file each; all of them give a :class:`stablepush.PushLog`."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
