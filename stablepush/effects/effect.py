"""Effects with values of their parameters, and how commands write them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from stablepush.core import InputError, check_choice, check_number, did_you_mean, note_friction, note_quantity
from stablepush.effects.catalogue import CATALOGUE


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect with values of its parameters, each a tuple of numbers; those not given are nominal."""

    id: str
    values: Mapping[str, tuple[float, ...]]

    def __init__(self, id: str, values: Mapping[str, float | Iterable[float]]) -> None:
        check_choice(id, "effect", CATALOGUE)
        kind = CATALOGUE[id]
        known = {p.name: p for p in kind.parameters}
        if not isinstance(values, Mapping):
            raise InputError(f"effect {id}", "expected a mapping from parameters to values", repr(values))
        checked: dict[str, tuple[float, ...]] = {}
        for name, given in values.items():
            if name not in known:
                raise InputError(
                    f"effect {id}", f"unknown parameter, expected {' or '.join(known)}", f"{name!r}{did_you_mean(name, known)}"
                )
            parameter = known[name]
            several = given if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
            numbers = tuple(check_number(x, f"effect {id}: {name}", largest=math.inf) for x in several)
            if len(numbers) != parameter.size:
                raise InputError(
                    f"effect {id}: {name}", f"expected {parameter.size} number{'s' * (parameter.size > 1)}", len(numbers)
                )
            for value in numbers:
                try:
                    parameter.check(value)
                except InputError as error:
                    raise error.within(f"effect {id}") from None
            checked[name] = numbers
        object.__setattr__(self, "id", id)
        object.__setattr__(self, "values", MappingProxyType(checked))

    def __reduce__(self) -> tuple[type[Effect], tuple[str, dict[str, tuple[float, ...]]]]:
        # a read-only view of a mapping cannot be sent to another process
        return Effect, (self.id, dict(self.values))

    def number(self, name: str) -> float | None:
        """Return the value of a parameter of one number; its nominal value, which may be None, if it was not given."""
        value = self.vector(name)
        return None if value is None else value[0]

    @property
    def numbers(self) -> dict[str, tuple[float, ...]]:
        """Numbers of all parameters that are given, or have a nominal value, by name."""
        found = {parameter.name: self.vector(parameter.name) for parameter in CATALOGUE[self.id].parameters}
        return {name: numbers for name, numbers in found.items() if numbers is not None}

    def vector(self, name: str) -> tuple[float, ...] | None:
        """Return the numbers of a parameter; nominal ones if it was not given."""
        if name in self.values:
            return self.values[name]
        parameter = next(p for p in CATALOGUE[self.id].parameters if p.name == name)
        return None if parameter.nominal is None else (parameter.nominal,) * parameter.size


def parse_effect(text: str) -> Effect:
    """Read ``id:param=value,param=value``; the numbers of a vector are separated by slashes, as in ``0.01/0.02``."""
    if not isinstance(text, str):
        raise InputError("effect", "expected a text like drift:rate=-0.1", repr(text))
    id, _, rest = text.partition(":")
    if "=" in id:
        raise InputError("effect", "expected ID:PARAM=VALUE, like drift:rate=-0.1", repr(text))
    values: dict[str, tuple[float, ...]] = {}
    for part in filter(None, rest.split(",")):
        name, equals, numbers = part.partition("=")
        if not equals:
            raise InputError(f"effect {id}", "expected param=value", repr(part))
        if name in values:
            raise InputError(f"effect {id}", f"{name} is given twice")
        try:
            values[name] = tuple(float(x) for x in numbers.split("/"))
        except ValueError:
            raise InputError(f"effect {id}: {name}", "expected numbers separated by '/'", repr(numbers)) from None
    effect = Effect(id, values)
    for parameter in CATALOGUE[id].parameters:
        for value in values.get(parameter.name, ()):
            # frames follow the unit: rad in W
            note_quantity(value, parameter.unit.partition(" ")[0], parameter.high, f"effect {id}: {parameter.name}")
            if parameter.name == "mu":
                note_friction(value, f"effect {id}: mu")
    if not values:
        parameters = CATALOGUE[id].parameters
        example = "/".join(f"{parameters[0].high:.3g}" for _ in range(parameters[0].size))
        raise InputError(
            f"effect {id}",
            f"expected values for {', '.join(p.name for p in parameters)}, as in {id}:{parameters[0].name}={example}",
        )
    return effect
