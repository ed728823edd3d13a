import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stablepush as sp
from stablepush.geometry.se2 import compose
from stablepush.views.pages import plan_html

SCENES = Path(__file__).parents[2] / "examples" / "scenes"
NAMES = sorted(file.stem for file in SCENES.glob("*.json") if file.stem != "triangle")


@pytest.mark.parametrize("name", NAMES)
def test_scenes_are_solved_or_refused(name):
    problem = sp.load_scene(SCENES / f"{name}.json")
    result = sp.plan(problem, time_limit=120, refinement_budget=0)
    if name == "unsolvable":
        assert result.status == "no-path"
        assert "exhausted" in result.message
    else:
        assert result.status == "solved", result.message
        assert sp.check_plan(problem, result).valid
        assert result.lower_bound <= result.duration
    if name == "two-contacts":
        assert result.switches > 0
        page = plan_html(problem, result)
        (transfer,) = [s for s in json.loads(re.search(r"const data = (.*);", page)[1])["segments"] if s["kind"] == "transfer"]
        np.testing.assert_allclose(transfer["path"][-1][:2], compose(problem.start, problem.contacts[1].frame)[:2], atol=0.5)
        settings = {"contacts": problem.contacts[:1], "obstacles": problem.obstacles, "bounds": problem.bounds}
        settings |= {name: getattr(problem, name) for name in ("pusher", "tolerance", "speed", "switch_cost", "min_margin")}
        alone = sp.PlanningProblem(problem.slider, problem.surface, start=problem.start, goal=problem.goal, **settings)
        assert sp.plan(alone, time_limit=120).status == "no-path"


def test_what_the_model_buys():
    plans = {one.region: one for one in sp.compare_regions(sp.load_scene(SCENES / "tight-turn.json"), refinement_budget=0)}
    assert list(plans) == ["model", "all-pressure", "conservative"]
    assert plans["model"].result.duration < plans["conservative"].result.duration
    assert plans["all-pressure"].certified == plans["conservative"].certified == 1
    assert 0 < plans["model"].certified < 1


def test_the_sweep_study(tmp_path):
    study = SCENES.parent / "planning" / "sweeps.py"
    arguments = ["--pushes", "100", "--samples", "1000"]
    run = subprocess.run([sys.executable, str(study), *arguments], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "0 free by the sweep but not" in run.stdout
