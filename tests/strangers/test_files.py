"""What strangers' files hold, and what becomes of files when a program is killed."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import unicodedata
from pathlib import Path

import numpy as np
import pytest
from conftest import make_log, small_scene
from hypothesis import given, strategies as st
from recordings import mapping_file

import stablepush as sp
from stablepush.cli import main
from stablepush.core import isolated_environment, run_parallel, shown
from stablepush.io import whole_folder, write_atomically

SQUARE = [(-0.05, -0.04), (0.05, -0.04), (0.05, 0.04), (-0.05, 0.04)]


def test_a_ring_that_repeats_its_first_vertex_is_the_same_outline():
    import shapely

    ring = np.array(shapely.Polygon(SQUARE).exterior.coords)
    assert len(ring) == 5
    ring = ring if shapely.LinearRing(ring).is_ccw else ring[::-1]
    assert sp.Slider(ring).vertices.shape == (4, 2)
    scene = small_scene(
        obstacles=[[*o, o[0]] for o in small_scene().obstacles], pusher=[*small_scene().pusher, small_scene().pusher[0]]
    )
    assert [len(o) for o in scene.obstacles] == [4] and len(scene.pusher) == 4
    with pytest.raises(sp.InputError, match="edge 0 has zero length"):
        sp.Slider([SQUARE[0], *SQUARE])


@given(st.text(max_size=400))
def test_what_is_shown_is_printable_and_short(text):
    assert all(c.isprintable() or unicodedata.category(c) == "Zs" for c in shown(text))
    assert len(shown(text)) < 3000
    if text.isprintable() and len(text) <= 200:
        assert shown(text) == text


@pytest.mark.parametrize("name", ["\x1b[31mred", "a" * 100_000, "\u202egnp.exe", "x\ry", "$\\frac{$"])
def test_names_are_text_everywhere(name, tmp_path, capsys):
    log = make_log("drift:rate=-0.2", count=8, rows=4)
    names = {word: f"{word}{name}" for word in map(str, log.trials["trial"])}
    trials = {**log.trials, "trial": [names[word] for word in map(str, log.trials["trial"])]}
    samples = {**log.samples, "trial": [names[word] for word in map(str, log.samples["trial"])]}
    folder = tmp_path / f"log{name[:40]}"
    sp.write_pushlog(sp.PushLog(log.rig, trials, samples), folder)
    read = sp.read_pushlog(folder)
    assert list(read.trials["trial"]) == [word.strip() for word in trials["trial"]]
    assert main(["diagnose", str(folder), "--html", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert not set("\x1b\u202e\r") & set(page)
    said = capsys.readouterr()
    for line in (said.out + said.err).split("\n"):
        assert line.isprintable() and len(line) < 8000


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize("name", ["rig.json", "trials.csv", "samples.csv"])
def test_a_pipe_in_a_folder_is_refused(tmp_path, capsys, name):
    """Nobody may ever write into it."""
    sp.write_pushlog(make_log(count=2), tmp_path / "log")
    (tmp_path / "log" / name).unlink()
    os.mkfifo(tmp_path / "log" / name)
    for arguments in (["diagnose", tmp_path / "log"], ["import", tmp_path / "log", "-o", tmp_path / "other"]):
        assert main([str(a) for a in arguments]) == 2
        assert f"{name}: cannot read: expected a file" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_for_the_outline_of_a_mapping_is_refused(tmp_path, capsys):
    os.mkfifo(tmp_path / "outline.json")
    mapping = mapping_file(tmp_path, columns={"t": "t"}, slider="outline.json")
    (tmp_path / "t.csv").write_text("t\n0\n")
    assert main(["import", str(tmp_path / "t.csv"), "--mapping", str(mapping), "-o", str(tmp_path / "log")]) == 2
    assert "outline.json: cannot read: expected a file" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["a loop of links", "a pipe with a name"])
@pytest.mark.parametrize(
    "arguments",
    [
        "plan X -o out.json", "check scene.json X", "fit X -o out.json", "fit --slider X -o out.json",
        "simulate scene.json X -o out", "trajectory scene.json X -o out.csv", "diagnose X",
        "import X --kind csv --mapping m.yaml -o out", "view X -o out.html", "import t.csv --kind csv --mapping X -o out",
        "import t.csv --mapping m.yaml --slider X -o out", "map X --contact c.json -o o.png",
    ],
)  # fmt: skip
def test_an_input_that_is_no_file_is_refused_at_once(kind, arguments, tmp_path, monkeypatch, capsys):
    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    monkeypatch.chdir(tmp_path)
    sp.save_scene(small_scene(), "scene.json")
    Path("t.csv").write_text("t\n0\n")
    Path("m.yaml").write_text("columns: {t: t, x: t, y: t, theta: t}\nslider: s.json\n")
    Path("s.json").write_text('{"format": "slider/1", "vertices": [[0, 0], [1, 0], [0, 1]]}')
    if kind == "a loop of links":
        Path("X").symlink_to("Y")
        Path("Y").symlink_to("X")
    else:
        os.mkfifo("X")
    before = sorted(os.listdir())
    assert main(arguments.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("stablepush: error: ") and "X" in line
    assert sorted(os.listdir()) == before


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_that_nobody_may_read_is_no_output(tmp_path, capsys):
    sp.write_pushlog(make_log(count=6), tmp_path / "log")
    os.mkfifo(tmp_path / "pipe")
    assert main(["fit", str(tmp_path / "log"), "-o", str(tmp_path / "pipe")]) == 2
    assert "pipe: cannot write: expected a file, not a pipe with a name" in capsys.readouterr().err


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="no such device here")
def test_what_never_ends_is_refused(tmp_path, capsys):
    scene = tmp_path / "scene.json"
    sp.save_scene(small_scene(), scene)
    values = json.loads(scene.read_text())
    os.mkfifo(tmp_path / "pipe")
    for model in ("/dev/zero", "pipe"):
        scene.write_text(json.dumps(values | {"model": model}))
        assert main(["plan", str(scene), "-o", str(tmp_path / "plan.json")]) == 2
        assert f"{model}: cannot read: expected a file" in capsys.readouterr().err
    assert main(["plan", "/dev/zero", "-o", str(tmp_path / "plan.json")]) == 2
    assert "not a device" in capsys.readouterr().err
    mapping = mapping_file(tmp_path, columns={})
    bomb = "".join(f"k{i}: &k{i} [{', '.join([f'*k{i - 1}'] * 9) if i else 'x'}]\n" for i in range(9))
    mapping.write_text(bomb)
    (tmp_path / "t.csv").write_text("t\n0\n")
    assert main(["import", str(tmp_path / "t.csv"), "--mapping", str(mapping), "-o", str(tmp_path / "log")]) == 2
    assert "instead of an alias" in capsys.readouterr().err


def test_infinite_numbers_of_json_are_named(tmp_path):
    from stablepush.io import read_json

    path = tmp_path / "x.json"
    for number in ("NaN", "Infinity", "-Infinity", "1e999", "1" * 400 + ".0"):
        path.write_text('{"a": [1, {"b": [[0, 2], [3, ' + number + "]]}]}")
        with pytest.raises(sp.InputError, match=r"a\[1\]\.b\[1\]\[1\]: expected a finite number"):
            read_json(path)


def test_a_log_is_replaced_as_a_whole_and_other_files_are_not_lost(tmp_path):
    log = make_log("drift:rate=-0.2", count=4, rows=4)
    folder = tmp_path / "log"
    sp.write_pushlog(log, folder)
    (folder / "samples.parquet").write_bytes(b"of an older log")
    sp.write_pushlog(log, folder)
    assert sorted(f.name for f in folder.iterdir()) == ["rig.json", "samples.csv", "trials.csv"]
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(sp.InputError, match=r"files of others.*notes\.txt"):
        sp.write_pushlog(log, folder)
    assert (folder / "notes.txt").read_text() == "mine"
    with pytest.raises(RuntimeError), whole_folder(tmp_path / "new", "*") as place:
        (place / "a").write_text("half")
        raise RuntimeError
    assert [f.name for f in tmp_path.iterdir()] == ["log"]


WRITER = """
import itertools, sys
from stablepush.io import whole_folder
for k in itertools.count():
    with whole_folder(sys.argv[1], "*") as place:
        for name in "abcd":
            (place / name).write_text(str(k) * 20000)
    print(k, flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_kill_leaves_the_old_or_the_new(number, tmp_path):
    """At ten random moments: all files of the folder are of one time, and the next writer clears what was left."""
    rng, target = np.random.default_rng(int(number)), tmp_path / "folder"
    for _ in range(10):
        with subprocess.Popen([sys.executable, "-c", WRITER, str(target)], stdout=subprocess.PIPE) as writer:
            writer.stdout.readline()
            time.sleep(rng.uniform(0, 0.05))
            writer.send_signal(number)
        assert sorted(f.name for f in target.iterdir()) == list("abcd")
        assert len({f.read_text() for f in target.iterdir()}) == 1
    write_atomically(tmp_path / "file", "x")
    assert sorted(f.name for f in tmp_path.iterdir()) == ["file", "folder"]


def _sleep(seconds):
    time.sleep(seconds)
    return os.getpid()


PARENT = """
import sys
sys.path.append(sys.argv[1])
from test_files import _sleep
from stablepush.core import run_parallel
print(next(run_parallel(_sleep, [(0.01,), (60.0,)], 2)), flush=True)
list(run_parallel(_sleep, [(60.0,), (60.0,)], 2))
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_workers_end_with_a_parent_that_was_killed():
    here = os.path.dirname(__file__)
    environment = isolated_environment()
    environment["PYTHONPATH"] += os.pathsep + os.pathsep.join((here, os.path.join(here, ".."), os.path.join(here, "../io")))
    with subprocess.Popen([sys.executable, "-c", PARENT, here], stdout=subprocess.PIPE, env=environment) as parent:
        worker = int(parent.stdout.readline())
        parent.kill()
    for _ in range(100):
        if not _lives(worker):
            break
        time.sleep(0.1)
    assert not _lives(worker)


def _lives(process):
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_program_in_a_deleted_folder_says_so(tmp_path):
    code = "import os, sys\nos.makedirs(sys.argv[1])\nos.chdir(sys.argv[1])\nos.rmdir(sys.argv[1])\n"
    code += "from stablepush.cli import main\nsys.exit(main(['fit', 'log', '-o', 'model.json']))"
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "gone")], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and re.fullmatch(r"stablepush: error: the current folder does not exist.*\n", done.stderr)


def test_no_module_of_the_current_folder_is_run(tmp_path, monkeypatch):
    for name in ("random", "stablepush", "joblib", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(77)")
    monkeypatch.chdir(tmp_path)
    assert len(list(run_parallel(_sleep, [(0.0,), (0.0,)], 2))) == 2


@pytest.mark.parametrize("tolerance", [(0.0, 0.0), (1e-4, 0.01), (0.01, 0.05), (0.05, 3.2)])
@pytest.mark.parametrize("planner", ["cor-lattice", "ompl-kpiece"])
def test_a_start_that_is_the_goal_is_solved_at_once(tolerance, planner):
    if planner not in sp.planner_names():
        pytest.skip("OMPL is not installed")
    problem = small_scene(goal=small_scene().start, tolerance=tolerance)
    result = sp.plan(problem, planner)
    assert result.solved and result.duration < 0.01 and result.length < 1e-3
    assert sp.check_plan(problem, result).valid


@pytest.mark.parametrize("depth", [0.001, 0.03])
def test_a_pusher_inside_the_slider_is_refused(depth):
    with pytest.raises(sp.InputError, match=r"pusher\.outline: .* docked at contact 0 it overlaps the slider, got .* cm²"):
        small_scene(pusher=((-0.03 + depth, -0.03), (depth, -0.03), (depth, 0.03), (-0.03 + depth, 0.03)))
    # what touches does not overlap
    small_scene(pusher=((-0.03, -0.03), (1e-5, -0.03), (1e-5, 0.03), (-0.03, 0.03)))


def test_loads_that_are_too_small_for_newtons_are_told():
    rng = np.random.default_rng(0)
    feet = sp.SupportDistribution([(0.05, 0.03), (-0.05, 0.03), (-0.05, -0.03), (0.05, -0.03)], [1, 1, 1, 1])
    twists = rng.standard_normal((20, 3)) * [0.01, 0.01, 0.2]
    for friction, told in ((0.2, False), (0.02, True)):
        loads = sp.IdealLimitSurface(feet, friction).wrench(twists)
        fit = sp.fit_limit_surface(loads, twists, model="poly4-cvx")
        assert (np.median(fit.surface.value(loads)) == pytest.approx(1.0, rel=0.05)) is not told
        assert any("too small for coefficients" in words for words in fit.warnings) is told
