"""A small built-in rig: a triangle on three feet that is poked and pushed, so that the whole chain runs without any data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stablepush.effects import parse_effect
from stablepush.geometry import compose, exp, inverse, transport_twist, wrench_from_force
from stablepush.io import Noise, PushLog, Rig
from stablepush.mechanics import Pusher
from stablepush.objects import PushContact, Slider, SupportDistribution
from stablepush.planning import PlanningProblem, PlanResult
from stablepush.rig import Execution, VirtualRig, execute_plan
from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Coefficients of friction of the rig: finger against slider, slider against table.
CONTACT_FRICTION, SUPPORT_FRICTION = 0.9, 0.35
_MASS, _GRAVITY = 1.2, 9.81
#: What the fingers that push really have: nobody knows it in the beginning.
SLIPPERY = 0.3
_NOISE, _NOISE_OF_PUSHES = Noise(force=0.05, position=1e-4, angle=2e-3), Noise(force=0.02, position=1e-4, angle=1e-3)
#: Length (m) and speed (m/s) of a poke.
_DISTANCE, _SPEED = 0.015, 0.0025


def demo_slider() -> Slider:
    """A right triangle with legs of 0.16 m on three feet that the fit does not know."""
    return Slider(np.array(((0.0, 0.0), (0.16, 0.0), (0.0, 0.16))) - 0.16 / 3, _MASS)


def demo_truth() -> IdealLimitSurface:
    """The friction of the three feet on the table, in N."""
    feet = SupportDistribution(((-0.04, -0.03), (0.07, -0.03), (-0.03, 0.06)), (1, 1, 1))
    return IdealLimitSurface(feet, SUPPORT_FRICTION * _MASS * _GRAVITY)


def demo_rig(problem: PlanningProblem) -> VirtualRig:
    """The rig that carries out plans: the three feet, and fingers that are far more slippery than the scene believes."""
    pusher = Pusher.of_contact(problem.contacts[0], problem.finger_radius)
    slippery = parse_effect(f"contact-friction:mu={SLIPPERY}")
    return VirtualRig(problem.slider, demo_truth(), CONTACT_FRICTION, pusher, [slippery], _NOISE_OF_PUSHES)


def demo_log(problem: PlanningProblem, result: PlanResult, seed: int = 0) -> Execution:
    """A plan carried out on that rig; the log's ``rig.json`` has what the scene believes, its surface as the nominal one."""
    done = execute_plan(demo_rig(problem), problem, result, seed=seed)
    log = done.log
    believed = replace(log.rig, model=problem.surface, contact_friction=problem.contacts[0].mu, extra=None)
    return replace(done, log=PushLog(believed, log.trials, log.samples))


def demo_pokes(count: int = 40, seed: int = 0) -> PushLog:
    """Simulate pokes of one finger on random places of the outline, with the noise of a force sensor and a tracker.

    For a poke the finger's force and the slip twist are drawn together: a force inside the friction cone at a random
    place, the twist that the rig's true surface (three feet) gives to it. Each row of a poke is one reading.
    """
    rng = np.random.default_rng(seed)
    slider = demo_slider()
    truth = demo_truth()
    columns = ("trial", "t", "x", "y", "theta", "fx", "fy", "tau", "c1x", "c1y", "phase")
    samples: dict[str, list[object]] = {name: [] for name in columns}
    trials: dict[str, list[object]] = {"trial": [], "start_time": [], "group": [], "speed": []}
    for trial in range(1, count + 1):
        start, end = slider.edge(int(rng.integers(len(slider.vertices))))
        along = (end - start) / np.linalg.norm(end - start)
        point = start + rng.uniform(0.05, 0.95) * (end - start)
        slope = rng.uniform(-1.0, 1.0) * CONTACT_FRICTION
        direction = np.array((-along[1], along[0])) + slope * along
        load = wrench_from_force(point, direction)
        load = load / truth.value(load)
        twist = truth.twist(load)
        # the finger's pace sets the size of the twist
        pace = np.hypot(*transport_twist(twist, inverse((*point, 0.0)))[:2])
        twist = twist * (_SPEED / pace)
        duration = _DISTANCE / _SPEED
        pose = np.array((*rng.uniform(-0.1, 0.1, 2), rng.uniform(-np.pi, np.pi)))
        trials["trial"].append(str(trial))
        trials["start_time"].append(20.0 * (trial - 1))
        trials["group"].append("")
        trials["speed"].append(_SPEED)
        for row, share in enumerate(np.linspace(0.0, 1.0, 6)):
            true_pose = compose(pose, exp(twist * (share * duration)))
            noise = rng.normal(size=3) * (_NOISE.position, _NOISE.position, _NOISE.angle)
            sensed = load[:2] + rng.normal(size=2) * _NOISE.force
            wrench = wrench_from_force(point, sensed)
            values = (str(trial), share * duration, *(true_pose + noise), *wrench, *point, "push")
            if row == 0:
                values = (
                    str(trial),
                    0.0,
                    *(true_pose + noise),
                    *rng.normal(size=2) * _NOISE.force,
                    0.0,
                    np.nan,
                    np.nan,
                    "rest",
                )
            for name, value in zip(columns, values, strict=True):
                samples[name].append(value)
    rig = Rig(
        slider=slider,
        contact_kind="point",
        support_friction=SUPPORT_FRICTION,
        contact_friction=CONTACT_FRICTION,
        gravity=_GRAVITY,
        finger_radius=0.0,
        noise=_NOISE,
    )
    return PushLog(rig, trials, samples)


def demo_scene(surface: LimitSurface) -> PlanningProblem:
    """Two fingers push the triangle round two walls on a table of 1.5 m by 1 m."""
    slider = demo_slider()
    contact = PushContact.on_edge(slider, 0, 0.16 / 3, 0.05, CONTACT_FRICTION)
    return PlanningProblem(
        slider,
        surface,
        [contact],
        start=(0.18, 0.20, 0.0),
        goal=(1.28, 0.30, -np.pi / 2),
        obstacles=[
            ((0.48, 0.0), (0.56, 0.0), (0.56, 0.45), (0.48, 0.45)),
            ((0.88, 0.55), (0.96, 0.55), (0.96, 1.0), (0.88, 1.0)),
        ],
        bounds=(0.0, 0.0, 1.5, 1.0),
        pusher=((-0.03, -0.035), (0.0, -0.035), (0.0, 0.035), (-0.03, 0.035)),
        tolerance=(0.01, 0.05),
        speed=0.05,
        switch_cost=5.0,
        min_margin=0.03,
    )


__all__ = ["CONTACT_FRICTION", "SLIPPERY", "demo_log", "demo_pokes", "demo_rig", "demo_scene", "demo_slider", "demo_truth"]
