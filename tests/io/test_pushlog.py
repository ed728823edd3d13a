import csv
import json

import numpy as np
import pytest
import scipy.io

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.geometry.planar import angle_between, normalize_twist, normalize_wrench
from stablepush.geometry.se2 import compose, exp, wrap_angle
from stablepush.io.importers import find_sources, import_source, triangle_slider
from stablepush.io.pushlog import distinct


@pytest.fixture
def folder(tmp_path):
    sp.write_pushlog(demo_pokes(5), tmp_path / "log")
    return tmp_path / "log"


def test_logs_survive_their_folder(tmp_path):
    log = demo_pokes(6)
    sp.write_pushlog(log, tmp_path / "log")
    again = sp.read_pushlog(tmp_path / "log")
    assert len(again) == 6
    for table, other in ((log.trials, again.trials), (log.samples, again.samples)):
        assert list(table) == list(other)
        for name in table:
            np.testing.assert_array_equal(table[name], other[name])
    np.testing.assert_array_equal(log.rig.slider.vertices, again.rig.slider.vertices)
    assert again.rig.noise == log.rig.noise
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log"]


def test_entries_that_are_not_ours_are_kept(folder, tmp_path):
    rig = json.loads((folder / "rig.json").read_text())
    rig["operator"] = {"name": "Ada"}
    (folder / "rig.json").write_text(json.dumps(rig))
    (folder / "trials.csv").write_text((folder / "trials.csv").read_text().replace("group", "remark"))
    sp.write_pushlog(sp.read_pushlog(folder), tmp_path / "copy")
    assert json.loads((tmp_path / "copy" / "rig.json").read_text())["operator"] == {"name": "Ada"}
    assert "remark" in (tmp_path / "copy" / "trials.csv").read_text()


def edit(folder, name, change):
    path = folder / name
    if name == "rig.json":
        value = json.loads(path.read_text())
        change(value)
        path.write_text(json.dumps(value))
    else:
        path.write_text(change(path.read_text()))


def replace_cell(row, column, value):
    def change(text):
        lines = [line.split(",") for line in text.splitlines()]
        lines[row][lines[0].index(column)] = value
        return "\n".join(",".join(line) for line in lines) + "\n"

    return change


@pytest.mark.parametrize(
    ("name", "change", "place"),
    [
        ("rig.json", lambda v: v.update(format="pushlog/2"), "format"),
        ("rig.json", lambda v: v.pop("slider"), "slider: missing key"),
        ("rig.json", lambda v: v["friction"].pop("support"), "friction.support: missing key"),
        ("rig.json", lambda v: v["slider"].pop("mass"), "slider.mass: missing key"),
        ("rig.json", lambda v: v["slider"].update(mass=-1), "slider.mass"),
        ("rig.json", lambda v: v["slider"]["vertices"].reverse(), "slider.vertices: .*clockwise"),
        ("rig.json", lambda v: v["slider"]["vertices"].append([float("nan"), 0]), r"slider.vertices\[3\]\[0\]"),
        ("rig.json", lambda v: v.update(contact_kind="glove"), "contact_kind"),
        ("rig.json", lambda v: v["friction"].update(support=-0.1), "friction.support"),
        ("rig.json", lambda v: v.update(gravity="much"), "gravity"),
        ("rig.json", lambda v: v["noise"].update(force=1e7), "noise.force"),
        ("trials.csv", lambda t: t.replace("start_time", "begin"), "column start_time: missing column"),
        ("trials.csv", replace_cell(2, "start_time", "soon"), "line 3: column start_time"),
        ("trials.csv", replace_cell(2, "start_time", ""), "line 3: column start_time"),
        ("trials.csv", replace_cell(2, "speed", "-1"), "line 3: column speed"),
        ("trials.csv", replace_cell(2, "trial", "1"), "twice"),
        ("trials.csv", lambda t: t + "9,1\n", "line 7"),
        ("samples.csv", lambda t: t.replace("theta", "heading"), "column theta: missing column"),
        ("samples.csv", replace_cell(4, "fx", "1e9"), "line 5: column fx"),
        ("samples.csv", replace_cell(4, "fx", "nan"), "line 5: column fx"),
        ("samples.csv", replace_cell(4, "t", "1_0"), "line 5: column t"),
        ("samples.csv", replace_cell(4, "trial", "77"), "trial of trials.csv"),
        ("samples.csv", replace_cell(4, "phase", "shove"), "line 5: column phase"),
        ("samples.csv", lambda t: t.replace("\n", "\n\n , \n", 1).replace("push", "shove", 1), "line 5: column phase"),
        ("samples.csv", lambda t: t.replace("\n", '\n"', 1), "CSV"),
        ("samples.csv", lambda t: "", "line 1"),
    ],
)
def test_broken_logs_are_refused_with_their_place(folder, name, change, place):
    edit(folder, name, change)
    with pytest.raises(sp.InputError, match=place) as caught:
        sp.read_pushlog(folder)
    assert str(folder / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def tiny_log(poses, times, **columns):
    n = len(poses)
    x, y, theta = np.transpose(poses)
    samples = {"trial": np.array(["a"] * n, dtype=object), "t": times, "x": x, "y": y, "theta": theta, **columns}
    trials = {"trial": np.array(["a"], dtype=object), "start_time": np.zeros(1)}
    return sp.PushLog(sp.Rig(triangle_slider("patch")), trials, samples)


def test_twists_are_differentiated_exactly_for_constant_ones():
    twist = np.array((0.01, -0.02, 0.3))
    times = np.array((0.0, 0.4, 1.0, 1.1))
    poses = compose((0.3, 0.2, 3.0), exp(twist * times[:, None]))
    shuffled = np.array((2, 0, 3, 1))
    twists = tiny_log(poses[shuffled], times[shuffled]).twists()
    np.testing.assert_allclose(twists, np.tile(twist, (4, 1)), atol=1e-12)


def test_headings_kept_within_a_turn_make_no_jump():
    twist = np.array((0.01, 0.0, 0.3))
    times = np.linspace(0, 1, 6)
    poses = compose((0.0, 0.0, np.pi - 0.1), exp(twist * times[:, None]))
    poses[:, 2] = wrap_angle(poses[:, 2])
    assert np.ptp(poses[:, 2]) > 6
    np.testing.assert_allclose(tiny_log(poses, times).twists(), np.tile(twist, (6, 1)), atol=1e-12)


@pytest.mark.parametrize("unit", [1e-8, 1e-12, 1e-160, 1e-320])
def test_rows_at_one_time_have_no_twist(unit):
    poses = compose((0.0, 0.0, 0.0), exp(np.array((0.01, 0.0, 0.3)) * np.arange(6.0)[:, None]))
    twists = tiny_log(poses, unit * np.arange(6)).twists()
    assert np.isfinite(twists).all() == (unit >= 1e-9)
    assert np.isnan(twists).all() == (unit < 1e-9)


def test_times_are_told_apart():
    assert distinct(np.zeros(0)).tolist() == []
    times = np.array((0.0, 0.5, 0.5, 0.5 + 1e-10, 1.0, 0.2, np.nan, 2.0))
    assert distinct(times).tolist() == [True, True, False, False, True, False, False, False]
    assert distinct(times[::-1][:2]).tolist() == [True, False]


def test_twists_that_are_logged_in_part_come_from_the_poses():
    poses = np.array(((0.0, 0, 0), (np.nan, np.nan, np.nan), (0.2, 0, 0)))
    log = tiny_log(poses, np.arange(3.0), vx=np.full(3, 5.0), vy=np.zeros(3))
    np.testing.assert_allclose(log.twists(), [(0.1, 0, 0), (np.nan,) * 3, (0.1, 0, 0)])


def test_logged_twists_and_missing_rows():
    poses = np.array(((0.0, 0, 0), (0.1, 0, 0), (np.nan, np.nan, np.nan), (0.3, 0, 0)))
    nan = np.nan
    log = tiny_log(
        poses,
        np.arange(4.0),
        vx=np.array((nan, 0.5, nan, nan)),
        vy=np.array((nan, 0.0, nan, nan)),
        omega=np.array((nan, 0.0, nan, nan)),
    )
    np.testing.assert_allclose(log.twists()[[0, 1, 3], 0], (0.1, 0.5, 0.1))
    assert np.isnan(log.twists()[2]).all()


def test_pairs_are_means_over_push_rows_with_forces():
    poses = np.zeros((4, 3))
    one, nan = np.ones(4), np.nan
    log = tiny_log(
        poses,
        np.arange(4.0),
        fx=np.array((9.0, 1.0, 2.0, nan)),
        fy=one,
        tau=one,
        vx=np.array((9.0, 3.0, 5.0, 7.0)),
        vy=one,
        omega=one,
        phase=np.array(("rest", "push", "push", "push"), dtype=object),
    )
    loads, twists, names = log.pairs()
    np.testing.assert_allclose(loads, [[1.5, 1, 1]])
    np.testing.assert_allclose(twists, [[4, 1, 1]])
    assert names == ["a"]
    assert tiny_log(poses, np.arange(4.0)).pairs()[2] == []


def test_a_trial_may_hold_one_push_row():
    log = tiny_log(np.zeros((1, 3)), np.zeros(1), **{c: np.ones(1) for c in ("fx", "fy", "tau", "vx", "vy", "omega")})
    assert len(log.pairs()[0]) == 1


def test_supports_come_from_folder_names():
    support = triangle_slider("10_90_10_10_30_130").support
    np.testing.assert_allclose(support.points * 1000 + 50, [(10, 10), (90, 30), (10, 130)])
    np.testing.assert_allclose(support.weights, (0.25, 0.5, 0.25))
    patch = triangle_slider("patch")
    np.testing.assert_allclose(patch.support.center, 0, atol=1e-12)
    np.testing.assert_allclose(sorted(map(tuple, patch.support_vertices)), sorted(map(tuple, patch.vertices)))
    assert triangle_slider("somewhere").support is None


def test_practice_logs_are_read(practice):
    for path in sorted(p for p in practice.iterdir() if p.is_dir()):
        log = sp.read_pushlog(path)
        loads, twists, names = log.pairs()
        assert len(names) == len(log) == 60
        assert ((loads * twists).sum(axis=1) > 0).mean() > 0.95


POKES = "raw/SlidingExpCode/FusionMatlab/RandPushExp/SensorLogs"


def test_all_poking_logs_of_the_lab(lab):
    sources = find_sources(lab / "raw", "mlab-poke")
    assert len(sources) >= 7
    assert len({s.name for s in sources}) == len(sources)
    for source in sources:
        log, notes = import_source(source)
        loads, twists, _ = log.pairs()
        assert len(loads) == 50, source.name
        assert ((loads * twists).sum(axis=1) > 0).all(), source.name
        assert notes == []


def test_pairs_agree_with_the_authors_own(lab):
    """The (F, V) pairs that the authors stored with their results, F in (fx, fy, tau/rho)."""
    stored = scipy.io.loadmat(lab / "raw/SlidingExpCode/StablePushing/StableLC/results_lc_2.mat")["result_methods"]
    for i, folder in enumerate(("wood_30_90_30_30_30_90", "wood_10_90_10_10_30_130", "wood_patch")):
        (source,) = find_sources(lab / POKES / folder)
        loads, twists, _ = import_source(source)[0].pairs()
        loads, twists = normalize_wrench(loads, 0.05), normalize_twist(twists, 0.05)
        entry = stored[0, i][0, 0]
        for load, twist in zip(entry["F_train"], entry["V_train"], strict=True):
            match = int(np.argmin(angle_between(twists, twist)))
            assert np.degrees(angle_between(twists[match], twist)) < 0.002
            assert np.degrees(angle_between(loads[match], load)) < 0.08
            assert np.abs(loads[match] - load).max() < 0.005


def test_two_finger_logs_and_their_labels(lab):
    sources = find_sources(lab / "raw/PushExp", "mlab-stable")
    assert len(sources) >= 3
    labels: dict[str, dict[str, float]] = {}
    with open(lab / "labels.csv", encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            labels.setdefault(row["log"], {})[row["action"]] = float(row["stable"])
    agreed = total = 0
    for source in sources:
        log, _ = import_source(source)
        assert len(log) == 20
        assert set(log.trials["sense"]) <= {1.0, -1.0}
        for name, told in labels.items():
            if name in source.file.name:
                found = dict(zip(log.trials["trial"], log.trials["stable"], strict=True))
                agreed += sum(found[k] == v for k, v in told.items())
                total += len(told)
    # patch 17 is labelled stable though its log shows a miss of 64 mm
    assert (agreed, total) == (39, 40)


def raw_log(pushes=2, rows=12):
    lines = [str(pushes)]
    for i in range(pushes):
        lines += ["500 0 10 1 0 0 0", "515 1 10 0.9995 0 0 0.0316", str(rows)]
        lines += [f"{1000 + 30 * i + k / 10} {-0.01 - (0.5 * (k > 1)):.4f} {-0.5 * (k > 1):.4f}" for k in range(rows)]
        lines += ["3", *(f"{1000 + 30 * i + k} {495 + k} 30 50 1 0 0 0" for k in range(3))]
    return "\n".join(lines) + "\n"


def test_a_log_that_ends_early_gives_its_whole_records(tmp_path):
    folder = tmp_path / "wood_patch"
    folder.mkdir()
    text = raw_log(3)
    (folder / "a.txt").write_text(text[: text.rindex("\n", 0, -40)])
    (source,) = find_sources(tmp_path)
    assert source.name == "wood_patch"
    log, notes = import_source(source)
    assert len(log) == 2
    assert "declares 3 pushes and ends after 2" in notes[0]


def test_pushes_that_the_tracker_missed_are_left_out(tmp_path):
    path = tmp_path / "raw.txt"
    path.write_text(raw_log(2).replace("500 0 10 1 0 0 0", "0 0 0 0 0 0 0", 1))
    log, notes = import_source(find_sources(path)[0])
    assert len(log) == 1
    assert "push 1: left out" in notes[0]


def test_two_logs_of_one_arrangement_keep_apart(tmp_path):
    folder = tmp_path / "30_90_30_30_30_90"
    folder.mkdir()
    (folder / "a.txt").write_text(raw_log())
    (folder / "b c.txt").write_text(raw_log())
    (folder / "notes.txt").write_text("nothing of interest\n")
    names = [s.name for s in find_sources(tmp_path)]
    assert names == ["board_30_90_30_30_30_90_a", "board_30_90_30_30_30_90_b-c"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("two\n", "line 1"),
        ("1\n1 2 3\n", "line 2: expected 7"),
        (raw_log().replace("50 1 0", "nan 1 0"), "finite"),
        (raw_log().replace("50 1 0", "50 0 0"), "quaternion"),
        (raw_log().replace("500 0", "1e9 0"), "magnitudes"),
    ],
)
def test_broken_raw_logs_are_refused(tmp_path, text, message):
    path = tmp_path / "raw.txt"
    path.write_text(text)
    (source,) = find_sources(path, "mlab-poke")
    with pytest.raises(sp.InputError, match=message) as caught:
        import_source(source)
    assert str(path) in str(caught.value)


def test_a_log_of_plain_lists_comes_back_as_it_was_given(tmp_path):
    trials = {"trial": [1, 2], "start_time": [0, 1.5], "group": ["a", np.nan], "operator": ["Zoë", '"B", C']}
    samples = {
        "trial": ["1", "1", "2"],
        "t": [0, 1, 0],
        "x": [0.0, None, 2.0],
        "y": [0] * 3,
        "theta": (0, 1, 2),
        "shift": [1, 2, 3],
    }
    log = sp.PushLog(sp.Rig(triangle_slider("patch")), trials, samples)
    sp.write_pushlog(log, tmp_path / "log")
    again = sp.read_pushlog(tmp_path / "log")
    for table in (log, again):
        assert table.trials["trial"].tolist() == ["1", "2"] and table.trials["group"].tolist() == ["a", ""]
        assert table.trials["operator"].tolist() == ["Zoë", '"B", C']
        assert table.samples["trial"].tolist() == ["1", "1", "2"]
        np.testing.assert_array_equal(table.samples["x"], (0.0, np.nan, 2.0))
        with pytest.raises(ValueError, match="read-only"):
            table.samples["x"][0] = 1.0
    # numbers that the format does not know are text once they have been in a file
    np.testing.assert_array_equal(log.samples["shift"], (1.0, 2.0, 3.0))
    assert again.samples["shift"].tolist() == ["1", "2", "3"]
    # what is kept is not what was given
    given = np.zeros(3)
    log = sp.PushLog(log.rig, log.trials, {**log.samples, "fx": given})
    given[:] = 7
    assert not log.samples["fx"].any()


@pytest.mark.parametrize(
    ("table", "name", "values", "complaint"),
    [
        ("samples", "theta", None, "samples: column theta: missing column"),
        ("trials", "start_time", None, "trials: column start_time: missing column"),
        ("samples", "x", [0.0, 1.0], "samples: column x: expected 3 values, as many as trial has, got 2"),
        ("samples", "x", ["a", "b", "c"], "samples: column x: expected numbers"),
        ("samples", "x", np.zeros((3, 2)), "samples: column x: expected a list of values"),
        ("samples", "x", [[0, 1], 2, 3], "samples: column x: expected (numbers|a list)"),
        ("samples", "x", 1.0, "samples: column x: expected a list of values"),
        ("samples", "trial", ["1", "1", "3"], "samples: column trial: expected trials of trials, got '3'"),
    ],
)
def test_logs_that_are_none_are_refused_when_they_are_made(table, name, values, complaint):
    trials = {"trial": ["1", "2"], "start_time": [0, 1]}
    samples = {"trial": ["1", "1", "2"], "t": [0, 1, 0], "x": [0, 1, 2], "y": [0, 1, 2], "theta": [0, 1, 2]}
    changed = {"trials": trials, "samples": samples}[table]
    if values is None:
        del changed[name]
    else:
        changed[name] = values
    with pytest.raises(sp.InputError, match=complaint):
        sp.PushLog(sp.Rig(triangle_slider("patch")), trials, samples)
