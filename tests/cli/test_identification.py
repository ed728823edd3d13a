"""Commands that fit surfaces, through the command line."""

import json

import numpy as np
import pytest
from conftest import one_line

import stablepush as sp
from stablepush.cli import main


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


def test_a_fit_names_the_pushes_that_it_leaves_out(rig, tmp_path, capsys):
    log = sp.read_pushlog(rig / "log")
    name = str(log.trials["trial"][2])
    loads = np.where((log.samples["trial"] == name)[:, None], 1e4, 1.0) * log.columns("fx", "fy", "tau")
    sp.write_pushlog(
        sp.PushLog(log.rig, log.trials, {**log.samples, **dict(zip(("fx", "fy", "tau"), loads.T, strict=True))}), tmp_path / "log"
    )
    assert main(["fit", str(tmp_path / "log"), "-o", str(tmp_path / "m.json")]) == 0
    assert f"note: left out: 1 push ({name})\n" in capsys.readouterr().out


def test_a_gaussian_process_is_fitted_and_classifies(rig, tmp_path, capsys):
    out = tmp_path / "gp.json"
    assert main(["fit", str(rig / "log"), "--model", "gp", "-o", str(out)]) == 0
    assert "no limit surface" in capsys.readouterr().out
    arguments = ["--contact", str(rig / "contact.json"), "--cors", str(rig / "cors.csv"), "-o", str(tmp_path / "o.csv")]
    assert main(["classify", str(out), *arguments]) == 0


def test_pages_of_a_surface_and_of_a_map(rig, tmp_path, capsys):
    surface, region = tmp_path / "s.html", tmp_path / "r.html"
    assert main(["fit", str(rig / "log"), "--view", str(surface), "-o", str(tmp_path / "m.json")]) == 0
    contact = ["--contact", str(rig / "contact.json"), "--slider", str(rig / "slider.json")]
    assert main(["map", str(tmp_path / "m.json"), *contact, "--view", str(region), "-o", str(tmp_path / "m.png")]) == 0
    assert "pokes, slip" in surface.read_text(encoding="utf-8")
    assert '"name": "conservative"' in region.read_text(encoding="utf-8")
    # a page inside the log would be taken for a part of it
    assert main(["fit", str(rig / "log"), "--view", str(rig / "log" / "s.html"), "-o", str(tmp_path / "m.json")]) == 2
    assert "outside" in capsys.readouterr().err


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


def test_a_surface_from_a_slider_alone_is_that_of_the_library(rig, tmp_path, capsys):
    body, out = rig / "slider.json", tmp_path / "m.json"
    assert main(["fit", "--slider", str(body), "-o", str(out), "--view", str(tmp_path / "s.html")]) == 0
    assert "0 pokes" in capsys.readouterr().out
    expected = sp.fit_limit_surface(np.empty((0, 3)), np.empty((0, 3)), slider=sp.load_slider(body)).surface
    twists = np.random.default_rng(0).normal(size=(20, 3))
    np.testing.assert_allclose(sp.load_model(out).wrench(twists), expected.wrench(twists), rtol=1e-9)


def test_a_scene_and_a_rig_have_a_slider(rig, tmp_path, capsys):
    scene, log = sp.load_scene(rig / "scene.json"), sp.read_pushlog(rig / "log")
    for path, body in ((rig / "scene.json", scene.slider), (rig / "log" / "rig.json", log.rig.slider)):
        np.testing.assert_array_equal(sp.load_slider(path).vertices, body.vertices)
    assert main(["fit", "--slider", str(rig / "model.json"), "-o", str(tmp_path / "m.json")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "slider/1" in error and "model/1" in error


@pytest.mark.parametrize(
    ("given", "said"), (((), "neither"), (("log", "--slider"), "both"), (("--slider", "--no-slider"), "a log"))
)
def test_a_surface_needs_a_log_or_a_slider(rig, tmp_path, capsys, given, said):
    words = {"log": [str(rig / "log")], "--slider": ["--slider", str(rig / "slider.json")], "--no-slider": ["--no-slider"]}
    assert main(["fit", *(word for name in given for word in words[name]), "-o", str(tmp_path / "m.json")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "m.json").exists()


def test_the_surface_of_known_feet(rig, tmp_path, capsys):
    """The exact surface of the support in the slider's file, with loads in N; nothing else has such an option."""
    slider = json.loads((rig / "slider.json").read_text())
    feet = {"points": [[-0.03, -0.03], [0.06, -0.02], [-0.03, 0.05]], "weights": [1, 2, 1]}
    (tmp_path / "feet.json").write_text(json.dumps(slider | {"support": feet, "mass": 1.2}))
    given = ["fit", "--slider", tmp_path / "feet.json", "--model", "support", "--support-mu", "0.3", "-o", tmp_path / "m.json"]
    assert main([str(a) for a in given]) == 0
    assert "3 support points, friction load 3.532 N" in capsys.readouterr().out
    surface = sp.load_model(tmp_path / "m.json")
    expected = sp.IdealLimitSurface(sp.SupportDistribution(feet["points"], feet["weights"]), 0.3 * 1.2 * 9.81)
    twist = (0.02, 0.05, 0.3)
    assert surface.wrench(twist) == pytest.approx(expected.wrench(twist), rel=1e-12)
    one_line(capsys, [*given[:5], "-o", tmp_path / "n.json"], "--model, --support-mu: expected")
    (tmp_path / "none.json").write_text(json.dumps(slider))
    one_line(capsys, [*given[:2], tmp_path / "none.json", *given[3:-1], tmp_path / "n.json"], "none.json: support, mass")
    assert not (tmp_path / "n.json").exists()
