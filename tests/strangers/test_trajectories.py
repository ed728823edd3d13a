"""Headings of a trajectory that go on beyond half a turn."""

import math

import numpy as np
import pytest
from conftest import small_scene

from stablepush.geometry import exp
from stablepush.planning import PlanResult, Push, sample_plan


def test_headings_of_a_trajectory_go_on(tmp_path):
    """A plan that turns on through half a turn: no jump by 2 pi, and neighbouring quaternions on one side."""
    problem = small_scene(obstacles=[], bounds=None, start=(0.0, 0.0, 3.0))
    push = Push.from_start(0, np.array((0.0, 0.01, 0.1)), 8.0, problem.start, 0.1)
    result = PlanResult.from_segments([push], planner="none")
    samples = sample_plan(problem, result, rate=20)
    for poses in (samples.slider, samples.pusher):
        assert np.abs(np.diff(poses[:, 2])).max() < 0.1
        assert np.ptp(poses[:, 2]) == pytest.approx(0.8, abs=1e-6)
    assert samples.slider[-1, 2] > math.pi
    turns = samples.tool_poses(0.1)[:, 3:]
    assert (turns[1:] * turns[:-1]).sum(axis=1).min() > 0.99
    assert exp(push.twist * push.duration)[2] == pytest.approx(0.8)
