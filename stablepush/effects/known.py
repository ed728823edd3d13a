"""Effects that a rig is known to have, as scenes and diagnoses hold them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stablepush.core import FloatArray, Node, read_only
from stablepush.effects.catalogue import CATALOGUE, Effect

#: Effects that leave the stable set as it is: friction that is as much more everywhere, and what sensors do.
_PLAN_NEUTRAL = ("drift",)


@dataclass(frozen=True, slots=True, eq=False)
class KnownEffect:
    """An effect, and the covariance (k, k) of all its numbers in the order of the catalogue; None if it is not known."""

    effect: Effect
    covariance: FloatArray | None = None

    @property
    def changes_no_plan(self) -> bool:
        """Whether the stable pushes are the same with it."""
        return CATALOGUE[self.effect.id].acts == "sensing" or self.effect.id in _PLAN_NEUTRAL

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``effects`` of a ``scene/1``."""
        values = {name: list(v) if len(v) > 1 else v[0] for name, v in self.effect.values.items()}
        covariance = None if self.covariance is None else self.covariance.tolist()
        return {"effect": self.effect.id, "parameters": values, "covariance": covariance}


def effects_from_node(node: Node | None) -> tuple[KnownEffect, ...]:
    """Read the ``effects`` of a ``scene/1``, a ``rig.json`` or a ``diagnosis/1``; none if the key is absent."""
    if node is None:
        return ()
    found: dict[str, KnownEffect] = {}
    for entry in node.items():
        entry.expect_keys("effect", "parameters", "covariance")
        id = entry["effect"].text(tuple(CATALOGUE))
        if id in found:
            entry["effect"].fail("expected every effect once", f"{id} twice")
        values: dict[str, Any] = {}
        known = {p.name: p for p in CATALOGUE[id].parameters}
        for name in entry["parameters"].object():
            value = entry["parameters"][name]
            if name not in known:
                value.fail(f"expected the parameters {', '.join(known)}")
            size = known[name].size
            values[name] = value.number() if size == 1 else value.array(size).tolist()
        if not values:
            entry["parameters"].fail(f"expected values of {', '.join(known)}")
        effect = entry.built(lambda id=id, values=values: Effect(id, values), f"effect {id}")  # type: ignore[misc]
        count = sum(np.size(value) for value in values.values())
        given = entry.get("covariance")
        found[id] = KnownEffect(effect, None if given is None else read_only(given.array(count, count)))
    return tuple(found.values())
