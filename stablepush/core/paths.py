"""Where paths lead."""

from __future__ import annotations

import os
from pathlib import Path


def real_path(path: str | Path) -> Path:
    """Where a path leads; of links that lead to each other itself, where ``Path.resolve`` fails."""
    return Path(os.path.realpath(path))
