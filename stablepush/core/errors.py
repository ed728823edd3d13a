"""Exceptions of the library: one root, and messages of one line."""

from __future__ import annotations

from typing import Self

from stablepush.core.shown import shown

#: Characters of a path and of a sentence that are shown at most.
_PATH, _WORDS = 4096, 2000


class StablepushError(Exception):
    """Root of every error that the library raises on purpose."""


class StablepushWarning(UserWarning):
    """Root of every warning that the library gives on purpose."""


class PlausibilityWarning(StablepushWarning):
    """Input that is valid and looks like a mistake: another unit, a key that nothing reads.

    Parameters
    ----------
    place : str
        The argument, key, or row and column; empty where the text says it.
    doubt : str
        What looks wrong.
    file : str, optional
        The file that was read.
    """

    def __init__(self, place: str, doubt: str, *, file: object = "") -> None:
        super().__init__(place, doubt)
        self.place, self.doubt, self.file = place, doubt, str(file)

    def __str__(self) -> str:
        return ": ".join(filter(None, (shown(self.file, _PATH), shown(self.place), shown(self.doubt, _WORDS))))


class PlanWarning(StablepushWarning):
    """A plan that is less certain than was asked for; the message gives the number."""


class InputError(StablepushError, ValueError):
    """Input that breaks a format or a physical rule. As text: ``file: place: expected, got``.

    Parameters
    ----------
    place : str
        The argument, option, key, or row and column; empty where the text says it.
    expected : str
        What was expected, or what is wrong.
    got : object, optional
        What was found instead.
    file : str, optional
        The file that was read, or was to be written.
    """

    def __init__(self, place: str, expected: str | None = None, got: object = None, *, file: object = "") -> None:
        # a single text is all that there is to say
        place, expected = ("", place) if expected is None else (place, expected)
        super().__init__(place, expected, got)
        self.place, self.expected, self.got, self.file = place, expected, got, str(file)

    def __str__(self) -> str:
        text = ": ".join(filter(None, (shown(self.file, _PATH), shown(self.place), shown(self.expected, _WORDS))))
        return text if self.got is None else f"{text}, got {shown(self.got)}"

    def within(self, place: str = "", *, file: object = "") -> Self:
        """Return the same error as seen from further out: its place lies within ``place``, its input in ``file``."""
        return type(self)(": ".join(filter(None, (place, self.place))), self.expected, self.got, file=self.file or file)


class EffectError(InputError):
    """An effect that cannot be on a rig, or is too strong for it."""


class ConvergenceError(StablepushError, ArithmeticError):
    """An iteration did not reach its tolerance, as happens on surfaces that are not convex."""


class SolverError(StablepushError, RuntimeError):
    """An optimisation back end failed; the message carries its status."""


class OutOfTimeError(StablepushError, TimeoutError):
    """A deadline passed in the middle of a computation."""


class UnsupportedContactError(StablepushError, ValueError):
    """A method does not cover this arrangement of contacts."""


class UnavailableError(StablepushError, ImportError):
    """A package that this needs is not installed, or not made for this platform."""
