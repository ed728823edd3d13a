"""A model of a log: which effects act, in which forms, on which surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Model:
    """Effects that are fitted together.

    ``free``: any pressure, else the nominal one, scaled if its friction is not known; ``families``: those of the effects that
    have the terms of their family (:class:`stablepush.effects.Family`), the others have the catalogue's own form.
    """

    effects: tuple[str, ...] = ()
    free: bool = True
    families: frozenset[str] = frozenset()

    def plus(self, *effects: str) -> Model:
        """Return the model with further effects."""
        return replace(self, effects=(*self.effects, *effects))

    def without(self, *effects: str) -> Model:
        """Return the model without some effects and their families."""
        return self.of([id for id in self.effects if id not in effects])

    def of(self, effects: Sequence[str]) -> Model:
        """Return the model with these effects, in the forms that they have here."""
        return replace(self, effects=tuple(effects), families=self.families & frozenset(effects))

    def with_family(self, effect: str) -> Model:
        """Return the model in which an effect has the terms of its family."""
        return replace(self, families=self.families | {effect})

    def on(self, free: bool) -> Model:
        """Return the model on a free surface, or on the nominal one."""
        return replace(self, free=free)

    @property
    def in_own_forms(self) -> Model:
        """The model with effects in the catalogue's forms: no simulation has the terms of families."""
        return replace(self, families=frozenset())
