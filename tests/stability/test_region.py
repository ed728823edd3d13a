import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import SQUARE, SQUARE_PUSH, counts, grid, pairs, random_twists, surface_zoo, three_feet, triangle

import stablepush as sp
from stablepush.geometry.planar import normalize_wrench, twist_from_cor
from stablepush.stability.kernels.chart import twists_from_disc
from stablepush.stability.region import BOUNDARY_TOLERANCE, regions_to_json

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "regions"))

import brute_force
import nesting

ZOO = surface_zoo()


def edge_contact(mu=0.9):
    return sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, mu)


def test_reference_counts_on_the_unit_square():
    """41 x 41 CORs over [-4, 4]^2 in both senses: STABLE accepts 144, 12 of them on its boundary; even pressure 398."""
    assert counts(sp.lynch_mason_region(SQUARE, SQUARE_PUSH)) == 144
    even = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(SQUARE.vertices, 0.04), 1.0)
    assert counts(sp.stable_region(even, SQUARE_PUSH)) == 398


def test_conservative_cors_are_stable_for_every_pressure():
    """Random pressures on the square with its COM: no COR that STABLE accepts is unstable."""
    rng = np.random.default_rng(0)
    region = sp.lynch_mason_region(SQUARE, SQUARE_PUSH)
    for _ in range(30):
        points = rng.uniform(-0.5, 0.5, size=(4, 2))
        # with its mirror image every point set has the COM in its middle
        support = sp.SupportDistribution(np.concatenate((points, -points)), np.tile(rng.uniform(0.1, 1, 4), 2))
        oracle = sp.StabilityOracle(sp.IdealLimitSurface(support, 1.0), SQUARE_PUSH)
        for sense in (1, -1):
            accepted = grid()[region.contains(grid(), sense)]
            assert oracle.is_stable_cor(accepted, sense).all()
        low, high = region.translations
        angles = np.linspace(low, high, 9)
        assert oracle.is_stable(np.column_stack((np.cos(angles), np.sin(angles), 0 * angles))).all()


def test_conservative_region_uses_the_support_not_the_contacts():
    wide = sp.lynch_mason_region(SQUARE, SQUARE_PUSH)
    feet = sp.SupportDistribution(((0.1, 0), (-0.05, 0.1), (-0.05, -0.1)), (1, 1, 1))
    narrow = sp.lynch_mason_region(sp.Slider(SQUARE.vertices, support=feet), SQUARE_PUSH)
    assert counts(narrow) > counts(wide)


@pytest.mark.parametrize("sense", (1, -1))
def test_polygons_of_the_conservative_region_match_its_inequalities(sense):
    region = sp.lynch_mason_region(SQUARE, SQUARE_PUSH)
    points = np.random.default_rng(2).uniform(-4, 4, size=(20_000, 2))
    merged = shapely.union_all(region.polygons(sense, 4.0))
    np.testing.assert_array_equal(shapely.contains_xy(merged, *points.T), region.contains(points, sense))
    # the mirror image of the other sense
    other = shapely.union_all(region.polygons(-sense, 4.0))
    assert merged.area == pytest.approx(other.area)


@pytest.mark.parametrize("name", ZOO)
@pytest.mark.parametrize("mu", (0.2, 1.0))
def test_polygons_against_brute_force(name, mu):
    """Polygons come from gradients on the cone's facets, membership from H_inv: they meet only if both are right."""
    surface = ZOO[name]
    contact = edge_contact(mu)
    region = sp.stable_region(surface, contact)
    extent = 0.5
    points = np.random.default_rng(3).uniform(-extent, extent, size=(4000, 2))
    for sense in (1, -1):
        merged = shapely.union_all(region.polygons(sense, extent))
        inside = shapely.contains_xy(merged, *points.T)
        stable = region.contains(points, sense)
        wrong = points[inside != stable]
        if len(wrong):
            assert shapely.distance(shapely.boundary(merged), shapely.points(wrong)).max() < 2e-5 * extent


@pytest.mark.parametrize("name", ("quartic", "three feet", "patch"))
def test_translations_end_where_the_margin_changes_sign(name):
    oracle = sp.StabilityOracle(ZOO[name], edge_contact())
    low, high = sp.stable_region(ZOO[name], edge_contact()).translations

    def margin(angle):
        return float(oracle.margin((np.cos(angle), np.sin(angle), 0.0)))

    assert margin(low + 1e-4) > 0 > margin(low - 1e-4)
    assert margin(high - 1e-4) > 0 > margin(high + 1e-4)


def test_membership_is_never_cut_and_polygons_are():
    region = sp.stable_region(ZOO["patch"], edge_contact())
    assert region.contains((-1e4, 0.0), 1)
    assert region.default_extent == pytest.approx(100 * 0.0559, rel=0.2)
    box = shapely.union_all(region.polygons(1)).bounds
    assert max(map(abs, box)) <= region.default_extent * (1 + 1e-12)
    assert region.contains(np.zeros((2, 3, 2)), np.array((1, -1, 1))).shape == (2, 3)


def test_conservative_polygons_reach_every_extent():
    region = sp.lynch_mason_region(triangle(), edge_contact())
    for extent in (0.2, 10.0, 1e5):
        merged = shapely.union_all(region.polygons(1, extent))
        points = np.random.default_rng(1).uniform(-extent, extent, size=(2000, 2))
        np.testing.assert_array_equal(shapely.contains_xy(merged, *points.T), region.contains(points, 1))


def test_order_of_contact_points_has_no_meaning():
    contact = edge_contact()
    swapped = sp.PushContact(contact.points[::-1], contact.normals[::-1], contact.mu)
    for build in (lambda c: sp.stable_region(ZOO["quartic"], c), lambda c: sp.lynch_mason_region(triangle(), c)):
        one, two = build(contact), build(swapped)
        np.testing.assert_array_equal(one.contains(grid(1.0), 1), two.contains(grid(1.0), 1))
        np.testing.assert_allclose(one.translations, two.translations)


def test_contacts_without_a_region_are_refused():
    finger = sp.PushContact([(0.0, -0.05)], [(0, 1)], 1.0)
    with pytest.raises(sp.UnsupportedContactError, match="line contact"):
        sp.lynch_mason_region(triangle(), finger)
    corner = sp.PushContact(((0.0, -0.05), (-0.05, 0.0)), ((0, 1), (1, 0)), 1.0)
    with pytest.raises(sp.UnsupportedContactError, match="common normal"):
        sp.lynch_mason_region(triangle(), corner)


def test_frictionless_pushes_are_stable_on_a_line_only():
    """Without friction the force is along the normal, so no sideways translation is stable."""
    oracle = sp.StabilityOracle(sp.IdealLimitSurface(sp.SupportDistribution.ring(0.05, 24), 1.0), edge_contact(0.0))
    assert oracle.cone.rank == 2
    assert oracle.is_stable((0.0, 1.0, 0.0))
    assert not oracle.is_stable((0.1, 1.0, 0.0))


def test_margin_against_the_definition():
    surface = sp.IdealLimitSurface(three_feet(), 5.0)
    oracle = sp.StabilityOracle(surface, edge_contact())
    rho = surface.characteristic_length
    for twist in random_twists(50, rho):
        f = normalize_wrench(surface.wrench(twist), rho)
        f /= np.linalg.norm(f)
        assert float(oracle.margin(twist)) == pytest.approx(min(np.arcsin(oracle.cone.normals @ f)))
    cors = np.random.default_rng(0).normal(size=(30, 2))
    np.testing.assert_array_equal(oracle.is_stable_cor(cors, -1), oracle.is_stable(twist_from_cor(cors, -1)))


def test_regions_as_json_are_plain():
    import json

    region = sp.lynch_mason_region(SQUARE, SQUARE_PUSH)
    value = json.loads(json.dumps(regions_to_json([region], 4.0), allow_nan=False))
    entry = value["regions"][0]
    area = sum(shapely.geometry.shape(p).area for p in entry["clockwise"])
    assert area == pytest.approx(sum(p.area for p in region.polygons(-1, 4.0)))


def test_one_finger_holds_a_curve_of_motions():
    """The cone of one contact is a sector: its motions are a curve, and near it none is stable."""
    for surface in (ZOO["quartic"], ZOO["three feet"]):
        region = sp.stable_region(surface, sp.PushContact([(0.01, -0.05)], [(0, 1)], 0.6))
        rho = surface.characteristic_length
        assert region.solid_angle() == 0 and region.polygons(1) == []
        assert len(region.curve) > 40 and np.linalg.norm(region.curve, axis=1) == pytest.approx(np.ones(len(region.curve)))
        inner = region.curve[1:-1] / (1, 1, rho)
        oracle = sp.StabilityOracle(surface, sp.PushContact([(0.01, -0.05)], [(0, 1)], 0.6))
        assert np.abs(oracle.margin(inner)).max() < 1e-6
        for low, high in region.translation_intervals:
            assert low == high
            direction = (np.cos(low), np.sin(low), 0.0)
            assert float(oracle.margin(direction)) == pytest.approx(0.0, abs=1e-4)


def test_a_cone_within_a_facet_of_the_surface_holds_one_rotation():
    """Where one support point carries enough, every load of the fingers turns the slider about it."""
    feet = sp.SupportDistribution(((0.02, 0.0), (-0.3, 0.2), (-0.3, -0.2)), (0.94, 0.03, 0.03))
    surface = sp.IdealLimitSurface(feet, 5.0)
    contact = sp.PushContact(((0.1, -0.05), (0.12, -0.05)), (0, 1), 0.02)
    region = sp.stable_region(surface, contact)
    assert region.curve.shape == (1, 3) and region.solid_angle() == 0
    np.testing.assert_allclose(region.tightest_turn(1), (0.02, 0.0), atol=1e-9)


def test_frictionless_contacts_hold_an_arc_or_a_single_motion():
    one = sp.stable_region(ZOO["quartic"], sp.PushContact([(0.01, -0.05)], [(0, 1)], 0.0))
    assert one.curve.shape == (1, 3)
    assert one.contains_twists(one.curve / (1, 1, 0.05)).all()
    two = sp.stable_region(ZOO["quartic"], edge_contact(0.0))
    assert two.solid_angle() == 0 and len(two.curve) > 10
    senses = np.sign(two.curve[:, 2])
    turns = [two.tightest_turn(sense) for sense in (1, -1)]
    assert [turn is not None for turn in turns] == [bool((senses == s).any()) for s in (1, -1)]
    line = sp.PushContact(((-0.05, 0.0), (0.05, 0.0)), ((1, 0), (-1, 0)), 0.0)
    assert sp.stable_region(ZOO["quartic"], line).curve.shape == (2, 3)


def test_opposed_fingers_hold_everything_or_are_refused():
    pinch = sp.PushContact(((-0.05, 0.0), (0.03, 0.0)), ((1, 0), (-1, 0)), 0.5)
    region = sp.stable_region(ZOO["quartic"], pinch)
    assert region.solid_angle() == pytest.approx(4 * np.pi, rel=1e-4)
    assert region.area(1, 0.3) == pytest.approx(0.36)
    assert region.contains(np.random.default_rng(0).normal(size=(50, 2)), -1).all()
    assert region.translations == (0.0, 2 * np.pi)
    np.testing.assert_allclose(region.tightest_turn(1), (0, 0), atol=1e-12)
    points, normals = ((-0.05, 0.0), (0.03, 0.0), (0.0, -0.05), (0.05, -0.05)), ((1, 0), (-1, 0), (0, 1), (0, 1))
    wedge = sp.PushContact(points, normals, 0.0)
    assert sp.StabilityOracle(ZOO["quartic"], wedge).cone.rank == 3
    with pytest.raises(sp.UnsupportedContactError, match="line in it"):
        sp.stable_region(ZOO["quartic"], wedge)


def test_three_prongs_of_translations():
    """A region that reaches translation in three places right round the rim: neither hemisphere is taken for the other."""
    # |F|^4 + 0.3 tau (fx^3 - 3 fx fy^2)
    terms = {(4, 0, 0): 1, (0, 4, 0): 1, (0, 0, 4): 1, (2, 2, 0): 2, (2, 0, 2): 2, (0, 2, 2): 2, (3, 0, 1): 0.3, (1, 2, 1): -0.9}
    coefficients = np.array([terms.get(tuple(e), 0.0) for e in sp.monomial_exponents(4).tolist()])
    surface = sp.PolynomialLimitSurface(coefficients, 4, 0.05)
    angles = np.radians((90, 210, 330))
    for radius in (0.6, 1.0, 1.5, 2.5):
        points = 0.05 * radius * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        contact = sp.PushContact(points, np.stack((-np.sin(angles), np.cos(angles)), axis=-1), 0.1)
        region = sp.stable_region(surface, contact)
        rng = np.random.default_rng(0)
        for sense in (1, -1):
            places = rng.uniform(-1.42, 1.42, size=(3000, 2))
            places = places[(places**2).sum(axis=1) < 1.998]
            stable = region.contains_twists(twists_from_disc(places, sense) / (1, 1, 0.05))
            disc = region.disc(sense)
            wrong = places[shapely.contains_xy(disc, *places.T) != stable]
            if len(wrong):
                assert shapely.distance(shapely.boundary(disc), shapely.points(wrong)).max() < BOUNDARY_TOLERANCE


@pytest.mark.parametrize(
    "contact",
    (
        sp.PushContact(((-0.03, -0.05), (0.0, -0.05), (0.05, -0.05)), (0, 1), 0.4),
        sp.PushContact(((-0.02, -0.05), (-0.05, 0.01)), ((0, 1), (1, 0)), 0.3),
        sp.PushContact(((-0.05, -0.05), (0.0, -0.05)), ((1, 1), (0, 1)), 0.4),
        sp.PushContact(((-0.02, -0.05), (0.03, 0.02)), ((0, 1), (-1, -1)), 0.05),
    ),
    ids=("several points", "two edges", "a vertex", "nearly opposed"),
)
@pytest.mark.parametrize("name", ("quartic", "three feet", "patch"))
def test_contacts_of_every_kind_against_brute_force(name, contact):
    surface = ZOO[name]
    region = sp.stable_region(surface, contact)
    rng = np.random.default_rng(5)
    for sense in (1, -1):
        places = rng.uniform(-1.42, 1.42, size=(4000, 2))
        places = places[(places**2).sum(axis=1) < 1.999]
        stable = region.contains_twists(twists_from_disc(places, sense) / (1, 1, surface.characteristic_length))
        disc = region.disc(sense)
        wrong = places[shapely.contains_xy(disc, *places.T) != stable]
        if len(wrong):
            assert shapely.distance(shapely.boundary(disc), shapely.points(wrong)).max() < BOUNDARY_TOLERANCE


def test_random_rigs_against_brute_force():
    """The study of examples/regions on some rigs: no motion on the wrong side, no load of the facets off the polygon."""
    for seed in range(24):
        found = brute_force.check(seed)
        assert found["wrong"] == 0 and found["far"] < BOUNDARY_TOLERANCE and found["mapped"] < BOUNDARY_TOLERANCE
        assert found["asked"] > 3000


def test_nesting_on_random_rigs():
    """STABLE within all-pressure within the region of every pressure; just outside, the pressure returned breaks the push."""
    for seed in range(8):
        found = nesting.check(seed, 30)
        assert found["loose"] == found["violations"] == 0
        assert found["broken"] == found["just outside"]


def test_areas_and_solid_angles_against_counting():
    region = sp.stable_region(ZOO["quartic"], edge_contact())
    rng = np.random.default_rng(0)
    sphere = rng.normal(size=(100_000, 3))
    share = region.contains_twists(sphere / (1, 1, region.characteristic_length)).mean()
    assert region.solid_angle() == pytest.approx(4 * np.pi * share, abs=0.05)
    cors = rng.uniform(-0.3, 0.3, size=(50_000, 2))
    assert region.area(-1, 0.3) == pytest.approx(0.36 * region.contains(cors, -1).mean(), abs=3e-3)


def test_the_raster_is_the_oracle_s_answer():
    region = sp.stable_region(ZOO["quartic"], edge_contact())
    line = 0.3 * ((2 * np.arange(80) + 1) / 80 - 1)
    cors = np.stack(np.meshgrid(line, line), axis=-1)
    for sense in (1, -1):
        drawn = region.raster(sense, 0.3, 80)
        assert (drawn != region.contains(cors, sense)).sum() <= 1
        assert drawn.any()
    with pytest.raises(sp.InputError, match="cells"):
        region.raster(1, 0.3, 0)


def test_the_tightest_turn_is_the_nearest_stable_cor():
    for name in ("quartic", "three feet", "patch"):
        region = sp.stable_region(ZOO[name], edge_contact())
        for sense in (1, -1):
            turn = region.tightest_turn(sense)
            radius = float(np.linalg.norm(turn))
            cors = np.random.default_rng(1).normal(size=(20_000, 2)) * 0.1
            near = cors[region.contains(cors, sense)]
            assert np.linalg.norm(near, axis=1).min() > radius - 1e-5
            polygon = shapely.union_all(region.polygons(sense, 1.0))
            assert shapely.distance(polygon, shapely.Point(turn)) < 1e-5


def test_regions_travel_between_processes():
    contact = edge_contact()
    fit = sp.fit_limit_surface(*pairs(12, 0.02), slider=triangle())
    regions = [
        sp.stable_region(fit.surface, contact),
        sp.chance_region(fit.surface, contact, 0.9),
        sp.all_pressure_region(triangle(), contact),
        sp.lynch_mason_region(triangle(), contact),
        sp.stable_region(fit.surface, sp.PushContact(((0.0, -0.05),), (0, 1), 0.5)),
    ]
    for region in regions:
        copy = pickle.loads(pickle.dumps(region))
        np.testing.assert_array_equal(copy.contains(grid(0.5), 1), region.contains(grid(0.5), 1))
        assert copy.solid_angle() == region.solid_angle()
