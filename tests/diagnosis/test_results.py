"""Results are values; their JSON comes from their fields."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import make_log

import stablepush as sp
from stablepush.diagnosis.judge.gap_reduction import _reduction
from stablepush.diagnosis.results import GapReduction, as_json


def test_json_has_the_fields_as_keys():
    entry = sp.RankedEffect("drift", 0.9, {"rate": sp.ParameterEstimate(-0.1, [-0.2, 0.0], "1")}, True, None)
    assert json.loads(json.dumps(as_json([entry]))) == [
        {
            "effect": "drift",
            "probability": 0.9,
            "parameters": {"rate": {"estimate": -0.1, "ci95": [-0.2, 0.0], "unit": "1"}},
            "identifiable": True,
            "reason": None,
            "form": None,
        }
    ]


@pytest.mark.parametrize("word", (*sp.Verdict, *sp.PlanStatus))
def test_words_equal_their_text_and_say_what_to_do(word):
    assert word == str(word) == json.loads(json.dumps(word))
    assert type(word)(str(word)) is word
    assert len(word.advice) > 10


def test_a_plan_s_status_is_a_word_of_the_vocabulary():
    assert sp.PlanResult("timeout", "any").status is sp.PlanStatus.TIMEOUT
    assert sp.PlanResult("of-another-planner", "any").status == "of-another-planner"


@pytest.mark.parametrize(
    ("before", "after", "floor", "closed", "words"),
    [
        (0.05, 0.046, 0.046, 1.0, "explained 100 % (20 to 100)"),
        (0.0473, 0.0473, 0.0473, 1.0, "both within the noise"),
        (1.0, 3.0, 1.0, -9.0, "there was nothing to explain"),
        (1.2, 3.0, 1.0, -9.0, "explained nothing: more is left than before"),
        (0.0, 0.1, 0.0, 0.0, "explained 0 % (20 to 100)"),
    ],
)
def test_a_channel_within_the_noise_says_so(before, after, floor, closed, words):
    assert GapReduction("twist", "rad", 20, before, after, floor, closed, [0.2, 1.0], floor).explained == words


def test_the_support_friction_is_told_where_it_was_refitted():
    """Of a log with forces whose rig believes in 20 % too much friction; not of one whose rig has a model, or without forces."""
    log = make_log(count=16, seed=3)
    rig = replace(log.rig, support_friction=1.2 * log.rig.support_friction)
    report = sp.diagnose(replace(log, rig=rig))
    assert report.verdict == "absorbed"
    assert report.support_friction == pytest.approx(log.rig.support_friction, rel=0.02)
    assert sp.diagnose(log).support_friction is None
    modelled = replace(rig, model=sp.IdealLimitSurface(log.rig.slider.support, 5.0))
    assert sp.diagnose(replace(log, rig=modelled)).support_friction is None


@pytest.mark.parametrize(
    ("before", "after", "noise", "words"),
    (
        (4e-3, 2e-3, 1e-3, "4 mm before, 2 after, floor 1"),
        (4e-3, 1e-3, 1.2e-3, "4 mm before, 1 after, which is within the noise"),
        # the correction changes nothing, and there was nothing to correct
        (1.6e-3, 1.6e-3, 5e-3, "1.6 mm before, 1.6 after"),
        # a channel without noise, of which nothing is left
        (0.4, 0.0, 0.0, "400 mm before, 0 after"),
    ),
)
def test_what_is_left_is_told_beside_the_noise(before, after, noise, words):
    squares = {"before": np.full(6, before**2), "after": np.full(6, after**2)}
    entry = _reduction("pose", "m", np.arange(6), squares, noise**2)
    assert entry.sizes == words
    assert (entry.explained == "both within the noise") == (before == after)


def test_a_correction_that_predicts_worse_is_warned_of():
    report = sp.diagnose(make_log("drift:rate=-0.3", count=16))
    assert report.named == ["drift"] and not any("predicted worse" in step for step in report.steps)

    def with_twist(named, before, after, floor):
        others = [entry for entry in report.reductions if entry.channel != "twist"]
        twist = GapReduction("twist", "rad", 16, before, after, floor, 0.0, [0.0, 0.0], floor)
        return replace(report, named=named, reductions=[*others, twist])

    worse = with_twist(["drift"], 0.06, 0.17, 0.09)
    assert any("predicted worse (twist 0.06 rad to 0.17 rad)" in step for step in worse.steps)
    # within the noise it says nothing; nor of what an import takes off
    assert not any("predicted worse" in step for step in with_twist(["drift"], 0.06, 0.095, 0.09).steps)
    assert not any("predicted worse" in step for step in with_twist(["latency"], 0.06, 0.17, 0.09).steps)


def test_a_refit_that_is_no_nearer_is_no_reason_to_plan_again():
    log = make_log(count=16, seed=3)
    report = sp.diagnose(replace(log, rig=replace(log.rig, support_friction=1.2 * log.rig.support_friction)))
    assert report.verdict == "absorbed" and "then plan again" in report.steps[0]

    def with_pose(before, after):
        return replace(report, reductions=[GapReduction("pose", "m", 16, before, after, 1e-3, 0.0, [0.0, 0.0], 1e-3)])

    assert "plans stay as they are" in with_pose(1.1e-3, 1.2e-3).steps[0]
    assert "does not predict the others" in with_pose(5e-3, 6e-3).steps[0]
    assert "does not predict the others" not in with_pose(5e-3, 3e-3).steps[0]
    assert all("then plan again" in with_pose(5e-3, after).steps[0] for after in (3e-3, 6e-3))
