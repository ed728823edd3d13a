import re
import string
from dataclasses import replace

import pytest
from conftest import edited, make_log, triangle

import stablepush as sp
from stablepush.diagnosis.judge.verdicts import Judgement
from stablepush.diagnosis.likelihood.building import log_model
from stablepush.diagnosis.results import ChannelGap, GapReduction, ParameterEstimate, Verdict
from stablepush.diagnosis.rows.observations import observe
from stablepush.diagnosis.telling.wording import estimate_in_words, sentence_of
from stablepush.effects import CATALOGUE, Parameter


@pytest.mark.parametrize(
    ("unit", "estimate", "interval", "words"),
    (
        ("s", 0.0797, [0.0781, 0.0813], "79.7 ± 1.6 ms (95 %)"),
        ("m in B", [0.0051, -0.0007], [[0.0049, 0.0053], [-0.0010, -0.0004]], "(5.10, -0.70) ± 0.30 mm (95 %)"),
        ("rad in W", [0.02, -0.01], [[0.0195, 0.0205], [-0.0105, -0.0095]], "(1.146, -0.573) ± 0.029 deg (95 %)"),
        ("1, first to last trial", -0.2, [-0.21, -0.19], "-20.0 ± 1.0 % (95 %)"),
        # each of two logs has its own
        ("1, first to last trial", [-0.3, 0.1], [[-0.32, -0.28], [0.09, 0.11]], "(-30.0, 10.0) ± 2.0 % (95 %)"),
        ("1", 0.3, [0.3, 0.3], "0.300 ± 0.000 (95 %)"),
        ("kg", 1.2, [0.0, 26.0], "1 kg (95 %: 0 to 26)"),
        ("1", 1.1, [1.08, 1.16], "1.100 (95 %: 1.080 to 1.160)"),
    ),
)
def test_numbers_are_told_with_their_uncertainty(unit, estimate, interval, words):
    assert estimate_in_words(Parameter("p", unit, 0.0, 0.0, 1.0), ParameterEstimate(estimate, interval, unit)) == words


@pytest.mark.parametrize("kind", CATALOGUE.values(), ids=list(CATALOGUE))
def test_every_effect_has_a_sentence_about_its_parameters(kind):
    named = {field for _, field, _, _ in string.Formatter().parse(kind.says) if field}
    assert named == ({p.name for p in kind.parameters} if kind.id != "model-capacity" else set())
    for parameter in kind.parameters:
        numbers = [0.5] * parameter.size if parameter.size > 1 else 0.5
        interval = [[0.4, 0.6]] * parameter.size if parameter.size > 1 else [0.4, 0.6]
        assert "±" in estimate_in_words(parameter, ParameterEstimate(numbers, interval, parameter.unit))


def test_the_sentence_says_what_acts_and_what_the_correction_does():
    report = sp.diagnose(make_log("latency:delay=0.08"))
    delay = report.ranking[0].parameters["delay"]
    half = 1000 * (delay.ci95[1] - delay.ci95[0]) / 2
    lag = f"{1000 * delay.estimate:.1f} ± {half:.1f} ms (95 %)"
    assert report.sentence.startswith(f"latency: the slider's poses lag all other readings by {lag}; so corrected, ")
    pose = next(entry for entry in report.reductions if entry.channel == "pose")
    nearer = f"falls from {1000 * pose.before:.3g} to {1000 * pose.after:.3g} mm rms"
    assert f"the error of the final pose, push by push, on pushes left out of the fit {nearer}" in report.sentence


@pytest.mark.parametrize("effect", ("drift:rate=-0.3", "force-bias:force=0.2/0.1", "tilt:slope=0.03/0.02"))
def test_the_sentence_tells_the_error_that_the_cause_acts_on(effect):
    assert "the error of the wrench on pushes left out" in sp.diagnose(make_log(effect)).sentence


def test_certain_causes_come_before_those_that_a_log_cannot_tell_apart():
    log = make_log("latency:delay=0.08")
    report, likelihood = sp.diagnose(log), log_model(observe(log), log.rig, []).likelihood
    assert report.named == ["latency"] and not report.apart
    judged = Judgement(
        Verdict.AMBIGUOUS, ["latency", "tilt", "inertia"], ["tilt", "inertia"], [], [], [], 0.0, {}, [], 0.0, 1.0, ""
    )
    sentence = sentence_of(likelihood, judged, report.ranking, likelihood.prior.nominal)
    assert re.match(
        r"latency: the slider's poses lag .* \(95 %\)\. Besides, this log cannot tell tilt from inertia; one alone would explain "
        r"what is left: \(1\) tilt: .*; \(2\) inertia: .*\.$",
        sentence,
    )
    alone = sentence_of(likelihood, replace(judged, effects=["tilt", "inertia"]), report.ranking, likelihood.prior.nominal)
    assert alone.startswith("This log cannot tell tilt from inertia; one alone would explain it: (1) tilt")
    unsure = replace(report, verdict=Verdict.AMBIGUOUS, named=judged.effects, apart=judged.apart)
    assert unsure.steps[0].startswith("latency: ") and unsure.steps[1:] == [Verdict.AMBIGUOUS.advice]


def test_a_sentence_tells_what_a_refitted_surface_explains_by_itself():
    log = make_log("latency:delay=0.08")
    report, likelihood = sp.diagnose(log), log_model(observe(log), log.rig, []).likelihood
    gap = ChannelGap("wrench", "N", 1.0, 0.5, 0.1, 0.0)
    reduced = GapReduction("wrench", "N", 40, 1.0, 0.4, 0.1, (1 - 0.16) / (1 - 0.01), [0.8, 0.9], 0.1)
    judged = Judgement(Verdict.NAMED, ["tilt"], [], [gap], [gap], [reduced], 0.0, {}, [], 0.0, 1.0, "")
    told = sentence_of(likelihood, judged, report.ranking, likelihood.prior.nominal)
    assert (
        "falls from 1 to 0.4 N rms (floor 0.1 N): 85 % of the mean square gap is explained, 76 % by refitting the surface" in told
    )
    # where the refit does little, nothing is said of it
    judged = replace(judged, gaps=[replace(gap, refitted=0.95)])
    assert "refitting" not in sentence_of(likelihood, judged, report.ranking, likelihood.prior.nominal)


def test_a_surface_beside_a_fault_of_a_sensor_asks_for_a_new_plan():
    """Poses that lag, on feet that nobody stated: a plan for the believed pressure lost the object, and was said to be good."""
    outline = triangle().vertices
    feet = sp.SupportDistribution([(-0.04, -0.04), (0.08, -0.04), (-0.04, 0.08)], [1, 1, 1])
    noise = sp.Noise(0.02, 1e-4, 1.7e-3)
    reports = []
    for support in (feet, None):
        slider = sp.Slider(outline, 1.2, feet)
        surface = sp.IdealLimitSurface(feet, 3.5)
        rig = sp.VirtualRig(slider, surface, 0.5, sp.Pusher.finger(0.005), [sp.parse_effect("latency:delay=0.08")], noise)
        log = rig.execute(sp.random_pushes(slider, rig.pusher, 30, seed=4, groups=0), seed=4).log
        reports.append(sp.diagnose(edited(log, slider=sp.Slider(outline, 1.2, support), model=None)))
    stated, unstated = reports
    assert stated.named == unstated.named == ["latency"]
    assert not stated.changes_plans and "you need no new plan" in stated.to_do[0] and len(stated.to_do) == 1
    assert unstated.changes_plans and "no new plan" not in unstated.to_do[0]
    other = "esides, the limit surface is not that of an even pressure under the outline, which was assumed"
    assert unstated.to_do[1] == f"b{other}: stablepush correct, then plan again"
    assert unstated.sentence.endswith(f" B{other}.")
