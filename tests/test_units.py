"""Results do not depend on the unit of length: the same object in metres, a thousand times as small, and as large."""

import numpy as np
import pytest
from conftest import small_scene

import stablepush as sp

SCALES = (1e-3, 0.03, 30.0, 1e3)
OUTLINE = np.array(((-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)))
FEET = np.array(((-0.03, -0.04), (0.07, -0.04), (-0.03, 0.06)))
FORCE = 4.0


def slider(s):
    return sp.Slider(s * OUTLINE, 1.2, sp.SupportDistribution(s * FEET, (1, 2, 1.5)))


def contact(s):
    return sp.PushContact.on_edge(slider(s), 0, s * 0.06, s * 0.05, 0.6)


def ideal(s):
    return sp.IdealLimitSurface(slider(s).support, FORCE)


def pokes(s, count=12):
    """Noisy pairs of another pressure; the same directions in every unit."""
    rng = np.random.default_rng(0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(s * OUTLINE, s * 0.03), FORCE)
    twists = rng.normal(size=(count, 3)) / (1, 1, surface.characteristic_length)
    return surface.wrench(twists) * rng.normal(1, 0.03, (count, 1)), twists


def twists_of(surface):
    return np.random.default_rng(1).normal(size=(60, 3)) / (1, 1, surface.characteristic_length)


@pytest.mark.parametrize("s", SCALES)
@pytest.mark.parametrize("kind", ("ideal", "quartic"))
def test_loads_margins_and_regions(s, kind):
    def made(s):
        return ideal(s) if kind == "ideal" else sp.fit_limit_surface(*pokes(s), slider=slider(s)).surface

    here, there = made(1.0), made(s)
    assert there.characteristic_length == pytest.approx(s * here.characteristic_length)
    loads = there.wrench(twists_of(there))
    # a fit goes through a solver, whose tolerance both have for themselves
    close = {"rtol": 1e-9, "atol": 1e-9} if kind == "ideal" else {"rtol": 1e-4, "atol": 1e-4}
    np.testing.assert_allclose(loads / (1, 1, s), here.wrench(twists_of(here)), **close)
    margins = [sp.StabilityOracle(a, contact(b)).margin(twists_of(a)) for a, b in ((here, 1.0), (there, s))]
    np.testing.assert_allclose(margins[1], margins[0], **close)
    for sense in (1, -1):
        areas = [
            sum(p.area for p in sp.stable_region(a, contact(b)).polygons(sense, 0.5 * b)) / b**2
            for a, b in ((here, 1.0), (there, s))
        ]
        assert areas[1] == pytest.approx(areas[0], rel=1e-3 if kind == "quartic" else 1e-6)


@pytest.mark.parametrize("s", SCALES)
def test_conservative_regions(s):
    for region in (sp.lynch_mason_region, sp.all_pressure_region):
        for sense in (1, -1):
            areas = [sum(p.area for p in region(slider(b), contact(b)).polygons(sense, 0.5 * b)) / b**2 for b in (1.0, s)]
            assert areas[1] == pytest.approx(areas[0], rel=1e-6)


@pytest.mark.parametrize("s", SCALES)
def test_slides_and_pushes(s):
    here = sp.simulate_free_sliding(ideal(1.0), slider(1.0), (0.3, 0.1, 2.0), samples=5)
    # forces stay: a mass of 1/s decelerates s times as fast, over s times the way
    lighter = sp.Slider(s * OUTLINE, 1.2 / s, slider(s).support)
    slide = sp.simulate_free_sliding(ideal(s), lighter, (0.3 * s, 0.1 * s, 2.0), samples=5)
    np.testing.assert_allclose(slide.poses[-1] / (s, s, 1), here.poses[-1], rtol=1e-6, atol=1e-7)
    assert slide.t[-1] == pytest.approx(here.t[-1], rel=1e-6)
    traces = [
        sp.simulate_push(
            ideal(b), slider(b), sp.Pusher.finger(0.005 * b), 0.5, (0, 0, 0), (0.01 * b, -0.06 * b, np.pi / 2),
            [((0.02 * b, 0, 0), 2.0)], step=5e-4 * b,
        )
        for b in (1.0, s)
    ]  # fmt: skip
    np.testing.assert_allclose(traces[1].poses[-1] / (s, s, 1), traces[0].poses[-1], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("s", (0.01, 100.0))
def test_plans(s):
    one = small_scene()
    other = sp.PlanningProblem(
        sp.Slider(s * one.slider.vertices, one.slider.mass),
        sp.PolynomialLimitSurface(one.surface.coefficients, one.surface.degree, s * one.surface.characteristic_length)
        if isinstance(one.surface, sp.PolynomialLimitSurface)
        else sp.IdealLimitSurface(
            sp.SupportDistribution(s * one.surface.support.points, one.surface.support.weights), one.surface.friction_load
        ),
        [sp.PushContact(s * c.points, c.normals, c.mu) for c in one.contacts],
        one.start * (s, s, 1), one.goal * (s, s, 1), [s * o for o in one.obstacles],
        None if one.bounds is None else s * one.bounds, None if one.pusher is None else s * one.pusher,
        tuple(np.array(one.tolerance) * (s, 1)), s * one.speed, one.switch_cost, one.min_margin,
        sp.Uncertainty(contact_place=s * 0.002, center_of_mass=s * 0.001),
    )  # fmt: skip
    here, there = sp.plan(one, refinement_budget=0), sp.plan(other, refinement_budget=0)
    assert here.solved and there.solved and sp.check_plan(other, there).valid
    # the lattice is laid in metres of the object's size
    assert there.duration == pytest.approx(here.duration, rel=0.02)
    assert there.min_margin == pytest.approx(here.min_margin, abs=0.02)
