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

#: Longest wait (s) for other processes; after that this one builds for itself. A lock on a network's disk may never be released,
#: and a process may have been stopped.
_PATIENCE = 60.0
_PAUSE = 0.02

#: Open files that hold locks, by folder. The system releases all of a process's locks on a file when any of its openings is
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
    """The right to build a function whose code is kept in ``folder``. A process that ends gives it back."""

    #: What is left (s) of this process's patience.
    patience = _PATIENCE

    def __init__(self, folder: str, function: str) -> None:
        self._folder, self._place, self.mine = Path(folder), zlib.crc32(function.encode()) & 0x7FFFFFFF, False

    def take(self, patience: float | None = None) -> None:
        """Wait at most ``patience`` (s) until no other process builds the function. Where the disk has no locks, do not wait."""
        began = time.monotonic()
        most = Turn.patience if patience is None else patience
        # what cannot be locked is built by all who need it
        with suppress(OSError):
            if self._folder not in _files:
                self._folder.mkdir(parents=True, exist_ok=True)
                _files[self._folder] = os.open(self._folder / "building.lock", os.O_RDWR | os.O_CREAT, 0o666)
            self.mine = self._lock()
            while not self.mine and time.monotonic() < began + most:
                time.sleep(_PAUSE)
                self.mine = self._lock()
        if patience is None and not self.mine:
            # whoever made this process wait so long is not waited for again
            Turn.patience = max(0.0, Turn.patience - (time.monotonic() - began))

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
