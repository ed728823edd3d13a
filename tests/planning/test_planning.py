import math
import time
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import random_twists, small_scene, three_feet, triangle
from hypothesis import given, settings, strategies as st
from stablepush_planners.distance_field import DistanceField
from stablepush_planners.dubins import WORDS, dubins_lengths
from stablepush_planners.stable_set import StableSet
from stablepush_planners.steering import steering

import stablepush as sp
from stablepush.core.deadline import Deadline, within
from stablepush.geometry.se2 import compose, exp, transform_points, wrap_angle
from stablepush.planning.check import _Sweep
from stablepush.planning.collision import SweptBody
from stablepush.planning.result import Push, Transfer

coordinate = st.floats(-3, 3)


@pytest.fixture(scope="module")
def solved():
    problem = small_scene()
    return problem, sp.plan(problem, time_limit=60)


@settings(max_examples=200)
@given(*([coordinate] * 6), st.floats(0.1, 2))
def test_dubins_words_end_at_the_goal(x0, y0, t0, x1, y1, t1, radius):
    table = np.empty((6, 3))
    dubins_lengths(x0, y0, t0, x1, y1, t1, radius, table)
    assert np.isfinite(table).all(axis=1).sum() >= 2
    for word, lengths in zip(WORDS, table, strict=True):
        if not np.isfinite(lengths).all():
            continue
        pose = np.array((x0, y0, t0))
        for letter, length in zip(word, lengths, strict=True):
            turn = {"L": 1, "R": -1, "S": 0}[letter]
            pose = compose(pose, exp(np.array((radius * length, 0, turn * length))))
        np.testing.assert_allclose(pose[:2], (x1, y1), atol=1e-6)
        assert abs(float(wrap_angle(pose[2] - t1))) < 1e-6


@pytest.mark.parametrize("region", ("model", "all-pressure", "conservative"))
def test_steering_is_stable_and_tight(region):
    problem = small_scene(min_margin=0.05)
    stable = StableSet(problem, 0, sp.PlanOptions(region))
    steer = steering(problem, stable)
    assert steer is not None
    turns = [steer.twist(kappa / steer.radius) for kappa in (0.0, 1.0, -1.0)]
    assert (stable.oracle.margin(turns) >= 0.05).all()
    # the reference point moves on circles of equal radius to both sides, straight along its x axis
    for twist, sense in zip(turns[1:], (1, -1), strict=True):
        center = np.array((-twist[1], twist[0])) / twist[2]
        assert np.linalg.norm(center - steer.frame[:2]) == pytest.approx(steer.radius)
        assert np.sign(twist[2]) == sense
    if region != "model":
        build = {"conservative": sp.lynch_mason_region, "all-pressure": sp.all_pressure_region}[region]
        assert build(problem.slider, problem.contacts[0]).contains_twists(turns).all()
        assert steering(problem, StableSet(problem, 0)).radius < steer.radius  # type: ignore[union-attr]
    if region == "all-pressure":
        assert steer.radius < steering(problem, StableSet(problem, 0, sp.PlanOptions("conservative"))).radius  # type: ignore[union-attr]


def test_a_plan_among_obstacles_passes_the_check(solved):
    problem, result = solved
    assert result.status == "solved", result.message
    assert sp.check_plan(problem, result).objections == ()
    assert result.min_margin >= 0.02
    assert result.lower_bound is not None and 0 < result.lower_bound <= result.duration
    np.testing.assert_array_equal(result.pushes[0].start, problem.start)


def test_a_plan_survives_its_file(solved, tmp_path):
    problem, result = solved
    sp.save_plan(result, tmp_path / "plan.json")
    again = sp.load_plan(tmp_path / "plan.json")
    assert sp.check_plan(problem, again).valid
    assert again.duration == result.duration
    np.testing.assert_array_equal(again.pushes[-1].end, result.pushes[-1].end)


@pytest.mark.parametrize("speed", (1e-8, 1e6))
def test_a_plan_that_no_file_can_hold_is_rejected(speed):
    problem = replace(small_scene(), speed=speed)
    result = sp.plan(problem, time_limit=60)
    assert (result.status, result.segments) == ("rejected", ())
    assert "1e+06" in result.message


def test_plans_repeat(solved):
    problem, result = solved
    again = sp.plan(problem, time_limit=60)
    np.testing.assert_array_equal(again.pushes[-1].end, result.pushes[-1].end)
    assert again.duration == result.duration


def change_push(result, index, **changes):
    segments = list(result.segments)
    segments[index] = replace(segments[index], **changes)
    return replace(result, segments=tuple(segments))


def test_the_check_refuses_every_wrong_plan(solved):
    problem, result = solved
    push = result.segments[0]
    wrong = {
        "status": replace(result, status="timeout"),
        "segments": replace(result, segments=()),
        "duration": replace(result, duration=result.duration + 1e-4),
        "length": replace(result, length=result.length * 0.99),
        "switches": replace(result, switches=1),
        "min_margin": replace(result, min_margin=result.min_margin + 1e-3),
        "lower_bound": replace(result, lower_bound=result.duration * 1.1),
        "planning_time": replace(result, planning_time=-1.0),
        "its end is not where": change_push(result, 0, end=push.end + np.array((0, 1e-4, 0))),
        "from where the slider stands then": change_push(result, 1, start=result.segments[1].start + np.array((1e-4, 0, 0))),
        "from the scene's start": change_push(result, 0, start=push.start + np.array((0, 0, 1e-3))),
        "moves at": change_push(result, 0, twist=push.twist * 1.1, duration=push.duration / 1.1),
        "recomputed it is": change_push(result, 0, margin=push.margin + 1e-4),
        "contact from 0": change_push(result, 0, contact=3),
        "duration > 0": change_push(result, 0, duration=-1.0),
        "not zero": change_push(result, 0, twist=np.zeros(3)),
        "goal": replace(result, segments=result.segments[:-1]),
        "transfer": replace(result, segments=(Transfer(0, 0, np.empty((0, 3)), 0.0), *result.segments)),
    }
    for name, plan in wrong.items():
        report = sp.check_plan(problem, plan)
        assert not report.valid, name
    words = " ".join(o for plan in wrong.values() for o in sp.check_plan(problem, plan).objections)
    for name in wrong:
        if name != "transfer":
            assert name in words, name


def test_the_check_refuses_unstable_pushes_and_collisions(solved):
    problem, result = solved
    middle = result.pushes[0].poses(result.pushes[0].duration / 2)[:2]
    pebble = middle + 0.005 * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)))
    bigger = small_scene(obstacles=[*problem.obstacles, pebble])
    words = " ".join(sp.check_plan(bigger, result).objections)
    assert "hits obstacle 1" in words
    assert not sp.check_plan(small_scene(bounds=(0.0, 0.0, 0.8, 1.0)), result).valid
    assert not sp.check_plan(small_scene(min_margin=result.min_margin + 0.01), result).valid
    slippery = small_scene(contacts=[sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.05)])
    assert not sp.check_plan(slippery, result).valid


def push_of(twist, duration, start=(0.0, 0.0, 0.0)):
    return Push.from_start(0, np.array(twist, dtype=float), duration, np.array(start, dtype=float), 0.0)


@settings(max_examples=150)
@given(st.integers(0, 10**6), st.booleans())
def test_exact_sweeps_agree_with_dense_sampling(seed, straight):
    rng = np.random.default_rng(seed)
    outline = rng.normal(size=2) + triangle().vertices * rng.uniform(2, 8)
    angle = rng.uniform(0, 2 * np.pi, size=4)
    obstacle = rng.uniform(-1.5, 1.5, 2) + 0.3 * np.column_stack((np.cos(np.sort(angle)), np.sin(np.sort(angle))))
    twist = (*rng.normal(size=2), 0.0 if straight else rng.normal() * 2)
    push = push_of(twist, 1.0)
    times = np.linspace(0, 1, 2001)
    placed = transform_points(exp(push.twist * times[:, None]), outline)
    gaps = shapely.distance(shapely.polygons(placed), shapely.Polygon(obstacle))
    step = np.linalg.norm(np.diff(placed, axis=0), axis=-1).max()
    hit = _Sweep.from_push(push).hits(outline, obstacle)
    if gaps.min() == 0:
        assert hit
    elif gaps.min() > step:
        assert not hit
    low, high = placed.reshape(-1, 2).min(axis=0), placed.reshape(-1, 2).max(axis=0)
    ends = _Sweep.from_push(push).extremes(outline)
    np.testing.assert_allclose(ends.min(axis=0), low, atol=2 * step)
    np.testing.assert_allclose(ends.max(axis=0), high, atol=2 * step)


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_motions_declared_free_are_free(seed):
    """The planner's test may refuse a free motion, but never passes one that the exact sweep refuses."""
    rng = np.random.default_rng(seed)
    problem = small_scene(obstacles=[rng.uniform(0, 1, 2) + s * 0.05 * np.array(((-1, -1), (1, -1), (0, 1))) for s in (1, 2)])
    body = SweptBody(problem, problem.contacts[0])
    start = np.array((*rng.uniform(0.1, 0.9, 2), rng.uniform(-3, 3)))
    twist = np.array((*rng.normal(size=2) * 0.3, rng.normal() * 3))
    push = push_of(twist, 1.0, start)
    if not body.push_is_free(start, twist, 1.0):
        return
    docked = transform_points(problem.contacts[0].frame, problem.pusher)
    sweep = _Sweep.from_push(push)
    for outline in (problem.slider.vertices, docked):
        placed = transform_points(start, outline)
        assert not any(sweep.hits(placed, o) for o in problem.obstacles)
        ways = sweep.extremes(placed)
        assert (ways >= problem.bounds[:2] - 1e-6).all() and (ways <= problem.bounds[2:] + 1e-6).all()


def test_touching_is_no_collision():
    wall = ((0.1, -0.5), (0.2, -0.5), (0.2, 0.5), (0.1, 0.5))
    contact = sp.PushContact.on_edge(triangle(), 2, 0.075, 0.05, 0.9)
    surface = sp.IdealLimitSurface(three_feet(), 5.0)
    margin = float(sp.StabilityOracle(surface, contact).margin((1.0, 0.0, 0.0)))
    for gap, valid in ((0.0, True), (-1e-3, False)):
        # the corner at x = 0.1 in B ends at the wall
        push = Push.from_start(0, (0.05, 0.0, 0.0), (0.05 - gap) / 0.05, (-0.05, 0.0, 0.0), margin)
        problem = sp.PlanningProblem(
            triangle(), surface, [contact], push.start, push.end, [wall], (-1, -1, 1, 1), tolerance=(0.001, 0.01)
        )
        result = sp.PlanResult.from_segments([push], planner="hand")
        assert sp.check_plan(problem, result).valid is valid


@pytest.mark.parametrize(
    "change", ({"obstacles": [((0.14, 0.0), (0.15, 0.0), (0.15, 0.6), (0.14, 0.6))]}, {"bounds": (0.15, 0.09, 1.2, 1.0)})
)
def test_plans_start_where_the_slider_touches(change):
    problem = small_scene(**{"obstacles": (), "pusher": None, "goal": (0.7, 0.6, -1.0), **change})
    result = sp.plan(problem, time_limit=30)
    assert result.status == "solved", result.message
    assert sp.check_plan(problem, result).valid


def test_the_same_pose_with_no_tolerance_takes_a_loop():
    problem = small_scene(goal=(0.5, 0.5, 0.0), start=(0.5, 0.5, 0.0), obstacles=(), tolerance=(0.0, 0.0))
    result = sp.plan(problem, time_limit=30)
    assert result.status == "solved", result.message
    assert sp.check_plan(problem, result).valid


def test_support_of_many_points_keeps_the_time_limit():
    """Primitives of a surface of thousands of support points are sought under the deadline, too."""
    from stablepush.core.errors import OutOfTimeError

    many = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(triangle().vertices, 0.001), 5.0)
    with pytest.raises(OutOfTimeError):
        problem = small_scene(surface=many)
        steering(problem, StableSet(problem, 0, deadline=Deadline(0.0)))


def test_building_compiled_code_takes_none_of_the_time():
    """A new function, which no cache knows, takes longer to be built than there is time."""
    import numba

    with within(0.1) as deadline:
        started = time.perf_counter()
        numba.njit(lambda values: np.sort(values) + 1.0)(np.arange(3.0))
        spent = time.perf_counter() - started
        assert spent > 0.1
        assert not deadline.passed()
        time.sleep(0.1)
        assert deadline.passed()
    assert deadline.left() < 0 < Deadline().left()


def transfer_problem(obstacles=()):
    contacts = [sp.PushContact.on_edge(triangle(), e, c, 0.05, 0.9) for e, c in ((0, 0.05), (2, 0.1))]
    return small_scene(contacts=contacts, obstacles=obstacles, switch_cost=2.0, goal=(0.5, 0.5, 0.0))


def plan_with_transfer(problem, path):
    pose = problem.start
    oracle = [sp.StabilityOracle(problem.surface, c) for c in problem.contacts]
    segments = []
    twists = ((0.0, 0.05, 0.0), (0.05, 0.0, 0.0))
    for contact, twist in enumerate(twists):
        if contact:
            segments.append(Transfer(0, 1, np.array(path(pose)), 2.0))
        push = Push.from_start(contact, twist, 6.0, pose, float(oracle[contact].margin(twist)))
        segments.append(push)
        pose = push.end
    return sp.PlanResult.from_segments(segments, planner="hand")


def round_the_corner(problem):
    def path(pose):
        first, last = (compose(pose, c.frame) for c in problem.contacts)
        away = compose(first, (-0.1, 0, 0))
        beside = compose(last, (-0.1, 0, 0))
        corner = np.array((beside[0], away[1], away[2]))
        return [first, away, corner, beside, last]

    return path


def test_transfers_are_checked():
    problem = transfer_problem()
    good = plan_with_transfer(problem, round_the_corner(problem))
    assert sp.check_plan(problem, good).objections == ()

    def slide(pose):
        """Along the pushed edge and back, in touch with the slider all the way."""
        first = compose(pose, problem.contacts[0].frame)
        return [first, compose(first, (0, 0.02, 0)), *round_the_corner(problem)(pose)]

    assert sp.check_plan(problem, plan_with_transfer(problem, slide)).objections == ()

    def through(pose):
        return [compose(pose, c.frame) for c in problem.contacts]

    words = " ".join(sp.check_plan(problem, plan_with_transfer(problem, through)).objections)
    assert "pusher hits" in words
    words = " ".join(sp.check_plan(problem, plan_with_transfer(problem, lambda pose: np.empty((0, 3)))).objections)
    assert "expected a path" in words
    words = " ".join(sp.check_plan(problem, plan_with_transfer(problem, lambda p: round_the_corner(problem)(p)[:-1])).objections)
    assert "docked" in words
    blocked = transfer_problem([((0.3, 0.3), (0.35, 0.3), (0.35, 0.35), (0.3, 0.35))])
    assert sp.check_plan(blocked, good).valid
    blocked = transfer_problem([((0.03, 0.38), (0.06, 0.38), (0.06, 0.4), (0.03, 0.4))])
    assert not sp.check_plan(blocked, good).valid


def test_contacts_are_changed_where_the_pusher_takes_no_room():
    """In a corridor too low to turn in, only the second contact leads on."""
    problem = small_scene(
        contacts=transfer_problem().contacts,
        pusher=None,
        obstacles=(),
        bounds=(0, 0.1, 1.2, 0.32),
        goal=(0.8, 0.2, 0.0),
        switch_cost=1.0,
    )
    result = sp.plan(problem, time_limit=60)
    assert result.status == "solved"
    assert result.switches >= 1
    assert sp.check_plan(problem, result).valid


def test_walled_in_means_no_path():
    walls = [((0.4, -0.1), (0.5, -0.1), (0.5, 1.1), (0.4, 1.1))]
    result = sp.plan(small_scene(obstacles=walls), time_limit=100)
    assert result.status == "no-path"
    assert "enclose the goal" in result.message
    assert result.segments == ()


def test_a_gap_too_narrow_for_the_slider_exhausts_the_lattice():
    """The centre of mass could pass, so the distance field does not see it: the search has to."""
    walls = [((0.4, -0.1), (0.5, -0.1), (0.5, 0.4), (0.4, 0.4)), ((0.4, 0.49), (0.5, 0.49), (0.5, 0.9), (0.4, 0.9))]
    result = sp.plan(small_scene(obstacles=walls, bounds=(0.0, 0.0, 0.9, 0.8), goal=(0.7, 0.4, -1.5)), time_limit=600)
    assert result.status == "no-path"
    assert "exhausted" in result.message


def test_hopeless_starts_and_contacts_are_named():
    assert "start" in sp.plan(small_scene(start=(0.5, 0.15, 0.0)), time_limit=20).message
    assert "start" in sp.plan(small_scene(start=(0.02, 0.2, 0.0)), time_limit=20).message
    finger = sp.PushContact([(0.0, -0.05)], [(0, 1)], 0.9)
    assert "no contact" in sp.plan(small_scene(contacts=[finger]), time_limit=20).message


def test_a_start_within_tolerance_still_gives_a_push():
    problem = small_scene(goal=(0.2, 0.201, 0.0), obstacles=())
    result = sp.plan(problem, time_limit=30)
    assert result.status == "solved"
    assert sp.check_plan(problem, result).valid
    assert result.length < 0.01


def test_no_time_means_timeout():
    assert sp.plan(small_scene(), time_limit=0.0).status == "timeout"


def test_distance_field_never_exceeds_the_way():
    """The bound at poses along a found path is below the time that the rest of the path takes."""
    problem = small_scene()
    result = sp.plan(problem, time_limit=60)
    field = DistanceField(problem)
    rest = result.duration
    for push in result.pushes:
        for share in np.linspace(0, 1, 10):
            pose = push.poses(share * push.duration)
            i, j = np.floor((pose[:2] - field.low) / field.cell).astype(int)
            assert field.times[i, j] <= rest - share * push.duration + 1e-9
        rest -= push.duration


def test_entry_arguments_are_checked():
    with pytest.raises(sp.InputError, match="cor-lattice"):
        sp.plan(small_scene(), planner="teleport")
    with pytest.raises(sp.InputError, match="region"):
        sp.plan(small_scene(), region="hopeful")
    with pytest.raises(sp.InputError, match="time_limit"):
        sp.plan(small_scene(), time_limit=-1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"contacts": []}, "contact"),
        ({"bounds": (1, 0, 0, 1)}, "bounds"),
        ({"speed": 0.0}, "speed"),
        ({"tolerance": (-1, 0)}, "tolerance"),
        ({"obstacles": [((0, 0), (1, 1), (1, 0), (0, 1))]}, r"obstacles\[0\]"),
        ({"switch_cost": -1.0}, "switch_cost"),
        ({"start": (0, 0)}, "start"),
    ],
)
def test_bad_problems_are_refused(change, message):
    with pytest.raises(sp.InputError, match=message):
        small_scene(**change)


def test_scenes_survive_their_file(tmp_path):
    from stablepush.planning.problem import save_scene

    problem = small_scene()
    save_scene(problem, tmp_path / "scene.json")
    again = sp.load_scene(tmp_path / "scene.json")
    for name in ("start", "goal", "bounds", "pusher"):
        np.testing.assert_array_equal(getattr(again, name), getattr(problem, name))
    assert again.tolerance == problem.tolerance
    with pytest.raises(sp.InputError, match="bounds"):
        save_scene(small_scene(bounds=None), tmp_path / "open.json")


def identified(pokes=8):
    """A surface with an ensemble, from a few pokes of the triangle."""
    truth = sp.IdealLimitSurface(three_feet(), 5.0)
    twists = random_twists(pokes, 0.05)
    return sp.fit_limit_surface(truth.wrench(twists), twists, slider=triangle()).surface


def test_plans_of_an_identified_surface_are_likely_to_hold_by_default():
    problem = small_scene(surface=identified(), min_margin=0.0)
    default = sp.plan(problem, time_limit=60, refinement_budget=2000)
    quickest = sp.plan(problem, time_limit=60, refinement_budget=2000, success=0)
    assert default.solved and quickest.solved
    assert default.success_probability >= 0.97
    assert quickest.success_probability < 0.9
    assert quickest.duration < default.duration < 1.2 * quickest.duration


def test_without_a_likely_plan_the_surest_comes_with_a_warning():
    surface = identified()
    # half of the surfaces are of a body whose feet are far to one side: what holds it does not hold the other
    aside = sp.IdealLimitSurface(sp.SupportDistribution(np.add(three_feet().points, (0.5, 0.0)), np.ones(3)), 5.0)
    twists = random_twists(20, 0.05)
    rho = surface.characteristic_length
    other = sp.fit_limit_surface(aside.wrench(twists), twists, characteristic_length=rho).surface
    skewed = sp.PolynomialLimitSurface(
        surface.coefficients, 4, rho, ensemble=np.concatenate((surface.ensemble[:25], other.ensemble[:25]))
    )
    problem = small_scene(surface=skewed, min_margin=0.0)
    with pytest.warns(sp.PlanWarning, match="no plan was found that succeeds with probability 0.98") as told:
        result = sp.plan(problem, time_limit=60, refinement_budget=0)
    assert result.solved
    assert 0.2 < result.success_probability < 0.6
    assert str(told[0].message) in result.message
    with pytest.warns(sp.PlanWarning):
        assert sp.plan(problem, time_limit=60, refinement_budget=0).duration == result.duration


def test_a_search_can_be_stopped():
    """What was found by then is the answer; before that there is none."""
    problem = small_scene()
    result = sp.plan(problem, time_limit=60, stop=lambda: True)
    assert result.status == "interrupted" and not result.pushes
    said = []
    asked = iter([False] * 200)

    def stop():
        return len(said) > 3 and next(asked, True)

    full = sp.plan(problem, time_limit=60, refinement_budget=math.inf, stop=stop, progress=said.append)
    assert full.solved
    assert sp.check_plan(problem, full).valid
