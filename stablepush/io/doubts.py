"""What a log that was made of recordings should have and has not: a wrong sign, unit or origin shows in it, a line each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from stablepush.core import FloatArray
from stablepush.geometry import rotate_vectors
from stablepush.io.pushlog import PushLog

#: While it pushes the tip is at most so far (share of the slider's radius, and m) from where its radius puts it; the same share
#: stands for a radius that is not known.
_OFF, _OFF_LEAST = 0.2, 5e-3
#: A slider does not travel so many of its radii in a push, and a heading counts no more than two turns (rad).
_FARTHEST, _TURNS = 50.0, 4 * np.pi
#: A push whose power is a smaller share of the greatest was none.
_WORKS = 0.01
#: Seconds between two rows, shorter and longer than which no clock of a tracker ticks.
_QUICK, _SLOW = 1e-4, 1.0
#: Rows are missing where two are so many usual steps and so many seconds apart.
_STEPS, _GAP = 5.0, 0.15


def doubts(log: PushLog, zeroed: bool = True) -> list[str]:
    """Return a line for each thing that a recorded log is unlikely to be; none for one that looks as it should.

    ``zeroed``: the offset of the force sensor was to be taken from rows at rest.
    """
    return [*_opposed(log), *(_restless(log) if zeroed else ()), *_away(log), *_large(log), *_clock(log)]


def _opposed(log: PushLog) -> Iterator[str]:
    """Friction takes power from the pusher: a force that gives some back has the wrong sign."""
    pairs = log.pairs()
    power = (pairs.wrenches * pairs.twists).sum(axis=1)
    # a poke that missed says nothing
    power = power[np.abs(power) > _WORKS * np.abs(power).max(initial=0.0)]
    number, against = len(power), int((power < 0).sum())
    if number > 1 and 2 * against > number:
        yield f"in {against} of {number} pushes the force opposes the motion: is its sign wrong (forces_on)?"


def _restless(log: PushLog) -> Iterator[str]:
    resting = {str(name) for name in log.samples["trial"][log.samples["phase"] == "rest"]}
    restless = sum(str(name) not in resting for name in log.trials["trial"])
    if restless and log.pairs().trials:
        yield f"{restless} of {len(log)} pushes have no rows at rest: an offset of the force sensor stays in them"


def _away(log: PushLog) -> Iterator[str]:
    """The tip is a finger's radius outside the outline while it pushes."""
    body, tips = log.columns("x", "y", "theta"), log.columns("px", "py")
    slider, radius = log.rig.slider, log.rig.finger_radius
    pushing = np.isfinite(body).all(axis=1) & np.isfinite(tips).all(axis=1) & (log.samples["phase"] == "push")
    if not pushing.any():
        return
    local = shapely.points(rotate_vectors(-body[pushing, 2], tips[pushing] - body[pushing, :2]))
    outside = shapely.distance(slider.polygon, local)
    inside = shapely.distance(slider.polygon.exterior, local) * (outside == 0)
    place = float(np.median(outside - inside))
    off = max(_OFF * slider.radius, _OFF_LEAST)
    low, high = (0.0, off) if radius is None else (radius, radius)
    if not low - off <= place <= high + off:
        where = f"{1000 * abs(place):.3g} mm {'outside' if place > 0 else 'inside'}"
        finger = "" if radius is None else f", with a finger of {1000 * radius:.3g} mm radius"
        asked = "units (length), body_pose, outline?"
        yield f"while it pushes the centre of the tip is {where} the slider's outline{finger}: {asked}"


def _large(log: PushLog) -> Iterator[str]:
    """Millimetres for metres, and degrees for radians."""
    poses, slider = log.columns("x", "y", "theta"), log.rig.slider
    far = 0.0
    for name in log.trials["trial"]:
        known = poses[log.rows(str(name))]
        known = known[np.isfinite(known).all(axis=1)]
        if len(known):
            far = max(far, float(np.linalg.norm(known[:, :2] - known[0, :2], axis=1).max()))
    if far > _FARTHEST * slider.radius:
        reach = 1000 * slider.radius
        yield f"the slider moves by {1000 * far:.4g} mm in a push, and its outline reaches {reach:.4g} mm: units (length)?"
    heading = float(np.nanmax(np.abs(poses[:, 2]), initial=0.0))
    if heading > _TURNS:
        yield f"headings go up to {heading:.3g} rad: units (angle)?"


def _clock(log: PushLog) -> Iterator[str]:
    """A clock in another unit, and rows that are missing."""
    steps: list[FloatArray] = []
    for name in log.trials["trial"]:
        rows = log.rows(str(name))
        steps.append(np.diff(log.samples["t"][rows])[log.samples["phase"][rows][1:] == "push"])
    ticks = np.concatenate(steps) if steps else np.zeros(0)
    if not len(ticks):
        return
    usual = float(np.median(ticks))
    if not _QUICK <= usual <= _SLOW:
        yield f"rows are {usual:.3g} s apart: units (time)?"
    leaps = [float(of_push.max(initial=0.0)) for of_push in steps]
    missing = [leap for leap in leaps if leap > max(_STEPS * usual, _GAP)]
    if missing:
        yield (
            f"in {len(missing)} of {len(log)} pushes rows are missing, for up to {max(missing):.3g} s (usual: {usual:.2g} s "
            "between two): velocities are means over such a gap"
        )
