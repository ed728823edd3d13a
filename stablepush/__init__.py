"""Plan stable pushes of flat objects: limit surfaces from a few pokes, stable rotation centres, push paths."""

import warnings
from typing import Any

import lazy_loader as lazy

__version__ = "0.1.0"

# __init__.pyi has the public names, each once. They are loaded on first use: the program answers --help before it imports numpy.
_load, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
#: Names that changed, and what they are now. The old ones work for one more version.
_RENAMED = {"Poke": "EdgePush"}


def __getattr__(name: str) -> Any:
    if name in _RENAMED:
        warnings.warn(f"stablepush.{name} is now stablepush.{_RENAMED[name]}", DeprecationWarning, stacklevel=2)
    return _load(_RENAMED.get(name, name))
