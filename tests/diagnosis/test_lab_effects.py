"""Effects of a lab's own: friction that follows a column of the log, and play in the mount of a tool."""

import re
from dataclasses import replace

import numpy as np
import pytest

import stablepush as sp
from stablepush.effects import CATALOGUE, LabEffect, Parameter, lab_effects

SLIDER = sp.Slider.centered([(0.0, 0.0), (0.15, 0.0), (0.0, 0.15)], mass=1.5)
FEET = sp.SupportDistribution([(-0.03, -0.03), (0.07, -0.03), (-0.03, 0.07)], [1, 1, 1])
NOISE = sp.Noise(0.02, 1e-4, 1e-3)


class Humidity(LabEffect):
    id = "humidity"
    what = "support friction follows the humidity of the room"
    needs = "a column humidity (%) in trials.csv that varies, and forces"
    parameter = Parameter("slope", "1 per %", 0.0, -0.02, 0.02)
    remedy = "keep the room at 50 % humidity"

    def wrench(self, rows, wrench, value):
        return wrench * (1 + value[0] * (rows.columns["humidity"] - 50.0))[:, None]


class Play(LabEffect):
    id = "mount-play"
    what = "the fingers give way against the load"
    needs = "poses of the pusher and the slider, and forces"
    parameter = Parameter("play", "m", 0.0, -0.005, 0.005)

    def clearance(self, rows, finger, value):
        # the fingers are nearer to where the pusher was than it was told, along the force on them
        force = rows.wrench[:, :2] / np.linalg.norm(rows.wrench[:, :2], axis=1, keepdims=True)
        return -value[0] * (force * rows.normal[:, finger]).sum(axis=1)


@pytest.fixture(scope="module")
def clean():
    rig = sp.VirtualRig(SLIDER, sp.IdealLimitSurface(FEET, 3.5), 0.6, sp.Pusher.finger(0.005), [], NOISE)
    log = rig.execute(sp.random_pushes(SLIDER, rig.pusher, 40, seed=2), seed=2).log
    humidity = np.random.default_rng(3).uniform(30, 70, len(log)).round(1)
    return sp.PushLog(log.rig, {**log.trials, "humidity": humidity}, log.samples)


def test_friction_that_follows_a_column_is_named(clean):
    by_trial = dict(zip(clean.trials["trial"], clean.trials["humidity"], strict=True))
    factor = np.array([1 + 0.006 * (by_trial[name] - 50) for name in clean.samples["trial"]])
    humid = sp.PushLog(
        clean.rig, clean.trials, {k: v * factor if k in ("fx", "fy", "tau") else v for k, v in clean.samples.items()}
    )
    report = sp.diagnose(humid, effects=[Humidity()])
    assert report.verdict == "named" and report.named == ["humidity"]
    slope = report.ranking[0].parameters["slope"]
    assert slope.estimate == pytest.approx(0.006, rel=0.1) and slope.ci95[0] < 0.006 < slope.ci95[1]
    assert "humidity of the room" in report.sentence
    assert report.reductions[0].closed > 0 and not report.changes_plans
    assert report.to_do[0] == "humidity: keep the room at 50 % humidity"
    # what no scene can hold is not carried into one
    assert not report.corrected[0].effects and report.to_json()["ranking"][0]["effect"] == "humidity"
    # without it the gap has no name of the catalogue's
    assert sp.diagnose(humid).verdict != "named"


def test_play_of_a_tool_shows_in_where_fingers_touch(clean):
    samples = dict(clean.samples)
    forces = np.column_stack([samples[k] for k in ("fx", "fy")])
    theta, size = samples["theta"], np.maximum(np.linalg.norm(forces, axis=1), 1e-12)
    c, s = np.cos(theta), np.sin(theta)
    world = np.column_stack((c * forces[:, 0] - s * forces[:, 1], s * forces[:, 0] + c * forces[:, 1])) / size[:, None]
    touching = np.isfinite(samples["fx"]) & (np.asarray(samples["phase"]) == "push")
    for k, name in enumerate(("px", "py")):
        # the tool is told where it would be without the play: ahead of its fingers
        samples[name] = samples[name] + np.where(touching, 0.0015 * world[:, k], 0.0)
    report = sp.diagnose(sp.PushLog(clean.rig, clean.trials, samples), effects=[Play()])
    named = {entry.effect: entry for entry in report.ranking if entry.effect in report.named}
    assert "mount-play" in named
    assert named["mount-play"].parameters["play"].estimate == pytest.approx(0.0015, rel=0.15)


def test_a_clean_log_has_none(clean):
    report = sp.diagnose(clean, effects=[Humidity(), Play()])
    assert report.verdict == "none"
    probable = {entry.effect: entry.probability for entry in report.ranking}
    assert len(report.ranking) == len(CATALOGUE) + 2 and max(probable["humidity"], probable["mount-play"]) < 0.1


def test_effects_that_are_none_are_refused(clean):
    class Nameless(Humidity):
        id = "drift"

    flat = replace(Humidity.parameter, low=0.0, high=0.0)
    still = type("Still", (Humidity,), {"parameter": flat})
    for effects, words in (
        ([Nameless()], "effects[0]: expected an id of its own, got 'drift'"),
        ([Humidity(), Humidity()], "effects[1]: expected an id of its own, got 'humidity'"),
        (["humidity"], "effects[0]: expected a LabEffect, got str"),
        ([still()], "effects[0]: expected a parameter with a range, low < high"),
    ):
        with pytest.raises(sp.InputError) as error:
            sp.diagnose(clean, effects=effects)
        assert str(error.value) == words


def test_a_log_that_lacks_what_an_effect_reads(clean, monkeypatch):
    from stablepush.effects import lab

    trials = {name: values for name, values in clean.trials.items() if name != "humidity"}
    dry = sp.PushLog(clean.rig, trials, clean.samples)
    with pytest.raises(sp.InputError, match="got no column 'humidity' in trials"):
        sp.diagnose(dry, effects=[Humidity()])
    blank = sp.PushLog(clean.rig, {**trials, "humidity": ["", *clean.trials["humidity"][1:]]}, clean.samples)
    with pytest.raises(sp.InputError, match="got numbers that are not finite"):
        sp.diagnose(blank, effects=[Humidity()])
    # one that a package registered is left out
    monkeypatch.setattr(lab, "plugin_names", lambda group: ["humidity"])
    monkeypatch.setattr(lab, "load_plugin", lambda group, name: Humidity)
    assert sp.diagnose(dry).verdict == "none"


def test_packages_register_effects(monkeypatch):
    from stablepush.effects import lab

    monkeypatch.setattr(lab, "plugin_names", lambda group: ["humidity"])
    monkeypatch.setattr(lab, "load_plugin", lambda group, name: Humidity)
    assert list(lab_effects()) == ["humidity"] and list(lab_effects([Play()])) == ["humidity", "mount-play"]


def test_a_registered_effect_that_is_broken_stops_nothing(monkeypatch, clean):
    from stablepush.effects import lab

    def load(group, name):
        if name == "torn":
            raise ZeroDivisionError("in its module")
        return {"humidity": Humidity, "word": "no effect"}[name]

    monkeypatch.setattr(lab, "plugin_names", lambda group: ["torn", "humidity", "word"])
    monkeypatch.setattr(lab, "load_plugin", load)
    with pytest.warns(sp.StablepushWarning) as warned:
        assert list(lab_effects()) == ["humidity"]
    torn, word = (str(w.message) for w in warned)
    told = r"the registered effect torn is left out: ZeroDivisionError: in its module \(test_lab_effects.py, line \d+, in load\)"
    assert re.fullmatch(told, torn)
    assert word == "the registered effect word is left out: word: expected a LabEffect, got str"


def test_what_a_lab_writes_wrongly_is_named(clean):
    class Always(Humidity):
        def wrench(self, rows, wrench, value):
            return wrench + 0.1

    class InPlace(Humidity):
        def wrench(self, rows, wrench, value):
            wrench *= (1 + value[0] * (rows.columns["humidity"] - 50.0))[:, None]
            return wrench

    class Mute(LabEffect):
        id = "mute"

    class Elsewhere(Humidity):
        acts = "moon"

    for effects, words in (
        ([Humidity], "effects[0]: expected a LabEffect, got a class, not an object of it"),
        ([Always()], "effect humidity: expected finite loads"),
        ([Mute()], "effects[0]: expected what, in words, got none"),
        ([Elsewhere()], "effects[0]: expected acts support or sensing, got 'moon'"),
    ):
        with pytest.raises(sp.InputError) as error:
            sp.diagnose(clean, effects=effects)
        assert str(error.value).startswith(words)
    report = sp.diagnose(clean, effects=[InPlace()])
    assert report.verdict == "none"
    # without forces there is nothing that it changes, and that is said
    samples = {key: column for key, column in clean.samples.items() if key not in ("fx", "fy", "tau")}
    told = sp.diagnose(sp.PushLog(clean.rig, clean.trials, samples), effects=[Humidity()]).notes
    assert any("humidity was not tested" in note for note in told)


def test_the_command_line_knows_registered_effects(monkeypatch, tmp_path, capsys):
    from stablepush.cli import main
    from stablepush.effects import lab

    monkeypatch.setattr(lab, "plugin_names", lambda group: ["humidity"])
    monkeypatch.setattr(lab, "load_plugin", lambda group, name: Humidity)
    assert main(["effects"]) == 0
    assert "humidity: support friction follows the humidity of the room; of an installed package" in capsys.readouterr().out
    assert main(["effects", "humidity"]) == 0
    shown = capsys.readouterr().out
    assert "slope [1 per %]: no effect at 0; from -0.02 to 0.02" in shown and "a log needs a column humidity" in shown
    arguments = ["simulate", str(tmp_path / "scene.json"), str(tmp_path / "plan.json"), "-o", str(tmp_path / "log")]
    assert main([*arguments, "--effect", "humidity:slope=0.01"]) == 2
    assert "those of a lab are diagnosed, not simulated" in capsys.readouterr().err


class Broken(Humidity):
    id = "broken"

    def wrench(self, rows, wrench, value):
        return wrench * (1 + value[0] * rows.columns["humidity"])  # a column, where rows of three are


def test_a_mistake_in_an_effect_is_told_by_its_name(clean, monkeypatch):
    with pytest.raises(sp.InputError, match=r"effect broken: .*ValueError: operands could not be broadcast"):
        sp.diagnose(clean, effects=[Broken()])
    # one that a package registered is left out, and the log is diagnosed all the same
    monkeypatch.setattr("stablepush.effects.lab.plugin_names", lambda group: ["broken"])
    monkeypatch.setattr("stablepush.effects.lab.load_plugin", lambda group, name: Broken)
    with pytest.warns(sp.StablepushWarning, match="the registered effect broken is left out, it gives ValueError"):
        assert sp.diagnose(clean).verdict == "none"
