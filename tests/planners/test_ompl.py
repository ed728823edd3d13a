import subprocess
import sys

import numpy as np
import pytest
from conftest import small_scene

import stablepush as sp

pytest.importorskip("ompl", reason="ompl is not installed")
NAMES = [name for name in sp.planner_names() if name.startswith("ompl")]


@pytest.mark.parametrize("name", NAMES)
def test_plans_pass_the_check(name):
    problem = small_scene()
    result = sp.plan(problem, name, time_limit=20, seed=3, refinement_budget=50)
    assert result.status == "solved", result.message
    assert result.planner == name
    assert result.seed == 3
    assert result.lower_bound < result.duration


@pytest.mark.parametrize("name", NAMES)
def test_what_cannot_be_solved_is_said(name):
    walls = [((0.4, -0.1), (0.5, -0.1), (0.5, 1.1), (0.4, 1.1))]
    assert "enclose the goal" in sp.plan(small_scene(obstacles=walls), name, time_limit=10).message
    narrow = [((0.4, -0.1), (0.5, -0.1), (0.5, 0.4), (0.4, 0.4)), ((0.4, 0.49), (0.5, 0.49), (0.5, 1.1), (0.4, 1.1))]
    result = sp.plan(small_scene(obstacles=narrow), name, time_limit=1.5)
    assert result.status == "timeout"
    assert "path" in result.message
    finger = sp.PushContact([(0.0, -0.05)], [(0, 1)], 0.9)
    assert "no contact" in sp.plan(small_scene(contacts=[finger]), name, time_limit=10).message


def test_a_seed_repeats_in_a_process_of_its_own():
    code = (
        "import sys; sys.path.insert(0, 'tests'); from conftest import small_scene; import stablepush as sp;"
        "print([p.twist.tolist() for p in sp.plan(small_scene(), 'ompl-rrtconnect', time_limit=30, seed=5).pushes])"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(2)]
    assert runs[0].stdout == runs[1].stdout
    assert runs[0].stdout.startswith("[[")
    # the library's objects are let go before OMPL's are
    assert "leaked" not in runs[0].stderr


def test_all_twists_of_control_planners_are_stable():
    problem = small_scene()
    result = sp.plan(problem, "ompl-rrt", time_limit=20, seed=1)
    oracle = sp.StabilityOracle(problem.surface, problem.contacts[0])
    assert (oracle.margin(np.array([p.twist for p in result.pushes])) >= problem.min_margin - 1e-9).all()
