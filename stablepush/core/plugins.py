"""What installed packages add by entry points; each is loaded only when it is asked for."""

from __future__ import annotations

import traceback
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from stablepush.core.errors import UnavailableError


def plugin_names(group: str) -> list[str]:
    """Return the names that packages registered in an entry point group, in alphabetical order."""
    return sorted({entry.name for entry in entry_points(group=group)})


@cache
def load_plugin(group: str, name: str) -> Any:
    """Return what is registered under a name; raises :class:`LookupError` if nothing is, and :class:`UnavailableError` if its
    package cannot be imported."""
    found = tuple(entry_points(group=group, name=name))
    if not found:
        raise LookupError(f"{group}: nothing is registered as {name}")
    entry = found[0]
    try:
        return entry.load()
    except (ImportError, AttributeError) as error:
        package = entry.dist.name if entry.dist else entry.module
        raise UnavailableError(f"{group}: {name} of the package {package} cannot be loaded: {error}") from None


def what_failed(error: Exception) -> str:
    """Return an error of a package's code in a line: its kind, its words, and the last place in the file that was called."""
    words = ": ".join(filter(None, (type(error).__name__, " ".join(str(error).split()))))
    places = traceback.extract_tb(error.__traceback__)[1:]
    if not places:
        return words
    place = [place for place in places if place.filename == places[0].filename][-1]
    return f"{words} ({Path(place.filename).name}, line {place.lineno}, in {place.name})"
