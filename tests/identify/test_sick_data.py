"""Data that cannot be right, or that leave the surface open: an error, or a remark that says why."""

import numpy as np
import pytest
from conftest import RHO, pairs, triangle

import stablepush as sp


def warnings(f, v, **options):
    return " ".join(sp.fit_limit_surface(f, v, characteristic_length=RHO, **options).warnings)


def test_good_data_give_no_remark():
    assert warnings(*pairs(20, 0.02)) == ""
    assert warnings(*pairs(3, 0.02), slider=triangle()) == ""


def test_fewer_pairs_than_needed():
    assert "4 different loads do not determine the surface, 5 are needed" in warnings(*pairs(4, 0.02))
    assert "10 are needed" in warnings(*pairs(6, 0.02), model="poly6-cvx")


def test_repeated_pairs():
    f, v = pairs(8, 0.02)
    said = warnings(np.tile(f, (3, 1)), np.tile(v, (3, 1)))
    assert "16 of 24 pairs repeat" in said
    assert "1 different loads" in warnings(np.repeat(f[:1], 10, axis=0), np.repeat(v[:1], 10, axis=0))


def test_all_in_one_plane():
    f, v = pairs(30)
    f[:, 2] *= 1e-4
    v[:, 2] *= 1e-4
    assert "nearly in one plane" in warnings(f, v)


@pytest.mark.parametrize(
    ("f", "v", "message"),
    [
        ((1, 1, 1000), (1, 1, 1), "N·mm"),
        ((1, 1, 1), (1000, 1000, 1), "mm/s"),
    ],
)
def test_units_off_by_a_thousand_are_refused(f, v, message):
    loads, twists = pairs(20, 0.02)
    with pytest.raises(sp.InputError, match=message):
        sp.fit_limit_surface(loads * f, twists * v, slider=triangle())


def test_kilonewtons_are_noticed():
    loads, twists = pairs(20, 0.02)
    for factor in (1e-3, 1e3):
        assert "forces in N" in warnings(loads * factor, twists, slider=triangle())


@pytest.mark.parametrize("factor", (1e-50, 1e-3, 300.0, 1e5))
@pytest.mark.parametrize("slider", (None, triangle()))
def test_a_load_of_another_size_is_left_out(factor, slider):
    f, v = pairs(20, 0.02)
    f[6] *= factor
    fit = sp.fit_limit_surface(f, v, slider=slider, characteristic_length=RHO)
    assert "1 of 20 pairs are left out, the first of them number 6" in fit.warnings[0]
    assert fit.pair_weights[6] == 0 and (np.delete(fit.pair_weights, 6) > 0).all()
    rest = sp.fit_limit_surface(np.delete(f, 6, axis=0), np.delete(v, 6, axis=0), slider=slider, characteristic_length=RHO)
    assert np.mean(np.delete(fit.angle_errors, 6)) < 1.5 * np.mean(rest.angle_errors)


def test_what_is_not_used_is_said_or_refused():
    f, v = pairs(8, 0.02)
    for options in ({"model": "poly4"}, {"model": "quadratic"}, {"model": "gp"}, {"loss": "norm"}, {"loss": "published"}):
        assert "of the slider it uses only the characteristic length" in warnings(f, v, slider=triangle(), **options)
        with pytest.raises(sp.InputError, match="com_tolerance"):
            sp.fit_limit_surface(f, v, slider=triangle(), com_tolerance=0.01, **options)


@pytest.mark.parametrize(
    "options", ({"seed": -1}, {"seed": 1.5}, {"seed": "x"}, {"slider": np.zeros((3, 2))}, {"validation_indices": [[1], [2, 3]]})
)
def test_wrong_types_are_refused(options):
    with pytest.raises(sp.InputError, match=next(iter(options))):
        sp.fit_limit_surface(*pairs(8), characteristic_length=RHO, **options)


def test_a_setting_without_solution_is_passed_over(monkeypatch):
    from stablepush.identify import estimator

    solve = estimator.SquaredLoss.solve

    def sometimes(self, part, weights):
        if weights.eta1 == 1000.0:
            raise sp.SolverError("no")
        return solve(self, part, weights)

    monkeypatch.setattr(estimator.SquaredLoss, "solve", sometimes)
    fit = sp.fit_limit_surface(*pairs(10), characteristic_length=RHO)
    assert fit.weights["eta1"] != 1000.0


def test_pairs_against_the_motion():
    f, v = pairs(20, 0.02)
    f[:4] *= -1
    assert "4 of 20 pairs have F·V < 0" in warnings(f, v)


@pytest.mark.parametrize("model", ("poly4-cvx", "poly6-cvx", "poly4", "quadratic", "gp"))
@pytest.mark.parametrize("slider", (None, triangle()))
def test_the_sickest_data_still_give_a_surface(model, slider):
    """One pair, the same pair ten times, pairs along one line: finite predictions, certified where that is claimed."""
    f, v = pairs(1)
    line = np.array(((1.0, 0, 0), (2.0, 0, 0), (-1.0, 0, 0)))
    for loads, twists in ((f, v), (np.repeat(f, 10, axis=0), np.repeat(v, 10, axis=0)), (line, line)):
        fit = sp.fit_limit_surface(loads, twists, model, slider=slider, characteristic_length=RHO)
        assert np.isfinite(fit.surface.twist([[1.0, 2.0, 0.05]])).all()
        if slider is None or "cvx" not in model:
            assert fit.warnings
        if fit.certificate is not None:
            assert fit.certificate.sos_convex
