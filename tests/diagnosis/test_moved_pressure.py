"""A pressure that has moved or widened in no form of the catalogue: what is said of it, and the surface that plans get."""

import numpy as np
import pytest
from conftest import FORCES, edited, make_log

import stablepush as sp

OUTLINE = np.array([(-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)])
LOAD = 3.0
GRID = np.stack(np.meshgrid(*[np.arange(-0.045, 0.05, 0.01)] * 2), axis=-1).reshape(-1, 2)
#: Most of the load on a patch beside the centre.
PATCH = np.where(np.hypot(*(GRID - (0.025, 0.015)).T) < 0.02, 3.0, 0.3)
CENTER = PATCH @ GRID / PATCH.sum()


def patch_log(drop=()):
    """A log of a rig that is believed to press evenly, and its true surface."""
    slider = sp.Slider(OUTLINE, mass=0.8, support=sp.SupportDistribution(GRID, np.ones(len(GRID))))
    surface = sp.IdealLimitSurface(sp.SupportDistribution(GRID, LOAD * PATCH / PATCH.sum()), LOAD)
    rig = sp.VirtualRig(slider, surface, 0.5, sp.Pusher.finger(0.005), [], sp.Noise(0.02, 1e-4, 1e-3))
    log = rig.execute(sp.random_pushes(slider, rig.pusher, 30, seed=0), seed=0).log
    return edited(log, drop=drop, support_friction=LOAD / (0.8 * 9.81)), surface


def error_deg(surface, true):
    """Mean angle between the loads of two surfaces, for twists all round."""
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
    # beside a pressure that may be any other, a shift of all of it alike has no size of its own: that of the centre is told
    offset = report.ranking[0].parameters["offset"]
    np.testing.assert_allclose(offset.estimate, CENTER, atol=4e-3)
    low, high = np.transpose(offset.ci95)
    assert (low <= CENTER).all() and (CENTER <= high).all()
    # plans get the refitted pressure with what is uncertain of it
    surface = report.corrected[0].surface
    errors = [error_deg(member, surface) for member in surface.members()]
    assert error_deg(surface, true) < most_deg
    assert error_deg(surface, true) < 3 * np.median(errors)


def test_without_forces_the_surface_of_a_named_form_is_uncertain_too():
    log = edited(make_log("pressure-spread:scale=0.7", seed=3), drop=FORCES)
    report = sp.diagnose(log)
    assert report.named == ["pressure-spread"], report.sentence
    surface = report.corrected[0].surface
    points, center = log.rig.slider.support.points, log.rig.slider.support.center
    true = sp.IdealLimitSurface(sp.SupportDistribution(center + 0.7 * (points - center), log.rig.slider.support.weights), LOAD)
    errors = [error_deg(member, surface) for member in surface.members()]
    assert error_deg(surface, true) < min(2.0, 3 * np.median(errors))
