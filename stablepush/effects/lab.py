"""Effects of a lab's own, beside the catalogue: what a sensor reads with them, and where that shows.

Friction that follows the humidity of the room, play in the mount of a tool: a lab knows what its rig may have. Such an effect is
one class, given to :func:`stablepush.diagnose` or registered as an entry point of the group ``stablepush.effects``.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError, StablepushWarning, UnavailableError, load_plugin, plugin_names, what_failed
from stablepush.effects.catalogue import CATALOGUE
from stablepush.effects.kind import EffectKind, LogRows, Parameter, RigBounds, TouchingRows

#: What to do about an effect of a lab's own.
LAB_REMEDY = "remove its cause, or model it in your own simulation: stablepush correct cannot take it into account"
#: Entry points of packages, and what an effect may act on.
_GROUP = "stablepush.effects"
_ACTS = ("support", "sensing")


class LabEffect:
    """An effect that the catalogue does not have.

    Derive from it, set the attributes, and say what the effect changes: the loads that are read, the clearances between fingers
    and outline, or both. The values of the parameter are fitted, zero being no effect.

    Attributes
    ----------
    id : str
        A word of its own, like ``"humidity"``.
    what, needs : str
        What it is, and what a log must hold to show it; in words.
    parameter : Parameter
        Its parameter, zero without the effect: name, unit, and ``low`` to ``high``, the range in which rigs are found.
    acts : {"support", "sensing"}
        On what the table does to the slider, or on what the sensors read of it.
    remedy : str
        What to do once it is named; if it is not given, to remove its cause.
    """

    id: str
    what: str
    needs: str
    parameter: Parameter
    acts: str = "support"
    remedy: str = ""

    def wrench(self, rows: LogRows, wrench: FloatArray, value: FloatArray) -> FloatArray:
        """Return the loads (n, 3) that are read in the tracked frame, of those without the effect; linear in these, but for a
        constant."""
        return wrench

    def clearance(self, rows: LogRows, finger: int, value: FloatArray) -> FloatArray:
        """Return how much (n,) in m the clearance of finger 0 or 1 is changed: its centre's distance from the outline less its
        radius; NaN where that is unknown. Linear in the value."""
        return np.zeros(len(rows.time))


class _OfLab(EffectKind):
    """A lab's effect as one that is fitted like those of the catalogue: whatever else its class holds is its own."""

    of_lab = in_clearances = True
    _effect: LabEffect

    def __init__(self, effect: LabEffect) -> None:
        parameter = replace(effect.parameter, nominal=0.0)
        own: dict[str, Any] = {
            "id": effect.id, "what": effect.what, "acts": effect.acts, "needs": effect.needs, "unseen": effect.needs,
            "remedy": effect.remedy, "parameters": (parameter,), "size": parameter.size,
            # half of the range in which its parameter is found
            "plausible": (parameter.high - parameter.low) / 2,
        }  # fmt: skip
        vars(self).update(own, _effect=effect)

    @property
    def description(self) -> dict[str, Any]:
        words = {"what": f"{self.what}; of an installed package", "remedy": self.remedy or LAB_REMEDY}
        return {key: value for key, value in (super().description | words).items() if key != "says"}

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        return np.clip(value, self.parameters[0].least, self.parameters[0].most)

    def wrench(self, rows: LogRows, wrench: FloatArray, value: FloatArray) -> FloatArray:
        return self._effect.wrench(rows, wrench, value)

    def clearance(self, rows: LogRows, finger: int, value: FloatArray) -> FloatArray:
        """Return how much (n,) in m the effect changes the clearance of finger 0 or 1."""
        return self._effect.clearance(rows, finger, value)

    def clearance_slope(self, touch: TouchingRows, value: FloatArray) -> FloatArray:
        units = np.eye(self.size)
        changes = [self.clearance(touch.rows, touch.finger, unit)[touch.chosen] for unit in units]
        return np.nan_to_num(np.column_stack(changes))


def lab_effects(given: Sequence[LabEffect] = ()) -> dict[str, _OfLab]:
    """Return effects by id: those that packages registered, and those that are given.

    Raises :class:`InputError` for one that is given and is none, has no name of its own, or nothing to be fitted. One that a
    package registered is then left out, and so is one that cannot be loaded: a :class:`StablepushWarning` says which.
    """
    found: dict[str, _OfLab] = {}
    for name in plugin_names(_GROUP):
        try:
            entry = load_plugin(_GROUP, name)
            effect = _checked(entry() if isinstance(entry, type) else entry, name, found)
        # whatever goes wrong in another's package is its own: other logs, and other effects, are no worse for it
        except Exception as error:
            words = str(error) if isinstance(error, (InputError, UnavailableError)) else what_failed(error)
            warnings.warn(StablepushWarning(f"the registered effect {name} is left out: {words}"), stacklevel=2)
        else:
            found[effect.id] = effect
    own: dict[str, _OfLab] = {}
    for number, one in enumerate(given):
        effect = _checked(one, f"effects[{number}]", own)
        own[effect.id] = effect
    # what is given takes the place of what is installed under the same id
    return found | own


def _checked(effect: object, place: str, others: Mapping[str, _OfLab]) -> _OfLab:
    """The effect as it is fitted, if it is one."""
    if not isinstance(effect, LabEffect):
        got = "a class, not an object of it" if isinstance(effect, type) else type(effect).__name__
        raise InputError(place, "expected a LabEffect", got)
    id = getattr(effect, "id", "")
    if not id or id in CATALOGUE or id in others:
        raise InputError(place, "expected an id of its own", repr(id))
    for name in ("what", "needs", "remedy"):
        if not isinstance(getattr(effect, name, None), str):
            raise InputError(place, f"expected {name}, in words", "none")
    if not isinstance(getattr(effect, "parameter", None), Parameter):
        raise InputError(place, "expected a parameter, a stablepush.effects.Parameter", "none")
    if effect.acts not in _ACTS:
        raise InputError(place, f"expected acts {' or '.join(_ACTS)}", repr(effect.acts))
    if not effect.parameter.low < effect.parameter.high:
        raise InputError(place, "expected a parameter with a range, low < high")
    if not effect.parameter.least <= 0 <= effect.parameter.most:
        raise InputError(place, "expected a parameter that may be 0, which is no effect")
    return _OfLab(effect)


def applicable(effects: Mapping[str, _OfLab], rows: LogRows, asked: Sequence[str]) -> tuple[dict[str, _OfLab], dict[str, str]]:
    """Return the effects that a log can be asked about, and what it lacks for others. Those that packages registered are
    left out, with a :class:`StablepushWarning` if that is not for want of a column.

    Raises :class:`InputError` for one that was asked for, if the log lacks a column that it reads, or if what it returns has
    another shape, is not finite where the log is, or changes anything at 0.
    """
    found: dict[str, _OfLab] = {}
    lacking: dict[str, str] = {}
    known = np.isfinite(rows.wrench).all(axis=1)
    wrench = np.nan_to_num(rows.wrench)
    for id, effect in effects.items():
        small, got, missing = np.full(effect.size, 0.01 * effect.plausible), "", False
        try:
            read, without = (np.asarray(effect.wrench(rows, wrench.copy(), value)) for value in (small, 0 * small))
            touch = [np.asarray(effect.clearance(rows, finger, 0 * small)) for finger in (0, 1)]
            shapes = [one.shape for one in (read, without) if one.shape != rows.wrench.shape]
            shapes += [one.shape for one in touch if one.shape != rows.wrench.shape[:1]]
            if shapes:
                got = f"shape {shapes[0]}"
            elif not np.isfinite(read[known]).all():
                got = "numbers that are not finite"
            elif not np.allclose(without[known], wrench[known]) or any(np.nan_to_num(one).any() for one in touch):
                got = "a change where its parameter is 0"
        except KeyError as error:
            missing, got = True, f"no column {error.args[0]!r} in trials.csv"
        # a mistake in somebody's effect is told by its name, whatever it is
        except Exception as error:
            got = what_failed(error)
        if not got:
            found[id] = effect
        elif id in asked:
            raise InputError(f"effect {id}", f"expected finite loads {rows.wrench.shape} of a log with {effect.needs}", got)
        elif missing:
            lacking[id] = f"{effect.needs}: {got}"
        else:
            warnings.warn(StablepushWarning(f"the registered effect {id} is left out, it gives {got}"), stacklevel=2)
    return found, lacking
