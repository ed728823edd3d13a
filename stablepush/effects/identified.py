"""Effects that a rig is known to have, as scenes and diagnoses hold them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError, Node, check_array, did_you_mean, read_only
from stablepush.effects.catalogue import CATALOGUE
from stablepush.effects.effect import Effect

#: Rounding of a covariance, over its largest entry.
_ROUNDED = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class KnownEffect:
    """An effect, and the covariance (k, k) of all its numbers in the order of the catalogue; None if it is not known."""

    effect: Effect
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.covariance is None:
            return
        size = sum(len(numbers) for numbers in self.effect.values.values())
        matrix = check_array(self.covariance, f"effect {self.effect.id}: covariance", (size, size))
        scale = float(np.abs(matrix).max())
        if np.abs(matrix - matrix.T).max() > _ROUNDED * scale or np.linalg.eigvalsh(matrix)[0] < -_ROUNDED * scale:
            raise InputError(f"effect {self.effect.id}: covariance", "expected it symmetric, without negative eigenvalues")

    @property
    def changes_no_plan(self) -> bool:
        """Whether the stable pushes are the same with it, as with nominal values."""
        if not CATALOGUE[self.effect.id].changes_plans:
            return True
        return self._is_nominal and (self.covariance is None or not self.covariance.any())

    @property
    def _is_nominal(self) -> bool:
        known = {p.name: p.nominal for p in CATALOGUE[self.effect.id].parameters}
        # a direction says nothing where the ratio is 1
        names = [name for name in self.effect.values if name != "direction"]
        return all(value == known[name] for name in names for value in self.effect.values[name])

    def drawn(self, rng: np.random.Generator, share: float = 1.0) -> KnownEffect:
        """Return the effect with values drawn from its covariance, within what makes sense; itself if that is not known.

        ``share``: of the way from the estimate to the draw.
        """
        if self.covariance is None:
            return self
        known = [p for p in CATALOGUE[self.effect.id].parameters if p.name in self.effect.values]
        middle = np.concatenate([self.effect.values[p.name] for p in known])
        sizes, axes = np.linalg.eigh(self.covariance)
        numbers = middle + share * axes @ (np.sqrt(np.maximum(sizes, 0.0)) * rng.normal(size=len(middle)))
        values, first = {}, 0
        for p in known:
            # a bound that a value must not reach is kept away from
            least = p.least + 1e-3 if p.above else p.least
            values[p.name] = np.clip(numbers[first : first + p.size], least, p.most).tolist()
            first += p.size
        return KnownEffect(Effect(self.effect.id, values), self.covariance)

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
                value.fail(f"unknown parameter, expected {' or '.join(known)}{did_you_mean(name, known)}")
            size = known[name].size
            values[name] = value.number() if size == 1 else value.array(size).tolist()
        if not values:
            entry["parameters"].fail(f"expected values of {', '.join(known)}")
        effect = entry.built(lambda id=id, values=values: Effect(id, values), f"effect {id}")  # type: ignore[misc]
        count = sum(np.size(value) for value in values.values())
        given = entry.get("covariance")
        covariance = None if given is None else read_only(given.array(count, count))
        found[id] = entry.built(lambda effect=effect, covariance=covariance: KnownEffect(effect, covariance), "covariance")  # type: ignore[misc]
    return tuple(found.values())
