"""The pushes of a log carried out again in simulation: from where the slider lay, by the pusher's path as logged or commanded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from stablepush.core import BoolArray, ConvergenceError, FloatArray, InputError, in_threads
from stablepush.diagnosis.likelihood.nominal import Nominal, nominal_of
from stablepush.diagnosis.rows.fingers import finger_places
from stablepush.diagnosis.rows.observations import Observations
from stablepush.effects import CATALOGUE, EffectKind, PushSetup, in_order, with_effects
from stablepush.geometry import (
    compose,
    contacts_on_outline,
    inverse,
    log as log_of,
    transform_points,
    transport_twist,
    twist_from_cor,
    wrap_angle,
)
from stablepush.io import Noise, PushLog, distinct
from stablepush.mechanics import MotionProfile, Pusher, TableFriction, motion_profile, rollout
from stablepush.objects import PushContact, Slider
from stablepush.surfaces import IdealLimitSurface

#: Radius (m) of fingers that is not known: where they go is found at the contact.
_RADIUS = 5e-3
#: Contact points nearer than this (m) are one finger's.
_SAME_POINT = 1e-3
#: Travel of a finger in a step of the simulation, in m and over the slider's radius of gyration, the greater of the two: final
#: poses are within about 0.1 mm of those of small steps on a slider of 5 cm.
_STEP, _STEP_SHARE = 2e-3, 0.04
#: Least radius (m) of a finger.
_THIN = 1e-4
#: Largest number of pieces of constant twist that stand for a logged path, but for one in which the pusher stands at its end.
_MOST_PIECES = 16
#: A final pose can be predicted if noise of the first pose moves it by no more than this multiple of that noise.
AMPLIFIED = 10.0
#: Least rows of a stretch of a push, and noise of poses where none is stated: what it is does not matter, how it grows does.
_FEWEST_ROWS, _NOISE = 4, Noise(0.0, 1e-4, 1e-3)
#: Lever (m) by which turns of the pusher count as travel, and how near (m) it is to its last place when it stands.
_ARM, _STANDS = 0.05, 3e-4
#: Draws of the noise of first poses.
_DRAWS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """A push to be carried out again.

    Attributes
    ----------
    trial : int
        Its number in the log.
    order : float
        Its place in the log, from 0 to 1.
    start, end : array, shape (3,)
        First and last pose of the tracked frame in W.
    pusher : Pusher
    place, profile
        The pusher's first pose in W, and its motion profile from there.
    logged : bool
        Whether the motion is the path as it was logged, up to the last pose; else as it was commanded, to rest.
    off : tuple of floats
        Fingers, 1 or 0, whose radius may be another.
    """

    trial: int
    order: float
    start: FloatArray
    end: FloatArray
    pusher: Pusher
    place: FloatArray
    profile: MotionProfile
    logged: bool
    off: tuple[float, ...]

    def thicker(self, change: float) -> Pusher:
        """Return the pusher with a change (m) of the fingers that are off; one of two is moved ahead by it, which is the same
        while the face is square to the pusher."""
        pusher = self.pusher
        if all(self.off):
            return Pusher(pusher.fingers, max(_THIN, pusher.radius + change))
        return Pusher(pusher.fingers + change * np.outer(self.off, (1.0, 0.0)), pusher.radius)


class _Sheet:
    """Columns of a log's samples, and what is known of its fingers."""

    def __init__(self, log: PushLog, observations: Observations) -> None:
        s, rig = log.samples, log.rig
        self.log, self.outline = log, rig.slider.vertices
        self.step = step_of(rig.slider)
        self.poses, self.pushers, self.times = (
            log.columns("x", "y", "theta"),
            log.columns("px", "py", "ptheta"),
            log.columns("t")[:, 0],
        )
        self.points = log.columns("c1x", "c1y", "c2x", "c2y").reshape(-1, 2, 2)
        self.phases = np.asarray(s["phase"]) if "phase" in s else None
        self.two = rig.contact_kind == "two-point"
        if not self.two:
            # how a single round finger is turned does not matter
            self.pushers[:, 2] = np.where(np.isfinite(self.pushers[:, 2]), self.pushers[:, 2], 0.0)
        self.places, self.order = finger_places(log), observations.trial_order
        self.off = observations.off if self.two else (1.0,)
        self.radius = observations.finger_radius if observations.finger_radius is not None else _RADIUS
        self.mu = rig.contact_friction if rig.contact_friction is not None else 1.0
        self.seen: BoolArray = np.asarray(np.isfinite(self.poses).all(axis=1) & np.isfinite(self.times))
        self.known: BoolArray = self.seen & np.isfinite(self.pushers).all(axis=1) & bool(np.isfinite(self.places).all())
        self.touched: BoolArray = np.asarray(np.isfinite(self.points).all(axis=(1, 2)))

    def rows(self, trial: str) -> np.ndarray:
        rows = self.log.rows(trial)
        return np.asarray(rows[np.argsort(self.times[rows], kind="stable")])

    def path(self, trial: str) -> np.ndarray:
        """Rows of a trial, in the order of time, in which slider and pusher are seen."""
        rows = self.rows(trial)
        rows = rows[self.known[rows]]
        return np.asarray(rows[distinct(self.times[rows])])

    def contact(self, rows: np.ndarray) -> PushContact | None:
        """Where two fingers are nearest to the outline in the first row that shows it, else the contact points that it logs."""
        known, touched = rows[self.known[rows]], rows[self.touched[rows]]
        if self.two and len(known):
            places = transform_points(compose(inverse(self.poses[known[0]]), self.pushers[known[0]]), self.places)
        elif len(touched):
            places = self.points[touched[0]]
        else:
            return None
        points, normals, _ = contacts_on_outline(self.outline, places)
        apart = np.linalg.norm(points[0] - points[1]) >= _SAME_POINT
        return PushContact(points, normals, self.mu) if apart else None


def step_of(slider: Slider) -> float:
    """Return the travel (m) of a finger in a step of the simulation."""
    return max(_STEP, _STEP_SHARE * slider.characteristic_length)


def first_contacts(log: PushLog, observations: Observations) -> dict[int, PushContact]:
    """Return where two fingers touch at first, in B, of trials by number where the log shows it."""
    sheet = _Sheet(log, observations)
    found = {k: sheet.contact(sheet.rows(name)) for k, name in enumerate(observations.names)}
    return {k: contact for k, contact in found.items() if contact is not None}


def replays(log: PushLog, observations: Observations, whole: bool = False) -> list[Replay]:
    """Return the pushes of a log whose path is known, and where the slider was before and after.

    A push by one finger is unstable: after some widths of the slider nobody can tell from its first pose where it ends. It is
    replayed in stretches, each from where the slider was seen, that are as long as its end can be told from their first pose;
    not if pushes are to be ``whole``.
    """
    if log.rig.contact_kind == "held":
        return []
    sheet = _Sheet(log, observations)
    found, paths = [], {}
    for k, name in enumerate(observations.names):
        # a pusher whose poses jump farther than anything moves
        with suppress(InputError):
            rows = sheet.path(name)
            push = _logged(sheet, k, rows) or _commanded(sheet, k, name)
            if push is not None:
                found.append(push)
                paths[push] = rows
    return found if whole else list(_in_stretches(sheet, found, paths))


def _in_stretches(sheet: _Sheet, pushes: list[Replay], paths: Mapping[Replay, np.ndarray]) -> Iterator[Replay]:
    """Yield pushes whose final pose can be told, and the halves of others by a logged path, and theirs."""
    rig = sheet.log.rig
    believed, noise = nominal_of(rig), rig.noise or _NOISE
    table = friction_of(believed, believed.points, {}, 0.0)
    own = np.linalg.norm((noise.position, noise.position, rig.slider.characteristic_length * noise.angle))
    while pushes:
        _, moved = carried(pushes, table, rig.slider, sheet.mu, noise)
        halves: list[Replay] = []
        for push, far in zip(pushes, np.linalg.norm(moved, axis=1), strict=True):
            rows = paths[push]
            # where it cannot be simulated, or has too few rows, nothing is gained
            if not far > AMPLIFIED * own or not push.logged or len(rows) < 2 * _FEWEST_ROWS:
                yield push
                continue
            middle = len(rows) // 2
            parts = [(part, _logged(sheet, push.trial, part)) for part in (rows[: middle + 1], rows[middle:])]
            if any(half is None for _, half in parts):
                yield push
                continue
            for part, half in parts:
                if half is not None:
                    halves.append(half)
                    paths = {**paths, half: part}
        pushes = halves


def _logged(sheet: _Sheet, trial: int, rows: np.ndarray) -> Replay | None:
    """A push, or a stretch of one, by the pusher's logged path in these rows."""
    if len(rows) < 2:
        return None
    rows = _knots(rows, sheet.pushers, sheet.phases)
    motion = []
    for i, j in pairwise(rows):
        step = compose(inverse(sheet.pushers[i]), sheet.pushers[j])
        step[2] = wrap_angle(step[2])
        span = float(sheet.times[j] - sheet.times[i])
        motion.append((log_of(step) / span, span))
    first, last = rows[0], rows[-1]
    pusher = Pusher(sheet.places, sheet.radius)
    profile = motion_profile(pusher, motion, sheet.step)
    return Replay(
        trial, sheet.order[trial], sheet.poses[first], sheet.poses[last], pusher, sheet.pushers[first], profile, True, sheet.off
    )


def _commanded(sheet: _Sheet, trial: int, name: str) -> Replay | None:
    """A rotation as it was commanded, from where the fingers touch at first."""
    wanted = ("cor_x", "cor_y", "sense", "angle")
    rows = sheet.rows(name)
    seen, touched = rows[sheet.seen[rows]], rows[sheet.touched[rows]]
    if not set(wanted) <= set(sheet.log.trials) or len(seen) < 2 or not len(touched):
        return None
    cor_x, cor_y, sense, angle = (float(sheet.log.trials[c][trial]) for c in wanted)
    contact = sheet.contact(touched[:1])
    # where the slider was last seen while it was pushed, the rotation was not at its end
    unfinished = sheet.phases is not None and sheet.phases[seen[-1]] == "push"
    if contact is None or unfinished or not np.isfinite((cor_x, cor_y, sense, angle)).all():
        return None
    pusher = Pusher.of_contact(contact, sheet.radius)
    docked = pusher.docked(contact)
    twist = transport_twist(twist_from_cor((cor_x, cor_y), sense), inverse(docked))
    start, end = sheet.poses[seen[0]], sheet.poses[seen[-1]]
    profile = motion_profile(pusher, [(twist, abs(angle))], sheet.step)
    return Replay(trial, sheet.order[trial], start, end, pusher, compose(start, docked), profile, False, sheet.off)


def _knots(rows: np.ndarray, pushers: FloatArray, phases: np.ndarray | None) -> np.ndarray:
    """Rows (k,) at places that are evenly spaced on the pusher's path, from the last one before the push."""
    if phases is not None and (phases[rows] == "push").any():
        rows = rows[max(0, int(np.argmax(phases[rows] == "push")) - 1) :]
    steps = np.diff(pushers[rows], axis=0)
    travelled = np.concatenate(([0.0], np.cumsum(np.hypot(*steps[:, :2].T) + _ARM * np.abs(wrap_angle(steps[:, 2])))))
    if len(rows) <= _MOST_PIECES + 1 or travelled[-1] == 0:
        return rows
    # a row that is at one of the places but for rounding is the one
    at = np.searchsorted(travelled - 1e-9, np.linspace(0, travelled[-1], _MOST_PIECES + 1), side="right") - 1
    # where it stops, for poses that lag catch up while it stands
    left = pushers[rows] - pushers[rows[-1]]
    stops = np.argmax((np.hypot(*left[:, :2].T) + _ARM * np.abs(wrap_angle(left[:, 2])) > _STANDS)[::-1])
    return rows[np.unique((*at, len(rows) - max(1, int(stops)), len(rows) - 1))]


def _moving(values: Mapping[str, FloatArray]) -> list[EffectKind]:
    """Effects that change where a slider goes, in the order of the catalogue."""
    return [kind for id, kind in CATALOGUE.items() if kind.pose_step and id in values]


def friction_of(believed: Nominal, surface: IdealLimitSurface, values: Mapping[str, FloatArray], weight: float) -> TableFriction:
    """Return the friction of the table for the friction of points and fitted numbers of effects; ``weight`` of the slider in N.

    Terms of families are not simulated.
    """
    acting = {kind.id: kind.numbers(values[kind.id]) for kind in _moving(values)}
    moved, fields = with_effects(surface, acting, weight, 0.0, surface.support.center)
    return believed.table(moved, **fields)


def pose_errors(
    pushes: Sequence[Replay],
    friction: TableFriction,
    slider: Slider,
    mu: float,
    values: Mapping[str, FloatArray],
) -> FloatArray:
    """Return pose errors (n, 3): the twist from the simulated to the measured final pose, as ``(x, y, rho θ)`` in m; NaN where a
    push cannot be simulated."""
    table = friction.compiled()

    def pose_error(push: Replay) -> FloatArray:
        error = compose(inverse(carry_out(push, table, slider, mu, values)), push.end)
        error[2] = wrap_angle(error[2])
        return np.asarray(log_of(error) * (1, 1, slider.characteristic_length))

    return np.reshape(in_threads(pose_error, pushes), (-1, 3))


def carried(
    pushes: Sequence[Replay], friction: TableFriction, slider: Slider, mu: float, noise: Noise
) -> tuple[FloatArray, FloatArray]:
    """Return pose errors (n, 3), and how far (n, 3) the final poses move, in ``(x, y, rho θ)`` in m, when the first pose errs by
    its noise (root mean squares over the draws that can be simulated: no finger may begin inside of the slider); NaN where there
    is none."""
    rng = np.random.default_rng(0)
    sizes = np.array((noise.position, noise.position, noise.angle))
    nominal = pose_errors(pushes, friction, slider, mu, {})
    squares, counts = np.zeros_like(nominal), np.zeros_like(nominal)
    for _ in range(_DRAWS):
        other = [replace(push, start=push.start + sizes * rng.normal(size=3)) for push in pushes]
        moved = pose_errors(other, friction, slider, mu, {}) - nominal
        squares += np.nan_to_num(moved) ** 2
        counts += np.isfinite(moved)
    return nominal, np.sqrt(np.where(counts > 0, squares / np.maximum(counts, 1), np.nan))


def carry_out(replay: Replay, table: Any, slider: Slider, mu: float, values: Mapping[str, FloatArray]) -> FloatArray:
    """Return the pose (3,) of the tracked frame where a push ends, on a table as compiled; NaN where it cannot be simulated."""
    moving = in_order(_moving(values))
    setup = PushSetup(replay.start, replay.pusher, mu)
    for kind in moving:
        setup = kind.at_start(setup, replay, values[kind.id])
    try:
        trace = rollout(table, slider, setup.pusher, setup.mu, setup.start, replay.place, replay.profile)
    except (InputError, ConvergenceError):
        return np.full(3, np.nan)
    end = trace.poses[-1]
    for kind in moving:
        end = kind.at_end(end, trace, replay, values[kind.id])
    return end
