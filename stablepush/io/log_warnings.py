"""What a log that was made of recordings should have and has not: a wrong sign, unit or origin shows in it, a line each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from stablepush.core import FloatArray, some_of
from stablepush.geometry import contacts_on_outline, rotate_vectors, transform_points
from stablepush.io.frozen_sensors import dead_columns, dead_words, stopped, stopped_words
from stablepush.io.pushlog import PushLog
from stablepush.io.recorded_pushes import largest_step
from stablepush.io.sensor_offset import LEAST_REST

#: While it pushes the tip is at most so far (share of the slider's radius, and m) from where its own radius puts it; largest
#: radius (m) of a finger where it is not known.
_OFF, _OFF_LEAST, _WIDEST = 0.2, 5e-3, 0.03
#: Fingers of a known radius are off from so far (m), and the middle of two contact points on one face is on it to this (m).
_SEEN_OFF, _STRAIGHT = 1e-3, 1e-5
#: Fingers that are farther off (m) than this are so for no radius, and no delay of a tracker.
_FAR_OFF = 0.015
#: A slider does not travel so many of its radii in a push, nor turn so far (rad).
_FARTHEST, _TURNS = 50.0, 2 * np.pi
#: Friction turns a force less far (rad) from the normal of the touched edge, and less in the mean of so many pushes; or by no
#: more than this beyond the angle of the friction that is believed, or likely.
_ASLANT, _TURNED, _FEWEST, _BEYOND, _LIKELY = math.radians(50), math.radians(25), 8, math.radians(10), 0.5
#: A tip that is nearer (m) to the outline than this has no normal; nor has one that is as near to two edges of a notch.
_ON, _NOTCH = 1e-4, 1e-3
#: A rest shows the offset of the force sensor for pushes that begin so many seconds before or after.
_REST_SERVES = 60.0
#: A force that is larger than this share of the usual load pushes, as where pushes begin.
_ACTS = 0.3
#: A push whose power is a smaller share of the greatest was none.
_WORKS = 0.01
#: Nobody pushes so slowly or so fast (m/s).
_SLOWEST, _FASTEST = 5e-5, 10.0
#: Rubber on dry concrete has a friction of 1: nobody slides an object with so many times its weight.
_HEAVIEST = 5.0
#: Loads, moments counted by the characteristic length, are near the friction that is stated; so many times off is another unit.
_OFF_FRICTION = 3.0
#: Share of the rows in which the tracker sees a slider that does not move, or in which force or tip is missing.
_SEEN = 0.5
#: Poses that are farther apart (s) are too few for the usual pushes, if a window for twists holds none but a row's neighbours.
_SPARSE = 0.5


def doubts(log: PushLog, zeroed: bool = True, rests: Sequence[float] | FloatArray = ()) -> list[str]:
    """Return a line for each thing that a recorded log is unlikely to be; none for one that looks as it should.

    ``zeroed``: the offset of the force sensor was to be taken from rows at rest; ``rests``: when (s) the slider rested beside the
    trials.
    """
    elsewhere = list(_away(log)) or list(_apart(log))
    # normals are known where the fingers are at the outline
    of_forces = list(_unlike_friction(log)) or list(_opposed(log)) or ([] if elsewhere else list(_aslant(log)))
    still = stopped(log)
    stuck = (*stopped_words(still, len(log)), *dead_words(dead_columns(log)))
    of_channels = (*_large(log), *_clock(log), *_unseen(log), *_unloaded(log), *_missed(log, still["poses"]), *stuck)
    return [*of_forces, *(_restless(log, rests) if zeroed else ()), *elsewhere, *of_channels]


def covers(name: str, t: FloatArray, values: FloatArray) -> list[str]:
    """Return a line if a recorded channel, ``values`` (n, k) at ``t`` (n,) in s, begins after the record does, or ends before."""
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    step = largest_step(np.diff(t))
    left_out = [lost for lost in (t[known[0]] - t[0], t[-1] - t[known[-1]]) if lost > step] if len(known) else []
    if not left_out:
        return []
    return [f"{name} cover {t[known[-1]] - t[known[0]]:.3g} of {t[-1] - t[0]:.3g} s: {sum(left_out):.3g} s are left out"]


def unit_doubts(log: PushLog) -> list[str]:
    """Return a line for each unit that a log seems to have instead of its own."""
    return [*_unlike_friction(log), *_large(log)]


def _in_pushes(names: Sequence[str], number: int) -> str:
    return f"in {len(names)} of {number} pushes ({some_of(names)})"


def _powers(log: PushLog) -> dict[str, float]:
    """Mean power (W) of each trial that is a push: a poke that missed takes none to speak of."""
    power = (log.columns("fx", "fy", "tau") * log.twists()).sum(axis=1)
    pushing = np.isfinite(power) & (log.samples["phase"] == "push")
    found = {}
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        rows = rows[pushing[rows]]
        if len(rows):
            found[name] = float(power[rows].mean())
    most = max(map(abs, found.values()), default=0.0)
    return {name: value for name, value in found.items() if abs(value) > _WORKS * most}


def _opposed(log: PushLog) -> Iterator[str]:
    """Friction takes power from the pusher: a force that gives some back has the wrong sign."""
    powers = _powers(log)
    against = [name for name, power in powers.items() if power < 0]
    if len(powers) > 1 and 2 * len(against) > len(powers):
        words = "is its sign wrong (forces_on), or are its axes those of the tool (force_axes)?"
        yield f"{_in_pushes(against, len(powers))} the force opposes the motion: {words}"


def _unlike_friction(log: PushLog) -> Iterator[str]:
    """Loads that are not of the size of the friction of the table, of a slider whose mass is known."""
    if log.rig.slider.mass is None:
        return
    # a moment counts as the force that makes it at the characteristic length
    loads = np.linalg.norm(log.columns("fx", "fy", "tau") / (1, 1, log.rig.slider.characteristic_length), axis=1)
    if "phase" in log.samples:
        loads = loads[log.samples["phase"] == "push"]
    share = float(np.nanmedian(loads)) / (log.rig.slider.mass * log.rig.gravity) if np.isfinite(loads).any() else 0.0
    friction = log.rig.support_friction
    if friction and share and not 1 / _OFF_FRICTION < share / friction < _OFF_FRICTION:
        yield (
            f"loads are {share / friction:.2g} times what the friction of the support, {friction:g}, gives with the slider's "
            "weight: units (force, mass), or the friction?"
        )
    elif share > _HEAVIEST:
        yield f"forces are {share:.3g} times the slider's weight, and friction is hardly ever more than it: units (force, mass)?"


def _aslant(log: PushLog) -> Iterator[str]:
    """Forces that are turned from the normal of the touched edge by more than friction does, in many pushes or on average."""
    body, tips, forces = log.columns("x", "y", "theta"), log.columns("px", "py"), log.columns("fx", "fy")
    vertices, mu = log.rig.slider.vertices, log.rig.contact_friction
    pushing = np.isfinite(np.column_stack((body, tips, forces))).all(axis=1) & (log.samples["phase"] == "push")
    if log.rig.contact_kind == "held" or not pushing.any():
        return
    edges = shapely.linestrings(np.stack((vertices, np.roll(vertices, -1, axis=0)), axis=1))
    turns: dict[str, float] = {}
    for name in _powers(log):
        rows = log.rows(name)
        rows = rows[pushing[rows]]
        local = rotate_vectors(-body[rows, 2], tips[rows] - body[rows, :2])
        near, inward, away = contacts_on_outline(vertices, local)
        # in a notch a finger may touch two edges
        touched = shapely.distance(edges[:, None], shapely.points(local)) < away + _NOTCH
        beside = shapely.distance(edges[:, None], shapely.points(near)) > _NOTCH
        clear = (away > _ON) & ~(touched & beside).any(axis=0)
        if clear.any():
            cross = inward[:, 0] * forces[rows, 1] - inward[:, 1] * forces[rows, 0]
            turns[name] = float(np.median(np.arctan2(cross, (inward * forces[rows]).sum(axis=1))[clear]))
    friction = math.atan(_LIKELY if mu is None else mu)
    most, most_mean = max(_ASLANT, friction + _BEYOND), max(_TURNED, friction + _BEYOND)
    far = [name for name, turn in turns.items() if abs(turn) > most]
    mean = float(np.angle(np.exp(1j * np.array(list(turns.values()))).sum()))
    asked = "are its axes (force_axes) and its angle (force_angle) right?"
    if 2 * len(far) > len(turns) > 1:
        off = f"more than {np.degrees(most):.0f} degrees off the normal of the touched edge"
        yield f"{_in_pushes(far, len(turns))} the force is {off}: {asked}"
    elif len(turns) >= _FEWEST and abs(mean) > most_mean:
        off = f"turned by {np.degrees(mean):.0f} degrees counter-clockwise from the normal of the touched edge"
        yield f"on average the force is {off}: {asked}"


def _restless(log: PushLog, beside: Sequence[float] | FloatArray) -> Iterator[str]:
    read = (log.samples["phase"] == "rest") & np.isfinite(log.columns("fx", "fy")).all(axis=1)
    names, rows = np.unique(log.samples["trial"][read].astype(str), return_counts=True)
    resting, pushes = set(names[rows >= LEAST_REST].tolist()), _powers(log)
    begun = dict(zip(map(str, log.trials["trial"]), np.asarray(log.trials["start_time"], dtype=np.float64), strict=True))
    rests = np.array([*(begun[name] for name in resting), *beside])
    # of a rest shortly before nothing need be said: that of a plan serves all its pushes
    restless = [name for name in pushes if not (np.abs(rests - begun[name]) <= _REST_SERVES).any()]
    if restless:
        yield (
            f"{len(restless)} of {len(pushes)} pushes ({some_of(restless)}) have fewer than {LEAST_REST} rows at rest within "
            f"{_REST_SERVES:g} s, which show the offset of the force sensor: that of another rest is taken off them, or none"
        )


def _away(log: PushLog) -> Iterator[str]:
    """The tip is a finger's radius outside the outline while it pushes."""
    body, tips = log.columns("x", "y", "theta"), log.columns("px", "py")
    slider, radius = log.rig.slider, log.rig.finger_radius
    pushing = np.isfinite(body).all(axis=1) & np.isfinite(tips).all(axis=1) & (log.samples["phase"] == "push")
    if not pushing.any() or log.rig.contact_kind == "held":
        return
    local = rotate_vectors(-body[pushing, 2], tips[pushing] - body[pushing, :2])
    place = float(np.median(contacts_on_outline(slider.vertices, local)[2]))
    off = max(_OFF * slider.radius, _OFF_LEAST)
    low, high = (0.0, _WIDEST) if radius is None else (radius, radius)
    if not low - off <= place <= high + off:
        where = f"{1000 * abs(place):.3g} mm {'outside' if place > 0 else 'inside'}"
        finger = "" if radius is None else f", with a finger of {1000 * radius:.3g} mm radius"
        asked = "units (length, angle), body_pose, outline?"
        yield f"while it pushes the centre of the tip is {where} the slider's outline{finger}: {asked}"


def _apart(log: PushLog) -> Iterator[str]:
    """Fingers of a known radius touch the outline while they push."""
    radius, slider = log.rig.finger_radius, log.rig.slider
    pushing = np.isfinite(log.columns("x", "y", "theta", "px", "py")).all(axis=1) & (log.samples["phase"] == "push")
    if log.rig.contact_kind == "two-point":
        # the pusher's pose is midway between two fingers: on a straight face it is as far from it as they are
        ends = log.columns("c1x", "c1y", "c2x", "c2y")
        pushing &= np.isfinite(ends).all(axis=1)
        middle = shapely.points(np.where(pushing[:, None], ends[:, :2] + ends[:, 2:], 0.0) / 2)
        pushing &= shapely.distance(slider.polygon.exterior, middle) < _STRAIGHT
    if radius is None or log.rig.contact_kind == "held" or not pushing.any():
        return
    body, tips = log.columns("x", "y", "theta"), log.columns("px", "py")
    off: dict[str, float] = {}
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        rows = rows[pushing[rows]]
        if len(rows):
            local = rotate_vectors(-body[rows, 2], tips[rows] - body[rows, :2])
            off[name] = float(np.median(contacts_on_outline(slider.vertices, local)[2])) - radius
    far = [name for name, value in off.items() if abs(value) > _SEEN_OFF]
    if 2 * len(far) > len(off):
        most = max(off.values(), key=abs)
        asked = "tracked origin (body_pose), radius, or a tracker that lags?"
        if abs(most) > _FAR_OFF:
            asked = "unit or sign of theta, the outline, or the tracked origin (body_pose)?"
        yield (
            f"{_in_pushes(far, len(off))} the fingers seem more than {1000 * _SEEN_OFF:g} mm off the outline, up to "
            f"{1000 * abs(most):.2g} mm {'away from it' if most > 0 else 'inside'}: {asked}"
        )


def _large(log: PushLog) -> Iterator[str]:
    """Millimetres for metres, and degrees for radians."""
    poses, slider = log.columns("x", "y", "theta"), log.rig.slider
    of_pushes = []
    for name in log.trials["trial"]:
        known = poses[log.rows(str(name))]
        known = known[np.isfinite(known).all(axis=1)]
        if len(known):
            off = np.abs(known - known[0])
            of_pushes.append((float(np.hypot(off[:, 0], off[:, 1]).max()), float(off[:, 2].max())))
    # one long push among others is one
    far, turned = np.median(of_pushes, axis=0).tolist() if of_pushes else (0.0, 0.0)
    if far > _FARTHEST * slider.radius:
        reach = 1000 * slider.radius
        yield f"the slider moves by {1000 * far:.4g} mm in a push, and its outline reaches {reach:.4g} mm: units (length)?"
    if turned > _TURNS:
        yield f"the slider turns by {turned:.3g} rad in a push: units (angle)?"


def _clock(log: PushLog) -> Iterator[str]:
    """A clock in another unit, and rows that are missing."""
    slider, poses = log.rig.slider, log.columns("x", "y", "theta")
    steps: dict[str, FloatArray] = {}
    seen, speeds = [], []
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        steps[name] = np.diff(log.samples["t"][rows])[log.samples["phase"][rows][1:] == "push"]
        rows = rows[(log.samples["phase"][rows] == "push") & np.isfinite(poses[rows]).all(axis=1)]
        seen.append(np.diff(log.samples["t"][rows]))
        if len(rows) > 1:
            first, last = (transform_points(poses[row], slider.vertices) for row in (rows[0], rows[-1]))
            travel = float(np.linalg.norm(last - first, axis=1).max())
            speeds.append(travel / float(log.samples["t"][rows[-1]] - log.samples["t"][rows[0]]))
    ticks = np.concatenate(list(steps.values())) if steps else np.zeros(0)
    if not len(ticks) or not speeds:
        return
    usual, speed = float(np.median(ticks)), float(np.median(speeds))
    apart = float(np.median(np.concatenate(seen)))
    if not _SLOWEST <= speed <= _FASTEST:
        yield f"the slider moves at {1000 * speed:.3g} mm/s, and rows are {usual:.3g} s apart: units (time, length)?"
    elif apart > max(_SPARSE, (log.rig.twist_window or 0.0) / 2):
        yield f"poses are {apart:.2g} s apart, and twists are slopes from row to row: record 20 rows per second or more"
    leaps = {name: float(of_push.max(initial=0.0)) for name, of_push in steps.items()}
    missing = [name for name, leap in leaps.items() if leap > largest_step(ticks)]
    if missing:
        yield (
            f"{_in_pushes(missing, len(log))} rows are missing, for up to {max(leaps.values()):.3g} s (usual: {usual:.2g} s "
            "between two): nothing is known of the motion there"
        )


def _missed(log: PushLog, told: Sequence[str]) -> Iterator[str]:
    """Pushes in which the tracker sees the slider all the time and it does not move. ``told``: those that another line names."""
    names = []
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        seen = np.isfinite(log.columns("x", "y", "theta")[rows]).all(axis=1)
        lost = float(np.ptp(log.samples["t"][rows][~seen])) if not seen.all() else 0.0
        if name in told or lost > largest_step(np.diff(log.samples["t"][rows])):
            continue
        if not (log.samples["phase"][rows] == "push").any() and seen.mean() > _SEEN:
            names.append(name)
    if names:
        yield f"{_in_pushes(names, len(log))} the slider does not move: did the finger miss? They show no load"


def _unloaded(log: PushLog) -> Iterator[str]:
    """Pushes that give no load because the force is missing, or the place of the tip, without which there is no moment."""
    if "fx" not in log.samples:
        return
    loaded = set(log.pairs().trials)
    lacking: dict[str, list[str]] = {"force": [], "place of the tip": []}
    body, tips, loads = log.columns("x", "y", "theta"), log.columns("px", "py"), log.columns("fx", "fy")
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        rows = rows[(log.samples["phase"][rows] == "push") & np.isfinite(body[rows]).all(axis=1)]
        if len(rows) < 2 or name in loaded:
            continue
        if np.isnan(loads[rows]).any(axis=1).mean() > _SEEN:
            lacking["force"].append(name)
        elif log.rig.contact_kind == "point" and np.isnan(tips[rows]).any(axis=1).mean() > _SEEN:
            lacking["place of the tip"].append(name)
    for what, names in lacking.items():
        if names:
            yield f"{_in_pushes(names, len(log))} the {what} is missing while the slider moves: they show no load"


def pushes_unseen(t: FloatArray, tips: FloatArray, forces: FloatArray, load: float) -> list[str]:
    """Return a line if a force acts while the tip moves, in rows that belong to no push: the slider is not seen to move there.

    Times (n,) in s, places of the tip (n, 2 or 3) and forces (n, 2) of those rows; ``load`` (N): the usual force of a push.
    """
    acts = np.linalg.norm(forces, axis=1) > _ACTS * load
    runs = np.split(np.arange(len(t)), np.flatnonzero((np.diff(acts) != 0) | (np.diff(t) > largest_step(np.diff(t)))) + 1)
    unseen = [run for run in runs if len(run) and acts[run[0]] and np.linalg.norm(np.ptp(tips[run, :2], axis=0)) > _OFF_LEAST]
    if not unseen:
        return []
    times = "once" if len(unseen) == 1 else f"{len(unseen)} times"
    where = f"{times} a force acts while the tip moves and the slider is not seen to move, at first t = {t[unseen[0][0]]:.4g} s"
    return [f"{where}: did the tracker freeze? No push is found there"]


def _unseen(log: PushLog) -> Iterator[str]:
    """Pushes in which the tracker lost the slider."""
    body, pushed = log.columns("x", "y", "theta"), log.samples["phase"] == "push"
    blind: list[str] = []
    gaps: dict[str, float] = {}
    number = 0
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        known = np.isfinite(body[rows]).all(axis=1)
        lost = float(np.ptp(log.samples["t"][rows][~known])) if not known.all() else 0.0
        unseen = not pushed[rows].any() and lost > largest_step(np.diff(log.samples["t"][rows]))
        rows = rows[pushed[rows]]
        known = np.flatnonzero(np.isfinite(body[rows]).all(axis=1))
        number += bool(len(rows)) or unseen
        if unseen or (len(rows) > 1 and len(known) < 2):
            blind.append(name)
        elif len(rows) > 1:
            # rows that are not there are another line's
            lost = np.diff(log.samples["t"][rows[known]])[np.diff(known) > 1].max(initial=0.0)
            if lost > largest_step(np.diff(log.samples["t"][rows])):
                gaps[name] = float(lost)
    if blind:
        without = "fewer than two rows have a pose while the slider moves: they show no load and no twist"
        yield f"{_in_pushes(blind, number)} {without}"
    if gaps:
        most = f"for up to {max(gaps.values()):.3g} s"
        yield f"{_in_pushes(list(gaps), number)} the pose is missing {most}: nothing is known of the motion there"
