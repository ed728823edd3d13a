"""Raw logs of laboratories are found and read by importers, one for each kind, which are found by their entry points."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from stablepush.core import InputError, load_plugin, plugin_names
from stablepush.io.pushlog import PushLog
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
    """Reads one kind of raw logs; registered in the group ``stablepush.importers`` under the name of the kind."""

    def find(self, root: Path) -> Iterable[Source]:
        """Return the logs of this kind in a folder, or the one that a file is, in any order."""

    def read(self, source: Source, slider: Slider | None) -> tuple[PushLog, list[str]]:
        """Return a log, and lines on what could not be used; ``slider`` replaces the laboratory's own."""


_GROUP = "stablepush.importers"


def importers() -> list[str]:
    """Return the kinds of raw logs that installed importers read, in alphabetical order."""
    return plugin_names(_GROUP)


def find_sources(path: str | Path, kind: str | None = None) -> list[Source]:
    """Return the raw logs that a file, a folder or a whole clone holds, ordered by path, with distinct names."""
    root = Path(path)
    if kind is not None and kind not in importers():
        raise InputError("kind", f"expected {' or '.join(importers())}", repr(kind))
    if not root.exists():
        raise InputError("", "cannot read: no such file or folder", file=root)
    wanted = importers() if kind is None else [kind]
    found = (load_plugin(_GROUP, name).find(root) for name in wanted)
    sources = sorted((source for several in found for source in several), key=lambda source: source.file)
    if not sources:
        raise InputError("", f"expected a raw log of kind {' or '.join(wanted)}, found none", file=root)
    names = [source.name for source in sources]
    return [s if names.count(s.name) == 1 else replace(s, name=f"{s.name}_{name_of(s.file)}") for s in sources]


def import_source(source: Source, slider: Slider | None = None) -> tuple[PushLog, list[str]]:
    """Read one raw log into a :class:`PushLog`; also returns lines about what could not be used."""
    importer: Importer = load_plugin(_GROUP, source.kind)
    return importer.read(source, slider)


def name_of(path: Path) -> str:
    """Return what a path is called, in letters that every file system takes."""
    stem = path.name.removesuffix(path.suffix)
    return re.sub(r"[^A-Za-z0-9._-]+", "-", stem).strip("-.") or "log"
