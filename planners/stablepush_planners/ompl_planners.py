"""Planners of the Open Motion Planning Library on the same stable pushes, obstacles and checks as the lattice.

Geometric planners work on the Dubins paths of the first contact's reference point (:mod:`stablepush_planners.steering`); their
motions are tested exactly. Control planners draw stable pushes of the first contact at random; every one is swept exactly as it
is made. None changes the contact. Paths are shortened like those of the lattice.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from stablepush.core import Deadline, FloatArray, OutOfTimeError, UnavailableError
from stablepush.geometry import compose, inverse, twist_from_cor, wrap_angle
from stablepush.planning import PlanningProblem, PlanOptions, PlanResult
from stablepush.planning.kernels import pose_is_free, push_is_free
from stablepush_planners._connection import moved, stable_along
from stablepush_planners._goal import at_goal
from stablepush_planners.context import PlanningContext, end_of, stable_parts
from stablepush_planners.shorten import TimedTwist

#: Names, and the classes of ``ompl.geometric`` and ``ompl.control`` behind them.
GEOMETRIC = {
    "ompl-bitstar": "BITstar",
    "ompl-rrtstar": "RRTstar",
    "ompl-informed-rrtstar": "InformedRRTstar",
    "ompl-rrtconnect": "RRTConnect",
}
CONTROL = {"ompl-rrt": "RRT", "ompl-kpiece": "KPIECE1"}
#: Stable pushes that control planners choose from, and how long (in slider radii at the speed limit) one step of them is.
_CONTROLS, _STEP, _MOST_STEPS = 400, 0.25, 8
#: What is left of the time for shortening the path: so many seconds, and at most this share.
_LAST, _SHARE = 1.0, 0.1


def plan_ompl(
    problem: PlanningProblem,
    *,
    name: str,
    deadline: Deadline,
    seed: int = 0,
    options: PlanOptions,
    progress: Callable[[str], None] | None = None,
) -> PlanResult:
    """Plan with a planner of OMPL; see :func:`stablepush.plan`. The first plan of a process repeats for a seed.

    A sampling planner cannot show that there is no path: when it does not find one, the status is ``"timeout"``.
    """
    try:
        from ompl import util
    except ImportError:
        raise UnavailableError(f"planner {name}: the package ompl is not installed (it has no wheels for Windows)") from None
    progress = progress or (lambda _: None)
    try:
        context = PlanningContext(problem, options, deadline)
    except OutOfTimeError:
        return PlanResult("timeout", name, seed=seed, message="the time limit left no time to search")

    def without(status: str, message: str) -> PlanResult:
        return PlanResult(status, name, lower_bound=context.bound, seed=seed, message=message)

    if context.infeasible_reason:
        return without("no-path", context.infeasible_reason)
    if 0 not in context.steerings:
        words = "the first contact has no stable straight push with stable turns to both sides"
        if context.stable[0].loads is not None:
            # at other headings it may have
            return without("timeout", f"{words} near the heading of the goal, where these planners need it")
        return without("no-path", words)
    util.setLogLevel(util.LOG_NONE)
    # zero is taken for "no seed"
    util.RNG.setSeed(seed + 1)
    solve = _geometric if name in GEOMETRIC else _control
    try:
        pushes, approximate = solve(context, name, options, progress)
    finally:
        # states outlive their space otherwise
        gc.collect()
    if pushes is None:
        return without("timeout", "only an approximate path was found" if approximate else "no path was found in time")
    return context.result(context.shortened([(0, pushes)]), name, seed, "")


class _Clock:
    """Tells a planner when to stop: near the deadline, or when it has looked at so many motions."""

    def __init__(self, deadline: Deadline, most: float, progress: Callable[[str], None]) -> None:
        # some time is left to shorten the path in
        self._deadline, self._last = deadline, min(_LAST, _SHARE * deadline.left())
        self._progress = progress
        self.motions, self.last = 0, most

    def __call__(self) -> bool:
        self._progress(f"{self.motions} motions looked at")
        return self._deadline.left() < self._last or self.motions >= self.last


def _bounds(problem: PlanningProblem, context: PlanningContext) -> Any:
    from ompl import base

    low, high = context.field.low, context.field.low + context.field.cell * np.array(context.field.times.shape)
    bounds = base.RealVectorBounds(2)
    for axis in range(2):
        # the reference point may lie outside of the slider
        padding = float(np.linalg.norm(context.steerings[0].frame[:2]))
        bounds.setLow(axis, float(low[axis]) - padding)
        bounds.setHigh(axis, float(high[axis]) + padding)
    return bounds


def _geometric(
    context: PlanningContext, name: str, options: PlanOptions, progress: Callable[[str], None]
) -> tuple[list[TimedTwist] | None, bool]:
    """Pushes along a Dubins path that OMPL finds, and whether it found at least an approximate one."""
    from ompl import base, geometric

    problem, steer, body, world = context.problem, context.steerings[0], context.bodies[0].body, context.world
    back = inverse(steer.frame)
    space = base.DubinsStateSpace(steer.radius)
    space.setBounds(_bounds(problem, context))
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()

    def pose_of(state: Any) -> FloatArray:
        return compose((state.getX(), state.getY(), state.getYaw()), back)

    def valid(state: Any) -> bool:
        x, y, theta = pose_of(state)
        return bool(pose_is_free(world, body, x, y, math.cos(theta), math.sin(theta)))

    class Motion(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, first: Any, second: Any, *_: Any) -> bool:
            clock.motions += 1
            start, end = pose_of(first), pose_of(second)
            c, s = math.cos(end[2]), math.sin(end[2])
            return bool(pose_is_free(world, body, end[0], end[1], c, s)) and context.connect(0, start, end) is not None

    setup.setStateValidityChecker(valid)
    information.setMotionValidator(Motion(information))

    def state_of(pose: FloatArray) -> Any:
        state = space.allocState()
        x, y, theta = compose(pose, steer.frame)
        state.setX(float(x))
        state.setY(float(y))
        state.setYaw(math.remainder(float(theta), 2 * math.pi))
        return state

    start = state_of(problem.start)
    setup.setStartState(start)
    goal = base.GoalStates(information)
    # goals are tried in this order: first the one that is nearest where nothing is in the way
    ends = [state_of(end) for end in context.goal.ends]
    for state in sorted(ends, key=lambda state: space.distance(start, state)):
        goal.addState(state)
    setup.setGoal(goal)
    planner = getattr(geometric, GEOMETRIC[name])(information)
    setup.setPlanner(planner)
    clock = _Clock(context.deadline, options.search_budget, progress)
    # optimising planners report a path when they stop: first at any path at all, then after so many motions more
    length = base.PathLengthOptimizationObjective(information)
    length.setCostThreshold(base.Cost(math.inf))
    setup.setOptimizationObjective(length)
    setup.solve(base.PlannerTerminationCondition(clock))
    if setup.haveExactSolutionPath():
        context.deadline.path_found()
    if setup.haveExactSolutionPath() and options.refinement_budget > 0:
        length.setCostThreshold(base.Cost(0.0))
        clock.last = clock.motions + options.refinement_budget
        setup.solve(base.PlannerTerminationCondition(clock))
    if not setup.haveExactSolutionPath():
        return None, bool(setup.haveSolutionPath())
    return _connected(context, [pose_of(state) for state in setup.getSolutionPath().getStates()]), True


def _connected(context: PlanningContext, poses: list[FloatArray]) -> list[TimedTwist] | None:
    """Pushes from the start through poses to the goal; None if one of them leads nowhere."""
    ends = [*poses[1:-1], _same(context.goal.ends, poses[-1])]
    found: list[TimedTwist] = []
    pose = context.problem.start
    for end in ends:
        part = context.connect(0, pose, end)
        if part is None:
            return None
        found += part
        pose = end_of(pose, part)
    return found


def _control(
    context: PlanningContext, name: str, options: PlanOptions, progress: Callable[[str], None]
) -> tuple[list[TimedTwist] | None, bool]:
    """Stable pushes that OMPL strings together until a connection leads to the goal; the first path is the last."""
    from ompl import base, control

    problem, body, world = context.problem, context.bodies[0].body, context.world
    twists = _controls(context)
    parts = stable_parts(context.stable[0], twists)
    space, setup = _control_space(context, len(twists))
    information = setup.getSpaceInformation()
    outside = float(context.field.low[0]) - 1e3

    def number_of(u: Any) -> int:
        return min(len(twists) - 1, max(0, int(u[0])))

    def propagate(state: Any, u: Any, duration: float, result: Any) -> None:
        clock.motions += 1
        x, y, theta = state.getX(), state.getY(), state.getYaw()
        v = twists[number_of(u)]
        steady = stable_along(parts[number_of(u)], theta, v[2] * duration)
        if steady and x > outside / 2 and push_is_free(world, body, x, y, math.cos(theta), math.sin(theta), *v, duration):
            x, y, theta = moved(x, y, theta, *v, duration)
            result.setX(x)
            result.setY(y)
            result.setYaw(math.remainder(theta, 2 * math.pi))
        else:
            # a place that is never valid
            result.setX(outside)
            result.setY(y)
            result.setYaw(theta)

    setup.setStateValidityChecker(lambda state: state.getX() > outside / 2)
    setup.setStatePropagator(propagate)
    information.setPropagationStepSize(_STEP * problem.slider.radius / problem.speed)
    information.setMinMaxControlDuration(1, _MOST_STEPS)
    start = space.allocState()
    x, y, theta = problem.start.tolist()
    for setter, value in zip((start.setX, start.setY, start.setYaw), (x, y, math.remainder(theta, 2 * math.pi)), strict=True):
        setter(value)
    setup.setStartState(start)
    goal = _joined(context, information)
    setup.setGoal(goal)
    setup.setPlanner(getattr(control, CONTROL[name])(information))
    clock = _Clock(context.deadline, options.search_budget, progress)
    setup.solve(base.PlannerTerminationCondition(clock))
    found: list[TimedTwist] | None = None
    if setup.haveExactSolutionPath():
        path = setup.getSolutionPath()
        found = [
            (twists[number_of(u)].copy(), float(d))
            for u, d in zip(path.getControls(), path.getControlDurations(), strict=True)
            if d > 0
        ]
        end = end_of(problem.start, found)
        if not at_goal(context.goal, *end):
            found += context.connect_to_goal(0, end) or []
    return found, bool(setup.haveSolutionPath())


def _joined(context: PlanningContext, information: Any) -> Any:
    """The poses from which a connection leads to the goal, as OMPL asks for them."""
    from ompl import base

    class Joined(base.GoalRegion):  # type: ignore[misc]
        def distanceGoal(self, state: Any) -> float:
            dx, dy = state.getX() - context.problem.goal[0], state.getY() - context.problem.goal[1]
            pose = np.array((state.getX(), state.getY(), state.getYaw()))
            if at_goal(context.goal, *pose) or context.connect_to_goal(0, pose) is not None:
                return 0.0
            return 1.0 + math.hypot(dx, dy)

    goal = Joined(information)
    goal.setThreshold(0.5)
    return goal


def _control_space(context: PlanningContext, count: int) -> tuple[Any, Any]:
    """Poses, and the set-up of a search in them whose controls are the numbers of ``count`` twists."""
    from ompl import base, control

    space = base.SE2StateSpace()
    space.setBounds(_bounds(context.problem, context))
    controls = control.RealVectorControlSpace(space, 1)
    limits = base.RealVectorBounds(1)
    limits.setLow(0.0)
    limits.setHigh(float(count))
    controls.setBounds(limits)
    setup = control.SimpleSetup(controls)
    return space, setup


def _same(ends: FloatArray, pose: FloatArray) -> FloatArray:
    """The pose of ``ends`` (n, 3) that a pose is but for rounding."""
    off = np.hypot(ends[:, 0] - pose[0], ends[:, 1] - pose[1]) + np.abs(wrap_angle(ends[:, 2] - pose[2]))
    return ends[int(np.argmin(off))]


def _controls(context: PlanningContext) -> FloatArray:
    """Stable body twists (n, 3) at the speed limit: CORs over the plane, denser near the slider, and translations."""
    rng = np.random.default_rng(0)
    rho = context.problem.surface.characteristic_length
    found = [context.steerings[0].twist(k / context.steerings[0].radius) for k in (1.0, 0.0, -1.0)]
    for _ in range(50):
        places = rng.normal(size=(1000, 2))
        places *= rho * 10 ** rng.uniform(-0.5, 2, size=(1000, 1)) / np.linalg.norm(places, axis=1, keepdims=True)
        turns = twist_from_cor(places, rng.choice((1.0, -1.0), size=1000))
        found += list(turns[stable_parts(context.stable[0], turns).any(axis=1)])
        if len(found) >= _CONTROLS:
            break
    twists = np.array(found[:_CONTROLS])
    return np.ascontiguousarray(twists * (context.problem.speed / context.problem.push_speed(twists))[:, None])


plan_bitstar = partial(plan_ompl, name="ompl-bitstar")
plan_rrtstar = partial(plan_ompl, name="ompl-rrtstar")
plan_informed_rrtstar = partial(plan_ompl, name="ompl-informed-rrtstar")
plan_rrtconnect = partial(plan_ompl, name="ompl-rrtconnect")
plan_rrt = partial(plan_ompl, name="ompl-rrt")
plan_kpiece = partial(plan_ompl, name="ompl-kpiece")
