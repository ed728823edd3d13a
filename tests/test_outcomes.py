"""What is decided does not hang on last bits: of problems that are turned as a whole, or mirrored, or at rest but for rounding.

``make test-cpu`` runs ``outcomes.py`` as other processors would; here every case stands in one run beside its like.
"""

import itertools

import numpy as np
import outcomes
import pytest
from conftest import three_feet
from hypothesis import given, strategies as st
from stablepush_planners.dubins import dubins_lengths

import stablepush as sp
from stablepush.core.arrays import first_least, order_with_ties
from stablepush.geometry.se2 import compose, exp, wrap_angle


def by_problem(found):
    """What was decided by the name of the problem, without its turn."""
    groups = itertools.groupby(sorted(found.items()), key=lambda item: item[0].partition(", heading")[0])
    return {name: [decided for _, decided in items] for name, items in groups}


@pytest.mark.parametrize("part", (outcomes.plans, outcomes.pushes))
def test_turned_problems_have_the_same_answer(part):
    for name, decided in by_problem(part()).items():
        assert all(one == decided[0] for one in decided), name


def test_symmetric_contacts_stand_in_the_order_of_the_edges():
    found = outcomes.contacts()
    for name, ranked in found.items():
        if name.startswith("square"):
            middle = [edge for edge, center, width in ranked if center == 0.05 and width == ranked[0][2]]
            assert middle == [0, 1, 2, 3], name
    assert found["fingers on the ends of an edge"] == [0, 1, 2, 3]


def test_residues_do_not_decide_what_is_refused():
    """What is as good as nothing is refused, or taken, like nothing at all."""
    for name, decided in itertools.groupby(sorted(outcomes.refusals().items()), key=lambda item: item[0].rpartition(", ")[0]):
        if name:
            assert len({words for _, words in decided}) == 1, name
    spread = {name: words for name, words in outcomes.refusals().items() if name.startswith("spread")}
    assert [name for name, words in spread.items() if words == "taken"] == ["spread 1e-1", "spread 1e-6"]


def test_a_log_at_rest_has_no_pairs():
    assert outcomes.pushes()["pairs of a log at rest"] == 0


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=20), st.floats(1e-12, 1e-9))
def test_alike_values_keep_their_order(values, tolerance):
    noise = np.random.default_rng(len(values)).uniform(-tolerance / 4, tolerance / 4, size=(2, len(values)))
    # far apart, or alike
    rounded = np.round(values, 3)
    first, second = (order_with_ties(rounded + part, tolerance).tolist() for part in noise)
    assert first == second == np.argsort(rounded, kind="stable").tolist()
    assert first_least(rounded + noise[0], tolerance) == int(np.argmin(rounded))


def test_values_that_are_none_come_last():
    assert order_with_ties([np.inf, 1.0, np.inf, 0.5], 1e-9).tolist() == [3, 1, 0, 2]
    assert first_least([np.nan, 2.0, 1.0, 1.0 - 1e-12], 1e-9) == 2


def test_half_a_turn_is_to_the_left():
    for angle in (np.pi, -np.pi, -np.pi + 1e-12, np.pi - 1e-12, 3 * np.pi, -3 * np.pi + 1e-12):
        assert wrap_angle(angle) == pytest.approx(np.pi, abs=1e-9)
    assert wrap_angle(-np.pi + 1e-6) == pytest.approx(-np.pi + 1e-6, abs=1e-12)


@pytest.mark.parametrize("sign", (1.0, -1.0))
def test_a_goal_on_a_tightest_turn_is_reached_by_that_turn(sign):
    """The circles of the first and the last turn are then one, to rounding."""
    rng = np.random.default_rng(0)
    lengths = np.empty((6, 3))
    for _ in range(500):
        start, angle, radius = rng.uniform(-3, 3, 3), rng.uniform(0.01, 6.0), rng.uniform(0.01, 2.0)
        goal = compose(start, exp((radius * angle, 0.0, sign * angle)))
        dubins_lengths(*start, *goal, radius, lengths)
        assert lengths.sum(axis=1).min() == pytest.approx(angle, abs=1e-6)


def test_mirrored_pressures_break_a_straight_push_alike():
    """Two points hold the worst pressure of a push through the centre of a square, whichever way it is turned."""
    for angle in outcomes.TURNS:
        c, s = np.cos(angle), np.sin(angle)
        slider = sp.Slider(outcomes.SQUARE.vertices @ ((c, s), (-s, c)), 1.0)
        contact = sp.PushContact.on_edge(slider, 3, 0.05, 0.05, 0.5)
        worst = sp.worst_pressure(slider, contact, (*contact.normals[0], 0.0))
        assert len(worst.points) == 2
        assert worst.shares.sum() == pytest.approx(1.0)


def test_cells_of_a_polygon_carry_what_they_cover():
    """Slivers that rounding leaves along a slanted edge are no support points."""
    support = sp.SupportDistribution.from_polygon(outcomes.triangle().vertices, 0.01)
    assert support.weights.min() > 1e-6
    with pytest.raises(sp.InputError, match="two different points"):
        sp.IdealLimitSurface(sp.SupportDistribution(three_feet().points, (1.0, 1e-30, 1e-30)), 1.0)
