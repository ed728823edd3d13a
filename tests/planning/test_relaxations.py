"""Where no plan is found the command tells which relaxed problem has one."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import stablepush as sp
from stablepush.cli import main
from stablepush.planning import feasible_relaxations

SCENES = Path(__file__).parents[2] / "examples" / "scenes"


def test_bounds_that_are_proposed_hold_a_plan(tmp_path, capsys):
    assert main(["plan", str(SCENES / "unsolvable.json"), "-o", str(tmp_path / "p.json")]) == 1
    told = capsys.readouterr().out
    (found,) = re.findall(r"^hint: there is a plan within bounds of \[(.*)\] \(m\) or without the obstacles$", told, re.MULTILINE)
    problem = sp.load_scene(SCENES / "unsolvable.json")
    wider = problem.with_changes(bounds=[float(number) for number in found.split(", ")])
    assert (wider.bounds[:2] <= problem.bounds[:2]).all() and (wider.bounds[2:] >= problem.bounds[2:]).all()
    assert sp.plan(wider, refinement_budget=0, time_limit=120).solved
    # the file of the plan keeps to its statuses
    assert json.loads((tmp_path / "p.json").read_text())["status"] == "no-path"


def test_what_no_plan_can_solve_has_the_hint_too(tmp_path, capsys):
    problem = sp.load_scene(SCENES / "walls.json")
    wall = np.array([(-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01)]) + problem.goal[:2]
    sp.save_scene(problem.with_changes(obstacles=(*problem.obstacles, wall)), tmp_path / "scene.json")
    assert main(["plan", str(tmp_path / "scene.json"), "-o", str(tmp_path / "p.json")]) == 1
    assert "hint: there is a plan without the obstacles" in capsys.readouterr().out
    x, y, _ = problem.goal
    sp.save_scene(problem.with_changes(obstacles=(), bounds=(x - 1, y - 1, x + 1, y + 0.01)), tmp_path / "scene.json")
    assert main(["plan", str(tmp_path / "scene.json"), "-o", str(tmp_path / "p.json")]) == 1
    told = capsys.readouterr().out
    assert "out of bounds" in told and "hint: there is a plan within bounds of [" in told


@pytest.mark.parametrize(
    ("plans", "words"),
    (
        ([False, False, True], "there is a plan without the obstacles"),
        ([False, True], "there is a plan without the obstacles"),
        ([False, False, False], ""),
    ),
)
def test_both_are_relaxed_where_neither_alone_helps(plans, words):
    problem = sp.load_scene(SCENES / "walls.json")
    free = problem.with_changes(obstacles=())
    plan, answers = sp.plan(free, refinement_budget=0), iter(plans)

    def make(relaxed):
        return plan if next(answers) else sp.PlanResult("no-path", "cor-lattice")

    assert re.fullmatch(words, feasible_relaxations(problem, make))
    assert next(answers, None) is None


def test_a_search_that_fails_proposes_nothing():
    def make(relaxed):
        raise sp.InputError("bounds", "expected some, which the effect needs")

    assert feasible_relaxations(sp.load_scene(SCENES / "walls.json"), make) == ""


def test_bounds_that_are_not_in_the_way_are_not_proposed():
    """What is found without them may lie within them, and keeps to each side that it does not pass."""
    problem = sp.load_scene(SCENES / "open.json")
    plan = sp.plan(problem, refinement_budget=0)
    told = feasible_relaxations(problem.with_changes(obstacles=()), lambda relaxed: plan)
    assert "bounds" not in told
    shut = problem.with_changes(obstacles=(), bounds=(*problem.bounds[:3], float(problem.goal[1]) + 0.001))
    found = re.fullmatch(r"there is a plan within bounds of \[(.*)\] \(m\)", feasible_relaxations(shut, lambda relaxed: plan))
    assert [float(side) for side in found[1].split(", ")][:3] == [float(f"{side:g}") for side in problem.bounds[:3]]
