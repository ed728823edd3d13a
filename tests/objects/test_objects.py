"""Slider, SupportDistribution, PushContact and the composite wrench cone."""

import numpy as np
import pytest
from conftest import triangle
from hypothesis import given, settings, strategies as st
from scipy.optimize import nnls

import stablepush as sp

SQUARE = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        (((0, 0), (1, 0)), "at least 3"),
        (SQUARE[::-1], "clockwise"),
        (((0, 0), (1, 1), (1, 0), (0, 1)), "cross"),
        (((0, 0), (1, 0), (1, 0), (0, 1)), "zero length"),
        (((0, 0), (1, 0), (np.nan, 1)), "finite"),
        (((0, 0, 0), (1, 0, 0), (0, 1, 0)), "shape"),
        (((0, 0), (2e6, 0), (0, 1)), "magnitude"),
        (((0, 0), (1, 0), (2, 0)), "cross or touch|area"),
        (((0, 0), (1e-9, 0), (0, 1e-9)), "area of at least"),
    ],
)
def test_bad_outlines_are_refused(vertices, message):
    with pytest.raises(sp.InputError, match=message):
        sp.Slider(vertices)


@pytest.mark.parametrize("mass", [0, 1e-320, 9e-10, -1.0, 1e7, np.nan, "1"])
def test_masses_that_are_none_are_refused(mass):
    """Forces are divided by them."""
    with pytest.raises(sp.InputError, match="mass: expected"):
        sp.Slider(SQUARE, mass)
    assert sp.Slider(SQUARE, 1e-9).mass == 1e-9


def test_slider_moments():
    square = sp.Slider(SQUARE)
    assert square.radius_of_gyration == pytest.approx(np.sqrt(1 / 6))
    # the lab's triangle: legs a, about its centroid k^2 = 2 a^2/18
    assert triangle().radius_of_gyration == pytest.approx(0.05)
    even = sp.SupportDistribution.from_polygon(SQUARE, 0.01)
    assert even.characteristic_length == pytest.approx(square.radius_of_gyration, rel=1e-4)


def test_values_cannot_be_changed():
    slider = triangle()
    with pytest.raises(ValueError, match="read-only"):
        slider.vertices[0] = 0
    with pytest.raises(AttributeError):
        slider.mass = 2  # type: ignore[misc]


@pytest.mark.parametrize("spacing", (0.5, 0.05, 0.0137))
def test_cells_of_a_polygon_keep_area_and_centroid(spacing):
    outline = triangle().vertices
    support = sp.SupportDistribution.from_polygon(outline, spacing)
    assert support.weights.sum() == pytest.approx(1)
    np.testing.assert_allclose(support.center, 0, atol=1e-12)


def test_support_hull_comes_from_the_support_if_there_is_one():
    assert len(triangle().support_vertices) == 3
    support = sp.SupportDistribution(((0, 0), (0.01, 0), (0, 0.01), (0.002, 0.002)), (1, 1, 1, 1))
    np.testing.assert_allclose(np.abs(sp.Slider(triangle().vertices, support=support).support_vertices).max(), 0.01)


@pytest.mark.parametrize(
    ("points", "normals", "mu", "message"),
    [
        ([], [], 1, "at least one|shape"),
        ([(0, 0), (0, 0)], (0, 1), 1, "equal"),
        ([(0, 0)], [(0, 0)], 1, "positive length"),
        ([(0, 0)], [(0, 1)], -0.1, "mu"),
        ([(0, 0)], [(0, 1)], float("nan"), "finite"),
        ([(0, 0), (1, 0)], [(0, 1)], 1, "one a point"),
    ],
)
def test_bad_contacts_are_refused(points, normals, mu, message):
    with pytest.raises(sp.InputError, match=message):
        sp.PushContact(points, normals, mu)


def test_contact_on_an_edge():
    contact = sp.PushContact.on_edge(triangle(), 1, 0.1, 0.05, 0.5)
    start, end = triangle().edge(1)
    along = (end - start) / np.linalg.norm(end - start)
    np.testing.assert_allclose(contact.points.mean(axis=0), start + 0.1 * along)
    assert np.linalg.norm(np.diff(contact.points, axis=0)) == pytest.approx(0.05)
    # into the slider: towards the corner opposite the hypotenuse
    assert (contact.normals @ (triangle().vertices[0] - start) > 0).all()
    with pytest.raises(sp.InputError, match="on edge 1"):
        sp.PushContact.on_edge(triangle(), 1, 0.01, 0.05, 0.5)


def test_cone_of_a_line_contact_has_the_published_facets():
    """Design facts: facets (f_l,y, -f_l,x, 0), (-f_r,y, f_r,x, 0), (p_l,y, -p_l,x, 1), (-p_r,y, p_r,x, -1), turned inwards."""
    mu, rho = 0.4, 0.07
    p_l, p_r, n = np.array((-0.02, -0.05)), np.array((0.03, -0.05)), np.array((0.0, 1.0))
    t = np.array((-n[1], n[0]))
    f_l, f_r = n + mu * t, n - mu * t
    expected = np.array(((f_l[1], -f_l[0], 0), (-f_r[1], f_r[0], 0), (p_l[1], -p_l[0], 1), (-p_r[1], p_r[0], -1))) * (1, 1, rho)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    found = sp.PushContact((p_l, p_r), n, mu).cone(rho).normals
    assert len(found) == 4
    for a in expected:
        assert np.abs(found - a).max(axis=1).min() < 1e-12
    assert np.array_equal(np.sort(found, axis=0), np.sort(sp.PushContact((p_r, p_l), n, mu).cone(rho).normals, axis=0))


def nonnegative_residual(rays, wrench):
    return nnls(rays.T, wrench / np.linalg.norm(wrench))[1]


@settings(max_examples=60)
@given(st.integers(1, 4), st.one_of(st.just(0.0), st.floats(1e-4, 1.5)), st.integers(0, 10_000))
def test_cone_agrees_with_nonnegative_combinations(count, mu, seed):
    """Membership by facets against membership by a least-squares fit of nonnegative finger forces."""
    rng = np.random.default_rng(seed)
    contact = sp.PushContact(rng.normal(size=(count, 2)), rng.normal(size=(count, 2)), mu)
    rays = contact.rays(0.8)
    cone = contact.cone(0.8)
    inside = rng.exponential(size=(20, len(rays))) @ rays
    inside = inside[np.linalg.norm(inside, axis=1) > 1e-3]
    assert (cone.margin(inside) >= -1e-9).all()
    for wrench in rng.normal(size=(20, 3)):
        margin, residual = float(cone.margin(wrench)), nonnegative_residual(rays, wrench)
        if residual > 1e-6:
            assert margin < 0
        elif margin < -1e-9:
            pytest.fail(f"margin {margin} though the fingers can apply the wrench")


def test_whole_space_and_flat_cones():
    opposed = sp.PushContact(((0.0, -1.0), (0.0, 1.0), (1.0, 0.0)), ((0, 1), (0, -1), (-1, 0)), 1.0)
    assert len(opposed.cone(1.0).normals) == 0
    assert opposed.cone(1.0).margin([1.0, 2.0, 3.0]) == pytest.approx(np.pi / 2)
    finger = sp.PushContact([(0.0, -1.0)], [(0, 1)], 0.5)
    assert finger.cone(1.0).rank == 2
    assert finger.cone(1.0).margin(finger.rays(1.0)).min() == pytest.approx(0, abs=1e-12)
    assert finger.cone(1.0).margin([0.0, 1.0, 0.3]) < 0
    ray = sp.PushContact([(0.2, -1.0)], [(0, 1)], 0.0)
    assert ray.cone(1.0).rank == 1
    assert ray.cone(1.0).margin([0.0, 1.0, 0.2]) == pytest.approx(0, abs=1e-12)
    assert ray.cone(1.0).margin([0.0, -1.0, -0.2]) < 0


def test_margin_is_the_angle_to_the_nearest_facet():
    cone = sp.PushContact(((-1.0, 0.0), (1.0, 0.0)), (0, 1), 1.0).cone(1.0)
    wrench = np.array((0.1, 1.0, 0.05))
    nearest = min(np.pi / 2 - np.arccos(np.clip(a @ wrench / np.linalg.norm(wrench), -1, 1)) for a in cone.normals)
    assert float(cone.margin(wrench)) == pytest.approx(nearest)
