"""Loops under seal: what is wrong acts in the engine, is recorded as a lab would, and is in no file that plans see."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import stablepush as sp
from stablepush.cli.program import main

pytest.importorskip("mujoco")
pytest.importorskip("cryptography")

from stablepush.blind.loop import ARMS, believed, summary, true_problem
from stablepush.blind.loop_rig import Recorder, carry_out, tracked
from stablepush.blind.loop_worlds import CAUSES, FINGER, IN_TURN, draw_loop

SEED = 3


def world_of(cause):
    """The first loop of a seed with a cause."""
    return draw_loop(SEED, (IN_TURN.index(cause) - SEED) % len(IN_TURN))


def straight(world, length=0.08):
    """A straight push along the normal, and its planned end."""
    twist = np.array((*(0.03 * world.normal), 0.0))
    start = world.tasks[0, 0]
    return [(start, twist, length / 0.03)]


def ended(world, **given):
    pushes = straight(world)
    done, begins = carry_out(world, "mujoco", world.tasks[0, 0], pushes, **given)
    return done, begins, tracked(world, done.slider[-1:])[0]


def test_each_cause_has_its_turn_and_its_size():
    worlds = [draw_loop(SEED, k) for k in range(len(IN_TURN))]
    assert {w.cause for w in worlds} == set(CAUSES)
    again = draw_loop(SEED, 0)
    np.testing.assert_array_equal(again.outline, worlds[0].outline)
    slippery = world_of("contact-friction")
    assert 0.5 <= slippery.true("contact-friction", 1.0) / slippery.contact_mu <= 0.75
    assert math.hypot(*world_of("tilt").numbers["value"]) == pytest.approx(math.radians(2.0))
    assert world_of("nothing").true("tilt", 5.0) == 5.0


def test_without_anything_wrong_a_straight_push_ends_as_planned_and_is_recorded():
    world = world_of("nothing")
    done, begins, end = ended(world)
    assert np.hypot(*(end - world.tasks[0, 0])[:2]) == pytest.approx(0.08, abs=2e-3)
    recorder = Recorder(world, np.random.default_rng(0))
    recorder.add(done, begins, 0.03)
    rows = [row for row in recorder.samples if row["phase"] == "push"]
    assert len(rows) == 7 and recorder.samples[0]["phase"] == "rest"
    load = world.mu * world.mass * 9.81
    assert np.mean([math.hypot(row["fx"], row["fy"]) for row in rows[2:]]) == pytest.approx(load, rel=0.05)
    assert math.hypot(recorder.samples[0]["fx"], recorder.samples[0]["fy"]) < 0.15


def test_thicker_fingers_push_ahead_unless_the_plan_knows_them():
    world = world_of("contact-geometry")
    _, _, end = ended(world)
    _, _, known = ended(world, radius=FINGER + 0.002)
    assert np.hypot(*(end - known)[:2]) == pytest.approx(0.002, abs=3e-4)


@pytest.mark.parametrize("cause, columns, size", [("force-bias", ("fx", "fy"), 0.3), ("latency", ("x", "y"), 0.003)])
def test_sensors_err_as_the_cause_says(cause, columns, size):
    """The bias in N; a delay of 0.1 s at 0.03 m/s in m."""
    world = world_of(cause)
    recorded = []
    for errs in (world, replace(world, cause="nothing", numbers={})):
        recorder = Recorder(errs, np.random.default_rng(0))
        recorder.add(*carry_out(errs, "mujoco", world.tasks[0, 0], straight(world)), 0.03)
        recorded.append(np.array([[row[name] for name in columns] for row in recorder.samples[3:]]))
    assert np.hypot(*np.mean(recorded[0] - recorded[1], axis=0)) == pytest.approx(size, rel=0.2)


def test_the_tracker_reads_an_origin_that_is_off():
    world = world_of("frame-offset")
    pose = np.array(((0.1, 0.2, 1.0),))
    assert np.hypot(*(tracked(world, pose) - pose)[0, :2]) == pytest.approx(0.004)
    done, _ = carry_out(world, "mujoco", world.tasks[0, 0], straight(world))
    np.testing.assert_allclose(tracked(world, done.slider[:1])[0], world.tasks[0, 0], atol=1e-6)


def test_the_true_scene_has_what_is_wrong():
    tilted = world_of("tilt")
    scene = believed(tilted)
    truth = true_problem(tilted, scene)
    assert [entry.effect.id for entry in truth.effects] == ["tilt"] and not scene.effects
    assert (
        true_problem(world_of("contact-friction"), believed(world_of("contact-friction"))).contacts[0].mu
        < 0.8 * scene.contacts[0].mu + 0.5
    )
    aside = world_of("contact-place")
    moved = true_problem(aside, believed(aside)).contacts[0].points - aside.points
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.004)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loops")
    assert main(["blind", "--loop", "--sets", "1", "--seed", "5", "-o", str(folder)]) == 0
    return folder


def test_a_campaign_is_sealed_scored_and_resumes(campaign, capsys):
    rows = json.loads((campaign / "loops" / "0000" / "rows.json").read_text())
    assert [row["arm"] for row in rows] == [*ARMS, *ARMS]
    events = [json.loads(line)["event"] for line in (campaign / "ledger.jsonl").read_text().splitlines()]
    assert events == ["begun", "sealed", "diagnosed", "opened", "executed"]
    cause = draw_loop(5, 0).cause
    for file in (campaign / "loops" / "0000").rglob("*"):
        if file.is_file() and file.name not in ("rows.json", "answer.json"):
            assert cause not in file.read_text(errors="ignore")
    log = sp.read_pushlog(campaign / "loops" / "0000" / "log")
    assert log.rig.model is not None and log.rig.contact_kind == "two-point" and len(log) > 4
    capsys.readouterr()
    assert main(["blind", "--loop", "--sets", "1", "--seed", "5", "-o", str(campaign)]) == 0
    told = capsys.readouterr().out
    assert f"{cause}: old " in told and "arrived, arm corrected" in told and "last entry of the ledger" in told
    assert (campaign / "score.csv").read_text().startswith("loop,cause,arm,arrived")
    assert main(["blind", "--loop", "--sets", "2", "--seed", "5", "-o", str(campaign)]) == 2
    assert "begun with loops 1" in capsys.readouterr().err


def test_a_broken_seal_stops_it(campaign, capsys):
    answer = campaign / "loops" / "0000" / "answer.json"
    whole = answer.read_bytes()
    answer.write_bytes(whole.replace(b"verdict", b"verdikt"))
    assert main(["blind", "--loop", "--sets", "1", "--seed", "5", "-o", str(campaign)]) == 2
    assert "the diagnosis is not the one" in capsys.readouterr().err
    answer.write_bytes(whole)


def test_loops_and_other_checks_do_not_share_a_folder(campaign, capsys):
    assert main(["blind", "--sets", "1", "-o", str(campaign)]) == 2
    assert "line 1" in capsys.readouterr().err
    assert main(["blind", "--loop", "--generator", "both", "-o", str(campaign)]) == 2
    assert "expected mujoco or drake" in capsys.readouterr().err


def test_arrivals_are_counted_by_cause_and_in_pairs():
    rows = []
    for loop, (cause, named) in enumerate((("tilt", "tilt"), ("tilt", "drift"), ("nothing", ""))):
        for task in range(2):
            for arm in ARMS:
                arrived = arm != "old" or (cause == "nothing" and task == 0)
                rows.append(
                    {"loop": loop, "cause": cause, "arm": arm, "arrived": arrived, "duration": 2.0 if arm == "wide" else 1.0,
                     "arrival": 0.9, "verdict": "named" if named else "none", "named": named}
                )  # fmt: skip
    said = dict(summary(rows))
    assert said["tilt"] == "old 0 of 4; wide 4 of 4; corrected 4 of 4; true 4 of 4; names: 1 right, 1 wrong, 0 ambiguous of 2"
    assert said["nothing"].startswith("old 1 of 2; wide 2 of 2") and "1 right, 0 wrong" in said["nothing"]
    assert "5 better and 0 worse than old" in said["corrected against old and wide"]
    assert "time 0.500 of it" in said["corrected against old and wide"]
