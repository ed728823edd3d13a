"""Records of a tracker whose noise is as quick as the pushes are."""

import warnings

import numpy as np
import pytest

import stablepush as sp

SLIDER = sp.Slider(sp.Slider.rectangle(0.16, 0.1, mass=0.7).vertices, mass=0.7)
PUSHES, SPEED, FORCE, RADIUS = 20, 0.01, 2.0, 0.005


def record(position, angle, seed=0, rate=120.0):
    """Straight pushes of 5 mm that a finger makes from either side, which goes away in between, as a tracker of half the rate
    sees them, interpolated: times, poses, forces on the slider, places of the tip."""
    rng, step = np.random.default_rng(seed), 1 / rate
    x, way, tips, forces = 0.0, [], [], []
    for k in range(PUSHES):
        side = 1.0 if k % 2 == 0 else -1.0
        pushing = np.arange(0.0, 0.5, step)
        ahead = x + side * SPEED * pushing
        # away, near, pushing, away again
        waits = np.full(round(1.2 * rate), 0.0)
        back = ahead[-1] - side * (0.08 + RADIUS + 0.02)
        way += [x + waits, ahead, ahead[-1] + waits]
        tips += [x - side * (0.08 + RADIUS + 0.02) + waits, ahead - side * (0.08 + RADIUS), back + waits]
        forces += [waits, np.full(len(pushing), side * FORCE), waits]
        x = ahead[-1]
    place, tip, force = (np.concatenate(parts) for parts in (way, tips, forces))
    times, none = step * np.arange(len(place)), np.zeros(len(place))
    seen = np.arange(0, len(times), 2)
    noise = rng.normal(size=(len(seen), 3)) * (position, position, angle)
    poses = np.column_stack((place, none, none)) + np.column_stack([np.interp(times, times[seen], column) for column in noise.T])
    read = np.column_stack((force, none)) + rng.normal(size=(len(times), 2)) * 0.03
    return times, poses, read, np.column_stack((tip, none))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("position", "angle"), [(1e-4, 1.75e-3), (5e-5, 9e-4)])
def test_pushes_are_found_and_measured_through_noise(position, angle, seed):
    """0.1 mm and 0.1 degrees, over 0.1 s, are speeds of half a push: rests looked like pushes, and loads of rests like theirs."""
    times, poses, forces, tips = record(position, angle, seed)
    rig = sp.Rig(SLIDER, finger_radius=RADIUS, noise=sp.Noise(0.03, position, angle))
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log = sp.log_from_arrays(rig, times, poses, forces, tips)
    assert any("the tracker is noisy" in str(warning.message) for warning in heard) == (log.rig.twist_window > 0.1)
    assert len(log) == PUSHES
    loads, twists, _ = log.pairs()
    np.testing.assert_allclose(np.median(np.abs(loads[:, 0])), FORCE, rtol=0.03)
    # slopes of half a second's push reach beyond its ends
    np.testing.assert_allclose(np.median(np.abs(twists[:, 0])), SPEED, rtol=0.25)
    assert np.abs(twists[:, 1]).max() < 0.2 * SPEED


def test_the_window_is_short_where_noise_allows_and_as_given_where_it_is_given():
    times, poses, forces, tips = record(1e-5, 1e-4)
    rig = sp.Rig(SLIDER, finger_radius=RADIUS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sp.log_from_arrays(rig, times, poses, forces, tips).rig.twist_window == 0.1
    assert sp.log_from_arrays(rig, times, poses, forces, tips, window=0.23).rig.twist_window == 0.23
    with pytest.raises(sp.InputError, match="window"):
        sp.log_from_arrays(rig, times, poses, forces, tips, window=0.0)


def test_without_forces_a_push_is_where_the_finger_is(tmp_path):
    """Named pushes: of their rows at rest some look as quick as the push, and the finger is away in them."""
    times, poses, _, tips = record(1e-4, 1.75e-3, seed=5)
    names = np.repeat([f"{k}" for k in range(PUSHES)], len(times) // PUSHES).tolist()
    rig = sp.Rig(SLIDER, finger_radius=RADIUS, noise=sp.Noise(0.0, 1e-4, 1.75e-3))
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log = sp.log_from_arrays(rig, times, poses, None, tips, names)
    assert not any("off the outline" in str(warning.message) for warning in heard)
    for name in log.trials["trial"]:
        rows = log.rows(name)
        pushed = log.columns("t")[rows, 0][log.samples["phase"][rows] == "push"]
        # they push from 1.2 s to 1.7 s
        assert 1.15 <= pushed[0] <= 1.45 and 1.5 <= pushed[-1] <= 1.75


def test_without_forces_and_noise_a_push_is_as_long_as_the_motion():
    times, poses, _, tips = record(0.0, 0.0)
    names = np.repeat([f"{k}" for k in range(PUSHES)], len(times) // PUSHES).tolist()
    log = sp.log_from_arrays(sp.Rig(SLIDER, finger_radius=RADIUS), times, poses, None, tips, names, window=0.05)
    pushed = log.columns("t")[:, 0][log.samples["phase"] == "push"]
    assert 1.15 <= pushed.min() <= 1.25 and 1.65 <= pushed.max() <= 1.75
