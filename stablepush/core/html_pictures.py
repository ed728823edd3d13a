"""How values show themselves in notebooks: the rooms that draw register a picture for each kind, as plugins do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from stablepush.core.plugins import load_plugin

_GROUP = "stablepush.pictures"


def shown_as(kind: str) -> Callable[[Any], str]:
    """Return the ``_repr_html_`` of a class: what is registered for its kind makes it."""

    def html(value: Any) -> str:
        return str(load_plugin(_GROUP, kind)(value))

    return html
