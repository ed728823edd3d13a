"""Where the start is uncertain a straight push aligns the slider; what it leaves is simulated."""

import math
import warnings
from itertools import pairwise

import numpy as np
import pytest
from conftest import small_scene, three_feet, triangle

import stablepush as sp
from stablepush.geometry import compose, inverse
from stablepush.planning.alignment import after_docking, clearance
from stablepush.planning.chance.scenarios import alignment_push, draw_scenarios

START = (0.002, 0.03)


def uncertain(start=START, **changes):
    known = small_scene(pusher=None, **changes)
    names = ("slider", "surface", "contacts", "start", "goal", "obstacles", "bounds", "tolerance", "speed")
    given = {name: getattr(known, name) for name in names}
    return sp.PlanningProblem(**given, uncertainty=sp.Uncertainty(start=start), finger_radius=0.004)


def test_plans_begin_with_a_straight_push_that_is_long_enough():
    problem = uncertain()
    result = sp.plan(problem, time_limit=60, refinement_budget=0)
    assert result.solved and sp.check_plan(problem, result).valid
    first = result.pushes[0]
    assert first.twist[2] == 0
    # three deviations of position, and of heading times the fingers' distance, or more
    assert first.length >= 3 * (0.002 + 0.03 * 0.05) - 1e-9
    assert result.success_probability > 0.95 and result.lower_bound is None
    # after a shorter one the slider may not be square to the fingers
    short = sp.Push.from_start(0, first.twist, 0.003 / problem.speed, problem.start, first.margin)
    found = sp.estimate_success(problem, sp.PlanResult.from_segments([short], planner="hand"), 300)
    assert found.probability < 0.8 and "square" in found.failures[0][2]


def test_what_is_left_after_alignment_lies_along_the_edge():
    problem = uncertain()
    drawn = draw_scenarios(problem, 200, seed=3).after(alignment_push(problem))
    assert drawn.flush.mean() > 0.98
    contact = problem.contacts[0]
    left = drawn.start[drawn.flush]
    assert np.abs(left[:, :2] @ contact.normals[0]).max() < 5e-4
    assert np.abs(left[:, 2]).max() < 5e-3
    along = np.array((-contact.normals[0][1], contact.normals[0][0]))
    # about as far as it was off, a little more for the slide
    assert 0.0015 < (left[:, :2] @ along).std() < 0.004
    # and it moves the fingers in B the other way
    assert np.corrcoef(drawn.aside[drawn.flush, 0], left[:, :2] @ along)[0, 1] < -0.8


def test_arrival_counts_what_is_left():
    sharp = sp.PlanningProblem(
        **{
            name: getattr(uncertain(), name) for name in ("slider", "surface", "contacts", "start", "goal", "obstacles", "bounds")
        },
        tolerance=(0.003, 0.05),
        uncertainty=sp.Uncertainty(start=(0.003, 0.0)),
    )
    result = sp.plan(sharp, time_limit=60, refinement_budget=0)
    assert result.arrival_probability < result.success_probability - 0.1


def test_another_engine_agrees_on_what_is_left():
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    from stablepush.engines import Fingers, SliderOnFeet, executor

    problem = uncertain()
    push, contact = alignment_push(problem), problem.contacts[0]
    feet = three_feet()
    docked = sp.finger_frame(contact, 0.004)
    half = np.linalg.norm(np.diff(contact.points, axis=0)) / 2
    body = SliderOnFeet(problem.slider.vertices, 1.0, feet.points, feet.weights, 0.3)
    fingers = Fingers(np.array(((0.0, half), (0.0, -half))), 0.004, contact.mu)
    for error in ((0.002, 0.001, 0.04), (-0.001, -0.002, -0.03)):
        none = np.zeros(1)
        [predicted], flush = after_docking(
            problem, push, [problem.surface], none.astype(int), none + contact.mu, none, np.zeros((1, 2)), np.array([error])
        )
        assert flush.all()
        back = clearance(problem, problem.contacts[0]) + 1e-3
        theta = contact.frame[2] + problem.start[2]
        begin = compose(problem.start, docked) - (back * math.cos(theta), back * math.sin(theta), 0)
        t = np.array((0.0, back / problem.speed, back / problem.speed + push.duration))
        poses = np.array((begin, compose(problem.start, docked), compose(push.end, docked)))
        done = executor("mujoco", body, fingers).follow(compose(problem.start, error), t, poses)
        found = compose(inverse(push.end), done.slider[-1])
        np.testing.assert_allclose(found[:2], predicted[:2], atol=5e-4)
        assert abs(math.remainder(found[2] - predicted[2], 2 * math.pi)) < 0.01


def test_one_finger_does_not_align_and_that_is_said():
    known = uncertain()
    finger = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.0, 0.9)
    problem = sp.PlanningProblem(
        known.slider, known.surface, [finger], known.start, (0.2, 0.5, 0.0), uncertainty=sp.Uncertainty(start=START)
    )
    assert alignment_push(problem) is None
    twist = problem.speed * np.array((0.0, 1.0, 0.0))
    push = sp.Push.from_start(0, twist, 4.0, problem.start, 0.0)
    found = sp.estimate_success(problem, sp.PlanResult.from_segments([push], planner="hand"), 50)
    assert found.probability == 0.0 and "square" in found.failures[0][2]


def test_no_room_to_align_is_no_path():
    problem = uncertain()
    theta = problem.contacts[0].frame[2] + problem.start[2]
    ahead = problem.start[:2] + np.array((math.cos(theta), math.sin(theta))) * (0.1 + 0.001)
    wall = [ahead + d for d in ((-0.3, 0.0), (0.3, 0.0), (0.3, 0.01), (-0.3, 0.01))]
    blocked = uncertain(obstacles=[np.array(wall)], bounds=(-1, -1, 2, 2))
    result = sp.plan(blocked, time_limit=60, refinement_budget=0)
    assert result.status == "no-path" and "obstacles or bounds block the straight push" in result.message
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        certain = replace_uncertainty(blocked)
        assert "straight push" not in sp.plan(certain, time_limit=20, refinement_budget=0).message


def replace_uncertainty(problem):
    names = ("slider", "surface", "contacts", "start", "goal", "obstacles", "bounds", "tolerance", "speed")
    return sp.PlanningProblem(**{name: getattr(problem, name) for name in names})


def test_alignment_pushes_are_as_safe_as_they_can_be():
    """The direction nearest to the normal that is stable may hold in few scenarios only."""
    slider = sp.Slider.rectangle(0.12, 0.08, 1.0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0)
    contact = sp.PushContact.on_edge(slider, 3, 0.0205, 0.03, 0.5)
    problem = sp.PlanningProblem(
        slider, surface, [contact], (0, 0, 0), (0.4, -0.05, 0.0), uncertainty=sp.Uncertainty(start=(0.0005, 0.005))
    )
    with warnings.catch_warnings():
        # what alignment itself loses may be as much as the level leaves
        warnings.simplefilter("ignore", sp.PlanWarning)
        assert sp.plan(problem, time_limit=60, refinement_budget=0).success_probability > 0.96


def test_the_first_push_counts_whichever_contact_it_is_at():
    slider = sp.Slider.rectangle(0.12, 0.08, 1.0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0)
    corner = sp.PushContact(((-0.06, 0.01), (0.0, -0.04)), ((1, 0), (0, 1)), 0.5)
    edge = sp.PushContact.on_edge(slider, 1, 0.04, 0.05, 0.5)
    problem = sp.PlanningProblem(
        slider, surface, [corner, edge], (0, 0, 0), (-0.3, 0, 0), uncertainty=sp.Uncertainty(start=(0.001, 0.01))
    )
    push = sp.Push.from_start(1, (-0.03, 0.0, 0.0), 10.0, (0, 0, 0), 0.1)
    plan = sp.PlanResult.from_segments([sp.Transfer(0, 1, np.empty((0, 3)), 0.0), push], planner="hand")
    assert sp.estimate_success(problem, plan, 200).probability > 0.95


def test_a_later_docking_is_aligned_by_a_push_that_is_long_enough():
    """What is left along its normal is met too early or too late: a short push does not take that away."""
    slider = sp.Slider.rectangle(0.12, 0.08, 1.0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0)
    contacts = [sp.PushContact.on_edge(slider, 3, 0.04, 0.05, 0.5), sp.PushContact.on_edge(slider, 2, 0.06, 0.05, 0.5)]
    problem = sp.PlanningProblem(slider, surface, contacts, (0, 0, 0), (1, 0, 0), uncertainty=sp.Uncertainty(start=(0.004, 0.0)))
    first = sp.Push.from_start(0, (0.03, 0.0, 0.0), 3.0, (0, 0, 0), 0.1)

    def then(twist, duration):
        second = sp.Push.from_start(1, twist, duration, first.end, 0.1)
        plan = sp.PlanResult.from_segments([first, sp.Transfer(0, 1, np.empty((0, 3)), 0.0), second], planner="hand")
        return sp.estimate_success(problem, plan, 200).probability

    assert then((0.0, -0.03, 0.0), 3.0) > 0.95
    # 3 mm reach sliders that are up to 3 mm farther, to the millimetre that counts as touching: Phi((3 + 1) / 4) = 0.84
    assert 0.75 < then((0.0, -0.03, 0.0), 0.1) < 0.92
    alone = sp.PlanResult.from_segments([first], planner="hand")
    assert sp.estimate_success(problem, alone, 200).probability > 0.95


def test_three_fingers_are_planned_for_but_not_simulated():
    slider = sp.Slider.rectangle(0.12, 0.08, 1.0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0)
    contact = sp.PushContact([(-0.06, -0.02), (-0.06, 0.0), (-0.06, 0.02)], (1.0, 0.0), 0.3)
    given = (slider, surface, [contact], (0, 0, 0), (0.2, 0.15, 0.9))
    result = sp.plan(sp.PlanningProblem(*given, tolerance=(0.002, 0.01)), success=0, time_limit=60, refinement_budget=0)
    assert result.solved and result.success_probability is not None


def test_ends_after_a_slip_are_where_the_slider_is():
    """On scenarios that stick, the simulated end is the planned one displaced along the edge."""
    from stablepush.planning.chance.success import Losses, _aside, _ends, _Stretch

    problem = uncertain((0.004, 0.0))
    result = sp.plan(problem, success=0.9, time_limit=60, refinement_budget=0)
    drawn = draw_scenarios(problem, 30, seed=5).after(result.pushes[0])
    stuck = drawn.take(drawn.flush)
    expected = _aside(problem, result, stuck)
    losses = Losses(np.zeros(len(stuck), dtype=int), np.zeros((len(stuck), 1)), (_Stretch(0, len(result.pushes), stuck),))
    np.testing.assert_allclose(_ends(losses, np.arange(5), result)[:, :2], expected[:5, :2], atol=1e-3)


def two_edges(**changes):
    slider = sp.Slider.rectangle(0.12, 0.08, 1.0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0)
    contacts = [sp.PushContact.on_edge(slider, 3, 0.04, 0.05, 0.5), sp.PushContact.on_edge(slider, 0, 0.06, 0.05, 0.5)]
    given = {"uncertainty": sp.Uncertainty(start=(0.003, 0.02)), "finger_radius": 0.004, "tolerance": (0.01, 0.05)} | changes
    return sp.PlanningProblem(slider, surface, contacts, (0, 0, 0), (0.3, 0.3, 0.0), **given)


@pytest.fixture(scope="module")
def plan_of_two_dockings():
    problem = two_edges()
    return problem, sp.plan(problem, time_limit=60, refinement_budget=2000)


def test_every_docking_begins_with_a_push_that_aligns(plan_of_two_dockings):
    problem, result = plan_of_two_dockings
    assert result.solved and sp.check_plan(problem, result).valid and result.switches > 0
    assert result.success_probability > 0.95
    for before, push in pairwise(result.segments):
        if isinstance(before, sp.Transfer):
            contact = problem.contacts[push.contact]
            along = math.atan2(push.twist[1], push.twist[0]) - contact.frame[2]
            assert push.twist[2] == 0 and abs(math.remainder(along, 2 * math.pi)) < math.radians(35)
            assert push.length >= clearance(problem, contact) - 1e-9


def test_two_dockings_in_another_engine(plan_of_two_dockings):
    """Displaced sliders end where the plan ends, but for what is left along the last edge; two errors, MuJoCo."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    from stablepush.engines import Fingers, SliderOnFeet, executor

    problem, result = plan_of_two_dockings
    support = sp.SupportDistribution.from_polygon(0.8 * problem.slider.vertices, 0.03)
    body = SliderOnFeet(problem.slider.vertices, 1.0, support.points, support.weights / support.weights.sum(), 0.3)
    half = 0.025
    fingers = Fingers(np.array(((0.0, half), (0.0, -half))), problem.finger_radius, 0.5)
    samples = sp.sample_plan(problem, result, rate=100, acceleration=0.1, jerk=1.0)
    for error in ((0.003, -0.003, 0.02), (-0.004, 0.003, -0.03)):
        done = executor("mujoco", body, fingers).follow(compose(problem.start, error), samples.t, samples.pusher)
        left = compose(inverse(result.pushes[-1].end), done.slider[-1])
        across = problem.contacts[result.pushes[-1].contact].normals[0]
        assert abs(left[:2] @ across) < 1.5e-3 and np.hypot(*left[:2]) < 0.01
        assert abs(math.remainder(left[2], 2 * math.pi)) < 0.02
