"""Scenes and plans in MuJoCo and in Drake: models that are written open there, and the plan arrives."""

import json
import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import one_line, small_scene, three_feet

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import compose, transform_points
from stablepush.identify import on_few_points
from stablepush.mechanics import Pusher

RADIUS = 0.005
EXAMPLE = Path(__file__).parents[2] / "examples" / "simulation" / "demo_in_engines.py"


def scene(**changes):
    """A short way past an obstacle that is not convex."""
    settings = {
        "goal": (0.32, 0.22, -0.35), "pusher": None, "finger_radius": RADIUS, "bounds": (-1.0, -1.0, 2.0, 2.0),
        "obstacles": [((0.45, 0.0), (0.55, 0.0), (0.55, 0.5), (0.5, 0.2), (0.45, 0.5))],
    } | changes  # fmt: skip
    problem = small_scene(**settings)
    return problem.with_changes(slider=sp.Slider(problem.slider.vertices, 1.2))


@pytest.fixture(scope="module")
def planned():
    problem = scene()
    result = sp.plan(problem, refinement_budget=200)
    assert result.solved
    return problem, result


def in_mujoco(text):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    # as a user would: the example drives the servos
    return runpy.run_path(str(EXAMPLE))["in_mujoco"](text)


def in_drake(text, trajectory):
    pytest.importorskip("pydrake", reason="drake is not installed")
    return runpy.run_path(str(EXAMPLE))["in_drake"](text, trajectory)


def test_a_plan_arrives_in_mujoco(planned):
    problem, result = planned
    end, model, data = in_mujoco(sp.export_mjcf(problem, result))
    assert end == pytest.approx(result.pushes[-1].end, abs=1e-3)
    # what stands on the feet is the slider's weight, and it is spread as the surface has it
    assert model.body_subtreemass[model.body("slider").id] == pytest.approx(1.2, rel=1e-9)
    assert data.joint("slider_x").qpos[0] == pytest.approx(end[0])
    assert model.key_time[-1] == pytest.approx(sp.sample_plan(problem, result).t[-1])


def test_a_plan_arrives_in_drake_far_from_the_origin():
    """Drake's friction is regularised: fingers creep by a millimetre."""
    problem = scene()
    away = np.array((5.0, -4.0, 0.0))
    problem = problem.with_changes(
        start=problem.start + away, goal=problem.goal + away, bounds=np.add(problem.bounds, (*away[:2], *away[:2])),
        obstacles=[np.asarray(outline) + away[:2] for outline in problem.obstacles],
    )  # fmt: skip
    result = sp.plan(problem, refinement_budget=200)
    end = in_drake(sp.export_sdf(problem, result), sp.sample_plan(problem, result, 50.0))
    assert end == pytest.approx(result.pushes[-1].end, abs=3e-3)


def test_obstacles_stop_a_slider(planned):
    problem, _ = planned
    wall = ((0.26, -0.3), (0.28, -0.3), (0.28, 0.7), (0.26, 0.7))
    blocked = problem.with_changes(obstacles=[wall])
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    from stablepush.engines import Fingers, Motion, SliderOnFeet, mjcf

    # a slider that is driven against a wall by hand stays before it
    t = np.linspace(0.0, 2.0, 5)
    pusher = compose(np.tile(problem.start, (5, 1)), (0.0, -0.055 - RADIUS, np.pi / 2))
    pusher[:, 1] += 0.02 * t
    body = SliderOnFeet(problem.slider.vertices, 1.2, three_feet().points, three_feet().weights, 0.3)
    high = [np.array(((-1.0, 0.34), (1.0, 0.34), (1.0, 0.36), (-1.0, 0.36)))]
    still = np.tile(problem.start, (5, 1))
    fingers = Fingers(np.array(((0.0, -0.02), (0.0, 0.02))), RADIUS, 0.9)
    text = mjcf(body, fingers, high, Motion(t, still, pusher, 0 * pusher + (0, 0.02, 0)))
    end, _, _ = in_mujoco(text)
    assert transform_points(end, problem.slider.vertices)[:, 1].max() < 0.341
    assert "obstacle0" in sp.export_mjcf(blocked)


def test_a_slope_is_in_the_gravity_and_a_grain_is_refused(planned):
    problem, _ = planned
    tilted = problem.with_changes(effects=[sp.parse_effect("tilt:slope=0.03/0.01")])
    assert f'gravity="{9.81 * 0.03} {9.81 * 0.01} -9.81"' in sp.export_mjcf(tilted)
    with pytest.raises(sp.InputError, match="effects: tilt"):
        sp.export_sdf(tilted)
    grained = problem.with_changes(effects=[sp.parse_effect("anisotropy-world:ratio=1.3,direction=0")])
    with pytest.raises(sp.InputError, match="effects: anisotropy-world"):
        sp.export_mjcf(grained)


@pytest.mark.parametrize("engine", ["mujoco", "drake"])
def test_a_rig_in_an_engine_ends_where_ours_does_and_logs_the_same(planned, engine):
    pytest.importorskip({"mujoco": "mujoco", "drake": "pydrake"}[engine], reason=f"{engine} is not installed")
    problem, result = planned
    contact = problem.contacts[0]
    how = (problem.slider, problem.surface, contact.mu, Pusher.of_contact(contact, RADIUS))
    effects = [sp.parse_effect("tilt:slope=0.004/-0.003"), sp.parse_effect("force-bias:force=0.2/0.1")]
    ours, theirs = (sp.execute_plan(sp.VirtualRig(*how, effects, engine=e), problem, result) for e in (None, engine))
    # where two fingers have to hold it near the edge of their cones, friction that gives lets the slider creep along them
    assert theirs.final_pose == pytest.approx(ours.final_pose, abs={"mujoco": 1e-3, "drake": 2.5e-3}[engine])
    assert set(theirs.log.samples) == set(ours.log.samples)
    assert theirs.log.trials["stable"][1:].all()
    push = ours.log.samples["phase"] == "push"
    loads = [run.log.columns("fx", "fy", "tau")[push] for run in (ours, theirs)]
    # engines have inertia, and start and stop within rows: most are a few per cent of the load off
    off = np.abs(loads[0] - loads[1]) / np.abs(loads[0]).max(axis=0)
    assert np.quantile(off, 0.8) < 0.08
    assert off.max() < 0.5


def test_few_points_have_the_friction_of_many():
    many = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(small_scene().slider.vertices, 0.005), 3.0)
    few = on_few_points(many)
    assert len(few.support.weights) < 0.2 * len(many.support.weights)
    twists = np.random.default_rng(5).normal(size=(300, 3)) / (1, 1, many.characteristic_length)
    a, b = (s.wrench(twists) / (1, 1, many.characteristic_length) for s in (many, few))
    angles = np.degrees(np.arccos(np.clip((a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1), -1, 1)))
    assert angles.mean() < 1.0
    assert few.friction_load == pytest.approx(3.0, rel=0.01)


BAD = [
    ({"engine": "bullet"}, "engine: expected mujoco or drake"),
    ({"engine": "mujoco", "effects": [sp.parse_effect("speed-dependence:slope=0.1")]}, "effect speed-dependence"),
    ({"engine": "drake", "effects": [sp.parse_effect("anisotropy-world:ratio=1.3,direction=0")]}, "effect anisotropy-world"),
    ({"engine": "mujoco", "pusher": Pusher.two_fingers(0.05)}, "finger_radius: expected round fingers"),
    ({"engine": "mujoco", "slider": sp.Slider.rectangle(0.1, 0.1)}, "slider.mass: expected a mass"),
]


@pytest.mark.parametrize(("wrong", "words"), BAD, ids=[words for _, words in BAD])
def test_what_an_engine_cannot_have_is_refused(planned, wrong, words):
    for module in ("mujoco", "pydrake"):
        pytest.importorskip(module, reason=f"{module} is not installed")
    problem, _ = planned
    given = {"slider": problem.slider, "pusher": Pusher.two_fingers(0.05, RADIUS)} | wrong
    with pytest.raises(sp.InputError, match=words):
        sp.VirtualRig(surface=problem.surface, mu=0.9, **given)


def test_a_model_has_the_effects_of_the_scene(planned):
    """Pressure in the feet, friction and radius in the fingers."""
    problem, result = planned

    def with_(text):
        return sp.export_mjcf(problem.with_changes(effects=[sp.parse_effect(text)]), result)

    plain = sp.export_mjcf(problem, result)
    feet = [float(x) for x in re.findall(r'<body pos="(\S+) ', plain)]
    moved = [float(x) for x in re.findall(r'<body pos="(\S+) ', with_("pressure-shift:offset=0.005/0"))]
    assert np.sort(moved) - np.sort(feet) == pytest.approx(0.005, abs=1e-9)
    assert 'friction="0.4"' in with_("contact-friction:mu=0.4") and 'friction="0.4"' not in plain
    assert 'size="0.007"' in with_("contact-geometry:radius=0.007") and 'size="0.007"' not in plain
    with pytest.raises(sp.InputError, match="effects: drift"):
        with_("drift:rate=0.1")
    with pytest.raises(sp.InputError, match="effect speed-dependence"):
        with_("speed-dependence:slope=0.1")


def test_a_tool_has_one_friction_and_one_spacing(planned):
    problem, _ = planned
    here = problem.contacts[0]
    pushes = [
        sp.Push(k, np.array((0.0, 0.01, 0.0)), 1.0, problem.start, compose(problem.start, (0.0, 0.01, 0.0)), 0.3) for k in (0, 1)
    ]
    for other, words in (
        (sp.PushContact(here.points, here.normals, 0.4), r"contacts\[1\].mu: expected the same friction"),
        (sp.PushContact(0.8 * here.points[:, :] + (0, -0.01), here.normals, here.mu), r"contacts\[1\]: expected fingers of one"),
    ):
        both = problem.with_changes(contacts=[here, other])
        path = np.tile(compose(problem.start, here.frame), (2, 1))
        moved = [
            pushes[0],
            sp.Transfer(0, 1, path, 0.0),
            replace(pushes[1], start=pushes[0].end, end=compose(pushes[0].end, (0.0, 0.01, 0.0))),
        ]
        with pytest.raises(sp.InputError, match=words):
            sp.export_mjcf(both, sp.PlanResult.from_segments(moved, planner="hand"))


def test_the_commands(planned, tmp_path, capsys):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    problem, result = planned
    at, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    sp.save_scene(problem, at)
    sp.save_plan(result, plan)
    command = ["export", at, plan, "--mjcf", tmp_path / "m.xml", "--sdf", tmp_path / "m.sdf"]
    assert main(list(map(str, command))) == 0
    assert "keyframes of the plan" in capsys.readouterr().out
    assert (tmp_path / "m.sdf").read_text(encoding="utf-8").startswith("<sdf")
    assert main(["simulate", str(at), str(plan), "--engine", "mujoco", "-o", str(tmp_path / "log")]) == 0
    assert "sticking throughout" in capsys.readouterr().out
    assert len(sp.read_pushlog(tmp_path / "log")) == len(result.pushes)
    one_line(capsys, ["export", at], "--mjcf, --sdf: expected at least one file to write")
    one_line(capsys, ["simulate", at, plan, "--engine", "ode", "-o", tmp_path / "b"], "--engine: expected mujoco or drake")
    foreign = tmp_path / "foreign.json"
    whole = json.loads(plan.read_text(encoding="utf-8"))
    for segment in whole["segments"]:
        segment["contact"] = 5
    foreign.write_text(json.dumps(whole), encoding="utf-8")
    one_line(capsys, ["export", at, foreign, "--mjcf", tmp_path / "n.xml"], "foreign.json", "segments[0]")
    thin = tmp_path / "thin.json"
    sp.save_scene(problem.with_changes(finger_radius=0.0), thin)
    one_line(capsys, ["export", thin, "--mjcf", tmp_path / "n.xml"], "finger_radius: expected round fingers")
    assert main(["export", str(thin), "--mjcf", str(tmp_path / "n.xml"), "--finger-radius", "0.004"]) == 0
