"""Files that name others, plans of other scenes, diagnoses of other objects: the program says whose fault it is."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import one_line

import stablepush as sp
from stablepush.cli import main
from stablepush.io import write_json


@pytest.fixture
def scene(rig):
    return json.loads((rig / "scene.json").read_text())


@pytest.mark.parametrize(
    ("key", "place", "text", "words"),
    (
        ("slider", "slider", None, "cannot read"),
        ("slider", "slider", '{"format": "slider/1", "vertices": [[0, 0], [1, 0]], "mass": 1, "support": null}', "vertices"),
        ("model", "model", "{", "line 1 column 2"),
        ("contacts", "contacts[0]", '{"points": [[0, 0]], "normals": [[0, 1]], "mu": "high"}', "mu: expected a number"),
    ),
)
def test_who_named_a_bad_file_is_told(scene, tmp_path, capsys, key, place, text, words):
    if text is not None:
        (tmp_path / "named.json").write_text(text)
    scene[key] = "named.json" if key != "contacts" else ["named.json"]
    write_json(tmp_path / "scene.json", scene)
    named = tmp_path / "named.json"
    one_line(capsys, ["plan", tmp_path / "scene.json", "-o", tmp_path / "p.json"], f"scene.json: {place}: {named}: ", words)


@pytest.mark.parametrize("key", ("slider", "model"))
def test_an_empty_path_is_no_folder(scene, tmp_path, capsys, key):
    scene[key] = ""
    write_json(tmp_path / "scene.json", scene)
    one_line(
        capsys, ["plan", tmp_path / "scene.json", "-o", tmp_path / "p.json"], f"scene.json: {key}: expected an object", 'got ""'
    )


def test_normals_point_into_the_slider(scene, tmp_path, capsys):
    contact = scene["contacts"][0]
    contact["normals"] = (-np.array(contact["normals"])).tolist()
    write_json(tmp_path / "scene.json", scene)
    one_line(
        capsys, ["plan", tmp_path / "scene.json", "-o", tmp_path / "p.json"], "contacts[0].normals[0]: expected a normal that"
    )
    contact["normals"] = (-np.array(contact["normals"])).tolist()
    contact["points"] = np.add(contact["points"], (0.0, 0.01)).tolist()
    with pytest.warns(sp.StablepushWarning, match=r"contacts\[0\].points: a contact point 10 mm from the slider's outline"):
        write_json(tmp_path / "scene.json", scene)
        sp.load_scene(tmp_path / "scene.json")


@pytest.mark.parametrize("command", ("trajectory", "view", "export"))
def test_a_plan_that_the_scene_does_not_allow_is_noted(rig, scene, tmp_path, capsys, command):
    plan = json.loads((rig / "plan.json").read_text())
    x, y, _ = plan["segments"][len(plan["segments"]) // 2]["start"]
    scene["obstacles"].append([[x - 0.01, y - 0.01], [x + 0.01, y - 0.01], [x + 0.01, y + 0.01], [x - 0.01, y + 0.01]])
    scene["finger_radius"] = 0.002
    write_json(tmp_path / "scene.json", scene)
    assert main(["check", str(tmp_path / "scene.json"), str(rig / "plan.json")]) == 1
    capsys.readouterr()
    output = ["--mjcf" if command == "export" else "-o", tmp_path / "out"]
    assert main([str(a) for a in (command, tmp_path / "scene.json", rig / "plan.json", *output)]) == 0
    assert "note: the plan does not pass the check of this scene: " in capsys.readouterr().err


def test_a_diagnosis_of_another_object_corrects_nothing(scene, tmp_path, capsys):
    slider = sp.Slider.rectangle(0.1, 0.06, mass=1.0)
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0), 0.5,
                        sp.Pusher.finger(0.005), [], sp.Noise(0.02, 1e-4, 1e-3))  # fmt: skip
    report = sp.diagnose(rig.execute(sp.random_pushes(slider, rig.pusher, 8, seed=2), seed=2).log)
    write_json(tmp_path / "diagnosis.json", report.to_json())
    write_json(tmp_path / "scene.json", scene)
    one_line(
        capsys,
        ["correct", tmp_path / "scene.json", tmp_path / "diagnosis.json", "-o", tmp_path / "two.json"],
        "expected a diagnosis of the scene's slider",
    )
    with pytest.raises(sp.InputError, match="expected a diagnosis of the scene"):
        sp.correct(sp.load_scene(tmp_path / "scene.json"), report)


def test_a_box_of_the_centre_of_mass_that_leaves_the_outline(rig, tmp_path, capsys):
    for source in ([rig / "log"], ["--slider", rig / "slider.json"]):
        given = ["fit", *source, "--com-tolerance", "5", "-o", tmp_path / "m.json"]
        one_line(capsys, given, "--com-tolerance: expected a box inside")


def test_where_the_slider_goes_into_an_obstacle_is_told(rig, scene, tmp_path, capsys):
    plan = json.loads((rig / "plan.json").read_text())
    x, y, _ = plan["segments"][-1]["end"]
    scene["obstacles"] = [[[x - 0.01, y - 0.01], [x + 0.01, y - 0.01], [x + 0.01, y + 0.01], [x - 0.01, y + 0.01]]]
    for name, obstacles in (("hit", scene["obstacles"]), ("free", [])):
        write_json(tmp_path / "scene.json", scene | {"obstacles": obstacles})
        assert main(["simulate", str(tmp_path / "scene.json"), str(rig / "plan.json"), "-o", str(tmp_path / name)]) == 0
        assert ("the slider goes into an obstacle in push" in capsys.readouterr().err) == (name == "hit")


def test_options_of_the_program_after_the_command(capsys):
    one_line(capsys, ["check", "--quiet", "a.json", "b.json"], "--quiet: it comes before the command")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is full")
def test_standard_output_that_is_full_is_no_traceback():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "stablepush", "effects"], check=False, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2 and done.stderr.startswith("stablepush: error: cannot write") and done.stderr.count("\n") == 1
