"""STABLE for every centre of mass in a box, against STABLE about each of many centres."""

import numpy as np
import pytest
from conftest import triangle
from hypothesis import given, settings, strategies as st

import stablepush as sp


def about(center, slider, contact, twists):
    """Which body twists STABLE accepts if the centre of mass is at ``center`` (2,) in B."""
    moved = twists.copy()
    moved[:, :2] += twists[:, 2:] * (-center[1], center[0])
    there = sp.PushContact(contact.points - center, contact.normals, contact.mu)
    return sp.lynch_mason_region(sp.Slider(slider.vertices - center), there).contains_twists(moved)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 0.006), st.floats(0.0, 0.006), st.floats(0.3, 0.9), st.integers(0, 2), st.integers(0, 1000))
def test_stable_with_a_box_is_stable_for_every_centre_in_it(wide, high, mu, edge, seed):
    slider = triangle()
    length = float(np.linalg.norm(np.subtract(*slider.edge(edge))))
    contact = sp.PushContact.on_edge(slider, edge, length / 2, 0.7 * length, mu)
    rng = np.random.default_rng(seed)
    region = sp.lynch_mason_region(slider, contact, com_tolerance=(wide, high))
    # ahead and turning about CORs beside the contact, where the region is; some straight
    turns = rng.normal(size=(3000, 3)) * (0.3, 0.3, 1.0)
    turns[::10, 2] = 0.0
    twists = turns + np.append(contact.normals[0], 0.0)
    inside = region.contains_twists(twists)
    corners = np.array([(x, y) for x in (-wide, wide) for y in (-high, high)])
    centers = np.concatenate((corners, rng.uniform((-wide, -high), (wide, high), size=(20, 2))))
    everywhere = np.all([about(center, slider, contact, twists) for center in centers], axis=0)
    assert not (inside & ~everywhere).any()
    # what is given up is little: |z|² beside |p|² in one of the conditions
    assert (everywhere & ~inside).sum() <= 0.01 * everywhere.sum() + 1
    # and it is a part of what holds for every pressure
    held = np.flatnonzero(inside)[:200]
    if len(held):
        promised = sp.all_pressure_region(slider, contact, com_tolerance=(wide, high))
        assert promised.contains_twists(twists[held]).all()


def test_a_point_is_a_box_of_no_size():
    slider = triangle()
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.05, 0.5)
    twists = np.random.default_rng(0).normal(size=(5000, 3)) / (1, 1, slider.characteristic_length)
    sure, box = sp.lynch_mason_region(slider, contact), sp.lynch_mason_region(slider, contact, com_tolerance=(0.0, 0.0))
    np.testing.assert_array_equal(sure.contains_twists(twists), box.contains_twists(twists))
    np.testing.assert_array_equal(sure.translations, box.translations)


def test_a_centre_of_mass_outside_of_the_support_is_refused():
    slider = triangle()
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.05, 0.5)
    with pytest.raises(sp.InputError, match="centre of mass, with its tolerance"):
        sp.lynch_mason_region(slider, contact, com_tolerance=0.2)
    for tolerance in (-0.001, np.nan, (1, 2, 3), "wide"):
        with pytest.raises(sp.InputError, match="com_tolerance"):
            sp.lynch_mason_region(slider, contact, com_tolerance=tolerance)
