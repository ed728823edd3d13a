"""Child processes: they run the code of this one and nothing of the current folder, and end when it ends."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

#: How often (s) a worker looks whether its parent still lives.
_LOOK = 0.5


def isolated_environment() -> dict[str, str]:
    """Return the environment of a child that finds modules where this process does.

    Neither the current folder nor that of a script comes first: a ``random.py`` that lies there is not the library's. The package
    itself comes last, so that nothing beside it stands before a module of Python.
    """
    here, package = Path.cwd(), str(Path(__file__).resolve().parents[2])
    paths = [path for path in sys.path if path and Path(path).resolve() != here and path != package]
    return os.environ | {"PYTHONPATH": os.pathsep.join([*paths, package]), "PYTHONSAFEPATH": "1"}


def start_child(module: str, arguments: Sequence[str], error: Any = subprocess.DEVNULL, folder: Path | None = None) -> Any:
    """Start ``python -m module`` in a process that is told by the end of its standard input when this one has ended."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=error, env=isolated_environment(), cwd=folder, text=True,
    )  # fmt: skip


def run_child(module: str, arguments: Sequence[str], line: str = "", folder: Path | None = None) -> tuple[int, str]:
    """Run a module that begins with :func:`end_with_parent`; return its exit code and the last line on its standard error.

    ``line``: what it reads first.
    """
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as error:
        with start_child(module, arguments, error, folder) as child:
            try:
                with suppress(BrokenPipeError):
                    child.stdin.write(f"{line}\n")
                    child.stdin.flush()
                code = child.wait()
            finally:
                child.kill()
        error.seek(0)
        said = error.read().strip().splitlines()
    return code, said[-1] if said else ""


def end_with_parent() -> str:
    """Return the line that the parent of this child wrote first; from now on this process ends when the parent does."""
    first = sys.stdin.readline().strip()

    def wait() -> None:
        sys.stdin.read()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
    return first


def work_under(parent: int, function: Callable[..., Any], *job: Any) -> Any:
    """Return ``function(*job)``, in a worker that ends soon after its ``parent`` (number of a process) has ended."""
    if parent not in _watched:
        _watched.add(parent)
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    return function(*job)


#: Parents that a thread of this process looks after.
_watched: set[int] = set()


def _watch(parent: int) -> None:
    # a process whose parent has ended is given to another
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(1)
