import numpy as np
import pytest
import shapely
from conftest import SQUARE, SQUARE_PUSH, counts, grid, triangle
from hypothesis import given, settings, strategies as st
from scipy.optimize import linprog

import stablepush as sp
from stablepush.geometry.planar import point_velocity, twist_from_cor
from stablepush.stability.all_pressure import CERTIFICATE_TOLERANCE
from stablepush.stability.kernels.chart import twists_from_disc


def edge_contact(mu=0.9, center=0.05):
    return sp.PushContact.on_edge(triangle(), 0, center, 0.05, mu)


def by_program(slider, contact, twist, coms=((0.0, 0.0),), spacing=400):
    """Least ``a·F`` over the facets by HiGHS, over points along the boundary and the COR; never below the true minimum."""
    vertices = slider.vertices if slider.support is None else slider.support_vertices
    share = np.linspace(0, 1, spacing)[:, None, None]
    points = (vertices + share * (np.roll(vertices, -1, axis=0) - vertices)).reshape(-1, 2)
    rho = slider.characteristic_length
    rest = None
    if twist[2]:
        rest = np.array((-twist[1], twist[0])) / twist[2]
        # where an edge passes the COR closely, friction turns within a short way
        near = np.concatenate((-np.geomspace(1e-12, 0.05, 90), (0.0,), np.geomspace(1e-12, 0.05, 90)))
        for a, b in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
            length = np.linalg.norm(b - a)
            t = np.clip((rest - a) @ (b - a) / length + near, 0, length)
            points = np.vstack((points, a + t[:, None] * (b - a) / length))
        if not shapely.Polygon(vertices).covers(shapely.Point(rest)):
            rest = None
    values = []
    for a in contact.cone(rho).normals:
        b = np.stack((a[0] - a[2] / rho * points[:, 1], a[1] + a[2] / rho * points[:, 0]), axis=-1)
        v = np.stack((twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]), axis=-1)
        speed = np.linalg.norm(v, axis=1)
        g = np.where(speed > 1e-15, (b * v).sum(axis=1) / np.maximum(speed, 1e-15), -np.linalg.norm(b, axis=1))
        where = points
        if rest is not None:
            where = np.vstack((points, rest))
            g = np.append(g, -np.hypot(a[0] - a[2] / rho * rest[1], a[1] + a[2] / rho * rest[0]))
        corners = np.array(coms)
        equal = np.zeros((4, len(where) + len(corners)))
        equal[0, : len(where)], equal[1, len(where) :] = 1, 1
        equal[2:, : len(where)], equal[2:, len(where) :] = where.T, -corners.T
        cost = np.append(g, np.zeros(len(corners)))
        # the simplex method of older versions of HiGHS stops at times
        found = (linprog(cost, A_eq=equal, b_eq=(1, 1, 0, 0), method=method).fun for method in ("highs", "highs-ipm"))
        values.append(next(value for value in found if value is not None))
    return min(values)


@pytest.mark.parametrize("distance", (1e-5, 1e-7, 1e-9, 1e-10))
def test_the_bound_holds_for_rotations_about_places_just_outside(distance):
    """Where an edge passes the COR that closely, friction turns round within a part in a million of it."""
    slider = sp.Slider.centered([(0, 0), (0.1, 0), (0.1, 0.04), (0.04, 0.04), (0.04, 0.1), (0, 0.1)], 1.0)
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.03, 0.5)
    ends = slider.vertices
    rng = np.random.default_rng(0)
    for edge in range(6):
        a, b = ends[edge], ends[(edge + 1) % 6]
        along = (b - a) / np.linalg.norm(b - a)
        place = a + rng.uniform(0.1, 0.9) * (b - a) + distance * np.array((along[1], -along[0]))
        for sense in (1, -1):
            twist = twist_from_cor(place, sense)
            worst = sp.worst_pressure(slider, contact, twist)
            # the program knows points of the boundary only: it is never below the least
            assert worst.height <= by_program(slider, contact, twist) + 1e-7


def test_reference_count_on_the_unit_square():
    """41 x 41 CORs over [-4, 4]^2 in both senses: 258 are stable for every pressure."""
    region = sp.all_pressure_region(SQUARE, SQUARE_PUSH)
    assert counts(region) == 258
    stable = sp.lynch_mason_region(SQUARE, SQUARE_PUSH)
    for sense in (1, -1):
        assert not (stable.contains(grid(), sense) & ~region.contains(grid(), sense)).any()


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), box=st.sampled_from((0.0, 0.004)), scale=st.sampled_from((1e-6, 1.0, 30.0)))
def test_worst_pressure_is_the_optimum_of_the_linear_program(seed, box, scale):
    rng = np.random.default_rng(seed)
    slider, contact = triangle(), edge_contact(rng.uniform(0.1, 1.5), rng.uniform(0.03, 0.12))
    twist = rng.normal(size=3) * (1, 1, scale / 0.05)
    if rng.random() < 0.3:
        twist = twist_from_cor(rng.dirichlet(np.ones(3)) @ slider.vertices, rng.choice((-1.0, 1.0)))
    worst = sp.worst_pressure(slider, contact, twist, com_tolerance=box)
    coms = box * np.array(((1, 1), (-1, 1), (-1, -1), (1, -1)))
    reference = by_program(slider, contact, twist, coms)
    assert worst.gap < 1e-11
    # the program knows only some points: it cannot be lower, and is near
    assert worst.height - 1e-9 <= reference <= worst.height + 2e-3
    assert np.abs(worst.shares @ worst.points).max() <= box + 1e-12
    assert worst.shares.sum() == pytest.approx(1.0)
    assert np.linalg.norm(worst.forces, axis=1) == pytest.approx(worst.shares)


def test_a_push_outside_is_broken_by_the_pressure_returned():
    rng = np.random.default_rng(1)
    slider, contact = triangle(), edge_contact()
    region = sp.all_pressure_region(slider, contact)
    cone, asked = contact.cone(slider.characteristic_length), 0
    for sense in (1, -1):
        ring = np.array(region.disc(sense).exterior.coords)
        # at the boundary nothing is left, and a little beyond a pressure breaks the push
        ring = ring[(ring**2).sum(axis=1) < 1.999]
        for place in ring[rng.integers(len(ring), size=25)]:
            on, outer = (twists_from_disc(place * (1 + s), sense) / (1, 1, region.characteristic_length) for s in (0.0, -1e-3))
            assert abs(sp.worst_pressure(slider, contact, on).height) < 1e-4
            # towards the tighter turns
            if region.contains_twists(outer):
                continue
            worst = sp.worst_pressure(slider, contact, outer)
            assert worst.breaks and float(cone.margin(worst.load / (1, 1, slider.characteristic_length))) < 0
            # the same by way of the oracle, where all points move
            if (np.linalg.norm(point_velocity(outer, worst.points), axis=1) > 1e-6).all() and len(worst.points) > 1:
                ideal = sp.IdealLimitSurface(sp.SupportDistribution(worst.points, worst.shares), 1.0)
                assert not sp.StabilityOracle(ideal, contact).is_stable(outer)
                asked += 1
    assert asked > 5


def test_polygons_and_membership_agree():
    rng = np.random.default_rng(2)
    for contact in (
        edge_contact(),
        edge_contact(0.3, 0.09),
        sp.PushContact(((-0.02, -0.05), (-0.05, 0.01)), ((0, 1), (1, 0)), 0.4),
    ):
        region = sp.all_pressure_region(triangle(), contact)
        for sense in (1, -1):
            places = rng.uniform(-1.42, 1.42, size=(20_000, 2))
            places = places[(places**2).sum(axis=1) < 1.999]
            disc = region.disc(sense)
            inside = shapely.contains_xy(disc, *places.T)
            differ = places[
                inside != region.contains_twists(twists_from_disc(places, sense) / (1, 1, region.characteristic_length))
            ]
            if len(differ):
                assert shapely.distance(shapely.boundary(disc), shapely.points(differ)).max() < 2e-5


def test_less_is_known_less_is_promised():
    known = sp.all_pressure_region(triangle(), edge_contact())
    box = sp.all_pressure_region(triangle(), edge_contact(), com_tolerance=(0.004, 0.002))
    slippery = sp.all_pressure_region(triangle(), edge_contact(), mu=(0.6, 0.9))
    feet = sp.SupportDistribution(((-0.02, -0.02), (0.04, -0.02), (-0.02, 0.04)), (1, 1, 1))
    rho = triangle().characteristic_length
    narrow = sp.all_pressure_region(sp.Slider(triangle().vertices, support=feet), edge_contact(), characteristic_length=rho)
    assert box.solid_angle() < known.solid_angle() < narrow.solid_angle()
    assert slippery.solid_angle() == pytest.approx(sp.all_pressure_region(triangle(), edge_contact(0.6)).solid_angle())
    rng = np.random.default_rng(3)
    twists = rng.normal(size=(4000, 3)) / (1, 1, 0.05)
    inside = box.contains_twists(twists)
    assert inside.sum() > 50
    assert known.contains_twists(twists)[inside].all()
    # a COM in the box, moved there, is one of those that the box promises for
    moved = np.array((0.004, -0.002))
    for contact, slider in ((edge_contact(), triangle()),):
        shifted = sp.Slider(slider.vertices - moved)
        there = sp.PushContact(contact.points - moved, contact.normals, contact.mu)
        velocity = sp.all_pressure_region(shifted, there).contains_twists(
            np.column_stack((twists[:, 0] - twists[:, 2] * moved[1], twists[:, 1] + twists[:, 2] * moved[0], twists[:, 2]))
        )
        assert velocity[inside].all()


def test_translations_are_those_whose_force_through_the_com_is_in_the_cone():
    contact = edge_contact(0.7)
    region = sp.all_pressure_region(triangle(), contact)
    np.testing.assert_allclose(region.translations, sp.lynch_mason_region(triangle(), contact).translations)
    low, high = region.translations
    angles = np.array((low + 1e-6, high - 1e-6, low - 1e-6, high + 1e-6))
    held = region.contains_twists(np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=-1))
    np.testing.assert_array_equal(held, (True, True, False, False))


def test_units_do_not_matter():
    small = sp.all_pressure_region(triangle(), edge_contact())
    large = sp.all_pressure_region(
        sp.Slider(triangle().vertices * 1000), sp.PushContact(edge_contact().points * 1000, edge_contact().normals, 0.9)
    )
    assert large.solid_angle() == pytest.approx(small.solid_angle(), rel=1e-6)
    cors = np.random.default_rng(0).uniform(-1, 1, size=(2000, 2))
    np.testing.assert_array_equal(small.contains(cors, 1), large.contains(1000 * cors, 1))


def test_the_characteristic_length_is_of_the_picture_only():
    for build in (sp.all_pressure_region, sp.lynch_mason_region):
        one, two = build(triangle(), edge_contact()), build(triangle(), edge_contact(), characteristic_length=0.2)
        twists = np.random.default_rng(0).normal(size=(3000, 3)) / (1, 1, 0.1)
        np.testing.assert_array_equal(one.contains_twists(twists), two.contains_twists(twists))
        assert one.area(1, 0.5) == pytest.approx(two.area(1, 0.5), rel=1e-4)
        assert one.solid_angle() < two.solid_angle()


def test_every_kind_of_contact_has_an_answer():
    slider = triangle()
    finger = sp.all_pressure_region(slider, sp.PushContact([(0.0, -0.05)], [(0, 1)], 0.8))
    assert finger.disc(1).is_empty and finger.solid_angle() == 0
    # pushed straight through its centre of mass, without turning, whatever the pressure
    assert finger.contains_twists((0.0, 1.0, 0.0))
    low, high = finger.translations
    assert len(finger.translation_intervals) == 1
    assert low == pytest.approx(np.pi / 2) and high == pytest.approx(low)
    pinch = sp.PushContact(((-0.05, 0.0), (0.03, 0.0)), ((1, 0), (-1, 0)), 0.5)
    everything = sp.all_pressure_region(slider, pinch)
    assert everything.solid_angle() == pytest.approx(4 * np.pi, rel=1e-4)
    assert everything.contains(np.random.default_rng(0).normal(size=(50, 2)), -1).all()
    with pytest.raises(sp.InputError, match="nothing breaks"):
        sp.worst_pressure(slider, pinch, (1.0, 0.0, 0.0))


def test_pressure_keeps_to_an_outline_that_is_not_convex():
    """Nothing presses in the mouth of a C: more is promised than for its hull."""
    ring = np.array(((-1, -1), (1, -1), (1, -0.6), (-0.5, -0.6), (-0.5, 0.6), (1, 0.6), (1, 1), (-1, 1))) * 0.1
    slider = sp.Slider(ring + np.array((0.02, 0.0)))
    hull = sp.Slider(np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) * 0.1 + np.array((0.02, 0.0)))
    contact = sp.PushContact.on_edge(slider, 0, 0.1, 0.08, 0.6)
    region, cautious = sp.all_pressure_region(slider, contact), sp.all_pressure_region(hull, contact)
    rng = np.random.default_rng(0)
    twists = rng.normal(size=(10_000, 3)) / (1, 1, 0.1)
    inside = region.contains_twists(twists)
    assert (inside & ~cautious.contains_twists(twists)).any()
    assert not (~inside & cautious.contains_twists(twists)).any()
    polygon = slider.polygon.buffer(1e-9)
    for twist in twists[rng.permutation(10_000)[:150]]:
        worst = sp.worst_pressure(slider, contact, twist)
        assert shapely.contains_xy(polygon, *worst.points.T).all()
        assert worst.gap < 1e-11
        assert worst.height - 1e-9 <= by_program(slider, contact, twist) <= worst.height + 5e-3


def test_a_contact_at_the_centre_of_mass():
    """A facet without force bounds the sense of the turn only."""
    for offset in (0.0, 1e-9, 1e-7):
        contact = sp.PushContact(((offset, 0.0), (0.03, 0.0)), (0, 1), 0.5)
        region = sp.all_pressure_region(triangle(), contact)
        for sense in (1, -1):
            places = np.random.default_rng(1).uniform(-1.42, 1.42, size=(3000, 2))
            places = places[(places**2).sum(axis=1) < 1.99]
            held = region.contains_twists(twists_from_disc(places, sense) / (1, 1, region.characteristic_length))
            wrong = places[shapely.contains_xy(region.disc(sense), *places.T) != held]
            if len(wrong):
                assert shapely.distance(shapely.boundary(region.disc(sense)), shapely.points(wrong)).max() < 1e-4


def test_a_wedge_of_wrenches_has_a_region():
    points, normals = ((-0.05, 0.0), (0.03, 0.0), (0.0, -0.05), (0.05, -0.05)), ((1, 0), (-1, 0), (0, 1), (0, 1))
    region = sp.all_pressure_region(triangle(), sp.PushContact(points, normals, 0.0))
    sphere = np.random.default_rng(0).normal(size=(20_000, 3))
    share = region.contains_twists(sphere / (1, 1, region.characteristic_length)).mean()
    assert share > 0.05
    assert region.solid_angle() == pytest.approx(4 * np.pi * share, abs=0.1)


def test_bad_input_is_named():
    slider, contact = triangle(), edge_contact()
    two_feet = sp.Slider(slider.vertices, support=sp.SupportDistribution(((-0.02, 0), (0.02, 0)), (1, 1)))
    with pytest.raises(sp.InputError, match="on a line"):
        sp.all_pressure_region(two_feet, contact)
    with pytest.raises(sp.InputError, match="centre of mass"):
        sp.all_pressure_region(slider, contact, com_tolerance=0.2)
    for tolerance in (-1.0, np.nan, (1, 2, 3)):
        with pytest.raises(sp.InputError, match="com_tolerance"):
            sp.all_pressure_region(slider, contact, com_tolerance=tolerance)
    for interval in (0.5, (0.9, 0.5), (-1.0, 0.5)):
        with pytest.raises(sp.InputError, match="mu"):
            sp.all_pressure_region(slider, contact, mu=interval)
    with pytest.raises(sp.InputError, match="twist"):
        sp.worst_pressure(slider, contact, (0.0, 0.0, 0.0))
    assert CERTIFICATE_TOLERANCE <= 1e-6
