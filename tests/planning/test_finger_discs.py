"""Fingers are discs where there is no outline of the pusher: they take room, and go round the slider to another contact."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import small_scene, two_edges

import stablepush as sp
from stablepush.geometry import compose, transform_points

#: Bounds with a ceiling just above the slider: the first contact, which pushes up, leads nowhere.
LOW = (0.0, -0.3, 1.4, 0.31)


def with_fingers(problem, radius, **changes):
    """The same problem with fingers in place of an outline."""
    names = ("slider", "surface", "contacts", "start", "goal", "obstacles", "bounds", "tolerance", "speed", "switch_cost")
    given = {name: getattr(problem, name) for name in names} | changes
    return sp.PlanningProblem(**given, finger_radius=radius)


def test_outlines_of_fingers_hold_the_discs_and_touch_the_edge():
    problem = with_fingers(two_edges(), 0.006)
    for contact in problem.contacts:
        outlines = [shapely.Polygon(outline) for outline in problem.docked_outlines(contact)]
        assert len(outlines) == len(contact.points)
        for outline, point, normal in zip(outlines, contact.points, contact.normals, strict=True):
            disc = shapely.Point(point - 0.006 * normal).buffer(0.006 * (1 - 1e-9))
            assert outline.buffer(1e-9).covers(disc) and outline.area < 1.03 * np.pi * 0.006**2
            assert outline.intersection(problem.slider.polygon).area < 1e-12
            assert outline.distance(problem.slider.polygon) < 1e-9


def test_fingers_go_round_the_slider_clear_of_it():
    problem = with_fingers(two_edges(), 0.006, bounds=LOW)
    result = sp.plan(problem, time_limit=60, refinement_budget=0)
    assert result.solved and result.switches
    assert sp.check_plan(problem, result).objections == ()
    pose = problem.start
    for segment in result.segments:
        if isinstance(segment, sp.Push):
            pose = segment.end
            continue
        slider = shapely.Polygon(transform_points(pose, problem.slider.vertices))
        path = segment.pusher_path
        for number in range(len(path) - 1):
            for share in np.linspace(0, 1, 30):
                at = path[number] + share * (path[number + 1] - path[number])
                contact = problem.contacts[segment.source if number < len(path) - 2 else segment.target]
                for outline in problem.pusher_outlines(contact):
                    assert shapely.Polygon(transform_points(at, outline)).intersection(slider).area < 1e-9
    jumps = [replace(s, pusher_path=np.empty((0, 3))) if isinstance(s, sp.Transfer) else s for s in result.segments]
    assert "expected a path" in " ".join(sp.check_plan(problem, replace(result, segments=tuple(jumps))).objections)
    # through the slider
    straight = [replace(s, pusher_path=s.pusher_path[[0, -1]]) if isinstance(s, sp.Transfer) else s for s in result.segments]
    assert "hits something" in " ".join(sp.check_plan(problem, replace(result, segments=tuple(straight))).objections)


def test_points_have_a_path_but_need_none():
    problem = with_fingers(two_edges(), 0.0, bounds=LOW)
    result = sp.plan(problem, time_limit=60, refinement_budget=0)
    transfers = [s for s in result.segments if isinstance(s, sp.Transfer)]
    assert transfers and all(len(s.pusher_path) > 3 for s in transfers)
    jumps = [replace(s, pusher_path=np.empty((0, 3))) if isinstance(s, sp.Transfer) else s for s in result.segments]
    assert sp.check_plan(problem, replace(result, segments=tuple(jumps))).objections == ()


def test_fingers_take_room():
    """A wall just behind the edge that is pushed."""
    free = small_scene(obstacles=(), pusher=None)
    contact = free.contacts[0]
    behind = compose(contact.frame, [(-0.011 - a, b, 0.0) for a, b in ((0, -0.1), (0, 0.1), (0.01, 0.1), (0.01, -0.1))])[:, :2]
    wall = transform_points(free.start, behind)
    bounds = (-3.0, -3.0, 3.0, 3.0)
    thin, thick = (with_fingers(free, radius, obstacles=[wall], bounds=bounds) for radius in (0.005, 0.006))
    assert sp.plan(thin, time_limit=60, refinement_budget=0).solved
    refused = sp.plan(thick, time_limit=60, refinement_budget=0)
    assert refused.status == "no-path" and refused.message.startswith("start: the pusher")


def test_scenes_keep_the_radius(tmp_path):
    sp.save_scene(with_fingers(small_scene(), 0.006), tmp_path / "scene.json")
    assert sp.load_scene(tmp_path / "scene.json").finger_radius == 0.006
    with pytest.raises(sp.InputError, match="finger_radius"):
        with_fingers(small_scene(), -0.001)


CORNER = sp.Slider([(-0.04, -0.04), (0.08, -0.04), (0.08, 0.0), (0.0, 0.0), (0.0, 0.08), (-0.04, 0.08)], 0.5)


def test_a_finger_that_has_no_room_at_an_inner_corner_is_refused():
    """An L: the middle of its inner edge is 20 mm from the other arm. Outlines of pushers are refused there, too."""
    for along in (0.02, 0.075, 0.0751):
        contact = sp.PushContact([(0.08 - along, 0.0)], [(0, -1)], 0.5)
        assert small_scene(slider=CORNER, contacts=[contact], pusher=None, finger_radius=0.005, obstacles=[]).contacts
    contact = sp.PushContact([(0.003, 0.0)], [(0, -1)], 0.5)
    with pytest.raises(sp.InputError, match=r"finger_radius: .* docked at contact 0 one stands inside the slider, got 2 mm"):
        small_scene(slider=CORNER, contacts=[contact], pusher=None, finger_radius=0.005, obstacles=[])


def test_a_finger_whose_normal_is_not_the_edge_s_is_noted():
    """The disc behind the stated normal reaches into the slider; one that touches the edge would not."""
    tilted = sp.PushContact([(0.06, 0.0)], [(math.sin(0.9), -math.cos(0.9))], 0.5)
    with pytest.warns(sp.PlausibilityWarning, match=r"contacts\[0\]: a finger of radius 5 mm would stand 1.9 mm inside"):
        small_scene(slider=CORNER, contacts=[tilted], pusher=None, finger_radius=0.005, obstacles=[])
