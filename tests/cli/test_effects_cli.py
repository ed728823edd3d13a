"""Scenes whose table slopes, through the command line: planned, checked, simulated, corrected, and refused in one line."""

import json
import re

import pytest
from conftest import one_line, small_scene, three_feet, triangle

import stablepush as sp
from stablepush.cli import main
from stablepush.planning import save_scene

TILT = {"effect": "tilt", "parameters": {"slope": [0.05, -0.02]}, "covariance": [[1e-5, 0.0], [0.0, 1e-5]]}


def write_scene(path, effects, **changes):
    slider = sp.Slider(triangle().vertices, 1.5, three_feet())
    save_scene(small_scene(slider=slider, pusher=None, goal=(0.3, 0.55, 0.6), obstacles=(), **changes), path)
    data = json.loads(path.read_text())
    path.write_text(json.dumps({**data, "effects": effects}))


def test_a_sloping_scene_is_planned_checked_and_simulated(tmp_path, capsys):
    scene, plan, level = tmp_path / "scene.json", tmp_path / "plan.json", tmp_path / "level.json"
    write_scene(scene, [TILT])
    write_scene(level, [])
    arguments = ["--refinement-budget", "0", "--time-limit", "60", "-o", str(plan)]
    assert main(["plan", str(scene), *arguments]) == 0
    assert main(["check", str(scene), str(plan)]) == 0
    # a plan for another table states other margins
    assert main(["check", str(level), str(plan)]) == 1
    assert "margin" in capsys.readouterr().out
    assert main(["simulate", str(scene), str(plan), "-o", str(tmp_path / "log")]) == 0
    told = capsys.readouterr()
    # within what a plan's own tolerance leaves
    assert float(re.search(r"([\d.]+) mm and [\d.]+ deg from the goal", told.out)[1]) <= 10.0
    assert "does not pass the check" not in told.err
    assert main(["simulate", str(scene), str(plan), "--effect", "tilt:slope=0/0", "-o", str(tmp_path / "level-log")]) == 0


def test_what_plans_do_not_know_is_one_line(tmp_path, capsys):
    scene = tmp_path / "scene.json"
    out = ["-o", tmp_path / "p.json"]
    for effects, words in (
        (
            [{"effect": "contact-friction", "parameters": {"mu": 0.3}, "covariance": None}],
            "friction of the fingers is mu of the contacts",
        ),
        ([{**TILT, "covariance": [[1.0, 2.0], [3.0, -4.0]]}], "expected it symmetric, without negative eigenvalues"),
        ([{**TILT, "covariance": [[1.0]]}], "covariance"),
        ([{"effect": "pressure-shift", "parameters": {"offset": [0.3, 0.0]}, "covariance": None}], "stays under the slider"),
        ([{"effect": "spatial-variation", "parameters": {"gradient": [-9.0, 0.0]}, "covariance": None}], "friction above 0"),
    ):
        write_scene(scene, effects)
        one_line(capsys, ["plan", scene, *out], "scene.json", "effects", words)
    write_scene(scene, [TILT])
    one_line(capsys, ["plan", scene, "--region", "all-pressure", *out], "--region", "no guarantee is known under the effect tilt")
    assert not (tmp_path / "p.json").exists()


def test_a_steep_slope_has_no_plan(tmp_path, capsys):
    write_scene(tmp_path / "scene.json", [{"effect": "tilt", "parameters": {"slope": [0.4, 0.0]}, "covariance": None}])
    assert main(["plan", str(tmp_path / "scene.json"), "-o", str(tmp_path / "p.json")]) == 1
    assert "does not rest" in capsys.readouterr().out


@pytest.mark.parametrize("alternatives", [False, True])
def test_correct_says_what_plan_will_refuse(tmp_path, capsys, alternatives):
    scene, found = tmp_path / "scene.json", tmp_path / "diagnosis.json"
    write_scene(scene, [])
    entry = sp.Correction(0.6, effects=small_scene(effects=[sp.parse_effect("tilt:slope=0.02/0")]).effects).to_json()
    other = {**sp.Correction(0.4).to_json(), "tracker_offset": [0.004, 0.0]}
    found.write_text(json.dumps({"format": "diagnosis/1", "corrected": [entry, other] if alternatives else [entry]}))
    assert main(["correct", str(scene), str(found), "-o", str(tmp_path / "corrected.json")]) == 0
    told = capsys.readouterr().out
    assert "effects tilt" in told and ("plan will refuse this scene" in told) is alternatives
    code = main(
        ["plan", str(tmp_path / "corrected.json"), "--success", "0", "--refinement-budget", "0", "-o", str(tmp_path / "p.json")]
    )
    assert code == (2 if alternatives else 0)
