import numpy as np
import pytest
import shapely
from conftest import surface_zoo, three_feet, triangle

import stablepush as sp
from stablepush.geometry.planar import twist_from_cor
from stablepush.views.plot.regions import plot_contacts, plot_margins, plot_regions, plot_twist_sphere

FEET = sp.IdealLimitSurface(three_feet(), 5.0)


@pytest.mark.parametrize("measure", ("area", "tightest-turn", "margin"))
def test_the_best_contact_comes_first(measure):
    ranked = sp.rank_contacts(triangle(), FEET, 0.6, measure=measure, widths=(0.03, 0.06), places=4)
    assert len(ranked) == 3 * 2 * 4
    values = [{"area": -c.area, "tightest-turn": c.tightest_turn, "margin": -c.margin}[measure] for c in ranked]
    # contacts that are as good as each other to 1e-6 stand in the order of the edges
    finite = np.array(values)[np.isfinite(values)]
    assert np.isinf(values[len(finite) :]).all()
    assert (np.diff(finite) >= -1e-6 * np.abs(finite).max()).all()
    assert np.isfinite(values[0])
    for choice in (ranked[0], ranked[-1]):
        region = sp.stable_region(FEET, choice.contact)
        assert choice.area == pytest.approx(region.solid_angle())
        nearest = region.tightest_turn(1)
        assert choice.tightest_left == (np.inf if nearest is None else pytest.approx(np.linalg.norm(nearest)))
        again = sp.PushContact.on_edge(triangle(), choice.edge, choice.center, choice.width, 0.6)
        np.testing.assert_allclose(again.points, choice.contact.points)


def test_the_margin_is_of_the_worst_of_three_pushes():
    (choice,) = sp.rank_contacts(triangle(), FEET, 0.6, measure="margin", widths=0.05, places=1, edges=[0], turn_radius=0.5)
    oracle = sp.StabilityOracle(FEET, choice.contact)
    angles = np.linspace(0, np.pi, 2001)
    ways = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    left = 0.5 * np.stack((-ways[:, 1], ways[:, 0]), axis=-1)
    pushes = (np.column_stack((ways, 0 * angles)), twist_from_cor(left, 1), twist_from_cor(-left, -1))
    best = np.min([oracle.margin(p) for p in pushes], axis=0).max()
    assert choice.margin == pytest.approx(best, abs=1e-3)


def test_without_a_surface_the_all_pressure_region_is_ranked():
    ranked = sp.rank_contacts(triangle(), None, 0.6, widths=(0.06,), places=2, edges=[0, 2])
    assert len(ranked) == 4 and ranked[0].margin is None
    known = sp.all_pressure_region(triangle(), ranked[0].contact)
    assert ranked[0].area == pytest.approx(known.solid_angle())
    with pytest.raises(sp.InputError, match="margin"):
        sp.rank_contacts(triangle(), None, 0.6, measure="margin")


def test_bad_requests_are_named():
    for word, changes in (
        ("measure", {"measure": "beauty"}),
        ("widths", {"widths": -0.01}),
        ("widths", {"widths": 9.0}),
        ("places", {"places": 0}),
        ("edge", {"edges": [3]}),
        ("turn_radius", {"turn_radius": 0.0}),
    ):
        with pytest.raises(sp.InputError, match=word):
            sp.rank_contacts(triangle(), FEET, 0.6, **changes)


def test_pictures_show_what_they_are_given():
    contact = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.9)
    builders = (sp.all_pressure_region, sp.lynch_mason_region)
    promised = [build(triangle(), contact, characteristic_length=FEET.characteristic_length) for build in builders]
    regions = [sp.stable_region(FEET, contact), *promised]
    texts = [text.get_text() for text in plot_regions(regions, contact, triangle()).figure.legends[0].get_texts()]
    assert {"model, clockwise", "all-pressure", "conservative", "slider"} <= set(texts)
    assert any(text.startswith("tightest turn, clockwise") for text in texts)
    sphere = plot_twist_sphere(regions)
    assert len(sphere) == 2
    # the filled patch of each disc has the area of the region
    for axes, sense in zip(sphere, (1, -1), strict=True):
        outline = axes.patches[0].get_path().to_polygons()[0]
        area = 0.5 * abs(np.dot(outline[:-1, 0], outline[1:, 1]) - np.dot(outline[:-1, 1], outline[1:, 0]))
        assert area == pytest.approx(regions[0].disc(sense).area, rel=1e-3)
    chart = plot_margins(FEET, contact, regions, direction=np.pi / 2)
    line = next(line for line in chart.lines if line.get_label() == "margin")
    middle = np.degrees(float(sp.StabilityOracle(FEET, contact).margin((0.0, 1.0, 0.0))))
    assert np.interp(0.0, *line.get_data()) == pytest.approx(middle)
    ranked = sp.rank_contacts(triangle(), FEET, 0.6, widths=(0.03, 0.06), places=3)
    dots = plot_contacts(triangle(), ranked).collections[0]
    assert len(dots.get_offsets()) == len(ranked)
    with pytest.raises(sp.InputError, match="characteristic length"):
        plot_twist_sphere([regions[0], sp.lynch_mason_region(triangle(), contact)])
    with pytest.raises(sp.InputError, match="measure"):
        plot_contacts(triangle(), ranked, "beauty")
    curve = sp.stable_region(surface_zoo()["quartic"], sp.PushContact([(0.0, -0.05)], [(0, 1)], 0.6))
    assert plot_regions([curve], contact).lines


def test_pictures_go_into_axes_that_are_given():
    """Two pictures side by side in a figure of the user's, with legends of their own."""
    from matplotlib.figure import Figure

    contact = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.9)
    regions = [sp.stable_region(FEET, contact)]
    left, right = Figure(figsize=(12, 6)).subplots(1, 2)
    assert plot_regions(regions, contact, triangle(), ax=left) is left
    assert plot_margins(FEET, contact, regions, ax=right) is right
    assert left.get_legend() is not None and left.lines and right.lines
    pair = Figure(figsize=(12, 6)).subplots(1, 2)
    assert list(plot_twist_sphere(regions, ax=pair)) == list(pair)
    with pytest.raises(sp.InputError, match="ax: expected 2 axes, got 1"):
        plot_twist_sphere(regions, ax=left)


def test_fingers_that_have_no_room_are_left_out():
    """Against discs cut with the outline: an L whose inner corner is nearer than a finger is thick."""
    slider = sp.Slider.centered([(0, 0), (0.16, 0), (0.16, 0.05), (0.05, 0.05), (0.05, 0.13), (0, 0.13)])
    surface, radius = sp.IdealLimitSurface(sp.SupportDistribution(slider.vertices, np.ones(6)), 5.0), 0.01
    ranked = sp.rank_contacts(slider, surface, 0.6, widths=(0.015, 0.03), places=7)
    thick = sp.rank_contacts(slider, surface, 0.6, widths=(0.015, 0.03), places=7, finger_radius=radius)

    def has_room(one):
        discs = [shapely.Point(*center).buffer(radius, 64) for center in one.contact.points - radius * one.contact.normals]
        return (
            all(disc.intersection(slider.polygon).area < 1e-6 for disc in discs) and discs[0].intersection(discs[1]).area < 1e-6
        )

    expected = [(one.edge, one.center, one.width) for one in ranked if has_room(one)]
    assert [(one.edge, one.center, one.width) for one in thick] == expected
    assert 0 < len(thick) < len(ranked) and {one.width for one in thick} == {0.03}
    # fingers beside the inner corner are among those that are left out
    assert any(one.edge in (2, 3) and one.width == 0.03 for one in ranked if (one.edge, one.center, one.width) not in expected)
    with pytest.raises(sp.InputError, match="finger_radius"):
        sp.rank_contacts(slider, surface, 0.6, finger_radius=0.1)
