"""What widens a problem does not make its plan worse: a larger tolerance, more contacts; and time that runs out is said."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import small_scene, two_edges
from hypothesis import given, strategies as st
from stablepush_planners.context import goal_ends

import stablepush as sp
from stablepush.core import Deadline
from stablepush.geometry import wrap_angle
from stablepush.planning import PlanResult, registry
from stablepush.planning.chance import constrained
from stablepush.planning.chance.scenarios import draw_scenarios

SCENE = small_scene()
NEAR, TURNED = st.floats(0.0, 0.5), st.floats(0.0, math.pi)


def ends(near, turned):
    return goal_ends(SCENE.goal, (near, turned), SCENE.slider.radius)


@given(NEAR, TURNED, NEAR, TURNED)
def test_the_ends_of_a_larger_tolerance_are_those_of_a_smaller_one_and_more(near, turned, nearer, less):
    larger = {tuple(end) for end in ends(max(near, nearer), max(turned, less))}
    assert {tuple(end) for end in ends(near, turned)} <= larger
    assert tuple(SCENE.goal) in larger


@given(NEAR, TURNED)
def test_ends_are_within_the_tolerance(near, turned):
    found = ends(near, turned)
    away = np.hypot(*(found[:, :2] - SCENE.goal[:2]).T)
    off = np.abs(wrap_angle(found[:, 2] - SCENE.goal[2]))
    # well within: executions end a little beside
    assert away.max() <= near / 2 + 1e-12 and off.max() <= max(turned / 2, turned * (turned > 3.1415)) + 1e-9
    places = np.column_stack((found[:, :2], np.cos(found[:, 2]), np.sin(found[:, 2])))
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(found))
    # none is there twice
    assert apart.min() > 1e-3


@pytest.mark.parametrize("planner", ["cor-lattice", "ompl-rrtconnect", "ompl-rrt"])
def test_a_goal_without_a_heading_takes_no_longer_than_with_one(planner):
    if planner != "cor-lattice":
        pytest.importorskip("ompl", reason="ompl is not installed")
    free = SCENE.with_changes(tolerance=(0.01, math.pi), obstacles=())
    quickest = sp.plan(free, planner, success=0, time_limit=60)
    assert quickest.solved and sp.check_plan(free, quickest).valid
    if planner == "cor-lattice":
        turned = [SCENE.goal[2] + k * math.pi / 4 for k in range(8)]
        fixed = [free.with_changes(goal=(*SCENE.goal[:2], heading), tolerance=(0.01, 0.05)) for heading in turned]
        times = [result.duration for result in (sp.plan(p, success=0, time_limit=60) for p in fixed) if result.solved]
        assert len(times) > 3 and quickest.duration <= min(times) * (1 + 1e-6)


def test_what_is_drawn_of_a_contact_does_not_depend_on_the_others():
    both = two_edges(pusher=None)
    alone = both.with_changes(contacts=both.contacts[:1])
    many, one = draw_scenarios(both, 50, seed=3), draw_scenarios(alone, 50, seed=3)
    np.testing.assert_array_equal(many.contact_mu[:, 0], one.contact_mu[:, 0])
    np.testing.assert_array_equal(many.aside[:, 0], one.aside[:, 0])
    np.testing.assert_array_equal(many.center_of_mass, one.center_of_mass)
    assert (many.aside[:, 1] != many.aside[:, 0]).all()


@pytest.mark.parametrize("goal", [(0.9, 0.25, -0.2), (0.5, 0.25, 0.6), (1.0, 0.15, 0.0)])
def test_another_contact_makes_no_plan_worse(goal):
    """The search is repeated with fewer contacts: no scenario is left out for the sake of those that are of no use."""
    both = two_edges(start=(0.3, 0.2, 0.0), goal=goal, pusher=None)
    alone = both.with_changes(contacts=both.contacts[:1])
    one, two = (sp.plan(problem, time_limit=60, refinement_budget=5000) for problem in (alone, both))
    assert two.solved
    if one.solved:
        assert two.duration <= one.duration * (1 + 1e-6) and two.success_probability >= min(0.96, one.success_probability)


def asked_of(problem, limit, effort):
    """The sets of contacts that a search is asked for, in order."""
    asked = []

    def attempt(regions, deadline, effort):
        used = range(len(problem.contacts)) if not regions else [k for k, region in enumerate(regions) if region is not None]
        asked.append(set(used))
        found = sp.plan(problem.with_changes(contacts=problem.contacts[:1]), success=0, refinement_budget=0, time_limit=60)
        return replace(found, message="")

    constrained.likely_plan(problem, 0.5, attempt, Deadline(limit), limit, effort, 0)
    return asked


def test_in_a_hurry_the_contacts_of_the_quickest_plan_come_first():
    problem = two_edges(pusher=None)
    assert asked_of(problem, 4.9, 10.0)[:2] == [{0, 1}, {0}]
    patient = asked_of(problem, 60.0, 10.0)
    assert patient[0] == {0, 1} and {0} in patient


def test_time_that_ran_out_is_said(monkeypatch):
    """A plan that is less sure than asked for says that more time may help, if it may."""
    problem = small_scene(min_margin=0.0)
    quickest = sp.plan(problem, success=0, refinement_budget=0, time_limit=60)

    def slow(problem, *, deadline, seed, options, progress):
        deadline.extend(-1e6)
        return PlanResult("no-path", "") if options.regions else quickest

    monkeypatch.setattr(registry, "load_plugin", lambda group, name: slow)
    with pytest.warns(sp.PlanWarning, match="the time limit ended the search"):
        assert sp.plan(problem, success=0.9999, time_limit=4.0).solved
    with pytest.warns(sp.PlanWarning, match="wider bounds"):
        monkeypatch.setattr(registry, "load_plugin", lambda group, name: lambda *_, **__: quickest)
        sp.plan(problem, success=0.9999, time_limit=60)


def test_a_start_within_the_tolerance_is_solved_wherever_it_is():
    """No push is looked for that leads away: bounds round the start leave room for none."""
    problem = small_scene(goal=small_scene().start, obstacles=(), pusher=None)
    x, y = problem.start[:2]
    size = problem.slider.radius + 0.02
    tight = problem.with_changes(bounds=(x - size, y - size, x + size, y + size))
    result = sp.plan(tight)
    assert result.solved and len(result.pushes) == 1 and result.length < 1e-3
    assert sp.check_plan(tight, result).valid
