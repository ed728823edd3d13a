"""Files and folders that appear as a whole or not at all, whenever the process that writes them ends."""

from __future__ import annotations

import ctypes
import fnmatch
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from stablepush.core import ASIDE, InputError, clear_scratch, real_path, scratch_folder, scratch_prefix, some_of
from stablepush.io.special_files import refuse_endless


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file as a whole or not at all: into a neighbour first, then renamed over the target."""
    target = Path(path)
    data = content.encode() if isinstance(content, str) else content
    temporary = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            raise InputError("", "cannot write: is a directory", file=target)
        if target.exists() and not target.is_file():  # a pipe or a terminal takes what it gets
            refuse_endless(target, "write")
            target.write_bytes(data)
            return
        clear_scratch(target.parent)
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=scratch_prefix())
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        # mkstemp makes private files; give the mode that open() would have given
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
        temporary = None
    except OSError as error:
        raise InputError("", f"cannot write: {error.strerror or error}", file=target) from None
    finally:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)


@contextmanager
def whole_folder(path: str | Path, *names: str) -> Iterator[Path]:
    """Give a place for files that all appear at ``path`` when the block ends well, and not at all when it does not.

    A folder that is there is exchanged for the new one in one step. ``names``: patterns of the files that belong into it,
    relative to it. One that holds others is refused, for they would be lost. The files of the current folder, of a mount, or of
    a folder whose parent cannot be written are replaced one by one.
    """
    try:
        target = real_path(path)
        if target.exists() and not target.is_dir():
            raise InputError("", "cannot write: exists and is not a folder", file=path)
        target.parent.mkdir(parents=True, exist_ok=True)
        require_own_files(path, *names)
        # somebody may stand in it: a shell
        here = target in (Path.cwd(), *Path.cwd().parents)
        fixed = target.exists() and (here or os.path.ismount(target) or not os.access(target.parent, os.W_OK))
        with scratch_folder(target if fixed else target.parent) as staging:
            new = staging / "new"
            new.mkdir()
            yield new
            if fixed:
                for file in sorted(new.iterdir()):
                    _take_place(file, target / file.name)
            else:
                _take_place(new, target)
    except OSError as error:
        raise InputError("", f"cannot write: {error.strerror or error}", file=path) from None


def require_own_files(path: str | Path, *names: str) -> None:
    """Refuse a folder that holds other files than those of ``names``, patterns of paths relative to it."""
    folder = Path(path)
    if not folder.is_dir():
        return
    clear_scratch(folder)
    files = (file.relative_to(folder).as_posix() for file in sorted(folder.rglob("*")) if file.is_symlink() or not file.is_dir())
    others = [file for file in files if not any(fnmatch.fnmatchcase(file, name) for name in names)]
    if others:
        words = "cannot write: the folder is replaced as a whole, and holds files of others; move them, or name another"
        raise InputError("", words, some_of(others), file=path)


def _take_place(new: Path, target: Path) -> None:
    """Put a file or folder in the place of another, which takes the place of the new one if it is a folder with files."""
    try:
        os.replace(new, target)
    except OSError:
        if not target.is_dir():
            raise
        new.chmod(target.stat().st_mode)
        if not _exchange(new, target):
            # whoever clears this scratch folder puts back first what was set aside
            aside = new.with_name(ASIDE)
            aside.mkdir()
            os.replace(target, aside / target.name)
            os.replace(new, target)


def _exchange(a: Path, b: Path) -> bool:
    """Exchange two folders in one step; False where the system cannot."""
    # Linux: RENAME_EXCHANGE between places that are seen from the current folder (AT_FDCWD); macOS: RENAME_SWAP
    with suppress(OSError, AttributeError):
        system = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "linux":
            return bool(system.renameat2(-100, os.fsencode(a), -100, os.fsencode(b), 2) == 0)
        if sys.platform == "darwin":
            return bool(system.renamex_np(os.fsencode(a), os.fsencode(b), 2) == 0)
    return False


def _umask() -> int:
    now = os.umask(0)
    os.umask(now)
    return now


def write_json(path: str | Path, value: Any) -> None:
    """Write JSON with full precision; NaN and infinity are a bug of the caller."""
    write_atomically(path, json.dumps(value, indent=1, allow_nan=False) + "\n")
