"""A rig to push on: executes commands with effects that the nominal simulation leaves out, and logs what a laboratory would."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from stablepush.core import (
    EffectError,
    FloatArray,
    InputError,
    brief,
    check_count,
    check_number,
    check_seed,
    check_share,
    run_parallel,
)
from stablepush.effects import Effect, resting_share, table_friction
from stablepush.engines import SliderOnFeet
from stablepush.geometry import compose, inverse, transform_points
from stablepush.identify import on_few_points, support_for
from stablepush.io import Noise, PushLog, Rig
from stablepush.mechanics import Pusher, PushTrace, TableFriction, simulate_push
from stablepush.objects import EdgePush, Slider
from stablepush.rig.commands import AWAY, Command, edge_command
from stablepush.rig.engine_push import engine_push, require_engine, require_possible, slider_on_feet
from stablepush.rig.log_book import LogBook
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Fingers deeper (m) in the slider than this start farther back, in engines, whose contacts give, deeper than that; steps of
#: that distance; points checked along a flat edge.
_DEEP, _DEEP_IN_ENGINES, _BACK_STEP, _EDGE_PLACES = 1e-6, 2e-4, 2.5e-4, 21
#: Speed (m/s) of the approach to a push that does not move.
_APPROACH_SPEED = 0.02
#: Steps of the simulation in which the pusher moves as far as the slider's radius.
_STEPS = 400
#: Least share of the nominal friction that must be left where a slider is pushed.
_LEAST_FRICTION = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """A log, and what really happened in each of its trials, with the pusher as it really was.

    ``plans``: how many plans were followed; ``stop_reason``: why the last one was not followed to its end, blank if it was.
    """

    log: PushLog
    traces: list[PushTrace]
    pushers: list[Pusher]
    plans: int = 1
    stop_reason: str = ""

    def __repr__(self) -> str:
        return brief(self)

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
    step : float, optional
        Travel of the pusher in a step of the simulation, in m; a four-hundredth of the slider's radius if not given.
    engine : str, optional
        ``"mujoco"`` or ``"drake"``: pushes happen there, on feet that carry the identified pressure, with inertia and contacts
        that give. The quasi-static simulation of this library if not given.

    Raises
    ------
    InputError
        ``stablepush.core.errors.EffectError``, a kind of it, for effects that cannot be on this rig.
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
    step: float | None = None
    engine: str | None = None
    _by_id: dict[str, Effect] = field(init=False, repr=False)
    _friction: TableFriction = field(init=False, repr=False)
    _slope_share: float = field(init=False, repr=False)
    _points: IdealLimitSurface = field(init=False, repr=False)

    def __post_init__(self) -> None:
        by_id: dict[str, Effect] = {}
        if not isinstance(self.effects, Sequence):
            raise EffectError("effects", "expected a sequence of effects", repr(self.effects))
        for effect in self.effects:
            if not isinstance(effect, Effect):
                raise EffectError("effects", "expected effects, as of parse_effect", repr(effect))
            if effect.id in by_id:
                raise EffectError("effects", f"expected every effect once, {effect.id} is given twice")
            by_id[effect.id] = effect
        object.__setattr__(self, "_by_id", by_id)
        check_share(self.outliers, "outliers")
        check_share(self.scatter, "scatter")
        if self.noise is not None:
            for name in ("force", "position", "angle"):
                check_number(getattr(self.noise, name), f"noise.{name}", at_least=0.0)
        if self.pusher.flat and "contact-geometry" in by_id:
            raise EffectError("effect contact-geometry", "expected fingers, a flat edge has no radius")
        check_number(self.mu, "mu", at_least=0.0)
        check_number(self.gravity, "gravity", positive=True)
        if self.step is not None:
            check_number(self.step, "step", positive=True)
        if self.support_friction is not None:
            check_number(self.support_friction, "support_friction", positive=True)
        if self.surface.force_unit == "mu*N":
            if self.support_friction is None:
                raise InputError(
                    "support_friction",
                    "expected the friction of the table: the surface has forces in units of mu*N, a rig needs N",
                )
            if not self.slider.mass:
                raise InputError("slider.mass", "expected a mass > 0 in kg, since the forces of the surface are in units of mu*N")
        if "tilt" in by_id and not self.slider.mass:
            raise EffectError("effect tilt", "expected a slider with a mass")
        if self.engine is not None:
            require_engine(self.engine)
            require_possible(self.engine, self.slider, self.pusher, list(by_id))
        object.__setattr__(self, "_points", support_for(self.surface, self.slider, self._load()))
        friction = table_friction(self.slider, self.surface, by_id, self._load(), self.gravity, self._points)
        object.__setattr__(self, "_friction", friction)
        object.__setattr__(self, "_slope_share", self._tilt_share())

    def _tilt_share(self) -> float:
        """Downhill force of a tilted table over what friction holds, all effects but that of the place included."""
        if "tilt" not in self._by_id:
            return 0.0
        anywhere = replace(self._friction, gradient=(0.0, 0.0))
        share = resting_share(anywhere, np.zeros(2), self.surface.characteristic_length)
        if share >= 1.0:
            raise EffectError(
                "effect tilt: slope",
                f"expected one on which friction holds the slider, its force is {share:.3g} of that friction",
            )
        return share

    def _require_friction(self, pose: FloatArray, scale: float) -> None:
        """Refuse a place of the table where so little of the friction is left that the slider would not rest."""
        gradient = np.array(self._by_id["spatial-variation"].vector("gradient") if "spatial-variation" in self._by_id else (0, 0))
        least = scale * float((1 + transform_points(pose, self.slider.vertices) @ gradient).min())
        if least < _LEAST_FRICTION:
            raise EffectError(
                "effects and scatter",
                f"expected friction of at least {_LEAST_FRICTION:g} of the nominal one everywhere under the slider, "
                f"at x {pose[0]:.3f} m, y {pose[1]:.3f} m it is {least:.3g}",
            )
        if self._slope_share >= least:
            raise EffectError(
                "effect tilt: slope",
                f"expected one on which friction holds the slider, its force is {self._slope_share:.3g} of the nominal friction, "
                f"of which {least:.3g} is left at this place",
            )

    def _load(self) -> float:
        """Newtons in the unit of the surface's forces."""
        if self.surface.force_unit != "mu*N":
            return 1.0
        return float(self.support_friction or 0.0) * float(self.slider.mass or 0.0) * self.gravity

    @property
    def friction(self) -> TableFriction:
        """Friction of the table with all effects of the support and of inertia."""
        return self._friction

    def push(
        self,
        pusher: Pusher,
        mu: float,
        start: FloatArray,
        first: FloatArray,
        motion: Sequence[tuple[FloatArray, float]],
        scale: float,
    ) -> PushTrace:
        """Push the slider; ``scale``: of the friction of the table. The rest as :func:`stablepush.mechanics.simulate_push`."""
        if self.engine is None:
            step = self.slider.radius / _STEPS if self.step is None else self.step
            return simulate_push(self._friction, self.slider, pusher, mu, start, first, motion, step=step, scale=scale)
        body = self.on_feet()
        return engine_push(self.engine, replace(body, friction=scale * body.friction), pusher, mu, start, first, motion)

    def on_feet(self) -> SliderOnFeet:
        """Return the slider as engines have it: on a few feet that carry the pressure, on the table as it is."""
        friction = self._friction
        pressed = friction.surface if friction.points is None else friction.perturbed or friction.points
        support = pressed if isinstance(pressed, IdealLimitSurface) else self._points
        return slider_on_feet(self.slider, on_few_points(support), self._by_id, self.gravity)

    def session(self, *, rows: int = 7, seed: int = 0, trials: int | None = None) -> Session:
        """Begin a log: commands are carried out one by one. ``trials``: how many there will be, over which friction drifts."""
        return Session(self, rows, seed, trials)

    def execute(
        self,
        commands: Sequence[EdgePush | Command],
        *,
        rows: int = 7,
        seed: int = 0,
        progress: Callable[[int, int], None] | None = None,
    ) -> Execution:
        """Carry out pushes, one trial each, and log ``rows`` rows of each, each the mean of readings over an equal part of it."""
        session = self.session(rows=rows, seed=seed, trials=len(commands))
        for k, command in enumerate(commands):
            session.push(command)
            if progress is not None:
                progress(k + 1, len(commands))
        return session.done()


class Session:
    """A log in the making: see :meth:`VirtualRig.session`."""

    def __init__(self, rig: VirtualRig, rows: int, seed: int, trials: int | None) -> None:
        check_count(rows, "rows", most=100_000)
        self._rig, self._rng = rig, np.random.default_rng(check_seed(seed))
        self._book = _log_book(rig, self._rng, rows)
        self._traces: list[PushTrace] = []
        self._pushers: list[Pusher] = []
        self._last = max(1, (100 if trials is None else trials) - 1)
        self._two = True
        by_id = rig._by_id
        mu = by_id["contact-friction"].number("mu") if "contact-friction" in by_id else None
        radius = by_id["contact-geometry"].number("radius") if "contact-geometry" in by_id else None
        self._mu, self._radius = mu, radius
        self._drift = (by_id["drift"].number("rate") or 0.0) if "drift" in by_id else 0.0

    def push(self, command: EdgePush | Command) -> PushTrace:
        """Carry out one push.

        Where the pusher would start inside the slider, which is not where the command expects it, it comes from farther back
        along its own x axis instead.

        Raises :class:`InputError` with the number of the push.
        """
        try:
            return self._push(command)
        except InputError as error:
            raise error.within(f"push {len(self._traces) + 1}") from None

    def _push(self, push: EdgePush | Command) -> PushTrace:
        rig = self._rig
        start = push.start
        if start is None:
            if not self._traces:
                raise InputError("start", "expected the first push to say where the slider starts")
            start = self._traces[-1].poses[-1]
        command = edge_command(push, rig.pusher, start) if isinstance(push, EdgePush) else push
        nominal = command.pusher or rig.pusher
        pusher = nominal if self._radius is None else Pusher(nominal.fingers, self._radius, nominal.flat)
        first, motion = _from_outside(rig.slider, start, pusher, command, _DEEP if rig.engine is None else _DEEP_IN_ENGINES)
        done = len(self._traces)
        if not any(duration > 0 for _, duration in motion):
            raise InputError("motion", "expected at least one piece that lasts")
        # more pushes than were foreseen go on with the friction of the last
        share = min(1.0, done / self._last)
        scale = (1 + self._drift * share) * math.exp(rig.scatter * float(self._rng.normal()))
        mu = self._mu if self._mu is not None else (rig.mu if command.mu is None else command.mu)
        rig._require_friction(start, scale)
        trace = rig.push(pusher, mu, start, first, motion, scale)
        rig._require_friction(trace.poses[-1], scale)
        self._traces.append(trace)
        self._pushers.append(pusher)
        self._two &= len(nominal.fingers) == 2
        self._book.write(command, trace, nominal)
        return trace

    def done(self) -> Execution:
        """Return the log."""
        if not self._traces:
            raise InputError("commands", "expected at least one push")
        log = self._book.log()
        kind = "two-point" if self._two else "point"
        return Execution(PushLog(replace(log.rig, contact_kind=kind), log.trials, log.samples), self._traces, self._pushers)


def _log_book(rig: VirtualRig, rng: np.random.Generator, rows: int) -> LogBook:
    """A log whose rig is the nominal one, and sensors that err as the rig's do.

    The rig of a log has support points, those of an ideal surface or those that stand for another one, and then that one as well.
    """
    support, slider = rig.support_friction, rig.slider
    ideal = rig._points
    if slider.mass:
        support = ideal.friction_load / (slider.mass * rig.gravity)
    if slider.support is None:
        slider = Slider(slider.vertices, slider.mass, ideal.support)
    model = None if rig.surface.point_loads is not None else rig.surface
    nominal = Rig(slider, "point", support, rig.mu, rig.gravity, rig.pusher.radius, rig.noise, model=model)

    def of(id: str, name: str, size: int) -> FloatArray:
        return np.array(rig._by_id[id].vector(name) if id in rig._by_id else (0.0,) * size)

    bias, offset = of("force-bias", "force", 2), of("frame-offset", "offset", 2)
    angle, delay = float(of("force-rotation", "angle", 1)[0]), float(of("latency", "delay", 1)[0])
    return LogBook(nominal, rng, rows, rig.noise or Noise(0.0, 0.0, 0.0), rig.outliers, bias, angle, offset, delay)


def _from_outside(
    slider: Slider, start: FloatArray, pusher: Pusher, command: Command, deep: float
) -> tuple[FloatArray, Sequence[tuple[FloatArray, float]]]:
    """First pose of the pusher and its motion: those of the command, or from as far back as it takes to be outside."""

    places = pusher.fingers
    if pusher.flat:
        shares = np.linspace(0.0, 1.0, _EDGE_PLACES)[:, None]
        places = (1 - shares) * places[0] + shares * places[1]
    ring, face = shapely.LinearRing(slider.vertices), shapely.Polygon(slider.vertices)

    def depth(back: FloatArray) -> FloatArray:
        """How deep (n,) in m the pusher would be in the slider, so far back (n,)."""
        behind = np.stack((-back, np.zeros_like(back), np.zeros_like(back)), axis=-1)
        centers = transform_points(compose(compose(inverse(start), command.pusher_pose), behind), places)
        away = shapely.distance(ring, shapely.points(centers))
        inside = shapely.contains_xy(face, centers[..., 0], centers[..., 1])
        return np.asarray((pusher.radius + np.where(inside, away, -away)).max(axis=1))

    if depth(np.zeros(1))[0] <= deep or not len(command.motion):
        return command.pusher_pose, command.motion
    reach = 2 * slider.radius + 2 * float(np.abs(pusher.fingers).max()) + pusher.radius
    back = np.arange(0.0, reach + float(np.hypot(*(command.pusher_pose[:2] - start[:2]))), _BACK_STEP)
    inside = np.flatnonzero(depth(back) > deep)
    clear = float(back[inside[-1]]) + AWAY if len(inside) else AWAY
    first = np.asarray(command.motion[0][0])
    x, y = pusher.fingers.T
    speed = float(np.hypot(first[0] - first[2] * y, first[1] + first[2] * x).max()) or _APPROACH_SPEED
    return compose(command.pusher_pose, (-clear, 0.0, 0.0)), [(np.array((speed, 0.0, 0.0)), clear / speed), *command.motion]


def execute_batch(
    jobs: Sequence[tuple[VirtualRig, Sequence[EdgePush | Command], int]],
    *,
    rows: int = 7,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Execution]:
    """Carry out many logs side by side: each job is a rig, its commands and a seed. Results do not depend on ``workers``.

    ``workers``: processes; as many as there are cores if not given. ``scheduler``: address of a Dask cluster instead.
    """
    results: list[Execution] = []
    if workers is not None and workers < 1:
        raise InputError("workers", "expected at least 1", workers)
    for result in run_parallel(_execute_job, [(*job, rows) for job in jobs], workers, scheduler=scheduler):
        results.append(result)
        if progress is not None:
            progress(len(results), len(jobs))
    return results


def _execute_job(rig: VirtualRig, commands: Sequence[EdgePush | Command], seed: int, rows: int) -> Execution:
    return rig.execute(commands, rows=rows, seed=seed)
