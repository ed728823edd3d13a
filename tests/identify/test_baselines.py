"""The Gaussian process, and the older methods from pokes to friction."""

import numpy as np
import pytest
from conftest import RHO, pairs, random_twists, three_feet, triangle

import stablepush as sp
from stablepush.geometry.planar import angle_between, normalize_twist, normalize_wrench, unit


def test_gaussian_process_is_the_posterior_mean_of_its_kernel():
    """Against the textbook formula at the same hyperparameters, from the augmented pairs."""
    f, v = pairs(20, 0.05)
    surface = sp.fit_limit_surface(f, v, "gp", characteristic_length=RHO).surface
    assert isinstance(surface, sp.GaussianProcessSurface)
    x = unit(normalize_wrench(f, RHO))
    np.testing.assert_allclose(surface.slip.inputs, np.concatenate((x, -x)))
    y = unit(normalize_twist(v, RHO))
    square = ((surface.slip.inputs[:, None] - surface.slip.inputs) ** 2).sum(axis=-1)
    kernel = np.exp(-0.5 * square / surface.slip.length**2)
    # coefficients c = s (s K + n I)^-1 y, so that n/s = (y - K c)/c, the same everywhere
    ratio = (np.concatenate((y, -y)) - kernel @ surface.slip.coefficients) / surface.slip.coefficients
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=2e-2)
    assert np.median(ratio) > 0


def test_gaussian_process_learns_symmetry_and_survives_the_file(tmp_path):
    f, v = pairs(60, 0.02)
    fit = sp.fit_limit_surface(f, v, "gp", characteristic_length=RHO)
    assert "no limit surface" in fit.warnings[0]
    surface = fit.surface
    test_f, test_v = pairs(200, seed=4)
    assert np.degrees(angle_between(normalize_twist(surface.twist(test_f), RHO), normalize_twist(test_v, RHO)).mean()) < 12
    assert np.degrees(angle_between(normalize_wrench(surface.wrench(test_v), RHO), normalize_wrench(test_f, RHO)).mean()) < 12
    np.testing.assert_allclose(surface.twist(-test_f), -surface.twist(test_f), atol=1e-8)
    np.testing.assert_allclose(surface.value(-test_f), surface.value(test_f))
    assert np.abs(surface.value(test_f) - 1).mean() < 0.15
    sp.save_model(surface, tmp_path / "gp.json")
    again = sp.load_model(tmp_path / "gp.json")
    np.testing.assert_array_equal(again.twist(test_f), surface.twist(test_f))
    np.testing.assert_array_equal(again.wrench(test_v), surface.wrench(test_v))
    contact = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.9)
    assert sp.StabilityOracle(again, contact).probability(test_v) is None


@pytest.mark.parametrize("method", ("linear-program", "least-squares"))
def test_grid_pressures_predict_the_loads(method):
    f, v = pairs(30)
    found = sp.fit_pressure_grid(f, v, triangle(), method, spacing=0.01)
    test_v = random_twists(100, RHO, 7)
    truth = sp.IdealLimitSurface(three_feet(), 5.0).wrench(test_v)
    error = angle_between(normalize_wrench(found.surface.wrench(test_v), RHO), normalize_wrench(truth, RHO))
    assert np.degrees(np.median(error)) < 8
    assert found.loads.sum() == pytest.approx(5, rel=0.1)
    if method == "linear-program":
        assert (found.loads >= 0).all() and found.negative_share == 0
        np.testing.assert_allclose(found.loads @ found.points, 0, atol=1e-7)
    else:
        # what the paper holds against it
        assert found.negative_share > 0.01


def test_linear_program_is_optimal():
    """The same problem in cvxpy has the same optimum, and random feasible steps do not lower it."""
    import cvxpy as cp

    from stablepush.identify.pressure import predict_loads

    f, v = pairs(12, 0.05)
    found = sp.fit_pressure_grid(f, v, triangle(), spacing=0.03)
    rho = triangle().characteristic_length
    directions = unit(normalize_twist(v, rho))
    columns = predict_loads(found.points[:, None] / rho, np.ones((len(found.points), 1)), directions)

    def cost(loads):
        return np.abs(np.tensordot(loads, columns, 1) - normalize_wrench(f, rho)).sum()

    other = cp.Variable(len(found.points), nonneg=True)
    matrix = columns.transpose(1, 2, 0).reshape(-1, len(found.points))
    problem = cp.Problem(cp.Minimize(cp.norm1(matrix @ other - normalize_wrench(f, rho).ravel())), [found.points.T @ other == 0])
    problem.solve(solver=cp.CLARABEL)
    best = cost(found.loads)
    assert best == pytest.approx(problem.value, rel=1e-5)
    assert found.residual < 1.0


def test_ellipsoid_of_even_feet_keeps_their_symmetry():
    for points in (((-0.05, 0), (0.05, 0)), ((-0.05, 0), (-0.01, 0), (0.01, 0), (0.05, 0))):
        surface = sp.ellipsoid_from_pressure(sp.SupportDistribution(points, np.ones(len(points))), 3.0)
        # the middle of the feet is taken as it is, by a tolerance, and not as an iteration leaves it
        np.testing.assert_allclose(surface.twist([0, 1.0, 0]), (0, 1, 0), atol=1e-9)


def test_a_silent_gaussian_process_gives_no_answer():
    f, v = pairs(3)
    surface = sp.fit_limit_surface(f, v, "gp", characteristic_length=RHO).surface
    zero = type(surface.slip)(surface.slip.inputs, 0 * surface.slip.coefficients, 1.0)
    dumb = sp.GaussianProcessSurface(zero, surface.log_size, zero, 5.0, RHO)
    with pytest.raises(sp.ConvergenceError):
        dumb.twist(f)
    with pytest.raises(sp.ConvergenceError):
        dumb.wrench(v)
    contact = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.9)
    with pytest.raises(sp.InputError, match="no stable region"):
        sp.stable_region(surface, contact)


def test_ellipsoid_of_a_pressure_touches_the_ideal_surface_on_its_axes():
    """Equal in a translation's force and in the largest torque about the centre of friction (Howe and Cutkosky 1996)."""
    rng = np.random.default_rng(2)
    for _ in range(10):
        support = sp.SupportDistribution(rng.normal(size=(5, 2)) * 0.05, rng.uniform(0.1, 1, 5))
        surface = sp.ellipsoid_from_pressure(support, 4.0)
        # about the centre of friction a rotation takes a pure torque there: the load of a rotation about it
        ideal = sp.IdealLimitSurface(support, 4.0)
        grid = support.points.mean(axis=0) + rng.normal(size=(4000, 2)) * 0.03
        sums = 4.0 * (support.weights[:, None] * np.linalg.norm(support.points[:, None] - grid, axis=-1)).sum(axis=0)
        f, c = 4.0, surface.coefficients
        assert c[0] >= 1 / f**2 - 1e-12 and c[3] >= 1 / f**2 - 1e-12
        torque = 1 / np.sqrt(c[5]) * surface.characteristic_length
        assert torque <= sums.min() + 1e-6
        assert torque >= sums.min() * 0.97
        assert ideal.characteristic_length == surface.characteristic_length
    ring = sp.ellipsoid_from_pressure(sp.SupportDistribution.ring(0.05, 100), 2.0)
    assert ring.value([0, 0, 0.1]) == pytest.approx(1, rel=1e-6)
    assert ring.value([2.0, 0, 0]) == pytest.approx(1, rel=1e-6)


def test_bad_methods_are_refused():
    with pytest.raises(sp.InputError, match="least-squares"):
        sp.fit_pressure_grid(*pairs(5), triangle(), "guess")


def test_a_gaussian_process_answers_between_its_pairs():
    # with a free length scale the likelihood of these seven pairs makes each its own island
    for seed in range(25):
        rng = np.random.default_rng(seed)
        feet, shares = unit(rng.normal(size=(3, 2))), rng.dirichlet(np.ones(3))
        ideal = sp.IdealLimitSurface(sp.SupportDistribution(feet - shares @ feet, shares), 1.0, 1.0)
        twists = unit(rng.normal(size=(60, 3)))
        loads = ideal.wrench(twists) + 0.1 * rng.normal(size=(60, 3))
        twists = unit(twists + 0.1 * rng.normal(size=(60, 3)))
        surface = sp.fit_limit_surface(loads[:7], twists[:7], "gp", characteristic_length=1.0).surface
        assert np.isfinite(surface.twist(loads)).all()
        assert np.isfinite(surface.wrench(twists)).all()
