"""Executors in other engines: what they show agrees with the physics that they are to show, and between engines."""

import math

import numpy as np
import pytest
import shapely
from conftest import three_feet, triangle

import stablepush as sp
from stablepush.engines import Fingers, SliderOnFeet, executor
from stablepush.geometry import compose, exp
from stablepush.rig import contact_push

ENGINES = ["mujoco", "drake"]
FINGER = 0.004


def installed(engine):
    pytest.importorskip("pydrake" if engine == "drake" else "mujoco")


def pushed(engine, twist, duration, contact_mu=0.5, aside=0.0, **table):
    """A triangle on its three feet, pushed by two fingers through a body twist; the execution and the last planned pose."""
    installed(engine)
    slider, feet = triangle(), three_feet()
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.03, contact_mu)
    x, y, theta = contact.frame
    docked = np.array((x - FINGER * math.cos(theta), y - FINGER * math.sin(theta), theta))
    body = SliderOnFeet(slider.vertices, 1.0, feet.points, feet.weights, 0.3, **table)
    t = np.linspace(0.0, duration, 101)
    poses = exp(np.array(twist) * t[:, None])
    run = executor(engine, body, Fingers(np.array(((0.0, 0.015 + aside), (0.0, -0.015 + aside))), FINGER, contact_mu))
    return run.follow(np.zeros(3), t, compose(poses, docked)), poses[-1]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_stable_push_sticks(engine):
    slider = triangle()
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.03, 0.5)
    theta = contact.frame[2]
    twist = np.array((0.03 * math.cos(theta), 0.03 * math.sin(theta), 0.1))
    surface = sp.IdealLimitSurface(three_feet(), 3.0)
    assert sp.StabilityOracle(surface, contact).margin(twist[None])[0] > 0.1
    done, planned = pushed(engine, twist, 4.0)
    off = done.slider[-1] - planned
    assert np.hypot(*off[:2]) < 5e-4 and abs(off[2]) < 5e-3
    np.testing.assert_allclose(done.pusher[-1, 2], theta + planned[2], atol=1e-4)
    assert done.t[-1] == pytest.approx(4.0) and len(done.t) == len(done.slider)


@pytest.mark.parametrize("engine", ENGINES)
def test_an_unstable_push_slips(engine):
    """Straight along the edge the fingers slide, whatever the friction below one."""
    contact = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.03, 0.2)
    theta = contact.frame[2] - 1.2
    done, planned = pushed(engine, (0.03 * math.cos(theta), 0.03 * math.sin(theta), 0.0), 1.0, contact_mu=0.2)
    assert np.hypot(*(done.slider[-1] - planned)[:2]) > 5e-3


@pytest.mark.parametrize(
    "engine, effect, table",
    [
        ("mujoco", "tilt:slope=0.06/-0.03", {"slope": np.array((0.06, -0.03))}),
        ("drake", "tilt:slope=0.06/-0.03", {"slope": np.array((0.06, -0.03))}),
        ("mujoco", "anisotropy-world:ratio=1.5,direction=0.4", {"grain": (1.5, 0.4)}),
    ],
)
def test_a_push_that_slips_on_a_sloping_or_grained_table_ends_as_the_simulated_one(engine, effect, table):
    slider, feet = triangle(), three_feet()
    slider = sp.Slider(slider.vertices, 1.0)
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.03, 0.2)
    theta = contact.frame[2]
    twist = np.array((0.03 * math.cos(theta - 0.5), 0.03 * math.sin(theta - 0.5), 0.3))
    done, _ = pushed(engine, twist, 3.0, contact_mu=0.2, **table)
    surface = sp.IdealLimitSurface(feet, 0.3 * 9.81)
    pusher = sp.Pusher.of_contact(contact, FINGER)
    command = contact_push(contact, twist, 3.0, radius=FINGER, pose=np.zeros(3), reset=True, speed=0.03)

    def away(effects):
        end = sp.VirtualRig(slider, surface, 0.2, pusher, effects).execute([command]).final_pose
        return np.abs((done.slider[-1] - end) * (1, 1, 0.05)).max()

    assert away([sp.parse_effect(effect)]) < 1e-3
    assert away([]) > 2e-3


def test_outlines_that_are_not_convex_are_cut():
    pytest.importorskip("mujoco")
    from stablepush.engines.mjcf import convex_parts

    notched = np.array(((0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2.0)))
    parts = convex_parts(notched)
    assert {len(part) for part in parts} == {3}
    assert sum(shapely.Polygon(part).area for part in parts) == pytest.approx(shapely.Polygon(notched).area)
    assert len(convex_parts(notched[:3])) == 1


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("aside", [0.0, 0.003])
def test_the_wrench_of_the_pusher_is_the_load_of_the_slider(engine, aside):
    """About B, of the friction of the feet, while it sticks; the places of the fingers on the tool do not matter."""
    slider = triangle()
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.03, 0.5)
    theta = contact.frame[2]
    twist = np.array((0.03 * math.cos(theta), 0.03 * math.sin(theta), 0.1))
    done, _ = pushed(engine, twist, 2.0, aside=aside)
    load = sp.IdealLimitSurface(three_feet(), 0.3 * 9.81).wrench(twist)
    late = slice(len(done.t) // 2, None)
    turn, arm = done.slider[late, 2], (done.pusher - done.slider)[late, :2]
    fx, fy, tau = done.wrench[late].T
    tau = tau + arm[:, 0] * fy - arm[:, 1] * fx
    c, s = np.cos(turn), np.sin(turn)
    seen = np.mean((c * fx + s * fy, -s * fx + c * fy, tau), axis=1)
    np.testing.assert_allclose((seen - load) / (0.05, 0.05, 0.003), 0.0, atol=1.0)


def test_an_unknown_engine_is_refused():
    with pytest.raises(ValueError, match="mujoco or drake"):
        executor("bullet", None, None)


def test_drake_refuses_a_grained_table():
    installed("drake")
    with pytest.raises(ValueError, match="one coefficient"):
        pushed("drake", (0.03, 0.0, 0.0), 0.1, grain=(1.5, 0.0))
