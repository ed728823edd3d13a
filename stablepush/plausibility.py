"""Doubts about valid values that look like another unit: millimetres for metres, grams for kilograms, degrees for radians.

Each function warns with :class:`~stablepush.errors.PlausibilityWarning`, which names place, value and likely unit.
The limits lie well beyond what is pushed over a table, and well below the same thing in the next unit.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike

from stablepush.errors import PlausibilityWarning

#: Largest radius (m) of an object, and extent (m) of a scene or of poses: 5 mm and 200 mm, taken for metres, are beyond.
_LARGEST_RADIUS, _LARGEST_SCENE = 3.0, 100.0
#: Largest mass (kg) over an area (kg/m²): 0.4 m of steel is 3,100. And largest mass (kg).
_LARGEST_AREAL_MASS, _LARGEST_MASS = 4_000.0, 200.0
#: Largest speeds (m/s, rad/s): of a push, which is to be quasi-static, and of a thrown body.
_FASTEST_PUSH, _FASTEST_SLIDE, _FASTEST_TURN = 2.0, 20.0, 60.0
#: Largest heading (rad): two turns.
_LARGEST_HEADING = 4 * math.pi
#: Largest tolerance and margin (rad); a half turn and more allows every heading, and is meant.
_LARGEST_TOLERANCE, _LARGEST_MARGIN = 1.0, math.pi / 2
#: Largest coefficient of friction; beyond, it is an angle.
_LARGEST_FRICTION = 5.0
#: Largest radius (m) of a finger.
_LARGEST_FINGER = 0.5
#: Longest delay (s) of a sensor.
_LONGEST_DELAY = 5.0
#: Rotation centres farther than this many characteristic lengths are all but translations; a list has few of them.
_FAR_COR = 100.0


def note_size(radius: float, place: str) -> None:
    """Doubt the distance (m) from the origin to the farthest point of an object."""
    if radius > _LARGEST_RADIUS:
        _note(f"{place}: a radius of {radius:.4g} m looks like millimetres ({radius / 1000:.4g} m)")


def note_mass(mass: float, area: float, place: str) -> None:
    """Doubt a mass (kg) over the area (m²) that it stands on."""
    if mass > min(_LARGEST_MASS, _LARGEST_AREAL_MASS * area):
        _note(f"{place}: {mass:.4g} kg looks like grams ({mass / 1000:.4g} kg)")


def note_scene(lengths: ArrayLike, place: str) -> None:
    """Doubt coordinates (m) in the world."""
    largest = float(np.abs(lengths).max(initial=0.0))
    if largest > _LARGEST_SCENE:
        _note(f"{place}: {largest:.4g} m looks like millimetres ({largest / 1000:.4g} m)")


def note_heading(theta: float, place: str) -> None:
    """Doubt a heading (rad)."""
    if abs(theta) > _LARGEST_HEADING:
        _note_degrees(theta, place)


def note_tolerance(angle: float, place: str) -> None:
    """Doubt a tolerance of the heading (rad)."""
    if _LARGEST_TOLERANCE < angle < math.pi - 0.01 or angle > 2 * math.pi + 0.01:
        _note_degrees(angle, place)


def note_margin(margin: float, place: str) -> None:
    """Doubt a margin (rad); none is above a right angle."""
    if margin > _LARGEST_MARGIN:
        _note_degrees(margin, place)


def note_push_speed(speed: float, place: str) -> None:
    """Doubt the speed (m/s) of a push."""
    if speed > _FASTEST_PUSH:
        _note(f"{place}: {speed:.4g} m/s looks like millimetres per second ({speed / 1000:.4g} m/s)")


def note_slide(twist: ArrayLike, place: str) -> None:
    """Doubt the first twist (m/s, rad/s) of a thrown body."""
    vx, vy, omega = np.asarray(twist, dtype=np.float64)
    if math.hypot(vx, vy) > _FASTEST_SLIDE:
        _note(f"{place}: {math.hypot(vx, vy):.4g} m/s looks like millimetres per second ({math.hypot(vx, vy) / 1000:.4g} m/s)")
    if abs(omega) > _FASTEST_TURN:
        _note(f"{place}: {omega:.4g} rad/s looks like degrees per second ({math.radians(omega):.4g} rad/s)")


def note_friction(mu: float, place: str) -> None:
    """Doubt a coefficient of friction."""
    if _LARGEST_FRICTION < mu < 90.0:
        _note(f"{place}: a coefficient of {mu:.4g} looks like degrees (its tangent is {math.tan(math.radians(mu)):.3g})")


def note_finger(radius: float, place: str) -> None:
    """Doubt the radius (m) of a finger."""
    if radius > _LARGEST_FINGER:
        _note(f"{place}: {radius:.4g} m looks like millimetres ({radius / 1000:.4g} m)")


def note_gravity(gravity: float, place: str) -> None:
    """Doubt a gravity (m/s²)."""
    if gravity > 100:
        _note(f"{place}: {gravity:.4g} m/s^2 looks like millimetres or centimetres per second squared")


def note_quantity(value: float, unit: str, place: str) -> None:
    """Doubt an angle (``rad``), a length on an object (``m``) or a delay (``s``); other units are not judged."""
    if unit == "rad" and abs(value) > 2 * math.pi + 0.01:
        _note_degrees(value, place)
    elif unit == "m":
        note_finger(abs(value), place)
    elif unit == "s" and abs(value) > _LONGEST_DELAY:
        _note(f"{place}: {value:.4g} s looks like milliseconds ({value / 1000:.4g} s)")


def note_cors(cors: ArrayLike, characteristic_length: float, place: str) -> None:
    """Doubt rotation centres (n, 2) in m, if most of them lie far from a slider of this ``rho`` (m)."""
    distances = np.linalg.norm(np.asarray(cors, dtype=np.float64).reshape(-1, 2), axis=1)
    if not len(distances):
        return
    middle = float(np.median(distances))
    if _FAR_COR * characteristic_length < middle < 1e5 * characteristic_length:
        _note(f"{place}: half of the centres lie {middle:.4g} m away or more: looks like millimetres ({middle / 1000:.4g} m)")


def note_contact(points: ArrayLike, radius: float, place: str) -> None:
    """Doubt contact points (n, 2) in m on a slider of a radius (m)."""
    farthest = float(np.linalg.norm(np.asarray(points, dtype=np.float64), axis=-1).max(initial=0.0))
    if farthest > 10 * radius:
        _note(f"{place}: a point {farthest:.4g} m from a slider of radius {radius:.4g} m looks like millimetres")


def note_headings(theta: ArrayLike, place: str) -> None:
    """Doubt the headings (n,) in rad of a log, which may run on over turns."""
    angles = np.asarray(theta, dtype=np.float64)
    largest = float(np.nanmax(np.abs(angles), initial=0.0))
    if largest > 2 * _LARGEST_HEADING:
        _note_degrees(largest, place)


def _note_degrees(angle: float, place: str) -> None:
    _note(f"{place}: {angle:.4g} rad looks like degrees ({math.radians(angle):.4g} rad)")


def _note(text: str) -> None:
    # the caller of the constructor or function that took the value
    warnings.warn(PlausibilityWarning(text), stacklevel=4)
