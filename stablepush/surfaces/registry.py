"""Which kinds of limit surface there are: those of this library, and installed ones."""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points

from stablepush.surfaces.gp import GaussianProcessSurface
from stablepush.surfaces.ideal import IdealLimitSurface
from stablepush.surfaces.polynomial import PolynomialLimitSurface
from stablepush.surfaces.protocol import LimitSurface


@cache
def surface_kinds() -> dict[str, type[LimitSurface]]:
    """Return the classes of limit surfaces by their kind; packages add theirs by the entry point ``stablepush.surfaces``."""
    own = {surface.kind: surface for surface in (PolynomialLimitSurface, IdealLimitSurface, GaussianProcessSurface)}
    return {**own, **{entry.name: entry.load() for entry in entry_points(group="stablepush.surfaces")}}
