"""Weighted A* on a lattice of poses, with stable pushes as motions.

Headings are multiples of a full turn over the number of headings, counted from the start: every arc turns by such a
multiple, so headings never drift. Positions are pruned to one node a cell, heading and contact. A finer lattice follows
when one is exhausted; only when the finest is, the answer is ``no-path``. At regular intervals a node is joined to the
goal exactly by a Dubins path of the contact's reference point.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.collision import FootprintChecker
from stablepush.errors import OutOfTimeError
from stablepush.path import PlanResult, Push, Transfer
from stablepush.problem import PlanningProblem
from stablepush.se2 import compose, exp, transform_points, wrap_angle
from stablepush_planners.connect import Connector, TimedTwist, shorten
from stablepush_planners.distance_field import DistanceField
from stablepush_planners.primitives import Steering, steering

NAME = "cor-lattice"

#: Weight of the heuristic: the search follows it more greedily, and a solution costs at most this times the lattice's best.
WEIGHT = 2.0
#: The ladder of resolutions: number of headings, and length of a push in radii of the slider.
LADDER = ((24, 0.8), (32, 0.4), (48, 0.2))
#: A cell is this share of a push wide.
CELL_SHARE = 0.5
#: Radii of the turns, in units of the tightest one and at least of the push length, and the largest angle (rad) of one arc.
TURN_RADII = ((1.0, 0.0), (2.0, 1.5))
LARGEST_ARC = math.pi / 3
#: Straight pushes, in push lengths.
STRAIGHTS = (1.0, 3.0)
#: Poses that stand for a push of the lattice in the first test lie at most this share of the slider's radius apart.
STEP_SHARE = 0.04
#: Poses within the goal's tolerance to this (m, rad) count as inside: less than the check allows.
GOAL_SLACK = 1e-7
#: Poses spread along a path between which the way is shortened in the end.
PIECES = 24
#: With less time (s) than this left no search begins: the first load of a fresh install compiles for a second or two, which
#: cannot be cut short.
LEAST_TIME = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class _Primitive:
    """A push of one contact: body twist at the speed limit, duration, and the poses that sample its sweep."""

    contact: int
    twist: FloatArray
    duration: float
    turn: int
    move: FloatArray
    samples: FloatArray
    reach: float


@dataclass(frozen=True, slots=True, eq=False)
class _Node:
    cost: float
    pose: FloatArray
    turn: int
    contact: int
    parent: int
    pushes: tuple[TimedTwist, ...] = field(default=())


#: Contact, cell in x and y, heading.
_Key = tuple[int, int, int, int]


def plan_cor_lattice(
    problem: PlanningProblem,
    *,
    deadline: float,
    seed: int = 0,
    region: str = "model",
    progress: Callable[[str], None] | None = None,
) -> PlanResult:
    """Plan with the COR lattice; see :func:`stablepush.plan`."""
    bound = _lower_bound(problem, problem.start[None])[0]

    def answer(status: str, message: str) -> PlanResult:
        return PlanResult(status, NAME, lower_bound=float(bound), seed=seed, message=message)

    if time.perf_counter() > deadline - LEAST_TIME:
        return answer("timeout", "the time limit left no time to search")
    bodies = [FootprintChecker(problem, contact, deadline) for contact in problem.contacts]
    try:
        if not bodies[0].free(problem.start).all():
            return answer("no-path", "the start pose is in collision or out of bounds")
        # without a pusher outline a change of contact needs no way round the slider
        usable = range(len(problem.contacts)) if problem.pusher is None else range(1)
        steerings = {i: s for i in usable if (s := steering(problem, i, region, deadline)) is not None}
        if not steerings:
            return answer("no-path", "no contact has a stable straight push with stable turns to both sides")
        for rung, (headings, share) in enumerate(LADDER):
            if progress is not None:
                progress(f"lattice {rung + 1} of {len(LADDER)}: {headings} headings")
            search = _Search(problem, steerings, bodies, headings, share, deadline, progress)
            segments = search.run()
            if segments is None:
                continue
            result = PlanResult.from_segments(segments, planner=NAME, seed=seed, lower_bound=float(bound))
            return _gentler(problem, result, search, region, bodies, headings, share, deadline) or result
    except OutOfTimeError:
        return answer("timeout", "the time limit passed before a path was found")
    return answer("no-path", f"the lattice is exhausted at all {len(LADDER)} resolutions")


def _gentler(
    problem: PlanningProblem,
    result: PlanResult,
    search: _Search,
    region: str,
    bodies: list[FootprintChecker],
    headings: int,
    share: float,
    deadline: float,
) -> PlanResult | None:
    """Search once more with gentle turns, over no more nodes than it took before; a plan if it is quicker.

    The tightest turns open the narrowest ways, but a search that is not exhaustive overuses them.
    """
    try:
        gentle = {i: s for i in search.contacts if (s := steering(problem, i, region, deadline, gentle=True)) is not None}
        if 0 not in gentle:
            return None
        second = _Search(problem, gentle, bodies, headings, share, deadline, None)
        segments = second.run(most_nodes=2 * search.expanded)
    except OutOfTimeError:
        return None
    if segments is None:
        return None
    found = PlanResult.from_segments(segments, planner=NAME, seed=result.seed, lower_bound=result.lower_bound)
    return found if found.duration < result.duration else None


def _lower_bound(problem: PlanningProblem, poses: FloatArray) -> FloatArray:
    """Least time (n,) from poses (n, 3) to the goal: no point of the outline is faster than the speed limit."""
    outline = problem.slider.vertices
    away = np.linalg.norm(transform_points(poses, outline) - transform_points(problem.goal, outline), axis=-1)
    slack = problem.tolerance[0] + problem.tolerance[1] * np.linalg.norm(outline, axis=1)
    return np.asarray(np.maximum(0.0, (away - slack).max(axis=-1)) / problem.speed)


class _Search:
    """One resolution of the lattice."""

    def __init__(
        self,
        problem: PlanningProblem,
        steerings: dict[int, Steering],
        bodies: list[FootprintChecker],
        headings: int,
        share: float,
        deadline: float,
        progress: Callable[[str], None] | None,
    ) -> None:
        self._problem, self._steerings, self._bodies = problem, steerings, bodies
        self._headings, self._deadline, self._progress = headings, deadline, progress
        self.expanded = 0
        self._length = share * problem.slider.radius
        self._connectors = {i: Connector(problem, s, bodies[i]) for i, s in steerings.items()}
        self._cell = CELL_SHARE * self._length
        self._primitives = {i: self._make_primitives(s) for i, s in steerings.items()}
        self._field = DistanceField(problem, self._cell)

    def _make_primitives(self, steer: Steering) -> list[_Primitive]:
        """Turns by whole headings, as long as a push or as the largest arc, and straight pushes."""
        unit_turn = 2 * math.pi / self._headings
        radii = sorted({max(steer.radius * multiple, self._length * least) for multiple, least in TURN_RADII})
        primitives = []
        for radius in radii:
            turn = max(1, round(min(self._length / radius, LARGEST_ARC) / unit_turn))
            for sign in (1, -1):
                primitives.append(self._primitive(steer, steer.twist(sign / radius), radius * turn * unit_turn, sign * turn))
        primitives += [self._primitive(steer, steer.twist(0.0), self._length * multiple, 0) for multiple in STRAIGHTS]
        for angle in steer.directions:
            primitives.append(self._primitive(steer, np.array((math.cos(angle), math.sin(angle), 0.0)), self._length, 0))
        accepted = steer.accept(np.array([p.twist for p in primitives]))
        return [p for p, good in zip(primitives, accepted, strict=True) if good]

    def _primitive(self, steer: Steering, twist: FloatArray, length: float, turn: int) -> _Primitive:
        """A push along a body twist that moves the reference point at unit speed."""
        pace = self._problem.speed / float(self._problem.push_speed(twist))
        twist, duration = twist * pace, length / pace
        samples, reach = self._bodies[steer.contact].samples(twist, duration, STEP_SHARE * self._problem.slider.radius)
        return _Primitive(steer.contact, twist, duration, turn, exp(twist * duration), samples, reach)

    @property
    def contacts(self) -> list[int]:
        """Contacts that are used."""
        return list(self._steerings)

    def run(self, most_nodes: float = math.inf) -> list[Push | Transfer] | None:
        """Return the segments of a path, or None when the lattice, or the number of nodes, is exhausted."""
        problem = self._problem
        if self._at_goal(problem.start):
            nudge = self._nudge()
            if nudge is not None:
                return nudge
        nodes: list[_Node] = []
        best: dict[_Key, float] = {}
        closed: set[_Key] = set()
        queue: list[tuple[float, int]] = []

        def push(node: _Node, estimate: float) -> None:
            nodes.append(node)
            heapq.heappush(queue, (node.cost + WEIGHT * estimate, len(nodes) - 1))

        first = float(self._estimate(problem.start[None])[0])
        if not math.isfinite(first):
            return None
        for contact in self._steerings:
            cost = 0.0 if contact == 0 else problem.switch_cost
            if contact == 0 or problem.pusher is None:
                push(_Node(cost, problem.start, 0, contact, -1), first)
        while queue and self.expanded < most_nodes:
            _, index = heapq.heappop(queue)
            node = nodes[index]
            if node.pushes and self._at_goal(node.pose):
                return self._path(nodes, index)
            key = self._key(node)
            if key in closed:
                continue
            closed.add(key)
            self.expanded += 1
            if time.perf_counter() > self._deadline:
                raise OutOfTimeError("search: the deadline has passed")
            if self._progress is not None and self.expanded % 200 == 0:
                self._progress(f"{self._headings} headings: {self.expanded} nodes expanded, {len(queue)} open")
            estimate = float(self._estimate(node.pose[None])[0])
            # near the goal at every node, far from it now and then
            interval = 1 + int(16 * estimate / max(first, 1e-9))
            if self.expanded % interval == 0 or self.expanded == 1:
                finish = self._connectors[node.contact].join(node.pose, problem.goal)
                if finish is not None:
                    cost, pushes = finish
                    push(_Node(node.cost + cost, problem.goal, 0, node.contact, index, tuple(pushes)), 0.0)
            for child, guess in self._successors(node, index, best):
                push(child, guess)
        return None

    def _key(self, node: _Node) -> _Key:
        return self._cell_key(node.contact, self._reference(node.contact, node.pose), node.turn)

    def _reference(self, contact: int, pose: FloatArray) -> FloatArray:
        return compose(pose, self._steerings[contact].frame)

    def _cell_key(self, contact: int, reference: FloatArray, turn: int) -> _Key:
        return (
            contact,
            math.floor(float(reference[0]) / self._cell),
            math.floor(float(reference[1]) / self._cell),
            turn % self._headings,
        )

    def _estimate(self, poses: FloatArray) -> FloatArray:
        """Admissible time to go (n,) in s."""
        return np.maximum(_lower_bound(self._problem, poses), self._field.time_to_go(poses))

    def _at_goal(self, pose: FloatArray) -> bool:
        goal, (distance, angle) = self._problem.goal, self._problem.tolerance
        return bool(np.hypot(*(pose[:2] - goal[:2])) <= distance and abs(float(wrap_angle(pose[2] - goal[2]))) <= angle)

    def _successors(self, node: _Node, index: int, best: dict[_Key, float]) -> list[tuple[_Node, float]]:
        """Free pushes, and changes of contact, that lead to a cell for the first time or more cheaply; with their estimates."""
        children: list[_Node] = []
        candidates: list[_Primitive] = []
        for p in self._primitives[node.contact]:
            end = compose(node.pose, p.move)
            child = _Node(node.cost + p.duration, end, node.turn + p.turn, node.contact, index, ((p.twist, p.duration),))
            if child.cost < best.get(self._key(child), math.inf):
                children.append(child)
                candidates.append(p)
        free = self._free(node.contact, node.pose, candidates) if candidates else []
        children = [child for child, good in zip(children, free, strict=True) if good]
        # a change of contact right after another one is never needed
        if node.pushes:
            for contact in self._steerings:
                child = _Node(node.cost + self._problem.switch_cost, node.pose, node.turn, contact, index)
                if contact != node.contact and child.cost < best.get(self._key(child), math.inf):
                    children.append(child)
        if not children:
            return []
        guesses = self._estimate(np.array([child.pose for child in children]))
        found = [(c, float(g)) for c, g in zip(children, guesses, strict=True) if math.isfinite(g)]
        for child, _ in found:
            best[self._key(child)] = child.cost
        return found

    def _free(self, contact: int, pose: FloatArray, primitives: list[_Primitive]) -> list[bool]:
        """All sweeps in one batch; what neither collides at a sample nor is surely free is looked at again, finer."""
        body = self._bodies[contact]
        poses = compose(pose, np.concatenate([p.samples for p in primitives]))
        counts = [len(p.samples) for p in primitives]
        owner = np.repeat(np.arange(len(primitives)), counts)
        near = ~body.free(poses, np.array([p.reach for p in primitives])[owner])
        free = np.ones(len(primitives), dtype=bool)
        if near.any():
            free[owner[near][~body.free(poses[near])]] = False
            for i in np.unique(owner[near]):
                if free[i]:
                    p = primitives[i]
                    free[i] = body.push_is_free(pose, p.twist, p.duration)
        return [bool(f) for f in free]

    def _nudge(self) -> list[Push | Transfer] | None:
        """The start is within tolerance already, but a plan has a push: a short one that stays within."""
        problem = self._problem
        for contact, steer in self._steerings.items():
            if contact != 0:
                continue
            room = problem.tolerance[0] - float(np.hypot(*(problem.start[:2] - problem.goal[:2])))
            for length in (1e-3 * problem.slider.radius, room / 2, room / 16):
                push = self._connectors[contact].timed(steer.twist(0.0), length)
                end = compose(problem.start, exp(push[0] * push[1]))
                if length > 0 and self._at_goal(end) and self._connectors[contact].is_free(problem.start, push):
                    return self._segments([(contact, [push])])
        return None

    def _path(self, nodes: list[_Node], index: int) -> list[Push | Transfer]:
        """Turn the chain of nodes into segments, each stretch at one contact shortened."""
        chain = []
        while index >= 0:
            chain.append(nodes[index])
            index = nodes[index].parent
        stretches: list[tuple[int, list[TimedTwist]]] = []
        for node in reversed(chain):
            if not stretches or stretches[-1][0] != node.contact:
                stretches.append((node.contact, []))
            stretches[-1][1].extend(node.pushes)
        pose = self._problem.start
        shortened = []
        for contact, pushes in stretches:
            if pushes:
                shortened.append((contact, shorten(self._connectors[contact], pose, pushes, PIECES, self._deadline)))
            for twist, duration in pushes:
                pose = compose(pose, exp(twist * duration))
        return self._segments(shortened)

    def _segments(self, stretches: list[tuple[int, list[TimedTwist]]]) -> list[Push | Transfer]:
        """Return the pushes of stretches of one contact each, with the changes between them; equal twists in a row merge."""
        segments: list[Push | Transfer] = []
        pose, contact = self._problem.start, 0
        for at, pushes in stretches:
            if at != contact:
                segments.append(Transfer(contact, at, np.empty((0, 3)), self._problem.switch_cost))
                contact = at
            merged: list[TimedTwist] = []
            for twist, duration in pushes:
                if merged and np.abs(merged[-1][0] - twist).max() <= 1e-12 * self._problem.speed:
                    merged[-1] = (merged[-1][0], merged[-1][1] + duration)
                else:
                    merged.append((twist, duration))
            for twist, duration in merged:
                margin = float(self._steerings[contact].oracle.margin(twist))
                push = Push.from_start(contact, twist, duration, pose, margin)
                segments.append(push)
                pose = push.end
        return segments
