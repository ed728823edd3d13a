"""Anytime A* on a lattice of poses whose edges are single stable pushes (:mod:`stablepush_planners.lattice`).

A ladder of lattices, from coarse to fine, is searched until one holds a path; every expanded pose is also joined to the goal by a
Dubins path of the contact's reference point. Then the path is shortened, and searches with smaller weights, on this lattice
and on finer ones, look for better ones. Only when the finest lattice is exhausted the answer is ``no-path``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stablepush._arrays import FloatArray
from stablepush._sweep import World
from stablepush.collision import SweptBody, body_of, world_of
from stablepush.errors import OutOfTimeError
from stablepush.path import PlanResult, Push, Transfer
from stablepush.problem import PlanningProblem
from stablepush.se2 import compose, exp
from stablepush_planners import _search
from stablepush_planners._search import Graph, Tree
from stablepush_planners.connect import TimedTwist, merged, shorten
from stablepush_planners.distance_field import DistanceField
from stablepush_planners.lattice import Edges, lattice_edges
from stablepush_planners.stable_set import StableSet
from stablepush_planners.steering import Steering, steering
from stablepush_planners.transfers import Routes, routes_of, transfer_path

NAME = "cor-lattice"

#: The ladder of resolutions: number of headings, and width of a cell in radii of the slider.
LADDER = ((16, 0.25), (24, 0.125), (32, 0.0625))
#: Weights of the guess: the first search is greedy, the others look for better paths.
WEIGHTS = (3.0, 1.5, 1.0)
#: A lattice path is of use if it takes less than this, in times of the best plan: shortening may make it the better one.
WORTH = 1.05
#: Turning radii that joints try, in units of the tightest: slower to turn, but the outline swings out less.
RADII = (1.0, 2.0, 4.0, 8.0)
#: Cells each way about the goal for which the time without obstacles is known.
TABLE_REACH = 20
#: Nodes expanded between looks at the clock.
QUOTA = 500
#: Poses spread along a path between which the way is shortened, in the rounds of shortening.
PIECES = (24, 40, 60)
#: Largest heading and contact number that a search can tell apart, and the size of its first tree.
_MOST_CONTACTS, _FIRST_SIZE = 200, 1 << 14


def plan_cor_lattice(
    problem: PlanningProblem,
    *,
    deadline: float,
    seed: int = 0,
    region: str = "model",
    improve: float = 20_000,
    progress: Callable[[str], None] | None = None,
) -> PlanResult:
    """Plan with the COR lattice; see :func:`stablepush.plan`."""
    said = progress or (lambda _: None)
    planner: _Planner | None = None
    try:
        planner = _Planner(problem, region, deadline, said)
        if planner.hopeless:
            return planner.answer("no-path", planner.hopeless, seed)
        planner.run(improve)
    except OutOfTimeError:
        if planner is None:
            return PlanResult("timeout", NAME, seed=seed, message="the time limit left no time to search")
    if planner.best is not None:
        return planner.solved(seed)
    if time.perf_counter() > deadline:
        return planner.answer("timeout", "the time limit passed before a path was found", seed)
    return planner.answer("no-path", planner.hopeless or f"the lattice is exhausted at all {len(LADDER)} resolutions", seed)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Cost and path (contacts and their pushes) that a search found, if any, and how many poses it expanded."""

    cost: float
    stretches: list[tuple[int, list[TimedTwist]]] | None
    expanded: int


@dataclass(slots=True, eq=False)
class _Planner:
    """What all searches of a problem share, and the best plan so far."""

    problem: PlanningProblem
    world: World
    bodies: list[SweptBody]
    stable: dict[int, StableSet]
    steerings: dict[int, Steering]
    field: DistanceField
    routes: Routes | None
    deadline: float
    said: Callable[[str], None]
    hopeless: str
    bound: float
    best: list[Push | Transfer] | None
    duration: float
    #: of the search that found the best plan: its words
    found_by: str

    def __init__(self, problem: PlanningProblem, region: str, deadline: float, said: Callable[[str], None]) -> None:
        self.problem, self.deadline, self.said = problem, deadline, said
        self.best, self.duration, self.found_by, self.hopeless, self.bound = None, math.inf, "", "", 0.0
        if time.perf_counter() > deadline:
            raise OutOfTimeError("the deadline has passed")
        self.world = world_of(problem)
        self.bodies = [SweptBody(problem, contact, self.world) for contact in problem.contacts]
        self.field = DistanceField(problem)
        self.routes = None if problem.pusher is None or len(problem.contacts) == 1 else routes_of(problem)
        self.stable = {i: StableSet(problem, i, region, deadline) for i in range(min(len(problem.contacts), _MOST_CONTACTS))}
        self.steerings = {}
        if not self.bodies[0].free(problem.start)[0]:
            self.hopeless = "the start pose is in collision or out of bounds"
            return
        if not any(body.free(problem.goal)[0] for body in self.bodies) and max(problem.tolerance) == 0:
            self.hopeless = "the goal pose is in collision or out of bounds"
            return
        for i, stable in self.stable.items():
            found = steering(problem, stable)
            if found is not None:
                self.steerings[i] = found
        x, y, theta = problem.start
        graph = self.graph(4, 1.0, {})
        self.bound = float(_search.least_time(graph, x, y, math.cos(theta), math.sin(theta)))
        if math.isinf(self.bound):
            self.hopeless, self.bound = "obstacles close off the goal", 0.0

    def answer(self, status: str, message: str, seed: int) -> PlanResult:
        return PlanResult(status, NAME, lower_bound=self.bound, seed=seed, message=message)

    def solved(self, seed: int) -> PlanResult:
        assert self.best is not None
        # the best way may be shorter than the bound by rounding
        bound = min(self.bound, self.duration)
        return PlanResult.from_segments(self.best, planner=NAME, seed=seed, lower_bound=bound, message=self.found_by)

    def run(self, improve: float) -> None:
        """Climb the ladder; once there is a plan, look for better ones while no more than ``improve`` poses are expanded."""
        if self._nudged():
            return
        useful = False
        for rung, (headings, share) in enumerate(LADDER):
            self.said(f"lattice {rung + 1} of {len(LADDER)}: {headings} headings")
            cell = share * self.problem.slider.radius
            edges = {i: lattice_edges(self.problem, stable, headings, cell) for i, stable in self.stable.items()}
            useful = useful or any(len(e.durations) for e in edges.values())
            graph = self.graph(headings, cell, edges, table=True)
            limit = math.inf
            for weight in WEIGHTS:
                words = f"{headings} headings, cells of {1000 * cell:.3g} mm, weight {weight:g}"
                found = self.best is not None
                left = improve if found else math.inf
                search = self._search(graph, weight, min(limit, WORTH * self.duration), left, words)
                if search.stretches is not None:
                    limit = search.cost
                    self._take(graph, search.stretches, words)
                improve -= search.expanded if found else 0
                if improve <= 0 and self.best is not None:
                    return
                if self.best is None:
                    break
        if not useful:
            self.hopeless = "no contact has a stable push"

    def graph(self, headings: int, cell: float, edges: dict[int, Edges], table: bool = False) -> Graph:
        """Return what the compiled search needs to know."""
        problem, contacts = self.problem, len(self.problem.contacts)
        first, steps, twists, durations, count = [0], [], [], [], 0
        for i in range(contacts):
            if i in edges:
                first += (count + edges[i].first[1:]).tolist()
                steps.append(edges[i].steps)
                twists.append(edges[i].twists)
                durations.append(edges[i].durations)
                count += len(edges[i].durations)
            else:
                first += [count] * headings
        frames, radii, paces = np.zeros((contacts, 3)), np.zeros((contacts, len(RADII))), np.zeros((contacts, len(RADII), 3))
        for i, steer in self.steerings.items():
            frames[i] = steer.frame
            turns = np.array([[steer.twist(k / (m * steer.radius)) for k in (1.0, 0.0, -1.0)] for m in RADII])
            good = self.stable[i].accepts(turns.reshape(-1, 3)).reshape(-1, 3).all(axis=1)
            radii[i, : good.sum()] = steer.radius * np.array(RADII)[good]
            paces[i, : good.sum()] = problem.push_speed(turns[good]) / problem.speed
        bodies = [body.body for body in self.bodies]
        theta = float(problem.start[2])
        angles = theta + 2 * np.pi / headings * np.arange(headings)
        turn = np.array(((math.cos(theta), math.sin(theta)), (-math.sin(theta), math.cos(theta))))
        there = np.rint(turn @ (problem.goal[:2] - problem.start[:2]) / cell).astype(np.int64)
        heading = round((float(problem.goal[2]) - theta) / (2 * math.pi) * headings) % headings
        edge_first = np.array(first, dtype=np.int64)
        all_steps = np.concatenate(steps) if steps else np.zeros((0, 3), dtype=np.int64)
        all_durations = np.concatenate(durations) if durations else np.zeros(0)
        size = 2 * TABLE_REACH + 1 if table else 1
        known = np.zeros((contacts, headings, size, size))
        if table:
            _search.unobstructed(
                edge_first, all_steps, all_durations, headings, contacts, problem.switch_cost, heading, size, known
            )
        pusher = body_of([problem.pusher]) if problem.pusher is not None else None
        routes = self.routes
        return Graph(
            origin=np.array(problem.start),
            cell=cell,
            headings=headings,
            cos=np.cos(angles),
            sin=np.sin(angles),
            edge_first=edge_first,
            steps=all_steps,
            twists=np.concatenate(twists) if twists else np.zeros((0, 3)),
            durations=all_durations,
            body_first=np.cumsum([0] + [len(b.edges) for b in bodies]),
            body_edges=np.concatenate([b.edges for b in bodies]),
            corner_first=np.cumsum([0] + [len(b.corners) for b in bodies]),
            corners=np.concatenate([b.corners for b in bodies]),
            body_radius=np.array([b.radius for b in bodies]),
            switch_cost=problem.switch_cost,
            changes=_search.NO_PUSHER if problem.pusher is None else _search.KNOWN_WAYS,
            pusher_edges=np.zeros((0, 4)) if pusher is None else pusher.edges,
            pusher_corners=np.zeros((0, 2)) if pusher is None else pusher.corners,
            pusher_radius=0.0 if pusher is None else pusher.radius,
            docks=np.zeros((contacts, 3)) if routes is None else routes.docks,
            retreats=np.full(contacts, -1.0) if routes is None else routes.retreats,
            route_first=np.zeros(2 * contacts**2 + 1, dtype=np.int64) if routes is None else routes.first,
            routes=np.zeros((0, 2)) if routes is None else routes.points,
            goal=np.array(problem.goal),
            tolerance=np.array(problem.tolerance),
            outline=np.array(problem.slider.vertices),
            speed=problem.speed,
            field=self.field.times,
            field_low=np.array(self.field.low),
            field_cell=self.field.cell,
            table=known,
            goal_at=there,
            frames=frames,
            radii=radii,
            paces=paces,
        )

    def _search(self, graph: Graph, weight: float, limit: float, most: float, words: str) -> _Search:
        """Search once for a path that costs less than ``limit``, over at most ``most`` poses."""
        tree = _empty_tree(_FIRST_SIZE)
        for contact in self.stable:
            # without a pusher outline a change of contact needs no way round the slider
            if contact == 0 or self.problem.pusher is None:
                cost = 0.0 if contact == 0 else self.problem.switch_cost
                _search.reach(graph, tree, _search.key_of(contact, 0, 0, 0), cost, -1, _search.START, weight, limit)
        denied = np.zeros(0, dtype=np.int64)
        while True:
            expanded = int(tree.counts[2])
            why = _search.expand(graph, self.world, tree, weight, limit, int(min(QUOTA, most - expanded)), denied)
            if why == _search.FULL:
                tree = _larger(tree)
            elif why == _search.DONE:
                node = int(tree.counts[3])
                return _Search(float(tree.cost[node]), self._path(graph, tree, node), int(tree.counts[2]))
            elif why == _search.EXHAUSTED or tree.counts[2] >= most:
                return _Search(math.inf, None, int(tree.counts[2]))
            self.said(f"{words}: {tree.counts[2]} poses expanded, {tree.counts[1]} queued")
            if time.perf_counter() > self.deadline:
                raise OutOfTimeError("search: the deadline has passed")

    def _path(self, graph: Graph, tree: Tree, node: int) -> list[tuple[int, list[TimedTwist]]]:
        """Turn a chain of nodes into stretches of one contact each."""
        chain = []
        while node >= 0:
            chain.append(node)
            node = int(tree.parent[node])
        chain.reverse()
        first = _search.parts_of(tree.key[chain[0]])[0]
        stretches: list[tuple[int, list[TimedTwist]]] = [(int(first), [])]
        pose = np.array(self.problem.start)
        for parent, child in pairwise(chain):
            via = int(tree.via[child])
            contact = int(_search.parts_of(tree.key[child])[0])
            if via == _search.TRANSFER:
                stretches.append((contact, []))
                continue
            pushes = (
                [(graph.twists[via].copy(), float(graph.durations[via]))]
                if via >= 0
                else self._joint(graph, contact, pose, tree, parent, child)
            )
            stretches[-1][1].extend(pushes)
            for twist, duration in pushes:
                pose = compose(pose, exp(twist * duration))
        return [s for s in stretches if s[1]]

    def _joint(self, graph: Graph, contact: int, pose: FloatArray, tree: Tree, parent: int, child: int) -> list[TimedTwist]:
        """Pushes of the joint between a pose and the goal, which the search has found to be free."""
        lengths, pieces = np.empty((6, 3)), np.empty((3, 4))
        most = 1e-6 + float(tree.cost[child] - tree.cost[parent]) * (1 + 1e-6)
        _search.join(graph, self.world, self.bodies[contact].body, contact, *pose, *self.problem.goal, most, lengths, pieces)
        return [(pieces[k, :3].copy(), float(pieces[k, 3])) for k in range(3) if pieces[k, 3] > 1e-9]

    def _take(self, graph: Graph, stretches: list[tuple[int, list[TimedTwist]]], words: str) -> None:
        """Shorten a path, and keep it if it is the best so far."""
        pose = np.array(self.problem.start)
        result: list[tuple[int, list[TimedTwist]]] = []
        for contact, pushes in stretches:
            end = pose
            for twist, duration in pushes:
                end = compose(end, exp(twist * duration))
            best = pushes
            for pieces in PIECES:
                body, stable = self.bodies[contact], self.stable[contact]
                best = shorten(self.problem, graph, self.world, body, stable, pose, best, pieces, self.deadline)
                best = merged(best, self.problem.speed)
            result.append((contact, best))
            pose = end
        segments = self._segments(graph, result)
        duration = sum(s.duration for s in segments)
        if duration < self.duration:
            self.best, self.duration = segments, duration
            ratio = f", {duration / self.bound:.3g} times the lower bound" if self.bound > 0 else ""
            self.found_by = f"{words}{ratio}"

    def _segments(self, graph: Graph, stretches: list[tuple[int, list[TimedTwist]]]) -> list[Push | Transfer]:
        """Return the pushes of stretches of one contact each, with the changes between them."""
        segments: list[Push | Transfer] = []
        pose, contact = self.problem.start, 0
        for at, pushes in stretches:
            if at != contact:
                segments.append(Transfer(contact, at, self._pusher_path(graph, contact, at, pose), self.problem.switch_cost))
                contact = at
            margins = self.stable[contact].oracle.margin(np.array([twist for twist, _ in pushes]))
            for (twist, duration), margin in zip(pushes, margins, strict=True):
                push = Push.from_start(contact, twist, duration, pose, float(margin))
                segments.append(push)
                pose = push.end
        return segments

    def _pusher_path(self, graph: Graph, source: int, target: int, pose: FloatArray) -> FloatArray:
        if self.routes is None:
            return np.empty((0, 3))
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        route = int(_search.route_between(graph, self.world, source, target, pose[0], pose[1], cos, sin))
        return transfer_path(self.problem, self.routes, route, pose)

    def _nudged(self) -> bool:
        """The start is within tolerance already, but a plan has a push: a short one that stays within."""
        problem = self.problem
        graph = self.graph(4, 1.0, {})
        if 0 not in self.steerings or not _search.at_goal(graph, *problem.start):
            return False
        twist = self.steerings[0].twist(0.0)
        twist = twist * (problem.speed / float(problem.push_speed(twist)))
        room = problem.tolerance[0] - float(np.hypot(*(problem.start[:2] - problem.goal[:2])))
        for length in (1e-3 * problem.slider.radius, room / 2, room / 16):
            duration = length / problem.speed
            end = compose(problem.start, exp(twist * duration))
            if length > 0 and _search.at_goal(graph, *end) and self.bodies[0].push_is_free(problem.start, twist, duration):
                self.best = self._segments(graph, [(0, [(twist, duration)])])
                self.duration, self.found_by = duration, "the start is within tolerance"
                return True
        return False


def _empty_tree(size: int) -> Tree:
    table = np.full(4 * size, -1, dtype=np.int32)
    return Tree(
        np.zeros(size, dtype=np.int64),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size, dtype=np.int32),
        np.zeros(size, dtype=np.int32),
        np.zeros(size, dtype=np.bool_),
        table,
        np.zeros(4 * size),
        np.zeros(4 * size, dtype=np.int32),
        np.array((0, 0, 0, -1), dtype=np.int64),
    )


def _larger(tree: Tree) -> Tree:
    """Twice the room, with everything in it."""
    size = 2 * len(tree.key)
    grown = _empty_tree(size)
    for name in ("key", "cost", "least", "guess", "parent", "via", "closed", "queue", "queued", "counts"):
        old, new = getattr(tree, name), getattr(grown, name)
        new[: len(old)] = old
    _search.refill(grown)
    return grown
