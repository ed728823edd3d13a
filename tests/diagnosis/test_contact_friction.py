"""Friction of the fingers from made-up forces whose truth is known."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import t as student

from stablepush.diagnosis.search.contact_friction import P_SLIP, _density, _Model, _share, friction_of
from stablepush.diagnosis.search.finger_forces import FingerForces

COUNT = 60


def forces_of(mu, rng, slipping=0.2, creeping=0.2, error=0.012, count=COUNT):
    """Trials in random order of their ratios: fingers slip at the friction ``mu`` (count,), stick or creep below it."""
    order = np.linspace(0, 1, count)
    slips = rng.random(count) < slipping
    creeps = ~slips & (rng.random(count) < creeping)
    below = rng.uniform(0, 1, count) * mu
    errors = error * rng.uniform(0.5, 2.0, count)
    true = np.where(slips | (creeps & (rng.random(count) < 0.5)), mu, below)
    return FingerForces(np.arange(count), order, slips, creeps, true + errors * rng.normal(size=count), errors)


def test_the_friction_of_the_rig_is_not_put_in_doubt():
    """Three hundred logs whose fingers have the nominal friction, with few and with many that slip: no name."""
    rng, alarms = np.random.default_rng(0), 0
    for slipping in (0.0, 0.05, 0.2, 0.5):
        for count in (8, 30, 60, 100):
            for _ in range(20):
                nominal = rng.uniform(0.2, 0.8)
                found = friction_of(forces_of(np.full(count, nominal), rng, slipping, count=count), nominal)
                alarms += found is not None and found.p_value < P_SLIP
    assert alarms == 0


@pytest.mark.parametrize("nominal", [0.35, 0.7])
def test_another_friction_is_found_and_its_interval_holds(nominal):
    rng, held = np.random.default_rng(1), 0
    for _ in range(100):
        found = friction_of(forces_of(np.full(COUNT, 0.5), rng), nominal)
        assert found is not None and found.p_value < P_SLIP
        held += found.interval[0] <= 0.5 <= found.interval[1]
        assert found.estimate == pytest.approx(0.5, abs=0.06)
    # a nominal 95 %; binomial, one in a thousand
    assert held >= 87


def test_friction_that_changes_over_the_log():
    rng, held = np.random.default_rng(2), 0
    for _ in range(40):
        mu = np.linspace(0.1, 0.5, COUNT)
        found = friction_of(forces_of(mu, rng), 0.5)
        assert found is not None and found.p_value < P_SLIP and found.form is not None
        last, error = found.last
        assert last == found.at(1.0) and abs(last - 0.5) < max(4 * error, 0.04)
        held += abs(found.change - 0.4) < 2 * found.change_error
        assert found.beside(0.5) == pytest.approx([found.estimate - 0.5, found.change])
    assert held >= 34
    # one that stays is not said to change
    assert friction_of(forces_of(np.full(COUNT, 0.3), rng), 0.5).form is None


def test_fingers_that_stick_show_a_friction_that_is_higher():
    """Forces outside of the believed cone, with no finger that slips: three show it, two do not."""
    ratios = np.concatenate((np.linspace(0.0, 0.35, 30), (0.5, 0.52, 0.55)))
    n, sticks = len(ratios), np.zeros(len(ratios), dtype=bool)

    def found(kept):
        rows = np.arange(n)[:kept]
        return friction_of(FingerForces(rows, rows / n, sticks[:kept], sticks[:kept], ratios[:kept], np.full(kept, 0.012)), 0.36)

    assert found(n - 1) is None
    higher = found(n)
    assert higher is not None and higher.p_value < P_SLIP and higher.estimate > 0.5
    assert higher.form is None and 0.45 < higher.interval[0] < higher.estimate < higher.interval[1]


def test_slip_the_wrong_way_round_is_noise():
    rng = np.random.default_rng(3)
    for _ in range(50):
        n = 40
        signs = rng.choice((-1.0, 1.0), n)
        forces = FingerForces(
            np.arange(n), np.linspace(0, 1, n), np.arange(n) % 5 == 0, np.zeros(n, dtype=bool),
            np.where(np.arange(n) % 5 == 0, signs, 1.0) * rng.uniform(0.05, 0.45, n), np.full(n, 0.01),
        )  # fmt: skip
        found = friction_of(forces, 0.5)
        assert found is None or found.p_value >= P_SLIP


def test_too_few_trials_tell_nothing():
    none = np.zeros(2, dtype=bool)
    assert (
        friction_of(FingerForces(np.arange(2), np.array((0.0, 1.0)), ~none, none, np.full(2, 0.2), np.full(2, 0.01)), 0.6) is None
    )
    # without a friction to compare it with, there is an estimate and no name
    rng = np.random.default_rng(4)
    found = friction_of(forces_of(np.full(COUNT, 0.4), rng), None)
    assert found is not None and found.p_value == 1.0 and found.estimate == pytest.approx(0.4, abs=0.03)


def test_density_is_of_students_distribution_and_its_best_is_the_best():
    z = np.linspace(-9, 9, 101)
    assert _density(z) == pytest.approx(student.pdf(z, 4), abs=1e-15)
    assert _share(z) == pytest.approx(student.cdf(z, 4), abs=1e-14)
    rng = np.random.default_rng(5)
    for changes in (False, True):
        model = _Model(forces_of(np.linspace(0.3, 0.45, COUNT), rng), 0.6)
        best = model.best(changes)

        def worse(x, model=model, changes=changes):
            return -float(model.posterior(np.array((x[0], x[1] if changes else 0.0, np.exp(x[2])))))

        other = minimize(worse, (best[0], best[1], np.log(best[2])), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-8})
        assert float(model.posterior(best)) >= -other.fun - 0.1
        assert best[0] == pytest.approx(other.x[0], abs=5e-3)


def test_the_order_of_trials_in_the_table_changes_nothing():
    rng = np.random.default_rng(6)
    forces = forces_of(np.linspace(0.2, 0.5, COUNT), rng)
    mixed = rng.permutation(COUNT)
    other = FingerForces(*(getattr(forces, name)[mixed] for name in ("trial", "order", "slips", "creeps", "ratio", "error")))
    a, b = friction_of(forces, 0.5), friction_of(other, 0.5)
    assert a is not None and b is not None
    assert (a.estimate, a.change, a.trials) == pytest.approx((b.estimate, b.change, b.trials), abs=1e-9)


def test_trials_agree_if_all_that_move_give_one_friction_and_none_sticks_beyond_it():
    def agree(moving, sticking):
        ratio = np.array((*moving, *sticking))
        moves = np.arange(len(ratio)) < len(moving)
        return FingerForces(np.arange(len(ratio)), ratio, ~moves & False, moves, ratio, ratio).agree

    assert agree((0.3, 0.31), (0.29,)) and not agree((0.3, 0.31), (0.5,))
    assert not agree((0.3, 0.5), ()) and not agree((-0.3,), ()) and not agree((), (0.3,))


@pytest.mark.parametrize("true", [0.012, 2.2])
def test_friction_that_is_very_low_or_high(true):
    rng = np.random.default_rng(7)
    for nominal in (true, None, 0.5):
        found = friction_of(forces_of(np.full(COUNT, true), rng, error=0.002), nominal)
        assert found is not None and found.estimate == pytest.approx(true, abs=0.06 * true + 0.004)
        assert found.form is None and found.interval[0] <= found.estimate <= found.interval[1]
        assert (found.p_value < P_SLIP) == (nominal == 0.5)


def test_friction_that_scatters_from_push_to_push_is_no_other_friction():
    """Sticking trials are judged by the greatest ratio that they hold: where friction scatters, slipping trials decide."""
    rng, alarms = np.random.default_rng(8), 0
    for _ in range(150):
        mu = np.maximum(0.4 + 0.06 * rng.normal(size=COUNT), 0.05)
        found = friction_of(forces_of(mu, rng, slipping=0.25), 0.4)
        alarms += found is not None and found.p_value < P_SLIP
    assert alarms <= 1


def test_fingers_that_creep_under_any_load_do_not_show_where_they_slip():
    """Soft contacts: ten of sixty pushes creep, most of them at a load far below that of the one that slips."""
    crept = np.array((0.345, 0.311, 0.272, 0.268, 0.228, 0.227, 0.223, 0.210, 0.111, -0.016))
    ratios = np.concatenate((crept, [0.317], np.random.default_rng(0).uniform(0.0, 0.15, 49)))
    creeps, slips = np.arange(60) < 10, np.arange(60) == 10
    order = np.random.default_rng(1).permutation(60) / 59
    forces = FingerForces(np.arange(60), order, slips, creeps, ratios, np.full(60, 0.012))
    assert friction_of(forces, 0.439) is None
    # where those that creep agree they do
    alike = np.where(creeps, 0.3 + 0.01 * np.arange(60) / 10, ratios)
    assert friction_of(FingerForces(np.arange(60), order, slips, creeps, alike, np.full(60, 0.012)), 0.439).p_value < 1e-3
