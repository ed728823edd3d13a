"""Several logs of one rig, diagnosed together, and causes that must replicate."""

import json

import numpy as np
import pytest
from conftest import LOAD, MASS, QUIET, check_schema, edited, make_log, one_line, pressure, triangle

import stablepush as sp
from stablepush.cli.program import main
from stablepush.diagnosis.likelihood.building import log_model
from stablepush.diagnosis.rows.joined_logs import join
from stablepush.diagnosis.rows.observations import observe
from stablepush.diagnosis.search.folds import halves_of
from stablepush.effects import parse_effect
from stablepush.views import gap_html


def on_other_feet(*effects, feet, seed, count=16):
    """A log of the same rig whose object stands on other feet than rig.json says."""
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    pusher, surface = sp.Pusher.finger(0.005), sp.IdealLimitSurface(sp.SupportDistribution(*feet), LOAD)
    rig = sp.VirtualRig(slider, surface, 0.5, pusher, [parse_effect(text) for text in effects], QUIET)
    return rig.execute(sp.random_pushes(slider, pusher, count, seed=seed), rows=7, seed=seed).log


FEET = (
    (((-0.03, -0.03), (0.06, -0.02), (-0.02, 0.05), (0.0, 0.0)), (2, 1, 1, 1)),
    (((-0.04, -0.04), (0.07, -0.04), (-0.04, 0.07), (0.0, 0.01)), (1, 1, 1, 2)),
)


def test_logs_that_agree_with_their_rig_have_no_gap():
    report = sp.diagnose([make_log(count=16, seed=1), make_log(count=16, seed=2)], name=["monday", "tuesday"])
    assert report.verdict == "none"
    value = check_schema(report)
    assert value["logs"] == ["monday", "tuesday"] and value["trials"] == 32
    assert report.row_names[0].startswith("monday/") and report.row_names[-1].startswith("tuesday/")
    one = sp.diagnose(make_log(count=16, seed=1), name="monday")
    assert one.to_json()["logs"] == ["monday"]


def test_a_shared_cause_is_found_under_objects_on_other_feet():
    tilt = "tilt:slope=0.03/-0.02"
    logs = [on_other_feet(tilt, feet=feet, seed=k + 1) for k, feet in enumerate(FEET)]
    report = sp.diagnose(logs)
    assert report.named == ["tilt"], report.sentence
    (slope,) = report.ranking[0].estimates.values()
    np.testing.assert_allclose(slope, (0.03, -0.02), atol=0.004)
    # the corrected surface is that of the last log
    last = report.corrected[0].surface or report.surface
    center = np.average(last.support.points, axis=0, weights=last.support.weights)
    wanted = np.average(FEET[1][0], axis=0, weights=FEET[1][1])
    other = np.average(FEET[0][0], axis=0, weights=FEET[0][1])
    assert np.linalg.norm(center - wanted) < 0.5 * np.linalg.norm(center - other)


def test_what_two_logs_show_faintly_they_show_together():
    logs = [make_log("tilt:slope=0.003/0.0", count=16, seed=k) for k in (1, 2, 3)]
    each = [sp.diagnose(log).named for log in logs]
    together = sp.diagnose(logs)
    assert together.named == ["tilt"], together.sentence
    assert sum(named == ["tilt"] for named in each) < len(logs)


def test_drift_is_each_logs_own():
    report = sp.diagnose([make_log("drift:rate=-0.3", count=20, seed=1), make_log("drift:rate=0.2", count=20, seed=2)])
    assert report.named == ["drift"]
    np.testing.assert_allclose(report.ranking[0].estimates["rate"], (-0.3, 0.2), atol=0.02)
    assert report.effects["drift"]["rate"] == pytest.approx(0.2, abs=0.02)
    (effect,) = report.corrected[0].effects
    assert effect.effect.id == "drift"
    check_schema(report)
    assert "<html" in gap_html(report)


def test_a_cause_of_one_log_is_none_of_the_rig():
    report = sp.diagnose([make_log("tilt:slope=0.03/-0.02", count=20, seed=1), make_log(count=20, seed=2)])
    assert "tilt" not in report.named
    assert report.verdict in ("unknown", "absorbed")


def test_a_cause_of_one_half_of_the_pushes_is_not_named():
    with_it, without = make_log("force-bias:force=0.15/0.1", seed=3), make_log(seed=3)
    half = halves_of(log_model(observe(without), without.rig, []).likelihood.experiment) == 1
    chosen = dict(zip(map(str, without.trials["trial"]), half, strict=True))
    # the whole of the log reads the bias but in one half of its pushes the other way
    opposite = make_log("force-bias:force=-0.05/-0.04", seed=3)
    rows = np.array([chosen[str(name)] for name in without.samples["trial"]])
    samples = {
        key: np.where(rows, column, opposite.samples[key]) if column.dtype != object else column
        for key, column in with_it.samples.items()
    }
    report = sp.diagnose(sp.PushLog(with_it.rig, with_it.trials, samples))
    assert "force-bias" not in report.named
    assert sp.diagnose(with_it).named == ["force-bias"]


def test_logs_of_other_rigs_are_refused(tmp_path, capsys):
    logs = [make_log(count=16, seed=1), edited(make_log(count=16, seed=2), contact_friction=0.9)]
    with pytest.raises(sp.InputError, match=r"log 2: rig.json: friction: expected the rig of the first log"):
        sp.diagnose(logs)
    with pytest.raises(sp.InputError, match="expected a PushLog"):
        sp.diagnose([])
    with pytest.raises(sp.InputError, match="expected a PushLog"):
        sp.diagnose([logs[0], "log"])
    for log, name in zip(logs, ("a", "b"), strict=True):
        sp.write_pushlog(log, tmp_path / name)
    one_line(capsys, ["diagnose", tmp_path / "a", tmp_path / "b"], tmp_path / "b", "rig.json: friction")
    one_line(capsys, ["diagnose", tmp_path / "a", tmp_path / "a", "--simulated", tmp_path / "a"], "one log")


def test_a_log_is_not_given_twice(tmp_path, capsys):
    log = make_log(count=16, seed=1)
    with pytest.raises(sp.InputError, match="log 2: expected another log, got the same pushes twice"):
        sp.diagnose([log, log])
    sp.write_pushlog(log, tmp_path / "a")
    one_line(capsys, ["diagnose", tmp_path / "a", tmp_path / "a"], "expected another log")
    with pytest.raises(sp.InputError, match="expected a name for each of 2 logs"):
        sp.diagnose([log, make_log(count=16, seed=2)], name="one")


def test_what_each_log_has_is_said():
    log, other = make_log(count=16, seed=1), edited(make_log(count=16, seed=2), drop=("fx", "fy", "tau"))
    report = sp.diagnose([log, other], name=["monday", "tuesday"])
    assert "the corrected rig is that of monday; tuesday has no forces" in report.notes[0]
    blind = sp.diagnose([edited(log, drop=("fx", "fy", "tau")), other])
    assert "without forces they share one surface" in blind.notes[0]
    # a log without phases counts every row as a push
    phases, without = make_log(count=16, seed=3), edited(make_log(count=16, seed=4), drop=("phase",))
    joined, _ = join([phases, without], ["a", "b"])
    assert set(joined.samples["phase"][joined.rows(f"b/{without.trials['trial'][0]}")]) == {"push"}


def test_the_command_takes_several_logs(tmp_path, capsys):
    for name, seed in (("a", 1), ("b", 2)):
        sp.write_pushlog(make_log("force-bias:force=0.2/0.1", count=16, seed=seed), tmp_path / name)
    outputs = ["--json", tmp_path / "d.json", "--html", tmp_path / "r.html", "--mended", tmp_path / "mended"]
    assert main([str(a) for a in ("diagnose", tmp_path / "a", tmp_path / "b", *outputs)]) == 0
    assert "named: force-bias" in capsys.readouterr().out
    value = json.loads((tmp_path / "d.json").read_text())
    assert value["logs"] == [str(tmp_path / "a"), str(tmp_path / "b")] and value["effects"] == ["force-bias"]
    assert (tmp_path / "mended" / "rig.json").is_file() and (tmp_path / "r.html").is_file()


def test_joined_logs_keep_all_that_each_has():
    first, second = make_log(count=16, seed=1), edited(make_log(count=16, seed=2), drop=("c1x", "c1y"))
    joined, number = join([first, second], ["a", "b"])
    assert len(joined) == 32 and number.tolist() == [0] * 16 + [1] * 16
    for k, (log, name) in enumerate(((first, "a"), (second, "b"))):
        for trial in log.trials["trial"]:
            rows = joined.rows(f"{name}/{trial}")
            for column in log.samples:
                if column != "trial":
                    np.testing.assert_array_equal(joined.samples[column][rows], log.samples[column][log.rows(trial)])
            assert number[list(joined.trials["trial"]).index(f"{name}/{trial}")] == k
    assert np.isnan(joined.samples["c1x"][joined.rows(f"b/{second.trials['trial'][0]}")]).all()
    begun = np.asarray(joined.trials["start_time"], dtype=float)
    assert begun[number == 1].min() > begun[number == 0].max()
