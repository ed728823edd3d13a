"""The pushes of a log carried out again in simulation: from where the slider lay, by the pusher's way as logged or commanded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.contact import PushContact
from stablepush.diagnosis.observations import Observations, nearest
from stablepush.effects import principal
from stablepush.errors import ConvergenceError, InputError
from stablepush.logs import Noise, PushLog
from stablepush.models import IdealLimitSurface
from stablepush.planar import transport_twist, twist_from_cor
from stablepush.pushing import Pusher, TableFriction, simulate_push
from stablepush.se2 import compose, exp, inverse, transform_points, wrap_angle
from stablepush.se2 import log as log_of
from stablepush.slider import Slider

#: Radius (m) of fingers that is not known: where they go is told at the contact.
_RADIUS = 5e-3
#: Contact points nearer than this (m) are one finger's.
_SAME_POINT = 1e-3
#: Way (m) of a finger in a step of the simulation: ends are within about 0.01 mm of those of small steps.
_STEP = 2e-3
#: Parameters of effects that change where a slider goes, sizes of them that count as small, and the least radius of a finger.
MOVING: Mapping[str, float] = {
    "anisotropy-world": 0.05, "anisotropy-object": 0.05, "spatial-variation": 0.2, "pressure-shift": 1e-3,
    "pressure-spread": 0.05, "tilt": 5e-3, "contact-friction": 0.03, "contact-geometry": 5e-4, "frame-offset": 5e-4,
    "latency": 0.02,
}  # fmt: skip
_THIN = 1e-4
#: Pieces of constant twist that a logged way is followed in, at most.
_MOST_PIECES = 16
#: Draws of the noise of first poses.
_DRAWS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """A push to be carried out again.

    Attributes
    ----------
    trial : int
        Its number in the log.
    start, end : array, shape (3,)
        First and last pose of the tracked frame in W.
    pusher : Pusher
    place, motion
        The pusher's first pose in W, and twists in its own frame with durations.
    logged : bool
        Whether the motion is the way as it was logged, up to the last pose; else as it was commanded, to rest.
    contact : PushContact, optional
        Where two fingers touch at first, in B.
    """

    trial: int
    start: FloatArray
    end: FloatArray
    pusher: Pusher
    place: FloatArray
    motion: list[tuple[FloatArray, float]]
    logged: bool
    contact: PushContact | None


def replays(log: PushLog, observations: Observations) -> list[Replay]:
    """Return the pushes of a log whose way is known, and where the slider was before and after."""
    s, o, rig = log.samples, observations, log.rig
    outline, two = rig.slider.vertices, rig.contact_kind == "two-point"
    if rig.contact_kind == "held":
        return []

    def columns(*names: str) -> FloatArray:
        blank = np.full(len(s["t"]), np.nan)
        return np.stack([np.asarray(s[c], dtype=np.float64) if c in s else blank for c in names], axis=-1)

    poses, pushers, times = columns("x", "y", "theta"), columns("px", "py", "ptheta"), columns("t")[:, 0]
    if not two:
        # how a single round finger is turned does not matter
        pushers[:, 2] = np.where(np.isfinite(pushers[:, 2]), pushers[:, 2], 0.0)
    points = columns("c1x", "c1y", "c2x", "c2y").reshape(-1, 2, 2)
    spread = np.linalg.norm(points[:, 0] - points[:, 1], axis=1)
    half = float(np.median(spread[np.isfinite(spread)])) / 2 if np.isfinite(spread).any() else math.nan
    radius = o.finger_radius if o.finger_radius is not None else _RADIUS
    mu = rig.contact_friction if rig.contact_friction is not None else 1.0
    known, told = np.isfinite(poses).all(axis=1) & np.isfinite(times), np.isfinite(pushers).all(axis=1)
    places = np.array(((0.0, half), (0.0, -half))) if two else np.zeros((1, 2))
    wanted = ("cor_x", "cor_y", "sense", "angle")
    commanded = {c: np.asarray(log.trials[c], dtype=np.float64) for c in wanted} if set(wanted) <= set(log.trials) else {}
    found: list[Replay] = []
    for trial, name in enumerate(o.names):
        rows = log.rows(name)
        rows = rows[np.argsort(times[rows], kind="stable")]
        seen, both = rows[known[rows]], rows[(known & told)[rows]]
        both = both[np.concatenate(([True], np.diff(times[both]) > 0))] if len(both) else both
        if len(both) >= 2 and np.isfinite(places).all():
            # of many rows, places on the way that are even in time
            both = both[np.unique(np.linspace(0, len(both) - 1, min(len(both), _MOST_PIECES + 1)).round().astype(int))]
            contact = None
            if two:
                fingers = transform_points(compose(inverse(poses[both[0]]), pushers[both[0]]), places)
                contact = _contact(*nearest(outline, fingers)[:2], mu)
            motion = []
            for i, j in pairwise(both):
                step = compose(inverse(pushers[i]), pushers[j])
                step[2] = wrap_angle(step[2])
                span = float(times[j] - times[i])
                motion.append((log_of(step) / span, span))
            found.append(
                Replay(
                    trial, poses[both[0]], poses[both[-1]], Pusher(places, radius), pushers[both[0]], motion, True, contact
                )
            )  # fmt: skip
            continue
        touching = rows[np.isfinite(points[rows]).all(axis=(1, 2))]
        if len(seen) < 2 or not len(touching) or not commanded:
            continue
        cor_x, cor_y, sense, angle = (float(commanded[c][trial]) for c in wanted)
        contact = _contact(*nearest(outline, points[touching[0]])[:2], mu)
        if contact is None or not np.isfinite((cor_x, cor_y, sense, angle)).all():
            continue
        pusher = Pusher.of_contact(contact, radius)
        docked = pusher.docked(contact)
        twist = transport_twist(twist_from_cor((cor_x, cor_y), sense), inverse(docked))
        start = poses[seen[0]]
        found.append(Replay(trial, start, poses[seen[-1]], pusher, compose(start, docked), [(twist, abs(angle))], False, contact))
    return found


def _contact(points: FloatArray, normals: FloatArray, mu: float) -> PushContact | None:
    apart = len(points) == 2 and np.linalg.norm(points[0] - points[1]) >= _SAME_POINT
    return PushContact(points, normals, mu) if apart else None


def friction_of(surface: IdealLimitSurface, values: Mapping[str, FloatArray], weight: float) -> TableFriction:
    """Return the friction of the table for fitted parameters of effects; ``weight`` of the slider in N."""
    tables = []
    for id in ("anisotropy-object", "anisotropy-world"):
        a, b = values.get(id, np.zeros(2))
        size = min(float(np.hypot(a, b)), 0.9)
        tables.append(principal(math.sqrt((1 + size) / (1 - size)), 0.5 * math.atan2(b, a)))
    gradient, slope = values.get("spatial-variation", np.zeros(2)), values.get("tilt", np.zeros(2))
    support = surface.support
    points = support.points
    if "pressure-spread" in values:
        points = support.center + (1 + values["pressure-spread"][0]) * (points - support.center)
    points = points + values.get("pressure-shift", np.zeros(2))
    moved = IdealLimitSurface(type(support)(points, support.weights), surface.friction_load, surface.characteristic_length)
    return TableFriction(moved, of_slider=tables[0], of_table=tables[1], gradient=gradient, pull=weight * slope)


def misses(
    pushes: Sequence[Replay],
    surface: IdealLimitSurface,
    slider: Slider,
    mu: float,
    weight: float,
    values: Mapping[str, FloatArray],
) -> FloatArray:
    """Return how far (n, 3) the slider was measured from where pushes end: the twist from one to the other, as ``(x, y, rho θ)``
    in m; NaN where a push cannot be simulated."""
    friction = friction_of(surface, values, weight)
    found = []
    for push in pushes:
        miss = compose(inverse(carry_out(push, friction, slider, mu, values)), push.end)
        miss[2] = wrap_angle(miss[2])
        found.append(log_of(miss) * (1, 1, slider.characteristic_length))
    return np.reshape(found, (-1, 3))


def carried(
    pushes: Sequence[Replay], surface: IdealLimitSurface, slider: Slider, mu: float, weight: float, noise: Noise
) -> FloatArray:
    """Return how far (n,) the ends of pushes move, in ``(x, y, rho θ)`` in m, when the first pose errs by its noise (root mean
    square); NaN where a push cannot be simulated."""
    rng = np.random.default_rng(0)
    sizes = np.array((noise.position, noise.position, noise.angle))
    nominal = misses(pushes, surface, slider, mu, weight, {})
    squares = np.zeros(len(pushes))
    for _ in range(_DRAWS):
        other = [replace(push, start=push.start + sizes * rng.normal(size=3)) for push in pushes]
        squares += ((misses(other, surface, slider, mu, weight, {}) - nominal) ** 2).sum(axis=1) / _DRAWS
    return np.asarray(np.sqrt(squares))


def carry_out(replay: Replay, friction: TableFriction, slider: Slider, mu: float, values: Mapping[str, FloatArray]) -> FloatArray:
    """Return the pose (3,) of the tracked frame where a push ends; NaN where it cannot be simulated."""
    offset = np.array((*values.get("frame-offset", np.zeros(2)), 0.0))
    delay = float(values.get("latency", np.zeros(1))[0]) if replay.logged else 0.0
    pusher = replay.pusher
    if replay.logged and "contact-geometry" in values:
        pusher = Pusher(pusher.fingers, max(_THIN, pusher.radius + float(values["contact-geometry"][0])))
    mu = max(0.0, mu + float(values.get("contact-friction", np.zeros(1))[0]))
    # the tracked origin lies off the centre of mass by the offset
    start = compose(replay.start, -offset)
    try:
        trace = simulate_push(friction, slider, pusher, mu, start, replay.place, replay.motion, step=_STEP)
    except (InputError, ConvergenceError):
        return np.full(3, np.nan)
    end = trace.poses[-1]
    if delay > 0:
        at = max(0.0, float(trace.t[-1]) - delay)
        i = int(np.clip(np.searchsorted(trace.t, at), 1, len(trace.t) - 1))
        share = (at - trace.t[i - 1]) / (trace.t[i] - trace.t[i - 1])
        end = compose(trace.poses[i - 1], exp(share * log_of(compose(inverse(trace.poses[i - 1]), trace.poses[i]))))
    elif delay < 0:
        # poses ahead of the pusher: on as it went last
        last = trace.t[-1] - trace.t[-2]
        end = compose(end, exp(-delay / last * log_of(compose(inverse(trace.poses[-2]), end))))
    return compose(end, offset)
