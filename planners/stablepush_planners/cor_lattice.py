"""Anytime A* on a lattice of poses whose edges are single stable pushes (:mod:`stablepush_planners.lattice`).

A ladder of lattices, from coarse to fine, is searched until one holds a path; every expanded pose is also joined to the goal by a
Dubins path of the contact's reference point. Then the path is shortened, and searches with smaller weights, on this lattice
and on finer ones, look for better ones. Only when the finest lattice is exhausted the answer is ``no-path``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stablepush.core import ConvergenceError, Deadline, OutOfTimeError
from stablepush.geometry import compose
from stablepush.planning import PlanningProblem, PlanOptions, PlanResult
from stablepush_planners import _search
from stablepush_planners._search import Graph, Tree
from stablepush_planners._transfer import ANY_PATH, Transfers
from stablepush_planners.context import ContactSegment, PlanningContext, end_of, smaller_tolerances
from stablepush_planners.lattice import Lattice, make_lattice

NAME = "cor-lattice"

#: The ladder of resolutions: number of headings, and width of a cell in radii of the slider.
LADDER = ((16, 0.25), (24, 0.125), (32, 0.0625))
#: Weights of the guess: the first search is greedy, the others look for better paths.
WEIGHTS = (3.0, 1.5, 1.0)
#: A lattice path is of use if it costs less than this, in times of the best plan: shortening may make it the better one.
WORTH = 1.05
#: A plan is better than another if it costs less by this share: two searches that find the same path differ by rounding.
_GAIN = 1e-9
#: Nodes expanded between looks at the clock.
_QUOTA = 500
#: Nodes that the first tree has room for.
_FIRST_SIZE = 1 << 14


def plan_cor_lattice(
    problem: PlanningProblem,
    *,
    deadline: Deadline,
    seed: int = 0,
    options: PlanOptions,
    progress: Callable[[str], None] | None = None,
) -> PlanResult:
    """Plan with the COR lattice; see :func:`stablepush.plan`."""
    try:
        context = PlanningContext(problem, options, deadline)
    except OutOfTimeError:
        return PlanResult("timeout", NAME, seed=seed, message="the time limit left no time to search")
    planner = _Planner(context, options.search_budget, progress or (lambda _: None))
    status, message = "no-path", context.infeasible_reason
    if not message:
        try:
            message = planner.run(options.refinement_budget * len(problem.contacts))
        except OutOfTimeError:
            status, message = "timeout", "the time limit passed before a path was found"
            if not deadline.passed():
                message = f"no path was found in {options.search_budget:g} search steps"
    if planner.best is None:
        return PlanResult(status, NAME, lower_bound=context.bound, seed=seed, message=message)
    return context.result(planner.best, NAME, seed, planner.found_by)


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Cost and path that a search found, if any, and how many poses it expanded."""

    cost: float
    contact_segments: list[ContactSegment] | None
    expanded: int


class _Planner:
    """The ladder of searches, and the best plan so far."""

    def __init__(self, context: PlanningContext, search_budget: float, progress: Callable[[str], None]) -> None:
        self._context, self._search_budget, self._progress = context, search_budget, progress
        self.best: list[ContactSegment] | None = None
        self.cost, self.found_by = math.inf, ""
        self._lattices: dict[int, Lattice] = {}

    def run(self, refinement_budget: float) -> str:
        """Climb the ladder; once there is a plan, look for better ones: at most ``refinement_budget`` poses are expanded within
        the tolerance of the goal, and within each smaller one.

        Returns why there is no plan, if there is none.
        """
        context, tolerance = self._context, self._context.problem.tolerance
        useful = self._climb(refinement_budget, context.transfers, tolerance)
        for within in (
            smaller_tolerances(tolerance, context.problem.slider.radius)
            if self.best is not None and refinement_budget > 0
            else ()
        ):
            self._climb(refinement_budget, context.transfers, within)
        if self.best is None and context.routes is not None and self._search_budget > 0:
            # the pusher may still reach another contact on a path that does not hug the slider
            self._progress("any path of the pusher round the slider")
            self._climb(refinement_budget, context.transfers._replace(kind=ANY_PATH), tolerance)
        if self._search_budget <= 0:
            raise OutOfTimeError("search: the budget is spent")
        if not useful:
            return "no contact has a stable push"
        cell = 1000 * LADDER[-1][1] * context.problem.slider.radius
        words = f"the lattice is exhausted down to cells of {cell:.2g} mm (a narrower gap may have been missed)"
        if not context.steerings or context.problem.acting_effects:
            # under effects of the table turns depend on the heading
            return words
        contact, steering = min(context.steerings.items(), key=lambda item: item[1].radius)
        radius = f"{1000 * steering.radius:.3g} mm or more, measured midway between its tightest CORs to the left and right"
        return f"{words}; contact {contact} turns to either side with a radius of {radius}"

    def _climb(self, refinement_budget: float, transfers: Transfers, tolerance: tuple[float, float]) -> bool:
        """Search from the coarsest lattice to the finest, within a tolerance; return whether any of them has an edge."""
        context, useful = self._context, False
        for rung, (headings, share) in enumerate(LADDER):
            self._progress(f"lattice {rung + 1} of {len(LADDER)}: {headings} headings")
            cell = share * context.problem.slider.radius
            if rung not in self._lattices:
                self._lattices[rung] = make_lattice(context.problem, context.stable, headings, cell, context.aligning)
            useful = useful or len(self._lattices[rung].durations) > 0
            graph = context.graph(self._lattices[rung], transfers, tolerance)
            limit = math.inf
            # what a lattice leaves the finer ones have: none keeps them from their turn
            spare = refinement_budget - refinement_budget / (len(LADDER) - rung) if math.isfinite(refinement_budget) else 0.0
            for weight in WEIGHTS:
                words = f"{headings} headings, cells of {1000 * cell:.3g} mm, weight {weight:g}"
                improving = self.best is not None
                most = refinement_budget - spare if improving else self._search_budget
                found = self._search(graph, weight, min(limit, WORTH * self.cost), most, words)
                if found.contact_segments is not None:
                    limit = found.cost
                    self._take(context.shortened(found.contact_segments), words)
                if improving:
                    refinement_budget -= found.expanded
                else:
                    self._search_budget -= found.expanded
                if (refinement_budget if self.best is not None else self._search_budget) <= 0:
                    return useful
                if self.best is None or (improving and refinement_budget <= spare):
                    break
        return useful

    def _search(self, graph: Graph, weight: float, limit: float, most: float, words: str) -> _Found:
        """Search once for a path that costs less than ``limit``, over at most ``most`` poses."""
        context, denied = self._context, np.zeros((0, 2), dtype=np.int64)
        tree, spent = self._planted(graph, weight, limit), 0
        while True:
            looked = max(1, _QUOTA // (len(context.problem.contacts) * len(graph.goal.ends)))
            quota = math.ceil(min(looked, most - spent - int(tree.counts[2])))
            why = _search.expand(graph, context.world, tree, weight, limit, quota, denied)
            expanded = spent + int(tree.counts[2])
            if why == _search.FULL:
                tree = _larger(tree)
            elif why == _search.DONE:
                node = int(tree.counts[3])
                impossible = self._impossible_change(graph, tree, node)
                if impossible is None:
                    return _Found(float(tree.cost[node]), self._path(graph, tree, node), expanded)
                denied = np.concatenate((denied, (impossible,)))
                tree, spent = self._planted(graph, weight, limit), expanded
            elif why == _search.EXHAUSTED or expanded >= most:
                return _Found(math.inf, None, expanded)
            self._progress(f"{words}: {expanded} poses expanded, {tree.counts[1]} queued")
            if context.deadline.passed():
                raise OutOfTimeError("search: the deadline has passed")

    def _planted(self, graph: Graph, weight: float, limit: float) -> Tree:
        """Return a tree with nothing but the start."""
        tree = _empty_tree(_FIRST_SIZE)
        key = _search.key_of(0, 0, 0, 0)
        _search.reach(graph.lattice, graph.goal, tree, key, 0.0, -1, _search.START, weight, limit)
        return tree

    def _impossible_change(self, graph: Graph, tree: Tree, node: int) -> tuple[int, int] | None:
        """Return key and former contact of a change that the pusher has no path for, on the path of a node, or None."""
        while graph.transfers.kind == ANY_PATH and node >= 0:
            if tree.via[node] == _search.TRANSFER:
                target = int(_search.parts_of(tree.key[node])[0])
                source, heading, i, j = (int(part) for part in _search.parts_of(tree.key[tree.parent[node]]))
                turn = 2 * math.pi / graph.lattice.headings
                pose = compose(self._context.problem.start, (i * graph.lattice.cell, j * graph.lattice.cell, heading * turn))
                if self._context.transfer_path(source, target, pose) is None:
                    return int(tree.key[node]), source
            node = int(tree.parent[node])
        return None

    def _path(self, graph: Graph, tree: Tree, node: int) -> list[ContactSegment]:
        """Turn a chain of nodes into segments of one contact each."""
        chain = []
        while node >= 0:
            chain.append(node)
            node = int(tree.parent[node])
        chain.reverse()
        contact_segments: list[ContactSegment] = [(int(_search.parts_of(tree.key[chain[0]])[0]), [])]
        pose = np.array(self._context.problem.start)
        for parent, child in pairwise(chain):
            via = int(tree.via[child])
            contact = int(_search.parts_of(tree.key[child])[0])
            if via == _search.TRANSFER:
                row = contact * graph.lattice.headings + int(_search.parts_of(tree.key[child])[1])
                aligning, duration = graph.lattice.alignments, float(graph.lattice.alignments.durations[row])
                pushes = [(aligning.twists[row].copy(), duration)] if duration > 0 else []
                contact_segments.append((contact, []))
            elif via >= 0:
                pushes = [(graph.lattice.twists[via].copy(), float(graph.lattice.durations[via]))]
            else:
                most = 2 * graph.lattice.tick + float(tree.cost[child] - tree.cost[parent]) * (1 + 1e-6)
                connection = self._context.connect_to_goal(contact, pose, most)
                if connection is None:
                    raise ConvergenceError("connection to the goal: the path that the search found is not free by rounding")
                pushes = connection
            contact_segments[-1][1].extend(pushes)
            pose = end_of(pose, pushes)
        return [s for s in contact_segments if s[1]]

    def _take(self, contact_segments: list[ContactSegment], words: str) -> None:
        """Keep a path if it is the best so far."""
        cost = self._context.cost(contact_segments)
        if cost < self.cost * (1 - _GAIN):
            self.best, self.cost = contact_segments, cost
            self._context.deadline.path_found()
            ratio = f", cost {cost / self._context.bound:.3g} times the lower bound" if self._context.bound > 1e-3 else ""
            self.found_by = f"{words}{ratio}"


def _empty_tree(size: int) -> Tree:
    return Tree(
        key=np.zeros(size, dtype=np.int64),
        cost=np.zeros(size),
        least=np.zeros(size),
        guess=np.zeros(size),
        parent=np.zeros(size, dtype=np.int32),
        via=np.zeros(size, dtype=np.int32),
        closed=np.zeros(size, dtype=np.bool_),
        table=np.full(4 * size, -1, dtype=np.int32),
        queue=np.zeros(4 * size),
        queued=np.zeros(4 * size, dtype=np.int64),
        counts=np.array((0, 0, 0, -1), dtype=np.int64),
    )


def _larger(tree: Tree) -> Tree:
    """Twice the room, with everything in it."""
    grown = _empty_tree(2 * len(tree.key))
    for name in ("key", "cost", "least", "guess", "parent", "via", "closed", "queue", "queued", "counts"):
        old, new = getattr(tree, name), getattr(grown, name)
        new[: len(old)] = old
    _search.refill(grown)
    return grown
