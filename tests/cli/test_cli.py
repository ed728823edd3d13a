"""The program end to end: what it leaves, and its exit codes."""

import json
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import one_line, small_scene

import stablepush as sp
from stablepush.cli import main
from stablepush.io.json_files import write_json
from stablepush.io.tables import read_table


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
    # the loop: the plan is lost, the cause is found, the next plan arrives
    assert {"run", "diagnosis.json", "diagnosis.html", "corrected.json", "corrected-plan.json", "second-run"} <= names
    told = capsys.readouterr().out
    ends = [float(number) for number in re.findall(r"the object ends ([\d.]+) mm from the goal", told)]
    assert "named: contact-friction" in told and ends[0] > 50 and ends[1] <= 10.5
    page = (tmp_path / "demo" / "report.html").read_text(encoding="utf-8")
    assert f"ended {ends[0]:.0f} mm from the goal" in page and 'src="second-run.html"' in page
    assert sp.load_scene(tmp_path / "demo" / "corrected.json").contacts[0].mu == pytest.approx(0.3, abs=0.02)


def test_import_one_and_all(lab, tmp_path, capsys):
    source = lab / "raw/SlidingExpCode/FusionMatlab/RandPushExp/SensorLogs/wood_patch"
    assert main(["import", str(source), "--kind", "mlab-poke", "-o", str(tmp_path / "one")]) == 0
    assert len(sp.read_pushlog(tmp_path / "one")) == 50
    assert main(["import", str(lab / "raw"), "-o", str(tmp_path / "all")]) == 0
    assert {"wood_patch", "board_30_90_30_30_30_90", "poster_patch_stable"} <= {p.name for p in (tmp_path / "all").iterdir()}
    assert "50 pairs, 50 with F·V > 0" in capsys.readouterr().out


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
    code = "import sys, stablepush.planning.registry, stablepush_planners; print(sorted(sys.modules))"
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
    from stablepush.views.plot.canvas import figure_png
    from stablepush.views.plot.plans import plot_plan

    problem = small_scene()
    result = sp.plan(problem, time_limit=30)
    assert figure_png(plot_plan(problem, result)) == figure_png(plot_plan(problem, result))


def interrupted(arguments, wait, times=1):
    """Run the program, and press Ctrl-C once it is busy; exit code, standard output and error, seconds from the last Ctrl-C."""
    run = subprocess.Popen(
        [sys.executable, "-m", "stablepush", *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    began = time.perf_counter()
    while not wait() and run.poll() is None and time.perf_counter() - began < 120:
        time.sleep(0.05)
    for _ in range(times):
        run.send_signal(signal.SIGINT)
        last = time.perf_counter()
        time.sleep(0.3)
    out, err = run.communicate(timeout=120)
    return run.returncode, out, err, time.perf_counter() - last


@pytest.fixture
def by_hand():
    """Ctrl-C as in a terminal: what runs in the background may have it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_keeps_the_best_plan(rig, tmp_path, capsys, monkeypatch, by_hand):
    """Pressed once the search says that it looks for better plans."""
    from stablepush.cli import common, plans

    heard = []
    describe = common.Progress.describe

    def listen(self, text):
        heard.append(text)
        if "weight 1.5" in text and not pressed:
            pressed.append(text)
            signal.raise_signal(signal.SIGINT)
        describe(self, text)

    pressed: list[str] = []
    monkeypatch.setattr(plans.Progress, "describe", listen)
    output = tmp_path / "plan.json"
    code = main(["plan", str(rig / "scene.json"), "-o", str(output), "--refinement-budget", "inf", "--time-limit", "600"])
    out, err = capsys.readouterr()
    assert pressed and code == 130, heard
    assert err == f"stablepush: interrupted; {output} holds the best plan found so far\n"
    assert "solved" in out
    assert main(["check", str(rig / "scene.json"), str(output)]) == 0
    assert [p.name for p in tmp_path.iterdir()] == ["plan.json"]
    # the next one is an ordinary one
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_a_second_ctrl_c_ends_at_once(by_hand):
    from stablepush.cli.common import interruptible

    with interruptible() as interrupted:
        assert not interrupted()
        signal.raise_signal(signal.SIGINT)
        assert interrupted()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_ctrl_c_before_there_is_a_plan_leaves_nothing(rig, tmp_path, by_hand):
    scene = json.loads((rig / "scene.json").read_text())
    # a gap that is too narrow, which a planner that draws random numbers cannot show
    low, high = [[0.45, 0.0], [0.55, 0.0], [0.55, 0.48], [0.45, 0.48]], [[0.45, 0.56], [0.55, 0.56], [0.55, 1], [0.45, 1]]
    scene["obstacles"] = [low, high]
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    output = tmp_path / "plan.json"
    arguments = ["plan", tmp_path / "scene.json", "-o", output, "--planner", "ompl-rrtstar", "--time-limit", "600"]
    for times in (1, 2):
        began = time.perf_counter()
        code, out, err, seconds = interrupted(arguments, lambda start=began: time.perf_counter() - start > 8, times)
        # a second one may meet the program on its way out
        assert code == 130 or (times == 2 and code == -signal.SIGINT)
        assert (out, err) == ("", "stablepush: interrupted\n")
        assert seconds < 20
        assert [p.name for p in tmp_path.iterdir()] == ["scene.json"]


def test_the_catalogue_of_effects_is_shown(capsys):
    from stablepush.effects import CATALOGUE

    assert main(["effects"]) == 0
    out = capsys.readouterr().out
    assert all(f"{name}: " in out for name in CATALOGUE)
    assert main(["effects", "drift"]) == 0
    out = capsys.readouterr().out
    assert "rate [1, first to last trial]: no effect at 0" in out and "random order" in out
    assert main(["effects", "--json"]) == 0
    every = json.loads(capsys.readouterr().out)
    assert [entry["id"] for entry in every] == list(CATALOGUE)
    assert main(["effects", "tilt", "--json"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert one["parameters"][0]["size"] == 2 and one["needs"]
    assert main(["effects", "gremlins"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "gremlins" in error


def test_quiet_says_nothing_but_errors(rig, tmp_path, capsys):
    scene, plan = rig / "scene.json", tmp_path / "plan.json"
    assert main(["--quiet", "plan", str(scene), "-o", str(plan), "--refinement-budget", "0"]) == 0
    assert plan.is_file()
    assert main(["-q", "check", str(scene), str(plan)]) == 0
    assert capsys.readouterr() == ("", "")
    assert main(["-q", "check", str(scene), str(tmp_path / "none.json")]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    # the next command is heard again
    assert main(["check", str(scene), str(plan)]) == 0
    assert "valid" in capsys.readouterr().out


@pytest.mark.parametrize("command", [[], ["plan"], ["diagnose"]])
def test_the_short_form_of_help(command, capsys):
    assert main([*command, "-h"]) == 0
    assert "Usage: stablepush" in capsys.readouterr().out


def test_shells_complete_commands(monkeypatch, capsys):
    monkeypatch.setenv("_STABLEPUSH_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "stablepush sim")
    monkeypatch.setenv("COMP_CWORD", "1")
    with pytest.raises(SystemExit) as stop:
        main([])
    assert (stop.value.code or 0, capsys.readouterr().out.split()) == (0, ["simulate"])


def test_summaries_in_json(rig, tmp_path, capsys):
    """Each command's summary as one object: numbers, paths and words."""

    def answer(*arguments):
        code = main(["--json", *map(str, arguments)])
        return code, json.loads(capsys.readouterr().out)

    scene, plan = rig / "scene.json", tmp_path / "plan.json"
    code, told = answer("plan", scene, "-o", plan, "--refinement-budget", "0")
    result = sp.load_plan(plan)
    assert code == 0 and told["status"] == "solved" and told["pushes"] == len(result.pushes)
    assert told["duration"] == pytest.approx(result.duration) and told["output"] == str(plan)
    assert answer("check", scene, plan) == (0, {"plan": str(plan), "valid": True, "objections": []})
    code, told = answer("simulate", scene, plan, "-o", tmp_path / "log")
    assert told["pushes"] == len(result.pushes) and np.shape(told["final_pose"]) == (3,)
    code, told = answer("diagnose", tmp_path / "log")
    assert told["verdict"] == "none" and told["effects"] == [] and told["channels"][0]["channel"]
    code, told = answer("effects", "tilt")
    assert told["effects"][0]["id"] == "tilt"
    code, told = answer("map", rig / "model.json", "--contact", rig / "contact.json", "-o", tmp_path / "map.png")
    assert told["regions"][0]["name"] == "model"
    # what is bad is said as ever
    assert main(["--json", "plan", str(tmp_path / "none.json"), "-o", str(plan)]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith("stablepush: error: ")
