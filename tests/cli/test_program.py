"""The program as a whole: the demo, help, processes, interruptions, summaries."""

import importlib.util
import json
import re
import runpy
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import small_scene

import stablepush as sp
from stablepush.cli import main

ROOT = Path(__file__).parents[2]


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
    # engines that know nothing of the demo agree: among slippery fingers the first plan is lost, the corrected one is not
    engines = [name for name, module in (("MuJoCo", "mujoco"), ("Drake", "pydrake")) if importlib.util.find_spec(module)]
    example = runpy.run_path(str(ROOT / "examples" / "simulation" / "demo_in_engines.py"))
    found = {(plan, engine): (planned, goal) for plan, engine, planned, goal, _ in example["ends"](tmp_path / "demo", engines)}
    for engine in engines:
        assert found["first plan", engine][0] > 50
        # fingers creep in Drake's contacts
        assert found["corrected plan", engine][0] < {"MuJoCo": 3.0, "Drake": 12.0}[engine]


def test_import_one_and_all(lab, tmp_path, capsys):
    source = lab / "raw/SlidingExpCode/FusionMatlab/RandPushExp/SensorLogs/wood_patch"
    assert main(["import", str(source), "--kind", "mlab-poke", "-o", str(tmp_path / "one")]) == 0
    assert len(sp.read_pushlog(tmp_path / "one")) == 50
    assert main(["import", str(lab / "raw"), "-o", str(tmp_path / "all")]) == 0
    assert {"wood_patch", "board_30_90_30_30_30_90", "poster_patch_stable"} <= {p.name for p in (tmp_path / "all").iterdir()}
    assert "50 pushes, 50 pairs of load and twist\n" in capsys.readouterr().out


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
    # older linear algebra of scipy loads the sparse one itself
    code = "import sys, scipy.linalg; print('scipy.sparse' in sys.modules)"
    own = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    for heavy in ("scipy.optimize", "cvxpy", "matplotlib", "networkx", *(["scipy.sparse"] if "False" in own else [])):
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
