import numpy as np
import pytest
from conftest import RHO, pairs, power_form, random_twists, three_feet, triangle

import stablepush as sp
from stablepush.geometry.planar import angle_between, normalize_twist, normalize_wrench, unit
from stablepush.identify.moments import Moments
from stablepush.identify.program import LEAST_EIGENVALUE, SquaredProgram, squared_program
from stablepush.identify.sos import gram_equations, gram_parametrization
from stablepush.surfaces.monomials import gradient_rows, hessian_operator, monomials


@pytest.mark.parametrize(("degree", "count"), ((2, 6), (4, 36), (6, 90)))
def test_number_of_equations(degree, count):
    assert len(gram_equations(degree)[0]) == count


@pytest.mark.parametrize("degree", (2, 4, 6))
def test_every_gram_matrix_of_the_parametrization_is_the_hessian_form(degree):
    """zᵀ∇²H(F)z = yᵀQy with y = z ⊗ monomials, for random coefficients and free parts."""
    rng = np.random.default_rng(0)
    particular, free = gram_parametrization(degree)
    a = rng.normal(size=particular.shape[1])
    size = round(len(particular) ** 0.5)
    gram = (particular @ a + free @ rng.normal(size=free.shape[1])).reshape(size, size)
    for _ in range(20):
        f, z = rng.normal(size=3), rng.normal(size=3)
        xx, xy, xz, yy, yz, zz = (hessian_operator(degree) @ a) @ monomials(f, degree - 2)
        hessian = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
        y = np.kron(z, monomials(f, (degree - 2) // 2))
        assert y @ gram @ y == pytest.approx(z @ hessian @ z)


def test_moments_are_the_paper_s_sums_and_add():
    loads, twists = pairs(30, 0.05)
    f, v = normalize_wrench(loads, RHO) / 5, unit(normalize_twist(twists, RHO))
    a = np.random.default_rng(3).normal(size=15)
    whole = Moments.from_pairs(f, v, 4)
    gradient = gradient_rows(f, 4) @ a
    alpha = ((gradient - (gradient * v).sum(axis=1, keepdims=True) * v) ** 2).sum()
    beta = ((monomials(f, 4) @ a - 1) ** 2).sum()
    assert a @ whole.slip @ a == pytest.approx(alpha)
    assert a @ whole.level @ a - 2 * whole.target @ a + whole.count == pytest.approx(beta)
    both = Moments.from_pairs(f[:10], v[:10], 4) + Moments.from_pairs(f[10:], v[10:], 4)
    np.testing.assert_allclose(both.slip, whole.slip)
    np.testing.assert_allclose(both.target, whole.target)


@pytest.mark.parametrize("model", ("poly4-cvx", "quadratic"))
def test_the_program_agrees_with_another_solver(model):
    """Clarabel through the parametrization against SCS on the paper's own form: equations on Q, Q ⪰ eps I."""
    import cvxpy as cp

    from stablepush.identify.fit import POLYNOMIALS

    degree = POLYNOMIALS[model][0]
    loads, twists = pairs(25, 0.1)
    f, v = normalize_wrench(loads, RHO) / 5, unit(normalize_twist(twists, RHO))
    m = Moments.from_pairs(f, v, degree)
    quadratic = np.eye(len(m.target)) + 10 * m.slip + 10 * m.level
    ours = squared_program(degree).solve(quadratic, 10 * m.target)
    equations, targets = gram_equations(degree)
    a = cp.Variable(len(m.target))
    q = cp.Variable(equations.shape[1:], PSD=True)
    constraints = [cp.trace(e @ q) == t @ a for e, t in zip(equations, targets, strict=True)]
    constraints.append(q >> LEAST_EIGENVALUE * np.eye(q.shape[0]))
    problem = cp.Problem(cp.Minimize(cp.quad_form(a, cp.psd_wrap(quadratic)) - 20 * m.target @ a), constraints)
    problem.solve(solver=cp.SCS, eps=1e-8, max_iters=100_000)
    np.testing.assert_allclose(ours.coefficients, a.value, atol=2e-5 * np.abs(a.value).max())


@pytest.mark.parametrize("model", ("poly4-cvx", "poly6-cvx", "quadratic"))
def test_fits_are_certified_by_code_that_is_not_the_solver(model):
    fit = sp.fit_limit_surface(*pairs(20, 0.1), model, characteristic_length=RHO)
    assert fit.status == "optimal"
    assert fit.certificate is not None and fit.certificate.sos_convex
    # from scratch: the Gram matrix in the model's file proves convexity of the coefficients in the file
    entry = fit.surface.certificate
    gram = np.array(entry["gram"])
    equations, targets = gram_equations(fit.surface.degree)
    size = np.abs(fit.surface.coefficients).max()
    # the matrix was moved onto the equations by a sum of a few terms: what is left is rounding, some 1e-15 on any processor
    assert np.abs(np.tensordot(equations, gram, 2) - targets @ fit.surface.coefficients).max() < 1e-12 * size
    assert np.linalg.eigvalsh(gram)[0] == pytest.approx(entry["min_eigenvalue"])
    assert entry["min_eigenvalue"] > 0


def test_certificates_of_what_is_not_convex_fail():
    convex = power_form(np.random.default_rng(0).normal(size=(12, 3)), 4)
    gram = squared_program(4).solve(np.eye(15), convex).gram
    bent = convex.copy()
    bent[sp.monomial_exponents(4).tolist().index([2, 2, 0])] -= 40 * np.abs(convex).max()
    assert not sp.certify(bent, gram, 4).sos_convex
    # a right Gram matrix for other coefficients proves nothing about these
    assert not sp.certify(-convex, gram, 4).sos_convex


def test_exact_data_of_a_quadratic_are_recovered():
    truth = sp.PolynomialLimitSurface(power_form(np.random.default_rng(4).normal(size=(5, 3)), 2), 2, RHO)
    twists = random_twists(60, RHO)
    fit = sp.fit_limit_surface(truth.wrench(twists), twists, "quadratic", characteristic_length=RHO)
    other = random_twists(200, RHO, 8)
    error = angle_between(normalize_twist(fit.surface.twist(truth.wrench(other)), RHO), normalize_twist(other, RHO))
    assert np.degrees(error.max()) < 0.5
    np.testing.assert_allclose(fit.level_errors, 0, atol=0.01)


def test_quartic_beats_ellipsoid_on_three_feet():
    test_loads, test_twists = pairs(1000, seed=77)
    errors = {}
    for model in ("poly4-cvx", "poly4", "quadratic"):
        fit = sp.fit_limit_surface(*pairs(60), model, characteristic_length=RHO)
        slip = normalize_twist(fit.surface.twist(test_loads), RHO)
        errors[model] = np.degrees(angle_between(slip, normalize_twist(test_twists, RHO)).mean())
    assert errors["poly4-cvx"] < 0.8 * errors["quadratic"]
    assert errors["poly4"] < 0.8 * errors["quadratic"]


def test_fits_repeat_and_scale():
    loads, twists = pairs(20, 0.05)
    one = sp.fit_limit_surface(loads, twists, slider=triangle(), seed=3)
    two = sp.fit_limit_surface(loads, twists, slider=triangle(), seed=3)
    np.testing.assert_array_equal(one.surface.coefficients, two.surface.coefficients)
    assert one.surface.characteristic_length == pytest.approx(0.05)
    # a lighter slider has the same shape
    light = sp.fit_limit_surface(loads * 1e-3, twists * 7, slider=triangle(), seed=3)
    np.testing.assert_allclose(light.surface.twist(loads), one.surface.twist(loads), rtol=1e-4, atol=1e-6)
    assert light.surface.force_unit == "mu*N"
    assert np.abs(light.surface.coefficients).max() <= 1e6
    assert one.surface.force_unit == "N"


@pytest.mark.parametrize("newtons", [1e-3, 0.03, 0.3, 1.0, 1e3])
def test_models_of_any_force_are_read_again(newtons, tmp_path):
    """Coefficients grow with the inverse of the force to the fourth, their covariance, which may be left out, with its square."""
    loads, twists = pairs(20, 0.05)
    fitted = sp.fit_limit_surface(loads * newtons, twists, slider=triangle(), seed=3).surface
    sp.save_model(fitted, tmp_path / "model.json")
    again = sp.load_model(tmp_path / "model.json")
    np.testing.assert_allclose(again.twist(loads), fitted.twist(loads), rtol=1e-12)
    assert len(again.members()) == len(fitted.members()) > 0
    assert again.force_unit == ("N" if newtons > 1e-3 else "mu*N")
    # in newtons, or times the scale that the file has
    size = newtons if newtons > 1e-3 else newtons / again.provenance["force_scale_N"]
    ordinary = sp.fit_limit_surface(loads, twists, slider=triangle(), seed=3).surface
    np.testing.assert_allclose(again.wrench(twists), size * ordinary.wrench(twists), rtol=1e-3, atol=1e-4 * size)


def test_few_pairs_and_no_length_are_enough():
    loads, twists = pairs(3)
    fit = sp.fit_limit_surface(loads, twists)
    assert fit.validation_error is None
    assert fit.certificate is not None and fit.certificate.sos_convex
    assert 0.02 < fit.surface.characteristic_length < 0.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f, v: (f[:, :2], v), "shape"),
        (lambda f, v: (f[:3], v), "shape"),
        (lambda f, v: (f * np.nan, v), "finite"),
        (lambda f, v: (f * 0, v), "row 0 is zero"),
        (lambda f, v: (-f, v), "sign"),
        (lambda f, v: (f[:0], v[:0]), "at least one"),
    ],
)
def test_bad_pairs_are_refused(change, message):
    with pytest.raises(sp.InputError, match=message):
        sp.fit_limit_surface(*change(*pairs(6)))


def test_unknown_models_are_refused():
    with pytest.raises(sp.InputError, match="poly4-cvx"):
        sp.fit_limit_surface(*pairs(6), model="poly5")


def test_lab_pokes_are_fitted_as_well_as_published(lab):
    """Zhou et al. 2016, figure 5 over four arrangements: 12.6 deg (convex quartic), 14.9 deg (ellipsoid), 30 pokes of wood."""
    from stablepush.io.importers import find_sources, import_source

    (source,) = find_sources(lab / "raw/SlidingExpCode/FusionMatlab/RandPushExp/SensorLogs/wood_30_90_30_30_30_90")
    log, _ = import_source(source)
    loads, twists, _ = log.pairs()
    errors = {"poly4-cvx": [], "quadratic": []}
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(loads))
        train, test = order[:40], order[40:]
        for model, found in errors.items():
            fit = sp.fit_limit_surface(loads[train], twists[train], model, slider=log.rig.slider, seed=seed)
            slip = normalize_twist(fit.surface.twist(loads[test]), 0.05)
            found.append(angle_between(slip, normalize_twist(twists[test], 0.05)).mean())
    assert np.degrees(np.mean(errors["poly4-cvx"])) < 14.5
    assert np.mean(errors["poly4-cvx"]) < np.mean(errors["quadratic"])


def test_a_slider_makes_few_pokes_enough():
    """Five noisy pokes with the outline known beat twenty without, on other pokes of the same rig."""
    from stablepush.demo import demo_pokes

    log = demo_pokes(140)
    loads, twists, _ = log.pairs()
    rho = log.rig.slider.characteristic_length

    def error(count, slider):
        fit = sp.fit_limit_surface(loads[:count], twists[:count], slider=slider, characteristic_length=rho)
        assert fit.certificate is not None and fit.certificate.sos_convex
        return np.degrees(
            angle_between(normalize_twist(fit.surface.twist(loads[40:]), rho), normalize_twist(twists[40:], rho)).mean()
        )

    assert error(5, log.rig.slider) < 0.75 * error(5, None)
    assert error(5, log.rig.slider) < 1.3 * error(20, None)
    assert error(1, log.rig.slider) < 25


def test_pokes_that_contradict_the_slider_are_obeyed():
    """A support far outside the outline, and its centre off the origin: the prior is given up, and that is said."""
    feet = sp.SupportDistribution(((0.15, 0.15), (0.45, 0.15), (0.3, 0.45)), (0.2, 0.2, 0.6))
    truth = sp.IdealLimitSurface(feet, 5.0)
    twists = random_twists(60, 0.1)
    loads = truth.wrench(twists)
    with_slider = sp.fit_limit_surface(loads, twists, slider=triangle(), characteristic_length=0.3)
    without = sp.fit_limit_surface(loads, twists, characteristic_length=0.3)
    assert with_slider.prior_weight == 0
    assert any("contradict" in remark for remark in with_slider.warnings)
    np.testing.assert_allclose(with_slider.surface.coefficients, without.surface.coefficients, rtol=1e-6)


def test_a_centre_of_mass_at_a_corner_of_the_outline_is_no_prior():
    with pytest.raises(sp.InputError, match="centre of mass"):
        sp.Slider(triangle().vertices + 0.05)
    # hardly any pressure has its centre there
    far = sp.Slider(triangle().vertices + 0.05 - 1e-6)
    fit = sp.fit_limit_surface(*pairs(8), slider=far, characteristic_length=RHO)
    assert "not used as a prior" in fit.warnings[0]
    assert fit.pressures is None


def test_likely_pressures_have_the_centre_of_mass_and_the_outline():
    import shapely

    from stablepush.identify.pressure import PressureSampler

    loads, twists = pairs(12, 0.05)
    f, v = normalize_wrench(loads, RHO), unit(normalize_twist(twists, RHO))
    for pressures in (
        PressureSampler(triangle().vertices, count=200).prior(),
        PressureSampler(triangle().vertices, count=200).posterior(f, v, RHO),
    ):
        assert pressures.shares.shape == (200, 12)
        np.testing.assert_allclose(pressures.shares.sum(axis=1), 1)
        np.testing.assert_allclose((pressures.shares[..., None] * pressures.points).sum(axis=1), 0, atol=1e-7)
        loaded = pressures.shares > 0
        assert (loaded.sum(axis=1) >= 3).all()
        outline = shapely.buffer(triangle().polygon, 1e-12)
        assert shapely.contains_xy(outline, *pressures.points[loaded].T).all()
    # draws die out as the pokes come in, and those that are left move
    assert 5 < pressures.ancestors < 200 and 0.02 < pressures.acceptance < 0.9
    # the friction load of the rig, 5 N, is found within its scatter
    assert abs(np.median(pressures.loads) - 5) < 0.5


def test_sequential_sampling_agrees_with_plain_weights_where_those_work():
    """Two pokes leave thousands of plain weighted draws effective: means over both samples agree within their scatter."""
    from stablepush.identify.pressure import PressureSampler, _Pokes

    loads, twists = pairs(2, 0.05)
    f, v = normalize_wrench(loads, RHO), unit(normalize_twist(twists, RHO))
    prior = PressureSampler(triangle().vertices, count=20_000, seed=5).prior()
    scale, likelihood = _Pokes.of(f, v, RHO).weigh(prior, np.ones(20_000, dtype=bool))
    weights = np.exp(likelihood - likelihood.max())
    weights /= weights.sum()
    assert 1 / (weights**2).sum() > 2000
    posterior = PressureSampler(triangle().vertices, count=3000, seed=6).posterior(f, v, RHO)

    def gyration(p):
        return np.sqrt((p.shares * (p.points**2).sum(axis=-1)).sum(axis=1))

    for ours, plain in ((gyration(posterior), gyration(prior)), (posterior.loads, scale)):
        mean = (weights * plain).sum()
        spread = np.sqrt((weights * (plain - mean) ** 2).sum())
        assert abs(ours.mean() - mean) < 0.08 * spread
        assert ours.std() == pytest.approx(spread, rel=0.08)


def test_draws_are_weighed_as_the_formula_says():
    """Student errors of the load, mixed over the twists that a poke may have had; the scale by six turns of expectations."""
    from stablepush.identify.pressure import _SCATTER_WEIGHTS, LOAD_ERROR, PressureSampler, _Pokes, _scattered, predict_loads

    loads, twists = pairs(7, 0.05)
    f, v = normalize_wrench(loads, RHO), unit(normalize_twist(twists, RHO))
    prior = PressureSampler(triangle().vertices, count=50, seed=3).prior()
    possible = np.arange(50) != 17
    scales, likelihoods = _Pokes.of(f, v, RHO).weigh(prior, possible)
    at = _scattered(v)
    sizes = (f**2).sum(axis=1)[:, None]
    for d in np.flatnonzero(possible):
        predicted = predict_loads(prior.points[d : d + 1] / RHO, prior.shares[d : d + 1], at.reshape(-1, 3)).reshape(at.shape)
        scale = (predicted[:, 0] * f).sum() / (predicted[:, 0] ** 2).sum()
        for turn in range(6):
            miss = ((f[:, None] - scale * predicted) ** 2).sum(axis=2) / (LOAD_ERROR**2 * sizes)
            density = _SCATTER_WEIGHTS * (1 + miss / 4) ** -3.5
            if turn < 5:
                weight = density / density.sum(axis=1, keepdims=True) / (4 + miss) / sizes
                products, squares = (predicted * f[:, None]).sum(axis=2), (predicted**2).sum(axis=2)
                scale = (weight * products).sum() / (weight * squares).sum()
        assert scales[d] == pytest.approx(scale, rel=1e-9)
        assert likelihoods[d] == pytest.approx(np.log(density.sum(axis=1)).sum(), abs=1e-8)
    assert likelihoods[17] == -np.inf


def test_the_ensemble_is_convex_and_survives_the_file(tmp_path):
    fit = sp.fit_limit_surface(*pairs(10, 0.05), slider=triangle())
    surface = fit.surface
    assert surface.ensemble.shape == (50, 15)
    np.testing.assert_allclose(surface.covariance, np.cov(surface.ensemble, rowvar=False))
    assert np.linalg.eigvalsh(surface.covariance).min() > -1e-9 * np.abs(surface.covariance).max()
    twists = random_twists(300, RHO)
    for member in surface.members():
        member.wrench(twists)  # would say so if it were not convex
    sp.save_model(surface, tmp_path / "m.json")
    again = sp.load_model(tmp_path / "m.json")
    np.testing.assert_array_equal(again.ensemble, surface.ensemble)
    np.testing.assert_array_equal(again.covariance, surface.covariance)


def test_probability_is_the_share_of_the_ensemble():
    surface = sp.fit_limit_surface(*pairs(6, 0.1), slider=triangle()).surface
    contact = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.9)
    oracle = sp.StabilityOracle(surface, contact)
    cors = np.random.default_rng(0).uniform(-0.3, 0.3, size=(60, 2))
    from stablepush.geometry.planar import twist_from_cor

    twists = twist_from_cor(cors, 1)
    share = oracle.probability(twists)
    votes = sum(sp.StabilityOracle(m, contact).is_stable(twists).astype(float) for m in surface.members()) / 50
    np.testing.assert_allclose(share, votes)
    assert ((share > 0) & (share < 1)).any()
    # deep inside and far outside the members agree with the surface
    margin = oracle.margin(twists)
    assert (share[margin > 0.4] > 0.5).all() and (share[margin < -0.4] < 0.5).all()
    assert sp.StabilityOracle(sp.IdealLimitSurface(three_feet(), 1.0), contact).probability(twists) is None


def test_the_other_solver_takes_over(monkeypatch):

    loads, twists = pairs(8, 0.05)
    f, v = normalize_wrench(loads, RHO) / 5, unit(normalize_twist(twists, RHO))
    m = Moments.from_pairs(f, v, 4)
    program = SquaredProgram(4)
    quadratic, linear = np.eye(15) + 10 * m.slip + 10 * m.level, 10 * m.target
    expected = program.solve(quadratic, linear)
    monkeypatch.setattr(program, "_direct", lambda p, q: None)
    second = program.solve(quadratic, linear)
    assert second.status == "optimal (SCS)" and second.taken_over and not expected.taken_over
    np.testing.assert_allclose(second.coefficients, expected.coefficients, atol=1e-4)
    monkeypatch.setattr(program, "_attempt", lambda name, s: "failed")
    with pytest.raises(sp.SolverError, match="SCS"):
        program.solve(quadratic, linear)


def test_pairs_of_a_log_are_one_argument():
    loads, twists = pairs(12, 0.02)
    together = sp.SlipPairs(loads, twists, [str(i) for i in range(12)])
    apart = sp.fit_limit_surface(loads, twists, slider=triangle())
    np.testing.assert_array_equal(
        sp.fit_limit_surface(together, slider=triangle()).surface.coefficients, apart.surface.coefficients
    )
    with pytest.raises(sp.InputError, match="twists: expected none besides the pairs"):
        sp.fit_limit_surface(together, twists)
    with pytest.raises(sp.InputError, match="twists: expected slip twists"):
        sp.fit_limit_surface(loads)
