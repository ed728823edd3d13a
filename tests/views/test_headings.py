import math

import numpy as np
import pytest

import stablepush as sp
from stablepush.effects import KnownEffect
from stablepush.geometry import normalize_wrench, twist_from_cor
from stablepush.views.plot import plot_headings

SLOPE = np.array((0.06, -0.03))
FEET = sp.SupportDistribution([(-0.03, -0.03), (0.06, -0.02), (-0.03, 0.05)], [1, 1, 1])


def problem(*effects):
    slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)], mass=1.2)
    contact = sp.PushContact.on_edge(slider, edge=0, center=0.075, width=0.06, mu=0.5)
    surface = sp.IdealLimitSurface(FEET, 3.5)
    known = [KnownEffect(sp.parse_effect(text), None) for text in effects]
    return sp.PlanningProblem(
        slider, surface, [contact], (0.3, 0.3, 0.0), (1.0, 0.6, 1.0), bounds=(0, 0, 1.5, 1.0), effects=known
    )


def test_what_is_filled_is_held_at_that_heading():
    """Against the load of the push written out: friction less the weight's pull along the slope."""
    here = problem(f"tilt:slope={SLOPE[0]}/{SLOPE[1]}")
    shown = plot_headings(here, headings=4, extent=0.4)
    assert shown.shape == (2, 2)
    rng, rho = np.random.default_rng(0), here.surface.characteristic_length
    cone = here.contacts[0].cone(rho)
    cors, compared = rng.uniform(-0.39, 0.39, (400, 2)), 0
    for number, axes in enumerate(shown.ravel()):
        c, s = math.cos(number * math.pi / 2), math.sin(number * math.pi / 2)
        pull = 1.2 * 9.81 * np.array((c * SLOPE[0] + s * SLOPE[1], -s * SLOPE[0] + c * SLOPE[1]))
        filled = [found for found in axes.collections if found.get_fill() and len(found.get_facecolor())]
        for sense, drawn in zip((1, -1), filled, strict=True):
            load = here.surface.wrench(twist_from_cor(cors, sense))
            load[:, :2] -= pull
            margin = cone.margin(normalize_wrench(load, rho))
            inside = np.any([path.contains_points(cors) for path in drawn.get_paths()], axis=0)
            # a grid of 5 mm draws the border
            clear = np.abs(margin) > 0.05
            assert (inside[clear] == (margin[clear] > 0)).all()
            compared += int(clear.sum())
    assert compared > 1000


def test_without_effects_there_is_nothing_to_draw():
    with pytest.raises(sp.InputError, match="effects that change which pushes"):
        plot_headings(problem())
    with pytest.raises(sp.InputError, match="contact: expected 0 to 0"):
        plot_headings(problem("tilt:slope=0.05/0"), contact=1)
