"""What no planner can solve is told at once, with the reason, and only that."""

import numpy as np
import pytest
import shapely
from conftest import small_scene, three_feet, triangle
from hypothesis import given, settings, strategies as st

import stablepush as sp
from stablepush.planning.collision import SweptBody
from stablepush.planning.feasibility import infeasibility
from stablepush.planning.registry import planner_names


def box(x, y, half):
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))


def finger():
    return sp.PushContact([(0.0, -0.05)], [(0, 1)], 0.9)


CASES = {
    "goal in an obstacle": ({"obstacles": [box(0.9, 0.3, 0.15)]}, "goal: the slider is in collision with obstacle 0"),
    "goal out of bounds": ({"goal": (3.0, 0.3, 0.0)}, "goal: the slider is out of bounds"),
    "start in an obstacle": (
        {"obstacles": [box(0.0, 0.9, 0.1), box(0.2, 0.2, 0.05)]},
        "start: the slider is in collision with obstacle 1",
    ),
    "start out of bounds": ({"start": (0.0, 0.2, 0.0)}, "start: the slider is out of bounds"),
    "pusher at the start": ({"start": (0.2, 0.06, 0.0)}, "start: the pusher, docked at contact 0, is out of bounds"),
    "pusher at the goal": ({"goal": (0.9, 0.052, 0.0)}, "goal: the pusher, docked at contact 0, is in collision"),
    "one finger": ({"contacts": [finger()]}, "no contact has a stable push"),
    "a margin that no push has": ({"min_margin": 1.5}, "min_margin: no push has a margin of 1.5 rad"),
}


@pytest.mark.parametrize("name", planner_names())
@pytest.mark.parametrize("case", CASES)
def test_what_has_no_plan_is_told_by_every_planner(case, name):
    changes, words = CASES[case]
    result = sp.plan(small_scene(**changes), name, time_limit=20.0)
    assert result.status == "no-path"
    assert words in result.message


@settings(max_examples=60)
@given(
    st.floats(0.0, 0.05),
    st.floats(0.0, 3.2),
    st.floats(0.15, 1.05),
    st.floats(0.15, 0.85),
    st.floats(-3, 3),
    st.floats(0.02, 0.1),
)
def test_a_goal_is_refused_only_if_every_pose_near_it_is_in_collision(reach, turn, x, y, theta, half):
    problem = small_scene(
        goal=(x, y, theta), obstacles=[box(0.6, 0.5, half), box(0.75, 0.5, half)], tolerance=(reach, turn), pusher=None
    )
    reason = infeasibility(problem)
    rng = np.random.default_rng(0)
    away, bearing = reach * np.sqrt(rng.uniform(size=400)), rng.uniform(-np.pi, np.pi, 400)
    poses = np.column_stack((x + away * np.cos(bearing), y + away * np.sin(bearing), theta + turn * rng.uniform(-1, 1, 400)))
    free = SweptBody(problem).free(np.concatenate((poses, [problem.goal])))
    if reason:
        assert reason.startswith("goal: ")
        assert not free.any()
    # what is deep in an obstacle is found out
    if reach < 0.005 and turn < 0.05 and shapely.Point(x, y).distance(shapely.Polygon(box(0.6, 0.5, half))) == 0 and half > 0.05:
        assert reason


def test_a_start_that_is_wedged_in_is_told():
    """Walls that touch the slider on the sides that it would move to."""
    place = np.array((0.5, 0.5))
    corners = triangle().vertices + place
    right = [corners[1], corners[1] + (0.3, 0.0), corners[2] + (0.3, 0.3), corners[2]]
    problem = small_scene(start=(*place, 0.0), obstacles=[right], bounds=(0.0, 0.0, 1.5, 1.5), pusher=None)
    assert "start: every stable push" in infeasibility(problem)
    # half a millimetre aside there is room to begin with
    aside = small_scene(start=(0.4995, 0.4995, 0.0), obstacles=[right], bounds=(0.0, 0.0, 1.5, 1.5), pusher=None)
    assert infeasibility(aside) == ""


def test_a_goal_that_the_region_cannot_turn_to_is_told():
    """Fingers close together with little friction hardly turn, and the table is not long enough."""
    narrow = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.001, 0.005)
    ring = sp.IdealLimitSurface(sp.SupportDistribution.ring(0.05, 36), 3.0)
    settings = {
        "surface": ring,
        "contacts": [narrow],
        "obstacles": (),
        "pusher": None,
        "min_margin": 0.0,
        "start": (0.4, 0.2, 0.0),
    }
    problem = small_scene(goal=(0.4, 0.8, 1.5), **settings)
    region = sp.stable_region(problem.surface, narrow)
    assert min(np.hypot(*region.tightest_turn(s)) for s in (1, -1)) > 1.0
    assert "can turn the slider by" in infeasibility(problem)
    assert infeasibility(small_scene(goal=(0.4, 0.8, 0.0), **settings)) == ""
    # on a table without end it can
    assert infeasibility(small_scene(goal=(0.4, 0.8, 1.5), bounds=None, **settings)) == ""


def test_what_can_be_solved_is_not_refused():
    assert infeasibility(small_scene()) == ""
    assert infeasibility(small_scene(bounds=None)) == ""
    several = small_scene(contacts=[sp.PushContact.on_edge(triangle(), e, 0.05, 0.03, 0.5) for e in (0, 1, 2)])
    assert infeasibility(several) == ""


def test_the_widest_margin_of_a_cone_is_that_of_its_middle():
    surface = sp.IdealLimitSurface(three_feet(), 5.0)
    rng = np.random.default_rng(0)
    loads = rng.normal(size=(200_000, 3))
    for edge, width, mu in ((0, 0.05, 0.9), (1, 0.02, 0.3), (2, 0.08, 1.5)):
        cone = sp.PushContact.on_edge(triangle(), edge, 0.07, width, mu).cone(surface.characteristic_length)
        best = cone.margin(loads).max()
        assert best <= cone.widest_margin + 1e-9
        assert best == pytest.approx(cone.widest_margin, abs=0.01)
    assert finger().cone(0.05).widest_margin == pytest.approx(0.0, abs=1e-7)
