"""The program end to end: what it leaves, its exit codes, and one line for every bad input."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import small_scene

import stablepush as sp
from stablepush.cli import main
from stablepush.demo import demo_pokes, demo_slider
from stablepush.files import write_json
from stablepush.formats import contact_to_json, slider_to_json
from stablepush.logs.table import read_table
from stablepush.problem import save_scene


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Files for all commands; tests copy what they break."""
    folder = tmp_path_factory.mktemp("rig with ünicode")
    sp.write_pushlog(demo_pokes(12), folder / "log")
    assert main(["fit", str(folder / "log"), "-o", str(folder / "model.json")]) == 0
    contact = sp.PushContact.on_edge(demo_slider(), 0, 0.16 / 3, 0.05, 0.9)
    write_json(folder / "contact.json", contact_to_json(contact))
    write_json(folder / "slider.json", slider_to_json(demo_slider()))
    (folder / "cors.csv").write_text("name,cor_x,cor_y,sense\nfar,-2,0,1\nnear,0,0.01,1\nright,2,0,-1\n")
    save_scene(small_scene(), folder / "scene.json")
    assert main(["plan", str(folder / "scene.json"), "-o", str(folder / "plan.json")]) == 0
    return folder


def test_fit_writes_a_certified_model(rig, capsys):
    value = json.loads((rig / "model.json").read_text())
    assert value["format"] == "model/1" and value["kind"] == "polynomial" and value["degree"] == 4
    assert value["certificate"]["sos_convex"] is True
    assert value["certificate"]["min_eigenvalue"] > 0
    assert len(value["exponents"]) == len(value["coefficients"]) == 15
    assert {"characteristic_length", "covariance", "provenance"} <= value.keys()


@pytest.mark.parametrize("model", ("poly4", "quadratic", "poly6-cvx"))
def test_other_models_are_fitted(rig, tmp_path, model):
    out = tmp_path / "m.json"
    assert main(["fit", str(rig / "log"), "--model", model, "--no-slider", "--seed", "3", "-o", str(out)]) == 0
    assert sp.load_model(out).provenance["model"] == model


def test_a_gaussian_process_is_fitted_and_classifies(rig, tmp_path, capsys):
    out = tmp_path / "gp.json"
    assert main(["fit", str(rig / "log"), "--model", "gp", "-o", str(out)]) == 0
    assert "no limit surface" in capsys.readouterr().out
    arguments = ["--contact", str(rig / "contact.json"), "--cors", str(rig / "cors.csv"), "-o", str(tmp_path / "o.csv")]
    assert main(["classify", str(out), *arguments]) == 0


@pytest.mark.parametrize("options", (["--loss", "norm"], ["--loss", "published"], ["--com-tolerance", "0.004"]))
def test_fits_in_other_ways(rig, tmp_path, options):
    out = tmp_path / "m.json"
    assert main(["fit", str(rig / "log"), *options, "-o", str(out)]) == 0
    assert sp.load_model(out).certificate["sos_convex"]


@pytest.mark.parametrize(
    ("options", "said"), ((["--loss", "abs"], "'abs'"), (["--com-tolerance", "-1"], "-1"), (["--com-tolerance", "nan"], "nan"))
)
def test_bad_ways_to_fit_are_refused(rig, tmp_path, capsys, options, said):
    assert main(["fit", str(rig / "log"), *options, "-o", str(tmp_path / "m.json")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error


def test_classify_adds_columns(rig, tmp_path):
    out = tmp_path / "out.csv"
    arguments = ["--contact", str(rig / "contact.json"), "--cors", str(rig / "cors.csv"), "-o", str(out)]
    assert main(["classify", str(rig / "model.json"), *arguments]) == 0
    table, _ = read_table(out, required=(), numbers=("cor_x", "cor_y", "sense", "stable", "margin"))
    assert list(table) == ["name", "cor_x", "cor_y", "sense", "stable", "margin", "probability"]
    assert table["name"].tolist() == ["far", "near", "right"]
    assert table["stable"].tolist() == [1, 0, 1]
    assert ((table["margin"] >= 0) == (table["stable"] == 1)).all()
    probability = table["probability"].astype(float)
    assert probability[0] > 0.5 > probability[1]
    oracle = sp.StabilityOracle(sp.load_model(rig / "model.json"), sp.load_contact(rig / "contact.json"))
    expected = oracle.margin([[0.0, 2.0, 1.0]])[0]
    assert table["margin"][0] == pytest.approx(expected)


def test_classify_without_an_ensemble_leaves_the_probability_blank(rig, tmp_path):
    assert main(["fit", str(rig / "log"), "--model", "poly4", "-o", str(tmp_path / "m.json")]) == 0
    arguments = ["--contact", str(rig / "contact.json"), "--cors", str(rig / "cors.csv"), "-o", str(tmp_path / "o.csv")]
    assert main(["classify", str(tmp_path / "m.json"), *arguments]) == 0
    table, _ = read_table(tmp_path / "o.csv", required=(), numbers=("margin",))
    assert set(table["probability"]) == {""}


def test_classify_nothing(rig, tmp_path):
    (tmp_path / "none.csv").write_text("cor_x,cor_y,sense\n")
    arguments = ["--contact", str(rig / "contact.json"), "--cors", str(tmp_path / "none.csv"), "-o", str(tmp_path / "o.csv")]
    assert main(["classify", str(rig / "model.json"), *arguments]) == 0
    assert (tmp_path / "o.csv").read_text() == "cor_x,cor_y,sense,stable,margin,probability\n"


def test_map_leaves_a_picture_and_regions(rig, tmp_path):
    arguments = ["--contact", str(rig / "contact.json"), "--slider", str(rig / "slider.json")]
    outputs = ["-o", str(tmp_path / "map.png"), "--json", str(tmp_path / "regions.json")]
    assert main(["map", str(rig / "model.json"), *arguments, *outputs]) == 0
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    names = [r["name"] for r in json.loads((tmp_path / "regions.json").read_text())["regions"]]
    assert names == ["model", "all-pressure", "conservative"]
    assert main(["map", str(rig / "model.json"), *arguments[:2], "-o", str(tmp_path / "bare.png"), "--extent", "0.3"]) == 0


def test_map_draws_margins_the_sphere_and_a_chance_region(rig, tmp_path, capsys):
    arguments = ["--contact", str(rig / "contact.json"), "--slider", str(rig / "slider.json"), "-o", str(tmp_path / "m.png")]
    more = ["--probability", "0.9", "--margins", str(tmp_path / "margins.png"), "--sphere", str(tmp_path / "sphere.png")]
    more += ["--com-tolerance", "0.002", "--least-mu", "0.7", "--json", str(tmp_path / "r.json")]
    assert main(["map", str(rig / "model.json"), *arguments, *more]) == 0
    for name in ("m.png", "margins.png", "sphere.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert "probability 0.9" in capsys.readouterr().out
    angles = {r["name"]: r["solid_angle"] for r in json.loads((tmp_path / "r.json").read_text())["regions"]}
    assert 0 < angles["all-pressure"] < angles["model"] and angles["probability 0.9"] < angles["model"]


def test_map_of_one_finger_draws_a_curve(rig, tmp_path, capsys):
    write_json(tmp_path / "finger.json", {"points": [[0.0, -0.0533]], "normals": [[0, 1]], "mu": 0.5})
    arguments = ["--contact", str(tmp_path / "finger.json"), "--slider", str(rig / "slider.json"), "-o", str(tmp_path / "m.png")]
    assert main(["map", str(rig / "model.json"), *arguments, "--json", str(tmp_path / "r.json")]) == 0
    model = json.loads((tmp_path / "r.json").read_text())["regions"][0]
    assert model["solid_angle"] == 0 and len(model["curve"]) > 10


def test_contacts_leave_a_table_and_a_picture(rig, tmp_path, capsys):
    arguments = ["--slider", str(rig / "slider.json"), "--mu", "0.5", "--width", "0.03", "--width", "0.06", "--places", "3"]
    outputs = ["-o", str(tmp_path / "c.csv"), "--picture", str(tmp_path / "c.png"), "--measure", "margin", "--edge", "1"]
    assert main(["contacts", str(rig / "model.json"), *arguments, *outputs]) == 0
    table, _ = read_table(tmp_path / "c.csv", required=(), numbers=("edge", "width", "margin", "area", "tightest_left"))
    assert len(table["edge"]) == 6 and set(table["edge"]) == {1.0}
    assert (np.diff(table["margin"]) <= 0).all()
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    assert "best by margin: edge 1" in capsys.readouterr().out


def test_map_of_a_corner_has_no_conservative_region(rig, tmp_path, capsys):
    corner = {"points": [[0.0, -0.0533], [-0.0533, 0.0]], "normals": [[0, 1], [1, 0]], "mu": 0.5}
    write_json(tmp_path / "corner.json", corner)
    arguments = ["--contact", str(tmp_path / "corner.json"), "--slider", str(rig / "slider.json"), "-o", str(tmp_path / "m.png")]
    assert main(["map", str(rig / "model.json"), *arguments]) == 0
    assert "no conservative region" in capsys.readouterr().out


def test_plan_is_checked_and_drawn(rig, tmp_path, capsys):
    outputs = ["-o", str(tmp_path / "p.json"), "--view", str(tmp_path / "v.html"), "--picture", str(tmp_path / "p.png")]
    assert main(["plan", str(rig / "scene.json"), "--planner", "cor-lattice", "--time-limit", "30", *outputs]) == 0
    assert "solved" in capsys.readouterr().out
    assert main(["check", str(rig / "scene.json"), str(tmp_path / "p.json")]) == 0
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "v.html").read_text()
    assert not re.search(r"(src|href)=\"(?!data:)", page), "the page must need nothing else"
    value = json.loads((tmp_path / "p.json").read_text())
    assert value["format"] == "plan/1" and value["status"] == "solved" and value["planner"] == "cor-lattice"
    assert {"seed", "duration", "length", "switches", "min_margin", "lower_bound", "planning_time"} <= value.keys()


def test_plans_are_compared_and_sampled(rig, tmp_path, capsys):
    assert main(["compare", str(rig / "scene.json"), "--improve", "0", "--csv", str(tmp_path / "c.csv")]) == 0
    out = capsys.readouterr().out
    rows = [line.split(",") for line in (tmp_path / "c.csv").read_text().splitlines()]
    assert rows[0][:3] == ["scene", "region", "status"]
    assert [row[1] for row in rows[1:]] == ["model", "all-pressure", "conservative"]
    for row in rows[1:]:
        assert row[1] in out
        assert row[2] in ("solved", "no-path")
        assert row[1] == "model" or row[2] != "solved" or float(row[7]) == 1
    arguments = [str(rig / "scene.json"), str(tmp_path / "p.json")]
    assert main(["plan", *arguments[:1], "--improve", "0", "--margin-weight", "1", "-o", arguments[1]]) == 0
    assert main(["trajectory", *arguments, "--rate", "10", "--acceleration", "0.1", "-o", str(tmp_path / "t.csv")]) == 0
    assert (tmp_path / "t.csv").read_text().startswith("t,segment,contact,x,y,theta,px,py,ptheta\n")
    for bad in (["--rate", "0"], ["--rate", "nan"], ["--acceleration", "-1"]):
        capsys.readouterr()
        assert main(["trajectory", *arguments, *bad, "-o", str(tmp_path / "none.csv")]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    for bad in (["--probability", "2"], ["--margin-weight", "-1"], ["--improve", "nan"], ["--improve", "-1"]):
        assert main(["plan", *arguments[:1], *bad, "-o", str(tmp_path / "none.json")]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.glob("none.*"))


def test_simulate_leaves_a_log_that_reads_back(rig, tmp_path, capsys):
    out = tmp_path / "log"
    arguments = ["simulate", str(rig / "scene.json"), str(rig / "plan.json")]
    assert main([*arguments, "-o", str(out)]) == 0
    assert "stuck all the way" in capsys.readouterr().out
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
    one_line(capsys, [*arguments, "-o", str(out)], "--mu", "scaled.json")
    assert main([*arguments, "--mu", "0.3", "-o", str(out)]) == 0


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


def test_models_may_be_paths_relative_to_the_scene(rig, tmp_path):
    scene = json.loads((rig / "scene.json").read_text())
    write_json(tmp_path / "deep" / "m.json", scene["model"])
    scene["model"] = "deep/m.json"
    write_json(tmp_path / "scene.json", scene)
    assert main(["check", str(tmp_path / "scene.json"), str(rig / "plan.json")]) == 0


def test_demo_leaves_the_whole_chain(tmp_path, capsys):
    assert main(["demo", "-o", str(tmp_path / "demo")]) == 0
    names = {p.name for p in (tmp_path / "demo").iterdir()}
    assert {"plan.json", "report.html", "map.png", "plan.png", "plan.html", "model.json", "scene.json", "pokes"} <= names
    assert main(["check", str(tmp_path / "demo" / "scene.json"), str(tmp_path / "demo" / "plan.json")]) == 0


def test_import_one_and_all(lab, tmp_path, capsys):
    source = lab / "raw/SlidingExpCode/FusionMatlab/RandPushExp/SensorLogs/wood_patch"
    assert main(["import", str(source), "--kind", "mlab-poke", "-o", str(tmp_path / "one")]) == 0
    assert len(sp.read_pushlog(tmp_path / "one")) == 50
    assert main(["import", str(lab / "raw"), "-o", str(tmp_path / "all")]) == 0
    assert {"wood_patch", "board_30_90_30_30_30_90", "poster_patch_stable"} <= {p.name for p in (tmp_path / "all").iterdir()}
    assert "50 pairs, 50 with F·V > 0" in capsys.readouterr().out


def one_line(capsys, arguments, *words):
    """The command exits with 2 and one line on standard error that holds the words."""
    code = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    assert code == 2, captured
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith("stablepush: error: ")
    for word in words:
        assert str(word) in captured.err, captured.err


COMMANDS = {
    "fit": ["fit", "{log}", "-o", "{out}"],
    "classify": ["classify", "{model}", "--contact", "{contact}", "--cors", "{cors}", "-o", "{out}"],
    "map": ["map", "{model}", "--contact", "{contact}", "--slider", "{slider}", "-o", "{out}"],
    "contacts": ["contacts", "{model}", "--slider", "{slider}", "--mu", "0.5", "-o", "{out}"],
    "plan": ["plan", "{scene}", "-o", "{out}"],
    "check": ["check", "{scene}", "{plan}"],
    "simulate": ["simulate", "{scene}", "{plan}", "-o", "{out}"],
    "slide": ["slide", "{model}", "--slider", "{slider}", "--twist", "0.3", "-0.1", "2", "-o", "{out}"],
}
FILES = {
    "log": "log",
    "model": "model.json",
    "contact": "contact.json",
    "cors": "cors.csv",
    "slider": "slider.json",
    "scene": "scene.json",
    "plan": "plan.json",
}


def fill(command, rig, out, **replaced):
    places = {name: rig / file for name, file in FILES.items()} | {"out": out} | replaced
    return [part.format(**places) for part in COMMANDS[command]]


@pytest.mark.parametrize(("command", "file"), [(c, f) for c, parts in COMMANDS.items() for f in FILES if f"{{{f}}}" in parts])
@pytest.mark.parametrize("kind", ("missing", "empty", "garbage", "folder"))
def test_every_input_of_every_command(rig, tmp_path, capsys, command, file, kind):
    bad = tmp_path / "bad.json"
    if kind == "empty":
        bad.write_text("")
    elif kind == "garbage":
        bad.write_bytes(b"\xff\x00{]")
    elif kind == "folder":
        bad.mkdir()
    out = tmp_path / "out"
    one_line(capsys, fill(command, rig, out, **{file: bad}), bad)
    assert not out.exists()
    assert sorted(p.name for p in tmp_path.iterdir()) in (["bad.json"], [])


JSON_FAULTS = [
    ("model", lambda v: v.update(format="model/2"), "format"),
    ("model", lambda v: v.pop("coefficients"), "coefficients: missing key"),
    ("model", lambda v: v["coefficients"].pop(), "coefficients"),
    ("model", lambda v: v["coefficients"].__setitem__(0, float("nan")), "coefficients[0]"),
    ("model", lambda v: v.update(characteristic_length=float("inf")), "characteristic_length"),
    ("model", lambda v: v["exponents"].__setitem__(0, [4, 1, 0]), "exponents[0]"),
    ("model", lambda v: v["exponents"].__setitem__(1, [4, 0, 0]), "exponents[1]"),
    ("model", lambda v: v.update(degree=3), "degree"),
    ("model", lambda v: v.update(kind="magic"), "kind"),
    ("model", lambda v: v.update(covariance=[[1]]), "covariance"),
    ("contact", lambda v: v.update(mu=-0.5), "mu"),
    ("contact", lambda v: v.update(points=v["points"][:1] * 2), "equal"),
    ("contact", lambda v: v.update(normals=[[0, 0], [0, 1]]), "normals"),
    ("contact", lambda v: v.update(points=[], normals=[]), "points"),
    ("contact", lambda v: v.update(points="here"), "points"),
    ("slider", lambda v: v["vertices"].reverse(), "clockwise"),
    ("slider", lambda v: v.update(vertices=[[0, 0], [1, 1], [1, 0], [0, 1]]), "cross"),
    ("slider", lambda v: v.update(mass=-1), "mass"),
    ("slider", lambda v: v["vertices"][0].append(0), "vertices[0]"),
    ("scene", lambda v: v.update(contacts=[]), "contacts"),
    ("scene", lambda v: v.update(speed=0), "speed"),
    ("scene", lambda v: v.update(bounds=[1, 0, 0, 1]), "bounds"),
    ("scene", lambda v: v.update(start=[0, 0]), "start"),
    ("scene", lambda v: v.update(goal=[0, 0, "north"]), "goal[2]"),
    ("scene", lambda v: v["contacts"][0].update(mu=-1), "contacts[0].mu"),
    ("scene", lambda v: v["slider"]["vertices"].reverse(), "slider.vertices"),
    ("scene", lambda v: v.update(model="nowhere.json"), "nowhere.json"),
    ("scene", lambda v: v.update(model=7), "model"),
    ("scene", lambda v: v.update(obstacles=[[[0, 0], [1, 0]]]), "obstacles[0]"),
    ("scene", lambda v: v["pusher"].update(outline=[[0, 0], [1, 1], [1, 0], [0, 1]]), "pusher.outline"),
    ("scene", lambda v: v.pop("pusher"), "pusher: missing key"),
    ("scene", lambda v: v.update(start=[2e6, 0, 0]), "start"),
    ("scene", lambda v: v.update(switch_cost=True), "switch_cost"),
    ("plan", lambda v: v.update(format="plan/0"), "format"),
    ("plan", lambda v: v["segments"][0].pop("twist"), "segments[0].twist"),
    ("plan", lambda v: v["segments"][0].update(kind="kick"), "segments[0].kind"),
    ("plan", lambda v: v["segments"][0].update(contact=0.5), "segments[0].contact"),
    ("plan", lambda v: v.update(duration="long"), "duration"),
    ("plan", lambda v: v.update(switches=10**400), "switches"),
    ("scene", lambda v: v.update(speed=10**400), "speed"),
    ("scene", lambda v: v["slider"].pop("mass"), "slider.mass: missing key"),
    ("slider", lambda v: v.pop("support"), "support: missing key"),
    ("model", lambda v: v.pop("certificate"), "certificate: missing key"),
]


@pytest.mark.parametrize(("file", "change", "place"), JSON_FAULTS)
def test_faults_in_json_are_named(rig, tmp_path, capsys, file, change, place):
    value = json.loads((rig / FILES[file]).read_text())
    change(value)
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps(value))
    command = {"model": "classify", "contact": "classify", "slider": "map", "scene": "plan", "plan": "check"}[file]
    out = tmp_path / "out"
    words = [place] if place == "nowhere.json" else [bad, place]
    one_line(capsys, fill(command, rig, out, **{file: bad}), *words)
    assert not out.exists()


def test_where_json_does_not_parse(rig, tmp_path, capsys):
    bad = tmp_path / "bad.json"
    bad.write_text('{"format": "model/1",\n "kind": oops}')
    one_line(capsys, fill("map", rig, tmp_path / "out", model=bad), bad, "line 2 column 10")
    bad.write_text("[" * 100_000)
    one_line(capsys, fill("map", rig, tmp_path / "out", model=bad), bad, "nesting")
    bad.write_text('{"format": "model/1", "kind": "support", "kind": "polynomial"}')
    one_line(capsys, fill("map", rig, tmp_path / "out", model=bad), bad, "kind", "twice")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cor_x,cor_y\n1,2\n", ("column sense", "missing column")),
        ("cor_x,cor_y,sense\n1,2,1\n1,2\n", ("line 3",)),
        ("cor_x,cor_y,sense\n1,up,1\n", ("line 2", "column cor_y", "up")),
        ("cor_x,cor_y,sense\n1,,1\n", ("line 2", "column cor_y")),
        ("cor_x,cor_y,sense\n1,2,0\n", ("line 2", "column sense", "1 or -1")),
        ("cor_x,cor_y,sense\n1,inf,1\n", ("line 2", "column cor_y")),
        ("cor_x,cor_y,sense\n1,1e7,1\n", ("line 2", "column cor_y")),
        ("cor_x,cor_x,sense\n", ("cor_x", "twice")),
    ],
)
def test_faults_in_cors_are_named(rig, tmp_path, capsys, text, words):
    bad = tmp_path / "bad.csv"
    bad.write_text(text)
    one_line(capsys, fill("classify", rig, tmp_path / "out", cors=bad), bad, *words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plan", "{scene}", "-o", "{out}", "--planner", "teleport"], ("teleport", "cor-lattice")),
        (["plan", "{scene}", "-o", "{out}", "--time-limit", "nan"], ("nan",)),
        (["plan", "{scene}", "-o", "{out}", "--time-limit", "-3"], ("-3",)),
        (["plan", "{scene}", "-o", "{out}", "--time-limit", "soon"], ("soon",)),
        (["plan", "{scene}", "-o", "{out}", "--seed", "-1"], ("-1",)),
        (["plan", "{scene}", "-o", "{out}", "--seed", "x"], ("x",)),
        (["plan", "{scene}", "-o", "{out}", "--fast"], ("--fast",)),
        (["plan", "{scene}"], ("output",)),
        (["plan"], ("argument",)),
        (["fit", "{log}", "-o", "{out}", "--model", "poly5"], ("poly5",)),
        (["map", "{model}", "--contact", "{contact}", "-o", "{out}", "--extent", "nan"], ("nan",)),
        (["map", "{model}", "--contact", "{contact}", "-o", "{out}", "--probability", "1.5"], ("--probability", "1.5")),
        (["map", "{model}", "--contact", "{contact}", "-o", "{out}", "--least-mu", "0.1"], ("--slider",)),
        (["map", "{model}", "--contact", "{contact}", "-o", "{out}", "--com-tolerance", "-1"], ("--com-tolerance", "-1")),
        (
            ["map", "{model}", "--contact", "{contact}", "-o", "{out}", "--slider", "{slider}", "--com-tolerance", "0.5"],
            ("inside",),
        ),
        (["contacts", "{model}", "--slider", "{slider}", "--mu", "nan", "-o", "{out}"], ("--mu", "nan")),
        (["contacts", "{model}", "--slider", "{slider}", "--mu", "1", "--edge", "7", "-o", "{out}"], ("--edge", "7")),
        (["contacts", "{model}", "--slider", "{slider}", "--mu", "1", "--width", "9", "-o", "{out}"], ("fit on an edge",)),
        (["contacts", "{model}", "--slider", "{slider}", "--mu", "1", "--measure", "luck", "-o", "{out}"], ("luck",)),
        (["import", "{scene}", "-o", "{out}", "--kind", "other"], ("other",)),
        (["import", "{log}", "-o", "{out}"], ("mlab-poke",)),
        (["import", "/nowhere", "-o", "{out}"], ("/nowhere",)),
        (["plan", "{scene}", "-o", "{out}", "--view", "{out}"], ("twice",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "drift:rate=a"], ("drift", "'a'")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "magic:x=1"], ("magic", "drift")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "tilt:slope=1"], ("tilt", "slope", "2")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--noise", "0.1", "-1", "0"], ("--noise", "-1")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--finger-radius", "nan"], ("--finger-radius", "nan")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--rows", "0"], ("--rows", "0")),
        (["slide", "{model}", "--slider", "{slider}", "--twist", "1", "x", "1", "-o", "{out}"], ("x",)),
        (["slide", "{model}", "--slider", "{slider}", "--twist", "1", "nan", "1", "-o", "{out}"], ("--twist", "nan")),
        (["slide", "{model}", "--slider", "{slider}", "--twist", "1", "0", "1", "-o", "{out}", "--mu", "-1"], ("--mu", "-1")),
        (
            ["slide", "{model}", "--slider", "{slider}", "--twist", "1", "0", "1", "-o", "{out}", "--duration", "0"],
            ("--duration",),
        ),
        (["juggle"], ("juggle",)),
        (["--loud"], ("--loud",)),
    ],
)
def test_bad_arguments_are_quoted(rig, tmp_path, capsys, arguments, words):
    places = {name: rig / file for name, file in FILES.items()} | {"out": tmp_path / "out"}
    one_line(capsys, [a.format(**places) for a in arguments], *words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ("fit", "classify", "map", "contacts", "plan", "slide"))
def test_outputs_that_cannot_be_written(rig, tmp_path, capsys, command):
    (tmp_path / "file").write_text("")
    one_line(capsys, fill(command, rig, tmp_path / "file" / "out"), tmp_path / "file")
    one_line(capsys, fill(command, rig, tmp_path), tmp_path)
    one_line(capsys, fill(command, rig, "/dev/full"), "/dev/full")


def test_words_that_the_terminal_cannot_show(rig, tmp_path):
    plan = json.loads((rig / "plan.json").read_text())
    plan["status"] = "\ud800 F·V"
    write_json(tmp_path / "odd.json", plan)
    run = subprocess.run(
        [sys.executable, "-m", "stablepush", "check", str(rig / "scene.json"), str(tmp_path / "odd.json")],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        check=False,
    )
    assert run.returncode == 1
    assert run.stderr == b""


def test_help_and_version(capsys):
    assert main([]) == 0
    assert "plan" in capsys.readouterr().out
    for command in ("demo", "import", "fit", "classify", "map", "contacts", "plan", "check"):
        assert main([command, "--help"]) == 0
        assert "Usage: stablepush" in capsys.readouterr().out
    assert main(["--version"]) == 0
    assert sp.__version__ in capsys.readouterr().out


def test_help_imports_nothing_heavy():
    """Start-up stays short because of what is not imported."""
    code = "import sys, stablepush.cli as c; c.main(['plan', '--help']); print(sorted(sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    for heavy in ("numpy", "scipy", "cvxpy", "matplotlib", "shapely", "numba"):
        assert f"'{heavy}'" not in out


def test_planning_needs_no_solver_and_no_plots():
    """The first plan on a fresh install must answer within its limit: nothing slow to import may creep in."""
    code = "import sys, stablepush.planning, stablepush_planners; print(sorted(sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    for heavy in ("scipy.optimize", "scipy.sparse", "cvxpy", "matplotlib", "networkx"):
        assert f"'{heavy}'" not in out


def test_the_program_as_a_process(rig, tmp_path):
    run = subprocess.run(
        [sys.executable, "-m", "stablepush", "classify", str(rig / "nothing.json"), "--contact", "c", "--cors", "d", "-o", "e"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1 and "nothing.json" in run.stderr


def test_pictures_are_the_same_for_the_same_plan():
    from stablepush.plot import figure_png, plot_plan

    problem = small_scene()
    result = sp.plan(problem, time_limit=30)
    assert figure_png(plot_plan(problem, result)) == figure_png(plot_plan(problem, result))
