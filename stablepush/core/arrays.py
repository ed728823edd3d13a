"""Checks that turn what a caller passes into clean float64 arrays."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stablepush.core.errors import InputError
from stablepush.core.words import did_you_mean

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: Largest magnitude (SI units) that any quantity may have: beyond it lies a slip of units, not an object on a table.
LARGEST_MAGNITUDE = 1e6
#: Least magnitude (SI units) that what has to be positive may have: lengths, masses and loads divide, and less overflows.
LEAST_POSITIVE = 1e-9


def check_array(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return ``value`` as a finite float64 array whose trailing shape is ``shape`` (``None`` matches any length)."""
    array = _as_float(value, name)
    if array.ndim != len(shape) or any(want is not None and have != want for have, want in zip(array.shape, shape, strict=True)):
        raise InputError(name, f"expected shape {_shape_text(shape)}", _shape_text(array.shape))
    return _check_magnitude(array, name)


def check_vectors(value: ArrayLike, name: str, length: int) -> FloatArray:
    """Return ``value`` as a finite float64 array of shape (..., length)."""
    array = _as_float(value, name)
    if array.ndim == 0 or array.shape[-1] != length:
        raise InputError(name, f"expected shape (..., {length})", _shape_text(array.shape))
    if not np.isfinite(array).all():
        raise InputError(name, "expected finite numbers", array[~np.isfinite(array)][0])
    return array


def check_number(
    value: Any,
    name: str,
    *,
    at_least: float | None = None,
    positive: bool = False,
    largest: float = LARGEST_MAGNITUDE,
) -> float:
    """Return ``value`` as a finite float within the given limits; a positive one is at least :data:`LEAST_POSITIVE`."""
    if isinstance(value, (bool, str, bytes)):
        raise InputError(name, "expected a number", repr(value))
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(name, "expected a number", type(value).__name__) from None
    except OverflowError:
        number = np.inf
    if not np.isfinite(number):
        raise InputError(name, "expected a finite number", number)
    if abs(number) > largest:
        raise InputError(name, f"expected a magnitude of at most {largest:g} (SI units)", f"{number:g}")
    if at_least is not None and number < at_least:
        raise InputError(name, f"expected a number >= {at_least:g}", f"{number:g}")
    if positive and number < LEAST_POSITIVE:
        raise InputError(name, f"expected a number > 0{f', at least {LEAST_POSITIVE:g}' if number > 0 else ''}", f"{number:g}")
    return number


def check_zero_or_positive(value: Any, name: str) -> float:
    """Return ``value`` as a float that is zero, for none of it, or large enough to divide by."""
    number = check_number(value, name, at_least=0.0)
    if 0 < number < LEAST_POSITIVE:
        raise InputError(name, f"expected 0 or at least {LEAST_POSITIVE:g}", f"{number:g}")
    return number


def check_share(value: Any, name: str) -> float:
    """Return ``value`` as a float from 0 to 1."""
    share = check_number(value, name)
    if not 0 <= share <= 1:
        raise InputError(name, "expected a share from 0 to 1", f"{share:g}")
    return share


def check_choice(value: Any, name: str, choices: Iterable[str]) -> str:
    """Return ``value``, which must be one of some words."""
    words = tuple(choices)
    if value not in words:
        raise InputError(name, f"expected one of {', '.join(words)}", f"{value!r}{did_you_mean(value, words)}")
    return str(value)


def check_count(value: object, name: str, most: int, least: int = 1) -> int:
    """Return a whole number from ``least`` to ``most``, or say what is wrong."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise InputError(name, f"expected a whole number from {least} to {most}", repr(value))
    return int(value)


def check_sense(sense: ArrayLike) -> FloatArray:
    """Return ``sense`` as an array of +1 (counter-clockwise) and -1 (clockwise)."""
    array = _as_float(sense, "sense")
    if not np.isin(array, (-1.0, 1.0)).all():
        raise InputError("sense", "expected +1 (counter-clockwise) or -1 (clockwise)")
    return array


def order_with_ties(values: ArrayLike, tolerance: float) -> NDArray[np.intp]:
    """Return the order (n,) that sorts values, the least first; those within ``tolerance`` of a neighbour keep the order given.

    Which of two equal candidates comes first must not hang on rounding, which differs from processor to processor.
    """
    v = np.asarray(values, dtype=np.float64)
    order = np.argsort(v, kind="stable")
    with np.errstate(invalid="ignore"):  # infinity less infinity
        group = np.concatenate(((0,), np.cumsum(np.diff(v[order]) > tolerance)))[: len(v)]
    return order[np.lexsort((order, group))]


def first_least(values: ArrayLike, tolerance: float) -> int:
    """Return the first index whose value is within ``tolerance`` of the least; NaN counts for infinity."""
    v = np.nan_to_num(np.asarray(values, dtype=np.float64), nan=np.inf, posinf=np.inf, neginf=-np.inf)
    return int(np.argmax(v <= v.min() + tolerance))


def read_only(array: FloatArray) -> FloatArray:
    """Return a copy of ``array`` that cannot be written."""
    frozen = np.array(array, dtype=np.float64, copy=True)
    frozen.flags.writeable = False
    return frozen


def _as_float(value: ArrayLike, name: str) -> FloatArray:
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "fiu" and raw.size:
            raise TypeError
        return raw.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(name, "expected an array of numbers") from None


def _check_magnitude(array: FloatArray, name: str) -> FloatArray:
    if not np.isfinite(array).all():
        raise InputError(name, "expected finite numbers", array[~np.isfinite(array)][0])
    if array.size and np.abs(array).max() > LARGEST_MAGNITUDE:
        raise InputError(name, f"expected magnitudes of at most {LARGEST_MAGNITUDE:g} (SI units)", f"{np.abs(array).max():g}")
    return array


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("n" if length is None else str(length) for length in shape) + ")"


def check_seed(seed: Any, name: str = "seed") -> int:
    """Return a seed for numpy's generators."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**32:
        raise InputError(name, "expected a whole number from 0 to 4294967295", repr(seed))
    return int(seed)
