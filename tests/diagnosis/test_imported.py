"""Diagnoses of what a laboratory records in the world: a tracker, a finger, a sensor of forces and none of moments."""

import numpy as np
import pytest

import stablepush as sp
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
