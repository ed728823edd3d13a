"""Logs from what a lab records: a tracker's poses, a robot's tip and a sensor's forces, all in the world, become rows in B."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import (
    BoolArray,
    FloatArray,
    InputError,
    StablepushWarning,
    check_array,
    check_choice,
    check_number,
    note_mounting,
)
from stablepush.geometry import compose, contacts_on_outline, nearest_on_outline, rotate_vectors
from stablepush.identify import SlipPairs
from stablepush.io.force_spikes import without_spikes
from stablepush.io.frozen_sensors import dead_or_cut_off
from stablepush.io.log_warnings import covers, doubts, pushes_unseen
from stablepush.io.pushlog import PushLog, Rig
from stablepush.io.recorded_pushes import (
    LEAST_TRAVEL,
    NOISY_TWISTS,
    SLIPS,
    WINDOWS,
    bridged,
    largest_step,
    named_rows,
    noise_of_rows,
    phases_of,
    pushes_in,
    speeds_of,
    travel,
    twists_of,
    window_for,
)
from stablepush.io.sensor_offset import zeroed
from stablepush.io.tracker_glitches import without_glitches
from stablepush.objects import Slider

#: The refusal of two fingers that cannot both touch the slider.
_TOO_FAR_APART = "expected fingers that both reach the slider, at most {:.3g} m apart"
#: What a force acts on: the slider, the finger (its reaction), or whichever makes the power of the pushes positive.
FORCES_ON = ("slider", "finger", "power")
#: Rows of the first push that show how the tool holds two fingers.
_FACING = 10
#: A finger that is farther (m) from the outline, or than it usually is in a push, does not touch it.
_TOUCHES = 1e-3
#: So far (m) from it a finger that touches it may seem to be.
_SEEMS = 8e-3


def _most_apart(rig: Rig) -> float:
    """Return how far (m) the centres of two fingers can be from each other that both touch the slider."""
    return 2 * (rig.slider.radius + (rig.finger_radius or 0.0))


def log_from_arrays(  # noqa: PLR0913
    rig: Rig,
    times: ArrayLike,
    poses: ArrayLike,
    forces: ArrayLike | None = None,
    tip_positions: ArrayLike | None = None,
    trials: Sequence[str] | None = None,
    *,
    body_pose: ArrayLike = (0.0, 0.0, 0.0),
    forces_on: str = "slider",
    moments: ArrayLike | None = None,
    zero_forces: bool = True,
    window: float | None = None,
    finger_distance: float | None = None,
    pose_delay: float = 0.0,
    force_angle: float = 0.0,
) -> PushLog:
    """Make a log of what was recorded in the world frame.

    Poses of B are ``pose * body_pose``. Loads in B are ``f = R(theta)^T force`` and ``tau = p x f``: p is the point of the
    outline nearest to the tip, for a finger gives a force and no moment. With ``moments``, ``tau = moment + q x f``, q being the
    tip's place. Twists are the slopes of straight lines through the poses within ``window``, by least squares, turned into B.

    Parameters
    ----------
    rig : Rig
        The slider and what is believed of the rig. Its ``finger_radius`` is not needed: the nearest point of the outline is the
        same for every radius.
    times : array-like, shape (n,)
        Clock of all rows (s), from any origin; it grows within a trial.
    poses : array-like, shape (n, 3)
        Tracked poses ``(x, y, theta)`` of the slider in W (m, rad). NaN where the tracker saw nothing.
    forces : array-like, shape (n, 2), optional
        Forces in W (N).
    tip_positions : array-like, shape (n, 2) or (n, 3), optional
        Centre of the finger, or midpoint of two, in W (m); a third column is the heading of the tool (rad).
    trials : sequence of str, length n, optional
        The push of each row; rows with a blank are left out. If not given, a push is where the slider moves, and another begins
        after it rested for half a second; a second before it moves is kept with it, all other rows are left out.
    body_pose : array-like, shape (3,)
        Pose of B, whose origin is the centre of mass, in the tracked frame (m, rad).
    forces_on : str
        ``"slider"``: the load on the slider, as the log has it. ``"finger"``: its reaction. ``"power"``: whichever of the two
        does work on the slider, over all rows.
    moments : array-like, shape (n,), optional
        Moments about the tip, along z (N·m). Two fingers need them. Without moments nobody knows where between the
        fingers the force acts: ``tau`` is then blank, and a :class:`StablepushWarning` says so.
    zero_forces : bool
        Take off what the sensor reads at rest in each trial: the median of its rows before the push in which the tip is away
        from the outline, else of its first rows, up to where the force steps to that of the push, if the slider does not move
        yet. There must be three or more such rows. A trial without rest has the offset of the last rest before it, or else of
        the first after it; rows without a trial in which the tip is away are rest, too. Where the tip has a heading the offset
        turns with the tool, unless readings at rest agree better without. A finger that stopped and still presses is not at
        rest.
    window : float
        Width (s) of the window of these lines. A shorter one follows faster motion, a longer one leaves less noise. If not
        given: 0.1, or up to 0.5 if the tracker is so noisy that slopes of windows that follow each other differ by more than 15 %
        of the speed of the pushes (a :class:`StablepushWarning` says so).
    finger_distance : float, optional
        m, between the centres of two fingers, along the touched edge; ``tip_positions`` is midway between them. With it and
        ``rig.finger_radius`` the log has the contact point of each finger: of the one that is nearest to the outline in a
        push, and of the other where it is less than 1 mm farther.
    pose_delay : float
        s by which the poses lag the tip and the forces, as a diagnosis may have found it; less than 0 if they are ahead. The pose
        of a row is then the one that was recorded so much later, between two of the same trial; the last rows have none.
    force_angle : float
        rad by which readings are turned counter-clockwise, as a diagnosis may have found it. They are turned back. A sensor that
        is mounted 35 degrees counter-clockwise reads forces that are turned by -0.611.

    Returns
    -------
    PushLog
        With ``phase``: ``rest`` before contact, ``push`` in contact, ``retract`` after it, or once the slider stands for good.
        A :class:`StablepushWarning` says what looks wrong: forces that oppose the motion, a tip that is not at the outline,
        lengths, headings or times in another unit, rows that are missing, pushes without rest. Poses that leap away and back
        within a few rows are glitches of the tracker, unless in the first or last row of a push: they are left out, and a warning
        says when.

    Raises
    ------
    InputError
        For arrays of other shapes, times that do not grow, loads that need ``tip_positions`` and have none, no push.
    """
    if not isinstance(rig, Rig):
        raise InputError("rig", "expected a Rig", type(rig).__name__)
    if not isinstance(zero_forces, bool | np.bool_):
        raise InputError("zero_forces", "expected True or False", repr(zero_forces))
    check_choice(forces_on, "forces_on", FORCES_ON)
    recording = _Recording.of(rig, times, (poses, body_pose, pose_delay), (forces, force_angle), tip_positions, moments, trials)
    _require_fingers(recording, window, finger_distance)
    recording = recording if trials is not None else recording.with_pushes(window)
    if not recording.names:
        raise InputError("poses" if trials is None else "trials", "expected at least one push, found none")
    motion = _motion_of(recording, window, finger_distance or 0.0)
    loads = None if recording.forces is None else _loads_of(recording, motion, zero_forces)
    made = _log_of(recording, motion, loads, forces_on, finger_distance)
    _tell_doubts(recording, made, loads, zero_forces, alone=trials is None)
    return made


@dataclass(frozen=True, slots=True, eq=False)
class _Recording:
    """What was recorded, checked and without glitches: clock (n,), poses as tracked and of B (n, 3), forces (n, 2) in W, moments
    (n,), tips (n, 2) or (n, 3), None where there are none; and the ``rows`` of each push by name."""

    rig: Rig
    t: FloatArray
    tracked: FloatArray
    body: FloatArray
    forces: FloatArray | None
    moments: FloatArray | None
    tips: FloatArray | None
    names: Sequence[str]
    rows: Sequence[np.ndarray]

    @classmethod
    def of(
        cls,
        rig: Rig,
        times: ArrayLike,
        tracker: tuple[ArrayLike, ArrayLike, float],
        sensor: tuple[ArrayLike | None, float],
        tip_positions: ArrayLike | None,
        moments: ArrayLike | None,
        trials: Sequence[str] | None,
    ) -> _Recording:
        """Check what was recorded. ``tracker``: poses, pose of B in their frame, delay; ``sensor``: forces, and their angle."""
        (poses, body_pose, pose_delay), (forces, force_angle) = tracker, sensor
        t = _clock(times)
        n = len(t)
        tracked = _with_gaps(poses, "poses", n, (3,))
        rows, names = ([np.arange(n)], [""]) if trials is None else named_rows(t, trials)
        _require_growing(t, rows, names)
        tracked = without_glitches(t, tracked, rows, names, rig.slider.characteristic_length)
        if check_number(pose_delay, "pose_delay") != 0:
            tracked = _recorded_later(t, tracked, pose_delay, rows)
        body = compose(tracked, check_array(body_pose, "body_pose", (3,)))
        tips = None if tip_positions is None else _with_gaps(tip_positions, "tip_positions", n, (2, 3))
        world = None if forces is None else without_spikes(t, _with_gaps(forces, "forces", n, (2,)), rows, names)
        _tell([] if world is None else dead_or_cut_off(world))
        note_mounting(check_number(force_angle, "force_angle"), "force_angle")
        if force_angle != 0 and world is not None:
            world = rotate_vectors(-force_angle, world)
        turning = None if moments is None else _with_gaps(_column(moments), "moments", n, (1,))[:, 0]
        if world is not None and tips is None:
            raise InputError("tip_positions", "expected the places of the tip with forces, for their moments", "none")
        if turning is not None and world is None:
            raise InputError("moments", "expected forces with them", "none")
        if world is not None and turning is None and rig.contact_kind == "two-point":
            _tell(["two fingers without moments: nobody knows where between them the force acts, so tau is blank"])
            turning = np.full(n, np.nan)
        return cls(rig, t, tracked, body, world, turning, tips, names, rows)

    def with_pushes(self, window: float | None) -> _Recording:
        """Return the recording with a push wherever the slider moves."""
        rows, names = pushes_in(self.rig.slider, self.t, self.body, window)
        return replace(self, rows=rows, names=names)


def _require_growing(t: FloatArray, rows: Sequence[np.ndarray], names: Sequence[str]) -> None:
    """Refuse times that do not grow within a trial."""
    for name, mine in zip(names, rows, strict=True):
        if (np.diff(t[mine]) <= 0).any():
            late = mine[int(np.argmax(np.diff(t[mine]) <= 0)) + 1]
            raise InputError(f"times[{late}]", f"expected times that grow{f' within trial {name}' if name else ', or trials'}")


def _require_fingers(recording: _Recording, window: float | None, finger_distance: float | None) -> None:
    """Refuse fingers that no rig has, and tell what their readings lack."""
    rig, tips = recording.rig, recording.tips
    if window is not None:
        check_number(window, "window", positive=True)
    if finger_distance is not None:
        check_number(finger_distance, "finger_distance", positive=True)
        if rig.contact_kind != "two-point" or rig.finger_radius is None or tips is None:
            raise InputError("finger_distance", "expected a rig of kind two-point with a finger_radius, and tip_positions")
        if finger_distance > _most_apart(rig):
            raise InputError("finger_distance", _TOO_FAR_APART.format(_most_apart(rig)), f"{finger_distance:g} m")
    if rig.contact_kind == "two-point" and tips is not None and tips.shape[1] == 2:
        _tell(["two fingers without the heading of the tool (tip_theta): where the object slips nobody knows where they touch"])


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """How the slider moves in each push: the window (s) of its twists, these, and the phase of each row; ``away`` (n,) in m: how
    far the fingers of all rows are from the outline."""

    window: float
    twists: Sequence[FloatArray]
    phases: Sequence[np.ndarray]
    away: FloatArray


def _motion_of(recording: _Recording, window: float | None, finger_distance: float) -> _Motion:
    rig, t, body, tips, rows = recording.rig, recording.t, recording.body, recording.tips, recording.rows
    if window is None:
        window = window_for(rig.slider, t, body, rows, NOISY_TWISTS)
        if window > WINDOWS[0]:
            _tell([f"the tracker is noisy: twists are slopes over {window:g} s (window) instead of {WINDOWS[0]:g} s"])
    twists = [twists_of(t[mine], body[mine], window) for mine in rows]
    # what moves while the tracker sees nothing is pushed, too
    speeds = [speeds_of(rig.slider, twists_of(t[mine], bridged(t[mine], body[mine]), window)) for mine in rows]
    away, noise = np.full(len(t), np.nan), noise_of_rows(rig.slider, t, body)
    if tips is not None:
        # an object is lost later than in the beginning
        first = int(np.argmin([mine[0] for mine in rows]))
        steady = rows[first][speeds[first] >= SLIPS * np.percentile(speeds[first], 95)][:_FACING]
        away = _outside(rig.slider, body, tips, finger_distance, steady) - (rig.finger_radius or 0.0)
    phases = []
    for mine, speed in zip(rows, speeds, strict=True):
        read, tip = (None if values is None else values[mine] for values in (recording.forces, tips))
        phases.append(phases_of(rig.slider, body[mine], speed, read, away[mine], tip, noise))
    return _Motion(window, twists, phases, away)


@dataclass(frozen=True, slots=True, eq=False)
class _Loads:
    """Readings (n, 3) in W, less the offset of the sensor; the loads and places of contact in B of the rows of pushes; and the
    rows that are rests."""

    readings: FloatArray
    load: FloatArray
    place: FloatArray
    rests: list[int]


def _loads_of(recording: _Recording, motion: _Motion, zero_forces: bool) -> _Loads:
    tips, body, rows, moments = recording.tips, recording.body, recording.rows, recording.moments
    assert recording.forces is not None
    assert tips is not None
    readings = np.column_stack((recording.forces, np.zeros(len(body)) if moments is None else moments))
    rests: list[int] = []
    if zero_forces:
        headings = tips[:, 2] if tips.shape[1] == 3 else None
        readings, rests = zeroed(readings, motion.away, headings, rows, motion.phases)
    loads, places = [], []
    for mine, phases in zip(rows, motion.phases, strict=True):
        local, read = _into(body[mine], tips[mine, :2]), readings[mine]
        place = nearest_on_outline(recording.rig.slider.vertices, local)[0]
        places.append(np.where(_touching(local, place, phases)[:, None], place, np.nan))
        arms, force = place if moments is None else local, rotate_vectors(-body[mine, 2], read[:, :2])
        loads.append(np.column_stack((force, read[:, 2] + arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0])))
    return _Loads(readings, np.concatenate(loads), np.concatenate(places), rests)


def _log_of(
    recording: _Recording, motion: _Motion, loads: _Loads | None, forces_on: str, finger_distance: float | None
) -> PushLog:
    """The log of a recording, column by column."""
    rig, rows, names, clock = recording.rig, recording.rows, recording.names, recording.t
    phases, twist = np.concatenate(motion.phases), np.concatenate(motion.twists)
    pose = np.concatenate([recording.body[mine] for mine in rows])
    trial = [name for name, mine in zip(names, rows, strict=True) for _ in mine]
    columns: dict[str, Any] = {
        "trial": trial,
        "t": np.concatenate([clock[mine] - clock[mine][0] for mine in rows]).tolist(),
        "phase": phases.tolist(),
    }
    if loads is not None:
        load, power = loads.load, np.nansum((loads.load * twist)[phases == "push"])
        if forces_on == "finger" or (forces_on == "power" and power < 0):
            load = -load
        columns |= dict(zip(("fx", "fy", "tau"), load.T, strict=True))
        columns |= dict(zip(("c1x", "c1y"), loads.place.T, strict=True)) if rig.contact_kind == "point" else {}
    columns |= dict(zip(("x", "y", "theta"), pose.T, strict=True))
    columns |= dict(zip(("vx", "vy", "omega"), twist.T, strict=True))
    if recording.tips is not None:
        of_pushes = zip(rows, motion.phases, strict=True)
        pushers = [_pushers(rig.slider, recording.body[mine], recording.tips[mine], part) for mine, part in of_pushes]
        pusher = np.concatenate(pushers)
        columns |= dict(zip(("px", "py", "ptheta"), pusher.T, strict=True))
        if finger_distance is not None:
            points = _touched(rig, pose, pusher, finger_distance, np.array(trial), phases == "push")
            for k in (0, 1):
                columns |= {f"c{k + 1}x": points[:, k, 0].tolist(), f"c{k + 1}y": points[:, k, 1].tolist()}
    begins = [float(clock[mine][0]) for mine in rows]
    origin = min(begins)
    log = {"trial": names, "start_time": [begin - origin for begin in begins], "group": [""] * len(names)}
    return PushLog(replace(rig, twist_window=motion.window), log, columns)


def _tell_doubts(recording: _Recording, made: PushLog, loads: _Loads | None, zero_forces: bool, alone: bool) -> None:
    """Warn of what looks wrong; ``alone``: the recording said not which rows are pushes."""
    t, tips, rows = recording.t, recording.tips, recording.rows
    channels = {"poses": recording.tracked, "tip positions": tips, "forces": recording.forces}
    lacking = [words for name, values in channels.items() if values is not None for words in covers(name, t, values)]
    if alone and tips is not None and loads is not None:
        beside = np.setdiff1d(np.arange(len(t)), np.concatenate(rows))
        sizes = np.linalg.norm(made.columns("fx", "fy")[made.samples["phase"] == "push"], axis=1)
        usual = float(np.nanmedian(sizes)) if np.isfinite(sizes).any() else math.inf
        lacking += pushes_unseen(t[beside], tips[beside], loads.readings[beside, :2], usual)
    origin = min(float(t[mine][0]) for mine in rows)
    rests = [] if loads is None else loads.rests
    _tell([*lacking, *doubts(made, bool(zero_forces), t[rests] - origin)])


def _tell(words: Sequence[str]) -> None:
    for line in words:
        # where the caller of log_from_arrays is
        warnings.warn(StablepushWarning(line), stacklevel=4)


def pokes_from_world(
    poses: ArrayLike,
    tip_positions: ArrayLike,
    forces: ArrayLike,
    times: ArrayLike,
    slider: Slider,
    trials: Sequence[str] | None = None,
    **how: Any,
) -> SlipPairs:
    """Return a load and a slip twist of each poke that was recorded in the world frame, as a fit takes them.

    Rows, contact, zero of the sensor and twists are those of :func:`log_from_arrays`. Of each poke count the rows in contact
    whose fastest point of the outline moves at no less than 0.3 of the 95th percentile in the poke: there the slider slips, and
    the load is that of sliding friction. The load (N, N·m) and the twist (m/s, rad/s) are means over those rows, both in B. A
    poke in which no point of the outline travels 0.3 mm missed the slider, or did not move it, and is left out.

    Parameters
    ----------
    poses, tip_positions, forces, times, trials
        As :func:`log_from_arrays` takes them: (n, 3), (n, 2), (n, 2), (n,), n words; m, rad, N, s, in W.
    slider : Slider
        Its outline, in B.
    **how
        ``body_pose``, ``forces_on``, ``moments``, ``zero_forces``, ``window``, ``pose_delay``, ``force_angle`` of
        :func:`log_from_arrays`.

    Returns
    -------
    SlipPairs
        ``wrenches`` (k, 3), ``twists`` (k, 3) and the ``trials``: ``sp.fit_limit_surface(*pairs[:2], slider=slider)``.

    Raises
    ------
    InputError
        As :func:`log_from_arrays`, and if the slider slips in no poke.
    """
    if not isinstance(slider, Slider):
        raise InputError("slider", "expected a Slider", type(slider).__name__)
    if forces is None:
        raise InputError("forces", "expected forces, which a load is made of", "none")
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log = log_from_arrays(Rig(slider), times, poses, forces, tip_positions, trials, **how)
    for warning in heard:
        # as of this call
        warnings.warn(warning.message, warning.category, stacklevel=2)
    loads, twists, places = log.columns("fx", "fy", "tau"), log.columns("vx", "vy", "omega"), log.columns("x", "y", "theta")
    usable = (log.samples["phase"] == "push") & np.isfinite(loads).all(axis=1) & np.isfinite(twists).all(axis=1)
    speed = speeds_of(slider, twists)
    f, v, names, moving = [], [], [], 0
    for name in log.trials["trial"]:
        rows = log.rows(name)
        moved = travel(slider, places[rows]) >= LEAST_TRAVEL
        moving += moved
        rows = rows[usable[rows]]
        if moved and len(rows):
            rows = rows[speed[rows] >= SLIPS * np.percentile(speed[rows], 95)]
            f.append(loads[rows].mean(axis=0))
            v.append(twists[rows].mean(axis=0))
            names.append(name)
    if moving and not names:
        raise InputError("forces, tip_positions", "expected both where the slider moves", f"none in {moving} pokes that move it")
    if not names:
        raise InputError("poses", f"expected the slider to move by {1000 * LEAST_TRAVEL:g} mm in at least one poke")
    return SlipPairs(np.array(f), np.array(v), names)


def centered_rig(rig: Rig) -> tuple[Rig, FloatArray]:
    """Return a rig whose slider has the centroid of its area as origin, and the pose (3,) of that in the frame it had."""
    middle = shapely.get_coordinates(rig.slider.polygon.centroid)[0]
    support = rig.slider.support
    if support is not None:
        support = replace(support, points=support.points - middle)
    return replace(rig, slider=Slider(rig.slider.vertices - middle, rig.slider.mass, support)), np.array((*middle, 0.0))


def _with_gaps(values: ArrayLike, name: str, n: int, widths: tuple[int, ...]) -> FloatArray:
    """Rows (n, width) of numbers; one with a NaN is missing."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(name, "expected numbers") from None
    if array.ndim != 2 or array.shape[0] != n or array.shape[1] not in widths:
        shapes = " or ".join(f"({n}, {width})" for width in widths)
        raise InputError(name, f"expected shape {shapes}, a row for each time", array.shape)
    if np.isinf(array).any():
        raise InputError(name, "expected finite numbers, NaN for a missing one", "infinity")
    array[np.isnan(array).any(axis=1)] = np.nan
    return array


def _recorded_later(
    t: FloatArray, poses: FloatArray, delay: float, trials: list[np.ndarray[Any, np.dtype[np.intp]]]
) -> FloatArray:
    """Poses (n, 3) that were recorded ``delay`` (s) after each time, on lines between two of the same trial; else NaN."""
    found = np.full_like(poses, np.nan)
    for rows in trials:
        known = np.isfinite(poses[rows]).all(axis=1)
        if known.sum() > 1:
            clock, seen, asked = t[rows][known], poses[rows][known].copy(), t[rows] + delay
            seen[:, 2] = np.unwrap(seen[:, 2])
            moved = np.column_stack([np.interp(asked, clock, column, np.nan, np.nan) for column in seen.T])
            # within a gap of the tracker, or of the record, nothing is known
            after = np.clip(np.searchsorted(clock, asked), 1, len(clock) - 1)
            moved[clock[after] - clock[after - 1] > largest_step(np.diff(t[rows]))] = np.nan
            if not np.isfinite(moved).any():
                raise InputError("pose_delay", "expected less than a push lasts", f"{delay:g} s")
            found[rows] = moved
    return found


def _clock(times: ArrayLike) -> FloatArray:
    """Times (n,) from the first, whatever they count from: seconds since 1970 are more than other numbers may be."""
    try:
        t = np.array(times, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("times", "expected numbers") from None
    if t.ndim != 1 or not len(t):
        raise InputError("times", "expected at least one time, in a list", f"an array of shape {t.shape}")
    if not np.isfinite(t).all():
        raise InputError(f"times[{int(np.argmin(np.isfinite(t)))}]", "expected a finite number")
    return check_array(t - t[0], "times", (None,))


def _column(values: ArrayLike) -> Any:
    """A list of numbers as a table of one column; anything else as it is, to be refused."""
    array = np.asarray(values)
    return array[:, None] if array.ndim == 1 else array


def _touched(
    rig: Rig, body: FloatArray, pusher: FloatArray, distance: float, trials: np.ndarray, pushed: BoolArray
) -> FloatArray:
    """Contact points (n, 2, 2) in B of two fingers; NaN where one is away from the outline, and where nothing is ``pushed`` (n,).

    One of them certainly touches in a push. Where the tracked origin is off, or their radius is another, they seem to be farther
    from the outline or inside of it: the other touches if it is about as far.
    """
    points, gaps = np.empty((len(body), 2, 2)), np.empty((len(body), 2))
    for k, side in enumerate((-0.5, 0.5)):
        local = _into(body, compose(pusher, (0.0, side * distance, 0.0))[:, :2])
        points[:, k], _, away = contacts_on_outline(rig.slider.vertices, local)
        gaps[:, k] = away - (rig.finger_radius or 0.0)
    for name in dict.fromkeys(trials):
        rows = np.flatnonzero((trials == name) & pushed & np.isfinite(gaps).all(axis=1))
        seems = float(np.clip(np.median(gaps[rows], axis=0).min(), -_SEEMS, _SEEMS)) if len(rows) else 0.0
        gaps[trials == name] -= seems
    points[~(gaps < _TOUCHES) | ~pushed[:, None]] = np.nan
    return points


def _into(poses: FloatArray, points: FloatArray) -> FloatArray:
    """Points (n, 2) of W, one for each pose (n, 3), as the frame of that pose has them."""
    return rotate_vectors(-poses[:, 2], points - poses[:, :2])


def _outside(slider: Slider, body: FloatArray, tips: FloatArray, distance: float, pushes: np.ndarray) -> FloatArray:
    """How far (n,) in m a tip is outside the outline; of two fingers at a ``distance`` (m) the nearer one; inside is negative.

    Two fingers face the edge that they push at first: how the tool holds them follows from rows ``pushes`` of then. If its
    heading is not known, both are taken to be as near as they may be.
    """
    centers, reach = [tips[:, :2]], 0.0
    if distance and tips.shape[1] == 3:
        pushes = pushes[np.isfinite(np.column_stack((body, tips))[pushes]).all(axis=1)]
        held = np.exp(1j * (_faced(slider, body[pushes], tips[pushes, :2]) - tips[pushes, 2]))
        faces = tips[:, 2] + float(np.angle(held.sum()))
        side = 0.5 * distance * np.column_stack((-np.sin(faces), np.cos(faces)))
        centers = [tips[:, :2] + side, tips[:, :2] - side]
    elif distance:
        reach = 0.5 * distance
    nearer = np.min([contacts_on_outline(slider.vertices, _into(body, center))[2] for center in centers], axis=0)
    return np.maximum(nearer - reach, np.minimum(nearer, 0.0))


def _touching(tips: FloatArray, places: FloatArray, phases: np.ndarray[Any, np.dtype[np.object_]]) -> BoolArray:
    """Rows (n,) of a push in which a tip is as near to the outline as it usually is."""
    away, pushed = np.linalg.norm(tips - places, axis=1), phases == "push"
    usual = float(np.median(away[pushed & np.isfinite(away)])) if (pushed & np.isfinite(away)).any() else np.nan
    return np.asarray(pushed & (away < usual + _TOUCHES))


def _pushers(slider: Slider, body: FloatArray, tips: FloatArray, phases: np.ndarray[Any, np.dtype[np.object_]]) -> FloatArray:
    """Poses (n, 3) of the pusher in W: the tip, its x axis the inward normal of the touched edge at first touch.

    The axis turns with the tool where the tip has a heading, and keeps its direction where it has none.
    """
    seen = np.flatnonzero((phases == "push") & np.isfinite(body).all(axis=1) & np.isfinite(tips).all(axis=1))
    found = np.column_stack((tips[:, :2], np.full(len(tips), np.nan)))
    if not len(seen):
        return found
    first = seen[0]
    heading = float(_faced(slider, body[first : first + 1], tips[first : first + 1, :2])[0])
    found[:, 2] = heading + (tips[:, 2] - tips[first, 2] if tips.shape[1] == 3 else 0.0)
    return found


def _faced(slider: Slider, body: FloatArray, tips: FloatArray) -> FloatArray:
    """Headings (n,) in W of the inward normals of the edges that are nearest to tips (n, 2)."""
    ends = np.stack((slider.vertices, np.roll(slider.vertices, -1, axis=0)), axis=1)
    touched, _ = nearest_on_outline(slider.vertices, _into(body, tips))
    edge = np.argmin(shapely.distance(shapely.linestrings(ends), shapely.points(touched)[:, None]), axis=1)
    along = (ends[:, 1] - ends[:, 0])[edge]
    return np.asarray(body[:, 2] + np.arctan2(along[:, 0], -along[:, 1]))
