"""The blind check: logs whose cause is sealed before the diagnosis sees them, and the score of its answers.

``worlds``, ``laws``, ``engine``, ``instruments`` and ``generator`` make the logs in a process of their own and share no code
with the rest of the library; ``seal`` keeps the labels, ``score`` opens them, ``check`` runs all of it.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
