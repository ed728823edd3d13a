"""What a diagnosis makes of fingers: the gaps between them and the outline, their slip, their radius."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import FORCES, LOAD, MASS, QUIET, check_schema, edited, make_log, pressure, triangle

import stablepush as sp
from stablepush.diagnosis.rows.fingers import finger_places
from stablepush.diagnosis.rows.observations import observe
from stablepush.diagnosis.search.contact_friction import suspected_friction
from stablepush.diagnosis.search.finger_forces import FingerForces
from stablepush.rig import edge_command


def one_finger_a_push():
    """A log of a pusher with two fingers of which one touches in a push, now this and now that."""
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    pusher = sp.Pusher.two_fingers(0.05, 0.005)
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(pressure(), LOAD), 0.5, pusher, [], sp.Noise(0.02, 5e-5, 5e-4))
    pushes = sp.random_pushes(slider, pusher, 40, seed=3)
    straight = [edge_command(push, pusher, push.start) for push in pushes]
    commands = [replace(c, pusher_pose=np.add(c.pusher_pose, (0, 0, 0.25 * (-1) ** k))) for k, c in enumerate(straight)]
    log = rig.execute(commands, seed=3).log
    touch = [np.isfinite(log.samples[c]) for c in ("c1x", "c2x")]
    alone = [t for t in log.trials["trial"] if not (touch[0] & touch[1])[log.rows(t)].any()]
    samples = {name: values[np.isin(log.samples["trial"], alone)] for name, values in log.samples.items()}
    trials = {name: values[np.isin(log.trials["trial"], alone)] for name, values in log.trials.items()}
    return sp.PushLog(log.rig, trials, samples)


@pytest.mark.parametrize(("side", "fingers"), (("left", ((0, -0.02), (0.0025, 0.02))), ("right", ((0.0025, -0.02), (0, 0.02)))))
def test_one_finger_of_two_that_is_thicker_is_told(side, fingers):
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    # a finger that is 2.5 mm thicker than the rig says is one that sits so far ahead
    pusher = sp.Pusher(fingers, 0.005)
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(pressure(), LOAD), 0.5, pusher, [], QUIET)
    log = rig.execute(sp.random_pushes(slider, pusher, 40)).log
    report = sp.diagnose(log)
    check_schema(report)
    assert report.named == ["contact-geometry"]
    assert report.ranking[0].parameters["radius"].estimate == pytest.approx(0.0075, abs=1e-4)
    assert any(f"the {side} finger alone" in note for note in report.notes)
    assert next(e for e in report.reductions if e.channel == "pose").closed > 0.9
    # the mended rig has fingers that are alike
    assert report.effects == {}
    # nobody knows which one is as it should be where the rig does not say how thick they are
    assert observe(edited(log, finger_radius=None)).off == (1.0, 1.0)


def test_effects_that_hide_each_other_in_the_gaps_are_found():
    """Thicker fingers seem farther off, a delay brings them nearer: neither alone explains anything."""
    report = sp.diagnose(make_log("contact-geometry:radius=0.0064", "latency:delay=0.11", two=True))
    check_schema(report)
    assert set(report.named) == {"contact-geometry", "latency"}


def test_slip_is_that_of_the_surfaces_not_of_the_contact_point():
    """A finger that rolls along a face moves its contact point, and slips no bit: against the simulated modes."""
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(pressure(), LOAD), 0.4, sp.Pusher.finger(0.02))
    execution = rig.execute(sp.random_pushes(slider, rig.pusher, 30, seed=3), rows=40)
    o = observe(execution.log)
    speed = np.hypot(*o.twist[:, :2].T)
    sticks, rolls, slips = [], [], []
    for k, trace in enumerate(execution.traces):
        rows = np.flatnonzero(o.trial == k)
        modes = trace.modes[np.clip(np.searchsorted(trace.t, o.time[rows] - 0.2) - 1, 0, len(trace.t) - 2), 0]
        corner = np.linalg.norm(o.place[rows, 0, None] - slider.vertices, axis=2).min(axis=1) < 5e-3
        inside = np.isfinite(o.slip[rows]) & ~corner & (np.arange(len(rows)) > 0) & (np.arange(len(rows)) < len(rows) - 1)
        stuck = inside & (modes == 1)
        sticks += (np.abs(o.slip[rows]) / speed[rows])[stuck].tolist()
        rolls += (0.02 * np.abs(o.twist[rows, 2]) / speed[rows])[stuck].tolist()
        for mode, sign in ((2, 1), (3, -1)):
            slips += (sign * o.slip[rows])[inside & (modes == mode)].tolist()
    assert len(sticks) > 50
    assert np.median(sticks) < 0.02
    assert np.median(rolls) > 0.1
    assert len(slips) > 10
    assert np.mean(np.array(slips) > 0) > 0.9


def test_latency_shows_without_forces():
    log = edited(make_log("latency:delay=0.1"), drop=("fx", "fy", "tau"))
    report = sp.diagnose(log)
    check_schema(report)
    assert "latency" in report.named


@pytest.mark.parametrize("seed", range(2))
def test_thin_fingers_of_unknown_radius_are_no_error(seed):
    """Noise can put the pusher a little inside of the outline."""
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    pusher = sp.Pusher.finger(0.0)
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(pressure(), LOAD), 0.5, pusher, [], sp.Noise(0.02, 2e-4, 2e-3))
    log = rig.execute(sp.random_pushes(slider, pusher, 8, seed=seed, groups=0), seed=seed).log
    check_schema(sp.diagnose(edited(log, FORCES, finger_radius=None)))


def test_fingers_that_never_touch_together_are_found():
    """Their spacing follows from single contacts, and a contact point that is logged alone counts."""
    log = one_finger_a_push()
    assert len(log) > 8
    seen = observe(log)
    assert finger_places(log) == pytest.approx(np.array(((0.0, 0.025), (0.0, -0.025))), abs=5e-4)
    touching = np.isfinite(seen.clearance)
    assert touching.any(axis=1).mean() > 0.8 and not touching.all(axis=1).any()
    assert np.nanmedian(np.abs(seen.clearance)) < 3e-4
    assert sp.diagnose(log).verdict in ("none", "absorbed")


def test_rows_at_all_but_one_time_and_jumps_of_the_pusher_are_no_error():
    """Two rows 1e-8 s apart tell nothing of the acceleration, and no pusher moves 100 km."""
    log = make_log(count=16)
    times, pushers = np.array(log.samples["t"]), np.array(log.samples["px"])
    rows = [log.rows(trial) for trial in log.trials["trial"]]
    pushing = [r[log.samples["phase"][r] == "push"] for r in rows]
    times[pushing[0][2]] = times[pushing[0][1]] + 1e-8
    pushers[pushing[1][3]] = 1e5
    report = sp.diagnose(sp.PushLog(log.rig, log.trials, {**log.samples, "t": times, "px": pushers}))
    assert report.verdict in ("none", "absorbed")


def test_the_mended_rig_knows_what_the_log_tells_of_its_fingers():
    log = edited(make_log(count=40, two=True), contact_friction=None, finger_radius=None)
    report = sp.diagnose(log)
    assert report.rig.finger_radius == pytest.approx(0.005, abs=3e-4)
    assert report.rig.contact_friction is None or report.rig.contact_friction == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(("engine", "direction", "mu"), ((None, 0.31, 0.3), (None, 0.32, 0.29), ("mujoco", 0.31, 0.3)))
def test_a_single_push_that_loses_the_object_shows_the_friction_of_the_fingers(engine, direction, mu):
    """The load is just beyond the cone of the worn fingers, so where the push ends hangs on the third digit of their friction."""
    if engine:
        pytest.importorskip("mujoco")
    feet = sp.SupportDistribution([(-0.03, -0.02), (0.06, -0.03), (-0.03, 0.05)], [1, 1, 1])
    outline = [(0.0, 0.0), (0.12, 0.0), (0.12, 0.05), (0.05, 0.05), (0.05, 0.11), (0.0, 0.11)]
    slider = sp.Slider(sp.Slider.centered(outline).vertices, mass=0.8, support=feet)
    pusher, noise = sp.Pusher.two_fingers(0.06, 0.005), sp.Noise(0.02, 1e-4, 1e-3)
    worn = [sp.parse_effect(f"contact-friction:mu={mu}")]
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(feet, 2.7), 0.5, pusher, worn, noise, engine=engine)
    two = {"width": 0.06}
    straight = sp.EdgePush.on_edge(slider, 0, 0.06, distance=0.06, speed=0.03, start=(0, 0, 0), **two)
    slanted = sp.EdgePush.on_edge(slider, 0, 0.06, direction=-direction, distance=0.73, speed=0.05, start=(0, 0, 0.5), **two)
    report = sp.diagnose(rig.execute([straight, slanted], seed=1).log)
    assert report.named == ["contact-friction"]
    assert report.ranking[0].parameters["mu"].estimate == pytest.approx(mu, abs=0.01)


def worn_fingers(*pushes, mu=0.3):
    """The report on pushes of a bracket by two fingers with worn pads, of whose friction 0.5 is believed."""
    feet = sp.SupportDistribution([(-0.03, -0.02), (0.06, -0.03), (-0.03, 0.05)], [1, 1, 1])
    outline = [(0.0, 0.0), (0.12, 0.0), (0.12, 0.05), (0.05, 0.05), (0.05, 0.11), (0.0, 0.11)]
    slider = sp.Slider(sp.Slider.centered(outline).vertices, mass=0.8, support=feet)
    worn = [sp.parse_effect(f"contact-friction:mu={mu}")]
    noise = sp.Noise(0.02, 1e-4, 1e-3)
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(feet, 2.7), 0.5, sp.Pusher.two_fingers(0.06, 0.005), worn, noise)
    made = [
        sp.EdgePush.on_edge(slider, 0, 0.06, direction=direction, distance=0.1, speed=0.04, width=0.06, start=(0, 0, 0.4))
        for direction in pushes
    ]
    return sp.diagnose(rig.execute(made, seed=1).log)


def test_a_slip_that_cannot_be_named_makes_the_next_plan_safe():
    """One push creeps at the edge of the worn cone and loses nothing: no cause can be named, and yet the next plan must hold."""
    report = worn_fingers(0.0, -0.31, 0.1)
    assert report.named == []
    assert report.corrected[0].contact_friction == pytest.approx(0.3, abs=0.02)
    assert any("a corrected scene takes 0.3" in note for note in report.notes)
    # fingers that stick throughout suspect nothing
    report = worn_fingers(0.0, -0.2, 0.1)
    assert report.corrected[0].contact_friction is None and not any("crept" in note for note in report.notes)


@pytest.mark.parametrize(
    ("slips", "creeps", "ratio", "suspected"),
    (
        ((0, 0, 0), (0, 1, 0), (0.1, 0.25, 0.2), 0.25),
        ((0, 0, 0), (0, 1, 1), (0.1, 0.25, 0.05), 0.25),
        # fingers that stick bound it from below
        ((0, 0, 0), (0, 1, 0), (0.1, 0.25, 0.26), 0.26),
        ((0, 0, 0), (0, 1, 0), (0.1, 0.25, 0.45), None),
        # no less than what is believed; against the slip; nothing moves; enough for a test
        ((1, 0, 0), (0, 0, 0), (0.45, 0.1, 0.1), None),
        ((0, 0, 0), (0, 1, 0), (0.1, -0.25, 0.2), None),
        ((0, 0, 0), (0, 0, 0), (0.1, 0.25, 0.2), None),
        ((1, 1, 1), (0, 0, 0), (0.25, 0.25, 0.25), None),
    ),
)
def test_friction_is_suspected_where_few_fingers_move(slips, creeps, ratio, suspected):
    order = np.linspace(0, 1, 3)
    of = FingerForces(np.arange(3), order, np.array(slips, bool), np.array(creeps, bool), np.array(ratio), np.full(3, 0.01))
    assert of.held_by_few(0.5) == suspected
    assert of.held_by_few(None) is None


@pytest.mark.parametrize(
    ("slips", "ratios", "suspected"),
    (
        # three pushes that disagree, as of a sensor whose offset drifts: no name, but less than the friction that is assumed
        ((0, 0, 0, 1, 1, 1, 0), (0.07, 0.01, 0.11, 0.18, 0.40, 0.31, 0.23), 0.33),
        # as much as is assumed; and no push that slips
        ((0, 0, 0, 1, 1, 1, 0), (0.07, 0.01, 0.11, 0.48, 0.52, 0.5, 0.23), None),
        ((0, 0, 0, 0, 0, 0, 0), (0.07, 0.01, 0.11, 0.18, 0.40, 0.31, 0.23), None),
    ),
)
def test_friction_that_no_test_shows_is_suspected_where_a_gap_is_unexplained(slips, ratios, suspected):
    slip = np.array(slips, bool)
    forces = FingerForces(np.arange(7), np.linspace(0, 1, 7), slip, ~slip & False, np.array(ratios), np.full(7, 0.015))
    found = suspected_friction(forces, 0.5, unexplained=True)
    assert (found is None) == (suspected is None)
    if found is not None:
        assert found[0] == pytest.approx(suspected, abs=0.04) and 0.02 < found[1] < 0.1
    assert suspected_friction(forces, 0.5, unexplained=False) is None
    assert suspected_friction(forces, None, unexplained=True) is None


@pytest.mark.parametrize("seed", (3, 6, 7, 10))
def test_a_cause_that_explains_more_takes_the_place_of_one_that_came_first(seed):
    """A delay in a few pushes of one speed looks like a radius or an offset, by tests that are linear; it explains far more."""
    report = sp.diagnose(make_log("latency:delay=0.2", count=8, seed=seed))
    assert report.named == ["latency"]
    assert report.ranking[0].parameters["delay"].estimate == pytest.approx(0.2, rel=0.05)
