"""What an effect is: the interface that the catalogue's effects and a lab's own share, one file each in :mod:`.kinds`.

The parameters *as they are fitted* are zero without the effect. Of most effects they are those of the catalogue; of an anisotropy
they are two lobes, of a size a difference.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from stablepush.core import LARGEST_MAGNITUDE, FloatArray, InputError

if TYPE_CHECKING:
    from stablepush.mechanics import Pusher, PushTrace
    from stablepush.objects import Slider
    from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Speed (m/s) at which friction that depends on speed is nominal.
REFERENCE_SPEED = 0.02
#: Unit (m) of places in the terms of families, and logarithms of speed beyond which terms do not grow further, below and above.
PLACE, SLOWEST, FASTEST = 0.15, -2.5, 1.5
#: Bound on the terms of families in fits, over half of their plausible range.
_FAR = 4.0
#: Steps of differences by the terms of a family, over half of their plausible range: small beside it, large beside rounding.
_SMALL_TERM = 0.05
#: Effects count from this share of half of their plausible range.
_LEAST = 0.03


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect.

    ``size`` numbers; ``nominal`` value of each (None: that of the rig), and the range ``low`` to ``high`` in which rigs are
    found; ``least`` and ``most``: values beyond are invalid; ``above``: so is ``least`` itself; ``whole``: only whole numbers are
    valid.
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
        """Refuse an invalid value."""
        low = value <= self.least if self.above else value < self.least
        if math.isfinite(value) and not low and value <= self.most and (float(value).is_integer() or not self.whole):
            return
        floor = "" if self.least <= -LARGEST_MAGNITUDE else f" {'>' if self.above else '>='} {self.least:g} and"
        kind = "whole number" if self.whole else "number"
        unit = "" if self.unit in ("1", "support", "degree") else f" ({self.unit})"
        raise InputError(self.name, f"expected a {kind}{unit}{floor} <= {self.most:g}", f"{value:g}")


@dataclass(frozen=True, slots=True)
class Family:
    """Terms that may be added to the form of an effect: reality does not know the catalogue's formulas.

    ``covariate``: what the effect depends on; ``terms``: in words, one for each coefficient; ``unit`` of the coefficients;
    ``plausible``: half of the range in which they are found.
    """

    covariate: str
    terms: tuple[str, ...]
    unit: str
    plausible: float


@dataclass(frozen=True, slots=True, eq=False)
class LogRows:
    """The rows (n,) of a log that a diagnosis compares, as an effect sees them.

    Attributes
    ----------
    columns : mapping of str to array, shape (n,)
        The columns of ``trials.csv``, for each row that of its trial: numbers where all are, else words.
    time, order : array, shape (n,)
        In s, in the trial; and the place of the trial in the log, from 0 to 1.
    pose, twist, pusher : array, shape (n, 3)
        Of the tracked frame in W; its body twist; and the pose of the pusher in W, NaN where it is not known.
    wrench : array, shape (n, 3)
        The load as it was measured, in the tracked frame; NaN where there is none.
    normal : array, shape (n, 2, 2)
        Inward normals of the outline at the fingers, in B; NaN where a finger does not touch.
    """

    columns: Mapping[str, np.ndarray]
    time: FloatArray
    order: FloatArray
    pose: FloatArray
    twist: FloatArray
    pusher: FloatArray
    wrench: FloatArray
    normal: FloatArray


class TouchingRows(NamedTuple):
    """Rows (m,) in which a finger touches: numbers ``chosen`` of those of the log; inward normals (m, 2) in B; velocity (m, 2)
    of the slider's point there and its rate of change; whether the finger may have another radius (1 or 0); place in the log."""

    rows: LogRows
    finger: int
    chosen: np.ndarray
    normal: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    off: float
    order: FloatArray


class RigBounds(NamedTuple):
    """What of a rig and its log bounds effects: radius (m), mass (kg, None if unknown) of the slider, friction of the support, of
    the fingers their radius (m), the longest push (s), and places (n, 2) of the slider in W."""

    radius: float
    mass: float | None
    support_friction: float | None
    finger_radius: float | None
    longest_push: float
    places: FloatArray


class ReplayedPush(Protocol):
    """A push that is simulated again: place in the log (0 to 1), whether its path was logged, and the pusher, thicker by m."""

    @property
    def order(self) -> float: ...
    @property
    def logged(self) -> bool: ...
    def thicker(self, change: float) -> Pusher: ...


class PushSetup(NamedTuple):
    """Where the slider starts (pose in W), the pusher, and its friction."""

    start: FloatArray
    pusher: Pusher
    mu: float


class EffectKind:
    """An effect: what it is, what it does to a simulation, and how it is found.

    Attributes
    ----------
    number : int
        Place in the catalogue.
    id, what : str
    acts : str
        On the ``"support"``, by ``"inertia"``, on the ``"contact"``, or on what is read: ``"sensing"``.
    needs, unseen : str
        What a log must hold to show it, and why a log does not.
    remedy, says : str
        What to do once it is named, and a sentence about its parameters, by name.
    parameters : tuple of Parameter
    size : int
        Numbers that are fitted; 0 if it is never fitted.
    plausible, small, least : float
        Half of the range of these numbers, a step of differences, and the least size that matters, over ``plausible``.
    family : Family or None
    slots, term_slots : tuple of int or None
        Where the compiled readings take its numbers and those of its family; None if it changes no reading there.
    in_clearances : bool
        Whether it shows in the distances between fingers and outline.
    pose_step : float
        A step of its numbers that counts as small where pushes are simulated again; 0 if it does not move the slider.
    reshapes : str
        ``"pressure"`` for effects that a refitted pressure takes in, ``"body"`` for others that only change the shape of the
        limit surface, else blank.
    pulls : bool
        Whether it pulls the slider, along the numbers (2,) of its parameter in W.
    on_points : bool
        Whether it changes the friction of points under the slider.
    moves_center, moves_tracker, two_lobed, depends_on_speed, by_slip, of_radius, of_axes, of_lab, per_log, varies : bool
        A pressure whose centre moves; a tracked origin that does; friction that depends on direction, or on speed; friction of
        the fingers, which shows where they slip; their radius; axes of the force sensor; effect of a lab's own; one that each of
        several logs has of its own; one that may differ between logs.
    rank : int
        Of effects that act on one thing those of lower rank act first (:func:`in_order`).
    systematic : float
        Share of an estimate that it may be off beside its scatter, since rows are means over parts of pushes.
    curve : str
        What friction is a function of, for pictures: ``"direction in W"``, ``"speed"``, … ; blank if none.
    shows_in : str
        The channel that it acts on: ``"wrench"`` or ``"pose"``.
    import_key : str
        Key of an import's mapping that takes it off, blank if none does.
    changes_plans, planned : bool
        Whether other pushes may be stable with it; whether planners take it into account.
    instead : str
        Which part of a scene holds it, where that is none of ``effects``.
    needs_weight : bool
        Whether it acts on the slider's weight or mass.
    engines, not_in_models : tuple of str
        Engines that can have it on a rig, and those for which no model is written that has it.
    """

    number: int = 1000
    id: str = ""
    what: str = ""
    acts: str = "support"
    needs: str = ""
    unseen: str = ""
    remedy: str = ""
    says: str = ""
    parameters: tuple[Parameter, ...] = ()
    size: int = 0
    plausible: float = 1.0
    small: float = 0.0
    least: float = _LEAST
    family: Family | None = None
    slots: tuple[int, int] | None = None
    term_slots: tuple[int, int] | None = None
    in_clearances: bool = False
    pose_step: float = 0.0
    reshapes: str = ""
    on_points: bool = False
    moves_center: bool = False
    moves_tracker: bool = False
    two_lobed: bool = False
    depends_on_speed: bool = False
    by_slip: bool = False
    rank: int = 0
    pulls: bool = False
    of_radius: bool = False
    of_axes: bool = False
    of_lab: bool = False
    per_log: bool = False
    varies: bool = False
    systematic: float = 0.01
    curve: str = ""
    shows_in: str = "wrench"
    import_key: str = ""
    planned: bool = False
    instead: str = ""
    engines: tuple[str, ...] = ()
    not_in_models: tuple[str, ...] = ()
    needs_weight: bool = False

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an effect never changes: {name} of {self.id}")

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id}>"

    @property
    def changes_plans(self) -> bool:
        """Whether other pushes may be stable with it. Effects of the sensors leave them as they are."""
        return self.acts != "sensing"

    @property
    def in_loads(self) -> bool:
        """Whether it changes the loads that are read."""
        return self.slots is not None or self.reads_otherwise

    @property
    def reads_otherwise(self) -> bool:
        """Whether :meth:`wrench` says what it changes of the loads, where no compiled reading does."""
        return type(self).wrench is not EffectKind.wrench

    @property
    def description(self) -> dict[str, Any]:
        """What the catalogue says of it, as JSON."""
        return {
            "id": self.id, "what": self.what, "acts": self.acts, "needs": self.needs, "remedy": self.remedy, "says": self.says,
            "parameters": [asdict(parameter) for parameter in self.parameters],
        }  # fmt: skip

    # what it does

    def table_fields(self, numbers: Mapping[str, Sequence[float]], weight: float, gyration: float) -> dict[str, Any]:
        """Return fields of :class:`stablepush.mechanics.TableFriction`; ``weight`` (N) and radius of ``gyration`` (m) of the
        slider."""
        return {}

    def pressed(self, points: FloatArray, center: FloatArray, numbers: Mapping[str, Sequence[float]]) -> FloatArray:
        """Return where support points (k, 2) in B are with it; ``center``: of the nominal pressure."""
        return points

    def other_shape(
        self,
        slider: Slider,
        surface: LimitSurface,
        numbers: Mapping[str, Sequence[float]],
        load: float,
        points: IdealLimitSurface | None,
    ) -> tuple[LimitSurface, float]:
        """Return the surface that the support follows instead of the nominal one, and the newtons in the unit of its forces."""
        return surface, load

    def require_on(self, slider: Slider, center: FloatArray, numbers: Mapping[str, Sequence[float]]) -> None:
        """Refuse numbers that this slider, with a ``center`` (2,) of pressure in B, cannot have."""

    def at_start(self, setup: PushSetup, push: ReplayedPush, value: FloatArray) -> PushSetup:
        """Return how a push begins with it."""
        return setup

    def at_end(self, end: FloatArray, trace: PushTrace, push: ReplayedPush, value: FloatArray) -> FloatArray:
        """Return the final pose (3,) as it is tracked."""
        return end

    def wrench(self, rows: LogRows, wrench: FloatArray, value: FloatArray) -> FloatArray:
        """Return the loads (n, 3) that are read in the tracked frame, of those without the effect; linear in these, but for a
        constant."""
        return wrench

    def clearance_slope(self, touch: TouchingRows, value: FloatArray) -> FloatArray:
        """Return the derivatives (m, size) of the distances between fingers and outline."""
        return np.zeros((len(touch.chosen), self.size))

    def at_rest(self, late: FloatArray, heading: FloatArray) -> FloatArray:
        """Return the derivatives (m, 2, q) of what a sensor reads that touches nothing; ``late``: place in the log less a half;
        ``heading`` (m,) of the tool. Without columns if it reads nothing then."""
        return np.zeros((len(late), 2, 0))

    # how it is fitted and told

    def numbers(self, value: FloatArray) -> dict[str, Sequence[float]]:
        """Return the numbers of its parameters by name, of those that are fitted."""
        return {self.parameters[0].name: value[: self.size].tolist()}

    def largest(self, bounds: RigBounds) -> float:
        """Return the largest size that a rig can have."""
        return math.inf

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        """Return its own numbers (size,), of no more than the largest size, within what is valid."""
        return value

    def clipped(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        """Return its numbers, and those of its family behind them, within what a rig can have."""
        own, terms = value[: self.size], value[self.size :]
        size, most = float(np.linalg.norm(own)), self.largest(bounds)
        own = self.limited(own * (most / size) if size > most else own, bounds)
        if len(terms) and self.family is not None:
            far = _FAR * self.family.plausible
            terms = np.clip(terms, -far, far)
        return np.concatenate((own, terms))

    def is_possible(self, own: FloatArray) -> bool:
        """Whether numbers (size,) have the sign that the effect must have."""
        return True

    def step(self, k: int) -> float:
        """Return a step of differences in the number ``k`` of its own and its family's."""
        if k < self.size and self.small:
            return self.small
        plausible = self.family.plausible if k >= self.size and self.family is not None else self.plausible
        return _SMALL_TERM * plausible

    def estimates(self, value: FloatArray, errors: FloatArray) -> dict[str, tuple[Any, Any, Any]]:
        """Return estimate, lower and upper end of the 95 % interval of each parameter; ``errors``: standard errors of the fit."""
        parameter = self.parameters[0]
        origin = parameter.nominal or 0.0
        ends = (np.clip(value + origin + k * errors, parameter.least, parameter.most).tolist() for k in (0.0, -1.96, 1.96))
        found = tuple(end[0] if len(end) == 1 else end for end in ends)
        return {parameter.name: (found[0], found[1], found[2])}

    def where_pushed(self, estimates: Mapping[str, Any], terms: Sequence[float], places: FloatArray) -> str:
        """Return what it is at the places (n, 2) of the pushes, in words, if its parameters are those of another place."""
        return ""

    def remedy_in_form(self) -> str:
        """Return the remedy where it acts in another form than the catalogue's; blank if that is the same."""
        return ""

    def import_value(self, estimates: Mapping[str, Any], was: Any) -> str:
        """Return what to write for :attr:`import_key`, which ``was`` that (None: nothing) when the log was imported."""
        return ""


def in_order(kinds: Iterable[EffectKind]) -> list[EffectKind]:
    """Return effects in the order in which they act."""
    return sorted(kinds, key=lambda kind: kind.rank)
