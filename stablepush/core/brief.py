"""A ``repr`` of one screen for values that hold long arrays."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

#: Numbers of an array, and characters of another value, that are shown.
_NUMBERS, _CHARACTERS = 12, 200


def brief(value: Any) -> str:
    """Return the class and the fields of a dataclass or a named tuple: long arrays by their shape, other long values by class."""
    names = [field.name for field in fields(value) if field.repr] if is_dataclass(value) else list(type(value)._fields)
    return f"{type(value).__name__}({', '.join(f'{name}={_shown(getattr(value, name))}' for name in names)})"


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return repr(value.tolist()) if value.size <= _NUMBERS else f"<{' x '.join(map(str, value.shape))} {value.dtype}>"
    words = repr(value)
    if len(words) <= _CHARACTERS:
        return words
    return f"<{len(value)} {type(value[0]).__name__}>" if isinstance(value, (list, tuple)) else f"<{type(value).__name__}>"
