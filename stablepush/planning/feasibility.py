"""Why a planning problem has no plan, where that can be shown before any search.

What is found here holds for every planner. A start from which no push leads away is shown by a dense sample of pushes, all else
by proof, up to rounding. A problem without a reason may still have no plan.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, ConvergenceError, FloatArray, InputError, UnsupportedContactError
from stablepush.geometry import compose, exp, transform_points, twist_from_cor, wrap_angle
from stablepush.objects import PushContact
from stablepush.planning.collision import OVERLAP
from stablepush.planning.problem import PlanningProblem
from stablepush.planning.pusher_loads import loads_of
from stablepush.stability import StabilityOracle, StableRegion, stable_region

#: Bodies that overlap by more than this (m) are in collision for every check: twice what the check of plans allows.
_OVERLAP = 2e-6
#: Boxes of poses about the goal that are looked at before the question is left to the search.
_MOST_BOXES = 2000
#: Pushes tried from the start: turns, translations all round, and at least so many of them that are stable.
_TURNS, _TRANSLATIONS, _FEWEST = 2000, 720, 20
#: How far each goes, in radii of the slider, and in m: so little that one along a wall, half a step of direction off it, stays
#: within what touching bodies may overlap.
_STEP, _LONGEST_STEP = 1e-4, 0.5 * OVERLAP / (math.pi / _TRANSLATIONS)
#: Margins (rad) below this are none.
_NO_MARGIN = 1e-7
#: What the check of plans lets a margin (rad) fall short.
_MARGIN_SLACK = 1e-6
#: Slack (rad) of a turn that cannot be made.
_TURN_SLACK = 1e-3


def infeasibility(problem: PlanningProblem) -> str:
    """Return why no plan can solve a problem, in words; empty where that cannot be shown here."""
    walls = shapely.union_all([shapely.Polygon(obstacle) for obstacle in problem.obstacles])
    shapely.prepare(walls)
    alone = _Body(problem, None, walls)
    bodies = [_Body(problem, contact, walls) for contact in problem.contacts]
    reason = _start(problem, alone, bodies[0]) or _margin(problem)
    if reason or starts_at_goal(problem):
        # there is nothing to do but to stay
        return reason or _rest(problem)
    reason = _goal(problem, alone, bodies)
    if problem.acting_effects:
        # which pushes are stable depends on the pose
        return reason or _rest(problem)
    return reason or _turn(problem) or _first_push(problem, bodies)


def starts_at_goal(problem: PlanningProblem) -> bool:
    """Return whether the start is within the tolerance of the goal."""
    off = problem.goal - problem.start
    near, turned = problem.tolerance
    return bool(np.hypot(*off[:2]) <= near and abs(float(wrap_angle(off[2]))) <= turned)


class _Body:
    """Slider, and docked pusher if a contact is given, as one rigid body among the obstacles and bounds."""

    def __init__(self, problem: PlanningProblem, contact: PushContact | None, walls: shapely.Geometry) -> None:
        self.outlines = [problem.slider.vertices]
        if contact is not None:
            self.outlines += problem.docked_outlines(contact)
        self._shape = shapely.union_all([shapely.Polygon(outline) for outline in self.outlines])
        self._corners = np.concatenate(self.outlines)
        self._bounds, self._walls = problem.bounds, walls
        self.radius = float(np.linalg.norm(self._corners, axis=1).max())

    def collides(self, poses: FloatArray, shrunk: float) -> BoolArray:
        """Return whether the body at poses (n, 3), shrunk by so much (m), overlaps an obstacle or leaves the bounds.

        At all poses from which no point of it is farther than ``shrunk`` the whole body then does.
        """
        hit = np.zeros(len(poses), dtype=bool)
        if self._bounds is not None:
            placed = np.array([transform_points(pose, self._corners) for pose in poses])
            hit |= ((placed < self._bounds[:2] - shrunk) | (placed > self._bounds[2:] + shrunk)).any(axis=(1, 2))
        core = shapely.buffer(self._shape, -shrunk, join_style="mitre")
        rest = np.flatnonzero(~hit)
        if len(rest) and not (self._walls.is_empty or core.is_empty):
            placed_cores = [shapely.transform(core, partial(transform_points, poses[k])) for k in rest]
            hit[rest] = shapely.intersects(self._walls, placed_cores)
        return hit

    def overlaps(self, pose: FloatArray, obstacle: shapely.Polygon) -> bool:
        """Return whether the body at a pose overlaps an obstacle by more than the planners let it."""
        core = shapely.buffer(self._shape, -OVERLAP, join_style="mitre")
        return bool(shapely.intersects(obstacle, shapely.transform(core, partial(transform_points, pose))))

    def free(self, poses: ArrayLike) -> BoolArray:
        """Return whether the body at poses (n, 3) is free for the planners, which let bodies overlap by 5e-7 m."""
        return ~self.collides(np.atleast_2d(np.asarray(poses, dtype=np.float64)), OVERLAP)


def _start(problem: PlanningProblem, alone: _Body, docked: _Body) -> str:
    if not alone.free(problem.start)[0]:
        return f"start: the slider {_collision(problem, alone, problem.start)}"
    if not docked.free(problem.start)[0]:
        return f"start: the pusher, docked at contact 0, {_collision(problem, docked, problem.start)}"
    return ""


def _goal(problem: PlanningProblem, alone: _Body, bodies: list[_Body]) -> str:
    near = "" if max(problem.tolerance) < 1e-6 else "; every other pose within the tolerance is in collision or out of bounds too"
    if _never_free(problem, alone):
        return f"goal: the slider {_collision(problem, alone, problem.goal)}{near}"
    if problem.pusher_outlines(problem.contacts[0]) and all(_never_free(problem, body) for body in bodies):
        which = "docked at contact 0" if len(bodies) == 1 else "docked at any contact"
        return f"goal: the pusher, {which}, is in collision or out of bounds{near}"
    return ""


def _collision(problem: PlanningProblem, body: _Body, pose: FloatArray) -> str:
    """What a body is in collision with at a pose."""
    for number, obstacle in enumerate(problem.obstacles):
        if body.overlaps(pose, shapely.Polygon(obstacle)):
            return f"is in collision with obstacle {number}"
    return "is out of bounds"


def _never_free(problem: PlanningProblem, body: _Body) -> bool:
    """Whether a body is in collision or out of bounds at all poses within the tolerance of the goal.

    Boxes of poses are halved until a free pose is found, or until the body at each box's middle still is in collision when it is
    shrunk by as far as any of its points moves within the box, which shows it for the whole box. A box of half widths ``dx, dy,
    dtheta`` moves a point at the distance ``R`` by at most ``hypot(dx, dy) + 2 R sin(dtheta/2)``.
    """
    radius, reach = body.radius, problem.tolerance[0]
    half = np.array((reach, reach, min(problem.tolerance[1], math.pi)))
    boxes = np.array([problem.goal])
    seen = 0
    while len(boxes):
        if body.free(_nearest(boxes, problem.goal, reach)).any():
            return False
        moved = float(np.hypot(half[0], half[1])) + 2 * radius * math.sin(half[2] / 2)
        shown = body.collides(boxes, moved + _OVERLAP)
        boxes = boxes[~shown]
        seen += len(shown)
        if not len(boxes):
            return True
        axis = int(np.argmax(half * (1.0, 1.0, radius)))
        half[axis] /= 2
        step = np.zeros(3)
        step[axis] = half[axis]
        boxes = np.concatenate((boxes - step, boxes + step))
        # boxes whose nearest point to the goal lies outside of the tolerance
        away = np.maximum(np.abs(boxes[:, :2] - problem.goal[:2]) - half[:2], 0.0)
        boxes = boxes[np.hypot(*away.T) <= reach]
        if seen + len(boxes) > _MOST_BOXES:
            return False
    return True


def _nearest(poses: FloatArray, goal: FloatArray, reach: float) -> FloatArray:
    """Poses (n, 3), those farther from the goal than ``reach`` (m) pulled to it."""
    away = poses[:, :2] - goal[:2]
    size = np.hypot(*away.T)
    share = np.minimum(1.0, reach / np.maximum(size, 1e-300))[:, None]
    return np.column_stack((goal[:2] + share * away, poses[:, 2]))


def _margin(problem: PlanningProblem) -> str:
    rho = problem.surface.characteristic_length
    widest = 0.0
    for contact in problem.contacts:
        widest = max(widest, contact.cone(rho).widest_margin)
        if widest >= max(_NO_MARGIN, problem.min_margin):
            # one is enough
            return ""
    if widest < _NO_MARGIN:
        return "no contact has a stable push whose margin is above zero; two fingers or more are needed, with friction"
    if widest < problem.min_margin - _MARGIN_SLACK:
        return (
            f"min_margin: no push has a margin of {problem.min_margin:.4g} rad, the contacts allow at most {widest:.4g} rad "
            f"({math.degrees(widest):.3g} deg)"
        )
    return ""


def _rest(problem: PlanningProblem) -> str:
    loads = loads_of(problem)
    if loads is None or loads.resting_share < 1.0:
        return ""
    return (
        "effects: a slider that is not pushed does not rest, the slope pulls with "
        f"{loads.resting_share:.3g} of what friction holds where that is least"
    )


def _turn(problem: PlanningProblem) -> str:
    """Return why the bounds keep the only contact from turning the slider to the heading of the goal; empty if they do not.

    While the slider turns by ``d``, the origin of B travels at least ``d`` times the radius ``r`` of the tightest stable turn, in
    body directions that lie within ``f`` of a middle one: ahead by at least ``r (sin(f + d) - sin(f))``.
    """
    if problem.bounds is None or len(problem.contacts) > 1:
        return ""
    needed = abs(float(wrap_angle(problem.goal[2] - problem.start[2]))) - problem.tolerance[1]
    if needed <= _TURN_SLACK:
        return ""
    try:
        region = stable_region(problem.surface, problem.contacts[0])
    except (InputError, UnsupportedContactError, ConvergenceError):
        return ""
    radius, middle, spread = _steering(region)
    if spread >= math.pi / 2 or radius <= 0:
        return ""
    ahead = np.array((math.cos(problem.start[2] + middle), math.sin(problem.start[2] + middle)))
    ends = problem.bounds.reshape(2, 2) - problem.start[:2]
    clearance = float((ahead * ends).max(axis=0).sum())
    share = math.sin(spread) + clearance / radius
    if share >= 1.0:
        return ""
    most = math.asin(share) - spread
    if needed <= most + _TURN_SLACK:
        return ""
    return (
        f"goal: within the bounds this contact can turn the slider by {math.degrees(most):.3g} deg at most, the goal asks for "
        f"{math.degrees(needed):.3g} deg or more, without its tolerance; the tightest stable turn has a radius of {radius:.3g} m"
    )


def _steering(region: StableRegion) -> tuple[float, float, float]:
    """Radius (m) of the tightest turn of the origin of B, middle and half width (rad) of the directions in which it moves."""
    turns = [region.tightest_turn(sense) for sense in (1, -1)]
    radius = min((math.hypot(*cor) for cor in turns if cor is not None), default=math.inf)
    rings = [twist for sense in (1, -1) for ring in region.boundary_twists(sense) for twist in ring]
    if not rings or radius <= 0:
        return 0.0, 0.0, math.pi
    velocities = np.array(rings)[:, :2]
    total = velocities.sum(axis=0)
    middle = math.atan2(total[1], total[0])
    angles = wrap_angle(np.arctan2(velocities[:, 1], velocities[:, 0]) - middle)
    return radius, middle, float(np.abs(angles).max())


def _first_push(problem: PlanningProblem, bodies: list[_Body]) -> str:
    rho = problem.surface.characteristic_length
    rng = np.random.default_rng(0)
    away = rho * 10 ** rng.uniform(-1.0, 3.0, size=_TURNS)
    bearing = rng.uniform(-np.pi, np.pi, size=_TURNS)
    turns = twist_from_cor(away[:, None] * np.stack((np.cos(bearing), np.sin(bearing)), axis=-1), rng.choice((1.0, -1.0), _TURNS))
    angles = np.linspace(-np.pi, np.pi, _TRANSLATIONS, endpoint=False)
    straight = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1)
    twists = np.concatenate((straight, turns))
    step = min(_STEP * problem.slider.radius, _LONGEST_STEP)
    ends = compose(problem.start, exp(twists * (step / problem.push_speed(twists))[:, None]))
    for contact, body in zip(problem.contacts, bodies, strict=True):
        if not body.collides(problem.start[None], -2 * step).any():
            # free all round
            return ""
        try:
            held = StabilityOracle(problem.surface, contact).is_stable(twists)
        except ConvergenceError:
            return ""
        # a stable set too narrow for the sample proves nothing
        if held.sum() < _FEWEST or (body.free(problem.start)[0] and body.free(ends[held]).any()):
            return ""
    return "start: every stable push, of every contact, runs into an obstacle or the bounds as it begins"
