"""The catalogue of effects that a nominal simulation may leave out: all that have a file in :mod:`.kinds`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from types import MappingProxyType

from stablepush.effects import kinds
from stablepush.effects.kind import EffectKind, Family


def _kinds() -> Iterator[EffectKind]:
    for module in pkgutil.iter_modules(kinds.__path__):
        for value in vars(importlib.import_module(f"{kinds.__name__}.{module.name}")).values():
            if isinstance(value, type) and issubclass(value, EffectKind) and value.id:
                yield value()


#: All effects by id, in the order of the contract.
CATALOGUE: Mapping[str, EffectKind] = MappingProxyType({kind.id: kind for kind in sorted(_kinds(), key=lambda kind: kind.number)})
#: Families by the id of the effect whose form they extend; an effect that is not listed has one form.
FAMILIES: Mapping[str, Family] = MappingProxyType({id: kind.family for id, kind in CATALOGUE.items() if kind.family is not None})
#: Effects whose numbers are fitted.
FITTED: tuple[str, ...] = tuple(id for id, kind in CATALOGUE.items() if kind.size)
#: A change of the pressure that moves its centre, and friction of the fingers, which shows where they slip.
PRESSURE_SHIFT = next(id for id, kind in CATALOGUE.items() if kind.moves_center)
FINGER_FRICTION = next(id for id, kind in CATALOGUE.items() if kind.by_slip)
#: Effects that a refitted pressure takes in.
OF_PRESSURE = tuple(id for id, kind in CATALOGUE.items() if kind.reshapes == "pressure")
