"""Poses that a tracker gets wrong for a moment, and motions that only look like it."""

import warnings

import numpy as np
import pytest
from recordings import RADIUS, SLIDER as SMALL, recorded

import stablepush as sp

RIG = sp.Rig(SMALL, finger_radius=RADIUS)


def made(t, poses, tips, forces, trials=None):
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log = sp.log_from_arrays(RIG, t, poses, forces, tips, trials)
    return log, [str(warning.message) for warning in heard if "leaps" in str(warning.message)]


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize(("rate", "length"), [(60.0, 1), (100.0, 3), (250.0, 10)])
def test_glitches_change_neither_pushes_nor_pairs(rate, length, named):
    """A leap of 5 to 30 mm and back: without a trial each began a push of its own, with one it was a twist."""
    (t, poses, tips, forces), trials, _ = recorded(count=6, rate=rate)
    trials = trials if named else None
    clean, said = made(t, poses, tips, forces, trials)
    assert not said
    rng = np.random.default_rng(5)
    wrong = poses.copy()
    rows = np.linspace(0.05 * len(t), 0.95 * len(t), 8).astype(int)
    for row in rows:
        wrong[row : row + length] += rng.choice((-1, 1), 3) * rng.uniform(0.005, 0.03, 3) * (1, 1, 20)
    log, said = made(t, wrong, tips, forces, trials)
    assert len(said) == 1
    assert f"{length * len(rows)} poses are left out" in said[0]
    assert len(log) == len(clean) == 6
    for found, expected in zip(log.pairs()[:2], clean.pairs()[:2], strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.02, atol=0.02 * np.abs(expected).max())


def test_a_glitch_is_told_with_its_time():
    (t, poses, tips, forces), trials, _ = recorded()
    poses[120, :2] += 0.01
    _, said = made(t, poses, tips, forces, trials)
    assert said == ["the tracker leaps away and back once, 1.2 s after the first row of push p0: 1 pose is left out"]


def turns(rate, rho=0.03, speed=0.03):
    """Turns about a point of the body and back: places grow, stop and shrink."""
    t = np.arange(0.0, 20.0, 1 / rate)
    angle = speed / rho * np.abs((t + 2.0) % 8.0 - 4.0)
    return t, np.column_stack((rho * np.cos(angle), rho * np.sin(angle), angle))


def held(rate, every):
    """A tracker that is slower than the clock of the record."""
    t, poses = turns(rate)
    return t, poses[np.arange(len(t)) // every * every]


def set_back():
    """A hand sets the slider back between pushes, in a single row."""
    t = np.arange(0.0, 12.0, 0.01)
    x = 0.02 * np.maximum((t % 2.0) - 1.0, 0.0)
    return t, np.column_stack((x, 0 * x, 0 * x))


def pushed_back(rate):
    """A slider that rests nearly all the time, and is pushed ahead and at once back."""
    t = np.arange(0.0, 60.0, 1 / rate)
    x = 0.05 * np.maximum(0.0, 0.4 - np.abs(t - 30.0))
    return t, np.column_stack((x, 0 * x, 0 * x))


def in_leaps():
    """A slider that sticks and slips: 2 mm at once, ten times a second."""
    t = np.arange(0.0, 6.0, 0.005)
    x = 2e-3 * np.floor(10 * np.maximum(t - 1.0, 0.0))
    return t, np.column_stack((x, 0 * x, 0 * x))


MOTIONS = {
    **{f"turns {rate:g} Hz": turns(rate) for rate in (5.0, 30.0, 250.0)},
    "held 8 rows": held(240.0, 8), "held 10 rows": held(100.0, 10), "set back": set_back(), "in leaps": in_leaps(),
    **{f"pushed back {rate:g} Hz": pushed_back(rate) for rate in (10.0, 30.0, 250.0)},
}  # fmt: skip


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_motion_is_no_glitch(motion, noise):
    t, poses = motion
    poses = poses + np.random.default_rng(1).normal(size=poses.shape) * (noise, noise, 10 * noise)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        sp.log_from_arrays(sp.Rig(SMALL), t, poses, trials=["a"] * len(t))
    assert not [warning for warning in heard if "leaps" in str(warning.message)]


@pytest.mark.parametrize("length", (1, 3))
def test_a_marker_that_flips_is_a_glitch(length):
    """By half a turn, whose sign nobody knows: the rest of the record keeps its headings."""
    (t, poses, tips, forces), trials, _ = recorded(count=6, rate=60.0)
    clean, _ = made(t, poses, tips, forces, trials)
    wrong = poses.copy()
    rows = np.linspace(0.05 * len(t), 0.95 * len(t), 8).astype(int)
    for row in rows:
        wrong[row : row + length, 2] += np.pi
    log, said = made(t, wrong, tips, forces, trials)
    assert f"{length * len(rows)} poses are left out" in said[0]
    np.testing.assert_allclose(log.pairs().twists, clean.pairs().twists, atol=2e-3)


def test_one_trial_does_not_hide_the_glitches_of_others():
    (t, poses, tips, forces), trials, _ = recorded(count=6, rate=60.0)
    rows = np.flatnonzero(np.array(trials) == "p0")
    # a slider that is set back while its trial lasts
    poses[rows[60:], :2] += 0.1
    tips[rows[60:]] += 0.1
    poses[np.flatnonzero(np.array(trials) == "p3")[70], :2] += 0.01
    _, said = made(t, poses, tips, forces, trials)
    assert len(said) == 1 and "once" in said[0] and "push p3" in said[0]
