"""How near plans come to obstacles, by another way of measuring it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import small_scene

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import transform_points
from stablepush.planning import clearance_of
from stablepush.planning.keep_away import NO_ROOM, keep_away
from stablepush.planning.search import Found

SCENES = Path(__file__).parents[2] / "examples" / "scenes"
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
    # the lower bound would be that of larger obstacles
    assert (result.lower_bound is None) == (asked > 0)
    found, brute = clearance_of(problem, result), nearest(problem, result)
    assert brute >= asked - 1e-9
    assert found.distance == pytest.approx(brute, abs=1e-3) and found.where.startswith("push ")


@pytest.mark.parametrize("corners", [3, 4, 9, 11])
def test_obstacles_grow_by_no_less_than_the_clearance_and_little_more(corners):
    rng = np.random.default_rng(corners)
    angles = 2 * np.pi * np.arange(corners) / corners + rng.uniform(0, 0.1)
    shape = 0.5 + (rng.uniform(0.04, 0.1, corners) * np.stack((np.cos(angles), np.sin(angles)))).T
    problem = small_scene(obstacles=[shape])
    assert problem.with_clearance(0.0) is problem and problem.with_clearance(1e-9) is problem
    for distance in (1e-5, 0.01, 0.05):
        (grown,) = problem.with_clearance(distance).obstacles
        outer = shapely.Polygon(grown).exterior
        assert shapely.distance(shapely.Polygon(shape), outer) >= distance
        # nor is any of its corners much farther away
        assert shapely.distance(shapely.Polygon(shape), shapely.points(grown)).max() < 1.02 * distance
    np.testing.assert_array_equal(problem.with_clearance(0.01).goal, problem.goal)


def test_a_place_that_an_obstacle_encloses_stays_free():
    """A wall in the form of a C whose mouth is closed by the clearance."""
    ring = shapely.Point(0, 0.2).buffer(0.5).difference(shapely.Point(0, 0.2).buffer(0.45))
    wall = shapely.get_coordinates(ring.difference(shapely.box(0.3, 0.195, 0.7, 0.205)).exterior)[:-1]
    problem = small_scene(obstacles=[wall], bounds=(-1, -1, 1, 1))
    grown = problem.with_clearance(0.02)
    assert len(grown.obstacles) > 1
    union = shapely.union_all([shapely.Polygon(one) for one in grown.obstacles])
    assert not union.contains(shapely.Point(0, 0.2)) and union.area < 0.5 * shapely.Polygon(wall).convex_hull.area
    assert shapely.Polygon(wall).buffer(0.0199).difference(union).area < 1e-9


def test_the_way_between_two_contacts_counts():
    """The pusher passes a block on its way round the slider, from the lower edge to the left one."""
    scene = sp.load_scene(SCENES / "two-contacts.json")
    result = sp.plan(scene, refinement_budget=0)
    [change] = [k for k, segment in enumerate(result.segments) if isinstance(segment, sp.Transfer)]
    middle = result.segments[change].pusher_path[len(result.segments[change].pusher_path) // 2]
    around = sp.Slider.rectangle(0.02, 0.02).vertices + middle[:2]
    found = clearance_of(replace(scene, obstacles=(around,)), result)
    assert found.where == f"the change of contact after push {change}" and found.distance < 1e-3


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


@pytest.mark.parametrize("name", ["narrow", "tight-turn", "walls", "two-contacts"])
def test_plans_keep_away_from_obstacles_if_nothing_is_asked_for(name):
    problem = sp.load_scene(SCENES / f"{name}.json")
    touching, plain = sp.plan(problem, clearance=0.0), sp.plan(problem)
    assert sp.check_plan(problem, plain).valid and clearance_of(problem, plain).distance >= 0.005
    assert touching.duration * 0.999 <= plain.duration <= 1.05 * touching.duration
    # the bound is that of the obstacles as they are
    assert plain.lower_bound == touching.lower_bound and plain.success_probability >= 0.98
    # the quickest plan, and one that is not refined, may touch
    for options in ({"success": 0.0}, {"refinement_budget": 0}):
        assert sp.plan(problem, **options).duration == sp.plan(problem, clearance=0.0, **options).duration


def test_where_there_is_no_room_plans_may_touch(tmp_path, capsys):
    """Walls that leave less than 5 mm on either side of the only way."""
    tight = sp.load_scene(SCENES / "narrow.json").with_clearance(0.04)
    plain = sp.plan(tight)
    assert plain.solved and clearance_of(tight, plain).distance < 0.005
    assert plain.duration == sp.plan(tight, clearance=0.0).duration
    assert sp.plan(tight, clearance=0.005).duration > 1.05 * plain.duration
    sp.save_scene(tight, tmp_path / "tight.json")
    arguments = ["plan", str(tmp_path / "tight.json"), "-o", str(tmp_path / "p.json")]
    for more, words in (
        (
            [],
            "and takes at most 5 % longer; a clearance of 0.005 m accepts others (--clearance 0.005)",
        ),
        (["--clearance", "0"], ": try --clearance 0.005"),
    ):
        assert main([*arguments, *more]) == 0
        assert capsys.readouterr().out.rstrip().endswith(words)


def test_a_search_gives_up_after_the_steps_that_it_is_given():
    from stablepush_planners.cor_lattice import plan_cor_lattice

    problem = sp.load_scene(SCENES / "maze.json")
    options = [sp.PlanOptions(refinement_budget=0, search_budget=steps) for steps in (50, np.inf)]
    few, all_of_them = (plan_cor_lattice(problem, deadline=sp.core.Deadline(60.0), options=o) for o in options)
    assert few.status == "timeout" and few.message == "no path was found in 50 search steps" and all_of_them.solved


def test_what_lies_near_the_start_keeps_no_plan_from_keeping_away_elsewhere():
    """An object against a wall: that wall is kept away from as far as it is, others by 5 mm."""
    walls = sp.load_scene(SCENES / "walls.json")
    corners = transform_points(np.array(walls.start), walls.slider.vertices)
    left = float(corners[:, 0].min()) - 0.003
    wall = np.array(((left - 0.02, 0.1), (left, 0.1), (left, 0.5), (left - 0.02, 0.5)))
    problem = replace(walls, obstacles=(*walls.obstacles, wall))
    touching, plain = sp.plan(problem, clearance=0.0), sp.plan(problem)
    assert clearance_of(walls, touching).distance < 0.005 <= clearance_of(walls, plain).distance
    assert clearance_of(problem, plain).distance >= 0.0028 and plain.duration <= 1.05 * touching.duration


def test_a_plan_that_keeps_away_is_no_less_probable():
    """Nor longer, nor one that its own check refuses: then it is the plan that may touch."""
    problem = sp.load_scene(SCENES / "walls.json")
    touching = sp.plan(problem, clearance=0.0)

    def with_apart(change):
        def search(asked, until, /, *, search_budget):
            found = Found(touching, 0.98) if asked is problem else change(sp.plan(problem, clearance=0.005))
            if isinstance(found, Exception):
                raise found
            return found

        return keep_away(problem, search, sp.core.Deadline(60.0)).result

    assert with_apart(lambda plan: Found(plan, 0.98)).duration > touching.duration
    for refused in (
        lambda plan: Found(plan, 0.97),
        lambda plan: Found(replace(plan, duration=1.06 * touching.duration), 0.98),
        lambda plan: Found(touching, 0.98),
        lambda plan: Found(sp.PlanResult("timeout", ""), 0.0),
        lambda plan: sp.core.UnavailableError("it failed"),
    ):
        assert with_apart(refused) is touching


@pytest.mark.parametrize(("stopped", "remark"), ((False, NO_ROOM), (True, "")))
def test_a_search_that_is_stopped_does_not_say_that_there_is_no_room(stopped, remark):
    problem = sp.load_scene(SCENES / "walls.json")
    touching, asked = sp.plan(problem, clearance=0.0), []

    def search(one, until, /, *, search_budget):
        asked.append(one)
        return Found(touching if one is problem else sp.PlanResult("timeout", ""), 0.98)

    found = keep_away(problem, search, sp.core.Deadline(60.0, lambda: stopped and len(asked) > 1))
    assert found.result is touching and found.remark == remark and len(asked) == 2
