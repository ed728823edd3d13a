import numpy as np
import pytest
import shapely
from conftest import surface_zoo, three_feet, triangle

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.geometry.planar import twist_from_cor, unit
from stablepush.stability.kernels.chart import add_coverage, twists_from_disc
from stablepush.stability.probability import _covered
from stablepush.stability.region import BOUNDARY_TOLERANCE

RHO = 0.05


def edge_contact(mu=0.9):
    return sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, mu)


@pytest.fixture(scope="module")
def surface():
    """A quartic from ten noisy pokes, with its ensemble."""
    rng = np.random.default_rng(0)
    ideal = sp.IdealLimitSurface(three_feet(), 5.0, RHO)
    twists = unit(rng.normal(size=(10, 3))) / (1, 1, RHO)
    loads = ideal.wrench(twists) + 0.3 * rng.normal(size=(10, 3)) * (1, 1, RHO)
    return sp.fit_limit_surface(loads, twists, slider=triangle(), characteristic_length=RHO).surface


def test_the_map_is_the_oracle_s_probability(surface):
    """Scan lines through exact regions against H_inv of every surface."""
    grid = sp.probability_map(surface, edge_contact(), 0.4, 60)
    x, y = np.meshgrid(grid.x, grid.y)
    cors = np.stack((x, y), axis=-1)
    oracle = sp.StabilityOracle(surface, edge_contact())
    for sense, shares in ((1, grid.counter_clockwise), (-1, grid.clockwise)):
        expected = oracle.probability(twist_from_cor(cors, sense))
        assert (expected != shares).sum() <= 3, "a COR may lie on the boundary of a surface"
        assert np.abs(expected - shares).max() <= 0.02 + 1e-9
        assert 0 < shares.mean() < 1
    assert grid.x[0] == pytest.approx(-0.4 + 0.4 / 60)


@pytest.mark.parametrize("level", (0.1, 0.5, 0.9, 1.0))
def test_chance_regions_against_the_oracle(surface, level):
    region = sp.chance_region(surface, edge_contact(), level)
    oracle = sp.StabilityOracle(surface, edge_contact())
    rng = np.random.default_rng(1)
    for sense in (1, -1):
        places = rng.uniform(-1.42, 1.42, size=(3000, 2))
        places = places[(places**2).sum(axis=1) < 1.999]
        twists = twists_from_disc(places, sense) / (1, 1, RHO)
        expected = oracle.probability(twists) >= level - 1e-9
        np.testing.assert_array_equal(region.contains_twists(twists), expected)
        disc = region.disc(sense)
        wrong = places[shapely.contains_xy(disc, *places.T) != expected]
        if len(wrong):
            assert shapely.distance(shapely.boundary(disc), shapely.points(wrong)).max() < BOUNDARY_TOLERANCE
        assert expected.any()
    for low, high in region.translation_intervals:
        angles = np.array((low + 1e-4, high - 1e-4))
        directions = np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=-1)
        assert region.contains_twists(directions).all()
        outside = np.array((low - 1e-3, high + 1e-3))
        assert not region.contains_twists(np.stack((np.cos(outside), np.sin(outside), 0 * outside), axis=-1)).any()


def test_chance_regions_shrink_as_more_is_asked(surface):
    angles = [sp.chance_region(surface, edge_contact(), level).solid_angle() for level in (0.02, 0.3, 0.6, 0.9, 1.0)]
    assert (np.diff(angles) < 0).all()


def test_a_chance_region_needs_one_surface_at_least(surface):
    least, one = (sp.chance_region(surface, edge_contact(), level) for level in (1e-12, 1 / len(surface.members())))
    assert least.solid_angle() == one.solid_angle() < 12
    twists = np.random.default_rng(0).normal(size=(2000, 3)) / (1, 1, surface.characteristic_length)
    np.testing.assert_array_equal(least.contains_twists(twists), one.contains_twists(twists))
    assert not least.contains_twists(twists).all()


def test_polygons_are_counted():
    rng = np.random.default_rng(2)
    boxes = [shapely.box(x, y, x + 0.5, y + 0.4) for x, y in rng.uniform(-0.8, 0.3, size=(9, 2))]
    points = rng.uniform(-1, 1, size=(4000, 2))
    count = sum(shapely.contains_xy(box, *points.T).astype(int) for box in boxes)
    for needed in (1, 2, 5, 8, 10):
        covered = _covered([*boxes, shapely.Polygon()], needed)
        np.testing.assert_array_equal(shapely.contains_xy(covered, *points.T), count >= needed)


def test_polygons_in_several_pieces_are_counted():
    """Pieces, holes, copies, a whole chart and nothing at all, against points counted one by one."""
    rng = np.random.default_rng(4)
    points = rng.uniform(-1.5, 1.5, size=(3000, 2))
    for _ in range(20):
        discs = [shapely.Point(0, 0).buffer(1.41), shapely.Polygon()]
        for x, y, r in rng.uniform((-1, -1, 0.1), (1, 1, 0.6), size=(9, 3)):
            ring = shapely.Point(x, y).buffer(r, 30).difference(shapely.Point(x + 0.1, y).buffer(r / 2))
            cut = shapely.box(x - 0.05, -2, x + 0.05, 2) if rng.random() < 0.7 else shapely.Polygon()
            discs += [shapely.difference(ring, cut)] * rng.integers(1, 3)
        count = sum(shapely.contains_xy(disc, *points.T).astype(int) for disc in discs)
        for needed in (1, 2, 4, len(discs) - 1, len(discs)):
            covered = _covered(discs, needed)
            assert covered.is_valid
            np.testing.assert_array_equal(shapely.contains_xy(covered, *points.T), count >= needed)
    pieces = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(1.1, 0, 1.2, 1)])
    assert _covered([pieces], 1).area == pytest.approx(1.1)


def test_a_region_in_two_pieces_has_a_chance_region():
    """Two fingers that face each other: some surfaces leave two pieces of a hemisphere."""
    root, log = 0.5**0.5, demo_pokes()
    loads, slips = (array[:10] for array in log.pairs()[:2])
    surface = sp.fit_limit_surface(loads, slips, slider=log.rig.slider).surface
    contact = sp.PushContact([[0.024846157, 0.028487176], [0.0092277632, -0.0533333333]], [[-root, -root], [0, 1]], 0.187)
    oracle = sp.StabilityOracle(surface, contact)
    places = np.random.default_rng(5).uniform(-1.0, 1.0, size=(4000, 2))
    kinds = {sp.stable_region(member, contact).disc(-1).geom_type for member in surface.members()}
    assert "MultiPolygon" in kinds
    twists = twists_from_disc(places, -1) / (1, 1, surface.characteristic_length)
    for level in (0.1, 0.5, 0.9):
        disc = sp.chance_region(surface, contact, level).disc(-1)
        wrong = shapely.contains_xy(disc, *places.T) != (oracle.probability(twists) >= level - 1e-9)
        assert wrong.sum() <= 2, "a place may lie on the boundary"


def test_scan_lines_against_point_in_polygon():
    rng = np.random.default_rng(3)
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, 11))
        polygon = shapely.Polygon(np.stack((np.cos(angles), np.sin(angles)), axis=-1) * rng.uniform(0.2, 1.5, (11, 1)))
        polygon = shapely.difference(shapely.make_valid(polygon), shapely.Point(0.1, 0.0).buffer(0.07))
        for part in shapely.get_parts(shapely.make_valid(shapely.intersection(polygon, shapely.box(-1, -1, 1, 1)))):
            if not isinstance(part, shapely.Polygon):
                continue
            counts = np.zeros((50, 51))
            add_coverage(counts, part, 1.0)
            places = (2 * np.arange(50) + 1) / 50 - 1
            x, y = np.meshgrid(places, places)
            np.testing.assert_array_equal(np.cumsum(counts, axis=1)[:, :-1], shapely.contains_xy(part, x, y))


def test_what_has_no_ensemble_has_no_probability():
    plain = surface_zoo()["quartic"]
    with pytest.raises(sp.InputError, match="ensemble"):
        sp.chance_region(plain, edge_contact())
    with pytest.raises(sp.InputError, match="ensemble"):
        sp.probability_map(sp.IdealLimitSurface(three_feet(), 5.0), edge_contact(), 0.4)


def test_bad_levels_and_grids_are_refused(surface):
    for level in (0.0, 1.2, np.nan, -1):
        with pytest.raises(sp.InputError, match="probability"):
            sp.chance_region(surface, edge_contact(), level)
    for cells in (0, 1.5, True, 10**6):
        with pytest.raises(sp.InputError, match="cells"):
            sp.probability_map(surface, edge_contact(), 0.4, cells)
    with pytest.raises(sp.InputError, match="extent"):
        sp.probability_map(surface, edge_contact(), 0.0)
