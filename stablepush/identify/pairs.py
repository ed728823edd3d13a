"""Pairs of loads and slip twists: checked once, brought to one scale, and judged for what they cannot say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import (
    LARGEST_MAGNITUDE,
    LEAST_POSITIVE,
    FloatArray,
    InputError,
    brief,
    check_number,
    check_vectors,
    read_only,
)
from stablepush.geometry import normalize_twist, normalize_wrench, unit
from stablepush.objects import Slider

#: Loads below this (N) are no friction of an object on a table.
LEAST_FORCE = 1e-9
#: Loads and motions are a pure moment, or a translation, to this share.
_PURE = 1e-9
#: A factor between what pairs say and what the slider says, beyond which a unit must be wrong (the usual slips are 1000).
UNIT_SLIP = 50.0
#: A load this many times larger or smaller than the median is no load on the same surface: it is left out.
LARGEST_RATIO = 30.0
#: Pairs whose direction differs by less than this (rad) count as one.
SAME_DIRECTION = 1e-3
#: Smallest over largest singular value of unit loads, below which a warning says that a direction is undetermined.
LEAST_SPREAD = 0.05
STANDARD_GRAVITY = 9.80665
_TRANSLATION = 1e300


class SlipPairs(NamedTuple):
    """Measured loads and the slip twists that belong to them, as :meth:`stablepush.PushLog.pairs` returns them.

    ``wrenches`` (n, 3): loads ``(fx, fy, tau)`` in N and N·m; ``twists`` (n, 3): ``(vx, vy, omega)`` in m/s and rad/s, both in B;
    ``trials``: the name of the trial of each pair.
    """

    wrenches: FloatArray
    twists: FloatArray
    trials: list[str]

    def __repr__(self) -> str:
        return brief(self)


def given_pairs(wrenches: ArrayLike | SlipPairs, twists: ArrayLike | None) -> tuple[ArrayLike, ArrayLike]:
    """Return loads and twists of which a caller gives both, or :class:`SlipPairs` alone."""
    if isinstance(wrenches, SlipPairs):
        if twists is not None:
            raise InputError("twists", "expected none besides the pairs, which have them")
        return wrenches.wrenches, wrenches.twists
    if hasattr(wrenches, "pairs"):
        kind = type(wrenches).__name__
        raise InputError("wrenches", "expected loads, or pairs of loads and twists, as log.pairs() of a log", kind)
    if twists is None:
        raise InputError("twists", "expected slip twists, or pairs of loads and twists in place of the loads")
    return wrenches, twists


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Loads (n, 3), normalised and in units of ``force_scale`` (their median length, N), and unit normalised twists (n, 3)."""

    loads: FloatArray
    directions: FloatArray
    rho: float
    force_scale: float

    @classmethod
    def from_data(
        cls, wrenches: ArrayLike, twists: ArrayLike, slider: Slider | None, characteristic_length: float | None
    ) -> Pairs:
        """Check wrenches (N, N·m) and twists, and normalise them; see :func:`stablepush.fit_limit_surface` for the errors."""
        f, v = _check(wrenches, twists)
        if len(f) == 0:
            if slider is None:
                raise InputError("wrenches, twists", "expected at least one pair, or a slider")
            return cls(read_only(f), read_only(v), _characteristic_length(f, slider, characteristic_length), 1.0)
        if slider is not None:
            _check_units(f, v, slider)
        rho = _characteristic_length(f, slider, characteristic_length)
        loads = normalize_wrench(f, rho)
        force_scale = float(np.median(np.linalg.norm(loads, axis=1)))
        if not LEAST_FORCE <= force_scale <= LARGEST_MAGNITUDE:
            raise InputError(
                "wrenches", f"expected loads of {LEAST_FORCE:g} to {LARGEST_MAGNITUDE:g} N, their median is {force_scale:g} N"
            )
        return cls(read_only(loads / force_scale), read_only(unit(normalize_twist(v, rho))), rho, force_scale)

    def __len__(self) -> int:
        return len(self.loads)

    def take(self, rows: np.ndarray) -> Pairs:
        """Return some of the pairs, in the same units."""
        return Pairs(self.loads[rows], self.directions[rows], self.rho, self.force_scale)

    @property
    def usable(self) -> np.ndarray:
        """Rows (k,) whose load has a size that the median does not rule out."""
        sizes = np.linalg.norm(self.loads, axis=1)
        return np.flatnonzero((sizes > 1 / LARGEST_RATIO) & (sizes < LARGEST_RATIO))

    def warnings(self, needed: int, slider: Slider | None) -> list[str]:
        """Return warnings about what the pairs do not determine, for a model that needs ``needed`` pairs in general position."""
        warnings: list[str] = []
        if not len(self):
            return warnings
        if slider is not None and slider.mass:
            friction = self.force_scale / (slider.mass * STANDARD_GRAVITY)
            if not 1 / UNIT_SLIP < friction < UNIT_SLIP:
                warnings.append(
                    f"the median load, {self.force_scale:.3g} N, is {friction:.2g} times the slider's weight: "
                    "are forces in N and mass in kg?"
                )
        directions = unit(self.loads)
        distinct = _distinct(directions)
        if distinct < len(self):
            warnings.append(f"{len(self) - distinct} of {len(self)} pairs repeat the direction of another load")
        if distinct < needed:
            warnings.append(
                f"{distinct} different loads do not determine the surface, {needed} are needed: the penalty determines the rest"
            )
        elif (spread := np.linalg.svd(directions, compute_uv=False))[-1] < LEAST_SPREAD * spread[0]:
            warnings.append(
                "the loads lie nearly in one plane: outside it the penalty determines the surface (poke at other angles)"
            )
        opposed = int(((self.loads * self.directions).sum(axis=1) < 0).sum())
        if opposed:
            warnings.append(f"{opposed} of {len(self)} pairs have F·V < 0, impossible for friction: noise, or a wrong sign")
        return warnings


def _distinct(directions: FloatArray) -> int:
    """Count directions (n, 3) that differ from all before them; a load and its negative say the same."""
    close = np.abs(directions @ directions.T) > np.cos(SAME_DIRECTION)
    return int((~np.tril(close, -1).any(axis=1)).sum())


def _check(wrenches: ArrayLike, twists: ArrayLike) -> tuple[FloatArray, FloatArray]:
    f = check_vectors(wrenches, "wrenches", 3)
    v = check_vectors(twists, "twists", 3)
    if f.ndim != 2 or f.shape != v.shape:
        raise InputError("wrenches, twists", "expected two arrays of shape (n, 3)", f"{f.shape} and {v.shape}")
    for name, array in (("wrenches", f), ("twists", v)):
        if not array.any(axis=1).all():
            raise InputError(name, f"expected no zero rows, row {int(np.argmin(array.any(axis=1)))} is zero")
    opposed = int(((f * v).sum(axis=1) < 0).sum())
    if 2 * opposed > len(f):
        raise InputError(
            "wrenches, twists",
            f"{opposed} of {len(f)} pairs have F·V < 0; expected the load that the pusher applies, which drives the motion "
            "(is the sign of the force turned round?)",
        )
    return f, v


def _check_units(f: FloatArray, v: FloatArray, slider: Slider) -> None:
    """Refuse lever arms and rotation centres that no poke of this slider has: N·mm, mm/s, degrees a second."""
    size = slider.radius
    force, moment = np.linalg.norm(f[:, :2], axis=1), np.abs(f[:, 2])
    speed, turn = np.linalg.norm(v[:, :2], axis=1), np.abs(v[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        # forces of pure moments, and turns of translations, are rounding
        arms = np.where(force * size <= _PURE * moment, np.inf, moment / force)
        speeds = np.where(turn * size <= _PURE * speed, np.inf, speed / turn)
    # upper quartiles: a log may hold some pure rotations or translations, not mostly such
    arm = float(np.quantile(np.nan_to_num(arms, posinf=0.0), 0.75))
    if arm > UNIT_SLIP * size:
        raise InputError(
            "wrenches",
            f"a quarter of the moments act with lever arms above {arm:.3g} m on a slider of radius {size:.3g} m; "
            "expected N·m (are they N·mm, or the outline in another unit?)",
        )
    low = float(np.quantile(np.nan_to_num(speeds, nan=0.0, posinf=_TRANSLATION), 0.25, method="lower"))
    if UNIT_SLIP * size < low < _TRANSLATION:
        raise InputError(
            "twists",
            f"three quarters of the rotation centres are farther than {low:.3g} m from a slider of radius {size:.3g} m; "
            "expected m/s and rad/s (are they mm/s?)",
        )


def _characteristic_length(f: FloatArray, slider: Slider | None, given: float | None) -> float:
    if given is not None:
        return check_number(given, "characteristic_length", positive=True)
    if slider is not None:
        return slider.characteristic_length
    force = float(np.sqrt((f[:, :2] ** 2).sum(axis=1).mean()))
    torque = float(np.sqrt((f[:, 2] ** 2).mean()))
    if torque * np.sqrt(2) < LEAST_POSITIVE * force or torque * np.sqrt(2) > LARGEST_MAGNITUDE * force:
        raise InputError("characteristic_length", "expected a value or a slider, as the pairs lack forces or torques")
    return float(np.sqrt(2) * torque / force)
