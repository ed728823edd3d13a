"""Commands that show which rotation centres are stable, through the command line."""

import json

import numpy as np
import pytest

import stablepush as sp
from stablepush.cli import main
from stablepush.io import write_json
from stablepush.io.tables import read_table


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


def test_a_scene_has_all_that_a_map_needs(rig, tmp_path, capsys):
    """Its model, its contact and its slider, as when they are given one by one; two contacts, or effects, are refused."""
    surface, contact = sp.load_model(rig / "model.json"), sp.load_contact(rig / "contact.json")
    slider = sp.load_slider(rig / "slider.json")

    def scene(name, contacts, **more):
        problem = sp.PlanningProblem(slider, surface, contacts, (0, 0, 0), (1, 1, 0), bounds=(-1, -1, 2, 2), **more)
        sp.save_scene(problem, tmp_path / name)
        return str(tmp_path / name)

    one, cors, out = scene("one.json", [contact]), str(rig / "cors.csv"), tmp_path / "o.csv"
    by_parts = [str(rig / "model.json"), "--contact", str(rig / "contact.json")]
    written = []
    for model, more in (([one], []), (by_parts, ["--slider", str(rig / "slider.json")])):
        assert main(["map", *model, *more, "-o", str(tmp_path / "m.png"), "--json", str(tmp_path / "r.json")]) == 0
        assert main(["classify", *model, "--cors", cors, "-o", str(out)]) == 0
        written.append(((tmp_path / "r.json").read_text(), out.read_text()))
    assert written[0] == written[1]
    capsys.readouterr()
    # a delay of the tracker changes no stability
    late = scene("late.json", [contact], effects=[sp.parse_effect("latency:delay=0.05")])
    assert main(["classify", late, "--cors", cors, "-o", str(out)]) == 0
    assert out.read_text() == written[0][1]
    capsys.readouterr()
    two = scene("two.json", [contact, contact])
    sloped = scene("sloped.json", [contact], effects=[sp.parse_effect("tilt:slope=0.02/0")])
    for model, words in (
        (two, "two.json: contacts: expected one contact, got 2: choose one by its number, 0 to 1 (--contact)"),
        (sloped, "sloped.json: effects: expected none like tilt: stability then depends on heading and place"),
        (str(rig / "model.json"), "--contact: expected a contact file; only a scene has a contact of its own"),
    ):
        assert main(["map", model, "-o", str(tmp_path / "no.png")]) == 2
        assert words in capsys.readouterr().err
    assert main(["map", two, "--contact", "2", "-o", str(tmp_path / "no.png")]) == 2
    assert "contacts: expected one contact, got number 2 of 2" in capsys.readouterr().err
    assert not (tmp_path / "no.png").exists()
    # a path is no number, and a number is none without a scene
    for words in ("sub/1", "9" * 300, "\u0661"):
        assert main(["map", two, "--contact", words, "-o", str(tmp_path / "no.png")]) == 2
    assert main(["map", str(rig / "model.json"), "--contact", "0", "-o", str(tmp_path / "no.png")]) == 2
    for wrong in (1.0, True, "0"):
        with pytest.raises(sp.InputError, match="number"):
            sp.load_contact(two, wrong)
    # the second contact by its number
    assert main(["classify", two, "--contact", "1", "--cors", cors, "-o", str(out)]) == 0
    assert out.read_text() == written[0][1]


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
    arguments = [
        "--slider",
        str(rig / "slider.json"),
        "--contact-mu",
        "0.5",
        "--width",
        "0.03",
        "--width",
        "0.06",
        "--places",
        "3",
    ]
    outputs = ["-o", str(tmp_path / "c.csv"), "--picture", str(tmp_path / "c.png"), "--measure", "margin", "--edge", "1"]
    outputs += ["--best", str(tmp_path / "best.json")]
    assert main(["contacts", str(rig / "model.json"), *arguments, *outputs]) == 0
    table, _ = read_table(tmp_path / "c.csv", required=(), numbers=("edge", "width", "margin", "area", "tightest_left"))
    assert len(table["edge"]) == 6 and set(table["edge"]) == {1.0}
    assert (np.diff(table["margin"]) <= 0).all()
    # what classify and map take
    best, edge = sp.load_contact(tmp_path / "best.json"), sp.load_slider(rig / "slider.json").vertices[1:3]
    assert np.linalg.norm(best.points[1] - best.points[0]) == pytest.approx(table["width"][0])
    (along,), offs = np.diff(edge, axis=0), best.points - edge[0]
    assert along[0] * offs[:, 1] - along[1] * offs[:, 0] == pytest.approx(0.0, abs=1e-9)
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    assert "best by margin: edge 1" in capsys.readouterr().out


def test_map_of_a_corner_has_no_conservative_region(rig, tmp_path, capsys):
    corner = {"points": [[0.0, -0.0533], [-0.0533, 0.0]], "normals": [[0, 1], [1, 0]], "mu": 0.5}
    write_json(tmp_path / "corner.json", corner)
    arguments = ["--contact", str(tmp_path / "corner.json"), "--slider", str(rig / "slider.json"), "-o", str(tmp_path / "m.png")]
    assert main(["map", str(rig / "model.json"), *arguments]) == 0
    assert "no conservative region" in capsys.readouterr().out
