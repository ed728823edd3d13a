"""Logs without forces: pushes carried out again, and what their ends tell."""

import math

import numpy as np
import pytest
from conftest import FORCES, LOAD, MASS, check_schema, edited, make_log, make_rig, pressure, triangle

import stablepush as sp
from stablepush.diagnosis.likelihood.building import log_model
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.nominal import Nominal
from stablepush.diagnosis.likelihood.prior import MovedPressure
from stablepush.diagnosis.likelihood.replay import _knots, friction_of, pose_errors, replays
from stablepush.diagnosis.pipeline import gap_reductions_with
from stablepush.diagnosis.rows.observations import observe
from stablepush.effects import parse_effect
from stablepush.geometry.planar import twist_from_cor
from stablepush.geometry.se2 import compose, inverse, log as log_of
from stablepush.rig.commands import contact_push


def ends_of(log, values=None, mu=0.5):
    slider = log.rig.slider
    surface = sp.IdealLimitSurface(slider.support, log.rig.support_friction * slider.mass * log.rig.gravity)
    found = replays(log, observe(log))
    table = friction_of(Nominal(surface), surface, values or {}, slider.mass * log.rig.gravity)
    return found, pose_errors(found, table, slider, mu, values or {})


MOVED = (
    ("anisotropy-world:ratio=1.2,direction=0.5", {"anisotropy-world": (0.18 * math.cos(1.0), 0.18 * math.sin(1.0))}),
    ("anisotropy-object:ratio=1.2,direction=0.5", {"anisotropy-object": (0.18 * math.cos(1.0), 0.18 * math.sin(1.0))}),
    ("spatial-variation:gradient=0.8/-0.5", {"spatial-variation": (0.8, -0.5)}),
    ("pressure-shift:offset=0.005/0.002", {"pressure-shift": (0.005, 0.002)}),
    ("pressure-spread:scale=0.8", {"pressure-spread": (-0.2,)}),
    ("tilt:slope=0.02/-0.01", {"tilt": (0.02, -0.01)}),
    ("contact-geometry:radius=0.007", {"contact-geometry": (0.002,)}),
    ("frame-offset:offset=0.003/-0.002", {"frame-offset": (0.003, -0.002)}),
    ("latency:delay=0.1", {"latency": (0.1,)}),
    ("contact-friction:mu=0.2", {"contact-friction": (-0.3,)}),
)


@pytest.mark.parametrize(("effect", "values"), MOVED, ids=[e.split(":")[0] for e, _ in MOVED])
def test_pushes_carried_out_again_end_where_the_rig_left_them(effect, values):
    """Ends of a simulated log without noise, by the pusher's logged path: only with the effect do they agree."""
    log = make_log(effect, noise=None, count=16, rows=40)
    found, without = ends_of(log)
    _, with_it = ends_of(log, {k: np.array(v) for k, v in values.items()})
    sizes = [np.linalg.norm(m, axis=1) for m in (with_it, without)]
    assert len(found) == 16
    assert np.median(sizes[0]) < 1e-4
    assert sizes[1].mean() > 3 * np.median(sizes[0])


def test_commanded_rotations_are_carried_out_from_where_fingers_touch():
    """A log that has the slider before and after, contact points and commanded rotations, but no path of the pusher."""
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    contact = sp.PushContact.on_edge(slider, 0, 0.06, 0.05, 0.5)
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(pressure(), LOAD), 0.5, sp.Pusher.of_contact(contact, 0.005), [], None)
    commands = [
        contact_push(contact, twist_from_cor(cor, 1), 0.3, radius=0.005, pose=(0, 0, angle), reset=True)
        for angle, cor in enumerate(((-0.3, 0.05), (-0.4, 0.0), (-0.2, -0.05)))
    ]
    log = edited(rig.execute(commands, rows=30).log, ("px", "py", "ptheta", *FORCES))
    ends = {}
    for name, values in log.samples.items():
        ends[name] = np.concatenate([values[log.rows(trial)][[0, -1]] for trial in log.trials["trial"]])
    ends["phase"] = np.array(["rest", "retract"] * 3, dtype=object)
    short = sp.PushLog(log.rig, log.trials, ends)
    found = replays(short, observe(short))
    assert [push.trial for push in found] == [0, 1, 2] and not any(push.logged for push in found)
    # the last row of a log is the mean over its part of the push, half of a thirtieth before the end
    _, away = ends_of(short)
    way = np.array([np.linalg.norm((push.end - push.start)[:2]) for push in found])
    assert (np.linalg.norm(away, axis=1) < 0.05 * way + 1e-3).all()


@pytest.mark.parametrize(
    ("effect", "name"), [("tilt:slope=0.02/-0.01", "slope"), ("anisotropy-world:ratio=1.3,direction=0.5", "ratio")]
)
def test_poses_alone_name_what_moves_the_slider(effect, name):
    """Without forces, effects show in where pushes end."""
    log = edited(make_log(effect, count=20), FORCES)
    report = sp.diagnose(log)
    id = effect.split(":")[0]
    assert report.named == [id]
    truth = np.array(parse_effect(effect).vector(name))
    estimate = np.atleast_1d(next(e for e in report.ranking if e.effect == id).parameters[name].estimate)
    assert np.abs(estimate - truth).max() < 0.25 * np.abs(truth - (name == "ratio")).max()
    pose = next(e for e in report.reductions if e.channel == "pose")
    assert pose.closed > 0.8 and pose.before > 2 * pose.floor
    assert check_schema(report)["worse"] == []


def test_latency_shows_in_gaps_of_fingers_of_unknown_radius():
    log = edited(make_log("latency:delay=0.1", count=16), FORCES, finger_radius=None, noise=None)
    report = sp.diagnose(log)
    assert report.named == ["latency"]
    delay = next(e for e in report.ranking if e.effect == "latency").parameters["delay"]
    assert abs(delay.estimate - 0.1) < 0.02
    assert not next(e for e in report.ranking if e.effect == "contact-geometry").identifiable


def test_a_chance_push_is_left_out_of_the_poses():
    """Of two pushes, one passes a corner by a hair: its end is no measurement."""
    log = make_log(count=40)
    found = replays(log, observe(log))
    poses = log_model(observe(log), log.rig, found).poses
    kept, noise = poses.pushes, poses.noise
    assert 20 < len(kept) <= len(found) == 40
    assert len(noise) == len(kept) and (noise > 0).all()


def test_pushes_that_separate_causes_are_proposed_without_forces():
    """Carried out with the effect and without, the pushes that are proposed end apart, by far more than poses are noisy."""
    report = sp.diagnose(edited(make_log("tilt:slope=0.03/0.01", count=30), FORCES))
    assert report.named == ["tilt"]
    after = report.next_experiment
    assert after.separates[0] == "tilt" and after.pushes[0::2] == after.pushes[1::2]
    acting, other = make_rig("tilt:slope=0.03/0.01"), make_rig()
    away = []
    for push in after.pushes[::2]:
        one, two = (rig.execute([push], seed=0).final_pose for rig in (acting, other))
        rho = acting.slider.characteristic_length
        away.append(float(np.linalg.norm(log_of(compose(inverse(two), one)) * (1, 1, rho))))
    # a slope moves what would lie still without it
    assert min(away) > 1e-3
    said = [push.expected["expected_difference_of_ends_m"] for push in after.pushes[::2]]
    # the other cause may move one of them as well
    assert np.median(np.abs(np.divide(said, away) - 1)) < 0.05


def motions(log):
    observations = observe(log)
    return log_model(observations, log.rig, replays(log, observations)).likelihood


@pytest.mark.parametrize("mu", [0.5, None])
@pytest.mark.parametrize("effect", [None, "anisotropy-world:ratio=1.4,direction=0.5"])
def test_more_effects_never_fit_worse_wherever_fits_begin(mu, effect):
    """Fits to ends have many minima: with an effect they are to be no worse than without, wherever they begin."""
    log = edited(make_log(*([effect] if effect else []), count=24, seed=2), FORCES, contact_friction=mu)
    likelihood = motions(log)
    alone = likelihood.fit(Model())
    scores = {id: likelihood.fit(Model((id,))).score for id in ("tilt", "anisotropy-world", "speed-dependence")}
    assert min(scores.values()) > alone.score - 2
    # it moves no end: all that it gains is another start
    assert scores["speed-dependence"] < alone.score + 2
    later = likelihood.beginning_at(likelihood.fit(Model(("anisotropy-world",))))
    assert later.fit(Model()).score > alone.score - 1
    assert later.fit(Model(("tilt",))).score > scores["tilt"] - 1


@pytest.mark.parametrize("seed", [1, 5])
def test_fingers_of_unknown_friction_are_no_cause(seed):
    log = edited(make_log(count=24, seed=seed), FORCES, contact_friction=None)
    report = sp.diagnose(log)
    check_schema(report)
    assert report.verdict in ("none", "absorbed") and not report.named
    assert "cannot be judged" in report.evidence["contact-friction"].unseen


def test_a_known_cause_closes_the_gap_without_forces():
    log = edited(make_log("tilt:slope=0.02/-0.01", count=24), FORCES)
    closed = {entry.channel: entry.closed for entry in gap_reductions_with(log, ["tilt"])}
    assert closed["pose"] > 0.8
    assert {entry.channel: entry.closed for entry in sp.diagnose(log).reductions}["pose"] > 0.8


def test_a_log_whose_last_push_shows_nothing_is_fitted_without_it():
    log = edited(make_log("tilt:slope=0.02/-0.01", count=16), FORCES)
    x = np.where(log.samples["trial"] == log.trials["trial"][-1], np.nan, log.samples["x"])
    likelihood = motions(sp.PushLog(log.rig, log.trials, {**log.samples, "x": x}))
    chosen = np.arange(16) % 3 > 0
    assert np.isfinite(likelihood.fit(Model(("tilt",)), chosen).score)


def test_the_center_of_a_pressure_that_motions_moved_is_where_its_surface_has_it():
    """Without forces the loads of a fit are a shift over rho and stretches, not loads of points."""
    ideal = sp.IdealLimitSurface(sp.SupportDistribution([(-0.03, -0.03), (0.07, -0.03), (-0.03, 0.07)], [1, 2, 1]), 3.0, 0.04)
    prior = MovedPressure.of(ideal)
    loads = np.array((0.1, -0.05, 0.2, 0.0, 0.1))
    changes = np.diag((0.01, 0.02, 0.1, 0.1, 0.1))
    off, deviation = prior.moved_center(loads, changes)
    np.testing.assert_allclose(prior.surface(loads).support.center, ideal.support.center + off, atol=1e-12)
    np.testing.assert_allclose(deviation, (0.0004, 0.0008))


@pytest.mark.parametrize("noise", (0.0, 2e-5))
def test_a_pusher_that_stands_at_the_end_has_a_piece_of_its_own(noise):
    """Poses that lag catch up meanwhile: if the last piece of motion lasted on, a delay would leave the slider short of it."""
    moving, standing = 100, 60
    x = np.concatenate((np.linspace(0.0, 0.15, moving), np.full(standing, 0.15)))
    rng = np.random.default_rng(0)
    pushers = np.column_stack((x, 0 * x, 0 * x)) + rng.normal(size=(len(x), 3)) * (noise, noise, 0)
    rows = _knots(np.arange(len(x)), pushers, None)
    assert rows[-1] == len(x) - 1
    assert moving - 3 <= rows[-2] <= moving


@pytest.mark.parametrize("outline", [sp.Slider.rectangle(0.14, 0.1), triangle()], ids=["rectangle", "triangle"])
def test_a_pressure_that_is_not_stated_is_even(outline):
    """Its cells counted alike, cut ones as much as whole ones, and a shift of the pressure was named that nobody had made."""
    slider = sp.Slider(outline.vertices, 0.9, sp.SupportDistribution.from_polygon(outline.vertices, 0.005))
    surface = sp.IdealLimitSurface(slider.support, 0.3 * 0.9 * 9.81)
    noise = sp.Noise(0.02, 1e-4, 1.7e-3)
    rig = sp.VirtualRig(slider, surface, 0.45, sp.Pusher.finger(0.005), [], noise)
    log = rig.execute(sp.random_pushes(slider, rig.pusher, 20, seed=8, groups=0), seed=8).log
    log = edited(log, FORCES, slider=sp.Slider(outline.vertices, 0.9), model=None)
    believed = motions(log).prior.surface(np.zeros(5)).support
    np.testing.assert_allclose(believed.center, surface.support.center, atol=1e-6)
    assert believed.characteristic_length == pytest.approx(surface.characteristic_length, rel=0.03)
    assert sp.diagnose(log).verdict == "none"
