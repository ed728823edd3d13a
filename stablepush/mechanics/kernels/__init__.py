"""Compiled loops of pushing: friction on the table, contact laws, one and two contacts, the rollout of a push."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
