"""A push in an engine that is not ours, MuJoCo or Drake, seen as our simulation of pushes has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec

import numpy as np

from stablepush.core import EffectError, FloatArray, InputError, UnavailableError, did_you_mean
from stablepush.effects import CATALOGUE, Effect
from stablepush.engines import GRAVITY, Fingers, SliderOnFeet, executor
from stablepush.geometry import (
    compose,
    exp,
    inverse,
    log,
    nearest_on_outline,
    point_velocity,
    rotate_vectors,
    transform_points,
    wrench_from_force,
)
from stablepush.mechanics import Pusher, PushTrace
from stablepush.objects import Slider
from stablepush.surfaces import IdealLimitSurface

#: Engines, the module and the extra of each.
ENGINES = {"mujoco": ("mujoco", "sim"), "drake": ("pydrake", "drake")}
#: A finger touches where it is nearer (m) to the outline than this: contacts of engines give.
_TOUCH = 5e-4
#: Poses a second of a commanded motion, and its acceleration (m/s²), that of :func:`stablepush.sample_plan`.
_RATE, _ACCELERATION = 200.0, 0.1
#: Feet with a smaller share of the weight carry none.
_LEAST_SHARE = 1e-4


def slider_on_feet(slider: Slider, support: IdealLimitSurface, effects: Mapping[str, Effect], gravity: float) -> SliderOnFeet:
    """Return a slider as an engine has it: feet at support points (m, in B) with their shares of the weight.

    The friction of all feet is ``support.friction_load / (m g)``, ``g`` that of the engines.
    """
    assert slider.mass
    weights = support.support.weights / support.support.weights.sum()
    carrying = weights > _LEAST_SHARE
    shares = weights[carrying] / weights[carrying].sum()
    slope = np.array(effects["tilt"].vector("slope") if "tilt" in effects else (0.0, 0.0))
    grain = (1.0, 0.0)
    if "anisotropy-world" in effects:
        grain = (effects["anisotropy-world"].number("ratio") or 1.0, effects["anisotropy-world"].number("direction") or 0.0)
    # engines have a gravity of their own: the friction is what it should be, and so is the pull of a slope
    friction, slope = support.friction_load / (slider.mass * GRAVITY), slope * gravity / GRAVITY
    return SliderOnFeet(slider.vertices, slider.mass, support.support.points[carrying], shares, friction, slope, grain)


def require_engine(engine: str) -> None:
    """Refuse an engine that is not known or not installed."""
    if engine not in ENGINES:
        raise InputError("engine", f"expected {' or '.join(ENGINES)}", f"{engine!r}{did_you_mean(engine, ENGINES)}")
    module, extra = ENGINES[engine]
    if find_spec(module) is None:
        raise UnavailableError(f"engine {engine}: expected the extra {extra}: pip install 'stablepush[{extra}]'")


def require_possible(engine: str, slider: Slider, pusher: Pusher, effects: Sequence[str]) -> None:
    """Refuse what an engine cannot have: effects, fingers without a radius, a slider without mass."""
    if not slider.mass:
        raise InputError("slider.mass", "expected a mass in kg for an engine", "none")
    if pusher.flat or not pusher.radius > 0:
        raise InputError("finger_radius", "expected round fingers of a radius > 0 m in an engine", f"{pusher.radius:g} m")
    possible = [id for id, kind in CATALOGUE.items() if engine in kind.engines]
    for id in effects:
        if id not in possible:
            raise EffectError(f"effect {id}", f"expected effects that {engine} can have: {', '.join(possible)}")


def engine_push(
    engine: str,
    body: SliderOnFeet,
    pusher: Pusher,
    mu: float,
    start: FloatArray,
    first: FloatArray,
    motion: Sequence[tuple[FloatArray, float]],
) -> PushTrace:
    """Push a slider in an engine, as :func:`stablepush.mechanics.simulate_push` does in ours.

    ``start``, ``first`` (3,): poses in W of slider and pusher; ``motion``: twists of the pusher in its frame, and durations (s).
    The pusher goes from rest to rest: at its full speed from the first moment it would knock the slider away. So the push takes
    longer. Forces of single fingers are not told apart: NaN.
    """
    times, poses, here, now = [0.0], [np.asarray(first, dtype=float)], np.asarray(first, dtype=float), 0.0
    for twist, duration in motion:
        if duration <= 0:
            continue
        count = max(1, int(np.ceil(duration * _RATE)))
        steps = np.arange(1, count + 1)[:, None] / count
        poses += list(compose(here, exp(np.asarray(twist) * duration * steps)))
        times += (now + duration * steps[:, 0]).tolist()
        here, now = poses[-1], now + duration
    t = _from_rest_to_rest(np.array(times), _fastest(pusher, motion) / _ACCELERATION)
    run = executor(engine, body, Fingers(pusher.fingers, pusher.radius, mu)).follow(start, t, np.array(poses))
    slider, tool = run.slider, run.pusher
    dt = np.diff(run.t)[:, None]
    step = compose(inverse(slider[:-1]), slider[1:])
    # what the engine gives is the force in W and the moment about the pusher
    middle, place = 0.5 * (slider[:-1] + slider[1:]), 0.5 * (tool[:-1] + tool[1:])
    force = run.wrench[1:, :2]
    moment = run.wrench[1:, 2] + wrench_from_force(place[:, :2] - middle[:, :2], force)[:, 2]
    wrenches = np.column_stack((rotate_vectors(-middle[:, 2], force), moment))
    points, modes = _contacts(body.outline, pusher, slider[1:], tool[1:])
    nothing = np.full_like(points, np.nan)
    return PushTrace(run.t, slider, tool, log(step) / dt, wrenches, points, modes, nothing, np.zeros(len(modes), dtype=bool))


def _fastest(pusher: Pusher, motion: Sequence[tuple[FloatArray, float]]) -> float:
    """The largest speed (m/s) of a finger."""
    twists = np.array([twist for twist, duration in motion if duration > 0])
    return float(np.linalg.norm(point_velocity(twists, pusher.fingers), axis=-1).max())


def _from_rest_to_rest(t: FloatArray, ramp: float) -> FloatArray:
    """Times (n,) of a motion at full speed, with even ramps of the speed at both ends that take ``ramp`` (s) each."""
    end = float(t[-1])
    ramp = min(ramp, end)
    early, late = t < ramp / 2, t > end - ramp / 2
    return np.where(early, np.sqrt(2 * ramp * t), np.where(late, end + ramp - np.sqrt(2 * ramp * (end - t)), t + ramp / 2))


def _contacts(outline: FloatArray, pusher: Pusher, slider: FloatArray, tool: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Contact points (n, 2, 2) in B, NaN where a finger is open, and modes (n, 2): 1 in contact, 0 open."""
    points, modes = np.full((len(slider), 2, 2), np.nan), np.zeros((len(slider), 2), dtype=np.int64)
    centers = transform_points(compose(inverse(slider), tool), pusher.fingers)
    for k in range(len(pusher.fingers)):
        near, _ = nearest_on_outline(outline, centers[:, k])
        closed = np.linalg.norm(near - centers[:, k], axis=1) < pusher.radius + _TOUCH
        points[closed, k] = near[closed]
        modes[closed, k] = 1
    return points, modes
