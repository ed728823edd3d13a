"""A diagnosis carried back into a problem."""

import json
import math

import numpy as np
import pytest
from conftest import small_scene, three_feet, triangle

import stablepush as sp
from stablepush.cli.program import main
from stablepush.demo import demo_pokes, demo_slider
from stablepush.effects import KnownEffect
from stablepush.planning import load_corrections, save_scene
from stablepush.planning.chance.scenarios import draw_scenarios

SURFACE = sp.IdealLimitSurface(three_feet(), 4.0, ensemble=[(1.0, 1.0, 2.0), (1.5, 1.5, 1.0)])


def corrected(**given):
    return sp.correct(small_scene(pusher=None), [sp.Correction(**given)])


def test_surface_fingers_and_tracker():
    problem = small_scene(pusher=None)
    found = corrected(
        surface=SURFACE,
        contact_friction=0.4,
        contact_friction_error=0.02,
        finger_radius=0.006,
        tracker_offset=np.array((0.004, 0.0)),
    )
    assert found.surface is SURFACE and found.contacts[0].mu == 0.4 and found.finger_radius == 0.006
    assert found.uncertainty.contact_friction == pytest.approx(0.1)
    x, y, theta = problem.goal
    np.testing.assert_allclose(found.goal, (x - 0.004 * math.cos(theta), y - 0.004 * math.sin(theta), theta))
    aside = corrected(contact_offset=0.003)
    across = problem.contacts[0].frame[2] + np.pi / 2
    moved = aside.contacts[0].points - problem.contacts[0].points
    np.testing.assert_allclose(moved, np.tile(0.003 * np.array((np.cos(across), np.sin(across))), (2, 1)), atol=1e-12)
    assert aside.surface.friction_load == problem.surface.friction_load and aside.uncertainty == problem.uncertainty


def test_a_surface_of_points_keeps_its_ensemble(tmp_path):
    sp.save_model(SURFACE, tmp_path / "model.json")
    again = sp.load_model(tmp_path / "model.json")
    np.testing.assert_array_equal(again.ensemble, SURFACE.ensemble)
    assert [member.friction_load for member in again.members()] == [4.0, 4.0]
    data = json.loads((tmp_path / "model.json").read_text())
    for wrong in ([[1.0, 2.0]], [[-1.0, 1.0, 1.0]], [[0.0, 0.0, 0.0]]):
        (tmp_path / "model.json").write_text(json.dumps({**data, "ensemble": wrong}))
        with pytest.raises(sp.InputError, match=r"model\.json: ensemble"):
            sp.load_model(tmp_path / "model.json")


def test_effects_are_carried_along_or_refused(tmp_path):
    problem = small_scene(pusher=None)
    neutral = [
        sp.parse_effect("drift:rate=-0.2"),
        sp.parse_effect("latency:delay=0.1"),
        sp.parse_effect("force-bias:force=0.1/0"),
    ]
    kept = problem.with_changes(effects=neutral)
    save_scene(kept, tmp_path / "scene.json")
    again = sp.load_scene(tmp_path / "scene.json")
    assert [entry.effect.id for entry in again.effects] == ["drift", "latency", "force-bias"]
    assert again.effects[2].effect.vector("force") == (0.1, 0.0)
    plain = sp.plan(problem, time_limit=60, refinement_budget=0)
    assert sp.plan(again, time_limit=60, refinement_budget=0).duration == plain.duration
    # which plans know is in test_effects.py
    slippery = problem.with_changes(effects=[sp.parse_effect("contact-friction:mu=0.3")])
    with pytest.raises(sp.InputError, match=r"effects: expected effects that plans know.* got contact-friction"):
        sp.plan(slippery)
    with pytest.raises(sp.InputError, match="contact-friction"):
        sp.check_plan(slippery, plain)
    data = json.loads((tmp_path / "scene.json").read_text())
    for wrong, words in (
        ([{"effect": "drift"}], r"effects\[0\]\.parameters: missing key"),
        ([{"effect": "drifting", "parameters": {"rate": 1}}], r"effects\[0\]\.effect: expected"),
        ([{"effect": "drift", "parameters": {"slope": 1}}], "unknown parameter, expected rate"),
        ([{"effect": "drift", "parameters": {"rate": "a"}}], "expected a number"),
        ([{"effect": "drift", "parameters": {"rate": 0.1}}] * 2, "expected every effect once"),
        ([{"effect": "drift", "parameters": {"rate": 0.1}, "covariance": [[1, 2]]}], "covariance"),
        ("drift", "effects: expected a list"),
    ):
        (tmp_path / "scene.json").write_text(json.dumps({**data, "effects": wrong}))
        with pytest.raises(sp.InputError, match=words):
            sp.load_scene(tmp_path / "scene.json")


def test_alternatives_are_drawn_by_their_probability(tmp_path):
    problem = small_scene(pusher=None)
    other = sp.IdealLimitSurface(three_feet(), 3.0)
    found = sp.correct(
        problem, [sp.Correction(0.75, SURFACE, contact_friction=0.5), sp.Correction(0.25, other, contact_friction=0.9)]
    )
    assert found.surface is SURFACE and found.contacts[0].mu == 0.5 and len(found.alternatives) == 2
    save_scene(found, tmp_path / "scene.json")
    again = sp.load_scene(tmp_path / "scene.json")
    drawn = draw_scenarios(again, 4000, seed=0)
    assert len(drawn.surfaces) == 3
    share = np.bincount(drawn.surface) / 4000
    np.testing.assert_allclose(share, (0.375, 0.375, 0.25), atol=0.03)
    assert drawn.contact_mu[drawn.surface == 2].min() > 0.8 and drawn.contact_mu[drawn.surface < 2].max() < 0.6
    result = sp.plan(again, time_limit=60, refinement_budget=0)
    assert result.solved and sp.check_plan(again, result).valid
    with pytest.raises(sp.InputError, match="a guarantee knows no alternatives"):
        sp.plan(again, region="all-pressure")


def test_where_causes_place_the_slider_otherwise_is_uncertain():
    problem = small_scene(pusher=None)
    offset = np.array((0.004, 0.003))
    found = sp.correct(problem, [sp.Correction(0.5, tracker_offset=offset), sp.Correction(0.5, contact_offset=0.002)])
    # 5 mm apart in half of the cases: 5/sqrt(2)/sqrt(2) mm along each axis
    assert found.uncertainty.start[0] == pytest.approx(0.0025, rel=1e-6)
    assert found.uncertainty.contact_place == pytest.approx(0.004)
    assert all(entry.tracker_offset is None and entry.contact_offset is None for entry in found.alternatives)
    with pytest.raises(sp.InputError, match=r"alternatives\[1\]\.tracker_offset: expected null"):
        sp.plan(problem.with_changes(alternatives=[sp.Correction(0.5), sp.Correction(0.5, tracker_offset=offset)]))


def test_an_interval_of_friction_does_not_hide_that_of_alternatives():
    problem = small_scene(pusher=None, uncertainty=sp.Uncertainty(contact_friction=(0.8, 1.0)))
    found = problem.with_changes(alternatives=[sp.Correction(0.5, contact_friction=0.3), sp.Correction(0.5)])
    drawn = draw_scenarios(found, 1000, seed=0).contact_mu
    low = drawn[drawn < 0.5]
    assert 0.4 < len(low) / 1000 < 0.6 and abs(low - 0.3).max() <= 0.3 / 9 + 1e-9
    assert drawn[drawn > 0.5].min() >= 0.8


def test_friction_that_no_push_has_shown_is_less_certain_than_before():
    problem = small_scene()
    mu, own = problem.contacts[0].mu, problem.uncertainty.relative_friction
    found = sp.correct(problem, [sp.Correction(contact_friction_error=0.15 * mu)])
    assert found.contacts[0].mu == mu and found.uncertainty.contact_friction == pytest.approx(0.3)
    # never more certain
    found = sp.correct(problem, [sp.Correction(contact_friction_error=1e-3 * mu)])
    assert found.uncertainty.contact_friction == pytest.approx(own)


def test_friction_of_the_support_is_part_of_a_scene(tmp_path):
    save_scene(small_scene().with_changes(support_friction=0.3), tmp_path / "scene.json")
    assert sp.load_scene(tmp_path / "scene.json").support_friction == 0.3
    data = json.loads((tmp_path / "scene.json").read_text())
    (tmp_path / "scene.json").write_text(json.dumps({**data, "support_friction": 0}))
    with pytest.raises(sp.InputError, match="support_friction: expected a number > 0"):
        sp.load_scene(tmp_path / "scene.json")


def test_a_diagnosis_without_corrections_is_refused(tmp_path, capsys):
    save_scene(small_scene(), tmp_path / "scene.json")
    diagnosis = tmp_path / "diagnosis.json"
    rows = (
        ({"format": "diagnosis/1", "corrected": []}, "expected at least one entry"),
        ({"format": "diagnosis/1"}, "corrected: missing key"),
        ({"format": "plan/1", "corrected": []}, 'expected "diagnosis/1"'),
        ({"format": "diagnosis/1", "corrected": [{"probability": 2}]}, "expected a number from 0 to 1"),
        ({"format": "diagnosis/1", "corrected": [{"probability": 0}]}, "not all 0"),
        ({"format": "diagnosis/1", "corrected": [{"probability": 1, "tracker_offset": [1]}]}, "tracker_offset"),
    )
    for data, words in rows:
        diagnosis.write_text(json.dumps(data))
        assert main(["correct", str(tmp_path / "scene.json"), str(diagnosis), "-o", str(tmp_path / "out.json")]) == 2
        error = capsys.readouterr().err
        assert words in error and len(error.strip().splitlines()) == 1 and not (tmp_path / "out.json").exists()
    with pytest.raises(sp.InputError, match="at least one correction"):
        sp.correct(small_scene(), [])
    diagnosis.write_text(json.dumps({"format": "diagnosis/1", "verdict": "unknown", "corrected": [{"probability": 1}]}))
    with pytest.warns(sp.PlanWarning, match="something else is wrong, which no probability of a plan counts"):
        sp.correct(small_scene(pusher=None), diagnosis)
    assert main(["correct", str(tmp_path / "scene.json"), str(diagnosis), "-o", str(tmp_path / "out.json")]) == 0
    assert "warning: the diagnosis is unknown" in capsys.readouterr().err
    diagnosis.write_text(json.dumps({"format": "diagnosis/1", "corrected": [{"probability": 1}]}))
    assert [entry.probability for entry in load_corrections(diagnosis)] == [1.0]


def test_a_slope_has_the_newtons_of_the_rig_that_showed_it(tmp_path, capsys):
    """A surface that was fitted to no pokes is in units of ``mu*N``: no plan reckons with a slope without friction."""
    none = np.zeros((0, 3))
    prior = sp.fit_limit_surface(none, none, slider=triangle()).surface
    problem = small_scene(surface=prior, slider=triangle())
    slope = sp.Correction(effects=(KnownEffect(sp.parse_effect("tilt:slope=0.02/0"), None),))
    diagnosis = {"format": "diagnosis/1", "verdict": "named", "effects": ["tilt"], "corrected": [slope.to_json()]}
    path, scene = tmp_path / "diagnosis.json", tmp_path / "scene.json"
    save_scene(problem, scene)
    for stated in (None, 0.0, 0.3):
        path.write_text(json.dumps({**diagnosis, "support_friction": stated}))
        assert sp.correct(problem, path).support_friction == (stated or None)
    assert sp.correct(small_scene(surface=prior, support_friction=0.4), path).support_friction == 0.4
    assert sp.correct(small_scene(), path).support_friction is None
    assert main(["correct", str(scene), str(path), "-o", str(tmp_path / "scene2.json")]) == 0
    told = capsys.readouterr().out
    assert "support friction 0.3" in told and "plan will refuse" not in told
    path.write_text(json.dumps({**diagnosis, "support_friction": -1}))
    with pytest.raises(sp.InputError, match=r"diagnosis\.json: support_friction: expected a number"):
        sp.correct(problem, path)


def test_a_fitted_surface_that_stays_may_hold_the_effect(tmp_path, capsys):
    fitted = sp.fit_limit_surface(*demo_pokes(12).pairs()[:2], slider=demo_slider()).surface
    scene, path = tmp_path / "scene.json", tmp_path / "diagnosis.json"
    save_scene(small_scene(surface=fitted), scene)
    for effect, said in (("tilt:slope=0.02/0", True), ("latency:delay=0.1", False)):
        found = sp.Correction(effects=(KnownEffect(sp.parse_effect(effect), None),))
        path.write_text(json.dumps({"format": "diagnosis/1", "verdict": "named", "effects": [], "corrected": [found.to_json()]}))
        assert main(["correct", str(scene), str(path), "-o", str(tmp_path / "scene2.json")]) == 0
        assert (
            "the limit surface stays: if it was fitted to pokes on this table, tilt is in it" in capsys.readouterr().out
        ) == said
