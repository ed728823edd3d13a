"""Doubts about valid values that look like another unit: millimetres for metres, grams for kilograms, degrees for radians.

Each function warns with :class:`~stablepush.PlausibilityWarning`, which names place, value and likely unit.
The limits lie well beyond what is pushed over a table, and well below the same thing in the next unit.
"""

from __future__ import annotations

import math
import sys
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core.errors import PlausibilityWarning

#: Farthest that an object is pushed, in its radii.
_FARTHEST = 200.0
#: A tolerance of the position is no more than this, in radii of the slider.
_LOOSE = 5.0
#: Parts that belong to an object (pusher, support, contacts) are no farther from its origin than this, in its radii.
_NEAR = 10.0
#: Largest mass (kg/m²) over an area: 0.4 m of steel has 3,100.
_LARGEST_AREAL_MASS = 4_000.0
#: Largest speeds (m/s, rad/s) of a thrown body.
_FASTEST_SLIDE, _FASTEST_TURN = 20.0, 60.0
#: Largest heading (rad): two turns.
_LARGEST_HEADING = 4 * math.pi
#: Largest tolerance and margin (rad).
_LARGEST_TOLERANCE, _LARGEST_MARGIN = 1.0, math.pi / 2
#: Share of the slider's radius that the centre of pressure may be from the centre of mass: feet are never quite even.
_ASIDE = 0.2
#: Largest standard deviations of a row: position (m), angle (rad).
_NOISY_POSITION, _NOISY_ANGLE = 0.02, 0.1
#: Largest coefficient of friction; beyond, it is an angle.
_LARGEST_FRICTION = 5.0
#: Longest delay (s) of a sensor.
_LONGEST_DELAY = 5.0
#: Rotation centres farther than this many characteristic lengths are all but translations; a list has few of them.
#: A finger that is no deeper (m) in the slider than this is taken to touch it.
_LEAST_DEPTH = 5e-4
#: Farther than this they are translations, and meant.
_FAR_COR, _TRANSLATION = 100.0, 1e4


class _Limit(NamedTuple):
    """The largest plausible value (of arrays: the largest size), its unit, and the unit that a larger one is likely in."""

    most: float
    unit: str
    likely: str
    factor: float
    what: str = ""

    def __call__(self, value: ArrayLike, place: str) -> None:
        """Doubt a value beyond the limit."""
        size = float(np.abs(value).max(initial=0.0))
        if size > self.most:
            _note(place, f"{self.what}{size:.4g} {self.unit} looks like {self.likely} ({size * self.factor:.4g} {self.unit})")


#: The radius of an object (5 mm, taken for metres, is beyond), coordinates in the world, the distance from a flange to its
#: fingers, the radius of a finger, the speed of a quasi-static push, the longest time in a trial, and the angle at which a sensor
#: is mounted, which is no more than half a turn.
note_size = _Limit(3.0, "m", "millimetres", 1e-3, "a radius of ")
note_scene = _Limit(500.0, "m", "millimetres", 1e-3)
note_tool = _Limit(5.0, "m", "millimetres", 1e-3)
note_finger = _Limit(0.5, "m", "millimetres", 1e-3)
note_push_speed = _Limit(2.0, "m/s", "millimetres per second", 1e-3)
note_time = _Limit(3600.0, "s", "milliseconds", 1e-3)
note_mounting = _Limit(math.pi, "rad", "degrees", math.pi / 180)


def note_mass(mass: float, area: float, place: str) -> None:
    """Doubt a mass (kg) over the area (m²) that it stands on."""
    if mass > _LARGEST_AREAL_MASS * area:
        _note(place, f"{mass:.4g} kg looks like grams ({mass / 1000:.4g} kg)")


def note_distance(distance: float, radius: float, place: str) -> None:
    """Doubt how far (m) an object of a radius (m) is to be pushed."""
    if distance > _FARTHEST * radius:
        _note(
            place,
            f"{distance:.4g} m, {distance / radius:.3g} radii of the slider, looks like millimetres ({distance / 1000:.4g} m)",
        )


def note_part(points: ArrayLike, radius: float, place: str) -> None:
    """Doubt points (n, 2) in m of what belongs to a slider of a radius (m)."""
    farthest = float(np.linalg.norm(np.asarray(points, dtype=np.float64), axis=-1).max(initial=0.0))
    if farthest > _NEAR * radius:
        _note(place, f"a point {farthest:.4g} m off, with a slider of radius {radius:.4g} m, looks like millimetres")


def note_off_outline(distance: float, place: str) -> None:
    """Doubt a contact point that is ``distance`` (m) from the outline of the slider that it touches."""
    if distance > _LEAST_DEPTH:
        _note(place, f"a contact point {1000 * distance:.3g} mm from the slider's outline")


def note_overlap(depth: float, radius: float, place: str) -> None:
    """Doubt a finger that would stand ``depth`` (m) inside of the slider that it touches, by an inner corner or a thin part."""
    if depth > _LEAST_DEPTH:
        _note(
            place, f"a finger of radius {1000 * radius:.3g} mm would stand {1000 * depth:.2g} mm inside of the slider beside it"
        )


def note_pressure(center: ArrayLike, radius: float, place: str) -> None:
    """Doubt a centre of pressure (2,) in B (m) far from the centre of mass, at the origin: on a level table they are one."""
    x, y = np.asarray(center, dtype=np.float64)
    if math.hypot(x, y) > _ASIDE * radius:
        _note(
            place,
            f"the centre of pressure is at ({1000 * x:.3g}, {1000 * y:.3g}) mm, but on a level table it is below the centre "
            "of mass, at the origin; other weights of the points bring it there",
        )


def note_heading(theta: float, place: str, largest: float = _LARGEST_HEADING) -> None:
    """Doubt a heading (rad) beyond ``largest``: degrees are mostly whole."""
    if abs(theta) > largest and _is_whole(theta):
        _note_degrees(theta, place)


def note_tolerance(distance: float, angle: float, radius: float, place: str) -> None:
    """Doubt tolerances of the position (m) of a slider of a radius (m), and of its heading (rad): degrees are mostly whole."""
    if distance > _LOOSE * radius:
        words = f"{distance:.4g} m, {distance / radius:.3g} radii of the slider, looks like millimetres ({distance / 1000:.4g} m)"
        _note(f"{place}[0]", words)
    place = f"{place}[1]"
    if angle > _LARGEST_TOLERANCE and _is_whole(angle):
        _note_degrees(angle, place)


def note_noise(position: float, angle: float, place: str) -> None:
    """Doubt standard deviations (m, rad) of a row of a log."""
    if position > _NOISY_POSITION:
        _note(place, f"a position known to {position:.4g} m looks like millimetres ({position / 1000:.4g} m)")
    if angle > _NOISY_ANGLE:
        _note(place, f"an angle known to {angle:.4g} rad looks like degrees ({math.radians(angle):.4g} rad)")


def note_margin(margin: float, place: str) -> None:
    """Doubt a margin (rad); none is above a right angle."""
    if margin > _LARGEST_MARGIN:
        _note_degrees(margin, place)


def note_slide(twist: ArrayLike, place: str) -> None:
    """Doubt the first twist (m/s, rad/s) of a thrown body."""
    vx, vy, omega = np.asarray(twist, dtype=np.float64)
    if math.hypot(vx, vy) > _FASTEST_SLIDE:
        _note(place, f"{math.hypot(vx, vy):.4g} m/s looks like millimetres per second ({math.hypot(vx, vy) / 1000:.4g} m/s)")
    if abs(omega) > _FASTEST_TURN:
        _note(place, f"{omega:.4g} rad/s looks like degrees per second ({math.radians(omega):.4g} rad/s)")


def note_friction(mu: float, place: str) -> None:
    """Doubt a coefficient of friction."""
    if _LARGEST_FRICTION < mu < 90.0:
        _note(place, f"a coefficient of {mu:.4g} looks like degrees (its coefficient is {math.tan(math.radians(mu)):.3g})")


def note_gravity(gravity: float, place: str) -> None:
    """Doubt a gravity (m/s²)."""
    if gravity > 100:
        _note(place, f"{gravity:.4g} m/s^2 looks like millimetres or centimetres per second squared")


def note_quantity(value: float, unit: str, high: float, place: str) -> None:
    """Doubt a parameter of an effect: an angle (``rad``), a mass (``kg``), a length on an object (``m``), a delay (``s``).

    ``high``: the upper end of the range in which rigs are found.
    """
    if unit == "rad" and abs(value) > 10 * high:
        _note_degrees(value, place)
    elif unit == "kg" and value > 100 * high:
        _note(place, f"{value:.4g} kg looks like grams ({value / 1000:.4g} kg)")
    elif unit == "m":
        note_finger(abs(value), place)
    elif unit == "s" and abs(value) > _LONGEST_DELAY:
        _note(place, f"{value:.4g} s looks like milliseconds ({value / 1000:.4g} s)")


def note_cors(cors: ArrayLike, characteristic_length: float, place: str) -> None:
    """Doubt rotation centres (n, 2) in m, if most of them lie far from a slider of this ``rho`` (m)."""
    distances = np.linalg.norm(np.asarray(cors, dtype=np.float64).reshape(-1, 2), axis=1)
    if len(distances) < 2:
        return
    middle = float(np.median(distances))
    if _FAR_COR * characteristic_length < middle < _TRANSLATION * characteristic_length:
        _note(place, f"a median distance of {middle:.4g} m looks like millimetres ({middle / 1000:.4g} m)")


def note_headings(theta: ArrayLike, place: str) -> None:
    """Doubt the headings (n,) in rad of a log, which may run on over turns."""
    angles = np.asarray(theta, dtype=np.float64)
    largest = float(np.nanmax(np.abs(angles), initial=0.0))
    if largest > 2 * _LARGEST_HEADING:
        _note_degrees(largest, place)


def _note_degrees(angle: float, place: str) -> None:
    _note(place, f"{angle:.4g} rad looks like degrees ({math.radians(angle):.4g} rad)")


def _is_whole(angle: float) -> bool:
    return abs(angle - round(angle)) < 1e-9


def _note(place: str, doubt: str) -> None:
    # the place to name is where the value came from: the first caller outside of the package
    package, level = __name__.partition(".")[0], 2
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        frame, level = frame.f_back, level + 1
    warnings.warn(PlausibilityWarning(place, doubt), stacklevel=level)
