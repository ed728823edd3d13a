"""Mistakes that everybody makes once (``mistakes.py``): one line that says what is wrong, or a note where it may be meant."""

import pytest
from conftest import make_files
from mistakes import MISTAKES, tried


@pytest.mark.parametrize("mistake", MISTAKES, ids=[mistake.what for mistake in MISTAKES])
def test_a_mistake_is_told(rig, tmp_path, mistake):
    code, out, err, _ = tried(mistake, rig, tmp_path)
    assert code == mistake.code, (out, err)
    for word in mistake.words:
        assert word in err + (out if code == 1 else ""), (out, err)
    lines = err.splitlines()
    assert len(lines) == len(set(lines))
    if code == 2:
        assert len(lines) == 1
        assert lines[0].startswith("stablepush: error: ")
        assert not (tmp_path / "out").exists()
    else:
        assert all(line.startswith("note: ") for line in lines), err


def test_a_rig_in_order_gives_no_note(tmp_path, capsys):
    """All that is made here has the units of a laboratory."""
    make_files(tmp_path / "rig")
    assert capsys.readouterr().err == ""
