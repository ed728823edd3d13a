import numpy as np
import pytest
from conftest import IDEALS, POLYNOMIALS, power_form, random_twists, surface_zoo, triangle

import stablepush as sp
from stablepush.geometry.planar import angle_between, cor_from_twist, normalize_twist, normalize_wrench, twist_from_cor, unit
from stablepush.surfaces.monomials import hessian_operator, monomials

ZOO = surface_zoo()


def scale(surface):
    """A typical load: the mean force of random twists."""
    f = normalize_wrench(surface.wrench(random_twists(50, surface.characteristic_length)), surface.characteristic_length)
    return float(np.linalg.norm(f, axis=1).mean())


@pytest.mark.parametrize("name", ZOO)
def test_loads_of_random_twists_give_the_twists_back(name):
    surface = ZOO[name]
    rho = surface.characteristic_length
    twists = random_twists(20_000, rho, seed=3)
    loads = surface.wrench(twists)
    assert angle_between(normalize_twist(surface.twist(loads), rho), normalize_twist(twists, rho)).max() < 1e-9
    np.testing.assert_allclose(surface.value(loads), 1, rtol=1e-9)
    assert ((loads * twists).sum(axis=1) > 0).all()


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_blocks_of_twists_have_the_loads_of_single_ones(name):
    """Whatever the number of twists: in blocks, in what is left of one, and by the code that single twists take."""
    surface = ZOO[name]
    twists = random_twists(150, surface.characteristic_length, seed=5)
    single = np.array([surface.wrench(twist) for twist in twists])
    for count in (5, 12, 64, 75, 150):
        np.testing.assert_allclose(surface.wrench(twists[:count]), single[:count], rtol=0, atol=1e-9 * scale(surface))


@pytest.mark.parametrize("name", ZOO)
def test_twists_are_unit_and_loads_do_not_depend_on_speed(name):
    surface = ZOO[name]
    rho = surface.characteristic_length
    twists = random_twists(100, rho)
    loads = surface.wrench(twists)
    np.testing.assert_allclose(np.linalg.norm(normalize_twist(surface.twist(loads), rho), axis=1), 1)
    for factor in (1e-290, 1e-12, 1e9, 1e290):
        np.testing.assert_allclose(surface.wrench(twists * factor), loads, rtol=1e-6, atol=1e-9 * scale(surface))
    np.testing.assert_allclose(surface.wrench(-twists), -loads, rtol=1e-6, atol=1e-9 * scale(surface))


@pytest.mark.parametrize("name", ZOO)
def test_maximum_work(name):
    """No load on the surface does more work on a twist than its own."""
    surface = ZOO[name]
    rho = surface.characteristic_length
    twists = random_twists(300, rho)
    loads = surface.wrench(twists)
    work = twists @ loads.T
    assert (work <= np.diag(work)[:, None] + 1e-9 * scale(surface)).all()


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_gradient_against_finite_differences(name):
    surface = ZOO[name]
    rho = surface.characteristic_length
    f = surface.wrench(random_twists(40, rho))
    h = 1e-6 * scale(surface)
    for axis in range(3):
        step = np.eye(3)[axis] * (1, 1, rho) * h
        slope = (surface.value(f + step) - surface.value(f - step)) / (2 * h)
        np.testing.assert_allclose(slope, surface.gradient(f)[:, axis], rtol=1e-5, atol=1e-5 / scale(surface))


@pytest.mark.parametrize("name", IDEALS)
def test_ideal_loads_are_sums_over_support_points(name):
    surface = ZOO[name]
    for twist in random_twists(20, surface.characteristic_length):
        load = np.zeros(3)
        for (x, y), m in zip(surface.support.points, surface.loads, strict=True):
            v = np.array((twist[0] - twist[2] * y, twist[1] + twist[2] * x))
            f = m * v / np.linalg.norm(v)
            load += (*f, x * f[1] - y * f[0])
        np.testing.assert_allclose(surface.wrench(twist), load, atol=1e-12)


@pytest.mark.parametrize("name", IDEALS)
def test_ideal_gauge_against_brute_force(name):
    """The gauge is the largest power ratio F·V/h(V) over all twists; rotations about support points included."""
    surface = ZOO[name]
    rho = surface.characteristic_length
    rng = np.random.default_rng(5)
    points = surface.support.points
    about_points = np.column_stack((points[:, 1], -points[:, 0], np.ones(len(points))))
    candidates = np.concatenate((random_twists(200_000, rho, 9), about_points))
    power = (surface.wrench(candidates) * candidates).sum(axis=1)
    for f in rng.normal(size=(10, 3)) * (1, 1, rho):
        best = (np.abs(candidates @ f) / power).max()
        found = float(surface.value(f))
        assert best <= found * (1 + 1e-12)
        assert best == pytest.approx(found, rel=2e-3)
        twist = surface.twist(f)
        assert f @ twist / (surface.wrench(twist) @ twist) == pytest.approx(found, rel=1e-6)


def test_a_load_on_a_facet_turns_the_slider_about_a_support_point():
    surface = ZOO["three feet"]
    foot = surface.support.points[1]
    center = surface.wrench((foot[1], -foot[0], 1.0))
    load = center.copy()
    load[:2] += (0.3, -0.4)
    load[2] += foot[0] * -0.4 - foot[1] * 0.3
    cor, sense = cor_from_twist(surface.twist(load))
    np.testing.assert_allclose(cor, foot, atol=1e-12)
    assert sense == 1
    assert surface.value(load) == pytest.approx(1)


def test_motions_that_nearly_rest_a_support_point_are_found_again():
    rng = np.random.default_rng(0)
    for count in rng.integers(3, 30, size=20):
        points = rng.uniform(-1, 1, size=(count, 2))
        surface = sp.IdealLimitSurface(sp.SupportDistribution(points, rng.dirichlet(np.ones(count))), 1.0, 1.0)
        at = points[rng.integers(count, size=300)]
        angle, off = rng.uniform(-np.pi, np.pi, size=300), 10.0 ** rng.uniform(-13, -3, size=300)
        twists = np.stack((at[:, 1] + off * np.cos(angle), -at[:, 0] + off * np.sin(angle), np.ones(300)), axis=-1)
        twists = unit(twists) * rng.choice((-1, 1), size=(300, 1))
        assert np.linalg.norm(surface.twist(surface.wrench(twists)) - twists, axis=-1).max() < 1e-10


def test_every_load_has_a_motion_whatever_the_support():
    # points on a line, nearly one point, loads shared very unevenly, a characteristic length that does not fit
    rng = np.random.default_rng(5)
    for i in range(100):
        count = int(rng.integers(2, 40))
        points = rng.uniform(-1, 1, size=(count, 2)) * 10 ** rng.uniform(-1.5, 1.5)
        if i % 3 == 0:
            points[:, 1] = 0.3 * points[:, 0] + 0.1
        if i % 4 == 0:
            points[-1] = points[0] + 1e-9
        weights = rng.dirichlet(np.ones(count) * 10 ** rng.uniform(-1, 1))
        if len(np.unique(points[weights > 0], axis=0)) < 2:
            continue
        surface = sp.IdealLimitSurface(sp.SupportDistribution(points, weights), 1.0, 1.0)
        loads = unit(np.concatenate((rng.normal(size=(300, 3)), np.eye(3), rng.normal(size=(100, 3)) * (1, 1, 0))))
        twists = surface.twist(loads)
        # maximal work: no motion does more against this load for its friction power, 1/value
        power = (surface.wrench(twists) * twists).sum(axis=-1)
        assert np.allclose((loads * twists).sum(axis=-1), power * surface.value(loads), rtol=1e-9)
        others = unit(rng.normal(size=(200, 3)))
        works = loads @ others.T / (surface.wrench(others) * others).sum(axis=-1)
        assert (works <= surface.value(loads)[:, None] * (1 + 1e-9)).all()


def test_results_do_not_depend_on_the_unit_of_length():
    coefficients = power_form(np.random.default_rng(2).normal(size=(9, 3)), 4)
    metres = sp.PolynomialLimitSurface(coefficients, 4, 0.05)
    millimetres = sp.PolynomialLimitSurface(coefficients, 4, 50.0)
    twists = random_twists(100, 0.05)
    in_millimetres = twists * (1000, 1000, 1)
    np.testing.assert_allclose(metres.wrench(twists) * (1, 1, 1000), millimetres.wrench(in_millimetres), rtol=1e-9)


def test_shapes_pass_through():
    surface = ZOO["quartic"]
    twists = random_twists(12, 0.05).reshape(2, 2, 3, 3)
    assert surface.wrench(twists).shape == twists.shape
    assert surface.value(surface.wrench(twists)).shape == (2, 2, 3)
    assert surface.wrench(twists[0, 0, 0]).shape == (3,)
    assert surface.wrench(np.empty((0, 3))).shape == (0, 3)


@pytest.mark.parametrize("name", ("quartic", "three feet"))
def test_zero_is_refused(name):
    with pytest.raises(sp.InputError, match="not zero"):
        ZOO[name].wrench([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    with pytest.raises(sp.InputError, match="not zero"):
        ZOO[name].twist([0.0, 0.0, 0.0])


def test_surfaces_that_are_not_convex_say_so():
    coefficients = np.array(ZOO["x4+y4+z4"].coefficients)
    coefficients[sp.monomial_exponents(4).tolist().index([2, 2, 0])] = -3.0
    with pytest.raises(sp.ConvergenceError, match="convex"):
        sp.PolynomialLimitSurface(coefficients, 4, 0.05).wrench(random_twists(200, 0.05))
    with pytest.raises(sp.ConvergenceError, match="bounded"):
        sp.PolynomialLimitSurface(-coefficients, 4, 0.05).wrench(random_twists(2, 0.05))


def test_a_support_model_may_bring_its_own_length(tmp_path):
    surface = sp.IdealLimitSurface(ZOO["three feet"].support, 5.0, 0.2)
    sp.save_model(surface, tmp_path / "m.json")
    again = sp.load_model(tmp_path / "m.json")
    assert again.characteristic_length == 0.2
    twists = random_twists(50, 0.2)
    np.testing.assert_allclose(again.wrench(twists), ZOO["three feet"].wrench(twists), rtol=1e-9, atol=1e-12)
    loads = surface.wrench(twists)
    np.testing.assert_allclose(np.linalg.norm(surface.twist(loads) * (1, 1, 0.2), axis=1), 1)


def test_support_on_one_point_is_no_surface():
    with pytest.raises(sp.InputError, match="two different points"):
        sp.IdealLimitSurface(sp.SupportDistribution([(0.0, 0.0), (1.0, 0.0)], [1.0, 0.0]), 1.0)


@pytest.mark.parametrize("degree", (2, 4, 6))
def test_second_derivatives_by_euler(degree):
    """Fᵀ ∇²H F = d (d-1) H for homogeneous functions."""
    a = np.random.default_rng(0).normal(size=len(sp.monomial_exponents(degree)))
    f = np.random.default_rng(1).normal(size=(50, 3))
    forms = monomials(f, degree - 2) @ (hessian_operator(degree) @ a).T
    xx, xy, xz, yy, yz, zz = forms.T
    x, y, z = f.T
    quadratic = xx * x * x + yy * y * y + zz * z * z + 2 * (xy * x * y + xz * x * z + yz * y * z)
    np.testing.assert_allclose(quadratic, degree * (degree - 1) * (monomials(f, degree) @ a), atol=1e-9)


@pytest.mark.parametrize("name", ("quartic", "sextic", "three feet"))
def test_models_survive_their_file(name, tmp_path):
    surface = ZOO[name]
    sp.save_model(surface, tmp_path / "m.json")
    again = sp.load_model(tmp_path / "m.json")
    twists = random_twists(20, surface.characteristic_length)
    np.testing.assert_allclose(again.wrench(twists), surface.wrench(twists), rtol=1e-9)


def test_surfaces_can_be_sent_to_another_process():
    import pickle

    rng = np.random.default_rng(0)
    ideal = sp.IdealLimitSurface(sp.SupportDistribution.ring(0.05, 6), 3.0)
    twists = rng.normal(size=(30, 3)) * (1, 1, 20)
    fitted = sp.fit_limit_surface(ideal.wrench(twists), twists).surface
    for surface in (ideal, fitted):
        again = pickle.loads(pickle.dumps(surface))
        np.testing.assert_array_equal(again.wrench(twists), surface.wrench(twists))
    assert dict(again.provenance) == dict(fitted.provenance)
    assert dict(again.certificate) == dict(fitted.certificate)


def test_coincident_and_idle_support_points_change_nothing():
    """A point that carries nothing, or half of another in the same place but for rounding, is no point of its own."""
    rng = np.random.default_rng(3)
    points, weights = rng.uniform(-0.05, 0.05, (6, 2)), rng.uniform(0.2, 1.0, 6)
    plain = sp.IdealLimitSurface(sp.SupportDistribution(points, weights), 3.0, 0.04)
    twice = np.concatenate((points, points + 1e-17, points * (1 + 1e-15), rng.uniform(-0.05, 0.05, (4, 2))))
    shares = np.concatenate((0.25 * weights, 0.5 * weights, 0.25 * weights, np.zeros(4)))
    rich = sp.IdealLimitSurface(sp.SupportDistribution(twice, shares), 3.0, 0.04)
    # loads of turns about support points and near them, where a point rests
    pivots = points + rng.normal(0, 1e-4, (200, 1, 2))
    twists = np.concatenate((twist_from_cor(points, 1), twist_from_cor(pivots.reshape(-1, 2), -1)))
    loads = plain.wrench(twists) * rng.uniform(0.98, 1.0, (len(twists), 1))
    np.testing.assert_allclose(rich.value(loads), plain.value(loads), atol=1e-10)
    np.testing.assert_allclose(rich.twist(loads), plain.twist(loads), atol=1e-6)


def test_an_ensemble_of_surfaces_that_are_not_convex_is_refused():
    fitted = sp.fit_limit_surface(np.zeros((0, 3)), np.zeros((0, 3)), slider=triangle()).surface
    bent = np.where(np.arange(15) == 3, -3, 1)
    for change in (lambda row: -row, lambda row: row * bent, lambda row: row * (-1) ** np.arange(15)):
        rows = np.array(fitted.ensemble)
        rows[3] = change(rows[3])
        with pytest.raises(sp.InputError, match="row 3 is not"):
            sp.PolynomialLimitSurface(fitted.coefficients, 4, fitted.characteristic_length, ensemble=rows)


@pytest.mark.parametrize("rho", [1e-320, 1e-10, 0.0, -0.1, 1e7, np.nan])
def test_lengths_that_are_none_are_refused(rho):
    """Loads are divided by them: what overflows has no direction."""
    support = sp.SupportDistribution([[0.0, 0.03], [-0.03, -0.02], [0.03, -0.02]], [1, 2, 3])
    with pytest.raises(sp.InputError, match="characteristic_length: expected"):
        sp.IdealLimitSurface(support, 3.0, rho)
    with pytest.raises(sp.InputError, match="characteristic_length: expected"):
        sp.PolynomialLimitSurface(np.ones(15), 4, rho)


def test_loads_of_many_twists_are_greatest_on_surfaces_that_are_not_convex():
    """Such a surface has saddles with the gradient that is asked for: no load of a batch is one."""
    rng = np.random.default_rng(5)
    exponents = sp.monomial_exponents(4)
    axes = (exponents == 4).any(axis=1)
    asked = 0
    for _ in range(40):
        coefficients = np.where(axes, 1.0 + 0.24 * rng.normal(size=len(axes)), 1.2 * rng.normal(size=len(axes)))
        try:
            surface = sp.PolynomialLimitSurface(coefficients, 4, 1.0)
            twists = rng.normal(size=(80, 3))
            loads = surface.wrench(twists)
        except (sp.InputError, sp.ConvergenceError):
            continue
        asked += 1
        # a little aside, and back onto the surface, the power is less
        near = loads + 1e-3 * np.linalg.norm(loads, axis=1, keepdims=True) * rng.normal(size=(50, *loads.shape))
        near /= surface.value(near)[..., None] ** 0.25
        power = (near * twists).sum(axis=-1)
        best = (loads * twists).sum(axis=-1)
        assert (power <= best + 1e-9 * np.abs(best)).all()
    assert asked >= 4
