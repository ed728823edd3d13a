"""What the commands share: options, the checks of their values, progress, and the file that a complaint is about."""

from __future__ import annotations

import io
import json
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stablepush.cli.stops import CLEAR, STOPS
from stablepush.core import EffectError, InputError, StablepushError, UnsupportedContactError, real_path, shown

if TYPE_CHECKING:
    from stablepush.planning import PlanningProblem, PlanResult

#: Endings of what a PNG is not.
_OTHER_PICTURES = (".html", ".htm", ".pdf", ".svg", ".jpg", ".jpeg", ".gif")


def number(text: str | float) -> float:
    """Parse a number; the message quotes what was given, in every version of the argument parser."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"expected a number, got {text!r}") from None


def numbers(option: str, names: Sequence[str], texts: Sequence[str]) -> list[float]:
    """Parse the values of an option that takes several; the message says which one it is."""
    found = []
    for name, text in zip(names, texts, strict=True):
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and abs(value) <= LARGEST):
            raise InputError(f"{option}: {name}", f"expected a finite number of at most {LARGEST:g}", repr(text))
        found.append(value)
    return found


def whole_number(text: str | int) -> int:
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"expected a whole number, got {text!r}") from None


#: Largest magnitude of a number, in SI units.
LARGEST = 1e6

Output = Annotated[Path, typer.Option("-o", "--output", help="File to write.")]
Contact = Annotated[
    Path | None,
    typer.Option(
        "--contact", metavar="FILE|N", help="Contact file (JSON); for a scene with several contacts, the number of one, from 0."
    ),
]


@contextmanager
def about(path: Path, contact: Path | None = None, options: Mapping[str, str] | None = None) -> Iterator[None]:
    """Name the option or the file that an error of the library is about.

    ``options``: by the name of an argument of the library, the option that gives it. A complaint about contacts is about the
    file ``contact``, any other about ``path``; effects are given by no file.
    """
    try:
        yield
    except EffectError:
        raise
    except StablepushError as error:
        if isinstance(error, InputError) and error.place in (options or {}):
            raise InputError((options or {})[error.place], error.expected, error.got) from None
        file = contact if contact is not None and isinstance(error, UnsupportedContactError) else path
        raise (error.within(file=file) if isinstance(error, InputError) else InputError("", str(error), file=file)) from None


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Let a block end by itself at the first Ctrl-C or signal like it, which the callable reports; the second ends it at once."""
    interrupted = False

    def interrupt(number: int, frame: object) -> None:
        nonlocal interrupted
        if interrupted:
            raise KeyboardInterrupt
        interrupted = True

    if threading.current_thread() is not threading.main_thread():
        # nobody can press it there
        yield lambda: False
        return
    before = {number: signal.signal(number, interrupt) for number in STOPS if signal.getsignal(number) is not signal.SIG_IGN}
    try:
        yield lambda: interrupted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def require_outside(path: Path, folder: Path) -> None:
    """Refuse to write a file into a folder that is read, or replaced as a whole."""
    if real_path(folder) in (real_path(path), *real_path(path).parents):
        raise InputError("", f"expected a place outside of {folder}", file=path)


def note_if_invalid(problem: PlanningProblem, result: PlanResult | None, path: Path | None) -> None:
    """Say so where a plan is not one that the scene's own check lets through."""
    from stablepush.planning import check_plan

    if path is None or result is None or not result.solved or is_quiet():
        return
    try:
        report = check_plan(problem, result)
    except InputError:
        # effects that no plan knows: nothing can be said
        return
    if report.valid:
        return
    words = f"the plan does not pass the check of this scene: {report.main_objection}"
    if report.only_margins_differ:
        words = "the plan was made for another scene, where its pushes have other margins; they are stable here, too"
    print(f"{path}: note: {words}", file=sys.stderr)


def also_written(*paths: Path | None) -> None:
    """Say which files were written beside the one that the summary names; None for those that were not asked for, or not made."""
    made = [str(path) for path in paths if path is not None]
    told(also_written=made)
    if made:
        print(f"also written: {', '.join(made)}")


def options_of(*names: str, **others: str) -> dict[str, str]:
    """Options by the names of the arguments that they give: ``time_limit`` is given by ``--time-limit``; others as stated."""
    return {name: f"--{name.replace('_', '-')}" for name in names} | {name: f"--{option}" for name, option in others.items()}


def require_files(*paths: Path | None, read: Sequence[Path | None] = ()) -> None:
    """Refuse, before any work is done, outputs that cannot be written, that are one and the same, or that are read."""
    given = [path for path in paths if path is not None]
    sources = [real_path(path) for path in read if path is not None]
    for i, path in enumerate(given):
        if path.is_dir():
            raise InputError("", "cannot write: is a directory", file=path)
        _require_parent(path)
        if real_path(path) in map(real_path, given[:i]):
            raise InputError("", "expected different output files, this one is given twice", file=path)
        if real_path(path) in sources:
            raise InputError("", "expected an output file that is not also an input", file=path)


def require_png(picture: Path | None) -> None:
    """Refuse a picture whose name says that it is something else."""
    if picture is not None and picture.suffix.lower() in _OTHER_PICTURES:
        page = "; a page is what --view writes, where there is that option" if picture.suffix.lower().startswith(".htm") else ""
        raise InputError("", f"expected a name that ends in .png, for a picture{page}", file=picture)


def require_folder(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise InputError("", "cannot write: exists and is not a folder", file=path)
    _require_parent(path)


def _require_parent(path: Path) -> None:
    parent = path.parent
    while not parent.exists() and parent != parent.parent:
        parent = parent.parent
    if not parent.is_dir():
        raise InputError("", f"cannot write: {parent} is not a folder", file=path)
    if not os.access(parent, os.W_OK):
        raise InputError("", f"cannot write: no permission in {parent}", file=path)


@dataclass
class _Voice:
    """How the program speaks: ``quiet``, errors alone; ``values``: what the summary holds, if it is to be JSON."""

    quiet: bool = False
    values: dict[str, Any] | None = None


_voice = _Voice()


def be_quiet() -> None:
    """Say nothing but errors until the block of :func:`heard` ends."""
    _voice.quiet = True
    # summaries are printed in many places, and dropped in one
    sys.stdout = io.StringIO()


def answer_in_json() -> None:
    """Collect what is :func:`told` until the block of :func:`heard` ends, in place of summaries in words."""
    _voice.values = {}
    sys.stdout = io.StringIO()


def is_quiet() -> bool:
    return _voice.quiet


def told(**values: Any) -> None:
    """Add to the summary in JSON: numbers in SI units and rad, paths and words; NaN is null."""
    if _voice.values is not None:
        _voice.values |= values


@contextmanager
def heard() -> Iterator[None]:
    """Say again after the block what is said before it, and print the summary in JSON if one was asked for."""
    before = sys.stdout
    try:
        yield
    finally:
        sys.stdout, values, quiet = before, _voice.values, _voice.quiet
        _voice.values, _voice.quiet = None, False
        if values and not quiet:
            print(json.dumps(_plain(values), indent=1))


def _plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int)) else str(value)


class Progress:
    """A line on standard error while something runs, only where a person can see it."""

    def __init__(self, name: str, total: int | None = None) -> None:
        self._name, self._total, self._done, self._shown = name, total, 0, 0.0
        self._live = sys.stderr.isatty() and not is_quiet()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._clear()

    def __call__(self) -> None:
        self._done += 1
        self.to(self._done, self._total or self._done)

    def to(self, done: int, total: int) -> None:
        self.describe(f"{done} of {total}")

    def describe(self, text: str) -> None:
        now = time.perf_counter()
        if self._live and now - self._shown > 0.1:
            self._shown = now
            print(f"{CLEAR}{shown(self._name)}: {shown(text)}", end="", file=sys.stderr, flush=True)

    def say(self, line: str, error: bool = True) -> None:
        self._clear()
        if not (error and is_quiet()):
            print(shown(line, len(line)), file=sys.stderr if error else sys.stdout)

    def _clear(self) -> None:
        if self._live and self._shown:
            print(CLEAR, end="", file=sys.stderr, flush=True)
