"""What may be wrong with recordings of laboratories: the same answer, or a refusal or a note that names the place."""

import json
import re

import numpy as np
import pytest
from recordings import recorded, slider_file
from test_mit_push import mit_file

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import rotate_vectors

POSE, TIP, FORCE = "object_pose", "tip_pose", "ft_wrench"


def moved(x=0.0, y=0.0, turn=0.0, turns=0):
    def change(data, number):
        for name in (POSE, TIP):
            data[name][:, 1:3] = rotate_vectors(turn, data[name][:, 1:3]) + np.array((x, y))
            data[name][:, 3] += turn
        data[POSE][:, 3] += 2 * np.pi * turns
        data[FORCE][:, 1:3] = rotate_vectors(turn, data[FORCE][:, 1:3])

    return change


def of_clock(told):
    def change(data, number):
        for values in data.values():
            values[:, 0] = told(values[:, 0])

    return change


def of_rows(name, change_rows, only=(0, 1, 2)):
    def change(data, number):
        if number in only:
            data[name] = change_rows(data[name])

    return change


def of_all_rows(change_rows):
    def change(data, number):
        data.update({name: change_rows(values) for name, values in data.items()})

    return change


def frozen(first=0):
    def change(values):
        values[first:, 1:] = values[first, 1:]
        return values

    return change


def half_frozen(data, number):
    """A tracker with noise, whose poses stay the same in most of a push."""
    rng = np.random.default_rng(number)
    data[POSE][:, 1:] += rng.normal(0, (1e-5, 1e-5, 1e-4), size=(len(data[POSE]), 3))
    if number == 1:
        frozen(260)(data[POSE])


def told_as_zero(values):
    values[280:330, 1:] = 0.0
    return values


def spiked(values):
    values[320:323, 1] += 200.0
    return values


def step_back(values):
    values[200:, 0] -= 0.3
    return values


def times(*factors):
    return lambda values: values * np.array(factors)


SAME = {
    "1 km away": (moved(1000.0, -1000.0), 1e-6),
    "500 km away": (moved(5e5, 3e5), 1e-4),
    "turned by 1 rad": (moved(turn=1.0), 1e-6),
    "turned by 50 turns": (moved(turns=50), 1e-6),
    "later": (of_clock(lambda t: t + 1e6), 1e-6),
    "rows doubled": (of_all_rows(lambda values: np.repeat(values, 2, axis=0)), 1e-6),
}
NOTED = {
    "tracker frozen": (of_rows(POSE, frozen(), (1,)), "poses do not change in 1 of 3 pushes"),
    "tracker frozen half-way": (half_frozen, "poses do not change in 1 of 3 pushes"),
    "robot frozen": (of_rows(TIP, frozen(), (1,)), "tip positions do not change in 1 of 3 pushes"),
    "sensor frozen": (of_rows(FORCE, frozen(), (1,)), "forces do not change in 1 of 3 pushes"),
    **{
        f"{name} ends": (of_rows(name, lambda values: values[:280], (1,)), f"{name} covers 1.12 of 1.5 s")
        for name in (POSE, TIP, FORCE)
    },
    **{
        f"{name} empty": (of_rows(name, lambda values: values[:0], (1,)), rf"skipped: .*i=1\.000.*{name}: expected two or more")
        for name in (POSE, TIP, FORCE)
    },
    "a lost tracker says 0": (of_rows(POSE, told_as_zero, (1,)), r"i=1\.000.*the tracker leaps away and back once"),
    "a spike of the force": (of_rows(FORCE, spiked, (1,)), r"i=1\.000.*the force leaps away and back once"),
    "poses in millimetres": (of_rows(POSE, times(1, 1000, 1000, 1)), r"units \(length"),
    "headings in degrees": (of_rows(POSE, times(1, 1, 1, 180 / np.pi)), r"off the outline"),
    "forces in grams": (of_rows(FORCE, times(1, 102, 102, 1)), r"units \(force, mass\)"),
}
REFUSED = {
    "rows reversed": (of_all_rows(lambda values: values[::-1]), f"{POSE}: expected stamps that grow"),
    **{
        f"clock of {name} set back": (of_rows(name, step_back), f"{name}: expected stamps that grow")
        for name in (POSE, TIP, FORCE)
    },
    "milliseconds": (of_clock(lambda t: 1000 * t), f"{POSE}: expected samples at most 0.1 s apart"),
}


def run(folder, capsys, change):
    (folder / "hex").mkdir()
    outline = slider_file(folder)
    for number in range(3):
        path, _, _ = mit_file(folder / "hex", number)
        data = {name: np.array(values) for name, values in json.loads(path.read_text(encoding="utf-8")).items()}
        change(data, number)
        path.write_text(json.dumps({name: values.tolist() for name, values in data.items()}), encoding="utf-8")
    arguments = ["import", folder / "hex", "--kind", "mit-push", "--slider", outline, "-o", folder / "log"]
    code = main(list(map(str, arguments)))
    return code, capsys.readouterr().err


@pytest.mark.parametrize("what", SAME)
def test_the_answer_is_the_same(what, tmp_path, capsys):
    change, tolerance = SAME[what]
    code, said = run(tmp_path, capsys, change)
    assert code == 0 and "note" not in said
    pairs = sp.read_pushlog(tmp_path / "log").pairs()
    _, _, loads = recorded(rate=250.0, twist=(0.002, 0.02, 0.0))
    assert pairs.wrenches == pytest.approx(loads, abs=tolerance)


@pytest.mark.parametrize("what", NOTED)
def test_a_note_names_what_is_wrong(what, tmp_path, capsys):
    change, words = NOTED[what]
    code, said = run(tmp_path, capsys, change)
    assert code == 0 and any(re.search(words, line) for line in said.splitlines() if line.startswith("note: ")), said


@pytest.mark.parametrize("what", REFUSED)
def test_a_refusal_names_the_channel(what, tmp_path, capsys):
    change, words = REFUSED[what]
    code, said = run(tmp_path, capsys, change)
    (line,) = said.splitlines()
    assert code == 2 and "motion_surface=plywood" in line and words in line
    assert not (tmp_path / "log").exists()


def pokes(change, count=3):
    """Three pokes as the Manipulation Lab writes them; the second is changed."""
    lines = [str(count)]
    for k in range(count):
        clock = 1000 + 30 * k + np.arange(12) / 10
        pushed = np.arange(12) > 1
        record = {
            "before": np.array((500.0, 0, 10, 1, 0, 0, 0)),
            "after": np.array((515.0, 1, 10, 0.9995, 0, 0, 0.0316)),
            "forces": np.column_stack((clock, -0.01 - 0.5 * pushed, -0.5 * pushed + 0.001 * np.sin(clock))),
            "robot": np.array([(1000.0 + 30 * k + i, 495 + i, 30, 50, 1, 0, 0, 0) for i in range(3)]),
        }
        if k == 1:
            change(record)
        for name in ("before", "after"):
            lines.append(" ".join(map(repr, record[name].tolist())))
        for name in ("forces", "robot"):
            lines += [str(len(record[name])), *(" ".join(map(repr, row)) for row in record[name].tolist())]
    return "\n".join(lines) + "\n"


def of(name, change_rows):
    def change(record):
        record[name] = change_rows(record[name].copy())

    return change


def back(rows):
    rows[len(rows) // 2 :, 0] -= 5
    return rows


def still(rows):
    rows[:, 1:] = rows[-1, 1:]
    return rows


POKES = {
    "clock of the forces set back": (of("forces", back), "those of the forces go back by 4.9 s"),
    "clock of the robot set back": (of("robot", back), "those of the robot go back by 4 s"),
    "forces reversed": (of("forces", lambda rows: rows[::-1]), "those of the forces go back by 0.1 s"),
    "another clock": (of("robot", lambda rows: rows + np.array((500.0, *[0] * 7))), "recorded at different times"),
    "sensor frozen": (of("forces", still), "its forces do not change"),
    "robot frozen": (of("robot", still), "the robot does not move"),
    "tracker frozen": (of("after", lambda _: np.array((500.0, 0, 10, 1, 0, 0, 0))), "poses before and after are the same"),
    "no quaternion": (of("after", lambda _: np.array((515.0, 1, 10, 0, 0, 0, 0))), "the tracked pose is tilted"),
    "few forces": (of("forces", lambda rows: rows[:5]), "expected at least 10 force and 2 robot rows"),
}


@pytest.mark.parametrize("what", [None, *POKES])
def test_a_poke_that_shows_nothing_is_left_out_and_said(what, tmp_path, capsys):
    change, words = POKES[what] if what else (lambda record: None, "")
    (tmp_path / "wood_patch").mkdir()
    (tmp_path / "wood_patch" / "a.txt").write_text(pokes(change), encoding="utf-8")
    assert main(["import", str(tmp_path / "wood_patch"), "-o", str(tmp_path / "log")]) == 0
    said = capsys.readouterr().err
    assert ("a.txt: push 2: left out, " in said) == bool(what) and words in said
    pairs = sp.read_pushlog(tmp_path / "log").pairs()
    assert len(pairs.trials) == (2 if what else 3)
    # the others are as they were
    assert pairs.wrenches == pytest.approx(np.tile((0.7075, -0.0225, 0.016), (len(pairs.trials), 1)), abs=2e-3)


@pytest.mark.parametrize("what", [None, "clock of the robot set back", "robot frozen", "tracker frozen"])
def test_a_rotation_that_shows_nothing_is_left_out_and_said(what, tmp_path, capsys):
    change, words = POKES[what] if what else (lambda record: None, "")
    folder = tmp_path / "stablepush" / "patch"
    folder.mkdir(parents=True)
    (folder / "exp_a_sensor20.txt").write_text(pokes(change), encoding="utf-8")
    action = "TwoPointRotation\n50 0 0\n50 200 0\n0 1 0\n3.6 10\n"
    (folder / "exp_a_pushaction20.txt").write_text("3\n" + 3 * action, encoding="utf-8")
    assert main(["import", str(folder / "exp_a_sensor20.txt"), "-o", str(tmp_path / "log")]) == 0
    said = capsys.readouterr().err
    assert ("sensor20.txt: push 2: left out, " in said) == bool(what) and words in said
    log = sp.read_pushlog(tmp_path / "log")
    assert log.rig.contact_kind == "two-point"
    assert [str(name) for name in log.trials["trial"]] == (["1", "3"] if what else ["1", "2", "3"])
