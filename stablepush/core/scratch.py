"""Folders for work that is not finished: they go when the work ends, however it ends."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: What the names of all of them begin with.
SCRATCH = ".stablepush-"
#: Folder in one of them that holds what is being replaced.
ASIDE = "aside"


@contextmanager
def scratch_folder(parent: str | Path | None = None) -> Iterator[Path]:
    """Give a new folder in ``parent``, or where temporary files are, that is gone after the block.

    A process that is killed cannot clear up: the next one that works in ``parent`` does it.
    """
    place = Path(tempfile.gettempdir() if parent is None else parent)
    clear_scratch(place)
    folder = Path(tempfile.mkdtemp(dir=place, prefix=scratch_prefix()))
    try:
        yield folder
    finally:
        _remove(folder)


def scratch_prefix() -> str:
    """What the names of this process's files begin with that are not finished: its machine and number."""
    return f"{SCRATCH}{platform.node()}-{os.getpid()}-"


def clear_scratch(parent: Path) -> None:
    """Remove what processes of this machine that have ended left in a folder."""
    if os.name != "posix":
        # no question whether a process runs that does not end it
        return
    mine = f"{SCRATCH}{platform.node()}-"
    for left in parent.glob(f"{mine}*"):
        number = left.name.removeprefix(mine).partition("-")[0]
        if number.isdigit() and not _runs(int(number)):
            if left.is_dir():
                _remove(left)
            else:
                left.unlink(missing_ok=True)


def _remove(folder: Path) -> None:
    """Remove a folder for work; what it had set aside, and nothing has come in the place of, goes back beside it."""
    for kept in folder.glob(f"{ASIDE}/*"):
        if not (folder.parent / kept.name).exists():
            os.replace(kept, folder.parent / kept.name)
    shutil.rmtree(folder, ignore_errors=True)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        # of another user
        return True
    return True
