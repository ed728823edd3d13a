"""The program ``stablepush``: exit codes and one-line errors; the commands themselves are in :mod:`stablepush.cli.app`."""

from __future__ import annotations

import io
import os
import sys
import time
from typing import Any

#: Time limits count from here: the first thing that the program does, or the call of :func:`main` from Python.
STARTED = time.perf_counter()


def main(arguments: list[str] | None = None) -> int:
    """Run the program and return its exit code: 0 success, 1 a negative answer, 2 bad input, 130 interrupted."""
    global STARTED  # noqa: PLW0603
    if arguments is not None:
        STARTED = time.perf_counter()
    import typer

    from stablepush.cli.app import app
    from stablepush.errors import StablepushError

    # the class that all argument errors derive from is not a public name of every typer
    usage_error: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")
    for stream in (sys.stdout, sys.stderr):
        # names of files and words of plans may hold what the terminal's encoding cannot show
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    code: object
    try:
        code = app(args=arguments, prog_name="stablepush", standalone_mode=False)
        sys.stdout.flush()
    except typer.Exit as stop:
        code = stop.exit_code
    except StablepushError as error:
        code = _complain(str(error))
    except usage_error as error:
        code = _complain(error.format_message())  # type: ignore[attr-defined]
    except (KeyboardInterrupt, typer.Abort):
        print("stablepush: interrupted", file=sys.stderr)
        code = 130
    except BrokenPipeError:
        # whoever read the output has gone; the interpreter must not complain when it closes the stream
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except MemoryError:
        code = _complain("out of memory")
    result = code if isinstance(code, int) else 0
    if arguments is None:
        sys.exit(result)
    return result


def _complain(message: str) -> int:
    print(f"stablepush: error: {' '.join(message.split())}", file=sys.stderr)
    return 2
