import heapq
import math
import time

import numpy as np
import pytest
import shapely
from conftest import small_scene, triangle, two_edges
from stablepush_planners import contact_graph
from stablepush_planners._goal import at_goal
from stablepush_planners._transfer import route_between
from stablepush_planners.context import PlanningContext
from stablepush_planners.cor_lattice import _Planner
from stablepush_planners.lattice import make_lattice
from stablepush_planners.stable_set import StableSet
from stablepush_planners.transfers import _widened

import stablepush as sp
from stablepush.core.deadline import Deadline
from stablepush.geometry.planar import normalize_twist, unit
from stablepush.geometry.se2 import compose, exp, wrap_angle
from stablepush.planning.collision import SweptBody
from stablepush.planning.trajectory import PASSES


@pytest.mark.parametrize("headings", (8, 16, 24))
def test_every_edge_is_a_stable_push_that_ends_on_the_lattice(headings):
    problem = small_scene()
    cell = 0.03
    edges = make_lattice(problem, {0: StableSet(problem, 0)}, headings, cell)
    oracle = sp.StabilityOracle(problem.surface, problem.contacts[0])
    assert (oracle.margin(edges.twists) >= problem.min_margin).all()
    np.testing.assert_allclose(problem.push_speed(edges.twists), problem.speed)
    for k in range(headings):
        assert edges.first[k + 1] > edges.first[k]
        for e in range(edges.first[k], edges.first[k + 1]):
            end = compose((0, 0, k * 2 * np.pi / headings), exp(edges.twists[e] * edges.durations[e]))
            np.testing.assert_allclose(end[:2], edges.steps[e, :2] * cell, atol=1e-12)
            assert abs(float(wrap_angle(end[2] - (k + edges.steps[e, 2]) * 2 * np.pi / headings))) < 1e-12
    # both turns and straight pushes are there
    assert {-1, 0, 1} <= set(np.sign(edges.steps[:, 2]))


def test_edges_left_out_are_made_up_by_others():
    """Whatever single push is stable, edges lead to its end for at most a little more."""
    problem = small_scene()
    headings, cell = 16, 0.03
    stable = StableSet(problem, 0)
    edges = make_lattice(problem, {0: stable}, headings, cell)
    best = {(0, 0, 0): 0.0}
    queue = [(0.0, (0, 0, 0))]
    while queue:
        cost, (i, j, k) = heapq.heappop(queue)
        if cost > best[i, j, k]:
            continue
        for e in range(edges.first[k], edges.first[k + 1]):
            to = (i + int(edges.steps[e, 0]), j + int(edges.steps[e, 1]), (k + int(edges.steps[e, 2])) % headings)
            total = cost + float(edges.costs[e])
            if max(abs(to[0]), abs(to[1])) <= 9 and total < best.get(to, math.inf):
                best[to] = total
                heapq.heappush(queue, (total, to))
    from stablepush.geometry.se2 import log

    steps = np.array([(i, j, m) for i in range(-9, 10) for j in range(-9, 10) for m in range(-4, 5) if i or j])
    twists = log(np.column_stack((steps[:, :2] * cell, steps[:, 2] * 2 * np.pi / headings)))
    good = stable.accepts(twists)
    assert good.sum() > 100
    for (i, j, m), cost in zip(steps[good], stable.costs(twists[good]), strict=True):
        # parts may have been made up themselves: the slack compounds
        assert best[i, j, m % headings] <= 1.1 * cost


@pytest.mark.parametrize("seed", range(4))
def test_search_against_dijkstra(seed):
    """With weight one and no connections, the cost is that of a plain Dijkstra over the same lattice."""
    rng = np.random.default_rng(seed)
    obstacles = [rng.uniform(0.35, 0.55, 2) + 0.04 * np.array(((-1, -1), (1, -1), (0, 1))) for _ in range(2)]
    problem = small_scene(obstacles=obstacles, goal=(0.75, 0.6, 0.3), tolerance=(0.05, 0.5), bounds=(0, 0, 1, 0.9))
    context = PlanningContext(problem, sp.PlanOptions(), Deadline())
    headings, cell = 8, 0.06
    edges = make_lattice(problem, context.stable, headings, cell)
    graph = context.graph(edges, context.transfers, problem.tolerance)
    graph.connections.radii[:] = 0.0
    # what the edges take to the middle of the goal region is no lower bound
    graph.goal.table[:] = 0.0
    found = _Planner(context, math.inf, lambda _: None)._search(graph, 1.0, math.inf, math.inf, "")
    assert found.contact_segments is not None
    assert sum(d for _, pushes in found.contact_segments for _, d in pushes) == pytest.approx(found.cost)

    body, e0 = SweptBody(problem, problem.contacts[0]), edges
    best, queue, done = {(0, 0, 0): 0.0}, [(0.0, (0, 0, 0))], None
    while queue and done is None:
        cost, (i, j, k) = heapq.heappop(queue)
        if cost > best[i, j, k]:
            continue
        pose = compose(problem.start, (i * cell, j * cell, k * 2 * np.pi / headings))
        if at_goal(context.goal, *pose):
            done = cost
        rows = slice(e0.first[k], e0.first[k + 1])
        free = body.pushes_are_free(pose, e0.twists[rows], e0.durations[rows])
        for step, extra in zip(e0.steps[rows][free], e0.costs[rows][free], strict=True):
            to = (i + int(step[0]), j + int(step[1]), (k + int(step[2])) % headings)
            if cost + extra < best.get(to, math.inf) - 1e-12:
                best[to] = cost + float(extra)
                heapq.heappush(queue, (best[to], to))
    assert found.cost == pytest.approx(done)


def test_more_search_makes_plans_no_worse():
    problem = small_scene()
    plans = [sp.plan(problem, time_limit=60, success=0, refinement_budget=effort) for effort in (0, 2_000, 40_000)]
    assert all(sp.check_plan(problem, plan).valid for plan in plans)
    durations = [plan.duration for plan in plans]
    assert durations == sorted(durations, reverse=True)
    assert plans[0].lower_bound == plans[2].lower_bound < durations[2]


def test_margins_cost_time():
    scene = small_scene()
    loads = scene.surface.wrench(np.random.default_rng(0).normal(size=(12, 3)) * (1, 1, 20))
    surface = sp.fit_limit_surface(loads, scene.surface.twist(loads), slider=triangle(), seed=0).surface
    problem = small_scene(surface=surface, min_margin=0.0)
    plain, careful = (sp.plan(problem, time_limit=60, success=0, **asked) for asked in ({}, {"margin_weight": 3.0}))
    for plan in (plain, careful):
        assert sp.check_plan(problem, plan).valid

    def weighed(plan):
        return sum(p.margin * p.duration for p in plan.pushes) / sum(p.duration for p in plan.pushes)

    assert weighed(careful) > weighed(plain)
    assert careful.duration > plain.duration


def test_the_pusher_goes_round_the_slider_to_another_edge():
    """In a corridor too low to turn in, with a pusher that takes room."""
    problem = two_edges()
    result = sp.plan(problem, time_limit=60)
    assert result.status == "solved"
    assert result.switches >= 1
    report = sp.check_plan(problem, result)
    assert report.valid, report.objections
    transfer = next(s for s in result.segments if isinstance(s, sp.Transfer))
    assert len(transfer.pusher_path) > 3


def test_no_room_for_the_pusher_means_no_change():
    # the ceiling is so low that the pusher cannot pass the slider, and it starts below
    problem = two_edges(bounds=(0.02, 0.105, 1.4, 0.32), start=(0.15, 0.2, 0.0))
    result = sp.plan(problem, time_limit=60)
    assert result.status == "no-path"


def test_the_pusher_takes_a_wider_way_where_posts_stand_close():
    """Posts beside the slider block the ways that hug it, not those round the posts."""
    post = 0.01 * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)))
    start = np.array((0.4, 0.5, 0.0))
    posts = [
        start[:2] + at + post for at in ((0.15, 0.03), (0.04, 0.15), (-0.03, 0.16), (-0.115, 0.09), (-0.09, -0.1), (0.14, -0.08))
    ]
    problem = two_edges(bounds=(0, 0, 1.5, 1.2), start=start, goal=(1.2, 0.5, 0.0), obstacles=posts)
    context = PlanningContext(problem, sp.PlanOptions(), Deadline())
    assert route_between(context.transfers, context._docked, context.world, 0, 1, *start[:2], 1.0, 0.0) < 0
    path = context.transfer_path(0, 1, start)
    assert path is not None
    push = sp.Push.from_start(1, (0.05, 0.0, 0.0), 1.0, start, float(context.stable[1].oracle.margin((0.05, 0.0, 0.0))))
    first = sp.Transfer(0, 1, path, problem.switch_cost)
    objections = sp.check_plan(problem, sp.PlanResult.from_segments([first, push], planner="hand")).objections
    assert [o for o in objections if "goal" not in o] == []


def test_the_contact_graph_holds_paths_round_the_slider():
    problem = two_edges()
    graph = contact_graph(problem)
    assert sorted(graph.edges) == [(0, 1), (1, 0)]
    assert graph.edges[0, 1]["length"] == pytest.approx(graph.edges[1, 0]["length"])
    path = compose((0.5, 0.5, 0.3), graph.edges[0, 1]["path"])
    for end, contact in ((0, 0), (-1, 1)):
        np.testing.assert_allclose(path[end, :2], compose((0.5, 0.5, 0.3), problem.contacts[contact].frame)[:2])
    # fingers that are points go round, too
    assert contact_graph(two_edges(pusher=None)).edges[0, 1]["length"] > 0.05


@pytest.mark.parametrize("corners", (3, 5, 7, 11, 12, 30))
def test_widened_outlines_keep_their_distance(corners):
    rng = np.random.default_rng(corners)
    angles = 2 * np.pi * np.arange(corners) / corners
    for radius in (0.01, 0.05, 0.3):
        outline = 0.1 * np.column_stack((np.cos(angles), np.sin(angles))) + rng.normal(size=(corners, 2)) * 0.005
        shape = shapely.Polygon(outline)
        assert shapely.distance(shapely.boundary(_widened(shape, radius)), shape) >= radius


def test_a_way_among_very_many_obstacles_is_looked_for_nearby():
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 6, size=(600, 2))
    places = places[np.linalg.norm(places - (3, 3), axis=1) > 0.25]
    obstacles = [place + 0.02 * np.array(((-1, -1), (1, -1), (0, 1))) for place in places]
    problem = two_edges(bounds=(0, 0, 6, 6), start=(3, 3, 0), goal=(5, 3, 0), obstacles=obstacles)
    context = PlanningContext(problem, sp.PlanOptions(), Deadline())
    started = time.perf_counter()
    context.transfer_path(0, 1, np.array((3.0, 3.0, 0.0)))
    # no bound on speed: without the neighbourhood this takes minutes and gigabytes
    assert time.perf_counter() - started < 60


def test_an_effort_that_is_not_whole_ends():
    assert sp.plan(small_scene(), time_limit=300, refinement_budget=100.5).planning_time < 60


@pytest.mark.parametrize("rate", (0.5, 2.0))
def test_blends_bound_the_rate_and_keep_the_ends(rate):
    problem = small_scene()
    plain, gradual = (
        sp.plan(problem, time_limit=60, refinement_budget=0),
        sp.plan(problem, time_limit=60, refinement_budget=0, max_twist_rate=rate),
    )
    assert sp.check_plan(problem, gradual).valid
    rho = problem.surface.characteristic_length

    def jumps(plan):
        u = unit(normalize_twist(np.array([p.twist for p in plan.pushes]), rho))
        return np.linalg.norm(np.diff(u, axis=0), axis=1)

    assert jumps(plain).max() > 0.1
    left = int(gradual.message.split(";")[-1].split()[0]) if "not blended" in gradual.message else 0
    assert (jumps(gradual) > PASSES).sum() == left < (jumps(plain) > PASSES).sum()
    # over a blend the unit twist turns no faster than asked, but for what taking back the change of the pose adds
    times = np.array([p.duration for p in gradual.pushes])
    turned = jumps(gradual)
    short = [
        k for k in range(1, len(turned) - 1) if turned[k - 1] <= PASSES and turned[k] <= PASSES and times[k] < 0.05 / rate * 1.2
    ]
    assert short
    assert max(turned[k] / ((times[k] + times[k + 1]) / 2) for k in short if k + 1 in short) <= 1.1 * rate
    np.testing.assert_allclose(gradual.pushes[-1].end[:2], plain.pushes[-1].end[:2], atol=1e-9)

    # without a stop at blended corners, a time law takes less time
    def last(plan):
        return sp.sample_plan(problem, plan, acceleration=0.1).t[-1] - plan.duration

    assert last(gradual) < last(plain)
