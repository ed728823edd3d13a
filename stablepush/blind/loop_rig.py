"""The rig of a loop in an engine: plans carried out with what is wrong, and what its instruments record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from stablepush.blind.instruments import COLUMNS
from stablepush.blind.laws import turned
from stablepush.blind.loop_worlds import FINGER, NOISE, LoopWorld
from stablepush.engines import Execution, Fingers, SliderOnFeet, executor

#: How far (m) behind their places the fingers begin, their speed there (m/s), and samples a second of the commanded poses.
_BACK, _SPEED, _RATE = 0.02, 0.02, 100.0
#: Rows of a push, and least time (s) of one; noise of a moment (m) over that of a force, and of the pusher's pose over that of
#: the slider's.
_ROWS, _LEAST_ROW, _MOMENT, _PUSHER = 7, 0.01, 0.015, 0.2
#: Pause (s) between two pushes of a log.
_PAUSE = 5.0

#: A push as a rig gets it: start pose (3,) of B in W as planned, body twist (3,), duration (s).
Push = tuple[np.ndarray, np.ndarray, float]


def carry_out(
    world: LoopWorld, engine: str, start: np.ndarray, pushes: Sequence[Push], radius: float = FINGER
) -> tuple[Execution, list[float]]:
    """Carry out a plan in the open; also when each push begins (s).

    ``start``: what the tracker reads of the slider before; ``radius`` (m) of the fingers as the plan has it: so far behind the
    contact points it puts their centres. Fingers that are aside on the tool are so whatever the plan knows of it.
    """
    middle = world.points.mean(axis=0)
    heading = math.atan2(world.normal[1], world.normal[0])
    docked = np.array((*(middle - radius * world.normal), heading))
    across = np.array((-world.normal[1], world.normal[0]))
    places = (world.points - middle) @ across + world.true("contact-place", 0.0)
    thickness, rough = world.true("contact-geometry", FINGER), world.true("contact-friction", world.contact_mu)
    fingers = Fingers(np.column_stack((np.zeros(2), places)), thickness, rough)
    slope, grain = world.true("tilt", (0.0, 0.0)), world.true("anisotropy-world", (1.0, 0.0))
    feet = world.feet + np.array(world.true("pressure-shift", (0.0, 0.0)))
    body = SliderOnFeet(world.outline, world.mass, feet, world.weights, world.mu, np.array(slope), (grain[0], grain[1]))
    begins: list[float] = []
    first = _placed(pushes[0][0][None], docked)
    back = first - np.array((*(_BACK * np.array((math.cos(first[0, 2]), math.sin(first[0, 2])))), 0.0))
    now = _BACK / _SPEED
    times, poses = [np.array((0.0, now))], [back, first]
    for begin, twist, duration in pushes:
        begins.append(now)
        t = np.linspace(0.0, duration, 1 + math.ceil(duration * _RATE))[1:]
        times.append(now + t)
        poses.append(_placed(_along(begin, twist, t), docked))
        now += duration
    offset = -np.array((*world.true("frame-offset", (0.0, 0.0)), 0.0))
    there = _placed(np.asarray(start, dtype=float)[None], offset)[0]
    run = executor(engine, body, fingers).follow(there, np.concatenate(times), np.concatenate(poses))
    return run, begins


def tracked(world: LoopWorld, poses: np.ndarray) -> np.ndarray:
    """Poses (n, 3) in W that the tracker has of slider poses (n, 3), without noise and delay."""
    return _placed(poses, np.array((*world.true("frame-offset", (0.0, 0.0)), 0.0)))


class Recorder:
    """The log of a loop: trials and rows of plans that are carried out one after the other."""

    def __init__(self, world: LoopWorld, rng: np.random.Generator) -> None:
        self._world, self._rng = world, rng
        self.trials: list[dict[str, Any]] = []
        self.samples: list[dict[str, Any]] = []
        self._clock = 0.0

    def add(self, run: Execution, begins: Sequence[float], speed: float) -> None:
        """Record an execution whose pushes begin at times (s)."""
        ends = [*begins[1:], float(run.t[-1])]
        for number, (begin, end) in enumerate(zip(begins, ends, strict=True)):
            name = str(len(self.trials) + 1)
            self.trials.append({"trial": name, "start_time": round(self._clock, 3), "group": "", "speed": speed})
            if number == 0:
                self._row(name, "rest", run, 0.0, 0.3 * begin, 0.0)
            edges = np.linspace(begin, end, 1 + max(1, min(_ROWS, int((end - begin) / _LEAST_ROW))))
            for a, b in pairwise(edges):
                self._row(name, "push", run, float(a), float(b), begin)
            self._clock += end - begin + _PAUSE

    def _row(self, name: str, phase: str, run: Execution, first: float, last: float, begin: float) -> None:
        """Means between two times; ``begin``: when the trial began."""
        w, rng, (force, position, angle) = self._world, self._rng, NOISE
        rows = (run.t > first) & (run.t <= last)
        if not rows.any():
            # a push that is shorter than a tick
            rows[np.argmin(np.abs(run.t - last))] = True
        late = np.interp(run.t[rows] - w.true("latency", 0.0), run.t, np.arange(len(run.t)))
        k, share = late.astype(int), (late % 1)[:, None]
        after = np.minimum(k + 1, len(run.t) - 1)
        spread = np.array((position, position, angle))
        pose = tracked(w, (1 - share) * run.slider[k] + share * run.slider[after]).mean(axis=0) + spread * rng.normal(size=3)
        pusher = run.pusher[rows].mean(axis=0) + _PUSHER * spread * rng.normal(size=3)
        wrench = run.wrench[rows].mean(axis=0)
        read = wrench[:2] + np.array(w.true("force-bias", (0.0, 0.0))) + force * rng.normal(size=2)
        arm = pusher[:2] - pose[:2]
        tau = wrench[2] + _MOMENT * force * rng.normal() + arm[0] * read[1] - arm[1] * read[0]
        fx, fy = turned(-pose[2]) @ read
        values = ((first + last) / 2 - begin, *pose, fx, fy, tau, *pusher)
        names = ("t", "x", "y", "theta", "fx", "fy", "tau", "px", "py", "ptheta")
        known = {"trial": name, "phase": phase} | dict(zip(names, map(float, values), strict=True))
        self.samples.append(dict.fromkeys(COLUMNS, "") | known)


def _along(start: np.ndarray, twist: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Poses (n, 3) at times (n,) of a body twist that is held."""
    vx, vy, omega = twist
    angle = omega * t
    if abs(omega) < 1e-12:
        moved = np.stack((vx * t, vy * t), axis=-1)
    else:
        s, c = np.sin(angle) / omega, (1 - np.cos(angle)) / omega
        moved = np.stack((s * vx - c * vy, c * vx + s * vy), axis=-1)
    return np.column_stack((start[:2] + moved @ turned(start[2]).T, start[2] + angle))


def _placed(poses: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Poses (n, 3) in W of a frame (3,) in B."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return poses + np.stack((c * frame[0] - s * frame[1], s * frame[0] + c * frame[1], np.full(len(poses), frame[2])), axis=-1)
