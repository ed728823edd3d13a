"""Commands that plan, check, compare, sample and simulate, through the command line."""

import json
import re

import numpy as np
import pytest
from conftest import one_line

import stablepush as sp
from stablepush.cli import main
from stablepush.io import write_json
from stablepush.io.tables import read_table


def test_plan_is_checked_and_drawn(rig, tmp_path, capsys):
    outputs = ["-o", str(tmp_path / "p.json"), "--view", str(tmp_path / "v.html"), "--picture", str(tmp_path / "p.png")]
    assert main(["plan", str(rig / "scene.json"), "--planner", "cor-lattice", "--time-limit", "30", *outputs]) == 0
    out = capsys.readouterr().out
    # the goal's tolerance of the rig's scene
    away, turned = map(float, re.search(r"it ends ([\d.]+) mm and ([\d.]+) deg from the goal", out).groups())
    problem, result = sp.load_scene(rig / "scene.json"), sp.load_plan(tmp_path / "p.json")
    near, square = problem.tolerance[0], problem.tolerance[1]
    assert "solved" in out and 0 <= away <= 1000 * near + 0.05 and turned <= np.degrees(square) + 0.05
    end = result.pushes[-1].end
    assert result.from_goal(np.add(end, (0.003, 0.004, 0.1))) == pytest.approx((0.005, 0.1))
    assert main(["check", str(rig / "scene.json"), str(tmp_path / "p.json")]) == 0
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "v.html").read_text()
    assert not re.search(r"(src|href)=\"(?!data:)", page), "the page must need nothing else"
    value = json.loads((tmp_path / "p.json").read_text())
    assert value["format"] == "plan/1" and value["status"] == "solved" and value["planner"] == "cor-lattice"
    assert {"seed", "duration", "length", "switches", "min_margin", "lower_bound", "planning_time"} <= value.keys()


def test_plans_are_compared_and_sampled(rig, tmp_path, capsys):
    assert main(["compare", str(rig / "scene.json"), "--refinement-budget", "0", "--csv", str(tmp_path / "c.csv")]) == 0
    out = capsys.readouterr().out
    rows = [line.split(",") for line in (tmp_path / "c.csv").read_text().splitlines()]
    assert rows[0][:3] == ["scene", "region", "status"]
    assert [row[1] for row in rows[1:]] == ["model", "all-pressure", "conservative"]
    for row in rows[1:]:
        assert row[1] in out
        assert row[2] in ("solved", "no-path")
        assert row[1] == "model" or row[2] != "solved" or float(row[7]) == 1
    arguments = [str(rig / "scene.json"), str(tmp_path / "p.json")]
    assert main(["plan", *arguments[:1], "--refinement-budget", "0", "--margin-weight", "1", "-o", arguments[1]]) == 0
    assert main(["trajectory", *arguments, "--rate", "10", "--acceleration", "0.1", "-o", str(tmp_path / "t.csv")]) == 0
    assert (tmp_path / "t.csv").read_text().startswith("t,x,y,theta,px,py,ptheta,pvx,pvy,pomega,phase,segment,contact\n")
    assert "the plan takes" in capsys.readouterr().out
    tool = ["--height", "0.01", "--tool", "0", "0", "0.1", "1", "0", "0", "0"]
    assert main(["trajectory", *arguments, "--jerk", "inf", "--speed", "0.01", *tool, "-o", str(tmp_path / "t.csv")]) == 0
    assert (tmp_path / "t.csv").read_text().splitlines()[0].endswith(",contact,tx,ty,tz,qx,qy,qz,qw")
    for bad in (
        ["--rate", "0"],
        ["--rate", "nan"],
        ["--acceleration", "-1"],
        ["--jerk", "0"],
        ["--standoff", "-1"],
        ["--tool", "0", "0", "0", "0", "0", "0", "x"],
        ["--tool", "0", "0", "0", "0", "0", "0", "0"],
    ):
        capsys.readouterr()
        assert main(["trajectory", *arguments, *bad, "-o", str(tmp_path / "none.csv")]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    for bad in (["--probability", "2"], ["--margin-weight", "-1"], ["--refinement-budget", "nan"], ["--improve", "-1"]):
        assert main(["plan", *arguments[:1], *bad, "-o", str(tmp_path / "none.json")]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.glob("none.*"))


def test_simulate_leaves_a_log_that_reads_back(rig, tmp_path, capsys):
    out = tmp_path / "log"
    arguments = ["simulate", str(rig / "scene.json"), str(rig / "plan.json")]
    assert main([*arguments, "-o", str(out)]) == 0
    assert "sticking throughout" in capsys.readouterr().out
    plan = sp.load_plan(rig / "plan.json")
    log = sp.read_pushlog(out)
    assert len(log) == len(plan.pushes)
    end = plan.pushes[-1].end
    last = log.rows(str(len(plan.pushes)))[-1]
    # the last row is the mean over the last part of the last push
    assert np.hypot(log.samples["x"][last] - end[0], log.samples["y"][last] - end[1]) < 0.1
    changed = ["--effect", "drift:rate=-0.2", "--effect", "tilt:slope=0.01/0", "--noise", "0.03", "1e-4", "2e-3", "--seed", "4"]
    assert main([*arguments, *changed, "-o", str(out)]) == 0
    again = sp.read_pushlog(out)
    assert again.rig.noise == sp.Noise(0.03, 1e-4, 2e-3)
    assert not np.array_equal(again.samples["fx"], log.samples["fx"])
    unsolved = json.loads((rig / "plan.json").read_text()) | {"status": "no-path", "segments": []}
    write_json(tmp_path / "none.json", unsolved)
    capsys.readouterr()
    one_line(capsys, [*arguments[:2], str(tmp_path / "none.json"), "-o", str(out)], "none.json", "no-path")


def test_lists_of_pushes_are_simulated_and_shown(rig, tmp_path, capsys):
    pokes = "edge,along,direction,way,speed,x,y,theta,group\n0,0.05,0.2,0.03,0.02,0.3,0.7,1,a\n2,0.04,,,,,,,\n"
    (tmp_path / "pokes.csv").write_text(pokes)
    out, page = tmp_path / "log", tmp_path / "page.html"
    arguments = ["simulate", str(rig / "scene.json")]
    assert main([*arguments, str(tmp_path / "pokes.csv"), "-o", str(out), "--view", str(page)]) == 0
    assert "2 pushes" in capsys.readouterr().out
    log = sp.read_pushlog(out)
    assert log.rig.contact_kind == "point"
    assert list(log.trials["group"]) == ["a", ""]
    np.testing.assert_allclose(log.trials["speed"], (0.02, sp.load_scene(rig / "scene.json").speed))
    rest = log.samples["phase"] == "rest"
    np.testing.assert_allclose([log.samples[n][rest] for n in ("x", "y", "theta")], np.transpose([(0.3, 0.7, 1), (0.2, 0.2, 0)]))
    assert "push 1 of" not in page.read_text(encoding="utf-8") and '"pushes": 2' in page.read_text(encoding="utf-8")
    (tmp_path / "turns.CSV").write_text("cor_x,cor_y,sense,angle,contact\n-1.0,0.0,1,0.3,0\n0.01,-0.02,-1,0.3,0\n")
    assert main([*arguments, str(tmp_path / "turns.CSV"), "-o", str(out)]) == 0
    assert "1 of 2 sticking throughout" in capsys.readouterr().out
    log = sp.read_pushlog(out)
    assert log.rig.contact_kind == "two-point"
    assert list(log.trials["stable"]) == [1, 0]
    np.testing.assert_allclose(log.trials["angle"], (0.3, -0.3))
    np.testing.assert_allclose(log.trials["cor_x"], (-1.0, 0.01), atol=1e-12)


def test_simulating_a_plan_that_does_not_pass_the_check_says_so(rig, tmp_path, capsys):
    plan = json.loads((rig / "plan.json").read_text())
    write_json(tmp_path / "plan.json", {**plan, "length": plan["length"] + 1})
    assert main(["simulate", str(rig / "scene.json"), str(tmp_path / "plan.json"), "-o", str(tmp_path / "log")]) == 0
    assert "does not pass the check" in capsys.readouterr().err


def test_slide_leaves_a_table_and_a_picture(rig, tmp_path, capsys):
    out = tmp_path / "slide.csv"
    arguments = ["slide", str(rig / "model.json"), "--slider", str(rig / "slider.json"), "--twist", "0.4", "-0.1", "-3"]
    assert main([*arguments, "-o", str(out), "--picture", str(tmp_path / "slide.png")]) == 0
    assert "at rest after" in capsys.readouterr().out
    names = ("t", "x", "y", "theta", "vx", "vy", "omega")
    table, _ = read_table(out, required=names, numbers=names)
    assert tuple(table) == names
    assert (tmp_path / "slide.png").read_bytes().startswith(b"\x89PNG")
    rows = np.stack([table[name] for name in names], axis=-1)
    np.testing.assert_array_equal(rows[0], (0, 0, 0, 0, 0.4, -0.1, -3))
    np.testing.assert_array_equal(rows[-1, 4:], 0)
    # forces in units of mu*N need a friction
    scaled = json.loads((rig / "model.json").read_text()) | {"force_unit": "mu*N"}
    write_json(tmp_path / "scaled.json", scaled)
    arguments[1] = str(tmp_path / "scaled.json")
    one_line(capsys, [*arguments, "-o", str(out)], "--support-mu", "mu*N")
    assert main([*arguments, "--support-mu", "0.3", "-o", str(out)]) == 0


def test_negative_answers_exit_with_one(rig, tmp_path, capsys):
    scene = json.loads((rig / "scene.json").read_text())
    scene["obstacles"] = [[[0.4, -0.1], [0.5, -0.1], [0.5, 1.1], [0.4, 1.1]]]
    write_json(tmp_path / "walled.json", scene)
    assert main(["plan", str(tmp_path / "walled.json"), "-o", str(tmp_path / "p.json")]) == 1
    assert json.loads((tmp_path / "p.json").read_text())["status"] == "no-path"
    assert main(["check", str(tmp_path / "walled.json"), str(tmp_path / "p.json")]) == 1
    assert main(["plan", str(rig / "scene.json"), "--time-limit", "0", "-o", str(tmp_path / "late.json")]) == 1
    assert json.loads((tmp_path / "late.json").read_text())["status"] == "timeout"
    capsys.readouterr()
    plan = json.loads((rig / "plan.json").read_text())
    plan["duration"] += 1
    write_json(tmp_path / "wrong.json", plan)
    assert main(["check", str(rig / "scene.json"), str(tmp_path / "wrong.json")]) == 1
    assert "duration" in capsys.readouterr().out


def test_models_sliders_and_contacts_may_be_paths_relative_to_the_scene(rig, tmp_path, capsys):
    scene = json.loads((rig / "scene.json").read_text())
    for key in ("model", "slider"):
        write_json(tmp_path / "deep" / f"{key}.json", scene[key])
        scene[key] = f"deep/{key}.json"
    for number, contact in enumerate(scene["contacts"]):
        write_json(tmp_path / f"c{number}.json", contact)
    scene["contacts"] = [f"c{number}.json" for number in range(len(scene["contacts"]))]
    write_json(tmp_path / "scene.json", scene)
    assert main(["check", str(tmp_path / "scene.json"), str(rig / "plan.json")]) == 0
    assert sp.load_slider(tmp_path / "scene.json").mass == sp.load_slider(rig / "scene.json").mass
    # an error names the file that it is in; a scene is no slider, of another or of itself
    write_json(tmp_path / "c0.json", {"points": [[0, 0]], "normals": [[0, 1]]})
    write_json(tmp_path / "round.json", {**scene, "slider": "round.json"})
    capsys.readouterr()
    for scene_file, words in (("scene.json", "c0.json: mu: missing key"), ("round.json", "round.json: format: expected")):
        assert main(["check", str(tmp_path / scene_file), str(rig / "plan.json")]) == 2
        assert words in capsys.readouterr().err


def test_a_plan_for_other_margins_is_carried_out_and_that_is_said(rig, tmp_path, capsys):
    """As of a corrected scene, whose fingers have less friction: its pushes hold here with more."""
    plan = json.loads((rig / "plan.json").read_text())
    for segment in plan["segments"]:
        segment["margin"] -= 0.01
    plan["min_margin"] -= 0.01
    write_json(tmp_path / "plan.json", plan)
    assert main(["check", str(rig / "scene.json"), str(tmp_path / "plan.json")]) == 1
    capsys.readouterr()
    assert main(["simulate", str(rig / "scene.json"), str(tmp_path / "plan.json"), "-o", str(tmp_path / "log")]) == 0
    assert "made for another scene, where its pushes have other margins; they are stable here, too" in capsys.readouterr().err
