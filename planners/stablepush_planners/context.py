"""What all planners of a problem share: obstacles, bodies, stable pushes, connections, and plans made of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from stablepush.core import BoolArray, ConvergenceError, Deadline, FloatArray, InputError, UnsupportedContactError
from stablepush.geometry import compose, exp, wrap_angle
from stablepush.planning import (
    PlanningProblem,
    PlanOptions,
    PlanResult,
    Push,
    SweptBody,
    Transfer,
    alignment_push,
    aligns,
    body_of,
    world_of,
)
from stablepush.planning.kernels import Body
from stablepush_planners._connection import Connections, connect
from stablepush_planners._goal import Goal, least_time, unobstructed_times
from stablepush_planners._search import MOST_CONTACTS, Graph
from stablepush_planners._transfer import ANY_PATH, KNOWN_PATHS, Bodies, Transfers, route_between
from stablepush_planners.blend import blended
from stablepush_planners.distance_field import DistanceField
from stablepush_planners.lattice import Lattice
from stablepush_planners.shorten import LEAST_TRAVEL, TimedTwist, merged, shorten
from stablepush_planners.stable_set import StableSet
from stablepush_planners.steering import Steering, steering
from stablepush_planners.transfers import (
    Routes,
    backed_off,
    docking_path,
    path_among_obstacles,
    pusher_shapes,
    route_path,
    routes_of,
)

#: A segment of one contact: its number, and the pushes there.
ContactSegment = tuple[int, list[TimedTwist]]

#: Turning radii that connections try, in units of the tightest: slower to turn, but the outline swings out less.
RADII = (1.0, 2.0, 4.0, 8.0)
#: Parts of all headings in which the turns of connections are tested, and how near (rad) to the goal's heading a contact's turns
#: are to be stable, the widest first, where loads depend on the heading.
HEADING_PARTS, NEAR_GOAL = 72, (math.radians(30.0), math.radians(10.0))
#: Lattice each way about the goal for which the time without obstacles is known.
TABLE_REACH = 20
#: Poses spread along a path between which the path is shortened, in the rounds of shortening.
PIECES = (24, 40, 60)
#: Halves are rounded up, also those that are less by rounding.
_UP = 0.5 + 1e-9
#: Poses within the tolerance that connections lead to: how far apart their headings (rad) are, that of the coarsest lattice, and
#: how far from the goal their places (radii of the slider), a cell of it and more.
END_TURN, END_RINGS = math.pi / 8, (0.25, 0.5, 1.0, 2.0)
#: A tolerance (rad) of half a turn is one of all headings: 3.1416 and 3.14159 of a file, too.
_ALL_ROUND = 1e-4


class PlanningContext:
    """A planning problem made ready for search.

    Raises :class:`OutOfTimeError` once ``deadline`` has passed.

    Attributes
    ----------
    infeasible_reason : str
        Why there can be no plan, as far as that is plain before any search; empty if it is not.
    bound : float
        Time in s that every plan takes.
    """

    def __init__(self, problem: PlanningProblem, options: PlanOptions, deadline: Deadline) -> None:
        if len(problem.contacts) > MOST_CONTACTS:
            raise InputError("contacts", f"expected at most {MOST_CONTACTS}", len(problem.contacts))
        deadline.check()
        self.problem, self.deadline, self._rate = problem, deadline, options.max_twist_rate
        self.infeasible_reason, self.bound = "", 0.0
        self.world = world_of(problem)
        self.bodies = [SweptBody(problem, contact, self.world) for contact in problem.contacts]
        self.field = DistanceField(problem)
        self.routes: Routes | None = None
        if len(problem.contacts) > 1:
            self.routes = routes_of(problem, deadline)
        self.stable: dict[int, StableSet] = {}
        refused: UnsupportedContactError | None = None
        for i in range(len(problem.contacts)):
            deadline.check()
            if options.regions and options.regions[i] is None:
                continue
            try:
                self.stable[i] = StableSet(problem, i, options, deadline)
            except UnsupportedContactError as error:
                # the region does not cover this contact; others may do
                refused = error
        if refused is not None and not self.stable:
            raise refused
        self.steerings: dict[int, Steering] = {}
        for i, stable in self.stable.items():
            deadline.check()
            for headings in self._steered(stable):
                found = steering(problem, stable, headings)
                if found is not None:
                    self.steerings[i] = found
                    break
        #: contacts that are to align the slider when the pusher docks there, and a push that does, if any
        self.aligning: dict[int, Push | None] = {}
        if any(problem.uncertainty.start) and len(problem.contacts) > 1:
            self.aligning = {i: alignment_push(problem, i) for i in self.stable if aligns(problem.contacts[i])}
        self._docked = _bodies([body.body for body in self.bodies])
        self.goal, self.connections, self.transfers = self._goal(), self._connections(), self._transfers()
        x, y, theta = problem.start
        self.bound = float(least_time(self.goal, x, y, math.cos(theta), math.sin(theta)))
        if math.isinf(self.bound):
            self.infeasible_reason, self.bound = "obstacles enclose the goal", 0.0

    def graph(self, lattice: Lattice, transfers: Transfers, tolerance: tuple[float, float]) -> Graph:
        """Return what a search on a lattice runs on; ``transfers``: the changes of contact that it may make; ``tolerance``
        (m, rad): of the goal."""
        self.deadline.check()
        problem, contacts = self.problem, len(self.problem.contacts)
        theta = float(problem.start[2])
        turn = np.array(((math.cos(theta), math.sin(theta)), (-math.sin(theta), math.cos(theta))))
        there = np.floor(turn @ (problem.goal[:2] - problem.start[:2]) / lattice.cell + _UP).astype(np.int64)
        heading = math.floor((float(problem.goal[2]) - theta) / (2 * math.pi) * lattice.headings + _UP) % lattice.headings
        change = round(problem.switch_cost / lattice.tick) * lattice.tick
        size = 2 * TABLE_REACH + 1
        table = np.zeros((contacts, lattice.headings, size, size))
        ends = self._lattice_ends(lattice, there, heading, tolerance)
        unobstructed_times(lattice.first, lattice.steps, lattice.costs, lattice.headings, contacts, change, ends, size, table)
        goal = self.goal._replace(
            table=table, at=there, tolerance=np.array(tolerance), ends=goal_ends(problem.goal, tolerance, problem.slider.radius)
        )
        return Graph(lattice, self._docked, goal, self.connections, transfers._replace(cost=change))

    def _lattice_ends(self, lattice: Lattice, there: np.ndarray, heading: int, tolerance: tuple[float, float]) -> np.ndarray:
        """Lattice poses (n, 3) within a tolerance: heading, and cells from the pose next to the goal, which is always one."""
        goal, (near, turned) = self.problem.goal, tolerance
        reach = np.arange(-TABLE_REACH, TABLE_REACH + 1)
        k, i, j = (a.ravel() for a in np.meshgrid(np.arange(lattice.headings), reach, reach, indexing="ij"))
        x, y, theta = lattice.origin
        u, v = (there[0] + i) * lattice.cell, (there[1] + j) * lattice.cell
        away = np.hypot(
            x + math.cos(theta) * u - math.sin(theta) * v - goal[0], y + math.sin(theta) * u + math.cos(theta) * v - goal[1]
        )
        off = np.abs(wrap_angle(theta + 2 * math.pi / lattice.headings * k - goal[2]))
        within = ((away <= near) & (off <= turned)) | ((k == heading) & (i == 0) & (j == 0))
        return np.column_stack((k, i, j))[within]

    def _steered(self, stable: StableSet) -> list[tuple[float, float]]:
        """Headings, from and by how much, at which a contact's turns are to be stable: all, or ever fewer about the goal's."""
        if stable.loads is None:
            return [(0.0, 2 * math.pi)]
        return [(float(self.problem.goal[2]) - near, 2 * near) for near in NEAR_GOAL]

    def _goal(self) -> Goal:
        problem = self.problem
        return Goal(
            pose=np.array(problem.goal),
            ends=goal_ends(problem.goal, problem.tolerance, problem.slider.radius),
            tolerance=np.array(problem.tolerance),
            outline=np.array(problem.slider.vertices),
            speed=problem.speed,
            field=self.field.times,
            low=np.array(self.field.low),
            cell=self.field.cell,
            table=np.zeros((len(problem.contacts), 1, 1, 1)),
            at=np.zeros(2, dtype=np.int64),
        )

    def _connections(self) -> Connections:
        problem, contacts = self.problem, len(self.problem.contacts)
        frames, radii = np.zeros((contacts, 3)), np.zeros((contacts, len(RADII)))
        paces, prices = np.zeros((contacts, len(RADII), 3)), np.zeros((contacts, len(RADII), 3))
        effects = any(stable.loads is not None for stable in self.stable.values())
        allowed = np.ones((contacts, len(RADII), 3, HEADING_PARTS if effects else 1), dtype=bool)
        for i, steer in self.steerings.items():
            frames[i] = steer.frame
            turns = np.array([[steer.twist(k / (m * steer.radius)) for k in (1.0, 0.0, -1.0)] for m in RADII])
            known = stable_parts(self.stable[i], turns.reshape(-1, 3)).reshape(len(RADII), 3, -1)
            good = np.asarray(known.any(axis=2)).all(axis=1)
            allowed[i, : good.sum()] = known[good]
            radii[i, : good.sum()] = steer.radius * np.array(RADII)[good]
            paces[i, : good.sum()] = problem.push_speed(turns[good]) / problem.speed
            prices[i, : good.sum()] = self.stable[i].costs(turns[good].reshape(-1, 3)).reshape(-1, 3)
        return Connections(frames, radii, paces, prices, allowed)

    def _transfers(self) -> Transfers:
        problem, contacts, routes = self.problem, len(self.problem.contacts), self.routes
        return Transfers(
            cost=problem.switch_cost,
            kind=KNOWN_PATHS,
            pushers=_bodies([body_of(pusher_shapes(problem, contact)) for contact in problem.contacts]),
            radius=0.0 if routes is None else routes.radius,
            docks=np.zeros((contacts, 3)) if routes is None else routes.docks,
            retreats=np.full(contacts, -1.0) if routes is None else routes.retreats,
            first=np.zeros(2 * contacts**2 + 1, dtype=np.int64) if routes is None else routes.first,
            routes=np.zeros((0, 2)) if routes is None else routes.points,
        )

    def connect(self, contact: int, start: FloatArray, end: FloatArray, most: float = math.inf) -> list[TimedTwist] | None:
        """Return the pushes of the cheapest free Dubins path between two poses that costs less than ``most`` (s), if any."""
        lengths, pieces = np.empty((6, 3)), np.empty((3, 4))
        cost = connect(self.connections, self.world, self.bodies[contact].body, contact, *start, *end, most, lengths, pieces)
        if cost >= most:
            return None
        return [(pieces[k, :3].copy(), float(pieces[k, 3])) for k in range(3) if pieces[k, 3] * self.problem.speed > LEAST_TRAVEL]

    def connect_to_goal(self, contact: int, start: FloatArray, most: float = math.inf) -> list[TimedTwist] | None:
        """Return the pushes of the cheapest free connection to one of the goal's ends, of less than ``most`` (s), if any."""
        found: list[TimedTwist] | None = None
        for end in self.goal.ends:
            pushes = self.connect(contact, start, end, most)
            if pushes is not None:
                found, most = pushes, self._price(contact, pushes)
        return found

    def shortened(self, contact_segments: Sequence[ContactSegment]) -> list[ContactSegment]:
        """Return a path with the same changes of contact, at the same poses, that costs no more."""
        pose = np.array(self.problem.start)
        result: list[ContactSegment] = []
        for number, (contact, pushes) in enumerate(contact_segments):
            fixed = self._fixed(number, contact)
            begin, best = end_of(pose, pushes[:fixed]), pushes[fixed:]
            for pieces in PIECES if best else ():
                body, stable = self.bodies[contact], self.stable[contact]
                best = shorten(self.problem, self.connections, self.world, body, stable, begin, best, pieces, self.deadline)
                best = merged(best, self.problem.slider.radius)
            result.append((contact, merged(pushes[:fixed] + best, self.problem.slider.radius)))
            pose = end_of(pose, pushes)
        return result

    def _fixed(self, number: int, contact: int) -> int:
        """How many pushes of a contact's segment stay as they are: the one that aligns the slider after the pusher docked."""
        return int(contact in self.aligning and (number > 0 or contact != 0))

    def result(self, contact_segments: Sequence[ContactSegment], planner: str, seed: int, words: str) -> PlanResult:
        """Return a path as the plan that is asked for."""
        parts, left = self.blended(contact_segments)
        segments = self.segments(parts)
        # the best path may be shorter than the bound by rounding
        bound = min(self.bound, sum(s.duration for s in segments))
        message = "; ".join(filter(None, (words, f"{left} corners not blended" if left else "")))
        return PlanResult.from_segments(segments, planner=planner, seed=seed, lower_bound=bound, message=message)

    def blended(self, contact_segments: Sequence[ContactSegment]) -> tuple[list[ContactSegment], int]:
        """Return a path whose corners are blended as asked, and how many are left."""
        if math.isinf(self._rate):
            return list(contact_segments), 0
        pose, corners = np.array(self.problem.start), 0
        result: list[ContactSegment] = []
        for contact, pushes in contact_segments:
            fixed = self._fixed(len(result), contact)
            begin, free, left = end_of(pose, pushes[:fixed]), pushes[fixed:], 0
            if free:
                free, left = blended(self.problem, self.stable[contact], self.bodies[contact], begin, free, self._rate)
            result.append((contact, pushes[:fixed] + free))
            corners += left + int(fixed > 0 and len(free) > 0)
            pose = end_of(pose, pushes)
        return result, corners

    def segments(self, contact_segments: Sequence[ContactSegment]) -> list[Push | Transfer]:
        """Return the pushes of a path, with the changes of contact between its segments."""
        segments: list[Push | Transfer] = []
        pose, contact = self.problem.start, 0
        for at, pushes in contact_segments:
            if at != contact:
                path = self.transfer_path(contact, at, pose)
                if path is None:
                    raise ConvergenceError("change of contact: the pusher's path that the search found is not free by rounding")
                segments.append(Transfer(contact, at, path, self.problem.switch_cost))
                contact = at
            for twist, duration in pushes:
                push = Push.from_start(contact, twist, duration, pose, 0.0)
                push = replace(push, margin=self.stable[contact].margin(push))
                segments.append(push)
                pose = push.end
        return segments

    def cost(self, contact_segments: Sequence[ContactSegment]) -> float:
        """Return what a path costs, in s."""
        pushes = sum(self._price(contact, part) for contact, part in contact_segments)
        transfers = sum(a[0] != b[0] for a, b in pairwise(((0, ()), *contact_segments)))
        return pushes + transfers * self.problem.switch_cost

    def _price(self, contact: int, pushes: Sequence[TimedTwist]) -> float:
        """What pushes of one contact cost, in s."""
        travels = np.reshape([twist * duration for twist, duration in pushes], (-1, 3))
        return float(self.stable[contact].costs(travels).sum())

    def transfer_path(self, source: int, target: int, pose: FloatArray) -> FloatArray | None:
        """Return poses (n, 3) of the pusher's frame in W from one contact to another of a slider at ``pose``, or None.

        Close round the slider where that is free, else any path among the obstacles.
        """
        assert self.routes is not None
        at = (pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2]))
        route = int(route_between(self.transfers, self._docked, self.world, source, target, *at))
        if route >= 0:
            return route_path(self.routes, route, pose)
        known = self.transfers._replace(kind=ANY_PATH)
        if route_between(known, self._docked, self.world, source, target, *at) < 0:
            return None
        docks = [compose(pose, self.routes.docks[k]) for k in (source, target)]
        retreats = [float(self.routes.retreats[k]) for k in (source, target)]
        ends = [backed_off(dock, route)[:2] for dock, route in zip(docks, retreats, strict=True)]
        points = path_among_obstacles(self.problem, pose, ends[0], ends[1], self.routes.radius)
        return None if points is None else docking_path((docks[0], docks[1]), points)


def goal_ends(goal: FloatArray, tolerance: tuple[float, float], radius: float) -> FloatArray:
    """Return poses (n, 3) well within a tolerance (m, rad) of a goal, itself first, for a slider of a radius (m).

    They are of a grid that does not depend on the tolerance: a larger one has those of a smaller one.
    """
    # executions end a little beside: headings and places half as far off as they may be leave room for that
    near = tolerance[0] / 2
    turned = math.pi if tolerance[1] >= math.pi - _ALL_ROUND else tolerance[1] / 2
    count = min(int(turned / END_TURN), round(math.pi / END_TURN) - 1)
    turns = np.concatenate(([0], *((k, -k) for k in range(1, count + 1)), [count + 1] if turned == math.pi else []))
    angles = np.arange(8) * math.pi / 4
    around = np.column_stack((np.cos(angles), np.sin(angles)))
    places = np.concatenate([np.zeros((1, 2)), *(ring * radius * around for ring in END_RINGS if ring * radius <= near)])
    return np.array([(*(goal[:2] + place), goal[2] + turn) for place in places for turn in turns * END_TURN])


def smaller_tolerances(tolerance: tuple[float, float], radius: float) -> list[tuple[float, float]]:
    """Return smaller tolerances (m, rad) than one, whose values do not depend on it, for a slider of a radius (m).

    A search within a smaller tolerance finds another path, at times a shorter one. Without these searches a larger tolerance
    would at times make a plan longer. Below half a step of the coarsest lattice a tolerance makes no difference.
    """
    near, turned = tolerance
    headings = [share * END_TURN for share in (4.0, 2.0, 1.0, 0.5)]
    places = [ring * radius for ring in (*reversed(END_RINGS), END_RINGS[0] / 2)]
    return [(near, less) for less in headings if less < turned] + [(less, turned) for less in places if less < near]


def stable_parts(stable: StableSet, twists: FloatArray) -> BoolArray:
    """Return in which equal parts of all headings body twists (n, 3) are stable (n, parts); one part where none matters."""
    parts = 1 if stable.loads is None else HEADING_PARTS
    begins = 2 * math.pi / parts * np.arange(parts)
    headings = np.column_stack((begins, np.full(parts, 2 * math.pi / parts)))
    many = stable.accepts(np.repeat(twists, parts, axis=0), np.tile(headings, (len(twists), 1)))
    return many.reshape(len(twists), parts)


def _bodies(bodies: Sequence[Body]) -> Bodies:
    return Bodies(
        edge_first=np.cumsum([0] + [len(b.edges) for b in bodies]),
        edges=np.concatenate([b.edges for b in bodies]),
        corner_first=np.cumsum([0] + [len(b.corners) for b in bodies]),
        corners=np.concatenate([b.corners for b in bodies]),
        radii=np.array([b.radius for b in bodies]),
    )


def end_of(pose: FloatArray, pushes: Sequence[TimedTwist]) -> FloatArray:
    """Return the pose that pushes lead to."""
    for twist, duration in pushes:
        pose = compose(pose, exp(twist * duration))
    return pose
