"""A few of the fixed logs have the answers that are kept; ``answers.py`` compares all of them."""

import pytest
from parity.answers import answer, differences, read

KEPT = read()[0]
#: One of each family whose logs depend on nothing but this library.
ASKED = (
    "rig/none-1", "rig/tilt:slope=0.02/-0.01", "rig/tilt:slope=0.02/-0.01+latency:delay=0.05", "no forces/latency:delay=0.05",
    "alike/latency:delay=0.08-0", "several/drift:rate=-0.2",
)  # fmt: skip


@pytest.mark.parametrize("name", ASKED)
def test_a_diagnosis_says_what_it_said(name):
    kept, found = KEPT[name], answer(name)
    assert (found["verdict"], found["effects"]) == (kept["verdict"], kept["effects"])
    for effect in kept["effects"]:
        for place, value in kept["estimates"].items():
            if place.startswith(f"{effect}."):
                # last bits of other processors grow in a search
                assert found["estimates"][place] == pytest.approx(value, rel=1e-3)


def test_differences_are_found():
    before = {"a": 1.0, "b": [1.0, 2.0], "c": "none", "d": None}
    assert list(differences(before, before)) == []
    assert list(differences(before, {**before, "a": 1.0 + 1e-8})) == []
    changed = {"a": 1.001, "b": [1.0, 3.0], "c": "named", "e": 0}
    assert list(differences(before, changed)) == ["a: 1 -> 1.001", "b.1: 2 -> 3", "c: none -> named", "d: gone", "e: new"]
