import math

import numpy as np
import pytest
import shapely
from conftest import small_scene
from hypothesis import given, settings, strategies as st

import stablepush as sp
from stablepush.geometry.se2 import compose, exp, transform_points
from stablepush.planning.check import _Sweep
from stablepush.planning.collision import SweptBody


def star(rng, corners, radius):
    """A random outline round the origin, convex or not."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, size=corners))
    return (radius * rng.uniform(0.3, 1, size=corners))[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


def random_problem(rng):
    while True:
        try:
            obstacles = [star(rng, rng.integers(3, 9), 0.2) + rng.uniform(-1, 1, 2) for _ in range(rng.integers(1, 12))]
            slider = sp.Slider(star(rng, int(rng.integers(3, 8)), 0.15))
            return small_scene(
                slider=slider,
                obstacles=obstacles,
                bounds=(-1.2, -1.2, 1.2, 1.2),
                start=(0, 0, 0),
                goal=(1, 0, 0),
                contacts=[sp.PushContact([(0, 0.01), (0, -0.01)], [1, 0], 0.5)],
                pusher=None,
            )
        except sp.InputError:
            continue


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_poses_against_polygon_overlap(seed):
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    poses = np.column_stack((rng.uniform(-1.1, 1.1, (40, 2)), rng.uniform(-3, 3, 40)))
    blocked = shapely.union_all([shapely.Polygon(o) for o in problem.obstacles])
    for pose, free in zip(poses, SweptBody(problem).free(poses), strict=True):
        placed = transform_points(pose, problem.slider.vertices)
        inside = bool((np.abs(placed) <= 1.2).all())
        overlap = shapely.intersection(shapely.Polygon(placed), blocked).area
        # corners that meet by a few hundredths of a millimetre are rounding for one and a hit for the other
        if not 0 < overlap < 1e-9:
            assert free == (inside and overlap == 0)


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_sweeps_against_dense_sampling_and_the_check(seed):
    """No motion passes that a pose of it contradicts, none is refused that the check's own sweep calls free."""
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    body = SweptBody(problem)
    poses = np.column_stack((rng.uniform(-1, 1, (60, 2)), rng.uniform(-3, 3, 60)))
    poses = poses[body.free(poses)]
    twists = rng.normal(size=(len(poses), 3)) * (0.3, 0.3, 2.0)
    twists[::4, 2] = 0.0
    found = body.pushes_are_free(poses, twists, np.ones(len(poses)))
    for pose, twist, free in zip(poses, twists, found, strict=True):
        dense = bool(body.free(compose(pose, exp(twist * np.linspace(0, 1, 1000)[:, None]))).all())
        assert not free or dense
        if dense and not free:
            # a touch between samples: the independent sweep has to see it too
            push = sp.Push.from_start(0, twist, 1.0, pose, 0.0)
            sweep, placed = _Sweep.from_push(push), transform_points(pose, problem.slider.vertices)
            outside = np.abs(sweep.extremes(placed)).max() > 1.2
            assert outside or any(sweep.hits(placed, o) for o in problem.obstacles)


def test_turns_of_more_than_a_circle():
    ring = [(0.5 * math.cos(a), 0.5 * math.sin(a)) for a in np.linspace(0, 2 * np.pi, 40)[:-1]]
    post = [(0.34 + 0.01 * math.cos(a), 0.01 * math.sin(a)) for a in np.linspace(0, 2 * np.pi, 9)[:-1]]
    slider = sp.Slider([(-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)])
    problem = small_scene(slider=slider, obstacles=[post], bounds=(-1, -1, 1, 1), pusher=None, start=(0, 0, 0), goal=(0, 0.5, 0))
    body = SweptBody(problem)
    assert len(ring) == 39
    # round a circle of 0.3 m about the origin, from the left: the post is half a turn away
    start, speed = (-0.3, 0.0, -np.pi / 2), 0.3
    for turn, free in ((2.5, True), (3.5, False), (6.0, False), (-2.5, True), (-3.5, False), (7.0, False)):
        omega = math.copysign(1.0, turn)
        assert body.push_is_free(start, (speed * omega, 0.0, omega), abs(turn)) is free


@pytest.mark.parametrize("bounds", ((-1, -1, 1, 1), None))
def test_bounds_hold_the_arc_not_only_its_ends(bounds):
    slider = sp.Slider([(-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)])
    problem = small_scene(slider=slider, obstacles=[], bounds=bounds, pusher=None, start=(0, 0, 0), goal=(0, 0.5, 0))
    # a half circle of 0.6 m whose ends are inside, and whose middle is 0.25 m out
    assert SweptBody(problem).push_is_free((0.6, -0.6, 0.0), (0.6, 0.0, 1.0), np.pi) is (bounds is None)
