"""What has a name in a folder and is no file: devices that never end, pipes that nobody may ever write or read."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from stablepush.core import InputError, real_path


def require_file(path: str | Path) -> None:
    """Refuse a pipe, a socket or a device where a file of a folder, or one that a file names, is read: it might never end."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise InputError("", "cannot read: expected a file", file=path)


def refuse_endless(path: str | Path, what: str = "read") -> None:
    """Refuse to ``read`` a device, which never ends, and to ``read`` or ``write`` a pipe with a name.

    Such a pipe waits for ever where nobody uses its other end. The pipes of a shell, ``<(command)``, have no name and are taken.
    Raises OSError where there is nothing.
    """
    mode = os.stat(path).st_mode
    if what == "read" and (stat.S_ISCHR(mode) or stat.S_ISBLK(mode)):
        raise InputError("", "cannot read: expected a file, not a device", file=path)
    if stat.S_ISFIFO(mode) and real_path(path).exists():
        raise InputError("", f"cannot {what}: expected a file, not a pipe with a name", file=path)
