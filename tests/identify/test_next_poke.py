import numpy as np
import pytest
import shapely
from conftest import RHO, pairs, surface_zoo, triangle

import stablepush as sp
from stablepush.geometry.planar import point_velocity, unit

MU = 0.6


@pytest.mark.parametrize("name", ("quartic", "three feet", "ring", "quadratic"))
def test_outcomes_obey_coulomb_at_the_finger(name):
    """Sticking: the contact moves along the heading; sliding: the force is on the edge of the cone that resists the slip."""
    surface = surface_zoo()[name]
    pool = sp.poke_candidates(triangle(), places=4, headings=7, widest=1.3)
    points, normals, headings = (np.array([getattr(p, n) for p in pool]) for n in ("point", "normal", "heading"))
    loads, twists = sp.poke_outcome(surface, points, normals, headings, MU)
    stuck = slid = 0
    for p, n, u, f, v in zip(points, normals, headings, loads, twists, strict=True):
        force, velocity = f[:2], unit(point_velocity(v, p[None])[0])
        tangent = np.array((-n[1], n[0]))
        assert f[2] == pytest.approx(p[0] * force[1] - p[1] * force[0], abs=1e-6 * np.linalg.norm(force))
        slope = (force @ tangent) / (force @ n)
        assert abs(slope) <= MU + 1e-6 and force @ n > 0
        # the finger's motion relative to the slider, along the edge
        turn = np.degrees(np.arctan2(u @ tangent, u @ n) - np.arctan2(velocity @ tangent, velocity @ n))
        if abs(slope) < MU - 1e-3:
            assert abs(turn) < 3
            stuck += 1
        elif abs(turn) > 3:
            assert np.sign(turn) == np.sign(slope)
            slid += 1
    assert stuck and slid


def test_the_best_poke_is_where_surfaces_disagree():
    """Two surfaces that differ in torque only: a poke through the centre of mass tells nothing, one off it does."""
    members = np.array([[1.0, 0, 0, 1.0, 0, z] for z in np.linspace(0.6, 1.4, 12)])
    surface = sp.PolynomialLimitSurface(members.mean(axis=0), 2, RHO, ensemble=members)
    edge = np.array((0.0, 1.0))
    pokes = [sp.EdgePush(0, x + 0.05, np.array((x, -0.05)), edge) for x in (0.0, 0.02, 0.04)]
    ranked = sp.rank_pokes(surface, pokes, MU)
    assert [p.point[0] for p in ranked][-1] == 0.0
    assert ranked[-1].gain < 1e-6
    assert 0.2 < ranked[0].gain <= 1
    # a less certain measurement tells less
    assert sp.rank_pokes(surface, pokes, MU, scatter=0.5)[0].gain < ranked[0].gain


def test_only_reachable_edges_are_offered():
    pool = sp.poke_candidates(triangle(), edges=[1], places=3, headings=2)
    assert len(pool) == 6 and {p.edge for p in pool} == {1}
    start, end = triangle().edge(1)
    for poke in pool:
        across = np.array((-(end - start)[1], (end - start)[0]))
        assert abs((poke.point - start) @ across) < 1e-12
        assert poke.heading @ poke.normal >= np.cos(np.radians(60)) - 1e-12
        assert triangle().polygon.buffer(1e-9).contains(shapely.Point(poke.point + 1e-3 * poke.normal))


def test_gains_come_with_a_fit():
    fit = sp.fit_limit_surface(*pairs(4, 0.05), slider=triangle())
    ranked = sp.rank_pokes(fit.surface, sp.poke_candidates(triangle(), places=3, headings=3), MU)
    gains = [p.gain for p in ranked]
    assert gains == sorted(gains, reverse=True) and 0 < gains[0] < 1
    with pytest.raises(sp.InputError, match="ensemble"):
        sp.rank_pokes(surface_zoo()["quartic"], ranked, MU)
    with pytest.raises(sp.InputError, match="ensemble"):
        sp.rank_pokes(surface_zoo()["ring"], ranked, MU)
    with pytest.raises(sp.InputError, match="candidates"):
        sp.rank_pokes(fit.surface, [], MU)


@pytest.mark.parametrize(
    "options", ({"edges": [7]}, {"edges": [1.0]}, {"places": 0}, {"headings": 2.5}, {"places": "3"}, {"widest": 2.0})
)
def test_bad_candidates_are_refused(options):
    with pytest.raises(sp.InputError):
        sp.poke_candidates(triangle(), **options)


def test_one_heading_is_the_normal():
    for poke in sp.poke_candidates(triangle(), places=1, headings=1):
        np.testing.assert_allclose(poke.heading, poke.normal)


def test_bad_pokes_are_refused():
    surface, point, normal = surface_zoo()["quartic"], [[0.0, -0.05]], [[0.0, 1.0]]
    for points, normals, headings in (
        (point, normal, [[0.0, -1.0]]),
        (point, normal, [[0.0, 0.0]]),
        (point, normal * 2, normal),
        (np.empty((0, 2)),) * 3,
    ):
        with pytest.raises(sp.InputError):
            sp.poke_outcome(surface, points, normals, headings, MU)
