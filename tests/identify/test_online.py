import numpy as np
import pytest
from conftest import RHO, pairs, three_feet

import stablepush as sp
from stablepush.geometry.planar import angle_between, normalize_twist, normalize_wrench, unit
from stablepush.identify.estimator import sphere_power
from stablepush.identify.moments import Moments
from stablepush.identify.program import squared_program
from stablepush.surfaces.monomials import bombieri_norms


def test_an_update_is_the_fit_to_all_pokes_with_faded_weights():
    f, v = pairs(12, 0.05)
    follower = sp.OnlineIdentifier(RHO, forgetting_factor=0.8, eta1=7.0, eta2=3.0)
    for load, twist in zip(f, v, strict=True):
        estimate = follower.update(load, twist)
    loads = normalize_wrench(f, RHO)
    sizes = np.log(np.linalg.norm(loads, axis=1))
    log_scale, effective_sample_size = np.median(sizes[:5]), (1 - 0.8**5) / 0.2
    for size in sizes[5:]:
        effective_sample_size = 1 + 0.8 * effective_sample_size
        log_scale += (size - log_scale) / effective_sample_size
    scale = np.exp(log_scale)
    assert np.exp(sizes).max() < 1.5 * scale  # none so large that it loses weight
    moments = Moments.from_pairs(loads / scale, unit(normalize_twist(v, RHO)), 4, 0.8 ** np.arange(11, -1, -1))
    norms = bombieri_norms(4)
    quadratic, linear = np.diag(norms) + 7 * moments.slip + 3 * moments.level, norms * sphere_power(4) + 3 * moments.target
    whole = squared_program(4).solve(quadratic, linear).coefficients / scale**4
    # one program, solved from the same numbers to 1e-15 of them: the solver's own tolerance of 1e-8 is the difference
    np.testing.assert_allclose(estimate.surface.coefficients, whole, rtol=1e-6, atol=1e-7 * np.abs(whole).max())
    assert estimate.effective_sample_size == pytest.approx((1 - 0.8**12) / 0.2)


@pytest.mark.parametrize("options", ({"forgetting_factor": 0.9}, {"method": "projected-gradient"}))
def test_a_change_is_followed_and_every_surface_is_certified(options):
    rigs = (
        sp.IdealLimitSurface(three_feet(), 5.0, RHO),
        sp.IdealLimitSurface(sp.SupportDistribution(((0.06, 0.02), (-0.05, -0.03), (-0.02, 0.05)), (1, 1, 1)), 4.0, RHO),
    )
    rng = np.random.default_rng(0)
    follower = sp.OnlineIdentifier(RHO, **options)
    asked = unit(rng.normal(size=(200, 3))) / (1, 1, RHO)
    errors = []
    for i in range(80):
        rig = rigs[i >= 40]
        twist = unit(rng.normal(size=3)) / (1, 1, RHO)
        estimate = follower.update(rig.wrench(twist), twist)
        assert estimate.certificate.sos_convex
        gram = np.array(estimate.surface.certificate["gram"])
        assert sp.certify(estimate.surface.coefficients, gram, 4).sos_convex
        slip = normalize_twist(estimate.surface.twist(rig.wrench(asked)), RHO)
        errors.append(np.degrees(angle_between(slip, normalize_twist(asked, RHO)).mean()))
    assert errors[39] < 0.7 * errors[0]
    assert errors[79] < 0.7 * errors[40]


def test_neither_the_first_poke_nor_a_bad_one_rules_for_ever():
    f, v = pairs(40, 0.02)
    plain, other = sp.OnlineIdentifier(RHO), sp.OnlineIdentifier(RHO)
    for i, (load, twist) in enumerate(zip(f, v, strict=True)):
        one = plain.update(load, twist)
        two = other.update(load * (3.0 if i == 0 else 1.0), twist)
        if i == 5:
            for bad in (load * 1e200, load * np.nan, load * 0):
                with pytest.raises(sp.InputError):
                    other.update(bad, twist)
    test_f, test_v = pairs(100, seed=8)

    def error(surface):
        return angle_between(normalize_twist(surface.twist(test_f), RHO), normalize_twist(test_v, RHO)).mean()

    assert error(two.surface) < 1.5 * error(one.surface)
    sizes = [(which.surface.value(test_f) ** 0.25).mean() for which in (one, two)]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.15)


def test_surfaces_of_tiny_loads_can_be_written_and_read(tmp_path):
    f, v = pairs(3)
    with pytest.warns(sp.StablepushWarning, match="too small for coefficients of degree 4 in N"):
        estimate = sp.OnlineIdentifier(RHO).update(f[0] * 1e-4, v[0])
    assert estimate.surface.force_unit == "mu*N"
    sp.save_model(estimate.surface, tmp_path / "m.json")
    np.testing.assert_array_equal(sp.load_model(tmp_path / "m.json").coefficients, estimate.surface.coefficients)


def test_surprise_is_the_error_of_the_surface_before():
    f, v = pairs(5, 0.05)
    follower = sp.OnlineIdentifier(RHO)
    before = None
    for load, twist in zip(f, v, strict=True):
        estimate = follower.update(load, twist)
        if before is not None:
            expected = angle_between(normalize_twist(before.twist(load), RHO), normalize_twist(twist, RHO))
            assert estimate.innovation == pytest.approx(float(expected), abs=1e-6)
        before = estimate.surface


@pytest.mark.parametrize(
    "make",
    (
        lambda: sp.OnlineIdentifier(0.0),
        lambda: sp.OnlineIdentifier(RHO, forgetting_factor=1.5),
        lambda: sp.OnlineIdentifier(RHO, forgetting_factor=0.0),
        lambda: sp.OnlineIdentifier(RHO, method="guess"),
        lambda: sp.OnlineIdentifier(RHO, degree=3),
        lambda: sp.OnlineIdentifier(RHO).update((0, 0, 0), (1, 0, 0)),
        lambda: sp.OnlineIdentifier(RHO).update((1, 0, np.nan), (1, 0, 0)),
        lambda: sp.OnlineIdentifier(RHO).update([(1, 0, 0)], [(1, 0, 0)]),
    ),
)
def test_bad_input_is_refused(make):
    with pytest.raises(sp.InputError):
        make()
