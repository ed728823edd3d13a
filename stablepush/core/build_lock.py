"""Processes that need the same compiled function: one builds it, the others wait and read what it left on disk."""

from __future__ import annotations

import os
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]
    import msvcrt

#: Longest wait (s) of a process for all others; then it builds for itself. A lock on a network disk may never be released,
#: and a process may have been stopped.
_TIMEOUT = 60.0
_PAUSE = 0.02

#: Open files that hold locks, by folder. The system releases all of a process's locks on a file when any of its openings is
#: closed, so that each is opened once and stays open.
_files: dict[Path, int] = {}


class BuildLock:
    """The right to build a function whose code is kept in ``folder``. A process that ends releases it."""

    #: How much longer (s) this process waits for others.
    timeout = _TIMEOUT

    def __init__(self, folder: str, function: str) -> None:
        self._folder, self._place, self.held = Path(folder), zlib.crc32(function.encode()) & 0x7FFFFFFF, False

    def acquire(self, timeout: float | None = None) -> None:
        """Wait at most ``timeout`` (s) until no other process builds the function. Where the disk has no locks, do not wait."""
        began = time.monotonic()
        most = BuildLock.timeout if timeout is None else timeout
        # without a lock every process that needs the function builds it
        with suppress(OSError):
            if self._folder not in _files:
                self._folder.mkdir(parents=True, exist_ok=True)
                _files[self._folder] = os.open(self._folder / "building.lock", os.O_RDWR | os.O_CREAT, 0o666)
            self.held = self._lock()
            while not self.held and time.monotonic() < began + most:
                time.sleep(_PAUSE)
                self.held = self._lock()
        if timeout is None and not self.held:
            # a process that waited in vain does not wait as long for the next function
            BuildLock.timeout = max(0.0, BuildLock.timeout - (time.monotonic() - began))

    def release(self) -> None:
        """Let another process build the function."""
        if self.held:
            self.held = False
            with suppress(OSError):
                self._unlock()

    @contextmanager
    def released_on_error(self) -> Iterator[None]:
        """Release the lock if the block raises."""
        try:
            yield
        except BaseException:
            self.release()
            raise

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
