"""Tables of recordings: files with a known truth, written here, come back to rounding; bad ones give one line."""

import numpy as np
import pytest
from conftest import one_line
from recordings import RADIUS, SLIDER, imported, mapping_file, recorded

import stablepush as sp
from stablepush.cli import main

COLUMNS = {
    "t": "clock",
    "x": "X",
    "y": "Y",
    "theta": "yaw",
    "tip_x": "TX",
    "tip_y": "TY",
    "fx": "FX",
    "fy": "FY",
    "trial": "push",
}
UNITS = {"time": "ms", "length": "mm", "angle": "deg"}


def table(folder):
    (t, poses, tips, forces), trials, loads = recorded()
    numbers = np.column_stack((1000 * t, 1000 * poses[:, :2], np.degrees(poses[:, 2]), 1000 * tips, forces)).tolist()
    names = ["clock", "X", "Y", "yaw", "TX", "TY", "FX", "FY"]
    rows = [",".join([*map(repr, row), word]) for row, word in zip(numbers, trials, strict=True)]
    path = folder / "table.csv"
    path.write_text("\n".join([",".join([*names, "push"]), *rows]) + "\n", encoding="utf-8")
    return path, poses, loads


def test_a_table_in_millimetres_and_degrees(tmp_path, capsys):
    path, poses, loads = table(tmp_path)
    mapping = mapping_file(tmp_path, columns=COLUMNS, units=UNITS)
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert log.columns("x", "y", "theta") == pytest.approx(poses, abs=1e-12)
    assert log.pairs().wrenches == pytest.approx(loads, abs=1e-9)
    assert (log.rig.finger_radius, log.rig.contact_friction) == (RADIUS, 0.5)


@pytest.mark.parametrize(("axes", "up"), [("tip", 1), ("tip-z-down", -1)])
def test_forces_in_the_axes_of_a_tool_are_turned_into_the_world(axes, up, tmp_path, capsys):
    """A sensor that turns with the tool, whose heading is a column; without that column nobody knows its axes. The z of a flange
    points down: its y is to the other side."""
    (t, poses, tips, forces), trials, loads = recorded()
    heading = 0.7 + 0.4 * t
    c, s = np.cos(heading), np.sin(heading)
    read = np.column_stack((c * forces[:, 0] + s * forces[:, 1], up * (c * forces[:, 1] - s * forces[:, 0])))
    numbers = np.column_stack((t, poses, tips, heading, read)).tolist()
    rows = [",".join([*map(repr, row), word]) for row, word in zip(numbers, trials, strict=True)]
    path = tmp_path / "tool.csv"
    path.write_text("\n".join(["clock,X,Y,yaw,TX,TY,TH,FX,FY,push", *rows]) + "\n", encoding="utf-8")
    mapping = mapping_file(tmp_path, columns=COLUMNS | {"tip_theta": "TH"}, force_axes=axes)
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    assert sp.read_pushlog(tmp_path / "log").pairs().wrenches == pytest.approx(loads, abs=1e-9)
    for entries, place in (
        ({"columns": COLUMNS, "force_axes": "tip"}, "columns.tip_theta: missing key"),
        ({"columns": COLUMNS, "force_axes": "flange"}, "force_axes: expected"),
    ):
        mapping = mapping_file(tmp_path, **entries)
        assert main(["import", str(path), "--kind", "csv", "--mapping", str(mapping), "-o", str(tmp_path / "no")]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert place in line


def test_what_a_table_cannot_be_is_noted(tmp_path, capsys):
    """Forces on the finger, metres for millimetres, and no rows at rest: one line each, and the log is made."""
    path, _, _ = table(tmp_path)

    def notes(**entries):
        mapping = mapping_file(tmp_path, **{"columns": COLUMNS, "units": UNITS, **entries})
        assert main(["import", str(path), "--kind", "csv", "--mapping", str(mapping), "-o", str(tmp_path / "log")]) == 0
        return [line for line in capsys.readouterr().err.splitlines() if "note: " in line]

    assert not notes()
    # a mapping says that it is a table
    mapping = mapping_file(tmp_path, columns=COLUMNS, units=UNITS)
    assert main(["import", str(path), "--mapping", str(mapping), "-o", str(tmp_path / "log")]) == 0
    assert capsys.readouterr().out.startswith(f"{tmp_path / 'log'}: csv, 3 pushes")
    assert main(["import", str(path), "-o", str(tmp_path / "other")]) == 2
    assert "those of kind csv or rosbag need --mapping, and --kind where no suffix tells" in capsys.readouterr().err
    assert main(["diagnose", str(path)]) == 2
    assert "stablepush import makes one of other logs" in capsys.readouterr().err
    (far,) = notes(noise={"force": 0.1, "position": 2e-4, "angle": 0.2})
    assert "an angle known to 0.2 rad looks like degrees" in far
    (turned,) = notes(forces_on="finger")
    assert "in 3 of 3 pushes (p0, p1, p2) the force opposes the motion: is its sign wrong (forces_on)" in turned
    assert "or are its axes those of the tool" in turned
    (elsewhere,) = notes(body_pose=[0.5, 0.3, 0.0])
    assert "the centre of the tip is" in elsewhere
    assert "mm outside the slider's outline, with a finger of 5 mm radius: units (length, angle), body_pose" in elsewhere
    # metres for the degrees and the millimetres of the table
    assert {note.rpartition(": ")[2] for note in notes(units={"time": "ms"})} >= {"units (length, angle), body_pose, outline?"}
    assert any("mm/s, and rows are 10 s apart: units (time, length)?" in note for note in notes(units={**UNITS, "time": "s"}))
    lines = path.read_text().splitlines()
    # the tracker lost the slider for 0.2 s in the first push
    path.write_text("\n".join(lines[:115] + lines[135:]) + "\n")
    (lost,) = notes()
    assert "in 1 of 3 pushes (p0) rows are missing, for up to 0.21 s (usual: 0.01 s between two)" in lost
    # the second before each push is left out
    moving = [line for k, line in enumerate(lines[1:]) if k % 151 >= 100]
    path.write_text("\n".join([lines[0], *moving]) + "\n")
    assert any("3 of 3 pushes (p0, p1, p2) have fewer than 3 rows at rest" in note for note in notes())


BAD_TABLES = [
    ({"columns": {**COLUMNS, "x": "gone"}}, "table.csv: line 1: column gone: missing column"),
    ({"columns": {**COLUMNS, "x": COLUMNS["x"] + "s"}}, f"column {COLUMNS['x']}s: missing column; did you mean {COLUMNS['x']}?"),
    ({"columns": {**COLUMNS, "x": 3}}, "mapping.yaml: columns.x: expected a string, got 3"),
    ({"columns": {k: v for k, v in COLUMNS.items() if k != "theta"}}, "mapping.yaml: columns.theta: missing key"),
    ({"columns": {k: v for k, v in COLUMNS.items() if k != "fy"}}, "mapping.yaml: columns.fy: missing key"),
    ({"columns": COLUMNS, "units": {"length": "inch"}}, 'mapping.yaml: units.length: expected "m" or "cm" or "mm"'),
    ({"columns": COLUMNS, "forces_on": "air"}, 'mapping.yaml: forces_on: expected "slider"'),
    ({"columns": COLUMNS, "zero_forces": 1}, "mapping.yaml: zero_forces: expected true or false, got 1"),
    ({"columns": COLUMNS, "body_pose": [0, 0]}, "mapping.yaml: body_pose: expected 3 numbers, got 2"),
    ({"columns": COLUMNS, "slider": "none.json"}, "none.json: cannot read"),
    ({}, "mapping.yaml: columns: missing key"),
    (
        {"columns": COLUMNS, "noise": {"position": 0.2, "angle": 0.0035}},
        "mapping.yaml: noise.position: expected less than the size of the slider",
    ),
    ({"columns": {**COLUMNS, "trial": "X"}}, "mapping.yaml: columns.trial: expected a column of its own, got 'X'"),
    (
        {"columns": {**COLUMNS, "trial": "push"}, "trial_columns": {"start_time": "FY"}},
        "mapping.yaml: trial_columns.start_time: expected another name",
    ),
    (
        {"columns": {**COLUMNS, "trial": "push"}, "trial_columns": {"cor_x": "push"}},
        "mapping.yaml: trials: column cor_x: expected numbers",
    ),
]


@pytest.mark.parametrize(("entries", "words"), BAD_TABLES, ids=[words[:45] for _, words in BAD_TABLES])
def test_a_mapping_that_is_wrong_is_one_line(tmp_path, capsys, entries, words):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, **entries)
    one_line(capsys, ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"], words)
    assert not (tmp_path / "log").exists()


def test_a_table_of_an_executed_plan(tmp_path, capsys):
    """Two fingers, the surface of the plan, a moment about the tip, and a column of one's own."""
    path, _, _ = table(tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    more = [lines[0] + ",M,RH", *(f"{line},0.0,{40 + int(line[-1])}" for line in lines[1:])]
    path.write_text("\n".join(more) + "\n", encoding="utf-8")
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(SLIDER.vertices, 0.02), 2.0)
    sp.save_model(surface, tmp_path / "model.json")
    given = {"contact_kind": "two-point", "finger_distance": 0.02, "model": "model.json", "trial_columns": {"humidity": "RH"}}
    mapping = mapping_file(tmp_path, columns={**COLUMNS, "moment": "M"}, units=UNITS, **given)
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert log.rig.model is not None and log.rig.contact_kind == "two-point"
    assert log.trials["humidity"].astype(float) == pytest.approx([40, 41, 42])
    apart = np.linalg.norm(log.columns("c1x", "c1y") - log.columns("c2x", "c2y"), axis=1)
    assert np.nanmedian(apart) == pytest.approx(0.02, abs=1e-4)
    # millimetres for metres, and none at all
    command = ["import", str(path), "--kind", "csv", "--mapping", str(mapping), "-o", str(tmp_path / "other")]
    mapping_file(tmp_path, columns={**COLUMNS, "moment": "M"}, units=UNITS, **given | {"finger_distance": 20.0})
    assert main(command) == 2
    assert f"{mapping}: finger_distance: expected fingers that both reach the slider, at most 0." in capsys.readouterr().err
    del given["finger_distance"]
    mapping_file(tmp_path, columns={**COLUMNS, "moment": "M"}, units=UNITS, **given)
    assert main(command) == 0
    assert "finger_distance is not given: where the two fingers touch is not known" in capsys.readouterr().err


def test_pushes_that_nothing_parts_are_noted(tmp_path, capsys):
    """Rows at rest left out, and no column of trials: all is one push, which is said."""
    path, _, _ = table(tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    first = [line for line in lines[1:] if line.endswith(lines[1].rsplit(",", 1)[1])]
    path.write_text("\n".join([lines[0], *first]) + "\n", encoding="utf-8")
    mapping = mapping_file(tmp_path, columns={k: v for k, v in COLUMNS.items() if k != "trial"}, units=UNITS)
    command = ["import", str(path), "--kind", "csv", "--mapping", str(mapping), "-o", str(tmp_path / "log")]
    assert main(command) == 0
    assert "one push was found" in capsys.readouterr().err
    assert len(sp.read_pushlog(tmp_path / "log")) == 1


def test_the_noise_of_a_log_without_forces_needs_none_of_them(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    columns = {k: v for k, v in COLUMNS.items() if k not in ("fx", "fy")}
    mapping = mapping_file(tmp_path, columns=columns, units=UNITS, noise={"position": 1e-4, "angle": 1e-3})
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    assert sp.read_pushlog(tmp_path / "log").rig.noise == sp.Noise(0.0, 1e-4, 1e-3)


MORE_BAD_TABLES = [
    ({"columns": {k: v for k, v in COLUMNS.items() if k != "tip_y"}}, "mapping.yaml: columns.tip_y: missing key"),
    ({"columns": {k: v for k, v in COLUMNS.items() if k not in ("tip_x", "tip_y")}}, "mapping.yaml: columns.tip_x: missing key"),
]


@pytest.mark.parametrize(("entries", "words"), MORE_BAD_TABLES, ids=[words[:45] for _, words in MORE_BAD_TABLES])
def test_columns_that_need_others(tmp_path, capsys, entries, words):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, **entries)
    one_line(capsys, ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"], words)


def test_what_stands_in_a_table_that_is_wrong(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, columns=COLUMNS, units=UNITS)
    command = ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"]
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines[:6], lines[5], *lines[7:]]) + "\n", encoding="utf-8")
    one_line(capsys, command, "table.csv: line 7: column clock: expected times that grow within trial p0")
    path.write_text("\n".join([lines[0], *(line.rpartition(",")[0] + "," for line in lines[1:])]) + "\n", encoding="utf-8")
    one_line(capsys, command, "table.csv: column push: expected a name in at least one row")
    # a date is no text, and what is wrong for all tables is said once
    (tmp_path / "other.csv").write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    text = mapping.read_text(encoding="utf-8").replace("slider: slider.json", "slider: 2020-01-01")
    mapping.write_text(text, encoding="utf-8")
    one_line(capsys, ["import", tmp_path, *command[2:]], "mapping.yaml: slider: expected an object")
    # a source is never written over
    one_line(capsys, ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path], "expected a place outside")


def test_numbers_with_an_exponent_and_no_point_are_numbers(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, columns=COLUMNS, units=UNITS)
    mapping.write_text(mapping.read_text() + "noise: {force: 2e-2, position: 1.0e-4, angle: .1E-2}\n")
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    assert sp.read_pushlog(tmp_path / "log").rig.noise == sp.Noise(0.02, 1e-4, 1e-3)
    capsys.readouterr()
    one_line(
        capsys, ["import", path, "--kind", "rosbag", "--mapping", mapping, "-o", tmp_path / "bag"], "of kind rosbag, found none"
    )


def test_yaml_that_is_none_is_one_line(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    mapping = tmp_path / "m.yaml"
    command = ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"]
    for text, words in (
        ("a: [1", "line 1 column 6: expected YAML"),
        ("a: 1\na: 2\n", "the key a stands twice"),
        ("- 1\n", "expected an object"),
        ("1: 2\n", "expected words as keys, got 1"),
        ("columns: !!python/object:os.system {}\n", "expected YAML"),
        ("a: &x [*x]\n", "m.yaml"),
    ):
        mapping.write_text(text, encoding="utf-8")
        one_line(capsys, command, words)
    one_line(capsys, ["import", path, "--kind", "csv", "-o", tmp_path / "log"], "--mapping: expected a YAML file")
    one_line(capsys, ["import", path, "-o", tmp_path / "log"], "found none (those of kind csv or rosbag need")
    one_line(
        capsys, ["import", path, "--mapping", mapping, "--kind", "mlab-poke", "-o", tmp_path / "log"], "--mapping: expected none"
    )
