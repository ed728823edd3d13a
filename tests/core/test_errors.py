"""An error carries its place, what was expected and what was got; it travels between processes."""

import pickle

import pytest

import stablepush as sp


def test_an_error_has_its_parts():
    with pytest.raises(sp.InputError) as caught:
        sp.Slider(((0, 0), (1, 0)))
    error = caught.value
    assert (error.place, error.expected, error.got, error.file) == ("slider.vertices", "expected at least 3 vertices", 2, "")
    assert str(error) == "slider.vertices: expected at least 3 vertices, got 2"


def test_an_error_of_a_file_has_its_key(tmp_path):
    file = tmp_path / "slider.json"
    file.write_text('{"format": "slider/1", "vertices": [[0, 0], [1, 0], [0, 1]], "mass": -1}', encoding="utf-8")
    with pytest.raises(sp.InputError) as caught:
        sp.load_slider(file)
    assert (caught.value.file, caught.value.place) == (str(file), "mass")


def test_an_error_of_a_table_has_its_line_and_column(tmp_path):
    file = tmp_path / "pushes.csv"
    file.write_text("edge,along\n0,0.05\n0,five\n", encoding="utf-8")
    scene = sp.PlanningProblem(
        sp.Slider.rectangle(0.1, 0.1, 1.0),
        sp.IdealLimitSurface(sp.SupportDistribution.ring(0.04, 12), 3.0),
        [sp.PushContact(((0, -0.05),), (0, 1), 0.5)],
        (0, 0, 0),
        (1, 0, 0),
    )
    with pytest.raises(sp.InputError) as caught:
        sp.read_commands(file, scene, 0.005)
    error = caught.value
    assert (error.file, error.place, error.got) == (str(file), "line 3: column along", "'five'")


def test_an_error_seen_from_further_out_keeps_its_parts():
    inner = sp.InputError("mass", "expected a number > 0", -1)
    outer = inner.within("slider", file="scene.json")
    assert str(outer) == "scene.json: slider: mass: expected a number > 0, got -1"
    assert (outer.got, outer.within(file="other.json").file) == (-1, "scene.json")


def test_errors_travel_between_processes():
    error = sp.InputError("mass", "expected a number > 0", -1, file="scene.json")
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == str(error)
    assert copy.file == "scene.json"
