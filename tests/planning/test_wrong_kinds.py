"""What a caller confuses most: a file for what is in it, a log for its pairs, and an answer without a path for a plan."""

from pathlib import Path

import pytest

import stablepush as sp
from stablepush.planning import registry

SCENES = Path(__file__).parents[2] / "examples" / "scenes"


def test_a_path_is_no_problem():
    problem = sp.load_scene(SCENES / "narrow.json")
    nothing = sp.PlanResult("no-path", "cor-lattice", message="the goal is out of reach")
    words = r"problem: expected a PlanningProblem; stablepush.load_scene reads one .*'a.json'"
    for call in (sp.plan, lambda scene: sp.check_plan(scene, nothing), lambda scene: sp.correct(scene, "d.json")):
        with pytest.raises(sp.InputError, match=words):
            call("a.json")
    # one line that says why there is no path, and none about what it lacks
    assert sp.check_plan(problem, nothing).objections == ("status: expected solved, got no-path: the goal is out of reach",)


def test_parts_of_a_problem_are_what_they_should_be():
    problem = sp.load_scene(SCENES / "walls.json")
    with pytest.raises(sp.InputError, match=r"contacts: expected a list of PushContact, got one PushContact"):
        problem.with_changes(contacts=problem.contacts[0])
    with pytest.raises(sp.InputError, match=r"contacts\[1\]: expected a PushContact, got float"):
        problem.with_changes(contacts=[problem.contacts[0], 0.5])
    with pytest.raises(sp.InputError, match=r"slider: expected a Slider, as Slider.centered"):
        problem.with_changes(slider=problem.slider.vertices)
    with pytest.raises(sp.InputError, match=r"result: expected a PlanResult; stablepush.load_plan reads one"):
        sp.check_plan(problem, "plan.json")


@pytest.mark.parametrize("region", ("all-pressure", "conservative"))
def test_a_planner_that_does_not_know_the_region_is_refused(monkeypatch, region):
    problem = sp.load_scene(SCENES / "walls.json")
    quickest = sp.plan(problem, success=0, refinement_budget=0)
    monkeypatch.setattr(registry, "load_plugin", lambda group, name: lambda problem, **how: quickest)
    assert sp.plan(problem, "mine", success=0).solved
    result = sp.plan(problem, "mine", success=0, region=region)
    assert result.status == "rejected" and f"is not in the region that was asked for, {region}" in result.message


def test_a_log_is_no_pair():
    slider = sp.Slider.rectangle(0.1, 0.06, mass=0.8)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 1.0)
    rig = sp.VirtualRig(slider, surface, 0.5, sp.Pusher.finger(0.005))
    log = rig.execute(sp.random_pushes(slider, rig.pusher, 3, seed=1), seed=1).log
    with pytest.raises(sp.InputError, match=r"wrenches: expected loads, or pairs of loads and twists, as log.pairs\(\)"):
        sp.fit_limit_surface(log, slider=slider)
    assert sp.fit_limit_surface(log.pairs(), slider=slider).surface.is_dual
