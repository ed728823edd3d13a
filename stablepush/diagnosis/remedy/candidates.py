"""Pushes that a lab could make next, and what they would read if an effect acted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.equations import Fitted
from stablepush.diagnosis.likelihood.forward import PARAMETERS, SMALL, ForwardModel
from stablepush.diagnosis.likelihood.motions import Motions
from stablepush.diagnosis.likelihood.replay import MOVING, Replay, carry_out, step_of
from stablepush.diagnosis.likelihood.system import System
from stablepush.diagnosis.rows.observations import Observations
from stablepush.geometry import compose
from stablepush.mechanics import motion_profile
from stablepush.objects import EdgePush, Slider
from stablepush.rig import edge_command

#: Headings of the slider and speeds (m/s) that are looked at.
_HEADINGS, _SPEEDS = 12, (0.005, 0.02, 0.06)
#: Places along x and y in W: two that hold this share of the log's poses between them, and are at least so far (m) to either side
#: of their middle.
_BETWEEN, _ASIDE = 0.8, 0.03
#: Distance of a push, in m.
_DISTANCE = 0.04
#: Distance (m) that fingers keep from the corners of an edge.
_FROM_CORNERS = 3e-3
#: Without forces: positions along the free length of an edge, directions (rad from the normal), and how many of all these pushes
#: are simulated, drawn at random.
_ALONG, _DIRECTIONS, _DRAWN = (0.2, 0.5, 0.8), (-0.4, 0.0, 0.4), 120
#: How much farther (m) from the slider than a lab would such a push begins.
_BACK = 8e-3


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Pushes as entries of a list, and what they would read.

    ``readings(id, fitted, step)`` (n, r): readings over their noise, with an effect a step away from where it was fitted, NaN for
    pushes that cannot be simulated so;
    ``small(id)``: a step that counts as small; ``expected``: in words and units, a difference of the readings of one push.
    """

    entries: list[EdgePush]
    readings: Callable[[str, Fitted, FloatArray], FloatArray]
    small: Callable[[str], float]
    expected: Callable[[FloatArray], dict[str, float]]


def loads_of(system: System) -> Candidates:
    """Loads while the slider is pushed straight at the middle of an edge; clearances between fingers and outline if the log has
    them."""
    entries, inward, o = _straight(system)
    inertia, beyond_points = system.rig.slider.radius_of_gyration**2, system.believed.beyond_points(o.twist)
    model = ForwardModel(o, system.points, system.weight, inertia, system.center, beyond_points)
    noise = np.array((system.noise.force, system.noise.force, system.noise.moment))
    seen = any(len(rows) for _, rows in system.clearance_rows)

    def readings(id: str, fitted: Fitted, step: FloatArray) -> FloatArray:
        value = fitted.values[id] + step
        effects = {**fitted.values, id: value}
        load = model.predict(system.of_last(fitted.loads), {k: v for k, v in effects.items() if k in PARAMETERS})
        return np.column_stack((load / noise, seen * _clearance_change(id, value, inward, o.twist) / system.clearance_noise))

    def expected(difference: FloatArray) -> dict[str, float]:
        force = float(np.linalg.norm(difference[:3] * noise / (1, 1, system.rho)))
        return {"expected_difference_N": force, "expected_difference_m": float(np.abs(difference[3]) * system.clearance_noise)}

    return Candidates(entries, readings, lambda id: SMALL.get(id, 1e-4), expected)


def final_poses_of(system: Motions) -> Candidates:
    """Final poses of the slider if a pusher like the log's pushes it, off the middle of an edge and askew as well."""
    drawn = _drawn(system) if system.pushes else []
    kept, _ = system.predictable([push for _, push in drawn])
    if not kept:
        return Candidates([], lambda *_: np.zeros((0, 3)), lambda _: 0.0, lambda _: {})
    rig, table = system.rig, system.table(system.nominal, {}).compiled()
    # pose errors about the final pose of a push are small
    kept = [replace(push, end=carry_out(push, table, rig.slider, system.mu, {})) for push in kept]
    noise = np.median(system.spread.reshape(-1, 3), axis=0)

    def readings(id: str, fitted: Fitted, step: FloatArray) -> FloatArray:
        effects = {**fitted.values, id: fitted.values[id] + step}
        return system.simulated_errors(kept, fitted.loads, effects) / noise

    def expected(difference: FloatArray) -> dict[str, float]:
        return {"expected_difference_of_ends_m": float(np.linalg.norm(difference * noise))}

    return Candidates([drawn[push.trial][0] for push in kept], readings, lambda id: MOVING.get(id, 1e-4), expected)


def _places(poses: FloatArray) -> list[tuple[float, float]]:
    """Two places (m in W) along x and along y, where the slider of a log with poses (n, 3) was."""
    low, high = np.quantile(poses[:, :2], ((1 - _BETWEEN) / 2, (1 + _BETWEEN) / 2), axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, _ASIDE)
    # to a millimetre, as a lab would place it
    return [tuple(np.round((m - h, m + h), 3).tolist()) for m, h in zip(middle, half, strict=True)]


def _with_room(slider: Slider, needed: float) -> list[tuple[int, float]]:
    """Edges, with their lengths (m), on which fingers stay clear of the corners; if there are none, those on which they fit."""
    edges = [(e, float(np.linalg.norm(b - a))) for e, (a, b) in enumerate(map(slider.edge, range(len(slider.vertices))))]
    roomy = [edge for edge in edges if edge[1] > needed + 2 * _FROM_CORNERS]
    return roomy or [edge for edge in edges if edge[1] > needed]


def _drawn(system: Motions) -> list[tuple[EdgePush, Replay]]:
    """Pushes by the log's pusher, as entries of a list and as they are simulated."""
    like, slider = system.pushes[0], system.rig.slider
    pusher = like.pusher
    half = float(np.abs(pusher.fingers[:, 1]).max()) + pusher.radius
    headings = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
    places = _places(np.array([push.start for push in system.pushes]))
    choices = (_with_room(slider, 2 * half), _ALONG, _DIRECTIONS, headings.tolist(), _SPEEDS, *places)
    sizes = [len(choice) for choice in choices]
    rng = np.random.default_rng(0)
    count = int(np.prod(sizes))
    found: list[tuple[EdgePush, Replay]] = []
    for number in rng.choice(count, min(_DRAWN, count), replace=False):
        (edge, length), share, direction, heading, speed, x, y = (
            choice[i] for choice, i in zip(choices, np.unravel_index(int(number), sizes), strict=True)
        )
        along = half + share * (length - 2 * half)
        start = np.array((x, y, heading))
        entry = EdgePush.on_edge(
            slider, edge, along, direction=direction, distance=_DISTANCE, speed=speed, width=pusher.width, start=start
        )
        command = edge_command(entry, pusher, start)
        # from farther away: an effect may bring finger and outline nearer
        motion = [(np.array((speed, 0.0, 0.0)), _BACK / speed), *command.motion]
        place = compose(command.pusher_pose, (-_BACK, 0.0, 0.0))
        push = Replay(
            len(found), 0.5, start, start, pusher, place, motion_profile(pusher, motion, step_of(slider)), like.logged, like.off
        )
        found.append((entry, push))
    return found


def _straight(system: System) -> tuple[list[EdgePush], FloatArray, Observations]:
    """Pushes, normals (n, 2) of the edges that they push, and rows as a log of them would have."""
    two = system.rig.contact_kind == "two-point"
    width = _apart(system) if two else 0.0
    needed = width + 2 * (system.observations.finger_radius or 0.0) if two else 0.0
    entries, twists, poses, places, normals = [], [], [], [], []
    for face, length in _with_room(system.rig.slider, needed):
        a, b = system.rig.slider.edge(face)
        along = (b - a) / length
        normal, middle = np.array((-along[1], along[0])), (a + b) / 2
        # a finger off the centre turns the slider about as much as its lever says, two fingers do not
        turn = 0.0 if two else float(middle[0] * normal[1] - middle[1] * normal[0]) / system.rho**2
        headings = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
        for heading, speed, x, y in product(headings, _SPEEDS, *_places(system.observations.pose)):
            start = (x, y, float(heading))
            entries.append(
                EdgePush.on_edge(system.rig.slider, face, length / 2, distance=_DISTANCE, speed=speed, width=width, start=start)
            )
            twists.append(speed * np.array((*normal, turn)) / np.hypot(1.0, turn * system.rho))
            poses.append((x, y, heading))
            places.append(middle)
            normals.append(normal)
    n = len(entries)
    # a small slider may have no edge that is long enough for the fingers
    pose, twist, place = (np.reshape(part, (n, size)) for part, size in ((poses, 3), (twists, 3), (places, 2)))
    rows = replace(
        system.observations,
        trial=np.arange(n),
        # they come after the log
        order=np.ones(n),
        time=np.zeros(n),
        pose=pose,
        twist=twist,
        acceleration=np.zeros((n, 3)),
        unsteady=np.zeros((n, 3)),
        wrench=np.zeros((n, 3)),
        pusher=compose(pose, np.column_stack((place, np.zeros(n)))) if n else np.zeros((0, 3)),
        normal=np.full((n, 2, 2), np.nan),
        place=np.full((n, 2, 2), np.nan),
        clearance=np.full((n, 2), np.nan),
        slip=np.full(n, np.nan),
        span=np.ones(n),
        noise_gain=np.ones(n),
    )
    return entries, np.reshape(normals, (n, 2)), rows


def _apart(system: System) -> float:
    """Distance (m) between the two fingers, as the log has it."""
    places = system.observations.place
    apart = np.linalg.norm(places[:, 0] - places[:, 1], axis=1)
    known = np.isfinite(apart)
    return float(np.median(apart[known])) if known.any() else 0.0


def _clearance_change(id: str, value: FloatArray, normals: FloatArray, twists: FloatArray) -> FloatArray:
    """Change (n,) of the clearances between finger and outline by an effect, in m, of straight pushes along normals (n, 2)."""
    if id == "contact-geometry":
        return np.full(len(normals), float(value[0]))
    if id == "frame-offset":
        return np.asarray(normals @ value[:2])
    if id == "latency":
        return np.asarray(-float(value[0]) * (normals * twists[:, :2]).sum(axis=1))
    return np.zeros(len(normals))
