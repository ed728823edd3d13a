"""Pushes of the MIT data set: files with a known truth, written here, come back to rounding; bad ones give one line."""

import json

import numpy as np
import pytest
from conftest import one_line
from recordings import SLIDER, imported, recorded, slider_file

import stablepush as sp
from stablepush.cli import main


def mit_file(folder, k, shift=(0.0, 0.0), reaction=True, ending=".json", **changes):
    """One push, three clocks of 250 Hz since 1970."""
    (t, poses, tips, forces), trials, loads = recorded(rate=250.0, twist=(0.002, 0.02, 0.0))
    rows = [row for row, word in enumerate(trials) if word == f"p{k}"]
    clock = 1.4e9 + t[rows]
    where = poses[rows].copy()
    c, s = np.cos(where[:, 2]), np.sin(where[:, 2])
    where[:, 0] -= c * shift[0] - s * shift[1]
    where[:, 1] -= s * shift[0] + c * shift[1]
    sign = -1.0 if reaction else 1.0
    late = tips[rows] + 0.0013 * np.gradient(tips[rows], clock, axis=0)
    data = {
        "object_pose": np.column_stack((clock, where)),
        "tip_pose": np.column_stack((clock + 0.0013, late, np.zeros(len(rows)))),
        "ft_wrench": np.column_stack((clock - 0.0007, sign * forces[rows], np.zeros(len(rows)))),
    } | changes  # fmt: skip
    path = folder / f"motion_surface=plywood_shape=hex_a=0_v=20_i={k}.000_s=0.300_t=-0.349{ending}"
    if ending == ".json":
        path.write_text(json.dumps({name: np.asarray(value).tolist() for name, value in data.items()}), encoding="utf-8")
    else:
        h5py = pytest.importorskip("h5py", reason="h5py is not installed")
        with h5py.File(path, "w") as file:
            for name, value in data.items():
                file[name] = value
    return path, loads[k], poses[rows]


@pytest.mark.parametrize("ending", [".json", ".h5"])
@pytest.mark.parametrize("reaction", [True, False])
def test_mit_pushes(tmp_path, capsys, ending, reaction):
    folder = tmp_path / "hex"
    folder.mkdir()
    # the outline is given about another point than its centroid
    shift = np.array((0.01, 0.005))
    outline = slider_file(tmp_path, sp.Slider(SLIDER.vertices + shift, 0.8))
    truths = [mit_file(folder, k, shift, reaction, ending) for k in range(3)]
    imported(capsys, folder, "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert len(log) == 3
    assert log.rig.finger_radius == 0.00475
    assert log.rig.slider.vertices == pytest.approx(SLIDER.vertices, abs=1e-12)
    assert log.trials["speed"] == pytest.approx(0.02)
    assert log.trials["direction"].astype(float) == pytest.approx(-0.349)
    assert log.trials["edge"].astype(float) == pytest.approx([0, 1, 2])
    assert log.trials["start_time"] == pytest.approx([0.0, 10.0, 20.0], abs=1e-6)
    pairs = log.pairs()
    for k, (_, load, poses) in enumerate(truths):
        rows = log.rows(str(k + 1))
        # the first bin of contact is part at rest
        assert np.median(log.columns("fx", "fy", "tau")[rows][-20:], axis=0) == pytest.approx(load, rel=2e-3, abs=2e-3)
        assert log.columns("x", "y", "theta")[rows][0] == pytest.approx(poses[0], abs=1e-6)
        assert pairs.wrenches[k] == pytest.approx(load, rel=0.05, abs=0.02)


def test_mit_pushes_in_millimetres_or_about_another_origin_are_noted(tmp_path, capsys):
    folder = tmp_path / "hex"
    folder.mkdir()
    outline = slider_file(tmp_path)
    path, _, _ = mit_file(folder, 0, shift=(0.02, 0.03))
    command = ["import", folder, "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "log"]
    imported(capsys, *command[1:])
    assert "the slider's outline, with a finger of 4.75 mm radius" in capsys.readouterr().err
    data = json.loads(path.read_text(encoding="utf-8"))
    for name, columns in (("object_pose", 3), ("tip_pose", 3)):
        data[name] = [[row[0], *(1000 * v for v in row[1:columns]), *row[columns:]] for row in data[name]]
    path.write_text(json.dumps(data), encoding="utf-8")
    imported(capsys, *command[1:])
    assert "units (length)?" in capsys.readouterr().err


def test_folders_of_the_same_name_become_different_logs(tmp_path, capsys):
    outline = slider_file(tmp_path)
    for surface in ("abs", "plywood"):
        (tmp_path / "raw" / surface / "hex").mkdir(parents=True)
        path, _, _ = mit_file(tmp_path / "raw" / surface / "hex", 0)
        path.rename(path.with_name(path.name.replace("plywood", surface)))
    imported(capsys, tmp_path / "raw", "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "logs")
    assert sorted(p.name for p in (tmp_path / "logs").iterdir()) == ["hex_abs", "hex_plywood"]


def test_mit_pushes_that_are_wrong_are_one_line_or_skipped(tmp_path, capsys):
    folder = tmp_path / "hex"
    folder.mkdir()
    outline = slider_file(tmp_path)
    path, _, _ = mit_file(folder, 0)
    command = ["import", folder, "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "log"]
    one_line(capsys, command[:4] + command[6:], "--slider: expected the outline in the frame of object_pose")
    kept = json.loads(path.read_text(encoding="utf-8"))
    gap = {name: [row for k, row in enumerate(rows) if not 30 < k < 90] for name, rows in kept.items()}
    for broken, words in (
        ({**kept, "tip_pose": [[0.0, 1.0]]}, "tip_pose: expected two or more rows"),
        ({name: rows for name, rows in kept.items() if name != "ft_wrench"}, "ft_wrench: missing key"),
        (gap, "object_pose: expected samples at most 0.1 s apart"),
        ({**kept, "tip_pose": [[row[0] + 100, *row[1:]] for row in kept["tip_pose"]]}, "tip_pose: expected samples at the time"),
        ({**kept, "object_pose": [[*row[:3], "a"] for row in kept["object_pose"]]}, "object_pose: expected rows of numbers"),
    ):
        path.write_text(json.dumps(broken), encoding="utf-8")
        one_line(capsys, command, path.name, words)
    # beside others that can be read, it is skipped with a note
    mit_file(folder, 1)
    assert main(list(map(str, command))) == 0
    assert "skipped" in capsys.readouterr().err
    assert len(sp.read_pushlog(tmp_path / "log")) == 1
    (folder / "motion_surface=abs_shape=hex_a=0.json").write_text("{}", encoding="utf-8")
    one_line(capsys, command, "expected the pushes of one shape on one surface")
