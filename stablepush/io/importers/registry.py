"""Raw logs of laboratories are found and read by importers, one for each kind, which are found by their entry points."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from stablepush.core import (
    InputError,
    StablepushError,
    StablepushWarning,
    UnavailableError,
    did_you_mean,
    load_plugin,
    plugin_names,
    real_path,
    what_failed,
)
from stablepush.io.pushlog import PushLog
from stablepush.io.special_files import require_file
from stablepush.objects import Slider


@dataclass(frozen=True, slots=True)
class Source:
    """A raw log on disk.

    ``kind``: of its importer; ``name``: of the folder that it becomes; ``labels``: what its place says of it, as ``surface``.
    """

    kind: str
    file: Path
    name: str
    labels: Mapping[str, str]


class Importer(Protocol):
    """Reads one kind of raw logs; registered in the group ``stablepush.importers`` under the name of the kind.

    One whose class says ``needs_mapping = True`` gets the path of the user's mapping as the label ``mapping`` of a source.
    """

    def find(self, root: Path) -> Iterable[Source]:
        """Return the logs of this kind in a folder, or the one that a file is, in any order."""

    def read(self, source: Source, slider: Slider | None) -> tuple[PushLog, list[str]]:
        """Return a log, and lines on what could not be used; ``slider`` replaces the laboratory's own.

        Every :class:`StablepushWarning` on the way becomes a line, too.
        """


_GROUP = "stablepush.importers"


def importers() -> list[str]:
    """Return the kinds of raw logs that installed importers read, in alphabetical order."""
    return plugin_names(_GROUP)


def find_sources(path: str | Path, kind: str | None = None, mapping: str | Path | None = None) -> list[Source]:
    """Return the raw logs that a file, a folder or a whole clone holds, ordered by path, with distinct names.

    ``mapping``: a YAML file that says what is what, for importers that need one; it becomes the label ``mapping`` of all sources.
    Those that need one are only asked if they are named by ``kind``, for they take any table or bag; or with a mapping, by the
    suffixes that they have.
    """
    root = Path(path)
    if kind is not None and kind not in importers():
        raise InputError("kind", f"expected {' or '.join(importers())}", f"{kind!r}{did_you_mean(kind, importers())}")
    if not root.exists():
        raise InputError("", "cannot read: no such file or folder", file=root)
    for file in root.rglob("*") if root.is_dir() else ():
        # a socket of another program is nobody's log, and does not keep a reader waiting
        if not (file.is_dir() or file.is_socket()):
            require_file(file)
    asked = _all_importers() if kind is None else {kind: load_plugin(_GROUP, kind)}
    mapped = [name for name, one in asked.items() if getattr(one, "needs_mapping", False)]
    if kind is None:
        # who gives a mapping with a file may have one that its suffix tells
        told = [name for name in mapped if mapping is not None and root.suffix in getattr(asked[name], "suffixes", ())]
        asked = {name: one for name, one in asked.items() if (name in told if told else name not in mapped)}
    elif mapping is not None and not getattr(asked[kind], "needs_mapping", False):
        raise InputError("mapping", f"expected none, logs of kind {kind} need no mapping", str(mapping))
    sources = []
    for name, importer in asked.items():
        # an importer that finds logs reads them, whatever it calls itself
        sources += [replace(source, kind=name) for source in _asked(name, importer.find, root)]
    sources.sort(key=lambda source: source.file)
    if not sources:
        words = f"expected a raw log of kind {' or '.join(asked)}, found none"
        if kind is None:
            words += f" (those of kind {' or '.join(mapped)} need --mapping, and --kind where no suffix tells)"
        raise InputError("", words, file=root)
    if mapping is not None:
        sources = [replace(source, labels={**source.labels, "mapping": str(mapping)}) for source in sources]
    return _named_apart(sources)


def _all_importers() -> dict[str, Importer]:
    """Importers by name; one that is broken is left out with a warning, for it may have nothing to do with this log."""
    found = {}
    for name in importers():
        try:
            found[name] = load_plugin(_GROUP, name)
        except UnavailableError as error:
            warnings.warn(StablepushWarning(f"left out: {error}"), stacklevel=3)
    return found


def _asked(name: str, method: Callable[..., Any], *arguments: object) -> Any:
    """What a method of an importer answers; sources in a list, as it may find them one by one.

    Whatever its code fails by names it; what it says of its input, and what cannot be read, stays as it is.
    """
    try:
        answer = method(*arguments)
        return list(answer) if isinstance(answer, Iterator) else answer
    except (StablepushError, OSError):
        raise
    except Exception as error:
        raise UnavailableError(f"importer {name}: it failed by {what_failed(error)}") from error


def _named_apart(sources: list[Source]) -> list[Source]:
    """Give distinct names to sources: with those of their files and folders from the inside out, at last with numbers."""
    for depth in range(3):
        names = [source.name for source in sources]
        if len(set(names)) == len(names):
            return sources
        places = [real_path(source.file) for source in sources]
        parts = [place if depth == 0 else place.parents[depth - 1] for place in places]
        sources = [
            s if names.count(s.name) == 1 or name_of(p) == s.name else replace(s, name=f"{s.name}_{name_of(p)}")
            for s, p in zip(sources, parts, strict=True)
        ]
    names = [source.name for source in sources]
    return [s if names.count(s.name) == 1 else replace(s, name=f"{s.name}_{k + 1}") for k, s in enumerate(sources)]


def import_source(source: Source, slider: Slider | None = None) -> tuple[PushLog, list[str]]:
    """Read one raw log into a :class:`PushLog`; also returns lines about what could not be used, and what looks wrong."""
    importer: Importer = load_plugin(_GROUP, source.kind)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log, notes = _asked(source.kind, importer.read, source, slider)
    ours = [warning for warning in heard if issubclass(warning.category, StablepushWarning)]
    for warning in heard:
        if warning not in ours:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return log, [*notes, *(str(warning.message) for warning in ours)]


def name_of(path: Path) -> str:
    """Return what a path is called, in letters that every file system takes."""
    stem = path.name.removesuffix(path.suffix)
    return re.sub(r"[^A-Za-z0-9._-]+", "-", stem).strip("-.") or "log"


@contextmanager
def within(file: Path) -> Iterator[None]:
    """Name the file in errors about what it holds."""
    try:
        yield
    except InputError as error:
        raise error.within(file=file) from None
