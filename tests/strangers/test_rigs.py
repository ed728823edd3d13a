"""Rigs of other people that are in order: a controller that steers, another engine's cone, a believed friction that is off."""

import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import make_log
from recordings import mapping_file

import stablepush as sp
from stablepush.cli import main
from stablepush.effects import friction_over_place
from stablepush.geometry import rotate_vectors
from stablepush.views import gap_html
from stablepush.views.plot import plot_forms

STEP, SPEED, RADIUS = 0.05, 0.013, 0.005


def steered(count, way, seed):
    """Long pushes by one finger that a controller steers at 20 Hz: poses of slider and finger, with noise, and times."""
    rng = np.random.default_rng(seed)
    slider = sp.Slider.rectangle(0.07, 0.08, mass=0.3)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.008), 0.3 * 9.81 * 0.3)
    rows = []
    for number in range(count):
        pose, finger = np.zeros(3), np.array((-0.035 - RADIUS - 1e-6, rng.uniform(-0.006, 0.006), 0.0))
        bend, of_push = rng.uniform(-0.3, 0.3), []
        while np.hypot(*pose[:2]) < way:
            place = rotate_vectors(-pose[2], finger[:2] - pose[:2])
            # where on the edge a push would turn it back to the curve
            wanted = 0.6 * (pose[2] - bend * pose[0] / way) * 0.035 + 0.3 * (pose[1] - bend * pose[0] ** 2 / 2 / way)
            velocity = rotate_vectors(pose[2], np.array((SPEED, np.clip(4 * (wanted - place[1]), -0.01, 0.01))))
            of_push.append((pose, finger))
            trace = sp.simulate_push(surface, slider, sp.Pusher.finger(RADIUS), 0.2, pose, finger, [((*velocity, 0.0), STEP)])
            pose, finger = np.asarray(trace.poses)[-1], np.asarray(trace.pushers)[-1]
        of_push = [of_push[0]] * 10 + of_push
        for k, (body, tip) in enumerate(of_push):
            seen = body + rng.normal(0, (1e-4, 1e-4, 1.5e-3))
            rows.append((number, k * STEP + 100 * number, *seen, *(tip[:2] + rng.normal(0, 5e-5, 2))))
    return slider, rows


@pytest.mark.parametrize("noise", [{"force": 0.0, "position": 1e-4, "angle": 1.5e-3}, None])
def test_pushes_that_a_controller_steers_are_compared(tmp_path, capsys, noise):
    slider, rows = steered(5, 0.12, seed=1)
    table = tmp_path / "pushes.csv"
    table.write_text("push,t,x,y,th,px,py\n" + "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows))
    columns = {"trial": "push", "t": "t", "x": "x", "y": "y", "theta": "th", "tip_x": "px", "tip_y": "py"}
    entries = {"noise": noise} if noise else {}
    mapping = mapping_file(tmp_path, columns=columns, friction={"support": 0.3, "contact": 0.2}, **entries)
    sp.save_slider(slider, tmp_path / "slider.json")
    assert main(["import", str(table), "--mapping", str(mapping), "-o", str(tmp_path / "log")]) == 0
    capsys.readouterr()
    report = sp.diagnose(sp.read_pushlog(tmp_path / "log"))
    assert report.verdict == "none" and report.named == []
    (pose,) = (entry for entry in report.gap if entry.channel == "pose")
    assert pose.nominal < 2e-3


def four_lobes(log, share):
    """The log of a rig whose friction has four lobes over the direction in W, as a pyramidal cone has."""
    twists = log.twists()
    headings = np.arctan2(*rotate_vectors(log.columns("theta")[:, 0], twists[:, :2]).T[::-1])
    factor = 1 + share * np.cos(4 * np.nan_to_num(headings))
    return sp.PushLog(log.rig, log.trials, {k: v * factor if k in ("fx", "fy", "tau") else v for k, v in log.samples.items()})


def test_four_lobes_of_friction_are_not_called_anisotropy():
    report = sp.diagnose(four_lobes(make_log(count=40, seed=5), 0.14))
    assert not {"anisotropy-world", "anisotropy-object"} & set(report.named)
    assert report.verdict != "none"


def test_the_map_of_friction_is_relative_to_the_one_believed():
    """Friction was believed a quarter too high, and depends on the place: the map shows the ratio, where pushes were."""
    log = make_log("spatial-variation:gradient=0.9/-0.7", count=40, seed=2)
    truth = float(log.rig.support_friction)
    wrong = sp.PushLog(replace(log.rig, support_friction=1.25 * truth), log.trials, log.samples)
    report = sp.diagnose(wrong)
    assert "spatial-variation" in report.named
    axes = plot_forms(report)[report_index(report)]
    (mesh,) = axes.collections
    at = mesh.get_coordinates()
    centres = (at[:-1, :-1] + at[1:, 1:]) / 2
    shown = np.ma.masked_invalid(mesh.get_array()).reshape(centres.shape[:2])
    true = friction_over_place((0.9, -0.7), [], centres) / 1.25
    assert np.abs(shown - true).max() < 0.05
    # and only where the slider has been
    seen = log.columns("x", "y")
    away = np.linalg.norm(centres[:, :, None] - seen[None, None], axis=-1).min(axis=-1)
    assert (np.ma.getmaskarray(shown) == (away > log.rig.slider.radius)).mean() > 0.98
    assert "friction over the one believed" in axes.figure.axes[-1].get_ylabel()


def report_index(report):
    drawn = ("anisotropy-world", "anisotropy-object", "speed-dependence", "spatial-variation", "drift", "contact-friction")
    return [id for id in (entry.effect for entry in report.ranking) if id in report.named and id in drawn].index(
        "spatial-variation"
    )


def test_the_page_begins_with_the_channel_that_the_cause_shows_in():
    """A delay of the poses shows in final poses; loads are within the noise and come after."""
    report = sp.diagnose(make_log("latency:delay=0.08", count=24))
    page = gap_html(report)
    pictures = {"pose": "Where: final poses", "wrench": "Where: over the table"}
    first = min(pictures, key=lambda channel: page.index(pictures[channel]))
    by_name = {entry.channel: entry for entry in report.reductions}
    assert by_name[first].closed >= max(by_name[other].closed for other in pictures if other in by_name)
    told = re.findall(r"<(?:dt|th|td)[^>]*>(wrench|pose|clearance|twist)<", page[page.index("Gap reduction") :])
    assert told and by_name[told[0]].closed >= by_name[first].closed - 1e-9


@pytest.mark.parametrize("value", ["0.02/0.0", "0.004/0.0"])
def test_values_beyond_what_rigs_have_are_noted(tmp_path, capsys, rig, value):
    arguments = [
        "simulate",
        rig / "scene.json",
        rig / "plan.json",
        "--effect",
        f"pressure-shift:offset={value}",
        "-o",
        tmp_path / "log",
    ]
    assert main(list(map(str, arguments))) == 0
    said = capsys.readouterr().err
    assert ("rigs are found with -0.01 to 0.01 m" in said) == value.startswith("0.02")
