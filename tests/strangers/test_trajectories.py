"""Headings of a trajectory that go on beyond half a turn."""

import math

import numpy as np
import pytest
from conftest import small_scene

import stablepush as sp
from stablepush.cli import main
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


def test_a_bag_alone_may_be_asked_for(tmp_path, capsys):
    """And its headings go on, where the quaternions that it holds know them up to whole turns."""
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    problem = small_scene(obstacles=[], bounds=(-2, -2, 3, 3), start=(0.0, 0.0, 3.0), goal=(0.3, 0.4, 5.5), tolerance=(0.02, 0.2))
    result = sp.plan(problem, success=0, refinement_budget=0, time_limit=60)
    assert result.solved
    sp.save_scene(problem, tmp_path / "scene.json")
    sp.save_plan(result, tmp_path / "plan.json")
    files = [str(tmp_path / name) for name in ("scene.json", "plan.json")]
    assert main(["trajectory", *files, "--height", "0.1", "--rosbag", str(tmp_path / "bag")]) == 0
    assert main(["trajectory", *files, "-o", str(tmp_path / "t.csv")]) == 0
    bag, table = sp.load_rosbag(tmp_path / "bag"), sp.load_trajectory(tmp_path / "t.csv")
    for read, written in ((bag.slider, table.slider), (bag.pusher, table.pusher)):
        assert np.abs(np.diff(read[:, 2])).max() < 0.2
        turned = np.round((read[:, 2] - written[:, 2]) / (2 * math.pi))
        assert np.ptp(turned) == 0
        np.testing.assert_allclose(read[:, 2] - 2 * math.pi * turned, written[:, 2], atol=1e-6)
    capsys.readouterr()
    assert main(["trajectory", *files]) == 2
    assert "--output: expected a file to write, or a bag (--rosbag)" in capsys.readouterr().err
