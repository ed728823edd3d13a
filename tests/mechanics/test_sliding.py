import math

import numpy as np
import pytest
from conftest import triangle
from hypothesis import given, settings, strategies as st

import stablepush as sp
from stablepush.geometry.planar import angle_between
from stablepush.geometry.se2 import rotate_vectors

SQUARE = np.array(((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)))
GRAVITY = 9.81


def square(mass=1.2):
    return sp.Slider(SQUARE, mass=mass)


def uniform(spacing=0.005, mu=0.3, mass=1.2):
    return sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(SQUARE, spacing), mu * mass * GRAVITY)


def three_legs(mu=0.25, mass=1.0):
    corners = triangle().vertices
    feet = sp.SupportDistribution(0.8 * corners, np.ones(3))
    return sp.IdealLimitSurface(feet, mu * mass * GRAVITY), sp.Slider(corners, mass=mass)


def ellipsoid(fx=3.0, fy=2.0, tau=0.1):
    """``(f_x/a)² + (f_y/b)² + (tau/c)² = 1``."""
    return sp.PolynomialLimitSurface([1 / fx**2, 0, 0, 1 / fy**2, 0, 1 / 0.05**-2 / tau**2], 2, 0.05)


def test_translation_is_that_of_a_sliding_point():
    mu, speed = 0.3, 0.8
    result = sp.simulate_free_sliding(uniform(mu=mu), square(), (speed, 0, 0), pose=(1, 2, 0.5), samples=11)
    assert result.at_rest
    assert result.t[-1] == pytest.approx(speed / (mu * GRAVITY), rel=1e-7)
    way = speed**2 / (2 * mu * GRAVITY)
    np.testing.assert_allclose(result.poses[-1], (1 + way * math.cos(0.5), 2 + way * math.sin(0.5), 0.5), atol=1e-9)
    np.testing.assert_allclose(np.diff(result.t), result.t[-1] / 10, rtol=1e-4)
    assert not np.isfinite(result.cor).all()


def test_spin_of_a_disc_stops_by_its_friction_torque():
    """On a ring of support points the torque is ``mu m g r`` whatever the speed."""
    mu, mass, radius = 0.2, 0.7, 0.06
    ring = sp.IdealLimitSurface(sp.SupportDistribution.ring(radius, 24), mu * mass * GRAVITY)
    body = sp.Slider(sp.SupportDistribution.ring(0.08, 64).points, mass=mass)
    omega = 9.0
    result = sp.simulate_free_sliding(ring, body, (0, 0, omega))
    inertia = mass * body.radius_of_gyration**2
    stop = inertia * omega / (mu * mass * GRAVITY * radius)
    assert result.t[-1] == pytest.approx(stop, rel=1e-7)
    assert result.poses[-1, 2] == pytest.approx(omega * stop / 2, rel=1e-7)


def test_without_friction_the_body_goes_straight():
    surface = sp.PolynomialLimitSurface([1, 0, 0, 1, 0, 1], 2, 0.05, force_unit="mu*N")
    twist, pose = np.array((0.4, -0.2, 7.0)), np.array((0.1, 0.2, 0.3))
    result = sp.simulate_free_sliding(surface, square(), twist, mu=0.0, pose=pose, duration=2.0)
    velocity = rotate_vectors(pose[2], twist[:2])
    np.testing.assert_allclose(result.poses[:, :2], pose[:2] + result.t[:, None] * velocity, atol=1e-7)
    np.testing.assert_allclose(result.poses[:, 2], pose[2] + 7.0 * result.t, atol=1e-7)
    assert not result.at_rest
    assert result.t[-1] == pytest.approx(2.0)
    # the paper's equation keeps the velocity in the body, which turns: the body goes in circles
    paper = sp.simulate_free_sliding(surface, square(), twist, mu=0.0, pose=pose, duration=2.0, variant="paper")
    assert np.linalg.norm(paper.poses[-1, :2] - result.poses[-1, :2]) > 0.5
    np.testing.assert_allclose(paper.energy, result.energy, rtol=1e-6)


@settings(max_examples=25)
@given(st.integers(0, 2**31))
def test_against_a_plain_integration_of_the_equations(seed):
    """Runge-Kutta with tiny steps, of the equations as they stand, until shortly before the end."""
    rng = np.random.default_rng(seed)
    surface, body = ellipsoid(), square(0.8)
    twist = rng.normal(size=3) * (0.3, 0.3, 5.0)
    result = sp.simulate_free_sliding(surface, body, twist)
    steps, end = 200, 0.8 * result.t[-1]
    inertia = body.mass * body.radius_of_gyration**2

    def rate(state):
        theta, vx, vy, omega = state[2:]
        fx, fy, tau = surface.wrench(state[3:])
        c, s = math.cos(theta), math.sin(theta)
        accelerations = (-fx / body.mass + omega * vy, -fy / body.mass - omega * vx, -tau / inertia)
        return np.array((c * vx - s * vy, s * vx + c * vy, omega, *accelerations))

    state, dt = np.concatenate((np.zeros(3), twist)), end / steps
    for _ in range(steps):
        a = rate(state)
        b = rate(state + dt / 2 * a)
        c = rate(state + dt / 2 * b)
        d = rate(state + dt * c)
        state = state + dt / 6 * (a + 2 * b + 2 * c + d)
    for k in range(3):
        assert np.interp(end, result.t, result.poses[:, k]) == pytest.approx(state[k], abs=2e-5 * (1 + abs(state[k])))


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.sampled_from(("ideal", "uniform", "ellipsoid")))
def test_energy_never_grows_and_equals_the_work_of_friction(seed, kind):
    rng = np.random.default_rng(seed)
    legs, body = three_legs()
    surface = {"ideal": legs, "uniform": uniform(0.02), "ellipsoid": ellipsoid()}[kind]
    twist = rng.normal(size=3) * (0.3, 0.3, 5.0)
    result = sp.simulate_free_sliding(surface, body, twist, samples=2001)
    assert (np.diff(result.energy) <= 1e-12).all()
    power = (result.wrenches * result.twists).sum(axis=1)
    work = float(((power[1:] + power[:-1]) / 2 * np.diff(result.t)).sum())
    assert work == pytest.approx(result.energy[0], rel=2e-4)


def test_slides_end_along_eigen_directions_that_attract():
    surface, body = three_legs()
    found = sp.eigen_directions(surface, body)
    assert found.complete
    stable = found.twists[[kind == "stable" for kind in found.kinds]]
    rho = surface.characteristic_length
    rng = np.random.default_rng(3)
    for _ in range(12):
        twist = rng.normal(size=3) * (0.3, 0.3, 6.0)
        result = sp.simulate_free_sliding(surface, body, twist)
        gap = float(angle_between(stable * (1, 1, rho), result.direction * (1, 1, rho)).min())
        angle = math.atan2(result.direction[1], result.direction[0])
        attracts = any(low - 0.01 <= angle + turn <= high + 0.01 for low, high in found.translations for turn in (0, 2 * np.pi))
        # translations near the ends of their intervals attract weakly: the body rests before it has stopped turning
        assert gap < 1e-4 or (abs(rho * result.direction[2]) < 0.05 and attracts)


def test_eigen_directions_of_an_ellipsoid_are_its_axes():
    """With ``F = A V`` up to scale, they are the eigenvectors of the load against inertia: a minimum, a saddle, a maximum."""
    surface, body = ellipsoid(fx=3.0, fy=2.0, tau=0.1), square(0.8)
    found = sp.eigen_directions(surface, body)
    assert found.complete
    assert sorted(found.kinds) == ["saddle"] * 2 + ["stable"] * 2 + ["unstable"] * 2
    rho = surface.characteristic_length
    axes = np.abs(found.twists * (1, 1, rho))
    np.testing.assert_allclose(np.sort(axes, axis=1)[:, :2], 0, atol=1e-8)
    # power of unit U: the half axes over the roots of inertia
    roots = np.sqrt((0.8, 0.8, 0.8 * body.radius_of_gyration**2))
    np.testing.assert_allclose(np.unique(found.decelerations.round(9)), np.sort(np.array((3.0, 2.0, 0.1)) / roots), rtol=1e-6)


def test_basins_are_those_of_slow_slides():
    surface, body = ellipsoid(), square(0.8)
    rng = np.random.default_rng(0)
    twists = rng.normal(size=(10, 3)) * (1, 1, 20)
    found, ends = sp.sliding_basins(surface, body, twists)
    rho = surface.characteristic_length
    for twist, end in zip(twists, ends, strict=True):
        assert found.kinds[end] == "stable"
        slow = sp.simulate_free_sliding(surface, body, 1e-3 * twist)
        assert float(angle_between(slow.direction * (1, 1, rho), found.twists[end] * (1, 1, rho))) < 0.05


def test_finer_tolerance_changes_nothing_that_counts(monkeypatch):
    surface, body = three_legs()
    coarse = sp.simulate_free_sliding(surface, body, (0.25, -0.1, 9.0))
    monkeypatch.setattr("stablepush.mechanics.sliding._RELATIVE", 1e-11)
    fine = sp.simulate_free_sliding(surface, body, (0.25, -0.1, 9.0))
    np.testing.assert_allclose(coarse.poses[-1], fine.poses[-1], atol=1e-8)
    assert coarse.t[-1] == pytest.approx(fine.t[-1], rel=1e-8)


@pytest.mark.parametrize(
    ("change", "words"),
    (
        ({"slider": sp.Slider(SQUARE)}, "slider.mass: expected a mass > 0"),
        ({"surface": sp.PolynomialLimitSurface([1, 0, 0, 1, 0, 1], 2, 0.05, force_unit="mu*N")}, "mu: expected the friction"),
        (
            {"surface": sp.PolynomialLimitSurface([1, 0, 0, 1, 0, 1], 2, 0.05, force_unit="mu*N"), "mu": 1e-320},
            "mu: expected 0 or at least 1e-09",
        ),
        ({"twist": (1, math.nan, 0)}, "twist"),
        ({"duration": -1.0}, "duration"),
        ({"variant": "moon"}, "variant: expected body or paper"),
        ({"samples": 1}, "samples: expected a whole number from 2"),
        ({"gravity": -1}, "gravity"),
        ({"slider": sp.Slider(SQUARE, 1e6), "twist": (0.1, 0, 9.0)}, "duration: the body turns some .* times"),
    ),
)
def test_bad_input(change, words):
    given = {"surface": uniform(), "slider": square(), "twist": (1, 0, 0), **change}
    with pytest.raises(sp.InputError, match=words):
        sp.simulate_free_sliding(given.pop("surface"), given.pop("slider"), given.pop("twist"), **given)


def test_a_body_at_rest_stays():
    result = sp.simulate_free_sliding(uniform(), square(), (0, 0, 0), pose=(1, 2, 3))
    assert result.at_rest
    np.testing.assert_array_equal(result.poses, [(1, 2, 3)])


def test_eigen_directions_refuse_gravity_that_pulls_up():
    with pytest.raises(sp.InputError, match="gravity"):
        sp.eigen_directions(uniform(), square(), gravity=-1)


def test_a_body_that_swings_too_often_is_cut(monkeypatch):
    """Friction off the centre of mass makes a fast body swing; what cannot be followed says how long it can."""
    feet = sp.SupportDistribution([[0.05, 0.0], [-0.03, 0.03], [-0.02, -0.05]], [1, 2, 3])
    slider = sp.Slider([(-0.06, -0.06), (0.1, -0.05), (-0.05, 0.1)], 1.2)
    surface = sp.IdealLimitSurface(feet, 3.0)
    monkeypatch.setattr("stablepush.mechanics.sliding._MOST_RATES", 2000)
    with pytest.raises(sp.InputError, match="swings too often") as error:
        sp.simulate_free_sliding(surface, slider, (300.0, 90.0, 0.0))
    cut = float(str(error.value).split()[-1])
    slide = sp.simulate_free_sliding(surface, slider, (300.0, 90.0, 0.0), duration=cut)
    assert not slide.at_rest and slide.t[-1] == pytest.approx(cut)
