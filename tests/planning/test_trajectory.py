from dataclasses import replace

import numpy as np
import pytest
from conftest import small_scene, two_edges

import stablepush as sp
from stablepush.geometry.se2 import compose, wrap_angle


@pytest.fixture(scope="module")
def solved():
    problem = two_edges()
    return problem, sp.plan(problem, time_limit=60)


def test_samples_lie_on_the_plan(solved):
    problem, result = solved
    samples = sp.sample_plan(problem, result, rate=20)
    assert samples.t[0] == 0
    assert samples.t[-1] == pytest.approx(result.duration)
    assert (np.diff(samples.t) > 0).all()
    assert np.diff(samples.t).max() <= 1 / 20 + 1e-9
    now = 0.0
    for number, segment in enumerate(result.segments):
        rows = np.flatnonzero(samples.segment == number)
        if isinstance(segment, sp.Push):
            np.testing.assert_allclose(samples.slider[rows][:, :2], segment.poses(samples.t[rows] - now)[:, :2], atol=1e-9)
            docked = compose(samples.slider[rows], problem.contacts[segment.contact].frame)
            np.testing.assert_allclose(samples.pusher[rows][:, :2], docked[:, :2], atol=1e-9)
        else:
            # the slider rests, the pusher keeps to its path
            assert np.ptp(samples.slider[rows], axis=0).max() < 1e-9
            assert np.hypot(*(samples.pusher[rows[-1], :2] - segment.pusher_path[-1, :2])) < 1e-9
        now += segment.duration


def test_with_an_acceleration_every_push_starts_and_ends_at_rest(solved):
    problem, result = solved
    limit, rate = 0.2, 400
    samples = sp.sample_plan(problem, result, rate, acceleration=limit)
    assert samples.t[-1] > result.duration
    np.testing.assert_allclose(samples.slider[-1, :2], result.pushes[-1].end[:2], atol=1e-9)
    outline = problem.slider.vertices
    for number, segment in enumerate(result.segments):
        if not isinstance(segment, sp.Push):
            continue
        rows = np.flatnonzero(samples.segment == number)[1:]
        turn = np.unwrap(samples.slider[rows, 2])
        # the way of a body is a multiple of its twist: speed and acceleration along it by differences
        size = np.linalg.norm(segment.twist * (1, 1, problem.surface.characteristic_length))
        steps = np.diff(samples.slider[rows, :2], axis=0)
        chord = np.sqrt((steps**2).sum(axis=1) + (problem.surface.characteristic_length * np.diff(turn)) ** 2)
        pace = chord / np.diff(samples.t[rows]) / size
        assert pace.max() <= 1 + 1e-3
        assert pace[0] < 0.05 and pace[-1] < 0.05
        speed = pace * float(problem.push_speed(segment.twist))
        assert np.abs(np.diff(speed) / np.diff(samples.t[rows])[1:]).max() <= limit * 1.02
    assert len(outline) == 3


def test_trajectories_survive_their_file(solved, tmp_path):
    problem, result = solved
    samples = sp.sample_plan(problem, result)
    sp.save_trajectory(samples, tmp_path / "t.csv")
    again = sp.load_trajectory(tmp_path / "t.csv")
    for name in ("t", "segment", "contact", "slider", "pusher"):
        np.testing.assert_array_equal(getattr(samples, name), getattr(again, name))


def test_trajectories_survive_a_bag(solved, tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    samples = sp.sample_plan(*solved)
    for _ in range(2):
        # the second replaces the first
        sp.save_rosbag(samples, tmp_path / "bag")
    again = sp.load_rosbag(tmp_path / "bag")
    np.testing.assert_allclose(again.t, samples.t, atol=1e-9)
    np.testing.assert_array_equal(again.segment, samples.segment)
    np.testing.assert_array_equal(again.contact, samples.contact)
    for name in ("slider", "pusher"):
        one, other = getattr(again, name), getattr(samples, name)
        np.testing.assert_array_equal(one[:, :2], other[:, :2])
        assert np.abs(wrap_angle(one[:, 2] - other[:, 2])).max() < 1e-12
    (tmp_path / "none").mkdir()
    with pytest.raises(sp.InputError, match="none"):
        sp.load_rosbag(tmp_path / "none")


def test_only_solved_plans_and_sound_rates(solved):
    problem, result = solved
    with pytest.raises(sp.InputError, match="solved"):
        sp.sample_plan(problem, sp.PlanResult("timeout", "hand"))
    push = result.pushes[0]
    wrong = (
        [],
        [replace(push, contact=7)],
        [replace(push, contact=-1)],
        [replace(push, duration=-1.0)],
        [replace(push, twist=np.zeros(3))],
        [replace(push, start=push.start + 1)],
        [sp.Transfer(0, 9, np.empty((0, 3)), 1.0)],
    )
    for segments in wrong:
        with pytest.raises(sp.InputError, match="segments"):
            sp.sample_plan(problem, replace(result, segments=tuple(segments)))
    for bad in ({"rate": 0}, {"rate": np.nan}, {"rate": 1e9}, {"acceleration": 0}):
        with pytest.raises(sp.InputError):
            sp.sample_plan(problem, result, **bad)


def test_a_change_without_a_path_jumps_at_its_end():
    problem = small_scene(
        contacts=two_edges().contacts,
        pusher=None,
        obstacles=(),
        bounds=(0, 0.05, 1.4, 0.37),
        goal=(1.0, 0.2, 0.0),
        switch_cost=2.0,
    )
    result = sp.plan(problem, time_limit=60)
    assert result.switches
    samples = sp.sample_plan(problem, result)
    assert (np.abs(wrap_angle(samples.slider[:, 2])) <= np.pi).all()
