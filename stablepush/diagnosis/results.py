"""What a diagnosis returns, as values; :func:`as_json` makes the JSON of any of them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from stablepush.core import Word, brief
from stablepush.effects import CATALOGUE
from stablepush.objects import EdgePush


class Verdict(Word):
    """The result of a diagnosis, in one word."""

    NONE = "none", "the nominal simulation fits within the noise: nothing to correct"
    ABSORBED = "absorbed", "a refitted surface and friction fit, no other cause stands out: stablepush correct, then plan again"
    NAMED = "named", "use the corrected simulation, or remove the cause"
    AMBIGUOUS = "ambiguous", "make the pushes of next_experiment: this log cannot separate the causes"
    UNKNOWN = "unknown", "no effect of the catalogue is shown to explain the gap"


#: A channel whose errors, before and after, are no more than this times its floor has no gap to explain.
_WITHIN = 1.05


@dataclass(frozen=True, slots=True, eq=False)
class ParameterEstimate:
    """A parameter of an effect: its value, or two, each with its 95 % interval, and the unit."""

    estimate: float | list[float]
    ci95: list[Any]
    unit: str

    def __str__(self) -> str:
        value = self.estimate
        values = list(zip(value, self.ci95, strict=True)) if isinstance(value, list) else [(value, self.ci95)]
        numbers = ", ".join(f"{readable(value)} ({readable(low)} to {readable(high)})" for value, (low, high) in values)
        return f"{numbers} {re.sub('^1(, | |$)', '', self.unit)}".strip()


@dataclass(frozen=True, slots=True, eq=False)
class RankedEffect:
    """An effect of the catalogue with the probability that it acts; ``reason``: why it is not identifiable, if so."""

    effect: str
    probability: float
    parameters: Mapping[str, ParameterEstimate]
    identifiable: bool
    reason: str | None
    form: Mapping[str, Any] | None = None

    @property
    def estimates(self) -> dict[str, Any]:
        """Estimates by parameter, without their intervals."""
        return {name: parameter.estimate for name, parameter in self.parameters.items()}

    @property
    def by_terms(self) -> bool:
        """Whether only the terms of its family act. The interval of its own parameter then holds the value without the effect."""
        if self.form is None or self.effect not in CATALOGUE or not self.parameters:
            return False
        first = CATALOGUE[self.effect].parameters[0]
        bounds = np.reshape(self.parameters[first.name].ci95, (-1, 2))
        return first.nominal is not None and bool(((bounds[:, 0] <= first.nominal) & (bounds[:, 1] >= first.nominal)).all())


@dataclass(frozen=True, slots=True, eq=False)
class ChannelGap:
    """The gap in a channel as root mean squares in ``unit``: of the nominal and of the refitted simulation, and of the noise.

    ``noise_floor`` holds what rigid bodies leave by themselves, too: 1 % of a load, and of the slider's radius in a final pose.
    ``p_lack_of_fit``: how often noise alone leaves as much as the nominal simulation does.
    """

    channel: str
    unit: str
    nominal: float
    refitted: float
    noise_floor: float
    p_lack_of_fit: float


@dataclass(frozen=True, slots=True, eq=False)
class GapReduction:
    """The gap in a channel on held-out trials, root mean squares in ``unit`` before and after the correction.

    ``closed = (before² - after²)/(before² - floor²)`` with its 95 % interval. ``floor`` is what the noise explains, and no more
    than ``after`` or than 0.9995 times ``before``: where less remains, the noise was overestimated. ``noise_floor``: what
    the noise explains, as in the :class:`ChannelGap`.
    """

    channel: str
    unit: str
    held_out_trials: int
    before: float
    after: float
    floor: float
    closed: float
    ci95: list[float]
    noise_floor: float

    @property
    def within_noise(self) -> bool:
        """Whether the noise explains what remains."""
        return 0 < self.after <= self.noise_floor or self._stays_without_gap

    @property
    def _had_no_gap(self) -> bool:
        return 0 < self.before <= _WITHIN * self.noise_floor

    @property
    def _stays_without_gap(self) -> bool:
        return self._had_no_gap and 0 < self.after <= _WITHIN * self.noise_floor

    @property
    def explained(self) -> str:
        """How much of the gap is explained, in words."""
        if self._stays_without_gap:
            return "both within the noise"
        if self._had_no_gap or self.before == self.after == 0:
            return "there was nothing to explain"
        # where the gap is near the noise the interval of its share is very wide
        if self.closed < 0:
            return "explained nothing: more is left than before"
        low, high = ("less than -100" if part < -1 else f"{round(100 * part)}" for part in self.ci95)
        return f"explained {round(100 * self.closed)} % ({low} to {high})"

    @property
    def sizes(self) -> str:
        """What there was, what remains, and how much of that is noise, in words; lengths in mm."""
        if self.channel == "stability":
            # the square of an error of a label, right or wrong, is 1 or 0
            wrong = [round(size**2 * self.held_out_trials) for size in (self.before, self.after)]
            return f"{wrong[0]} of {self.held_out_trials} pushes wrongly predicted to be stable or not before, {wrong[1]} after"
        before = size_in_words(self.before, self.unit)
        after, floor = (size_in_words(value, self.unit, named=False) for value in (self.after, self.noise_floor))
        words = f"{before} before, {after} after"
        # a channel of labels, right or wrong, has no floor
        if self._stays_without_gap or self.noise_floor == 0:
            return words
        if self._had_no_gap:
            return f"{before} before, which is within the noise (floor {floor}); {after} after"
        return f"{words}, {'which is within the noise' if self.within_noise else f'floor {floor}'}"


@dataclass(frozen=True, slots=True, eq=False)
class NextExperiment:
    """Pushes that separate two effects, and why these; without pushes ``why`` says what to do instead."""

    separates: Sequence[str]
    pushes: Sequence[EdgePush]
    why: str

    def __repr__(self) -> str:
        return brief(self)


def size_in_words(value: float, unit: str, named: bool = True) -> str:
    """A root mean square of a channel, lengths in mm; with its unit if it has one and that is asked for."""
    factor, name = shown_unit(unit)
    return readable(factor * value) + (name if named else "")


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor and the name of the unit in which errors of a channel are told: final poses in mm, the rest as it is."""
    return (1000.0, " mm") if unit == "m" else (1.0, "" if unit == "1" else f" {unit}")


def readable(value: float) -> str:
    """A number with four digits, or with all that stand before its point: 12345, not 1.234e+04."""
    return f"{value:.4g}" if abs(value) < 9999.5 else f"{value:.0f}"


def as_json(value: Any) -> Any:
    """Return the JSON of a result: objects have the fields of its dataclass as keys."""
    if isinstance(value, EdgePush):
        return value.to_json()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: as_json(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(entry) for entry in value]
    return value
