"""Exceptions of the library: one root, and messages of one line."""

from __future__ import annotations


class StablepushError(Exception):
    """Root of every error that the library raises on purpose."""


class StablepushWarning(UserWarning):
    """Root of every warning that the library gives on purpose."""


class PlausibilityWarning(StablepushWarning):
    """Input that is valid and looks like a mistake: another unit, a key that nothing reads; the message names the place."""


class PlanWarning(StablepushWarning):
    """A plan that is less certain than was asked for; the message gives the number."""


class InputError(StablepushError, ValueError):
    """Input that breaks a format or a physical rule; the message names the place and what was expected."""


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
