"""A pressure that has moved, but not all of it alike: its centre, and the corrected surface."""

import numpy as np
import pytest
from conftest import FORCES, edited, make_log

import stablepush as sp

OUTLINE = np.array([(-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)])
LOAD = 3.0
GRID = np.stack(np.meshgrid(*[np.arange(-0.045, 0.05, 0.01)] * 2), axis=-1).reshape(-1, 2)


def patch(center, radius, beside):
    """Loads of the grid: 3 within a radius (m) of a place, and less beside; and their centre."""
    loads = np.where(np.hypot(*(GRID - center).T) < radius, 3.0, beside)
    return loads, loads @ GRID / loads.sum()


#: Most of the load on a patch beside the centre.
PATCH, CENTER = patch((0.025, 0.015), 0.02, 0.3)


def patch_log(drop=(), loads=PATCH):
    """A log whose rig states an even pressure, and the true surface."""
    slider = sp.Slider(OUTLINE, mass=0.8, support=sp.SupportDistribution(GRID, np.ones(len(GRID))))
    surface = sp.IdealLimitSurface(sp.SupportDistribution(GRID, LOAD * loads / loads.sum()), LOAD)
    rig = sp.VirtualRig(slider, surface, 0.5, sp.Pusher.finger(0.005), [], sp.Noise(0.02, 1e-4, 1e-3))
    log = rig.execute(sp.random_pushes(slider, rig.pusher, 30, seed=0), seed=0).log
    return edited(log, drop=drop, support_friction=LOAD / (0.8 * 9.81)), surface


def error_deg(surface, true):
    """Mean angle (deg) between the loads of two surfaces at random twists."""
    length = true.characteristic_length
    twists = np.random.default_rng(0).normal(size=(300, 3)) / (1, 1, length)
    a, b = (surface.wrench(twists) / (1, 1, length) for surface in (surface, true))
    cosines = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    return float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean())


@pytest.mark.parametrize(("drop", "most_deg"), (((), 1.5), (("fx", "fy", "tau"), 7.0)))
def test_a_patch_moves_the_pressure(drop, most_deg):
    log, true = patch_log(drop)
    report = sp.diagnose(log)
    assert report.named == ["pressure-shift"], report.sentence
    offset = report.ranking[0].parameters["offset"]
    np.testing.assert_allclose(offset.estimate, CENTER, atol=4e-3)
    low, high = np.transpose(offset.ci95)
    assert (low <= CENTER).all() and (CENTER <= high).all()
    # that surface holds the shift
    assert report.effects_beside == {}
    # the surface and the effects of the report make the true one together
    if not drop:
        support = report.surface.support
        both = sp.SupportDistribution(support.points + report.effects["pressure-shift"]["offset"], support.weights)
        assert error_deg(sp.IdealLimitSurface(both, report.surface.friction_load), true) < 4.0
    surface = report.corrected[0].surface
    errors = [error_deg(member, surface) for member in surface.members()]
    assert error_deg(surface, true) < most_deg
    assert error_deg(surface, true) < 3 * np.median(errors)


def test_a_centre_of_pressure_is_told_inside_the_slider():
    """All but a tenth of the load on a small patch near a corner, without forces: a shift that fits best leaves the slider."""
    loads, center = patch((0.035, 0.03), 0.015, 0.02)
    log, _ = patch_log(FORCES, loads)
    report = sp.diagnose(log)
    assert report.named == ["pressure-shift"], report.sentence
    offset = report.ranking[0].parameters["offset"]
    assert (np.abs(offset.estimate) < 0.05).all()
    low, high = np.transpose(offset.ci95)
    assert (low <= center).all() and (center <= high).all()


def test_without_forces_the_surface_of_a_named_form_is_uncertain_too():
    log = edited(make_log("pressure-spread:scale=0.7", seed=3), drop=FORCES)
    report = sp.diagnose(log)
    assert report.named == ["pressure-spread"], report.sentence
    surface = report.corrected[0].surface
    points, center = log.rig.slider.support.points, log.rig.slider.support.center
    true = sp.IdealLimitSurface(sp.SupportDistribution(center + 0.7 * (points - center), log.rig.slider.support.weights), LOAD)
    errors = [error_deg(member, surface) for member in surface.members()]
    assert error_deg(surface, true) < min(2.0, 3 * np.median(errors))
