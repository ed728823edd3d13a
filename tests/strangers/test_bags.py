"""What strangers do to the streams of a bag."""

import numpy as np
import pytest

from stablepush.core import InputError
from stablepush.io.importers.streams import Stream, on_one_clock, without_leaps


def streams(**changes):
    t = 1.7e9 + 0.01 * np.arange(1000)
    poses = np.column_stack((np.linspace(0, 1, 1000), np.zeros(1000), np.linspace(0, 7, 1000)))
    given = {"what": "topics.pose (/box)", "t": t, "values": poses, "turning": 2} | changes
    return Stream(**given), Stream("topics.force (/ft)", t, np.ones((1000, 3)))


@pytest.mark.parametrize("step", [0.02, 0.3, 2.0])
@pytest.mark.parametrize("at", [1, 500, 999])
def test_a_clock_that_goes_back_is_refused(step, at):
    t = 1.7e9 + 0.01 * np.arange(1000)
    t[at:] -= step
    with pytest.raises(InputError, match=r"topics\.pose \(/box\): expected stamps that grow, they go back by .* s after 17"):
        streams(t=t)


def test_a_stamp_that_stands_twice_counts_once():
    t = np.repeat(1.7e9 + 0.01 * np.arange(500), 2)
    pose, force = streams(t=t)
    clock, (poses, _), notes = on_one_clock([pose, force], None, 0.25)
    assert len(clock) == len(poses) == 500 and any("covers" in words for words in notes)


@pytest.mark.parametrize(("first", "last"), [(0, 300), (700, 1000), (200, 600)])
def test_a_topic_that_covers_a_part_is_named(first, last):
    pose, force = streams()
    part = Stream("topics.tip (/tip)", pose.t[first:last], pose.values[first:last])
    _, _, notes = on_one_clock([pose, force, part], None, 0.25)
    (words,) = notes
    lost = 0.01 * (1000 - (last - first))
    assert words.startswith(f"topics.tip (/tip) covers {0.01 * (last - first - 1):.3g} of 9.99 s: {lost:.3g} s")


@pytest.mark.parametrize("lost", [[0], [999], [3, 4, 700], list(range(100, 400))])
@pytest.mark.parametrize("rate", [None, 20.0])
def test_samples_without_numbers_are_missing_values(lost, rate):
    pose, force = streams()
    values = pose.values.copy()
    values[lost] = np.nan
    broken, _ = streams(values=values)
    clock, (whole, _), _ = on_one_clock([pose, force], rate, 0.25)
    again, (found, forces), notes = on_one_clock([broken, force], rate, 0.25)
    assert again == pytest.approx(clock)
    known = np.isfinite(found).all(axis=1)
    # means over a bin are those of what is known of it
    assert found[known] == pytest.approx(whole[known], abs=1e-6 if rate is None else 0.05)
    assert np.isfinite(forces).all()
    assert notes == [f"topics.pose (/box): {len(lost)} of 1000 samples are no numbers: missing values"]


def test_a_stream_of_nothing_is_refused():
    with pytest.raises(InputError, match="expected a sample of finite numbers, got none in 1000"):
        streams(values=np.full((1000, 3), np.nan))


def test_a_topic_of_one_message_is_named():
    pose = Stream("topics.pose (/box)", np.arange(100) / 50, np.zeros((100, 3)))
    with pytest.raises(InputError, match=r"topics\.force \(/ft\): expected at least two samples, got 1"):
        on_one_clock([pose, Stream("topics.force (/ft)", np.array([1.0]), np.ones((1, 3)))], None, 0.25)


def test_leaps_are_left_out_before_streams_are_brought_to_one_clock():
    """Means over several samples would spread a spike, and the edges of what a lost tracker says, over their neighbours."""
    t = np.arange(1000) / 200
    moving = np.column_stack((0.01 * t, 0.3 + 0.0 * t, 0.2 + 0.02 * t))
    rng = np.random.default_rng(0)
    seen = moving + rng.normal(0, 1e-5, size=moving.shape)
    seen[400:460] = 0.0
    force = np.column_stack((2.0 + 0.0 * t, 0.0 * t, 0.0 * t)) + rng.normal(0, 0.02, size=(1000, 3))
    force[700] += 50.0
    pose, of_pose = without_leaps(Stream("topics.pose (/box)", t, seen, 2), 0.05)
    pull, of_force = without_leaps(Stream("topics.force (/ft)", t, force))
    clock, (poses, forces), notes = on_one_clock([pose, pull], 50.0, 0.25)
    assert of_pose == ["topics.pose (/box): the tracker leaps away and back once, 2 s after the first row: 60 poses are left out"]
    assert of_force == ["topics.force (/ft): the force leaps away and back once, 3.5 s after the first row: 1 force is left out"]
    # and no second line says so
    assert notes == []
    known = np.isfinite(poses).all(axis=1)
    assert 14 <= (~known).sum() <= 16
    assert np.abs(poses[known] - np.column_stack([np.interp(clock[known], t, column) for column in moving.T])).max() < 1e-4
    assert np.abs(forces[:, 0] - 2.0).max() < 0.1
