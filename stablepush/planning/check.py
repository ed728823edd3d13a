"""Verify a plan from the problem alone. Geometry, motion and margins share nothing with the planners; probabilities that a plan
states are measured again, on scenarios of the check's own, by the same code (:mod:`stablepush.planning.chance.success`).

Arcs are tested exactly: while a polygon turns about a point, contact begins where a vertex of one polygon crosses an
edge of the other, so a start without overlap and no crossing of vertex circles with edges, both ways, means no collision.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from stablepush.core import FloatArray, InputError
from stablepush.geometry import compose, exp, transform_points, wrap_angle
from stablepush.planning.chance.success import estimate_success
from stablepush.planning.problem import PlanningProblem, require_problem
from stablepush.planning.pusher_loads import loads_of, require_loads
from stablepush.planning.result import PlanResult, Push, Transfer
from stablepush.stability import StabilityOracle

#: Poses and sums must agree to this (m, rad, s), and bodies may overlap by it (m): touching is no collision.
TOLERANCE = 1e-6
_STILL = 1e-9
#: Parts of an arc, as shares of it, that are halved no more: by then what a part may hide is far below the tolerance.
_FINEST = 1e-5
#: Seed of the check's own scenarios, the level of the interval that a stated probability must lie in, and what is granted to a
#: number that was itself measured on as many scenarios.
_SEED, _CERTAINTY, _STATED = 987_654_321, 0.999, 0.02
#: A plan that starts farther (m) from the scene's start, or a degree, was made for another scene.
_OTHER_START = 1e-3
#: Said of a push whose margin is not the one that its plan states.
_OTHER_MARGIN = "states a margin of"


@dataclass(frozen=True, slots=True)
class CheckReport:
    """Verdict on a plan and every objection to it, in words."""

    valid: bool
    objections: tuple[str, ...]

    @property
    def main_objection(self) -> str:
        """The first objection that is not to a stated margin, if there is one; empty for a valid plan."""
        return next((words for words in self.objections if _OTHER_MARGIN not in words), next(iter(self.objections), ""))

    @property
    def only_margins_differ(self) -> bool:
        """Whether all that is wrong is the margins that a plan states, as where it was made for another scene. Its pushes are
        stable all the same."""
        return bool(self.objections) and all(_OTHER_MARGIN in words for words in self.objections)


def check_plan(problem: PlanningProblem, result: PlanResult) -> CheckReport:
    """Verify status, sums, poses, speed, stability, bounds, collisions, transfers and goal of a plan.

    Raises :class:`InputError` for a problem with effects that plans do not know.
    """
    require_problem(problem)
    if not isinstance(result, PlanResult):
        words = "expected a PlanResult; stablepush.load_plan reads one from a file"
        raise InputError("result", words, repr(result) if isinstance(result, str) else type(result).__name__)
    problem.require_plannable()
    require_loads(problem)
    objections: list[str] = []
    if result.status != "solved":
        objections.append(f"status: expected solved, got {result.status}{f': {result.message}' if result.message else ''}")
        if not result.segments:
            # why there is no path has been said
            return CheckReport(False, tuple(objections))
    if not result.segments:
        objections.append("segments: expected at least one")
    else:
        objections += _check_sums(problem, result)
        objections += _check_chain(problem, result)
        boxes = np.array([(*o.min(axis=0), *o.max(axis=0)) for o in problem.obstacles]).reshape(-1, 4)
        for index, segment in enumerate(result.segments):
            if isinstance(segment, Push):
                objections += _check_push(problem, segment, f"segment {index}", boxes)
        objections += _check_goal(problem, result) + _check_rest(problem)
    if not objections:
        objections += _check_probabilities(problem, result)
    return CheckReport(not objections, tuple(objections))


def _check_probabilities(problem: PlanningProblem, result: PlanResult) -> list[str]:
    """Stated probabilities, against scenarios of the check's own."""
    stated = {"success_probability": result.success_probability, "arrival_probability": result.arrival_probability}
    if all(value is None for value in stated.values()):
        return []
    if not problem.surface.is_dual:
        kind = type(problem.surface).__name__
        return [f"{name}: states one, plans of a {kind} have none" for name, value in stated.items() if value is not None]
    own = estimate_success(problem, result, seed=_SEED)
    found = []
    for (name, value), (low, high) in zip(stated.items(), own.intervals(_CERTAINTY), strict=True):
        if value is not None and not low - _STATED <= value <= high + _STATED:
            found.append(f"{name}: states {value:.4g}, scenarios of the check give {low:.4g} to {high:.4g}")
    return found


def _check_sums(problem: PlanningProblem, result: PlanResult) -> list[str]:
    found = []
    pushes = result.pushes
    sums = {
        "duration": (result.duration, sum(s.duration for s in result.segments)),
        "length": (result.length, sum(p.length for p in pushes)),
        "switches": (result.switches, len(result.segments) - len(pushes)),
        "min_margin": (result.min_margin, min((p.margin for p in pushes), default=0.0)),
    }
    for name, (stated, summed) in sums.items():
        if abs(stated - summed) > TOLERANCE:
            found.append(f"{name}: states {stated:.9g}, its segments add up to {summed:.9g}")
    if result.lower_bound is not None and result.lower_bound > result.duration + TOLERANCE:
        found.append(f"lower_bound: {result.lower_bound:.9g} s is above the duration {result.duration:.9g} s")
    if result.planning_time < 0:
        found.append(f"planning_time: expected a time >= 0, got {result.planning_time:g}")
    if not pushes:
        found.append("segments: expected at least one push")
    return found


def _check_chain(problem: PlanningProblem, result: PlanResult) -> list[str]:
    """Poses that follow on each other, contacts that do, and transfers."""
    found = []
    pose, contact = problem.start, 0
    for index, segment in enumerate(result.segments):
        place = f"segment {index}"
        if isinstance(segment, Transfer):
            if segment.source != contact:
                found.append(f"{place}: leaves contact {segment.source}, the pusher is at {contact}")
            if segment.source == segment.target:
                found.append(f"{place}: goes from contact {segment.source} to itself")
            found += _check_transfer(problem, segment, pose, place)
            contact = segment.target
            continue
        if segment.contact != contact:
            found.append(f"{place}: pushes at contact {segment.contact}, the pusher is at {contact}")
            contact = segment.contact
        if _pose_difference(segment.start, pose) > TOLERANCE:
            apart = np.hypot(*(segment.start[:2] - pose[:2])), np.rad2deg(abs(wrap_angle(segment.start[2] - pose[2])))
            there = "the scene's start" if index == 0 else "where the slider stands then"
            other = ": was the plan made for another scene?" if index == 0 and (apart[0] > _OTHER_START or apart[1] > 1) else ""
            found.append(f"{place}: starts {1000 * apart[0]:.3g} mm and {apart[1]:.3g} deg from {there}{other}")
        pose = segment.end
    return found


def _check_push(problem: PlanningProblem, push: Push, place: str, boxes: FloatArray) -> list[str]:
    if not 0 <= push.contact < len(problem.contacts):
        return [f"{place}: expected a contact from 0 to {len(problem.contacts) - 1}, got {push.contact}"]
    if not push.twist.any():
        return [f"{place}: expected a twist that is not zero"]
    if push.duration <= 0:
        return [f"{place}: expected a duration > 0, got {push.duration:g}"]
    found = []
    error = _pose_difference(push.end, compose(push.start, exp(push.twist * push.duration)))
    if error > TOLERANCE:
        found.append(f"{place}: its end is not where its twist and duration lead: {error:.2g} m or rad off")
    speed = float(problem.push_speed(push.twist))
    if speed > problem.speed * (1 + TOLERANCE):
        found.append(f"{place}: a point of the outline moves at {speed:.6g} m/s, the limit is {problem.speed:g}")
    margin = _margin(problem, push)
    if abs(margin - push.margin) > TOLERANCE:
        found.append(f"{place}: {_OTHER_MARGIN} {push.margin:.6g} rad, recomputed it is {margin:.6g} rad")
    least = max(0.0, problem.min_margin)
    if margin < least - TOLERANCE:
        found.append(f"{place}: margin {margin:.6g} rad is below {least:g}")
    for name, outline in _bodies(problem, push.contact):
        found += _check_sweep(problem, outline, push, f"{place}: {name}", boxes)
    return found


def _margin(problem: PlanningProblem, push: Push) -> float:
    """The margin of a push, the least along its arc where effects make the load depend on the pose.

    Over a part ``w`` of the arc a load is off the straight line between its ends by at most ``b w²/8``, ``b`` its greatest second
    derivative, and margins above zero are not less on a straight line than at its ends. Parts that cannot hold less than what was
    seen are left out, others are halved.
    """
    loads, contact = loads_of(problem), problem.contacts[push.contact]
    if loads is None:
        return float(StabilityOracle(problem.surface, contact).margin(push.twist))
    cone, rho = contact.cone(loads.rho), loads.rho
    turn, way = abs(push.twist[2]) * push.duration, push.length
    most = loads.changing
    bend = most.bend * turn**2 + 2 * most.per_both * turn * way + most.per_way * way * turn
    lows, width, least = np.zeros(1), 1.0, np.inf
    while len(lows):
        shares = np.unique(np.concatenate((lows, lows + width)))
        poses = compose(push.start, exp(push.twist * (push.duration * shares)[:, None]))
        wrenches = loads.at(np.tile(push.twist, (len(shares), 1)), poses) / (1.0, 1.0, rho)
        margins, sizes = cone.margin(wrenches), np.linalg.norm(wrenches, axis=1)
        least = min(least, float(margins.min()))
        first, last = np.searchsorted(shares, lows), np.searchsorted(shares, lows + width)
        off = bend * width**2 / 8 / np.maximum(np.minimum(sizes[first], sizes[last]), 1e-300)
        # a load that may vanish between has any direction
        turned = np.where(off < 0.5, np.arcsin(np.minimum(1.0, 2 * off)), np.pi)
        lowest = np.minimum(margins[first], margins[last])
        halves = lows[lowest - turned < least - TOLERANCE / 4] if least > 0 and width > _FINEST else lows[:0]
        width /= 2
        lows = np.concatenate((halves, halves + width))
    return least


def _check_rest(problem: PlanningProblem) -> list[str]:
    loads = loads_of(problem)
    if loads is None or loads.resting_share < 1.0:
        return []
    return ["effects: a slider that is not pushed does not rest on the slope"]


def _bodies(problem: PlanningProblem, contact: int) -> list[tuple[str, FloatArray]]:
    """Outlines (n, 2) in B that move during a push."""
    bodies = [("slider", problem.slider.vertices)]
    return bodies + [("pusher", outline) for outline in problem.docked_outlines(problem.contacts[contact])]


def _check_sweep(problem: PlanningProblem, outline: FloatArray, push: Push, place: str, boxes: FloatArray) -> list[str]:
    """``boxes`` (n, 4): lowest and highest x, y of the obstacles."""
    found = []
    placed = transform_points(push.start, outline)
    sweep = _Sweep.from_push(push)
    extremes = sweep.extremes(placed)
    if not _within(problem.bounds, extremes):
        found.append(f"{place} leaves the bounds")
    rings = _shrunk(placed)
    near = (boxes[:, 2:] >= extremes.min(axis=0)).all(axis=1) & (boxes[:, :2] <= extremes.max(axis=0)).all(axis=1)
    for i in np.flatnonzero(near):
        if any(sweep.hits(ring, problem.obstacles[i]) for ring in rings):
            found.append(f"{place} hits obstacle {i}")
    return found


def _check_transfer(problem: PlanningProblem, transfer: Transfer, pose: FloatArray, place: str) -> list[str]:
    found = []
    if abs(transfer.duration - problem.switch_cost) > TOLERANCE:
        found.append(f"{place}: takes {transfer.duration:g} s, a change of contact costs {problem.switch_cost:g} s")
    count = len(problem.contacts)
    if not (0 <= transfer.source < count and 0 <= transfer.target < count):
        return [
            *found,
            f"{place}: expected contacts from 0 to {count - 1}, got {transfer.source} and {transfer.target}",
        ]
    path = transfer.pusher_path
    if not len(path):
        has_outline = bool(problem.pusher_outlines(problem.contacts[transfer.source]))
        return [*found, f"{place}: expected a path for the pusher"] if has_outline else found
    for name, contact, end in (("first", transfer.source, path[0]), ("last", transfer.target, path[-1])):
        error = _pose_difference(end, compose(pose, problem.contacts[contact].frame))
        if error > TOLERANCE:
            found.append(f"{place}: the {name} pusher pose differs from the docked one by {error:.2g}")
    shapes = [problem.pusher_outlines(problem.contacts[k]) for k in (transfer.source, transfer.target)]
    if not shapes[0]:
        return found
    radius = float(np.linalg.norm(np.concatenate(shapes[0] + shapes[1]), axis=1).max())
    leaving, coming = ([ring for outline in shape for ring in _shrunk(outline)] for shape in shapes)
    obstacles = [shapely.Polygon(o) for o in (*problem.obstacles, transform_points(pose, problem.slider.vertices))]
    blocked = shapely.union_all(obstacles)
    for i, (a, b) in enumerate(pairwise(path)):
        # fingers leave one contact as they stand there and come to the other as they do there; between, both ways count
        first, last = i == 0, i == len(path) - 2
        rings = leaving if first and not last else coming if last and not first else leaving + coming
        step = np.array((*(b[:2] - a[:2]), float(wrap_angle(b[2] - a[2]))))
        # motions of less than this (m) are rounding
        if np.hypot(*step[:2]) < _STILL:
            step[:2] = 0.0
        if abs(step[2]) * radius < _STILL:
            step[2] = 0.0
        if step[:2].any() and step[2]:
            clear = _motion_is_clear(problem, blocked, a, step, radius, rings)
        else:
            # straight, or turning on the spot: exact, also where the pusher slides along something
            sweep = _Sweep(a[:2] if step[2] else None, float(step[2]), step[:2])
            placed = [transform_points(a, ring) for ring in rings]
            clear = not any(sweep.hits(ring, shapely.get_coordinates(o)[:-1]) for ring in placed for o in obstacles)
            clear = clear and all(_within(problem.bounds, sweep.extremes(ring)) for ring in placed)
        if not clear:
            found.append(f"{place}: the pusher hits something between path poses {i} and {i + 1}")
    return found


def _motion_is_clear(
    problem: PlanningProblem,
    blocked: shapely.Geometry,
    start: FloatArray,
    step: FloatArray,
    radius: float,
    rings: list[FloatArray],
) -> bool:
    """Halve the motion until every part is clear by more than it moves, or some pose overlaps."""
    parts = [(0.0, 1.0)]
    travel = float(np.hypot(step[0], step[1]) + radius * abs(step[2]))
    while parts:
        low, high = parts.pop()
        pose = start + (low + high) / 2 * step
        reach = travel * (high - low) / 2
        placed = [transform_points(pose, ring) for ring in rings]
        clear = True
        for ring in placed:
            polygon = shapely.Polygon(ring)
            gap = shapely.distance(polygon, blocked) if not shapely.is_empty(blocked) else np.inf
            if problem.bounds is not None:
                gap = min(gap, float((ring - problem.bounds[:2]).min()), float((problem.bounds[2:] - ring).min()))
            if gap <= 0 and (reach == 0 or shapely.intersects(polygon, blocked) or gap < 0):
                return False
            clear = clear and gap > reach
        if not clear and reach > TOLERANCE / 10:
            parts += [(low, (low + high) / 2), ((low + high) / 2, high)]
    return True


def _check_goal(problem: PlanningProblem, result: PlanResult) -> list[str]:
    pushes = result.pushes
    if not pushes:
        return []
    end = pushes[-1].end
    found = []
    distance = float(np.hypot(*(end[:2] - problem.goal[:2])))
    turn = abs(float(wrap_angle(end[2] - problem.goal[2])))
    if distance > problem.tolerance[0] + TOLERANCE:
        found.append(f"goal: missed by {distance:.6g} m, the tolerance is {problem.tolerance[0]:g} m")
    if turn > problem.tolerance[1] + TOLERANCE:
        found.append(f"goal: missed by {turn:.6g} rad, the tolerance is {problem.tolerance[1]:g} rad")
    return found


def _within(bounds: FloatArray | None, points: FloatArray) -> bool:
    if bounds is None:
        return True
    return bool((points >= bounds[:2] - TOLERANCE).all() and (points <= bounds[2:] + TOLERANCE).all())


def _pose_difference(a: FloatArray, b: FloatArray) -> float:
    return max(float(np.abs(a[:2] - b[:2]).max()), abs(float(wrap_angle(a[2] - b[2]))))


def _shrunk(outline: FloatArray) -> list[FloatArray]:
    """Polygons of an outline, moved inwards by the tolerance so that bodies that only touch do not overlap."""
    inner = shapely.buffer(shapely.Polygon(outline), -TOLERANCE, join_style="mitre")
    return [
        shapely.get_coordinates(shapely.get_exterior_ring(part))[:-1]
        for part in shapely.get_parts(inner)
        if not shapely.is_empty(part)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Sweep:
    """Rigid motion in W: a turn by ``angle`` (rad) about ``center``, or a translation by ``shift`` when ``center`` is None."""

    center: FloatArray | None
    angle: float
    shift: FloatArray

    @classmethod
    def from_push(cls, push: Push) -> _Sweep:
        vx, vy, omega = push.twist
        angle = omega * push.duration
        # a turn too small to have a usable centre moves like a translation to far below the tolerance
        if abs(angle) < 1e-9:
            return cls(None, 0.0, compose(push.start, exp(push.twist * push.duration))[:2] - push.start[:2])
        center = transform_points(push.start, np.array(((-vy / omega, vx / omega),)))[0]
        return cls(center, float(angle), np.zeros(2))

    def reversed(self) -> _Sweep:
        return _Sweep(self.center, -self.angle, -self.shift)

    def extremes(self, points: FloatArray) -> FloatArray:
        """Ends of the points' paths (m, 2), and the places where they run parallel to an axis."""
        if self.center is None:
            return np.concatenate((points, points + self.shift))
        arm = points - self.center
        start = np.arctan2(arm[:, 1], arm[:, 0])
        radius = np.hypot(arm[:, 0], arm[:, 1])
        ends = start + self.angle
        traced = [points, self.center + radius[:, None] * np.stack((np.cos(ends), np.sin(ends)), axis=-1)]
        for quarter in np.arange(4) * (np.pi / 2):
            passed = _turned(start, np.full_like(start, quarter), self.angle)
            direction = np.array((np.cos(quarter), np.sin(quarter)))
            traced.append(self.center + radius[passed, None] * direction)
        return np.concatenate(traced)

    def hits(self, ring: FloatArray, obstacle: FloatArray) -> bool:
        """Return whether a ring (n, 2) that makes this motion overlaps an obstacle (m, 2) at any time."""
        if shapely.intersects(shapely.Polygon(ring), shapely.Polygon(obstacle)):
            return True
        return self._crosses(ring, obstacle) or self.reversed()._crosses(obstacle, ring)

    def _crosses(self, points: FloatArray, ring: FloatArray) -> bool:
        """Return whether the path of any point (n, 2) crosses any edge of a ring (m, 2)."""
        a, edge = ring[None], np.roll(ring, -1, axis=0)[None] - ring[None]
        p = points[:, None]
        if self.center is None:
            # p + s shift = a + t edge
            across = self.shift[0] * edge[..., 1] - self.shift[1] * edge[..., 0]
            gap = a - p
            with np.errstate(divide="ignore", invalid="ignore"):
                s = (gap[..., 0] * edge[..., 1] - gap[..., 1] * edge[..., 0]) / across
                t = (gap[..., 0] * self.shift[1] - gap[..., 1] * self.shift[0]) / across
                return bool(((s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)).any())
        arm, rel = p - self.center, a - self.center
        start = np.arctan2(arm[..., 1], arm[..., 0])
        # |rel + t edge|² = |arm|²
        qa = (edge**2).sum(axis=-1)
        qb = (rel * edge).sum(axis=-1)
        qc = (rel**2).sum(axis=-1) - (arm**2).sum(axis=-1)
        discriminant = qb * qb - qa * qc
        root = np.sqrt(np.maximum(discriminant, 0.0))
        for sign in (-1.0, 1.0):
            t = (-qb + sign * root) / qa
            at = rel + t[..., None] * edge
            passed = _turned(start, np.arctan2(at[..., 1], at[..., 0]), self.angle)
            if ((discriminant >= 0) & (t >= 0) & (t <= 1) & passed).any():
                return True
        return False


def _turned(start: FloatArray, angle: FloatArray, turn: float) -> np.ndarray:
    """Return whether a turn (rad, signed) from ``start`` passes ``angle``."""
    travel = np.mod((angle - start) * np.sign(turn), 2 * np.pi)
    return np.asarray(travel <= abs(turn))
