"""Plan stable pushes of flat objects: limit surfaces from a few pokes, stable rotation centres, push paths."""

import lazy_loader as lazy

__version__ = "0.1.0"

# __init__.pyi has the public names, each once. They are loaded on first use: the program answers --help before it imports numpy.
__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
