"""Which kinds of limit surface there are: those of this library, and installed ones."""

from __future__ import annotations

from stablepush.core import load_plugin, plugin_names
from stablepush.surfaces.gp import GaussianProcessSurface
from stablepush.surfaces.ideal import IdealLimitSurface
from stablepush.surfaces.polynomial import PolynomialLimitSurface
from stablepush.surfaces.protocol import LimitSurface

_GROUP = "stablepush.surfaces"
_OWN: dict[str, type[LimitSurface]] = {
    surface.kind: surface for surface in (PolynomialLimitSurface, IdealLimitSurface, GaussianProcessSurface)
}


def surface_kinds() -> list[str]:
    """Return the kinds of limit surface; packages add theirs by the entry point ``stablepush.surfaces``."""
    return [*_OWN, *(name for name in plugin_names(_GROUP) if name not in _OWN)]


def surface_of_kind(kind: str) -> type[LimitSurface]:
    """Return the class of a kind; raises :class:`stablepush.UnavailableError` for a package that cannot be loaded."""
    return _OWN[kind] if kind in _OWN else load_plugin(_GROUP, kind)  # type: ignore[no-any-return]
