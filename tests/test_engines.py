"""Executors in other engines: what they show agrees with the physics that they are to show, and between engines."""

import math

import numpy as np
import pytest
import shapely
from conftest import three_feet, triangle

import stablepush as sp
from stablepush.engines import Fingers, SliderOnFeet, executor
from stablepush.geometry import compose, exp

ENGINES = ["mujoco", "drake"]
FINGER = 0.004


def installed(engine):
    pytest.importorskip("pydrake" if engine == "drake" else "mujoco")


def pushed(engine, twist, duration, contact_mu=0.5, aside=0.0):
    """A triangle on its three feet, pushed by two fingers through a body twist; the execution and the last planned pose."""
    installed(engine)
    slider, feet = triangle(), three_feet()
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.03, contact_mu)
    x, y, theta = contact.frame
    docked = np.array((x - FINGER * math.cos(theta), y - FINGER * math.sin(theta), theta))
    body = SliderOnFeet(slider.vertices, 1.0, feet.points, feet.weights, 0.3)
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


def test_outlines_that_are_not_convex_are_cut():
    pytest.importorskip("mujoco")
    from stablepush.engines.mujoco_executor import _convex_parts

    notched = np.array(((0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2.0)))
    parts = _convex_parts(notched)
    assert {len(part) for part in parts} == {3}
    assert sum(shapely.Polygon(part).area for part in parts) == pytest.approx(shapely.Polygon(notched).area)
    assert len(_convex_parts(notched[:3])) == 1


def test_an_unknown_engine_is_refused():
    with pytest.raises(ValueError, match="mujoco or drake"):
        executor("bullet", None, None)
