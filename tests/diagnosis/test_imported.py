"""Diagnoses of what a laboratory records in the world: a tracker, a finger, a sensor of forces and none of moments."""

import json

import numpy as np
import pytest

import stablepush as sp
from stablepush.diagnosis.rows.observations import observe
from stablepush.geometry import rotate_vectors

# what looks wrong in these records is noted, as it should be
pytestmark = pytest.mark.filterwarnings("ignore::stablepush.StablepushWarning")

FEET = sp.SupportDistribution([(-0.045, -0.028), (0.045, -0.028), (0.045, 0.028), (-0.045, 0.028)], [1, 1, 1, 1])
SLIDER = sp.Slider(sp.Slider.rectangle(0.12, 0.08, mass=0.9).vertices, mass=0.9, support=FEET)
NOISE = sp.Noise(0.02, 1e-4, 1e-3)
ANGLE = 0.12


def recorded(change=lambda poses, tips, forces: (poses, tips, forces), pushes=24, named=True, gap=0.0, **how):
    """The log of pushes that were recorded in the world, with ``change`` of what is read, and ``gap`` (s) between them."""
    surface = sp.IdealLimitSurface(FEET, 0.33 * 0.9 * 9.81)
    rig = sp.VirtualRig(SLIDER, surface, 0.45, sp.Pusher.finger(0.005), [], NOISE)
    made = rig.execute(sp.random_pushes(SLIDER, rig.pusher, pushes, seed=3, groups=0), rows=30, seed=3).log
    poses, tips = made.columns("x", "y", "theta"), made.columns("px", "py")
    forces = rotate_vectors(poses[:, 2], made.columns("fx", "fy"))
    begun = dict(zip(made.trials["trial"], np.arange(len(made)) * (60.0 + gap), strict=True))
    times = made.columns("t")[:, 0] + np.array([begun[name] for name in made.samples["trial"]])
    good = np.isfinite(np.column_stack((poses, tips, forces))).all(axis=1)
    poses, tips, forces = change(poses[good], tips[good], forces[good])
    trials = np.array(made.samples["trial"])[good].tolist() if named else None
    belief = sp.Rig(SLIDER, support_friction=0.33, contact_friction=0.45, finger_radius=0.005, noise=NOISE)
    return sp.log_from_arrays(belief, times[good], poses, forces, tips, trials, **how)


def turned(poses, tips, forces):
    """What a sensor reads that is mounted at an angle."""
    return poses, tips, rotate_vectors(ANGLE, forces)


def test_a_sensor_at_an_angle_whose_moments_are_computed():
    """The moment is that of the turned force about the origin, with the arm of the contact point: not of the finger's centre."""
    report = sp.diagnose(recorded(turned))
    assert report.named == ["force-rotation"]
    angle = report.ranking[0].parameters["angle"]
    assert angle.estimate == pytest.approx(ANGLE, abs=0.004) and angle.ci95[0] < ANGLE < angle.ci95[1]
    assert report.steps[0].endswith(f"force_angle: {angle.estimate:.4f}")
    # so read again, nothing is left
    assert sp.diagnose(recorded(turned, force_angle=angle.estimate)).verdict == "none"


def test_a_wrong_scale_of_the_tracker_is_no_cause_of_the_catalogue():
    """Lengths that are 3 % too long look a little like many effects, each of which explains hardly anything."""
    for factor in (1.03, 0.97):
        scaled = recorded(lambda poses, tips, forces, k=factor: (poses * (k, k, 1.0), tips, forces))
        report = sp.diagnose(scaled)
        assert report.verdict == "unknown" and not report.named, report.sentence


def test_pushes_of_a_record_with_gaps_are_those_that_were_made():
    """Between them the slider is set back while nothing is recorded: that is no motion."""
    log = recorded(named=False, gap=5.0)
    assert len(log) == 24
    assert sp.diagnose(log).verdict == "none"


def test_the_noise_of_twists_is_that_of_slopes_over_the_window():
    """A slider that goes straight ahead at 20 mm/s, at 200 Hz, 300 times: scatter of what an observation has of its twist."""
    rng, times, pushes = np.random.default_rng(8), np.arange(0.0, 1.0, 0.005), 300
    sent = np.zeros((pushes, len(times), 3))
    sent[:, :, 0] = 0.02 * times
    seen = sent + rng.normal(size=sent.shape) * (NOISE.position, NOISE.position, NOISE.angle)
    clock = (times + 60.0 * np.arange(pushes)[:, None]).ravel()
    trials = np.repeat([str(k) for k in range(pushes)], len(times)).tolist()
    log = sp.log_from_arrays(sp.Rig(SLIDER, noise=NOISE), clock, seen.reshape(-1, 3), trials=trials, window=0.1)
    assert log.rig.twist_window == 0.1
    o = observe(log)
    order = np.concatenate([np.arange(n) for n in np.bincount(o.trial)])
    for k in range(12):
        rows = order == k
        scatter = o.twist[rows].std(axis=0) / (NOISE.position, NOISE.position, NOISE.angle)
        assert np.allclose(scatter, np.sqrt((o.noise_gain[rows] ** 2).mean()), rtol=0.15), k


def test_the_floor_of_a_recorded_log_is_what_noise_leaves():
    report = sp.diagnose(recorded())
    wrench = next(entry for entry in report.gap if entry.channel == "wrench")
    assert report.verdict == "none" and 0.6 < wrench.nominal / wrench.noise_floor < 1.1


def test_the_window_of_twists_is_kept_in_the_log(tmp_path):
    log = recorded(pushes=3, window=0.08)
    sp.write_pushlog(log, tmp_path / "log")
    assert sp.read_pushlog(tmp_path / "log").rig.twist_window == 0.08
    rig = json.loads((tmp_path / "log" / "rig.json").read_text())
    (tmp_path / "log" / "rig.json").write_text(json.dumps(rig | {"twist_window": 0}))
    with pytest.raises(sp.InputError, match=r"twist_window"):
        sp.read_pushlog(tmp_path / "log")


def test_a_trial_with_one_row_has_no_slope():
    log = recorded(pushes=12)
    alone = log.rows("1")[30]
    kept = (log.samples["trial"] != "1") | (np.arange(len(log.samples["t"])) == alone)
    few = sp.PushLog(log.rig, log.trials, {name: column[kept] for name, column in log.samples.items()})
    assert sp.diagnose(few).verdict == "none"


def test_poses_of_a_slow_tracker_on_a_faster_clock_have_no_noise_of_their_own():
    """A straight push seen at 20 Hz with noise, on a clock of 200 Hz: by interpolation, and each pose held."""
    rng, slow, fast = np.random.default_rng(9), np.arange(0.0, 1.0001, 0.05), np.arange(0.0, 1.0001, 0.005)
    pushes, interpolated, held = 300, [], []
    for _ in range(pushes):
        seen = np.outer(slow, (0.02, 0.0, 0.0)) + rng.normal(size=(len(slow), 3)) * (NOISE.position, NOISE.position, NOISE.angle)
        interpolated.append(np.stack([np.interp(fast, slow, column) for column in seen.T], axis=-1))
        held.append(seen[np.minimum((fast / 0.05 + 1e-9).astype(int), len(slow) - 1)])
    clock = (fast + 60.0 * np.arange(pushes)[:, None]).ravel()
    trials = np.repeat([str(k) for k in range(pushes)], len(fast)).tolist()
    for poses, least in ((interpolated, 0.7), (held, 0.6)):
        log = sp.log_from_arrays(sp.Rig(SLIDER, noise=NOISE), clock, np.concatenate(poses), trials=trials, window=0.2)
        o = observe(log)
        middle = np.isin(np.concatenate([np.arange(n) for n in np.bincount(o.trial)]), (4, 5, 6, 7))
        scatter = o.twist[middle].std(axis=0) / (NOISE.position, NOISE.position, NOISE.angle)
        times = np.median(o.noise_gain[middle]) / scatter
        assert (least < times).all() and (times < 1.6).all()
