"""Work in threads: every item once, results in order, errors are raised and end the work."""

import threading
import time

import numpy as np
import pytest

from stablepush.core import in_threads, parallel


@pytest.fixture(autouse=True)
def four_cores(monkeypatch):
    monkeypatch.setattr(parallel, "usable_cores", lambda: 4)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 1000])
def test_every_item_is_worked_on_once_and_results_keep_their_order(count):
    done = []

    def square(item):
        done.append(item)
        return item * item

    assert in_threads(square, range(count)) == [item * item for item in range(count)]
    assert sorted(done) == list(range(count))


def test_several_threads_work_and_the_calling_one_is_among_them():
    seen = set()
    together = threading.Barrier(4, timeout=20)

    def work(_):
        seen.add(threading.get_ident())
        together.wait()

    in_threads(work, range(4))
    assert len(seen) == 4
    assert threading.get_ident() in seen


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_an_error_is_raised_and_ends_the_work(kind):
    done, before = [], threading.active_count()

    def work(item):
        if item == 3:
            raise kind("item 3")
        done.append(item)
        time.sleep(0.002)

    with pytest.raises(kind, match="item 3"):
        in_threads(work, range(400))
    assert len(done) < 400
    assert threading.active_count() == before


def test_threads_within_threads_end():
    assert in_threads(lambda a: sum(in_threads(lambda b: a * b, range(5))), range(5)) == [10 * a for a in range(5)]


def test_an_interrupt_comes_before_errors_of_the_function():
    together = threading.Barrier(4, timeout=20)

    def work(item):
        together.wait()
        raise KeyboardInterrupt if item == 3 else ValueError

    with pytest.raises(KeyboardInterrupt):
        in_threads(work, range(4))


def test_threads_have_the_settings_of_the_calling_one():
    with np.errstate(divide="raise"):
        assert in_threads(lambda _: np.geterr()["divide"], range(40)) == ["raise"] * 40
