"""One line for every bad input of the program."""

import json
import os
import subprocess
import sys

import pytest
from conftest import one_line

from stablepush.io import write_json

COMMANDS = {
    "fit": ["fit", "{log}", "-o", "{out}"],
    "classify": ["classify", "{model}", "--contact", "{contact}", "--cors", "{cors}", "-o", "{out}"],
    "map": ["map", "{model}", "--contact", "{contact}", "--slider", "{slider}", "-o", "{out}"],
    "contacts": ["contacts", "{model}", "--slider", "{slider}", "--contact-mu", "0.5", "-o", "{out}"],
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
    ("model", lambda v: v.update(coefficients=[1e-300 * c for c in v["coefficients"]]), "coefficients"),
    ("model", lambda v: v["ensemble"].__setitem__(2, [1e-90 * c for c in v["ensemble"][2]]), "ensemble: row 2"),
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
    ("slider", lambda v: v.update(mass=1e-160), "mass"),
    ("slider", lambda v: v.update(vertices=[[0, 0], [1e-90, 0], [0, 1e-90]]), "area"),
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
    (
        "scene",
        lambda v: [v.pop(k) for k in ("speed", "min_margin", "goal")],
        "goal: missing key; also missing: speed, min_margin",
    ),
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
        (["contacts", "{model}", "--slider", "{slider}", "--contact-mu", "nan", "-o", "{out}"], ("--contact-mu", "nan")),
        (["contacts", "{model}", "--slider", "{slider}", "--contact-mu", "1", "--edge", "7", "-o", "{out}"], ("--edge", "7")),
        (
            ["contacts", "{model}", "--slider", "{slider}", "--contact-mu", "1", "--width", "9", "-o", "{out}"],
            ("fit on an edge",),
        ),
        (["contacts", "{model}", "--slider", "{slider}", "--contact-mu", "1", "--measure", "luck", "-o", "{out}"], ("luck",)),
        (["import", "{scene}", "-o", "{out}", "--kind", "other"], ("other",)),
        (["import", "{log}", "-o", "{out}"], ("mlab-poke",)),
        (["import", "/nowhere", "-o", "{out}"], ("/nowhere",)),
        (["plan", "{scene}", "-o", "{out}", "--view", "{out}"], ("twice",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "drift:rate=a"], ("drift", "'a'")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "magic:x=1"], ("magic", "drift")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "tilt:slope=1"], ("tilt", "slope", "2")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--noise", "0.1", "-1", "0"], ("--noise", "-1")),
        (
            ["simulate", "{scene}", "{plan}", "--noise", "0.1", "-o", "{out}"],
            ("--noise: expected 3 numbers, N M RAD, got 1: 0.1",),
        ),
        (["simulate", "{scene}", "{plan}", "--noise=0.1", "-o", "{out}"], ("--noise: expected 3 numbers, N M RAD, got 1: 0.1",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--noise", "0.1", "--seed", "3"], ("N M RAD, got 1: 0.1",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--noise"], ("--noise: expected 3 numbers, N M RAD, got none",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "latncy:delay=0.1"], ("did you mean latency?",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "contact-friction=0.2"], ("expected ID:PARAM=VALUE",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "latency:dely=0.1"], ("did you mean delay?",)),
        (["plan", "{scene}", "-o", "{out}", "--planner", "cor_latice"], ("did you mean cor-lattice?",)),
        (["plan", "{scene}", "-o", "{out}", "--region", "all_pressure"], ("did you mean all-pressure?",)),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--finger-radius", "nan"], ("--finger-radius", "nan")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--rows", "0"], ("--rows", "0")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--support-mu", "0"], ("--support-mu", "> 0")),
        (["simulate", "{scene}", "{cors}", "-o", "{out}", "--replan", "0.01"], ("--replan", "list")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--view", "{out}/page.html"], ("page.html", "outside")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "model-capacity:facets=3.5"], ("facets", "3.5")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "model-capacity:degree=3"], ("degree", "3")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "tilt:slope=0.5/0"], ("error: effect tilt", "holds")),
        (
            ["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "pressure-spread:scale=1e-300"],
            ("error: effect pressure-spread: scale: support",),
        ),
        (["plan", "{scene}", "-o", "{out}", "--picture", "{out}.html"], ("ends in .png", "--view")),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "pressure-shift:offset=1/0"], ("pressure-shift", "under")),
        (
            ["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "spatial-variation:gradient=-9/9"],
            ("error: push 1: effects",),
        ),
        (
            ["simulate", "{scene}", "{plan}", "-o", "{out}", "--replan", "1", "--effect", "drift:rate=-0.99"],
            ("error: push ", ": effects and scatter"),
        ),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--outliers", "2"], ("--outliers", "2")),
        (["slide", "{model}", "--slider", "{slider}", "--twist", "1", "x", "1", "-o", "{out}"], ("x",)),
        (["slide", "{model}", "--slider", "{slider}", "--twist", "1", "nan", "1", "-o", "{out}"], ("--twist", "nan")),
        (
            ["slide", "{model}", "--slider", "{slider}", "--twist", "1", "0", "1", "-o", "{out}", "--mu", "-1"],
            ("--support-mu", "-1"),
        ),
        (
            ["slide", "{model}", "--slider", "{slider}", "--twist", "1", "0", "1", "-o", "{out}", "--duration", "0"],
            ("--duration",),
        ),
        # too little to compute with, and nothing that the files are to blame for
        (
            ["slide", "{model}", "--slider", "{slider}", "--twist", "1", "0", "1", "-o", "{out}", "--gravity", "1e-99"],
            ("error: --gravity",),
        ),
        (
            ["slide", "{model}", "--slider", "{slider}", "--twist", "1", "0", "1", "-o", "{out}", "--mu", "1e-320"],
            ("error: --support-mu",),
        ),
        (["map", "{model}", "--contact", "{contact}", "-o", "{out}", "--extent", "1e-99"], ("error: --extent",)),
        (["trajectory", "{scene}", "{plan}", "-o", "{out}", "--rate", "1e-99"], ("error: --rate",)),
        (["plan", "{scene}", "-o", "{out}", "--max-twist-rate", "1e-99"], ("error: --max-twist-rate",)),
        (
            ["contacts", "{model}", "--slider", "{slider}", "--contact-mu", "1", "--width", "1e-99", "-o", "{out}"],
            ("error: --width",),
        ),
        (["simulate", "{scene}", "{plan}", "-o", "{out}", "--mu", "1e-99"], ("error: --support-mu",)),
        (
            ["simulate", "{scene}", "{plan}", "-o", "{out}", "--effect", "drift:rate=0.1", "--effect", "drift:rate=0.2"],
            ("error: effects", "drift"),
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


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("along,edge\n", ("at least one push",)),
        ("edge\n0\n", ("line 1", "edge, along", "cor_x")),
        ("edge,along,cor_x,cor_y,sense,angle\n0,0.05,1,1,1,1\n", ("line 1", "edge, along")),
        ("edge,along,contact\n0,0.05,0\n", ("line 1", "column contact", "pushes of edges")),
        ("edge,along\n3,0.05\n", ("line 2", "column edge", "0 to 2", "3")),
        ("edge,along\n0.5,0.05\n", ("line 2", "column edge")),
        ("edge,along\n0,0.05\n0,0.9\n", ("line 3", "along", "0.9")),
        ("edge,along\n0,\n", ("line 2", "column along", "blank")),
        ("edge,along,direction\n0,0.05,2\n", ("line 2", "direction", "2")),
        ("edge,along,way\n0,0.05,0\n", ("line 2", "column way", "> 0")),
        ("cor_x,cor_y,sense,angle,contact\n0.1,0.1,1,0.3,1\n", ("line 2", "column contact", "0 to 0")),
        ("cor_x,cor_y,sense,angle\n0.1,0.1,2,0.3\n", ("line 2", "column sense")),
        ("cor_x,cor_y,sense,angle\n0.1,0.1,1,-0.3\n", ("line 2", "column angle")),
    ],
)
def test_faults_in_lists_of_pushes_are_named(rig, tmp_path, capsys, text, words):
    bad = tmp_path / "bad.csv"
    bad.write_text(text)
    one_line(capsys, fill("simulate", rig, tmp_path / "out", plan=bad), bad, *words)
    assert not (tmp_path / "out").exists()
