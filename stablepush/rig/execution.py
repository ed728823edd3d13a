"""Plans carried out on a rig: in the open, or replanned where the slider has left them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely

from stablepush.core import InputError, check_number
from stablepush.geometry import transform_points
from stablepush.planning import PlanningProblem, PlanResult, plan, planner_names
from stablepush.rig.commands import Command, contact_push
from stablepush.rig.virtual_rig import Execution, VirtualRig

#: Contact points farther (m) from the outline than this are none.
_OFF_OUTLINE = 1e-4


def plan_commands(problem: PlanningProblem, result: PlanResult, radius: float) -> list[Command]:
    """Return the commands of a plan, one for each push: the pusher goes where the plan has it, wherever the slider is.

    ``radius`` (m) of the fingers; their centres stay behind the contact points by it.
    """
    return [
        contact_push(
            problem.contacts[push.contact],
            push.twist,
            push.duration,
            radius=radius,
            pose=push.start,
            reset=number == 0,
            speed=float(problem.push_speed(push.twist)),
        )
        for number, push in enumerate(result.pushes)
    ]


def execute_plan(
    rig: VirtualRig,
    problem: PlanningProblem,
    result: PlanResult,
    *,
    rows: int = 7,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Execution:
    """Carry out a plan in the open: a trial for each push, the slider going on from where the last one left it."""
    _require_plan(problem, result)
    return rig.execute(plan_commands(problem, result, rig.pusher.radius), rows=rows, seed=seed, progress=progress)


def execute_closed_loop(
    rig: VirtualRig,
    problem: PlanningProblem,
    result: PlanResult,
    tolerance: float,
    *,
    rows: int = 7,
    seed: int = 0,
    attempts: int = 20,
    progress: Callable[[str], None] | None = None,
) -> Execution:
    """Carry out a plan, and replan from where the slider is whenever it lies farther off the plan after a push.

    ``tolerance`` (m): how far any point of the outline may be from where the plan has it. The pusher lets go before a new plan
    and docks at its first contact. Ends at the end of a plan, when there is no plan, or after ``attempts`` of them.
    """
    _require_plan(problem, result)
    limit = check_number(tolerance, "tolerance", positive=True)
    planner = result.planner if result.planner in planner_names() else "cor-lattice"
    here, followed = problem, result
    session = rig.session(rows=rows, seed=seed, trials=len(result.pushes))
    made = 0
    for number in range(1, attempts + 2):
        left = False
        pose = problem.start
        for command, push in zip(plan_commands(here, followed, rig.pusher.radius), followed.pushes, strict=True):
            pose = session.push(command if not made else replace(command, start=None)).poses[-1]
            made += 1
            if progress is not None:
                progress(f"plan {number}, push {made}")
            error = transform_points(pose, problem.slider.vertices) - transform_points(push.end, problem.slider.vertices)
            left = float(np.hypot(*error.T).max()) > limit
            # the last plan is followed to its end wherever it leads
            if left and number <= attempts:
                break
        if not left:
            return replace(session.done(), plans=number)
        if number > attempts:
            break
        here = problem.starting_at(pose)
        again = plan(here, planner, seed=seed)
        if not again.solved or not again.pushes:
            return replace(session.done(), plans=number, stop_reason=f"no plan from the slider's pose: {again.status}")
        followed = again
    return replace(session.done(), plans=attempts + 1, stop_reason=f"still off the plan after {attempts} replanned ones")


def require_contacts(problem: PlanningProblem) -> None:
    """Refuse contacts that the rig cannot push with: more than two points, or points away from the outline."""
    outline = shapely.LinearRing(problem.slider.vertices)
    for number, contact in enumerate(problem.contacts):
        if len(contact.points) > 2:
            raise InputError(f"contacts[{number}]", "expected one or two points to simulate", len(contact.points))
        away = shapely.distance(outline, shapely.points(contact.points))
        if away.max() > _OFF_OUTLINE:
            raise InputError(
                f"contacts[{number}].points", f"expected points on the slider's outline, one is {1000 * away.max():.3g} mm away"
            )


def _require_plan(problem: PlanningProblem, result: PlanResult) -> None:
    require_contacts(problem)
    if not result.solved or not result.pushes:
        found = f"its status is {result.status}" if not result.solved else "it has none"
        raise InputError("plan", f"expected a solved plan with pushes, {found}")
    for number, push in enumerate(result.pushes):
        if push.duration <= 0 or not push.twist.any():
            raise InputError(f"plan: segments: push {number + 1}", "expected a duration > 0 s and a twist that is not zero")
        if not 0 <= push.contact < len(problem.contacts):
            raise InputError("plan", f"expected contacts from 0 to {len(problem.contacts) - 1}", push.contact)
