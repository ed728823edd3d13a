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


#: What a child does first: it takes the package from its folder, wherever else on the path another copy lies, and runs a module.
_START = (
    "import importlib.util as u, runpy, sys; folder, module = sys.argv[1:3]; del sys.argv[1:3]; "
    "spec = u.spec_from_file_location('stablepush', folder + '/__init__.py', submodule_search_locations=[folder]); "
    "package = sys.modules['stablepush'] = u.module_from_spec(spec); spec.loader.exec_module(package); "
    "runpy.run_module(module, run_name='__main__', alter_sys=True)"
)


def isolated_environment() -> dict[str, str]:
    """Return the environment of a child that finds modules where this process does, but not in the current folder: a
    ``random.py`` that lies there is not the library's."""
    with suppress(OSError):
        # not in a folder that was deleted
        here = Path.cwd()
        paths = [path for path in sys.path if path and Path(path).resolve() != here]
        return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONSAFEPATH": "1"}
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "PYTHONSAFEPATH": "1"}


def start_child(module: str, arguments: Sequence[str], error: Any = subprocess.DEVNULL, folder: Path | None = None) -> Any:
    """Start a module of this very package in a process that is told by the end of its standard input when this one has ended."""
    package = str(Path(__file__).resolve().parents[1])
    return subprocess.Popen(
        [sys.executable, "-c", _START, package, module, *arguments],
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


def work_under(parent: int, scratch: str, function: Callable[..., Any], *job: Any) -> Any:
    """Return ``function(*job)``, in a worker that ends soon after its ``parent`` (number of a process) has ended.

    ``scratch``: folder for its temporary files, which the parent clears however the worker ends.
    """
    tempfile.tempdir = scratch
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
