"""The run of one command: exit codes, errors of one line, notes at the end; the commands are in :mod:`stablepush.cli.app`."""

from __future__ import annotations

import errno
import io
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stablepush.cli import clock
from stablepush.cli.stops import CLEAR, STOPS

#: Exit codes, besides 0 and 1, a negative answer.
BAD_INPUT, INTERRUPTED = 2, 130
#: How long (s) a program that was told to end has for it.
_PATIENCE = 5.0
#: Characters of a message that are shown at most.
_LONGEST_NOTE = 6000


def main(arguments: list[str] | None = None) -> int:
    """Run the program and return its exit code: 0 success, 1 a negative answer, 2 bad input, 130 interrupted."""
    if arguments is not None:
        clock.restart()
    import typer

    from stablepush.cli.app import app
    from stablepush.cli.building import FirstUse
    from stablepush.cli.common import heard, is_quiet
    from stablepush.core import at_first_build

    if arguments is None:
        at_first_build(FirstUse)

    if sys.stdout is None:
        # closed by whoever started the program
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    # the class that all argument errors derive from is not a public name of every typer
    usage_error: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")
    for stream in (sys.stdout, sys.stderr):
        # names of files and words of plans may hold what the terminal's encoding cannot show
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with _shown(), heard():
            with _notes() as notes, _stopped_alike():
                code = _run(app, arguments, usage_error)
            if code != BAD_INPUT and not is_quiet():
                for note in notes:
                    print(note, file=sys.stderr)
        sys.stdout.flush()
    except OSError as error:
        # of the summary as JSON
        if error.errno not in (errno.EPIPE, errno.ENOSPC):
            raise
        _drop_output()
        code = _complain(f"cannot write: {error.strerror}") if error.errno == errno.ENOSPC else 0
    if arguments is None:
        sys.exit(code)
    return code


class _Shown:
    """A stream whose text has no control characters: names from files may hold some."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        from stablepush.core import shown

        # what clears a line of progress is the program's own
        words = text.removeprefix(CLEAR)
        return int(self._stream.write(text[: len(text) - len(words)] + shown(words, len(words), keep="\n\t")))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def _shown() -> Iterator[None]:
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (_Shown(stream) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


@contextmanager
def _stopped_alike() -> Iterator[None]:
    """Let the signals of a system that shuts down, of ``kill`` and of a terminal that closes end the program as Ctrl-C does.

    One that is ignored, as by ``nohup``, stays ignored. Compiled code that runs on does not keep the program from ending.
    """

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    def end_all_the_same() -> None:
        # a byte, the number, is written when a signal comes; its handler is called between two steps of Python
        while number := os.read(came, 1):
            if number[0] in changed and not over.wait(_PATIENCE):
                os._exit(INTERRUPTED)
        os.close(came)

    def is_default(number: int) -> bool:
        return signal.getsignal(number) is signal.SIG_DFL

    mine = threading.current_thread() is threading.main_thread()
    changed = [number for number in STOPS if number != signal.SIGINT and mine and is_default(number)]
    if not changed:
        yield
        return
    (came, comes), over = os.pipe(), threading.Event()
    os.set_blocking(comes, False)
    for number in changed:
        signal.signal(number, stop)
    before = signal.set_wakeup_fd(comes, warn_on_full_buffer=False)
    threading.Thread(target=end_all_the_same, daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        for number in changed:
            signal.signal(number, signal.SIG_DFL)
        # both end the thread, whatever it waits for
        over.set()
        os.close(comes)


def _run(app: Any, arguments: list[str] | None, usage_error: Any) -> int:
    import typer

    from stablepush.core import StablepushError

    code: object
    if not _has_current_folder():
        # no relative path leads anywhere, and libraries that are loaded on the way fail
        return _complain("the current folder does not exist any more: change to one that does")
    try:
        given = sys.argv[1:] if arguments is None else arguments
        _require_values(given)
        program: Any = typer.main.get_command(app)
        chosen = next((program.commands[word] for word in given if word in program.commands), None)
        if chosen is not None:
            _require_numbers(chosen, given)
        code = program(args=arguments, prog_name="stablepush", standalone_mode=False)
        sys.stdout.flush()
    except typer.Exit as stop:
        code = stop.exit_code
    except InterruptedError as stop:
        # a command that kept something, and says what
        print(f"stablepush: interrupted; {stop}", file=sys.stderr)
        return INTERRUPTED
    except StablepushError as error:
        code = _complain(str(error))
    except usage_error as error:
        words = error.format_message()  # type: ignore[attr-defined]
        if words.partition(": ")[2].split(" ")[0].rstrip(".") in ("--quiet", "-q", "--json"):
            words = f"{words.rstrip('.')}: it comes before the command"
        code = _complain(words)
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except BrokenPipeError:
        # whoever read the output has gone; the interpreter must not complain when it closes the stream
        _drop_output()
        code = 0
    except MemoryError:
        code = _complain("out of memory")
    except OSError as error:
        if error.errno == errno.ENOSPC:
            _drop_output()
            code = _complain(f"cannot write: {error.strerror}")
        else:
            raise
    if code == INTERRUPTED:
        # from here, or from typer: newer versions turn a Ctrl-C into this code themselves
        print("stablepush: interrupted", file=sys.stderr)
    return code if isinstance(code, int) else 0


def _drop_output() -> None:
    """Send to nowhere what is not yet written, which the interpreter would write once more when it ends."""
    if sys.__stdout__ is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno())


def _has_current_folder() -> bool:
    try:
        Path.cwd()
    except OSError:
        return False
    return True


def _require_values(arguments: list[str]) -> None:
    """Refuse empty arguments, which an unset variable of a shell leaves: as a path they would mean the current folder."""
    from stablepush.core import InputError

    for before, argument in zip(("", *arguments), arguments, strict=False):
        name, equals, value = argument.partition("=")
        if argument == "" or (name.startswith("--") and equals and value == ""):
            place = name or (before if before.startswith("-") else "arguments")
            raise InputError(place, "expected a value", '""')


def _require_numbers(command: Any, arguments: list[str]) -> None:
    """Refuse an option of several numbers that another option cuts short, whose name the parser would take for a number; and
    several numbers after an option that is repeated for each."""
    from stablepush.core import InputError

    several = {name: option for option in command.params if option.nargs > 1 for name in option.opts}
    repeated = {name for option in command.params if getattr(option, "multiple", False) for name in option.opts}
    for k, argument in enumerate(arguments):
        name, equals, first = argument.partition("=")
        after = arguments[k + 1 : k + 3]
        if name in repeated and not equals and len(after) == 2 and all(_is_number(word) for word in after):
            raise InputError(name, f"expected one value each time, {name} {after[0]} {name} {after[1]}", " ".join(after))
        if name not in several:
            continue
        option = several[name]
        values = [first] * bool(equals) + arguments[k + 1 :]
        count = 0
        while count < min(option.nargs, len(values)) and not _is_option(values[count]):
            count += 1
        if count < option.nargs:
            got = f"{count}: {' '.join(values[:count])}" if count else "none"
            raise InputError(name, f"expected {option.nargs} numbers, {option.metavar}", got)


def _is_option(text: str) -> bool:
    return not _is_number(text) and re.match("--?[A-Za-z]", text) is not None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@contextmanager
def _notes() -> Iterator[list[str]]:
    """Collect, as lines to be printed, what the library warns of in a block: each value once, however often it is looked at."""
    from stablepush.core import PlausibilityWarning, StablepushWarning, shown

    lines: list[str] = []
    printed: set[str] = set()
    with warnings.catch_warnings():
        warnings.simplefilter("always", StablepushWarning)
        others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any, **named: Any) -> None:
            if not issubclass(category, StablepushWarning):
                others(message, category, *rest, **named)
                return
            text = shown(" ".join(str(message).split()), _LONGEST_NOTE)
            doubt, file = (message.doubt, message.file) if isinstance(message, PlausibilityWarning) else (text, "")
            # of drawn values each is another: one note says enough
            doubt = f"{getattr(message, 'place', '')}: {re.sub(r'[0-9][0-9.e+-]*', '#', doubt)}"
            # what was read is made into values more than once: those know no file
            if text in printed or (doubt in printed and not file):
                return
            printed.update((text, doubt))
            lines.append(f"{'note' if issubclass(category, PlausibilityWarning) else 'warning'}: {text}")

        warnings.showwarning = show
        yield lines


def _complain(message: str) -> int:
    from stablepush.core import shown

    print(f"stablepush: error: {shown(' '.join(message.split()), _LONGEST_NOTE)}", file=sys.stderr)
    return BAD_INPUT
