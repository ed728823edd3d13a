"""What a nominal simulation leaves out: the catalogue of effects, as data, and how each changes a rig.

An effect has an id, parameters with unit, nominal value (no effect) and plausible range, and a place where it acts: the friction
of the support, the mass that is moved, the contact, or the sensors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from stablepush.core import LARGEST_MAGNITUDE, InputError, check_choice, check_number, did_you_mean, note_friction, note_quantity

#: Speed (m/s) at which friction that depends on speed is nominal.
REFERENCE_SPEED = 0.02


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect.

    ``size`` numbers; ``nominal`` value of each (None: that of the rig), and the range ``low`` to ``high`` in which rigs are
    found; ``least`` and ``most``: values beyond make no sense; ``above``: nor does ``least`` itself; ``whole``: only whole
    numbers do.
    """

    name: str
    unit: str
    nominal: float | None
    low: float
    high: float
    size: int = 1
    least: float = -LARGEST_MAGNITUDE
    most: float = LARGEST_MAGNITUDE
    above: bool = False
    whole: bool = False

    def check(self, value: float) -> None:
        """Refuse a value that makes no sense."""
        low = value <= self.least if self.above else value < self.least
        if math.isfinite(value) and not low and value <= self.most and (float(value).is_integer() or not self.whole):
            return
        floor = "" if self.least <= -LARGEST_MAGNITUDE else f" {'>' if self.above else '>='} {self.least:g} and"
        kind = "whole number" if self.whole else "number"
        unit = "" if self.unit in ("1", "support", "degree") else f" ({self.unit})"
        raise InputError(self.name, f"expected a {kind}{unit}{floor} <= {self.most:g}", f"{value:g}")


#: Effects of the table that leave the stable pushes as they are: friction that is as much more everywhere.
_PLAN_NEUTRAL = ("drift",)


@dataclass(frozen=True, slots=True)
class EffectKind:
    """An entry of the catalogue; ``acts`` is ``"support"``, ``"inertia"``, ``"contact"`` or ``"sensing"``; ``needs``: what a log
    must hold to show it; ``remedy``: what to do once it is named; ``says``: a sentence about its parameters, by name."""

    id: str
    what: str
    acts: str
    needs: str
    remedy: str
    says: str
    parameters: tuple[Parameter, ...]

    @property
    def changes_plans(self) -> bool:
        """Whether other pushes may be stable with it. Not so with effects of the sensors, nor with friction that changes alike
        everywhere."""
        return self.acts != "sensing" and self.id not in _PLAN_NEUTRAL


def _kinds() -> tuple[EffectKind, ...]:
    ratio = Parameter("ratio", "1", 1.0, 1.0, 1.5, least=1.0)
    half = math.pi / 2
    return (
        EffectKind(
            "anisotropy-world",
            "support friction depends on direction over the table",
            "support",
            "headings of the slider over the table that vary, and forces, or pushes that slip",
            "stablepush correct, then plan again: plans reckon with it at every heading; or plan along one principal direction "
            "of the friction",
            "Support friction is {ratio} times as large along {direction} of the table as across it",
            (ratio, Parameter("direction", "rad in W", 0.0, -half, half)),
        ),
        EffectKind(
            "anisotropy-object",
            "support friction depends on direction, fixed in the slider",
            "support",
            "pushes in many directions of the slider, and forces, or pushes that slip",
            "stablepush correct, then plan again; look at the feet for a worn or ribbed one",
            "Support friction is {ratio} times as large along {direction} of the slider as across it",
            (ratio, Parameter("direction", "rad in B", 0.0, -half, half)),
        ),
        EffectKind(
            "speed-dependence",
            "support friction depends on speed",
            "support",
            "forces at speeds that vary by a factor of three or more",
            "push at the speed of the pokes; or stablepush correct, then plan again",
            "Support friction changes by {slope} for each e-fold of speed",
            (Parameter("slope", "1 per e-fold of speed", 0.0, -0.15, 0.15),),
        ),
        EffectKind(
            "spatial-variation",
            "support friction differs over the table",
            "support",
            "places on the table that vary, and forces, or pushes that slip",
            "clean the table; or stablepush correct, then plan again within the bounds",
            "Support friction rises by {gradient} along x and y of the table",
            (Parameter("gradient", "1/m in W", 0.0, -1.0, 1.0, 2),),
        ),
        EffectKind(
            "drift",
            "support friction changes over the log",
            "support",
            "forces over many trials, in random order",
            "wait until the surfaces have worn in, then poke again before planning",
            "Support friction changes by {rate} from the first to the last push",
            (Parameter("rate", "1, first to last trial", 0.0, -0.3, 0.3, least=-1.0, above=True),),
        ),
        EffectKind(
            "pressure-shift",
            "centre of pressure away from the nominal",
            "support",
            "pushes whose line of force misses the centre of mass, with forces or motions of the slider",
            "stablepush correct, then plan again: the corrected surface has it",
            "The centre of pressure lies {offset} along x and y of the slider from the nominal one",
            (Parameter("offset", "m in B", 0.0, -0.01, 0.01, 2),),
        ),
        EffectKind(
            "pressure-spread",
            "pressure nearer to or farther from its centre",
            "support",
            "turns and straight pushes, with forces or motions of the slider",
            "stablepush correct, then plan again: the corrected surface has it",
            "The pressure is {scale} times as wide as the nominal one",
            (Parameter("scale", "1", 1.0, 0.7, 1.4, least=0.0, above=True),),
        ),
        EffectKind(
            "tilt",
            "the table is not level",
            "support",
            "headings that vary, forces, and rows at rest to separate it from a sensor bias",
            "level the table (the slope points downhill, 0.017 rad is one degree), or free a cable that pulls on the object; or "
            "correct the scene and plan with the tilt",
            "The table falls by {slope} along x and y (negative: it rises)",
            (Parameter("slope", "rad in W", 0.0, -0.05, 0.05, 2, least=-0.5, most=0.5),),
        ),
        EffectKind(
            "inertia",
            "the push is not quasi-static",
            "inertia",
            "forces while pushes speed up or slow down",
            "push slower, or with less acceleration (stablepush trajectory --acceleration)",
            "Pushes are not quasi-static: a mass of {mass} resists",
            (Parameter("mass", "kg", 0.0, 0.0, 3.0, least=0.0),),
        ),
        EffectKind(
            "contact-friction",
            "friction between pusher and slider away from nominal",
            "contact",
            "pushes that slip along the face, with poses of the pusher",
            "stablepush correct, then plan again; or use rougher fingers",
            "The friction of the fingers is {mu}",
            (Parameter("mu", "1", None, 0.0, 1.2, least=0.0),),
        ),
        EffectKind(
            "contact-geometry",
            "finger radius or contact place away from nominal",
            "contact",
            "poses of the pusher and the slider in contact, from several sides",
            "measure the fingers; stablepush correct has the radius",
            "The fingers act as if their radius were {radius}",
            (Parameter("radius", "m", None, 0.0, 0.02, least=0.0, most=1.0),),
        ),
        EffectKind(
            "force-bias",
            "constant offset of the force sensor",
            "sensing",
            "forces at headings that vary, and rows at rest",
            "zero the force sensor before each push, or import rows at rest before each (zero_forces takes the offset off); fit "
            "again what was fitted to its readings, and plan again",
            "The force sensor has an offset of {force} along x and y of the table; subtract it",
            (Parameter("force", "N in W", 0.0, -1.0, 1.0, 2),),
        ),
        EffectKind(
            "force-rotation",
            "force sensor mounted at an angle",
            "sensing",
            "forces in many directions, and motions of the slider",
            "turn the readings of the force sensor back by the angle; fit again what was fitted to them, and plan again",
            "The force sensor is turned by {angle}",
            (Parameter("angle", "rad", 0.0, -0.3, 0.3),),
        ),
        EffectKind(
            "frame-offset",
            "origin of the tracked frame away from the centre of mass",
            "sensing",
            "forces with moments, or poses of a slider that turns",
            "either move body_pose in the mapping of the import back by the offset, along the axes of the slider, and import "
            "again; or plan with the scene that stablepush correct writes, which moves start and goal; not both",
            "The tracked origin lies {offset} along x and y of the slider from the centre of mass",
            (Parameter("offset", "m in B", 0.0, -0.01, 0.01, 2),),
        ),
        EffectKind(
            "latency",
            "the slider's poses lag the pusher's and the forces",
            "sensing",
            "poses of pusher and slider at speeds that vary",
            "set pose_delay (s) in the mapping of the import to this delay, and import the log again (fingers or an arm that "
            "bend under load delay the object as well)",
            "The slider's poses lag all other readings by {delay}",
            (Parameter("delay", "s", 0.0, 0.0, 0.3, least=0.0),),
        ),
        EffectKind(
            "model-capacity",
            "the nominal surface cannot represent the measured loads and motions",
            "support",
            "forces and motions of many different pushes",
            "fit a surface to more pokes",
            "The nominal surface cannot represent the measured loads and motions",
            (
                Parameter("facets", "support points", None, 3.0, 8.0, least=3.0, most=1000.0, whole=True),
                Parameter("degree", "degree of the polynomial", None, 2.0, 6.0, least=2.0, most=6.0, whole=True),
            ),
        ),
    )


#: All effects by id, in the order of the contract.
CATALOGUE: Mapping[str, EffectKind] = MappingProxyType({kind.id: kind for kind in _kinds()})


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


def principal(ratio: float, direction: float) -> np.ndarray:
    """Friction over its mean (geometric, 2 x 2) that is ``ratio`` times as large along ``direction`` (rad) as across it."""
    c, s = math.cos(direction), math.sin(direction)
    turn = np.array(((c, -s), (s, c)))
    return np.asarray(turn @ np.diag((math.sqrt(ratio), 1 / math.sqrt(ratio))) @ turn.T)
