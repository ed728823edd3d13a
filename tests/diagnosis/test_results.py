"""Results are values; their JSON comes from their fields."""

import json

import pytest

import stablepush as sp
from stablepush.diagnosis.results import as_json


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


def test_keys_of_before_work_for_one_more_version():
    gap = sp.ChannelGap("wrench", "N", 1.0, 0.5, 0.1, 0.01)
    with pytest.warns(DeprecationWarning, match="use .nominal instead"):
        assert gap["nominal"] == 1.0


@pytest.mark.parametrize("word", (*sp.Verdict, *sp.PlanStatus))
def test_words_equal_their_text_and_say_what_to_do(word):
    assert word == str(word) == json.loads(json.dumps(word))
    assert type(word)(str(word)) is word
    assert len(word.advice) > 10


def test_a_plan_s_status_is_a_word_of_the_vocabulary():
    assert sp.PlanResult("timeout", "any").status is sp.PlanStatus.TIMEOUT
    assert sp.PlanResult("of-another-planner", "any").status == "of-another-planner"
