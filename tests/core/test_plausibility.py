"""What looks like another unit is noted, and what is only unusual is not."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from conftest import make_log, small_scene

import stablepush as sp
from stablepush.core.plausibility import note_cors
from stablepush.effects import parse_effect

pytestmark = pytest.mark.filterwarnings("error::stablepush.core.errors.PlausibilityWarning")

FEET = sp.SupportDistribution([(0.4, 0.4), (-0.4, 0.4), (0.0, -0.4)], [1, 1, 1])

USUAL = {
    "a loaded pallet": lambda: sp.Slider.rectangle(1.2, 0.8, 1500.0),
    "a table top": lambda: sp.Slider.rectangle(1.5, 0.8, 60.0),
    "a coin": lambda: sp.Slider.regular_polygon(40, 0.012, 0.0075),
    "a steel block": lambda: sp.Slider.rectangle(0.1, 0.1, 7.8),
    "a slider on feet": lambda: sp.Slider(sp.Slider.rectangle(1.0, 1.0).vertices, 30.0, FEET),
    "any heading": lambda: small_scene(tolerance=(0.01, math.pi)),
    "a wide tolerance": lambda: small_scene(tolerance=(0.3, math.pi / 2)),
    "headings over turns": lambda: small_scene(start=(0.2, 0.2, 6 * math.pi), goal=(0.9, 0.3, 6 * math.pi - 1.5)),
    "a place far from the origin": lambda: small_scene(
        start=(350.2, 0.2, 0.0), goal=(350.9, 0.3, 0.0), bounds=None, obstacles=()
    ),
    "rubber": lambda: sp.PushContact([(0.0, -0.05)], [(0.0, 1.0)], 1.8),
    "translations as rotation centres": lambda: note_cors([(1e4, 0.0), (0.0, -1e4), (1e6, 1e6)], 0.05, "cors"),
    "one rotation centre far away": lambda: note_cors([(20.0, 0.0)], 0.05, "cors"),
    "a steep slope": lambda: parse_effect("tilt:slope=0.2/-0.2"),
    "a turned sensor": lambda: parse_effect("force-rotation:angle=1.57"),
}

DOUBTFUL = {
    "mm": (lambda: sp.Slider.rectangle(100.0, 80.0), "radius of 64.03 m looks like millimetres"),
    "g": (lambda: sp.Slider.rectangle(0.1, 0.08, 250.0), r"250 kg looks like grams \(0.25 kg\)"),
    "feet in mm": (lambda: sp.Slider(sp.Slider.rectangle(0.01, 0.01).vertices, 0.1, FEET), "slider.support"),
    "goal in mm": (lambda: small_scene(goal=(90.0, 30.0, 0.0), bounds=(0, 0, 99, 99)), "goal, from the start: 94.6.* radii"),
    "pusher in mm": (lambda: small_scene(pusher=((-30, -30), (0, -30), (0, 30), (-30, 30))), "pusher.outline"),
    "degrees": (lambda: small_scene(goal=(0.9, 0.3, -90)), r"goal\[2\]: -90 rad looks like degrees"),
    "tolerance in degrees": (lambda: small_scene(tolerance=(0.01, 5)), "tolerance"),
    "margin in degrees": (lambda: small_scene(min_margin=2), "min_margin: 2 rad"),
    "mm/s": (lambda: small_scene(speed=20.0), "20 m/s looks like millimetres"),
    "angle of friction": (lambda: sp.PushContact([(0.0, -0.05)], [(0.0, 1.0)], 30), "its coefficient is 0.577"),
    "mass of an effect in g": (lambda: parse_effect("inertia:mass=800"), "800 kg"),
    "delay in ms": (lambda: parse_effect("latency:delay=90"), "milliseconds"),
    "offset in mm": (lambda: parse_effect("frame-offset:offset=3/4"), "frame-offset"),
}  # fmt: skip


@pytest.mark.parametrize("case", USUAL)
def test_what_is_unusual_gives_no_note(case):
    USUAL[case]()


@pytest.mark.parametrize("case", DOUBTFUL)
def test_what_looks_like_another_unit_is_noted(case):
    build, words = DOUBTFUL[case]
    with pytest.warns(sp.PlausibilityWarning, match=words) as told:
        build()
    # the line to look at is the user's
    assert not any("/stablepush/" in warning.filename for warning in told)


def test_logs_in_other_units_are_noted(tmp_path):
    log = make_log(count=16)
    samples = dict(log.samples)
    sp.write_pushlog(log, tmp_path / "good")
    sp.read_pushlog(tmp_path / "good")
    doubtful = {
        "column x": samples | {"x": 1e4 * np.asarray(samples["x"])},
        "column theta": samples | {"theta": 100.0 + np.degrees(samples["theta"])},
        "column t": samples | {"t": 1e3 * np.asarray(samples["t"]) + 4e3},
    }
    for words, columns in doubtful.items():
        sp.write_pushlog(sp.PushLog(log.rig, log.trials, columns), tmp_path / "log")
        with pytest.warns(sp.PlausibilityWarning, match=words):
            sp.read_pushlog(tmp_path / "log")
    rig = replace(log.rig, finger_radius=5.0, noise=sp.Noise(0.02, 0.1, 1.0))
    sp.write_pushlog(sp.PushLog(rig, log.trials, samples), tmp_path / "log")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        sp.read_pushlog(tmp_path / "log")
    assert [
        word for word in ("finger_radius", "position known", "angle known") if not any(word in str(w.message) for w in told)
    ] == []


def test_what_this_project_writes_is_read_without_a_note(tmp_path):
    problem = small_scene()
    sp.save_scene(problem, tmp_path / "scene.json")
    again = sp.load_scene(tmp_path / "scene.json")
    sp.save_model(again.surface, tmp_path / "model.json")
    sp.load_model(tmp_path / "model.json")
    sp.save_plan(sp.plan(problem, refinement_budget=0), tmp_path / "plan.json")
    sp.load_plan(tmp_path / "plan.json")
