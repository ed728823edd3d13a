"""Another simulator's log as the nominal simulation."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import LAB_DATA, LOAD, MASS, QUIET, check_schema, edited, one_line, pressure, triangle

import stablepush as sp
from stablepush.cli.program import main
from stablepush.diagnosis.judge.other_simulator import compare
from stablepush.effects import parse_effect

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "diagnosis"))
import collins2018


def other_simulator(*effects, seed=0, noise=QUIET, two=False, count=40):
    """A rig whose feet and friction are not those of rig.json, as a simulator with settings of its own has them."""
    feet = sp.SupportDistribution(((-0.03, -0.03), (0.06, -0.02), (-0.02, 0.05), (0.0, 0.0)), (2, 1, 1, 1))
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    pusher = sp.Pusher.two_fingers(0.05, 0.005) if two else sp.Pusher.finger(0.005)
    rig = sp.VirtualRig(
        slider, sp.IdealLimitSurface(feet, 1.2 * LOAD), 0.5, pusher, [parse_effect(text) for text in effects], noise
    )
    return rig.execute(sp.random_pushes(slider, pusher, count, seed=3), rows=7, seed=seed).log


@pytest.fixture(scope="module")
def simulated():
    return other_simulator(noise=sp.Noise(0.0, 0.0, 0.0), seed=9)


def test_a_log_that_agrees_with_the_simulator_has_no_gap(simulated):
    real = other_simulator()
    assert sp.diagnose(real).verdict != "none"
    report = sp.diagnose(real, simulated=simulated)
    assert report.verdict == "none", report.sentence
    check_schema(report)
    gaps = {entry.channel: entry for entry in report.gap}
    assert gaps["wrench"].nominal < 1.3 * gaps["wrench"].noise_floor
    assert report.corrected == [] and report.surface is None
    assert "40 of 40 trials" in report.notes[0]


@pytest.mark.parametrize(
    ("effect", "truth"),
    (("tilt:slope=0.04/-0.02", (0.04, -0.02)), ("force-bias:force=0.3/0.2", (0.3, 0.2)), ("latency:delay=0.08", 0.08)),
)
def test_what_the_simulator_lacks_is_named(simulated, effect, truth):
    report = sp.diagnose(other_simulator(effect), simulated=simulated)
    assert report.named == [effect.split(":")[0]], report.sentence
    (value,) = report.ranking[0].estimates.values()
    np.testing.assert_allclose(value, truth, rtol=0.15, atol=0.004)
    assert next(entry for entry in report.reductions if entry.channel == "wrench").closed > 0.7


def test_logs_without_forces_are_compared_by_their_final_poses(simulated):
    real = edited(other_simulator("frame-offset:offset=0.006/-0.004"), drop=("fx", "fy", "tau"))
    report = sp.diagnose(real, simulated=edited(simulated, drop=("fx", "fy", "tau")))
    assert report.named == ["frame-offset"], report.sentence
    clean = sp.diagnose(edited(other_simulator(), drop=("fx", "fy", "tau")), simulated=simulated)
    assert clean.named == []


def test_trials_match_by_group_else_by_name(simulated):
    real = other_simulator()
    plain = {key: column for key, column in real.trials.items() if key != "group"}
    names = np.array([f"real {k}" for k in range(len(real))], dtype=object)
    renamed = dict(zip(real.trials["trial"], names, strict=True))
    moved = sp.PushLog(
        real.rig, {**plain, "trial": names}, {**real.samples, "trial": [renamed[t] for t in real.samples["trial"]]}
    )
    with pytest.raises(sp.InputError, match="expected trials with a group or name of the log's"):
        sp.diagnose(moved, simulated=simulated)
    grouped = [f"push {k}" for k in range(len(real))]
    with_groups = sp.PushLog(moved.rig, {**moved.trials, "group": grouped}, moved.samples)
    other = sp.PushLog(simulated.rig, {**simulated.trials, "group": grouped}, simulated.samples)
    assert compare(with_groups, other).partners["real 3"] == [str(simulated.trials["trial"][3])]
    assert sp.diagnose(with_groups, simulated=other).verdict == "none"


def spoiled(log, change):
    """The log with the slider's poses changed, trial by trial: ``change(poses)`` returns others."""
    x, y, theta = (np.array(log.samples[c], dtype=float) for c in ("x", "y", "theta"))
    for name in log.trials["trial"]:
        rows = log.rows(name)
        x[rows], y[rows], theta[rows] = change(np.stack((x[rows], y[rows], theta[rows]), axis=-1)).T
    return sp.PushLog(log.rig, log.trials, {**log.samples, "x": x, "y": y, "theta": theta})


def tumbled(poses):
    return poses + np.outer(np.arange(len(poses)) == len(poses) - 1, (0, 0, 3.0))


def without_end(poses):
    return np.where(np.arange(len(poses))[:, None] >= len(poses) - 5, np.nan, poses)


@pytest.mark.parametrize(
    ("change", "words"),
    (
        (lambda poses: np.tile(poses[0], (len(poses), 1)), "In 40 of 40 trials the simulator's slider is not touched"),
        (tumbled, "In 40 of 40 trials the simulator's slider tumbles"),
        (without_end, "it is not seen at the end"),
    ),
)
def test_a_simulator_that_loses_its_slider_names_nothing(simulated, change, words):
    report = sp.diagnose(other_simulator("tilt:slope=0.04/-0.02"), simulated=spoiled(simulated, change))
    assert report.verdict == "unknown" and report.named == []
    assert words in report.sentence
    check_schema(report)
    assert not any(entry.identifiable for entry in report.ranking)


def test_one_push_repeated_names_nothing(simulated):
    """Repeats show how large the gap is against their scatter, and no cause."""
    real, rng = other_simulator("tilt:slope=0.06/0"), np.random.default_rng(0)
    rows, other_rows = real.rows(real.trials["trial"][0]), simulated.rows(simulated.trials["trial"][0])
    count = 12

    def repeated(log, rows, scatter):
        trials = {"trial": [f"{k}" for k in range(count)], "start_time": 60.0 * np.arange(count), "group": ["push"] * count}
        samples = {key: np.tile(np.asarray(column)[rows], count) for key, column in log.samples.items()}
        samples["trial"] = np.repeat(trials["trial"], len(rows))
        samples["x"] = samples["x"] + np.repeat(scatter * rng.normal(size=count), len(rows)) * np.tile(
            np.linspace(0, 1, len(rows)), count
        )
        return sp.PushLog(log.rig, trials, samples)

    report = sp.diagnose(repeated(real, rows, 2e-4), simulated=repeated(simulated, other_rows, 0.0))
    assert report.verdict == "unknown" and report.named == []
    assert "One repeated push cannot tell" in report.sentence
    (gap,) = report.gap
    assert gap.nominal > 3 * gap.noise_floor > 0


def shifted(log, seconds):
    return sp.PushLog(log.rig, log.trials, {**log.samples, "t": log.samples["t"] + seconds})


def some(log, count):
    """The first trials of a log."""
    names = set(map(str, log.trials["trial"][:count]))
    chosen = [np.array([str(name) in names for name in table["trial"]]) for table in (log.trials, log.samples)]
    tables = [
        {k: np.asarray(v)[rows] for k, v in table.items()} for table, rows in zip((log.trials, log.samples), chosen, strict=True)
    ]
    return sp.PushLog(log.rig, *tables)


def test_clocks_that_do_not_overlap_name_nothing(simulated):
    report = sp.diagnose(other_simulator("tilt:slope=0.04/-0.02"), simulated=shifted(simulated, 1000.0))
    assert report.verdict == "unknown" and report.named == []
    assert "the clocks of the two logs do not overlap" in report.sentence


def test_few_trials_with_a_partner_name_nothing(simulated):
    report = sp.diagnose(other_simulator("tilt:slope=0.04/-0.02"), simulated=some(simulated, 2))
    assert report.named == [] and "In 38 of 40 trials the simulator's log has no partner" in report.sentence


def test_a_single_push_is_compared(simulated):
    real = some(other_simulator("tilt:slope=0.04/-0.02"), 1)
    still = spoiled(some(simulated, 1), lambda poses: np.tile(poses[0], (len(poses), 1)))
    report = sp.diagnose(real, simulated=still)
    assert report.verdict == "unknown" and "is not touched" in report.sentence and "noise of the poses leaves" in report.sentence
    assert "Too few pushes can be compared" in sp.diagnose(real, simulated=some(simulated, 1)).sentence


def test_what_a_simulator_s_log_lacks_is_said(simulated):
    real = other_simulator("tilt:slope=0.04/-0.02")
    without = edited(simulated, drop=("fx", "fy", "tau"))
    assert any("the simulator log has no forces" in note for note in sp.diagnose(real, simulated=without).notes)
    # neither forces nor poses of the pusher: the final poses still differ
    blind = edited(simulated, drop=("fx", "fy", "tau", "px", "py", "ptheta"))
    report = sp.diagnose(edited(real, drop=("fx", "fy", "tau")), simulated=blind)
    assert report.verdict == "unknown" and report.gap[0].nominal > 3 * report.gap[0].noise_floor


def test_a_blank_in_the_last_row_is_a_missing_value(simulated):
    real = spoiled(other_simulator(), lambda poses: np.where(np.arange(len(poses))[:, None] == len(poses) - 1, np.nan, poses))
    assert sp.diagnose(real, simulated=simulated).verdict == "none"


def test_another_slider_is_refused(simulated):
    with pytest.raises(sp.InputError, match="expected a PushLog"):
        sp.diagnose(other_simulator(), simulated="log")
    other = replace(simulated, rig=replace(simulated.rig, slider=sp.Slider.rectangle(0.1, 0.1, MASS)))
    with pytest.raises(sp.InputError, match="expected the outline of the log's slider"):
        sp.diagnose(other_simulator(), simulated=other)


def test_the_command_takes_the_log_of_another_simulator(simulated, tmp_path, capsys):
    sp.write_pushlog(other_simulator("tilt:slope=0.04/-0.02"), tmp_path / "real")
    sp.write_pushlog(simulated, tmp_path / "other")
    command = ["diagnose", tmp_path / "real", "--simulated", tmp_path / "other"]
    outputs = ["--json", tmp_path / "d.json", "--html", tmp_path / "r.html", "--mended", tmp_path / "mended"]
    assert main([str(a) for a in (*command, *outputs)]) == 0
    told = capsys.readouterr().out
    assert "named: tilt" in told and "belong to the other simulator" in told and "stablepush correct" not in told
    value = json.loads((tmp_path / "d.json").read_text())
    assert value["effects"] == ["tilt"] and value["corrected"] == []
    assert "another simulator" in (tmp_path / "r.html").read_text()
    assert not (tmp_path / "mended").exists()
    one_line(capsys, [*command[:3], tmp_path / "missing"], "missing", "expected a pushlog/1 folder")
    one_line(capsys, ["correct", tmp_path / "real", tmp_path / "d.json", "-o", tmp_path / "s.json"])


def test_the_real_pushes_of_another_lab_beside_seven_simulators():
    """Collins and others 2019: three arms miss the cube, and no single repeated push has a cause."""
    path = LAB_DATA / "collins2018" / "logs.csv"
    if not path.is_file():
        pytest.skip("the lab's logs are not beside the project")
    logs = collins2018.read_logs(path)
    real = logs.pop("real")
    reports = {source: sp.diagnose(real, simulated=log) for source, log in logs.items()}
    assert all(report.named == [] and report.verdict == "unknown" for report in reports.values())
    missed = {source for source, report in reports.items() if "is not touched" in report.sentence}
    assert missed == {"PyBullet", "VRepNewton", "VRepVortex"}
    assert {s for s, report in reports.items() if "tumbles" in report.sentence} == {"Mujoco", "VRepBullet283"}
    assert all(0.002 < report.gap[0].noise_floor < 0.004 for report in reports.values())
