"""The catalogue of effects that a nominal simulation may leave out: all that have a file in :mod:`.kinds`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from types import MappingProxyType

from stablepush.effects import kinds
from stablepush.effects.kind import EffectKind, Family


def _kinds() -> Iterator[EffectKind]:
    """The effects of all files."""
    for module in pkgutil.iter_modules(kinds.__path__):
        name = f"{kinds.__name__}.{module.name}"
        for value in vars(importlib.import_module(name)).values():
            if isinstance(value, type) and issubclass(value, EffectKind) and value.id and value.__module__ == name:
                yield value()


def _catalogue() -> Mapping[str, EffectKind]:
    """Effects by id, in the order of their numbers. Raises ValueError if two have one id or one number."""
    found = sorted(_kinds(), key=lambda kind: kind.number)
    for name in ("id", "number"):
        values = [getattr(kind, name) for kind in found]
        if len(set(values)) < len(values):
            raise ValueError(f"two files of {kinds.__name__} have one {name}: {values}")
    return MappingProxyType({kind.id: kind for kind in found})


#: All effects by id, in the order of the contract.
CATALOGUE = _catalogue()
#: Families by the id of the effect whose form they extend; an effect that is not listed has one form.
FAMILIES: Mapping[str, Family] = MappingProxyType({id: kind.family for id, kind in CATALOGUE.items() if kind.family is not None})
#: Effects whose numbers are fitted: of the table and the sensors, then of the fingers, whose friction shows only where they slip.
FITTED: tuple[str, ...] = tuple(
    kind.id for kind in sorted(CATALOGUE.values(), key=lambda kind: (kind.by_slip, kind.acts == "contact")) if kind.size
)
#: A change of the pressure that moves its centre, and friction of the fingers, which shows where they slip.
PRESSURE_SHIFT = next(id for id, kind in CATALOGUE.items() if kind.moves_center)
FINGER_FRICTION = next(id for id, kind in CATALOGUE.items() if kind.by_slip)
#: Effects that a refitted pressure takes in.
OF_PRESSURE = tuple(id for id, kind in CATALOGUE.items() if kind.reshapes == "pressure")
