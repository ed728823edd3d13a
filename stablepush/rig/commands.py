"""What a pusher is told to do: single pushes, campaigns of them, and lists from files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import (
    FloatArray,
    InputError,
    check_array,
    check_number,
    check_seed,
    check_share,
    note_cors,
    note_distance,
    note_heading,
    note_push_speed,
)
from stablepush.geometry import compose, inverse, transform_points, transport_twist, twist_from_cor
from stablepush.io import IS_POSITIVE, IS_SENSE, Column, read_table
from stablepush.mechanics import Pusher
from stablepush.objects import PushContact, Slider
from stablepush.planning import PlanningProblem

#: How far (m) the pusher is from the face of the slider at first.
AWAY = 2e-3
#: Way (m) of a poke that does not say.
_WAY = 0.03
#: Slack at the ends of an edge, as a share of its length, and of motions at right angles to the normal.
_END = 1e-9
_POKES, _ROTATIONS = ("edge", "along"), ("cor_x", "cor_y", "sense", "angle")


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What a pusher is told to do.

    Attributes
    ----------
    place : array, shape (3,)
        First pose of the pusher's frame in W.
    motion : sequence of (twist (3,), duration)
        Of the pusher in its frame: m/s, rad/s; s.
    start : array, shape (3,), optional
        Where the slider is put in W; None leaves it where it lies.
    group : str
        The same for commands that repeat; blank if none does.
    speed, cor, sense, angle
        What is written down: m/s, COR (2,) in B and sense if it turns, angle turned in rad.
    pusher, mu : Pusher, float, optional
        If they differ from the rig's.
    """

    place: FloatArray
    motion: Sequence[tuple[FloatArray, float]]
    start: FloatArray | None = None
    group: str = ""
    speed: float = math.nan
    cor: FloatArray | None = None
    sense: float = math.nan
    angle: float = math.nan
    pusher: Pusher | None = None
    mu: float | None = None


def poke(
    slider: Slider,
    pusher: Pusher,
    edge: int,
    along: float,
    *,
    start: ArrayLike,
    direction: float = 0.0,
    way: float = _WAY,
    speed: float = 0.02,
    cor: ArrayLike | None = None,
    sense: float = math.nan,
    group: str = "",
) -> Command:
    """Return a push of an edge from 2 mm away: straight to the face, up to speed in four parts, then on.

    Parameters
    ----------
    slider : Slider
    pusher : Pusher
        It faces the edge.
    edge : int
    along : float
        Where the middle of the pusher meets the edge: way in m from its first vertex.
    start : array-like, shape (3,)
        Where the slider is put, in W.
    direction : float
        Of the pusher's motion, in rad from the inward normal, counter-clockwise.
    way, speed : float
        Of the faster finger after it has met the slider, in m and m/s.
    cor, sense
        Instead of ``direction``: a centre (m) in the pusher's frame about which it turns, and the sense.
    group : str
        The same for repeats.
    """
    if isinstance(edge, bool) or not isinstance(edge, int | np.integer) or not 0 <= edge < len(slider.vertices):
        raise InputError("edge", f"expected one from 0 to {len(slider.vertices) - 1}", repr(edge))
    a, b = slider.edge(edge)
    length = float(np.linalg.norm(b - a))
    if not -_END * length <= check_number(along, "along") <= (1 + _END) * length:
        raise InputError("along", f"expected a place on edge {edge}, from 0 to {length:.6g} m", f"{along:.6g}")
    way, speed = check_number(way, "way", positive=True), check_number(speed, "speed", positive=True)
    tangent = (b - a) / length
    normal = np.array((-tangent[1], tangent[0]))
    docked = np.array((*(a + along * tangent - pusher.radius * normal), math.atan2(normal[1], normal[0])))
    pose = check_array(start, "start", (3,))
    if cor is None:
        direction = check_number(direction, "direction")
        twist, center = np.array((math.cos(direction), math.sin(direction), 0.0)), None
        if twist[0] <= _END:
            raise InputError("direction", "expected one towards the slider, within pi/2 of the normal", f"{direction:.6g} rad")
    else:
        twist = twist_from_cor(check_array(cor, "cor", (2,)), sense)
        center = transform_points(docked, np.reshape(cor, (1, 2)))[0]
        if (twist[0] - twist[2] * pusher.fingers[:, 1]).max() <= _END * _fastest(pusher, twist):
            raise InputError("cor", "expected a turn that moves a finger towards the slider")
    twist = twist * (speed / _fastest(pusher, twist))
    time = way / speed
    pieces = [(np.array((speed / 4, 0.0, 0.0)), AWAY / (speed / 4))]
    pieces += [(twist * share, 0.05 * time / share) for share in (0.25, 0.5, 0.75)]
    pieces.append((twist, 0.85 * time))
    angle = float(twist[2]) * time if center is not None else math.nan
    place = compose(compose(pose, docked), (-AWAY, 0.0, 0.0))
    return Command(place, pieces, pose, group, speed, center, sense, angle, pusher)


def contact_push(
    contact: PushContact,
    twist: ArrayLike,
    duration: float,
    *,
    radius: float,
    pose: ArrayLike,
    put: bool,
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
        Of B in W where the push is meant to start; ``put``: the slider is put there.
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
        place=compose(at, docked),
        motion=[(transport_twist(body, inverse(docked)), duration)],
        start=at if put else None,
        group=group,
        speed=speed,
        cor=np.array((-body[1], body[0])) / body[2] if turning else None,
        sense=float(np.sign(body[2])) if turning else math.nan,
        angle=float(body[2] * duration),
        pusher=pusher,
        mu=contact.mu,
    )


def random_pushes(
    slider: Slider,
    pusher: Pusher,
    count: int = 60,
    *,
    seed: int = 0,
    groups: int = 4,
    repeats: int = 4,
    speeds: tuple[float, float] = (0.004, 0.06),
    ways: tuple[float, float] = (0.02, 0.05),
    turning: float = 0.5,
    field: float = 0.3,
) -> list[Command]:
    """Return a campaign of pushes that tells causes apart: varied faces, places, headings, speeds and poses, in random order.

    Parameters
    ----------
    slider, pusher
    count : int
        Pushes in all.
    seed : int
    groups, repeats : int
        So many of the commands are made ``repeats`` times each, which tells how far repeats scatter.
    speeds, ways : tuple of float
        Ranges of the speed (m/s, evenly in its logarithm) and of the way (m) of the faster finger after it meets the slider.
    turning : float
        Share of pushes with two fingers that turn about a centre.
    field : float
        Side (m) of the square of the table, about the origin of W, in which the slider is put.
    """
    rng = np.random.default_rng(check_seed(seed))
    for name, pair in (("speeds", speeds), ("ways", ways)):
        low, high = (check_number(value, name, positive=True) for value in pair)
        if low > high:
            raise InputError(name, "expected the smaller number first", f"{low:g}, {high:g}")
    check_number(field, "field", at_least=0.0)
    check_share(turning, "turning")
    for name, whole in (("count", count), ("groups", groups), ("repeats", repeats)):
        if isinstance(whole, bool) or not isinstance(whole, int | np.integer):
            raise InputError(name, "expected a whole number", repr(whole))
    if count < 1 or groups < 0 or repeats < 1 or groups * repeats > count:
        raise InputError("count", f"expected at least groups * repeats = {groups * repeats} pushes", count)
    half = float(np.abs(pusher.fingers[:, 1]).max()) + pusher.radius
    ends = [slider.edge(e) for e in range(len(slider.vertices))]
    lengths = np.array([float(np.linalg.norm(b - a)) for a, b in ends])
    room = lengths - 2.2 * half
    room = np.where(room > _END * lengths, room, 0.0)
    if not room.any():
        raise InputError("pusher", "expected one that fits on an edge of the slider")

    def one(group: str) -> Command:
        edge = int(rng.choice(len(ends), p=room / room.sum()))
        along = lengths[edge] / 2 + room[edge] * rng.uniform(-0.5, 0.5)
        pose = np.array((*rng.uniform(-field / 2, field / 2, 2), rng.uniform(-np.pi, np.pi)))
        speed, way = float(np.exp(rng.uniform(*np.log(speeds)))), float(rng.uniform(*ways))
        direction, cor, sense = float(rng.uniform(-0.5, 0.5)), None, math.nan
        if len(pusher.fingers) == 2 and rng.random() < turning:
            # a centre beside the fingers, seen from them: the push turns as it goes
            sense = float(rng.choice((-1.0, 1.0)))
            cor = np.array((rng.uniform(-0.05, 0.05), sense * np.exp(rng.uniform(np.log(0.05), np.log(0.5)))))
        return poke(
            slider, pusher, edge, along, start=pose, direction=direction, way=way, speed=speed, cor=cor, sense=sense, group=group
        )

    repeated = [one(str(g + 1)) for g in range(groups)]
    commands = [command for command in repeated for _ in range(repeats)]
    commands += [one("") for _ in range(count - len(commands))]
    return [commands[i] for i in rng.permutation(len(commands))]


def read_commands(path: str | Path, problem: PlanningProblem, radius: float) -> list[Command]:
    """Read a list of pushes (CSV, a line each) for the slider and the contacts of a problem.

    Pokes by one finger have the columns ``edge, along`` and, if wanted, ``direction, way``: see :func:`poke`. Rotations by a
    contact of the problem have ``cor_x, cor_y, sense, angle`` (m in B; 1 or -1; rad) and, if wanted, ``contact``: its number.
    Both may have ``x, y, theta``, where the slider is put (the problem's start), ``speed`` in m/s, that of the finger or of the
    fastest point of the outline (the problem's), and ``group``, the same for repeats.

    Parameters
    ----------
    path : path
    problem : PlanningProblem
    radius : float
        Of the fingers, in m.
    """
    table, lines = read_table(
        path,
        required=(),
        numbers=(*_POKES, *_ROTATIONS, "direction", "way", "contact", "x", "y", "theta", "speed"),
        filled=(*_POKES, *_ROTATIONS),
        rules={"sense": IS_SENSE, "angle": IS_POSITIVE, "way": IS_POSITIVE, "speed": IS_POSITIVE},
    )
    turning = set(_ROTATIONS) <= set(table)
    if turning == (set(_POKES) <= set(table)):
        raise InputError(
            "line 1", f"expected the columns {', '.join(_POKES)} of pokes or {', '.join(_ROTATIONS)} of rotations", file=path
        )
    known = {*(_ROTATIONS if turning else _POKES), *(("contact",) if turning else ("direction", "way"))}
    for name in table:
        if name not in known | {"x", "y", "theta", "speed", "group"}:
            raise InputError(f"line 1: column {name}", f"not known for {'rotations' if turning else 'pokes'}", file=path)
    if not lines:
        raise InputError("", "expected at least one push", file=path)
    _doubt(table, problem, str(path))
    commands = []
    for row, line in enumerate(lines):
        try:
            commands.append((_rotation if turning else _poke)(table, row, problem, radius))
        except InputError as error:
            raise error.within(f"line {line}", file=path) from None
    return commands


def _doubt(table: dict[str, Column], problem: PlanningProblem, path: str) -> None:
    """Note what looks like another unit."""
    for name in ("direction", "angle", "theta"):
        for value in table.get(name, ()):
            note_heading(float(np.nan_to_num(value)), f"{path}: column {name}", math.pi)
    for name in ("x", "y", "way"):
        for value in table.get(name, ()):
            note_distance(abs(float(np.nan_to_num(value))), problem.slider.radius, f"{path}: column {name}")
    if "speed" in table:
        note_push_speed(float(np.nanmax(table["speed"], initial=0.0)), f"{path}: column speed")
    if "cor_x" in table:
        cors = np.stack((table["cor_x"], table["cor_y"]), axis=-1)
        note_cors(cors, problem.surface.characteristic_length, f"{path}: columns cor_x, cor_y")


def _cell(table: dict[str, Column], name: str, row: int, otherwise: float) -> float:
    """A number of the table; what stands for it where the column or the cell is missing."""
    value = float(table[name][row]) if name in table else math.nan
    return otherwise if math.isnan(value) else value


def _start(table: dict[str, Column], row: int, problem: PlanningProblem) -> FloatArray:
    names = ("x", "y", "theta")
    return np.array([_cell(table, name, row, float(problem.start[k])) for k, name in enumerate(names)])


def _group(table: dict[str, Column], row: int) -> str:
    return str(table["group"][row]) if "group" in table else ""


def _whole(table: dict[str, Column], name: str, row: int, count: int) -> int:
    value = _cell(table, name, row, 0.0)
    if not value.is_integer() or not 0 <= value < count:
        raise InputError(f"column {name}", f"expected a whole number from 0 to {count - 1}", f"{value:g}")
    return int(value)


def _poke(table: dict[str, Column], row: int, problem: PlanningProblem, radius: float) -> Command:
    return poke(
        problem.slider,
        Pusher.finger(radius),
        _whole(table, "edge", row, len(problem.slider.vertices)),
        _cell(table, "along", row, 0.0),
        start=_start(table, row, problem),
        direction=_cell(table, "direction", row, 0.0),
        way=_cell(table, "way", row, _WAY),
        speed=_cell(table, "speed", row, problem.speed),
        group=_group(table, row),
    )


def _rotation(table: dict[str, Column], row: int, problem: PlanningProblem, radius: float) -> Command:
    contact = problem.contacts[_whole(table, "contact", row, len(problem.contacts))]
    cor = (_cell(table, "cor_x", row, 0.0), _cell(table, "cor_y", row, 0.0))
    twist = twist_from_cor(cor, _cell(table, "sense", row, 1.0))
    speed = _cell(table, "speed", row, problem.speed)
    twist = twist * (speed / float(problem.push_speed(twist)))
    return contact_push(
        contact,
        twist,
        _cell(table, "angle", row, 0.0) / abs(float(twist[2])),
        radius=radius,
        pose=_start(table, row, problem),
        put=True,
        speed=speed,
        group=_group(table, row),
    )


def _fastest(pusher: Pusher, twist: FloatArray) -> float:
    """Speed (m/s) of the fastest finger."""
    x, y = pusher.fingers.T
    return float(np.hypot(twist[0] - twist[2] * y, twist[1] + twist[2] * x).max())
