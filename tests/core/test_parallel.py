"""The same numbers wherever work is done; cross-validation of models, which is such work."""

import os
import time

import numpy as np
import pytest
from conftest import LOAD, pressure, triangle

import stablepush as sp
from stablepush.core import one_blas_thread


def power(base, exponent):
    if exponent < 0:
        raise ValueError(f"no {exponent}")
    return base**exponent, os.getpid()


def leave_a_file(folder, name, seconds):
    time.sleep(seconds)
    (folder / name).write_text("done", encoding="utf-8")
    return name


def factor(matrix):
    """An answer that hangs on the order in which linear algebra adds."""
    return np.linalg.svd(matrix @ matrix.T)[1]


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("dask.distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as found:
        yield found.scheduler_address


def test_results_come_in_the_order_of_the_jobs():
    jobs = [(base, 3) for base in range(20)]
    here = list(sp.run_parallel(power, jobs))
    there = list(sp.run_parallel(power, jobs, 2))
    assert [value for value, _ in here] == [value for value, _ in there] == [base**3 for base in range(20)]
    assert {process for _, process in here} == {os.getpid()}
    assert os.getpid() not in {process for _, process in there}


def test_results_out_of_order_are_all_there():
    found = [value for value, _ in sp.run_parallel(power, [(base, 2) for base in range(20)], 2, in_order=False)]
    assert sorted(found) == [base**2 for base in range(20)]


def test_numbers_do_not_depend_on_the_place(cluster):
    rng = np.random.default_rng(0)
    jobs = [(rng.normal(size=(120, 120)),) for _ in range(4)]
    # equal to the last digit: workers have one thread each, wherever they are on this machine; this process may have more
    here = np.array(list(sp.run_parallel(factor, jobs, 2)))
    assert np.array_equal(here, list(sp.run_parallel(factor, jobs, scheduler=cluster)))
    np.testing.assert_allclose(list(sp.run_parallel(factor, jobs, 1)), here, rtol=1e-12)


@pytest.mark.parametrize("in_order", (True, False))
def test_a_cluster_does_the_work(cluster, in_order):
    found = list(sp.run_parallel(power, [(base, 2) for base in range(6)], scheduler=cluster, in_order=in_order))
    assert sorted(value for value, _ in found) == [base**2 for base in range(6)]
    assert not in_order or [value for value, _ in found] == [base**2 for base in range(6)]
    assert os.getpid() not in {process for _, process in found}
    with pytest.raises(ValueError, match="no -1"):
        list(sp.run_parallel(power, [(2, -1)], scheduler=cluster))


def test_work_within_work_goes_its_own_way(cluster):
    """Two at a time, one on a cluster and one here, and others of joblib: none changes where another runs."""
    import joblib

    there = sp.run_parallel(power, [(base, 1) for base in range(4)], scheduler=cluster)
    here = sp.run_parallel(power, [(base, 1) for base in range(4)], 2)
    assert next(there)[0] == next(here)[0] == 0
    there.close()
    assert [value for value, _ in here] == [1, 2, 3]
    assert joblib.Parallel(n_jobs=2)(joblib.delayed(abs)(-k) for k in range(3)) == [0, 1, 2]


def test_an_error_is_passed_on():
    with pytest.raises(ValueError, match="no -1"):
        list(sp.run_parallel(power, [(2, 1), (2, -1)], 2))


def test_leaving_early_ends_the_work(tmp_path):
    jobs = [(tmp_path, str(k), 0.0 if k == 0 else 0.4) for k in range(40)]
    work = sp.run_parallel(leave_a_file, jobs, 2)
    assert next(work) == "0"
    work.close()
    left = len(list(tmp_path.iterdir()))
    time.sleep(1.5)
    # what was under way may end, the rest is never begun
    assert len(list(tmp_path.iterdir())) <= left + 4 < 40


def test_nothing_to_do():
    assert list(sp.run_parallel(power, [], 2)) == []


@pytest.mark.parametrize(("options", "words"), [({"processes": 0}, "processes"), ({"scheduler": "tcp://127.0.0.1:1"}, "no Dask")])
def test_bad_options_are_refused_at_once(options, words):
    with pytest.raises(sp.InputError, match=words):
        sp.run_parallel(power, [(1, 1)], **options)


def pokes(count, seed=0):
    rng = np.random.default_rng(seed)
    surface = sp.IdealLimitSurface(pressure(), LOAD)
    twists = rng.normal(size=(count, 3)) / (1, 1, surface.characteristic_length)
    return surface.wrench(twists) * rng.normal(1, 0.02, (count, 1)), twists


def test_cross_validation_is_what_a_loop_over_folds_gives():
    loads, twists = pokes(12)
    found = sp.cross_validate(loads, twists, ["quadratic"], characteristic_length=0.05, folds=12, repeats=1, seed=3)
    for row in range(12):
        train = np.arange(12) != row
        fit = sp.fit_limit_surface(loads[train], twists[train], "quadratic", characteristic_length=0.05, seed=3)
        scale = (1, 1, 0.05)
        one, other = (v * scale / np.linalg.norm(v * scale) for v in (fit.surface.twist(loads[row]), twists[row]))
        assert found.errors[0, row] == pytest.approx(np.arccos(min(1.0, one @ other)), abs=1e-7)
    assert found.best == "quadratic" and found.behind("quadratic") == (0.0, 0.0)


def test_cross_validation_tells_the_better_model_and_is_the_same_everywhere(cluster):
    loads, twists = pokes(24)
    options = {"slider": triangle(), "repeats": 2, "seed": 1}
    said = []
    here = sp.cross_validate(loads, twists, ["quadratic", "poly4-cvx"], **options, progress=lambda *n: said.append(n))
    assert said[0] == (1, 20) and said[-1] == (20, 20)
    # facets of support points are no ellipsoid
    assert here.best == "poly4-cvx"
    more, half = here.behind("quadratic")
    assert more > half > 0
    for place in ({"processes": 2}, {"scheduler": cluster}):
        there = sp.cross_validate(loads, twists, ["quadratic", "poly4-cvx"], **options, **place)
        # solvers end 1e-8 of their objective apart at most, wherever they run; angles of the fits then agree to this
        np.testing.assert_allclose(there.errors, here.errors, atol=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"models": ["poly5"]}, "models"),
        ({"models": []}, "models"),
        ({"folds": 1}, "folds"),
        ({"folds": 9}, "folds"),
        ({"folds": 2.5}, "folds"),
        ({"repeats": "3"}, "repeats"),
        ({"repeats": 0}, "repeats"),
        ({"seed": -1}, "seed"),
    ],
)
def test_bad_cross_validations_are_refused(options, words):
    with pytest.raises(sp.InputError, match=words):
        sp.cross_validate(*pokes(8), **options)


def test_one_thread_of_blas_within_and_as_many_as_before_after():
    from threadpoolctl import threadpool_info

    def threads():
        return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]

    before = threads()
    with pytest.raises(ValueError, match="left early"), one_blas_thread():
        assert threads() == [1] * len(before)
        raise ValueError("left early")
    assert threads() == before
