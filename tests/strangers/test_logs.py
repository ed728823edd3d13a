"""What strangers do to a log of the program's own format: the same diagnosis, or a refusal or a note that names the place.

The log is that of a rig whose poses arrive late; the delay is in every channel that has poses.
"""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from conftest import check_schema, make_log

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import rotate_vectors
from stablepush.views.plot import gaps

DELAY = 0.08


@pytest.fixture(scope="module")
def good():
    return make_log(f"latency:delay={DELAY}", count=24)


@pytest.fixture(scope="module")
def answer(good):
    report = sp.diagnose(good)
    assert report.named == ["latency"]
    return delay_of(report)


def delay_of(report):
    (entry,) = (entry for entry in report.ranking if entry.effect == "latency")
    return entry.estimates["delay"]


def changed(log, trials=None, **samples):
    return sp.PushLog(log.rig, {**log.trials, **(trials or {})}, {**log.samples, **samples})


def moved(x=0.0, y=0.0, turn=0.0, turns=0):
    def change(log):
        columns = {}
        for names in (("x", "y"), ("px", "py"), ("c1x", "c1y"), ("fx", "fy")):
            if names[0] in log.samples and names[0] not in ("fx", "c1x"):
                xy = rotate_vectors(turn, log.columns(*names)) + np.array((x, y))
                columns |= dict(zip(names, xy.T, strict=True))
        for name in ("theta", "ptheta"):
            columns[name] = log.samples[name] + turn + 2 * np.pi * turns
        return changed(log, **columns)

    return change


def taken(log, rows):
    return sp.PushLog(log.rig, log.trials, {name: np.asarray(values)[rows] for name, values in log.samples.items()})


def trials_in_another_order(log):
    order = np.argsort([len(name) * 31 % 7 + int(name[-1]) for name in map(str, log.trials["trial"])], kind="stable")
    names = np.asarray(log.trials["trial"])[order]
    rows = np.concatenate([np.flatnonzero(log.samples["trial"] == name) for name in names])
    trials = {name: np.asarray(values)[order] for name, values in log.trials.items()}
    return sp.PushLog(log.rig, trials, taken(log, rows).samples)


def rows_of_trials_mixed(log):
    """As if rows had been sorted by something else: those of a trial still follow in time."""
    return taken(log, np.argsort(log.samples["t"], kind="stable"))


def doubled(log):
    return taken(log, np.repeat(np.arange(len(log.samples["t"])), 2))


def renamed(word):
    def change(log):
        trials = np.array([f"{word}{name}" for name in log.trials["trial"]], dtype=object)
        return changed(log, {"trial": trials}, trial=np.array([f"{word}{name}" for name in log.samples["trial"]], dtype=object))

    return change


def later(log):
    return changed(log, {"start_time": log.trials["start_time"] + 1.7e9})


SAME = {
    "1 km away": moved(1000.0, -1000.0),
    "500 km away": moved(5e5, 3e5),
    "turned by 1 rad": moved(turn=1.0),
    "turned by 50 turns": moved(turns=50),
    "since 1970": later,
    "trials in another order": trials_in_another_order,
    "rows of trials mixed": rows_of_trials_mixed,
    "rows doubled": doubled,
    "named $\\frac{$": renamed("$\\frac{$"),
    "named \x1b[31m": renamed("\x1b[31m"),
}


@pytest.mark.parametrize("what", SAME)
def test_the_diagnosis_is_the_same(what, good, answer):
    report = sp.diagnose(SAME[what](good))
    assert report.named == ["latency"]
    assert delay_of(report) == pytest.approx(answer, abs=2e-3)


def reversed_in_trials(log):
    rows = np.concatenate([log.rows(str(name))[::-1] for name in log.trials["trial"]])
    return taken(log, rows)


def stuck(*names, trials=None, every=False):
    """At the last value of each push; ``every``: of the log."""

    def change(log):
        columns = {}
        for name in names:
            values = np.array(log.samples[name], dtype=float)
            for trial in map(str, log.trials["trial"][:trials]):
                values[log.rows(trial)] = values[-1] if every else values[log.rows(trial)][-1]
            columns[name] = values
        return changed(log, **columns)

    return change


def scaled(factor, *names):
    return lambda log: changed(log, **{name: factor * np.asarray(log.samples[name], dtype=float) for name in names})


NOTED = {
    "rows reversed": (reversed_in_trials, r"column t: the time goes back within trial"),
    "lengths in millimetres": (scaled(1000.0, "x", "y", "px", "py"), r"the slider moves by .* mm in a push.*units \(length\)"),
    "forces in grams": (scaled(102.0, "fx", "fy", "tau"), r"loads are .* times what the friction .*units \(force, mass\)"),
    "angles in degrees": (scaled(180 / np.pi, "theta", "ptheta"), r"column theta: .* looks like degrees"),
}


@pytest.mark.parametrize("what", NOTED)
def test_a_note_names_the_column(what, good, tmp_path):
    change, words = NOTED[what]
    sp.write_pushlog(change(good), tmp_path / "log")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        sp.diagnose(sp.read_pushlog(tmp_path / "log"))
    assert any(re.search(words, str(one.message)) for one in said)


def tracker_stops(log):
    """After the third of the rows of each push."""
    columns = {name: np.array(log.samples[name]) for name in ("x", "y", "theta")}
    for trial in map(str, log.trials["trial"]):
        for values in columns.values():
            rows = log.rows(trial)
            values[rows[4:]] = values[rows[4]]
    return changed(log, **columns)


def heading_stops(log):
    heading = np.array(log.samples["theta"])
    for trial in map(str, log.trials["trial"]):
        heading[log.rows(trial)] = heading[log.rows(trial)[0]]
    return changed(log, theta=heading)


STUCK = {
    "the tracker, half-way": (tracker_stops, "poses do not change in "),
    "the force sensor": (stuck("fx", "fy", "tau", every=True), "forces do not change in any push"),
    "the robot": (stuck("px", "py", "ptheta"), "tip positions do not change in any push"),
    "the moment": (lambda log: changed(log, tau=np.zeros(len(log.samples["t"]))), "tau does not change in any push"),
    "the heading, push by push": (heading_stops, "theta does not change in any push, while other poses do"),
}


@pytest.mark.parametrize("what", STUCK)
def test_a_channel_that_stands_is_left_out(what, good, tmp_path, capsys):
    change, words = STUCK[what]
    sp.write_pushlog(change(good), tmp_path / "log")
    assert main(["diagnose", str(tmp_path / "log"), "--json", str(tmp_path / "d.json")]) == 0
    said = capsys.readouterr()
    assert words in said.out + said.err
    # what the other channels show is not touched by it
    assert sp.diagnose(change(good)).named in ([], ["latency"])


def test_a_slider_that_stands_is_unknown(good):
    assert sp.diagnose(stuck("x", "y", "theta")(good)).verdict == "unknown"


def test_a_log_without_poses_is_unknown(good):
    blank = np.full(len(good.samples["t"]), np.nan)
    assert sp.diagnose(changed(good, x=blank, y=blank, theta=blank)).verdict == "unknown"


CHANNELS = ("fx fy tau", "px py ptheta", "ptheta", "c1x c1y", "phase", "fx fy tau phase", "px py ptheta c1x c1y")
TRIAL_COLUMNS = ("stable", "speed", "edge", "along", "direction", "sense")


@pytest.mark.parametrize("left_out", CHANNELS)
@pytest.mark.parametrize("how", ["no such column", "blank in half of the trials"])
def test_no_answer_depends_on_which_channels_exist(left_out, how, good):
    names = [name for name in left_out.split() if name in good.samples]
    if how == "no such column":
        log = sp.PushLog(good.rig, good.trials, {k: v for k, v in good.samples.items() if k not in names})
    else:
        names = [name for name in names if name != "phase"]
        halved = {name: np.array(good.samples[name], dtype=float) for name in names}
        for trial in map(str, good.trials["trial"][::2]):
            for values in halved.values():
                values[good.rows(trial)] = np.nan
        log = changed(good, **halved)
    report = sp.diagnose(log)
    check_schema(report)
    assert report.named in ([], ["latency"])
    assert str(report) and report.to_json()
    for draw in (
        gaps.plot_residuals,
        gaps.plot_residuals_against,
        gaps.plot_final_poses,
        gaps.plot_effects,
        gaps.plot_signatures,
    ):
        try:
            draw(report)
        except sp.InputError as error:
            assert str(error).startswith("report: expected ")


@pytest.mark.parametrize("left_out", TRIAL_COLUMNS)
def test_no_answer_depends_on_what_is_known_of_trials(left_out, good, answer):
    log = replace(good, trials={k: v for k, v in good.trials.items() if k != left_out})
    report = sp.diagnose(log)
    assert report.named == ["latency"] and delay_of(report) == pytest.approx(answer, abs=2e-3)
