"""A scene and a plan as a model of another simulator: MJCF for MuJoCo, SDFormat for Drake."""

from __future__ import annotations

import numpy as np
import shapely

from stablepush.core import InputError
from stablepush.effects import CATALOGUE
from stablepush.engines import Fingers, Motion, SliderOnFeet, mjcf, sdf
from stablepush.geometry import compose
from stablepush.mechanics import Pusher
from stablepush.planning import PlanningProblem, PlanResult, Trajectory, sample_plan
from stablepush.rig.engine_push import require_possible
from stablepush.rig.execution import require_contacts
from stablepush.rig.virtual_rig import VirtualRig

#: Rows a second of a motion.
_RATE = 50.0
#: Spacings (m) of the fingers of two contacts that are the same.
_SAME = 1e-6


def export_mjcf(problem: PlanningProblem, result: PlanResult | None = None) -> str:
    """Return a problem, and its plan if given, as an MJCF model that MuJoCo opens as it is.

    The slider stands on feet that carry the pressure of the surface: a few support points, whose loads are within 0.5 deg of the
    surface's on average. Fingers are spheres, and the outline of the pusher is left out; obstacles stand as walls. Of
    ``problem.effects`` a slope of the table is in the gravity, pressure in the feet, friction and radius in the fingers; those of
    sensors are in no model, others are refused. Units are SI, the frame is W.

    Joints ``slider_x, slider_y, slider_theta`` and ``pusher_x, …`` hold the poses. The pusher, whose frame is that of the centres
    of the fingers, has position and velocity servos. Keyframes are the start, or the plan at 50 Hz: its time, the planned poses
    and the controls.

    Raises
    ------
    InputError
        If the slider has no mass, fingers no radius, contacts fingers of different spacings, or an effect cannot be in the model.
    """
    body, fingers, trajectory = _parts(problem, result, "mujoco")
    motion = Motion(trajectory.t, trajectory.slider, trajectory.pusher, trajectory.velocity)
    return mjcf(body, fingers, _walls(problem), motion)


def export_sdf(problem: PlanningProblem, result: PlanResult | None = None) -> str:
    """Return a problem as an SDFormat world that Drake's parser opens as it is; a plan says where the pusher begins.

    Slider, fingers and obstacles are those of :func:`export_mjcf`, on a level table. The models are ``table``, ``slider``,
    ``pusher`` and ``obstacles``; the joints are zero at the start. The motion of the plan is no part of the format: it is the
    trajectory of :func:`sample_plan`, for the servos of ``pusher_x``, ``pusher_y`` and ``pusher_theta``.
    """
    body, fingers, trajectory = _parts(problem, result, "drake")
    return sdf(body, fingers, _walls(problem), trajectory.slider[0], trajectory.pusher[0])


def _parts(problem: PlanningProblem, result: PlanResult | None, engine: str) -> tuple[SliderOnFeet, Fingers, Trajectory]:
    require_contacts(problem)
    # refuses a plan of another problem
    trajectory = _at_start(problem) if result is None else sample_plan(problem, result, _RATE)
    used = [0] if result is None else sorted({push.contact for push in result.pushes})
    pushers = {k: Pusher.of_contact(problem.contacts[k], problem.finger_radius) for k in used}
    pusher, mu = pushers[used[0]], problem.contacts[used[0]].mu
    for k in used[1:]:
        other = pushers[k].fingers
        if other.shape != pusher.fingers.shape or np.abs(other - pusher.fingers).max() > _SAME:
            raise InputError(f"contacts[{k}]", "expected fingers of one spacing, a model has one tool")
        if problem.contacts[k].mu != mu:
            raise InputError(
                f"contacts[{k}].mu", f"expected the same friction, {mu:g}, a model has one tool", problem.contacts[k].mu
            )
    effects = [entry.effect for entry in problem.effects]
    for effect in effects:
        if engine in CATALOGUE[effect.id].not_in_models:
            raise InputError(f"effects: {effect.id}", "expected none of it in a model of this kind")
    require_possible(engine, problem.slider, pusher, [effect.id for effect in effects])
    rig = VirtualRig(problem.slider, problem.surface, mu, pusher, effects, support_friction=problem.support_friction)
    by_id = {effect.id: effect for effect in effects}
    rough = by_id["contact-friction"].number("mu") if "contact-friction" in by_id else None
    radius = by_id["contact-geometry"].number("radius") if "contact-geometry" in by_id else None
    fingers = Fingers(pusher.fingers, pusher.radius if radius is None else radius, mu if rough is None else rough)
    return rig.on_feet(), fingers, trajectory


def _at_start(problem: PlanningProblem) -> Trajectory:
    """Slider and fingers where they begin, at the first contact."""
    docked = compose(problem.start, problem.contacts[0].frame)
    behind = compose(docked, np.array((-problem.finger_radius, 0.0, 0.0)))
    nothing = np.zeros((1, 3))
    return Trajectory(np.zeros(1), problem.start[None], behind[None], nothing, np.array(["push"]), np.zeros(1), np.zeros(1))


def _walls(problem: PlanningProblem) -> list[np.ndarray]:
    """Outlines (n, 2) of the obstacles in W, counter-clockwise."""
    found = []
    for obstacle in problem.obstacles:
        outline = np.asarray(obstacle)
        found.append(outline if shapely.LinearRing(outline).is_ccw else outline[::-1])
    return found
