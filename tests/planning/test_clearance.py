"""How near plans come to obstacles, by another way of measuring it."""

import numpy as np
import pytest
import shapely
from conftest import small_scene

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import transform_points
from stablepush.planning import clearance_of

#: A square in the way of the straight path.
BLOCK = np.array(((-0.06, 0.16), (0.0, 0.16), (0.0, 0.22), (-0.06, 0.22)))


def blocked(**changes):
    return small_scene(obstacles=[BLOCK], **changes)


def nearest(problem, result):
    """The least distance at many poses of a plan, in all of which both bodies are looked at as point sets and polygons."""
    least = np.inf
    block = shapely.Polygon(BLOCK)
    for push in result.pushes:
        for pose in push.poses(np.linspace(0, push.duration, 400)):
            for outline in (problem.slider.vertices, *problem.docked_outlines(problem.contacts[push.contact])):
                least = min(least, block.distance(shapely.Polygon(transform_points(pose, outline))))
    return least


@pytest.mark.parametrize("asked", [0.0, 0.004, 0.02])
def test_a_plan_keeps_the_clearance_that_is_asked_for(asked):
    problem = blocked()
    result = sp.plan(problem, refinement_budget=2000, clearance=asked)
    assert result.solved and sp.check_plan(problem, result).valid
    found, brute = clearance_of(problem, result), nearest(problem, result)
    assert brute >= asked - 1e-9
    assert found.distance == pytest.approx(brute, abs=1e-3) and 1 <= found.push <= len(result.pushes)


def test_obstacles_grow_by_no_less_than_the_clearance_and_little_more():
    rng = np.random.default_rng(0)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    shape = 0.5 + (rng.uniform(0.02, 0.1, 9) * np.stack((np.cos(angles), np.sin(angles)))).T
    problem = small_scene(obstacles=[shape])
    assert problem.with_clearance(0.0) is problem
    (grown,) = problem.with_clearance(0.01).obstacles
    points = shapely.points(rng.uniform(0.3, 0.7, (4000, 2)))
    away, inside = shapely.distance(shapely.Polygon(shape), points), shapely.contains(shapely.Polygon(grown), points)
    assert inside[away < 0.01 - 1e-12].all() and not inside[away > 0.01 * 1.03].any()
    np.testing.assert_array_equal(problem.with_clearance(0.01).goal, problem.goal)


def test_a_clearance_that_no_path_has_is_no_path():
    problem = blocked()
    result = sp.plan(problem, clearance=0.3)
    assert result.status == "no-path" and "larger by the clearance of 300 mm" in result.message
    assert clearance_of(problem, result) is None
    for wrong in (-0.001, float("nan")):
        with pytest.raises(sp.InputError, match="clearance"):
            sp.plan(problem, clearance=wrong)


def test_the_command_tells_how_near_its_plan_comes(tmp_path, capsys):
    sp.save_scene(blocked(), tmp_path / "s.json")
    arguments = ["plan", str(tmp_path / "s.json"), "-o", str(tmp_path / "p.json"), "--refinement-budget", "1000"]
    assert main([*arguments, "--clearance", "0.006"]) == 0
    out = capsys.readouterr().out
    told = float(out.partition("closest to an obstacle: ")[2].partition(" mm")[0])
    assert told >= 5.95 and "do not count collisions" in out
    assert main([*arguments, "--clearance", "-1"]) == 2
    assert "--clearance" in capsys.readouterr().err
