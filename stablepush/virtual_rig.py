"""A rig to push on: executes commands with effects that the nominal simulation leaves out, and logs what a laboratory would."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely

from stablepush._arrays import FloatArray, check_number
from stablepush.effects import REFERENCE_SPEED, Effect, principal
from stablepush.errors import InputError
from stablepush.logs.pushlog import Noise, PushLog, Rig, freeze
from stablepush.models import IdealLimitSurface, LimitSurface
from stablepush.planar import wrench_from_force
from stablepush.pushing import Pusher, PushTrace, TableFriction, simulate_push
from stablepush.se2 import compose, inverse, rotate_vectors, transform_points, wrap_angle
from stablepush.slider import Slider
from stablepush.support import SupportDistribution

#: Readings whose mean is a row.
_READINGS = 16
#: How far (m) the pusher of a campaign is from the slider at first.
_AWAY = 2e-3
#: Rest before a push, in s.
_REST = 0.2
#: Noise of the moment (N·m per N of force noise), and of the pusher's pose against the slider's.
_MOMENT, _PUSHER = 0.015, 0.2
#: An outlier is so many times as far off as the noise.
_OUTLIER = 10.0
#: A push was stable if the slider moved no more than this against the pusher, in m and rad, after the first tenth of it.
_STUCK = (1e-3, 0.02)
#: Effects that act on points under the slider.
_ON_POINTS = (
    *("anisotropy-world", "anisotropy-object", "speed-dependence", "spatial-variation"),
    *("pressure-shift", "pressure-spread", "model-capacity"),
)


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
    pusher : Pusher, optional
        If it differs from the rig's.
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


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """A log, and what really happened in each of its trials."""

    log: PushLog
    traces: list[PushTrace]

    @property
    def final_pose(self) -> FloatArray:
        """Pose (3,) of B in W after the last trial."""
        return self.traces[-1].poses[-1]


@dataclass(frozen=True, slots=True, eq=False)
class VirtualRig:
    """A slider, a table and a pusher, with effects.

    Parameters
    ----------
    slider : Slider
    surface : LimitSurface
        Nominal friction of the support. Effects that act on points under the slider change the points of an ideal surface. To a
        polynomial one they add what they change of the friction of points that stand for it: the slider's support if it has one,
        else pressures on a grid under the outline that come as near to the surface as pressures can.
    mu : float
        Nominal friction between pusher and slider.
    pusher : Pusher
        With its nominal radius.
    effects : sequence of Effect
    noise : Noise, optional
        Standard deviations of a row; none if not given.
    outliers, scatter : float
        Share of rows that are ten times as far off, and relative standard deviation of the friction from trial to trial.
    support_friction : float, optional
        ``mu`` of the support: the scale of surfaces in units of ``mu*N``.
    gravity : float
        In m/s².
    step : float
        Way of the pusher in a step of the simulation, in m.
    """

    slider: Slider
    surface: LimitSurface
    mu: float
    pusher: Pusher
    effects: Sequence[Effect] = ()
    noise: Noise | None = None
    outliers: float = 0.0
    scatter: float = 0.0
    support_friction: float | None = None
    gravity: float = 9.81
    step: float = 2.5e-4
    _by_id: dict[str, Effect] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        by_id: dict[str, Effect] = {}
        for effect in self.effects:
            if effect.id in by_id:
                raise InputError(f"effects: expected every effect once, {effect.id} is given twice")
            by_id[effect.id] = effect
        object.__setattr__(self, "_by_id", by_id)
        if check_number(self.outliers, "outliers", at_least=0.0) > 1:
            raise InputError(f"outliers: expected a share from 0 to 1, got {self.outliers:g}")
        check_number(self.scatter, "scatter", at_least=0.0)
        if self.surface.force_unit == "mu*N" and (self.support_friction is None or not self.slider.mass):
            raise InputError(
                "surface: its forces are in units of mu*N: expected the friction of the support and the slider's mass"
            )
        if "tilt" in by_id and not self.slider.mass:
            raise InputError("effect tilt: expected a slider with a mass")

    def friction(self) -> TableFriction:
        """Return the friction of the table with all effects of the support and of inertia."""
        by_id, surface = self._by_id, self.surface
        load = 1.0
        if surface.force_unit == "mu*N":
            load = float(self.support_friction or 0.0) * float(self.slider.mass or 0.0) * self.gravity
        points: IdealLimitSurface | None = None
        changed: IdealLimitSurface | None = None
        if isinstance(surface, IdealLimitSurface):
            surface = self._moved_pressure(surface)
        elif any(id in by_id for id in _ON_POINTS):
            points = _as_points(surface, self.slider, load)
            changed = self._moved_pressure(points)
        tables = [np.eye(2), np.eye(2)]
        for i, id in enumerate(("anisotropy-object", "anisotropy-world")):
            if id in by_id:
                tables[i] = principal(by_id[id].number("ratio") or 1.0, by_id[id].number("direction") or 0.0)
        slope = by_id["speed-dependence"].number("slope") if "speed-dependence" in by_id else 0.0
        gradient = by_id["spatial-variation"].vector("gradient") if "spatial-variation" in by_id else (0.0, 0.0)
        pull = np.zeros(2)
        if "tilt" in by_id:
            pull = float(self.slider.mass or 0.0) * self.gravity * np.array(by_id["tilt"].vector("slope"))
        mass = (by_id["inertia"].number("mass") or 0.0) if "inertia" in by_id else 0.0
        inertia = (mass, mass * self.slider.radius_of_gyration**2)
        return TableFriction(
            surface,
            load,
            points,
            changed,
            tables[0],
            tables[1],
            gradient or (0.0, 0.0),
            slope or 0.0,
            REFERENCE_SPEED,
            pull,
            inertia,
        )

    def _moved_pressure(self, surface: IdealLimitSurface) -> IdealLimitSurface:
        """The support with its pressure moved, spread, or on few points."""
        by_id, support = self._by_id, surface.support
        points, weights = support.points, support.weights
        if "model-capacity" in by_id:
            facets = by_id["model-capacity"].number("facets") or 3
            angles = 2 * np.pi * (np.arange(round(facets)) + 0.25) / round(facets)
            radius = math.sqrt(float(weights @ ((points - support.center) ** 2).sum(axis=1)))
            points = support.center + radius * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
            weights = np.ones(len(points))
        center = weights @ points / weights.sum()
        if "pressure-spread" in by_id:
            points = center + (by_id["pressure-spread"].number("scale") or 1.0) * (points - center)
        if "pressure-shift" in by_id:
            points = points + np.array(by_id["pressure-shift"].vector("offset"))
        if points is support.points:
            return surface
        return IdealLimitSurface(SupportDistribution(points, weights), surface.friction_load, surface.characteristic_length)

    def session(self, *, rows: int = 7, seed: int = 0, trials: int | None = None) -> Session:
        """Begin a log: commands are carried out one by one. ``trials``: how many there will be, over which friction drifts."""
        return Session(self, rows, seed, trials)

    def execute(
        self,
        commands: Sequence[Command],
        *,
        rows: int = 7,
        seed: int = 0,
        progress: Callable[[int, int], None] | None = None,
    ) -> Execution:
        """Carry out commands, one trial each, and log ``rows`` rows of each push, each the mean of readings over an equal part of
        it."""
        session = self.session(rows=rows, seed=seed, trials=len(commands))
        for k, command in enumerate(commands):
            session.push(command)
            if progress is not None:
                progress(k + 1, len(commands))
        return session.done()


class Session:
    """A log in the making: see :meth:`VirtualRig.session`."""

    def __init__(self, rig: VirtualRig, rows: int, seed: int, trials: int | None) -> None:
        self._rig, self._rng = rig, np.random.default_rng(seed)
        self._book = _LogBook(rig, self._rng, rows)
        self._friction = rig.friction()
        self._traces: list[PushTrace] = []
        self._last = max(1, (100 if trials is None else trials) - 1)
        by_id = rig._by_id
        mu = by_id["contact-friction"].number("mu") if "contact-friction" in by_id else None
        radius = by_id["contact-geometry"].number("radius") if "contact-geometry" in by_id else None
        self._mu, self._radius = rig.mu if mu is None else mu, radius
        self._drift = (by_id["drift"].number("rate") or 0.0) if "drift" in by_id else 0.0

    def push(self, command: Command) -> PushTrace:
        """Carry out one command."""
        nominal = command.pusher or self._rig.pusher
        pusher = nominal if self._radius is None else Pusher(nominal.fingers, self._radius, nominal.flat)
        start = command.start
        if start is None:
            if not self._traces:
                raise InputError("commands: expected the first one to say where the slider starts")
            start = self._traces[-1].poses[-1]
        done = len(self._traces)
        scale = (1 + self._drift * done / self._last) * math.exp(self._rig.scatter * float(self._rng.normal()))
        trace = simulate_push(
            self._friction,
            self._rig.slider,
            pusher,
            self._mu,
            start,
            command.place,
            command.motion,
            step=self._rig.step,
            scale=max(scale, 1e-9),
        )
        self._traces.append(trace)
        self._book.write(str(done + 1), command, trace, nominal)
        return trace

    def done(self) -> Execution:
        """Return the log."""
        return Execution(self._book.log(), self._traces)


class _LogBook:
    """Rows as the sensors of a rig see them."""

    def __init__(self, rig: VirtualRig, rng: np.random.Generator, rows: int) -> None:
        self._rig, self._rng, self._rows = rig, rng, rows
        self._time = 0.0
        self._samples: dict[str, list[object]] = {}
        self._trials: dict[str, list[object]] = {}
        by_id = rig._by_id

        def of(id: str, name: str, size: int) -> FloatArray:
            return np.array(by_id[id].vector(name) if id in by_id else (0.0,) * size)

        self._bias, self._angle = of("force-bias", "force", 2), float(of("force-rotation", "angle", 1)[0])
        self._offset, self._delay = of("frame-offset", "offset", 2), float(of("latency", "delay", 1)[0])
        self._outline = shapely.LinearRing(rig.slider.vertices)

    def write(self, trial: str, command: Command, trace: PushTrace, pusher: Pusher) -> None:
        end = float(trace.t[-1])
        touched = np.flatnonzero((trace.modes > 0).any(axis=1))
        # rows of the push begin when the fingers have met the slider; before that the pusher is on its way
        begin = float(trace.t[touched[0] + 1]) if len(touched) and touched[0] > 0 else 0.0
        edges = np.linspace(begin, end, self._rows + 1)
        self._row(trial, np.linspace(-_REST, 0, _READINGS + 2)[1:-1], trace, pusher, "rest")
        if begin > 0:
            self._row(trial, np.linspace(0, begin, _READINGS + 2)[1:-1], trace, pusher, "approach")
        for a, b in pairwise(edges):
            self._row(trial, a + (b - a) * (np.arange(_READINGS) + 0.5) / _READINGS, trace, pusher, "push")
        cor = (math.nan, math.nan) if command.cor is None else command.cor
        stable = math.nan if len(pusher.fingers) < 2 else float(_stayed(trace))
        values = {
            "trial": trial,
            "start_time": round(self._time, 6),
            "group": command.group,
            "speed": command.speed,
            "cor_x": float(cor[0]),
            "cor_y": float(cor[1]),
            "sense": command.sense,
            "angle": command.angle,
            "stable": stable,
        }
        for name, value in values.items():
            self._trials.setdefault(name, []).append(value)
        self._time += end + _REST + 5.0

    def _row(self, trial: str, times: FloatArray, trace: PushTrace, pusher: Pusher, phase: str) -> None:
        """One row: the mean of readings at times (s after the push began) of poses, forces and the moment at the pusher."""
        rig, rng, noise = self._rig, self._rng, self._rig.noise or Noise(0.0, 0.0, 0.0)
        true, pushers = _at(trace.t, trace.poses, times), _at(trace.t, trace.pushers, times)
        seen = _at(trace.t, trace.poses, times - self._delay)
        seen = compose(seen, np.column_stack((np.tile(self._offset, (len(times), 1)), np.zeros(len(times)))))
        step = np.clip(np.searchsorted(trace.t, times, side="right") - 1, 0, len(trace.wrenches) - 1)
        loads = np.where((times >= 0)[:, None], trace.wrenches[step], 0.0)
        force = rotate_vectors(true[:, 2], loads[:, :2])
        arm = true[:, :2] - pushers[:, :2]
        moment = float((loads[:, 2] + arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).mean())
        odd = _OUTLIER if rng.random() < rig.outliers else 1.0
        measured = rotate_vectors(self._angle, force.mean(axis=0)) + self._bias + noise.force * odd * rng.normal(size=2)
        moment += _MOMENT * noise.force * odd * float(rng.normal())
        spread = np.array((noise.position, noise.position, noise.angle))
        pose = seen.mean(axis=0) + odd * spread * rng.normal(size=3)
        place = pushers.mean(axis=0) + _PUSHER * spread * rng.normal(size=3)
        load = np.array((*rotate_vectors(-pose[2], measured), 0.0))
        load[2] = moment + float(wrench_from_force(place[:2] - pose[:2], measured)[2])
        touching = np.full((2, 2), math.nan)
        if phase == "push":
            touching = self._touching(pose, place, pusher, trace.modes[step])
        values = dict(zip(("t", "x", "y", "theta"), (float(times.mean()) + _REST, *pose), strict=True))
        values |= dict(zip(("fx", "fy", "tau"), load, strict=True))
        values |= dict(zip(("c1x", "c1y", "c2x", "c2y"), touching.ravel(), strict=True))
        values |= dict(zip(("px", "py", "ptheta"), place, strict=True))
        self._samples.setdefault("trial", []).append(trial)
        for name, value in values.items():
            self._samples.setdefault(name, []).append(float(value))
        self._samples.setdefault("phase", []).append(phase)

    def _touching(self, pose: FloatArray, place: FloatArray, pusher: Pusher, modes: np.ndarray) -> FloatArray:
        """Contact points (2, 2) in the tracked frame as a laboratory computes them: where the outline is nearest to each
        finger."""
        result = np.full((2, 2), math.nan)
        centers = transform_points(compose(inverse(pose), place), pusher.fingers)
        for k, center in enumerate(centers):
            if 2 * (modes[:, k] > 0).sum() > len(modes):
                # the tracked frame may not be B: the outline is drawn in it as if it were
                near = self._outline.interpolate(self._outline.project(shapely.Point(center)))
                result[k] = near.x, near.y
        return result

    def log(self) -> PushLog:
        rig = self._rig
        mass = rig.slider.mass
        support = rig.support_friction
        if support is None and isinstance(rig.surface, IdealLimitSurface) and mass:
            support = rig.surface.friction_load / (mass * rig.gravity)
        slider = rig.slider
        if slider.support is None and isinstance(rig.surface, IdealLimitSurface):
            slider = Slider(slider.vertices, slider.mass, rig.surface.support)
        kind = "two-point" if all(value == value for value in self._trials["stable"]) else "point"  # noqa: PLR0124
        nominal = Rig(slider, kind, support, rig.mu, rig.gravity, rig.pusher.radius, rig.noise)
        dropped = {name for name in ("c1x", "c1y", "c2x", "c2y") if not np.isfinite(np.array(self._samples[name], float)).any()}
        samples = {name: values for name, values in self._samples.items() if name not in dropped}
        return PushLog(nominal, freeze(self._trials), freeze(samples))


def _at(t: FloatArray, poses: FloatArray, times: FloatArray) -> FloatArray:
    """Poses (n, 3) at times; the first before the push."""
    return np.stack([np.interp(times, t, poses[:, k]) for k in range(3)], axis=-1)


def _stayed(trace: PushTrace) -> bool:
    """Whether the slider kept its place against the pusher, once they had met."""
    relative = compose(inverse(trace.pushers), trace.poses)
    touched = np.flatnonzero((trace.modes > 0).any(axis=1))
    if not len(touched):
        return False
    first = touched[0] + (len(relative) - touched[0]) // 10
    moved = relative[first:] - relative[min(first, len(relative) - 1)]
    turn = np.abs(wrap_angle(moved[:, 2])).max()
    return bool(np.hypot(moved[:, 0], moved[:, 1]).max() <= _STUCK[0] and turn <= _STUCK[1])


def _as_points(surface: LimitSurface, slider: Slider, load: float) -> IdealLimitSurface:
    """Support points that stand for a limit surface: the slider's own, else pressures on a grid that fit it."""
    rng = np.random.default_rng(0)
    twists = rng.normal(size=(200, 3)) / (1.0, 1.0, surface.characteristic_length)
    loads = surface.wrench(twists) * (load if surface.force_unit == "mu*N" else 1.0)
    if slider.support is not None:
        # with the load that explains most of the surface
        one = IdealLimitSurface(slider.support, 1.0, surface.characteristic_length)
        shape = one.wrench(twists) / (1, 1, surface.characteristic_length)
        scaled = loads / (1, 1, surface.characteristic_length)
        total = float((shape * scaled).sum() / (shape * shape).sum())
        return IdealLimitSurface(slider.support, total, surface.characteristic_length)
    from stablepush.identify import fit_pressure_grid

    return fit_pressure_grid(loads, twists, slider).surface


def execute_batch(
    jobs: Sequence[tuple[VirtualRig, Sequence[Command], int]],
    *,
    rows: int = 7,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Execution]:
    """Carry out many logs side by side: each job is a rig, its commands and a seed. Results do not depend on ``workers``.

    ``workers``: processes; as many as there are cores if not given.
    """
    results: list[Execution] = []
    if workers == 1 or len(jobs) == 1:
        for job in jobs:
            results.append(_execute_job((*job, rows)))
            if progress is not None:
                progress(len(results), len(jobs))
        return results
    with ProcessPoolExecutor(workers) as pool:
        for result in pool.map(_execute_job, [(*job, rows) for job in jobs]):
            results.append(result)
            if progress is not None:
                progress(len(results), len(jobs))
    return results


def _execute_job(job: tuple[VirtualRig, Sequence[Command], int, int]) -> Execution:
    rig, commands, seed, rows = job
    return rig.execute(commands, rows=rows, seed=seed)


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
    rng = np.random.default_rng(seed)
    if count < 1 or groups < 0 or repeats < 1 or groups * repeats > count:
        raise InputError(f"count: expected at least groups * repeats = {groups * repeats} pushes, got {count}")
    half = float(np.abs(pusher.fingers[:, 1]).max()) + pusher.radius
    ends = [slider.edge(e) for e in range(len(slider.vertices))]
    lengths = np.array([float(np.linalg.norm(b - a)) for a, b in ends])
    room = np.maximum(lengths - 2.2 * half, 0.0)
    if not room.any():
        raise InputError("pusher: expected one that fits on an edge of the slider")

    def one(group: str) -> Command:
        edge = int(rng.choice(len(ends), p=room / room.sum()))
        start, end = ends[edge]
        along = (end - start) / lengths[edge]
        normal = np.array((-along[1], along[0]))
        middle = start + along * (lengths[edge] / 2 + room[edge] * rng.uniform(-0.5, 0.5))
        angle = math.atan2(normal[1], normal[0])
        docked = np.array((*(middle - pusher.radius * normal), angle))
        pose = np.array((*rng.uniform(-field / 2, field / 2, 2), rng.uniform(-np.pi, np.pi)))
        speed = float(np.exp(rng.uniform(*np.log(speeds))))
        way = float(rng.uniform(*ways))
        heading = float(rng.uniform(-0.5, 0.5))
        twist, cor, sense = np.array((math.cos(heading), math.sin(heading), 0.0)), None, math.nan
        if len(pusher.fingers) == 2 and rng.random() < turning:
            # a centre beside the fingers, seen from them: the push turns as it goes
            sense = float(rng.choice((-1.0, 1.0)))
            beside = np.array((rng.uniform(-0.05, 0.05), sense * np.exp(rng.uniform(np.log(0.05), np.log(0.5)))))
            twist = np.array((sense * beside[1], -sense * beside[0], sense))
            cor = transform_points(docked, beside[None])[0]
        x, y = pusher.fingers.T
        fastest = float(np.hypot(twist[0] - twist[2] * y, twist[1] + twist[2] * x).max())
        twist = twist * (speed / fastest)
        time = way / speed
        # from two millimetres away straight to the face, then up to speed in four parts, then on
        pieces = [(np.array((speed / 4, 0.0, 0.0)), _AWAY / (speed / 4))]
        pieces += [(twist * share, 0.05 * time / share) for share in (0.25, 0.5, 0.75)]
        pieces.append((twist, 0.85 * time))
        turn = float(twist[2]) * time
        place = compose(compose(pose, docked), (-_AWAY, 0.0, 0.0))
        return Command(place, pieces, pose, group, speed, cor, sense, turn if cor is not None else math.nan)

    repeated = [one(str(g + 1)) for g in range(groups)]
    commands = [command for command in repeated for _ in range(repeats)]
    commands += [one("") for _ in range(count - len(commands))]
    return [commands[i] for i in rng.permutation(len(commands))]
