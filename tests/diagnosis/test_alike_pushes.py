"""Pushes that are all alike: errors of the believed surface are alike in them, too, and look like causes."""

import numpy as np
import pytest
from conftest import edited

import stablepush as sp

FEET = sp.SupportDistribution(
    np.array(((10, 8), (112, 8), (108, 34), (30, 84), (8, 82), (45, 30))) / 1000 - (0.0482353, 0.0332353),
    (0.25453, 0.17201, 0.11303, 0.09203, 0.13841, 0.22999),
)
OUTLINE = sp.Slider.centered(np.array(((0, 0), (120, 0), (120, 40), (40, 40), (40, 90), (0, 90))) / 1000).vertices
SLIDER, NOISE = sp.Slider(OUTLINE, 1.2, FEET), sp.Noise(0.05, 1e-4, 1.75e-3)
#: What many readings leave of that noise in each row.
MEAN = sp.Noise(0.012, 3e-5, 4e-4)


def surface():
    return sp.IdealLimitSurface(FEET, 0.3 * 9.81 * 1.2)


def fitted(seed):
    """A surface from 25 pokes."""
    finger = sp.VirtualRig(SLIDER, surface(), 0.45, sp.Pusher.finger(0.006), [], NOISE)
    pokes = finger.execute(sp.random_pushes(SLIDER, finger.pusher, 25, seed=seed, groups=0), rows=12, seed=seed).log
    return sp.fit_limit_surface(pokes.pairs(), slider=sp.Slider(OUTLINE, 1.2)).surface


def log_of(seed, effects=()):
    """Twelve pushes of two fingers on one edge, straight ahead or in wide arcs, at any heading."""
    rng = np.random.default_rng(seed)
    pushes = []
    for _ in range(12):
        arc = rng.uniform(-0.35, 0.35) / 0.1
        cor = None if abs(arc) < 0.3 else (-1 / arc, -0.0332)
        place = (*rng.uniform(-0.2, 0.2, 2), rng.uniform(-np.pi, np.pi))
        push = sp.EdgePush.on_edge(
            SLIDER, 0, 0.048, width=0.052, cor=cor, sense=np.nan if cor is None else float(np.sign(arc)), distance=0.1,
            speed=float(rng.uniform(0.01, 0.07)), start=place,
        )  # fmt: skip
        pushes.append(push)
    two = sp.VirtualRig(SLIDER, surface(), 0.45, sp.Pusher.two_fingers(0.052, 0.006), list(effects), MEAN)
    return two.execute(pushes, rows=12, seed=seed).log


@pytest.mark.parametrize("noise", (NOISE, MEAN), ids=("noise of a reading", "noise of a mean"))
@pytest.mark.parametrize("seed", range(4))
def test_errors_of_a_fitted_surface_are_no_cause(seed, noise):
    """The surface of 25 pokes is a few degrees off, in all of these pushes alike. A grain of the slider fits that, and a plan
    that reckons with such a grain loses the object."""
    believed = edited(log_of(seed), noise=noise, model=fitted(seed), slider=sp.Slider(OUTLINE, 1.2))
    report = sp.diagnose(believed)
    assert report.verdict in ("none", "absorbed"), report.sentence


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "effect", ("tilt:slope=0.05/0.02", "force-rotation:angle=0.2", "latency:delay=0.08", "speed-dependence:slope=0.1")
)
def test_causes_are_found_beside_them(effect, seed):
    log = log_of(seed, [sp.parse_effect(effect)])
    report = sp.diagnose(edited(log, noise=NOISE, model=fitted(seed), slider=sp.Slider(OUTLINE, 1.2)))
    assert report.named == [effect.split(":")[0]], report.sentence


@pytest.mark.parametrize("seed", range(3))
def test_errors_of_an_even_pressure_are_no_grain_and_no_fault_of_a_sensor(seed):
    report = sp.diagnose(edited(log_of(seed), noise=NOISE, support_friction=None, slider=sp.Slider(OUTLINE, 1.2)))
    assert set(report.named) <= {"pressure-spread", "pressure-shift"}, report.sentence


def first_of(log, count):
    """The first pushes of a log."""
    names = [str(name) for name in log.trials["trial"]][:count]
    rows = np.isin(np.asarray(log.samples["trial"], dtype=str), names)
    trials = {key: np.asarray(values)[:count] for key, values in log.trials.items()}
    return sp.PushLog(log.rig, trials, {key: np.asarray(values)[rows] for key, values in log.samples.items()})


def test_too_few_pushes_are_told_and_how_much_friction_there_is():
    log = log_of(1, [sp.parse_effect("tilt:slope=0.06/-0.04")])
    believed = edited(log, noise=NOISE, model=fitted(1), slider=sp.Slider(OUTLINE, 1.2))
    report = sp.diagnose(first_of(believed, 4))
    assert report.verdict == "unknown"
    assert "4 pushes with forces are too few to name a cause of the table or the sensors: 7 are needed." in report.sentence
    stronger = sp.diagnose(edited(log_of(1), noise=NOISE, slider=SLIDER, support_friction=0.25))
    assert stronger.verdict == "absorbed"
    assert "3.53 N in all, a coefficient of 0.3, 20 % more than believed" in stronger.sentence
