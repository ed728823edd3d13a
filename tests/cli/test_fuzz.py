"""Broken inputs of every kind, a few hundred of each: taken or refused, and nothing else."""

import json

import numpy as np
from breaking import broken_bytes, broken_json, broken_table, places
from fuzzing import fuzz, seeds

import stablepush as sp


def test_readers_and_commands_take_or_refuse():
    tallies = fuzz(inputs=120, seed=0)
    for name, tally in tallies.items():
        assert not tally.crashes, f"{name}: {tally.crashes[0]}"
        assert not tally.hangs, name
        assert tally.inputs == (12 if name.startswith("stablepush") else 120)
    # what breaks everything tests nothing but the first check
    assert sum(t.taken for t in tallies.values()) > 0.1 * sum(t.inputs for t in tallies.values())
    assert sum(t.refused for t in tallies.values()) > 0.3 * sum(t.inputs for t in tallies.values())


def test_a_crash_is_found(monkeypatch):
    """A fuzzer that finds nothing in a broken reader would be worth nothing."""
    good = sp.load_slider

    def careless(path):
        value = json.loads(path.read_text(encoding="utf-8"))
        return [vertex[1] for vertex in value["vertices"]] and good(path)

    monkeypatch.setattr(sp, "load_slider", careless)
    tally = fuzz(inputs=200, seed=0, only=["slider"])["slider"]
    assert len(tally.crashes) > 10
    for kind in ("KeyError", "TypeError"):
        assert any(kind in text for text in tally.crashes)


def test_a_hang_is_found(monkeypatch):
    monkeypatch.setattr("fuzzing.PATIENCE", 0.2)
    calls = []

    def stuck(path):
        calls.append(path)
        while len(calls) > 1:  # the first, unbroken input is read
            pass
        return path

    monkeypatch.setattr(sp, "load_contact", stuck)
    assert fuzz(inputs=2, seed=0, only=["contact"])["contact"].hangs == 2


def test_breaking_breaks(tmp_path):
    rng = np.random.default_rng(0)
    good = seeds(tmp_path)
    for way, file in ((broken_bytes, good["slider"]), (broken_json, good["scene"]), (broken_table, good["cors"])):
        data = file.read_bytes()
        assert np.mean([way(data, rng) != data for _ in range(100)]) > 0.85
    assert set(places({"a": [1, {"b": 2}]})) == {(), ("a",), ("a", 0), ("a", 1), ("a", 1, "b")}
