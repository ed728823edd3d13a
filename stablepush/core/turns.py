"""Processes that build the same code take turns: one builds, the others wait and read what it left on disk."""

from __future__ import annotations

import os
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]
    import msvcrt

#: Longest wait (s) for another process, after which a function is built twice: a lock on a network's disk may never be let go.
_PATIENCE = 120.0
_PAUSE = 0.02

#: Open files that hold locks, by folder. The system lets go of all of a process's locks on a file when any of its openings is
#: closed, so that each is opened once and stays open.
_files: dict[Path, int] = {}
_unheard: list[Callable[[], None]] = []


def at_first_build(notify: Callable[[], None]) -> None:
    """Call ``notify`` once, as soon as a function is found that is not on disk."""
    _unheard.append(notify)


def announce_build() -> None:
    """Tell whoever asked to hear of the first build."""
    while _unheard:
        _unheard.pop()()


class Turn:
    """The right to build a function whose code is kept in ``folder``. A process that dies loses it."""

    def __init__(self, folder: str, function: str) -> None:
        self._folder, self._place, self.mine = Path(folder), zlib.crc32(function.encode()) & 0x7FFFFFFF, False

    def take(self, patience: float = _PATIENCE) -> None:
        """Wait (s) until no other process builds the function. Where the disk has no locks, do not wait."""
        until = time.monotonic() + patience
        # what cannot be locked is built by all who need it
        with suppress(OSError):
            if self._folder not in _files:
                self._folder.mkdir(parents=True, exist_ok=True)
                _files[self._folder] = os.open(self._folder / "building.lock", os.O_RDWR | os.O_CREAT, 0o666)
            while not self.mine and time.monotonic() < until:
                self.mine = self._lock()
                if not self.mine:
                    time.sleep(_PAUSE)

    def give(self) -> None:
        """Let another process have it."""
        if self.mine:
            self.mine = False
            with suppress(OSError):
                self._unlock()

    def _lock(self) -> bool:
        file = _files[self._folder]
        try:
            if fcntl is not None:
                fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, self._place)
            else:
                os.lseek(file, self._place, os.SEEK_SET)
                msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except (BlockingIOError, PermissionError):
            return False
        return True

    def _unlock(self) -> None:
        file = _files[self._folder]
        if fcntl is not None:
            fcntl.lockf(file, fcntl.LOCK_UN, 1, self._place)
        else:
            os.lseek(file, self._place, os.SEEK_SET)
            msvcrt.locking(file, msvcrt.LK_UNLCK, 1)
