"""Pushes that a lab could make next, and what they would read if an effect acted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.final_pose import FinalPose, FinalPoses
from stablepush.diagnosis.likelihood.forward import ForwardModel
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.diagnosis.likelihood.replay import Replay, carry_out, friction_of, step_of
from stablepush.diagnosis.rows.observations import Observations
from stablepush.effects import TouchingRows
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


#: A step of an effect that counts as small where it is shown by other readings alone.
_SMALL = 1e-4


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


def loads_of(likelihood: Likelihood) -> Candidates:
    """Loads while the slider is pushed straight at the middle of an edge; clearances between fingers and outline if the log has
    them."""
    experiment, touch = likelihood.experiment, likelihood.clearance
    entries, inward, o = _straight(experiment)
    inertia, beyond_points = experiment.rig.slider.radius_of_gyration**2, experiment.believed.beyond_points(o.twist)
    model = ForwardModel(o, experiment.points, experiment.weight, inertia, experiment.center, beyond_points)
    sensor, effects = experiment.noise, experiment.effects
    noise = np.array((sensor.force, sensor.force, sensor.moment))
    still, chosen = np.zeros_like(inward), np.arange(len(inward))
    at_fingers = TouchingRows(experiment.rows, 0, chosen, inward, o.twist[:, :2], still, 1.0, o.order)

    def readings(id: str, fitted: Fitted, step: FloatArray) -> FloatArray:
        value, kind = fitted.values[id] + step, effects[id]
        acting = {k: v for k, v in {**fitted.values, id: value}.items() if effects[k].slots is not None}
        load = model.predict(likelihood.prior.of_last(fitted.loads), acting)
        change = kind.clearance_slope(at_fingers, np.zeros(0)) @ value[: kind.size]
        return np.column_stack((load / noise, touch.is_seen * change / touch.noise))

    def expected(difference: FloatArray) -> dict[str, float]:
        force = float(np.linalg.norm(difference[:3] * noise / (1, 1, experiment.rho)))
        return {"expected_difference_N": force, "expected_difference_m": float(np.abs(difference[3]) * touch.noise)}

    return Candidates(entries, readings, lambda id: effects[id].small or _SMALL, expected)


def final_poses_of(likelihood: Likelihood, channel: FinalPose) -> Candidates:
    """Final poses of the slider if a pusher like the log's pushes it, off the middle of an edge and askew as well."""
    experiment, poses = likelihood.experiment, channel.poses
    drawn = _drawn(poses) if poses.pushes else []
    kept = poses.predictable([push for _, push in drawn]).pushes
    if not kept:
        return Candidates([], lambda *_: np.zeros((0, 3)), lambda _: 0.0, lambda _: {})
    rig, surface = experiment.rig, poses.prior.surface(poses.prior.nominal)
    table = friction_of(experiment.believed, surface, {}, experiment.moving_weight).compiled()
    # pose errors about the final pose of a push are small
    kept = [replace(push, end=carry_out(push, table, rig.slider, experiment.mu, {})) for push in kept]
    noise = np.median(channel.spread.reshape(-1, 3), axis=0)

    def readings(id: str, fitted: Fitted, step: FloatArray) -> FloatArray:
        effects = {**fitted.values, id: fitted.values[id] + step}
        return poses.errors(kept, fitted.loads, effects) / noise

    def expected(difference: FloatArray) -> dict[str, float]:
        return {"expected_difference_of_ends_m": float(np.linalg.norm(difference * noise))}

    entries = [drawn[push.trial][0] for push in kept]
    return Candidates(entries, readings, lambda id: experiment.effects[id].pose_step or _SMALL, expected)


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


def _drawn(poses: FinalPoses) -> list[tuple[EdgePush, Replay]]:
    """Pushes by the log's pusher, as entries of a list and as they are simulated."""
    like, slider = poses.pushes[0], poses.experiment.rig.slider
    pusher = like.pusher
    half = float(np.abs(pusher.fingers[:, 1]).max()) + pusher.radius
    headings = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
    places = _places(np.array([push.start for push in poses.pushes]))
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


def _straight(experiment: Experiment) -> tuple[list[EdgePush], FloatArray, Observations]:
    """Pushes, normals (n, 2) of the edges that they push, and rows as a log of them would have."""
    two = experiment.rig.contact_kind == "two-point"
    width = _apart(experiment) if two else 0.0
    needed = width + 2 * (experiment.observations.finger_radius or 0.0) if two else 0.0
    entries, twists, poses, places, normals = [], [], [], [], []
    for face, length in _with_room(experiment.rig.slider, needed):
        a, b = experiment.rig.slider.edge(face)
        along = (b - a) / length
        normal, middle = np.array((-along[1], along[0])), (a + b) / 2
        # a finger off the centre turns the slider about as much as its lever says, two fingers do not
        turn = 0.0 if two else float(middle[0] * normal[1] - middle[1] * normal[0]) / experiment.rho**2
        headings = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
        for heading, speed, x, y in product(headings, _SPEEDS, *_places(experiment.observations.pose)):
            start = (x, y, float(heading))
            entries.append(
                EdgePush.on_edge(
                    experiment.rig.slider, face, length / 2, distance=_DISTANCE, speed=speed, width=width, start=start
                )
            )
            twists.append(speed * np.array((*normal, turn)) / np.hypot(1.0, turn * experiment.rho))
            poses.append((x, y, heading))
            places.append(middle)
            normals.append(normal)
    n = len(entries)
    # a small slider may have no edge that is long enough for the fingers
    pose, twist, place = (np.reshape(part, (n, size)) for part, size in ((poses, 3), (twists, 3), (places, 2)))
    rows = replace(
        experiment.observations,
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


def _apart(experiment: Experiment) -> float:
    """Distance (m) between the two fingers, as the log has it."""
    places = experiment.observations.place
    apart = np.linalg.norm(places[:, 0] - places[:, 1], axis=1)
    known = np.isfinite(apart)
    return float(np.median(apart[known])) if known.any() else 0.0
