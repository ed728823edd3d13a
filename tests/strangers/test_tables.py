"""What strangers do to a table of recordings: the same answer, or a refusal or a note that names the place.

Each transformation of a faultless table has an effect on the answer that is known.
"""

import math
import re

import numpy as np
import pytest
from recordings import mapping_file, recorded

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import rotate_vectors

NAMES = ("clock", "X", "Y", "yaw", "TX", "TY", "FX", "FY")
COLUMNS = dict(zip(("t", "x", "y", "theta", "tip_x", "tip_y", "fx", "fy"), NAMES, strict=True)) | {"trial": "push"}
#: Rows of a push.
ROWS = 151


def good():
    (t, poses, tips, forces), trials, _ = recorded()
    return np.column_stack((t, poses, tips, forces)), list(trials)


def moved(x=0.0, y=0.0, turn=0.0, turns=0):
    def change(rows, trials):
        for place in (slice(1, 3), slice(4, 6)):
            rows[:, place] = rotate_vectors(turn, rows[:, place]) + np.array((x, y))
        rows[:, 6:8] = rotate_vectors(turn, rows[:, 6:8])
        rows[:, 3] += turn + 2 * np.pi * turns
        return rows, trials

    return change


def later(rows, trials):
    rows[:, 0] += 1.7e9
    return rows, trials


def blocks_turned_round(rows, trials):
    order = np.concatenate([np.arange(k * ROWS, (k + 1) * ROWS) for k in (2, 0, 1)])
    return rows[order], [trials[k] for k in order]


def reversed_rows(rows, trials):
    return rows[::-1], trials[::-1]


def doubled_rows(rows, trials):
    return np.repeat(rows, 2, axis=0), [word for word in trials for _ in range(2)]


def step_back(rows, trials):
    rows[ROWS + 120 :, 0] -= 0.3
    return rows, trials


def renamed(word):
    def change(rows, trials):
        return rows, [f"{word}{name}" for name in trials]

    return change


def blank(columns, first, last):
    def change(rows, trials):
        rows[first:last, columns] = np.nan
        return rows, trials

    return change


def frozen(columns, first=0, last=None):
    def change(rows, trials):
        rows[first:last, columns] = rows[first, columns]
        return rows, trials

    return change


def stamps_only(rows, trials):
    rows[7::9, 1:] = np.nan
    return rows, trials


POSE, TIP, FORCE = slice(1, 4), slice(4, 6), slice(6, 8)


def noisy(force, seed=0):
    def change(rows, trials):
        rng = np.random.default_rng(seed)
        rows[:, FORCE] += rng.normal(0, force, size=(len(rows), 2))
        rows[:, POSE] += rng.normal(0, (1e-4, 1e-4, 1e-3), size=(len(rows), 3))
        return rows, trials

    return change


def quantised(step):
    def change(rows, trials):
        rows, trials = noisy(step / 4)(rows, trials)
        rows[:, FORCE] = step * np.round(rows[:, FORCE] / step)
        return rows, trials

    return change


def told(columns, value, first, last):
    """A value that stands for none."""

    def change(rows, trials):
        rows[first:last, columns] = value
        return rows, trials

    return change


def spikes(rows, trials):
    rows[130::ROWS, 6] += 50.0
    return rows, trials


def cut_off(limit):
    def change(rows, trials):
        rows, trials = noisy(0.02)(rows, trials)
        rows[:, FORCE] = np.clip(rows[:, FORCE], -limit, limit)
        return rows, trials

    return change


def dead(rows, trials):
    rows, trials = noisy(0.02)(rows, trials)
    rows[:, 7] = 0.0
    return rows, trials


def dead_heading(rows, trials):
    rows, trials = noisy(0.02)(rows, trials)
    rows[:, 3] = 0.3
    return rows, trials


def missed(rows, trials):
    rows, trials = noisy(0.02)(rows, trials)
    rows[ROWS : 2 * ROWS, POSE] = rows[ROWS, POSE] + np.random.default_rng(1).normal(0, (1e-4, 1e-4, 1e-3), size=(ROWS, 3))
    rows[ROWS : 2 * ROWS, FORCE] = np.random.default_rng(2).normal(0, 0.02, size=(ROWS, 2))
    return rows, trials


def called_twice(rows, trials):
    return rows, ["p0" if word == "p2" else word for word in trials]


SAME = {
    **{f"forces with noise of {size} N": (noisy(size, seed=k), 0.15) for k, size in enumerate((0.05, 0.1, 0.2, 0.3))},
    "forces in steps of 0.2 N": (quantised(0.2), 0.1),
    "1 km away": (moved(1000.0, -1000.0), 1e-6),
    "500 km away": (moved(5e5, 3e5), 1e-4),
    "turned by 1 rad": (moved(turn=1.0), 1e-9),
    "turned by 50 turns": (moved(turns=50), 1e-9),
    "seconds since 1970": (later, 1e-4),
    "pushes in another order": (blocks_turned_round, 1e-9),
    "rows of a lost tracker": (stamps_only, 1e-9),
    **{f"named {word!r}": (renamed(word), 1e-9) for word in ("$\\frac{$", "\x1b[31m", "=1+1", "é" * 300, "<b>", "{{7*7}}")},
}
NOTED = {
    "a lost tracker says -9999": (told(POSE, -9999.0, 120, 140), r"the tracker leaps away and back once, .* push p0: 20 poses"),
    "a lost tracker says 0": (
        told(POSE, 0.0, ROWS + 110, ROWS + 140),
        r"the tracker leaps away and back once, .* push p1: 30 poses",
    ),
    "spikes of the force": (spikes, r"the force leaps away and back 3 times, at first 1\.3 s .* push p0: 3 forces are left out"),
    "a force of -9999": (told(FORCE, -9999.0, 120, 124), r"the force leaps away and back once, .* 4 forces are left out"),
    "forces cut off": (cut_off(0.7), r"f[xy] is 0\.7 at most, in \d+ rows: is the sensor saturated"),
    "a dead channel": (dead, r"fy is 0 in all rows, while the other component changes"),
    "a dead channel of the tracker": (dead_heading, r"theta does not change in any push, while other poses do"),
    "no tip in a push": (blank(TIP, 100, ROWS), r"in 1 of 3 pushes \(p0\) the place of the tip is missing .* they show no load"),
    "no forces in a push": (blank(FORCE, 100, ROWS), r"in 1 of 3 pushes \(p0\) the force is missing .* they show no load"),
    "one pose in a push": (blank(POSE, 103, ROWS - 1), r"in 1 of 3 pushes \(p0\) fewer than two rows have a pose"),
    "three poses in a push": (blank(POSE, 113, ROWS - 2), r"in 1 of 3 pushes \(p0\) the pose is missing for up to 0\.3"),
    "a finger that misses": (missed, r"in 1 of 3 pushes \(p1\) the slider does not move: did the finger miss"),
    "the tracker ends": (blank(POSE, 2 * ROWS, None), r"poses cover .* of 21\.5 s"),
    "no pose in a push": (blank(POSE, 100, ROWS), r"1 of 3 pushes \(p0\) fewer than two rows have a pose"),
    "no pose for a while": (blank(POSE, 110, 140), r"in 1 of 3 pushes \(p0\) the pose is missing for up to 0\.3"),
    "forces stuck": (frozen(FORCE, 120), r"forces do not change in 2 of 3 pushes \(p1, p2\)"),
    "forces stuck from the first": (frozen(FORCE), r"forces do not change in any push"),
    "tracker frozen in a push": (frozen(POSE, ROWS, 2 * ROWS), r"poses do not change in 1 of 3 pushes \(p1\)"),
    "robot frozen in a push": (frozen(TIP, ROWS, 2 * ROWS), r"tip positions do not change in 1 of 3 pushes \(p1\)"),
}
REFUSED = {
    "a name twice": (called_twice, r"line 304: column push: expected the rows of a push to follow each other, p0 is there twice"),
    "rows reversed": (reversed_rows, r"line \d+: column clock: expected times that grow"),
    "rows doubled": (doubled_rows, r"line \d+: column clock: expected times that grow"),
    "clock set back": (step_back, r"line \d+: column clock: expected times that grow"),
}


def run(folder, capsys, change):
    rows, trials = change(*good())
    lines = [",".join([*NAMES, "push"])]
    for row, word in zip(rows.tolist(), trials, strict=True):
        quoted = '"' + word.replace('"', '""') + '"'
        lines.append(",".join(["" if math.isnan(v) else repr(v) for v in row] + [quoted]))
    table = folder / "table.csv"
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    mapping = mapping_file(folder, columns=COLUMNS)
    code = main(["import", str(table), "--mapping", str(mapping), "-o", str(folder / "log")])
    said = capsys.readouterr()
    for line in (said.out + said.err).splitlines():
        assert line.isprintable()
    return code, said.err


@pytest.mark.parametrize("what", SAME)
def test_the_answer_is_the_same(what, tmp_path, capsys):
    change, tolerance = SAME[what]
    code, said = run(tmp_path, capsys, change)
    # of a noisy tracker the window is told
    assert code == 0 and "note" not in said.replace("note: the tracker is noisy", "")
    _, _, loads = recorded()
    found = sp.read_pushlog(tmp_path / "log").pairs()
    order = np.argsort([name[-1] for name in found.trials])
    assert found.wrenches[order] == pytest.approx(loads, abs=tolerance)


@pytest.mark.parametrize("what", NOTED)
def test_a_note_names_what_is_lost(what, tmp_path, capsys):
    change, words = NOTED[what]
    code, said = run(tmp_path, capsys, change)
    assert code == 0
    notes = [line for line in said.splitlines() if line.startswith("note: ")]
    assert any(re.search(words, line) for line in notes), notes
    # no load is made up
    _, _, loads = recorded()
    pairs = sp.read_pushlog(tmp_path / "log").pairs()
    for name, load in zip(pairs.trials, pairs.wrenches, strict=True):
        if not {"forces", "frozen", "channel"} & set(what.split()):
            assert load == pytest.approx(loads[int(name[1:])], abs=0.05 if "misses" in what else 1e-9)


@pytest.mark.parametrize("pieces", [5, 25, 75])
def test_no_load_is_made_of_pieces_of_a_push(pieces, tmp_path, capsys):
    """Each piece has a name of its own; most are too short to show that anything moves, or a rest."""

    def split(rows, trials):
        rows, trials = noisy(0.02)(rows, trials)
        return rows, [f"p1/{k % ROWS * pieces // ROWS}" if word == "p1" else word for k, word in enumerate(trials)]

    code, said = run(tmp_path, capsys, split)
    assert code == 0
    (told,) = re.findall(rf"in (\d+) of {pieces + 2} pushes \(p1/0, p1/1, p1/2.*\) the slider does not move", said)
    pairs, (_, _, loads) = sp.read_pushlog(tmp_path / "log").pairs(), recorded()
    assert len(pairs.trials) == pieces + 2 - int(told)
    for name, load in zip(pairs.trials, pairs.wrenches, strict=True):
        assert load == pytest.approx(loads[int(name[1])], abs=0.1)


def test_pushes_that_a_frozen_tracker_hides_are_told(tmp_path, capsys):
    """Without names of pushes only motion tells them."""
    rows, _ = frozen(POSE, ROWS + 50)(*noisy(0.02)(*good()))
    table = tmp_path / "table.csv"
    table.write_text("\n".join([",".join(NAMES), *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n", encoding="utf-8")
    mapping = mapping_file(tmp_path, columns={name: column for name, column in COLUMNS.items() if name != "trial"})
    assert main(["import", str(table), "--mapping", str(mapping), "-o", str(tmp_path / "log")]) == 0
    assert (
        "2 times a force acts while the tip moves and the slider is not seen to move, at first t = 11 s"
        in capsys.readouterr().err
    )
    assert len(sp.read_pushlog(tmp_path / "log").pairs().trials) == 1


@pytest.mark.parametrize("what", REFUSED)
def test_a_refusal_names_the_line(what, tmp_path, capsys):
    change, words = REFUSED[what]
    code, said = run(tmp_path, capsys, change)
    (line,) = said.splitlines()
    assert code == 2 and "table.csv" in line and re.search(words, line)
    assert not (tmp_path / "log").exists()
