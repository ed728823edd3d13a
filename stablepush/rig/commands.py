"""Commands of a pusher: for a push of an edge, for a contact that follows a twist, and campaigns of pushes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import (
    LEAST_POSITIVE,
    FloatArray,
    InputError,
    check_array,
    check_number,
    check_seed,
    check_share,
)
from stablepush.geometry import compose, inverse, transform_points, transport_twist, twist_from_cor
from stablepush.mechanics import Pusher
from stablepush.objects import EdgePush, PushContact, Slider

#: Commands of a campaign that are repeated.
_GROUPS = 4
#: How far (m) the pusher is from the face of the slider at first.
AWAY = 2e-3
#: Slack at the ends of an edge, as a share of its length, and of motions at right angles to the normal.
_END = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """A command of a pusher.

    Attributes
    ----------
    pusher_pose : array, shape (3,)
        First pose of the pusher's frame in W.
    motion : sequence of (twist (3,), duration)
        Of the pusher in its frame: m/s, rad/s; s.
    start : array, shape (3,), optional
        Pose in W to which the slider is reset; None leaves it where it lies.
    group : str
        The same for commands that repeat; blank if none does.
    speed, cor, sense, angle
        What is written down: m/s, COR (2,) in B and sense if it turns, angle turned in rad.
    pusher, mu : Pusher, float, optional
        If they differ from the rig's.
    """

    pusher_pose: FloatArray
    motion: Sequence[tuple[FloatArray, float]]
    start: FloatArray | None = None
    group: str = ""
    speed: float = math.nan
    cor: FloatArray | None = None
    sense: float = math.nan
    angle: float = math.nan
    pusher: Pusher | None = None
    mu: float | None = None


def edge_command(push: EdgePush, pusher: Pusher, pose: FloatArray) -> Command:
    """Return the command of a pusher for a push of an edge.

    It starts 2 mm away, goes straight to the face, comes up to speed in four parts, and goes on.

    Parameters
    ----------
    push : EdgePush
    pusher : Pusher
        Of the rig. If its fingers are not ``push.width`` apart, fingers of its radius that are take its place.
    pose : array, shape (3,)
        Of the slider in W before the push.
    """
    if abs(pusher.width - push.width) > LEAST_POSITIVE:
        pusher = Pusher.two_fingers(push.width, pusher.radius) if push.width else Pusher.finger(pusher.radius)
    docked = _docked(push, pusher)
    if push.cor is None:
        twist = np.array((math.cos(push.direction), math.sin(push.direction), 0.0))
    else:
        twist = twist_from_cor(_moved(inverse(docked), push.cor), push.sense)
        if (twist[0] - twist[2] * pusher.fingers[:, 1]).max() <= _END * _fastest(pusher, twist):
            raise InputError("cor", "expected a turn that moves a finger towards the slider")
    twist = twist * (push.speed / _fastest(pusher, twist))
    time = push.distance / push.speed
    pieces = [(np.array((push.speed / 4, 0.0, 0.0)), AWAY / (push.speed / 4))]
    pieces += [(twist * share, 0.05 * time / share) for share in (0.25, 0.5, 0.75)]
    pieces.append((twist, 0.85 * time))
    first = compose(compose(pose, docked), (-AWAY, 0.0, 0.0))
    angle = math.nan if push.cor is None else float(twist[2]) * time
    return Command(first, pieces, push.start, push.group, push.speed, push.cor, push.sense, angle, pusher)


def contact_push(
    contact: PushContact,
    twist: ArrayLike,
    duration: float,
    *,
    radius: float,
    pose: ArrayLike,
    reset: bool,
    speed: float = math.nan,
    group: str = "",
) -> Command:
    """Return a push by a contact whose pusher is docked at first and goes where a body twist would take it.

    Parameters
    ----------
    contact : PushContact
    twist : array-like, shape (3,)
        Of the slider in B (m/s, rad/s), if it stays stuck; held for ``duration`` s.
    radius : float
        Of the fingers in m; their centres stay behind the contact points by it.
    pose : array-like, shape (3,)
        Of B in W where the push is meant to start; ``reset``: the slider is placed there.
    speed : float
        What is written down, in m/s.
    group : str
        The same for repeats.
    """
    pusher = Pusher.of_contact(contact, radius)
    docked = pusher.docked(contact)
    body, at = check_array(twist, "twist", (3,)), check_array(pose, "pose", (3,))
    turning = abs(body[2]) > 1e-9
    return Command(
        pusher_pose=compose(at, docked),
        motion=[(transport_twist(body, inverse(docked)), duration)],
        start=at if reset else None,
        group=group,
        speed=speed,
        cor=np.array((-body[1], body[0])) / body[2] if turning else None,
        sense=float(np.sign(body[2])) if turning else math.nan,
        angle=float(body[2] * duration),
        pusher=pusher,
        mu=contact.mu,
    )


def random_pushes(  # noqa: PLR0913
    slider: Slider,
    pusher: Pusher,
    count: int = 60,
    *,
    seed: int = 0,
    groups: int | None = None,
    repeats: int = 4,
    speeds: tuple[float, float] = (0.004, 0.06),
    distances: tuple[float, float] = (0.02, 0.05),
    turning: float = 0.5,
    field: float = 0.3,
) -> list[EdgePush]:
    """Return a campaign of pushes that separates causes: varied faces, places, headings, speeds and poses, in random order.

    Parameters
    ----------
    slider, pusher
    count : int
        Pushes in all.
    seed : int
    groups, repeats : int
        So many of the commands are made ``repeats`` times each, which shows how far repeats scatter. If ``groups`` is not given,
        four; none of so few pushes that four do not fit.
    speeds, distances : tuple of float
        Ranges of the speed (m/s, evenly in its logarithm) and of the distance (m) of the faster finger after it meets the slider.
    turning : float
        Share of pushes with two fingers that turn about a centre.
    field : float
        Side (m) of the square of the table, about the origin of W, in which the slider is reset.
    """
    rng = np.random.default_rng(check_seed(seed))
    for name, pair in (("speeds", speeds), ("distances", distances)):
        low, high = (check_number(value, name, positive=True) for value in pair)
        if low > high:
            raise InputError(name, "expected the smaller number first", f"{low:g}, {high:g}")
    check_number(field, "field", at_least=0.0)
    check_share(turning, "turning")
    if groups is None:
        few = isinstance(count, int) and isinstance(repeats, int) and count < _GROUPS * repeats
        groups = 0 if few else _GROUPS
    for name, whole in (("count", count), ("groups", groups), ("repeats", repeats)):
        if isinstance(whole, bool) or not isinstance(whole, int | np.integer):
            raise InputError(name, "expected a whole number", repr(whole))
    if count < 1 or groups < 0 or repeats < 1 or groups * repeats > count:
        raise InputError("count", f"expected at least groups * repeats = {groups * repeats} pushes", count)
    half = float(np.abs(pusher.fingers[:, 1]).max()) + pusher.radius
    ends = [slider.edge(e) for e in range(len(slider.vertices))]
    lengths = np.array([float(np.linalg.norm(b - a)) for a, b in ends])
    clearance = lengths - 2.2 * half
    clearance = np.where(clearance > _END * lengths, clearance, 0.0)
    if not clearance.any():
        raise InputError("pusher", "expected one that fits on an edge of the slider")

    def one(group: str) -> EdgePush:
        edge = int(rng.choice(len(ends), p=clearance / clearance.sum()))
        arc_length = lengths[edge] / 2 + clearance[edge] * rng.uniform(-0.5, 0.5)
        pose = np.array((*rng.uniform(-field / 2, field / 2, 2), rng.uniform(-np.pi, np.pi)))
        speed, distance = float(np.exp(rng.uniform(*np.log(speeds)))), float(rng.uniform(*distances))
        direction, cor, sense = float(rng.uniform(-0.5, 0.5)), None, math.nan
        if len(pusher.fingers) == 2 and rng.random() < turning:
            # a centre beside the fingers, seen from them: the push turns as it goes
            sense = float(rng.choice((-1.0, 1.0)))
            cor = np.array((rng.uniform(-0.05, 0.05), sense * np.exp(rng.uniform(np.log(0.05), np.log(0.5)))))
        push = EdgePush.on_edge(
            slider, edge, arc_length, direction=direction, distance=distance, speed=speed, width=pusher.width, start=pose,
            sense=sense, group=group,
        )  # fmt: skip
        return push if cor is None else replace(push, cor=_moved(_docked(push, pusher), cor))

    repeated = [one(str(g + 1)) for g in range(groups)]
    pushes = [push for push in repeated for _ in range(repeats)]
    pushes += [one("") for _ in range(count - len(pushes))]
    return [pushes[i] for i in rng.permutation(len(pushes))]


def _docked(push: EdgePush, pusher: Pusher) -> FloatArray:
    """Pose (3,) in B of a pusher that touches where a push begins."""
    return np.array((*(push.point - pusher.radius * push.normal), math.atan2(push.normal[1], push.normal[0])))


def _moved(pose: FloatArray, point: FloatArray) -> FloatArray:
    """A point (2,) of a frame, seen from where the frame has that pose."""
    return transform_points(pose, point[None])[0]


def _fastest(pusher: Pusher, twist: FloatArray) -> float:
    """Speed (m/s) of the fastest finger."""
    x, y = pusher.fingers.T
    return float(np.hypot(twist[0] - twist[2] * y, twist[1] + twist[2] * x).max())
