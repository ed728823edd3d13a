"""Families of forms: fits use the terms of the curves that are drawn, and forms that no catalogue has are found."""

import re
from dataclasses import replace

import numpy as np
import pytest

import stablepush as sp
from stablepush.diagnosis.judge.force_axes import uneven_axes
from stablepush.diagnosis.likelihood.building import log_model
from stablepush.diagnosis.likelihood.forward import ForwardModel
from stablepush.diagnosis.rows.observations import observe
from stablepush.effects import (
    CATALOGUE,
    FAMILIES,
    REFERENCE_SPEED,
    friction_over_direction,
    friction_over_log,
    friction_over_place,
    friction_over_speed,
)
from stablepush.views import gap_html
from stablepush.views.plot import plot_forms, plot_residuals_against

SLIDER = sp.Slider.centered([(0.0, 0.0), (0.15, 0.0), (0.0, 0.15)], mass=1.5)
FEET = sp.SupportDistribution([(-0.03, -0.03), (0.07, -0.03), (-0.03, 0.07)], [1, 1, 1])
NOISE = sp.Noise(0.02, 1e-4, 1e-3)


@pytest.fixture(scope="module")
def log():
    rig = sp.VirtualRig(SLIDER, sp.IdealLimitSurface(FEET, 3.5), 0.6, sp.Pusher.finger(0.005), [], NOISE)
    return rig.execute(sp.random_pushes(SLIDER, rig.pusher, 40, seed=2), seed=2).log


@pytest.fixture(scope="module")
def straight(log):
    """A forward model of rows that translate, over one support point at the origin: friction is the force along the motion."""
    o = observe(log)
    o.twist[:, 2] = 0.0
    return o, ForwardModel(o, np.zeros((1, 2)), 0.0, 1.0, np.zeros(2), np.zeros((len(o.twist), 3)))


@pytest.mark.parametrize("id", ["anisotropy-world", "anisotropy-object", "speed-dependence", "spatial-variation", "drift"])
def test_fits_use_the_curves_that_are_drawn(straight, id):
    o, model = straight
    rng = np.random.default_rng(4)
    value = np.concatenate((0.1 * rng.normal(size=CATALOGUE[id].size), 0.02 * rng.normal(size=len(FAMILIES[id].terms))))
    load = model.predict(np.ones(1), {id: value})
    along = o.twist[:, :2] / np.linalg.norm(o.twist[:, :2], axis=1, keepdims=True)
    friction = (load[:, :2] * along).sum(axis=1)
    own, terms = value[: CATALOGUE[id].size], value[CATALOGUE[id].size :]
    if id.startswith("anisotropy"):
        size = np.hypot(*own)
        angles = np.arctan2(along[:, 1], along[:, 0]) + (o.pose[:, 2] if id.endswith("world") else 0.0)
        expected = friction_over_direction(np.sqrt((1 + size) / (1 - size)), np.arctan2(own[1], own[0]) / 2, terms, angles)
    elif id == "speed-dependence":
        expected = friction_over_speed(own[0], terms, o.speed, REFERENCE_SPEED)
    elif id == "spatial-variation":
        expected = friction_over_place(own, terms, o.pose[:, :2])
    else:
        expected = friction_over_log(own[0], terms, o.order)
    np.testing.assert_allclose(friction, expected, rtol=1e-6)


def test_waves_take_the_force_of_a_convex_set(straight):
    """The force across the motion is the slope of the friction along it."""
    o, model = straight
    value = np.array((0.0, 0.0, 0.01, -0.005, 0.002, 0.003))
    load = model.predict(np.ones(1), {"anisotropy-object": value})
    along = o.twist[:, :2] / np.linalg.norm(o.twist[:, :2], axis=1, keepdims=True)
    across = load[:, 1] * along[:, 0] - load[:, 0] * along[:, 1]
    angles, step = np.arctan2(along[:, 1], along[:, 0]), 1e-5
    ahead, behind = (friction_over_direction(1.0, 0.0, value[2:], angles + s * step) for s in (1, -1))
    np.testing.assert_allclose(across, (ahead - behind) / (2 * step), atol=1e-7)


@pytest.mark.parametrize("id", [*FAMILIES])
def test_columns_are_the_derivatives_of_what_is_fitted(log, id):
    """Rows of loads, clearances and readings at rest, by every term of a family."""
    likelihood, _ = log_model(observe(log), log.rig, [])
    if id in likelihood.nuisance:
        pytest.skip("always fitted")
    size, nominal = likelihood.experiment.size(id, family=True), likelihood.prior.nominal
    value = np.zeros(size)
    columns = likelihood.columns(id, nominal, {id: value}, size)
    for k in range(size):
        step = np.zeros(size)
        step[k] = 1e-5
        ahead, behind = (likelihood.residual(nominal, {id: s * step}) for s in (1, -1))
        off = np.abs(columns[:, k] + (ahead - behind) / 2e-5) > 2e-3 * max(1.0, np.abs(columns[:, k]).max())
        # turns about a support point are no place for differences
        assert off.mean() < 0.01 and columns[:, k].any()


def reread(log, factor):
    """The log, had friction been so many times as large in each row."""
    changed = {k: v * factor if k in ("fx", "fy", "tau") else v for k, v in log.samples.items()}
    return sp.PushLog(log.rig, log.trials, changed)


def test_a_drift_that_no_catalogue_has_is_named_and_drawn(log):
    """Friction that rises and falls again: the catalogue's straight line does not show it at all."""
    place = {name: k / (len(log) - 1) for k, name in enumerate(log.trials["trial"])}
    orders = np.array([place[name] for name in log.samples["trial"]])
    report = sp.diagnose(reread(log, 1 + 0.3 * 4 * orders * (1 - orders)))
    assert report.verdict == "named" and report.named == ["drift"]
    form = report.ranking[0].form
    assert form["basis"] == list(FAMILIES["drift"].terms) and len(form["ci95"]) == 3
    # no simulation has the form, and the straight line that is nearest to it has no slope
    assert report.effects == {} and report.corrected[0].effects == ()
    found = friction_over_log(report.ranking[0].parameters["rate"].estimate, form["coefficients"], [0.25, 0.5, 0.75])
    np.testing.assert_allclose(found, 1 + 0.3 * np.array((0.75, 1.0, 0.75)), atol=0.04)
    assert report.to_json()["ranking"][0]["form"]["unit"] == "share of the friction"
    (drawn,) = plot_forms(report)
    highest = drawn.lines[1].get_ydata()
    assert drawn.get_title() == "drift" and highest.max() == pytest.approx(1.3, abs=0.04)
    # a mark for each push whose rows tell its load, near the curve
    places, marks = next(line.get_data() for line in drawn.lines if line.get_marker() == "o")
    assert 30 < len(places) <= len(log)
    np.testing.assert_allclose(marks, np.interp(places, drawn.lines[1].get_xdata(), highest), atol=0.1)
    # as far off the curve as their loads are off the corrected simulation
    far = replace(report, residuals={**report.residuals, "after": report.residuals["after"] + 0.2 * report.loads})
    (off,) = plot_forms(far)
    higher = next(line.get_ydata() for line in off.lines if line.get_marker() == "o")
    assert np.median(higher / marks) == pytest.approx(1.25, abs=0.03)
    page = gap_html(report)
    assert "What was found" in page and "4o(1-o)" in page


def test_a_pull_that_grows_with_the_place_is_told_where_the_pushes_are(log):
    """As that of a cable: nothing in the middle, 0.25 rad per m away from it; at the origin of W that says nothing."""
    middle = np.array((0.5, 0.5))
    changed = {k: np.asarray(v) + 0.5 if k in ("x", "y", "px", "py") else v for k, v in log.samples.items()}
    here = np.column_stack([np.asarray(changed[name], dtype=float) for name in ("x", "y")]) - middle
    pull = 0.25 * here * log.rig.slider.mass * log.rig.gravity
    theta = np.asarray(log.samples["theta"], dtype=float)
    c, s = np.cos(theta), np.sin(theta)
    # the pusher holds the slider back where it is pulled
    changed["fx"] = np.asarray(changed["fx"], dtype=float) - (c * pull[:, 0] + s * pull[:, 1])
    changed["fy"] = np.asarray(changed["fy"], dtype=float) - (c * pull[:, 1] - s * pull[:, 0])
    report = sp.diagnose(sp.PushLog(log.rig, log.trials, changed))
    assert report.named == ["tilt"]
    told = re.search(
        r"falls by \((.*?), (.*?)\) deg .* \(x (.*?) m, y (.*?) m\); .* from (\S*) to (\S*) deg along x", report.sentence
    )
    assert told is not None, report.sentence
    numbers = np.array([float(word) for word in told.groups()])
    mean = here[np.asarray(log.samples["phase"]) == "push"].mean(axis=0) if "phase" in log.samples else here.mean(axis=0)
    np.testing.assert_allclose(np.radians(numbers[:2]), 0.25 * mean, atol=2e-3)
    np.testing.assert_allclose(numbers[2:4], middle + mean, atol=0.006)
    np.testing.assert_allclose(np.radians(numbers[4:]), 0.25 * np.array((here[:, 0].min(), here[:, 0].max())), atol=4e-3)
    assert "a table that is not flat, or a cable" in " ".join(report.steps)


def test_a_clean_log_opens_no_form(log):
    report = sp.diagnose(log)
    assert report.verdict == "none" and all(entry.form is None for entry in report.ranking)
    with pytest.raises(sp.InputError, match="expected a named effect"):
        plot_forms(report)
    # what fits is not drawn beside a refit
    labels = [line.get_label() for line in plot_residuals_against(report)[0, 0].lines]
    assert "nominal" in labels and not {"corrected", "refitted"} & set(labels)
    page = gap_html(report)
    assert 'words = ["both", "nominal", ""]' in page and "refitted one" not in page


def read_by(log, matrix):
    """The log as a sensor reads it whose readings, in W, are a matrix times the forces."""
    x, y, theta, fx, fy, tau = (np.asarray(log.samples[name], dtype=float) for name in ("c1x", "c1y", "theta", "fx", "fy", "tau"))
    c, s = np.cos(theta), np.sin(theta)
    turned = np.array(matrix) @ (c * fx - s * fy, s * fx + c * fy)
    read_x, read_y = c * turned[0] + s * turned[1], -s * turned[0] + c * turned[1]
    # moments follow from forces at the contact
    moment = tau + x * (read_y - fy) - y * (read_x - fx)
    return replace(log, samples=dict(log.samples) | {"fx": read_x, "fy": read_y, "tau": moment})


def mounted(angle):
    return np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))


@pytest.mark.parametrize(
    ("matrix", "ratio", "direction", "angle"),
    [
        (np.diag((1.25, 1.0)), 1.25, 0.0, 0.0),
        (np.diag((1.0, 1.25)), 1.25, 90.0, 0.0),
        (np.diag((1.25, 1.0)) @ mounted(0.15), 1.25, 0.0, 8.6),
        # gains of a sensor whose own axes are askew to the table
        (mounted(0.7) @ np.diag((1.25, 1.0)) @ mounted(-0.7), 1.25, 40.1, 0.0),
        # one axis reads some of the other: half turn, half shear
        (np.array(((1.0, 0.2), (0.0, 1.0))), 1.2210, 42.1, -5.7),
    ],
)
def test_uneven_axes_of_a_force_sensor_are_told_by_their_gains(log, matrix, ratio, direction, angle):
    report = sp.diagnose(read_by(log, matrix))
    assert report.named == ["force-rotation"]
    (entry,) = (entry for entry in report.ranking if entry.effect == "force-rotation")
    axes = uneven_axes(entry)
    assert axes.ratio == pytest.approx(ratio, abs=0.03)
    # directions are alike modulo half a turn
    assert abs((np.degrees(axes.direction) - direction + 90) % 180 - 90) < 4
    assert np.degrees(axes.angle) == pytest.approx(angle, abs=1)
    assert str(axes) in report.sentence
    assert report.to_do == [
        "force-rotation: calibrate each axis of the force sensor against known forces; fit again what was fitted to its readings"
    ]
    # no angle: it would take up some of the gains
    assert not any(effect.effect.id == "force-rotation" for effect in report.corrected[0].effects)
    assert "force-rotation" not in report.effects


def test_a_sensor_that_is_only_turned_has_even_axes(log):
    report = sp.diagnose(read_by(log, mounted(0.12)))
    assert report.named == ["force-rotation"]
    assert uneven_axes(report.ranking[0]) is None
    assert "force_angle: 0.1" in report.to_do[0]


def test_one_number_does_not_take_off_a_delay_that_changes(log):
    report = sp.diagnose(read_by(log, mounted(0.12)))
    parameter = report.ranking[0].parameters["angle"]
    form = {"covariate": "", "basis": ["o - 1/2"], "coefficients": [0.08], "ci95": [[0.06, 0.1]], "unit": "s"}
    delayed = replace(report.ranking[0], effect="latency", parameters={"delay": parameter})
    assert "pose_delay" in report._in_numbers(delayed)
    assert "no one number" in report._in_numbers(replace(delayed, form=form))


def test_what_an_import_took_off_already_is_added_to(log):
    """An offset is along the axes of the slider, of which the tracked frame's may be turned."""
    report = sp.diagnose(read_by(log, mounted(0.12)))
    turned, angle = report.ranking[0], report.ranking[0].parameters["angle"].estimate
    offset = replace(report.ranking[0].parameters["angle"], estimate=[0.001, 0.004], ci95=[[0.0, 0.002], [0.003, 0.005]])
    off = replace(turned, effect="frame-offset", parameters={"offset": offset})
    assert report._in_numbers(turned).endswith(f"if the import had none: force_angle: {angle:.4f}")
    for source in (None, {}, "csv", {"body_pose": [1, 2], "force_angle": "0"}, {"body_pose": ["a", 0, 0], "force_angle": None}):
        other = replace(report, rig=replace(report.rig, extra={"source": source}))
        assert other._in_numbers(off) == ". Here, if the import had none: body_pose: [-0.00100, -0.00400, 0]"
    known = {"source": {"kind": "csv", "body_pose": [-0.05, -0.04, -np.pi / 2], "pose_delay": 0.0, "force_angle": 0.1}}
    other = replace(report, rig=replace(report.rig, extra=known))
    assert other._in_numbers(turned) == f". Here: force_angle: {angle + 0.1:.4f}"
    # x of the slider is -y of the tracked frame, and y of the slider is x of that
    assert other._in_numbers(off) == ". Here: body_pose: [-0.05400, -0.03900, -1.5708]"
