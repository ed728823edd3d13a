"""Pushes that are to be made: all that propose them can have them executed, written and read."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import make_log, small_scene, triangle

import stablepush as sp

CHECKED = ("edge", "arc_length", "direction", "distance", "speed", "width", "sense", "group")


def two_finger_rig():
    problem = small_scene()
    return sp.VirtualRig(problem.slider, problem.surface, 0.6, sp.Pusher.two_fingers(0.03, 0.004))


def proposed():
    """Pushes of each source, by its name."""
    rig = two_finger_rig()
    loads, twists, _ = make_log(count=20).pairs()
    fit = sp.fit_limit_surface(loads, twists, slider=triangle(), seed=0)
    candidates = sp.poke_candidates(triangle(), places=2, headings=3)
    return {
        "rank_pokes": (triangle(), sp.rank_pokes(fit.surface, candidates, mu=0.5)[:3]),
        "random_pushes": (rig.slider, sp.random_pushes(rig.slider, rig.pusher, 12, seed=1, groups=1, repeats=2)),
        "diagnose": (triangle(), sp.diagnose(make_log("force-bias:force=0.3/0.1", count=30)).next_experiment.pushes),
    }


def same(a, b):
    for name in CHECKED:
        assert getattr(a, name) == getattr(b, name) or math.isnan(getattr(a, name)), name
    for name in ("point", "normal", "cor", "start"):
        one, other = getattr(a, name), getattr(b, name)
        assert (one is None) == (other is None), name
        if one is not None:
            np.testing.assert_allclose(one, other, atol=1e-15)


def test_all_that_is_proposed_is_written_read_and_executed(tmp_path):
    for name, (slider, pushes) in proposed().items():
        assert len(pushes) >= 2, name
        sp.write_pushes(pushes, tmp_path / "pushes.csv")
        again = sp.read_pushes(tmp_path / "pushes.csv", slider)
        for one, other in zip(pushes, again, strict=True):
            same(one, other)
        rig = sp.VirtualRig(slider, small_scene().surface, 0.6, sp.Pusher.finger(0.004))
        log = rig.execute([replace(push, start=np.zeros(3)) for push in again]).log
        assert len(log) == len(pushes)
        assert (log.samples["phase"] == "push").any()


def test_a_push_without_a_start_goes_on_from_where_the_slider_lies():
    rig = two_finger_rig()
    first = sp.EdgePush.on_edge(rig.slider, 0, 0.05, width=rig.pusher.width, start=(0.3, 0.1, 0.4))
    on = sp.EdgePush.on_edge(rig.slider, 0, 0.05, width=rig.pusher.width)
    one, two = rig.execute([first, on]).traces
    np.testing.assert_allclose(two.poses[0], one.poses[-1], atol=0)
    assert np.linalg.norm(two.poses[-1][:2] - two.poses[0][:2]) > 0.02
    with pytest.raises(sp.InputError, match="push 1: start: expected the first push"):
        rig.execute([on])


def test_the_width_says_how_many_fingers_push():
    rig = two_finger_rig()
    one, two, wide = (sp.EdgePush.on_edge(rig.slider, 0, 0.05, width=w, start=(0, 0, 0)) for w in (0.0, 0.03, 0.05))
    assert [len(rig.execute([p]).pushers[0].fingers) for p in (one, two, wide)] == [1, 2, 2]
    assert [rig.execute([p]).pushers[0].width for p in (one, two, wide)] == pytest.approx([0, 0.03, 0.05])
    assert rig.execute([two]).pushers[0] is rig.pusher


def test_turning_pushes_turn_about_their_centre():
    """The centre is in B before the push: a finger stays at its distance from it."""
    rig = two_finger_rig()
    a, b = rig.slider.edge(0)
    cor = (a + b) / 2 + 0.2 * (b - a) / np.linalg.norm(b - a)
    length = float(np.linalg.norm(b - a))
    push = sp.EdgePush.on_edge(rig.slider, 0, length / 2, width=0.03, cor=cor, sense=-1.0, distance=0.02, start=(0, 0, 0))
    trace = rig.execute([push]).traces[0]
    away = np.hypot(*(trace.pushers[-20:, :2] - cor).T)
    np.testing.assert_allclose(away, away[0], atol=1e-9)


def test_two_finger_lists_are_simulated(tmp_path, capsys):
    from stablepush.cli import main

    problem = small_scene()
    sp.save_scene(problem, tmp_path / "scene.json")
    rig = two_finger_rig()
    sp.write_pushes(sp.random_pushes(rig.slider, rig.pusher, 6, groups=0), tmp_path / "pushes.csv")
    arguments = ["simulate", str(tmp_path / "scene.json"), str(tmp_path / "pushes.csv"), "-o", str(tmp_path / "log")]
    assert main(arguments) == 0
    assert sp.read_pushlog(tmp_path / "log").rig.contact_kind == "two-point"
    assert "6 pushes" in capsys.readouterr().out


def test_json_and_csv_have_the_same_entries(tmp_path):
    (_, pushes) = proposed()["diagnose"]
    entry = json.loads(json.dumps(pushes[0].to_json()))
    assert {"edge", "along", "direction", "way", "speed", "width", "x", "y", "theta", "expected_difference_N"} <= entry.keys()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cor_x,cor_y,sense,angle\n1,0,1,0.3\n", "line 1: expected the columns edge, along"),
        ("edge,along,x\n0,0.05,0.1\n", "line 2: start"),
        ("edge,along,cor_x,cor_y\n0,0.05,0.1,0\n", "line 2: sense"),
        ("edge,along,cor_x,sense\n0,0.05,0.1,1\n", "line 2: cor"),
        ("edge,along,width\n0,0.05,-1\n", "line 2: column width"),
    ],
)
def test_lists_that_cannot_be_made(text, words, tmp_path):
    (tmp_path / "pushes.csv").write_text(text)
    with pytest.raises(sp.InputError) as told:
        sp.read_pushes(tmp_path / "pushes.csv", triangle())
    assert words in str(told.value)
    assert str(told.value).startswith(str(tmp_path / "pushes.csv"))
