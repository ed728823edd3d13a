"""Logs of executed plans: the nominal simulation is the surface that the plan was made with."""

import json
import re
from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from conftest import LOAD, MASS, make_log, pairs, small_scene, three_feet, triangle

import stablepush as sp
from stablepush.cli.program import main
from stablepush.diagnosis.likelihood.building import log_model
from stablepush.diagnosis.likelihood.nominal import nominal_of
from stablepush.diagnosis.likelihood.score_test import ScoreTest
from stablepush.diagnosis.remedy.corrected_surface import _least, _Prior, _Shown
from stablepush.diagnosis.rows.observations import observe
from stablepush.diagnosis.search.family_wise import family_wise_p_values
from stablepush.diagnosis.search.plausibility import possible
from stablepush.effects import parse_effect
from stablepush.views import gap_html
from stablepush.views.plot import plot_forms

NOISE = sp.Noise(0.02, 1e-4, 1e-3)
FINGER = 0.005


@pytest.fixture(scope="module")
def executed():
    """A problem with a fitted surface, and its plan."""
    loads, twists = pairs(20, noise=0.02, seed=4)
    slider = sp.Slider(triangle().vertices, MASS)
    surface = sp.fit_limit_surface(loads, twists, slider=slider, seed=0).surface
    scene = small_scene(pusher=None)
    problem = sp.PlanningProblem(
        slider, surface, [sp.PushContact.on_edge(slider, 0, 0.05, 0.05, 0.9)], scene.start, (1.0, 0.45, 0.9)
    )
    result = sp.plan(problem, time_limit=60, refinement_budget=2000)
    assert result.solved and len(result.pushes) > 2
    return problem, result


def log_of(executed, *effects, seed=0, truth=None):
    problem, result = executed
    pusher = sp.Pusher.of_contact(problem.contacts[0], FINGER)

    def run(surface, acting):
        return sp.execute_plan(sp.VirtualRig(problem.slider, surface, 0.9, pusher, acting, NOISE), problem, result, seed=seed).log

    log = run(truth or problem.surface, [parse_effect(text) for text in effects])
    return sp.PushLog(run(problem.surface, []).rig, log.trials, log.samples)


def test_the_model_of_a_rig_is_written_and_read(executed, tmp_path):
    log = log_of(executed)
    assert log.rig.model is executed[0].surface
    sp.write_pushlog(log, tmp_path / "log")
    again = sp.read_pushlog(tmp_path / "log").rig.model
    np.testing.assert_array_equal(again.coefficients, log.rig.model.coefficients)
    np.testing.assert_array_equal(again.ensemble, log.rig.model.ensemble)
    # a path counts from the folder of the log
    rig = json.loads((tmp_path / "log" / "rig.json").read_text())
    (tmp_path / "log" / "surface.json").write_text(json.dumps(rig["model"]))
    (tmp_path / "log" / "rig.json").write_text(json.dumps({**rig, "model": "surface.json"}))
    np.testing.assert_array_equal(sp.read_pushlog(tmp_path / "log").rig.model.coefficients, again.coefficients)
    for wrong, words in (
        ({"kind": "polynomial"}, "rig.json: model.format: missing key"),
        (3, "rig.json: model: expected a model/1"),
    ):
        (tmp_path / "log" / "rig.json").write_text(json.dumps({**rig, "model": wrong}))
        with pytest.raises(sp.InputError, match=words):
            sp.read_pushlog(tmp_path / "log")
    units = {**rig["model"], "force_unit": "mu*N"}
    (tmp_path / "log" / "rig.json").write_text(json.dumps({**rig, "model": units, "friction": {"support": None, "contact": 0.9}}))
    with pytest.raises(sp.InputError, match="expected forces in N, or slider"):
        sp.read_pushlog(tmp_path / "log")


def only(log, number):
    """The log of one of its pushes."""
    name = log.trials["trial"][number]
    chosen = np.asarray(log.samples["trial"]) == name
    trials = {key: np.asarray(value)[[number]] for key, value in log.trials.items()}
    return sp.PushLog(log.rig, trials, {key: np.asarray(value)[chosen] for key, value in log.samples.items()})


def test_a_log_of_one_push_tells_how_far_it_ends_from_simulation(executed):
    clean = sp.diagnose(only(log_of(executed), 0))
    assert clean.verdict == "none" and clean.channels == ["pose"] and clean.gap[0].nominal < clean.gap[0].noise_floor
    slipped = sp.diagnose(only(log_of(executed, "contact-friction:mu=0.1"), 0))
    assert slipped.verdict == "unknown" and not slipped.named and slipped.to_json()["shrink"][0]["held_out_trials"] == 1
    assert slipped.gap[0].nominal > 10 * slipped.gap[0].noise_floor
    assert re.match(
        r"The push ends [\d.]+ mm and [\d.]+ deg from where .*: one push cannot tell causes apart\.", slipped.sentence
    )
    assert slipped.to_do == ["no effect of the catalogue is shown to explain the gap", slipped.next_experiment.why]
    assert "1 push<" in gap_html(slipped)
    # forces are not needed
    log = only(log_of(executed, "contact-friction:mu=0.1"), 0)
    blind = sp.PushLog(log.rig, log.trials, {k: v for k, v in log.samples.items() if k not in ("fx", "fy", "tau")})
    assert sp.diagnose(blind).verdict == "unknown" and sp.diagnose(blind).gap[0].nominal == pytest.approx(slipped.gap[0].nominal)


def test_the_nominal_prediction_is_that_of_the_model(executed):
    """Without noise nothing is left of the wrenches of an executed plan."""
    problem, result = executed
    pusher = sp.Pusher.of_contact(problem.contacts[0], FINGER)
    log = sp.execute_plan(sp.VirtualRig(problem.slider, problem.surface, 0.9, pusher), problem, result).log
    likelihood, _ = log_model(observe(log), log.rig, [])
    o, rho = likelihood.experiment.observations, likelihood.experiment.rho
    left = o.wrench - likelihood.wrench.predict(likelihood.prior.nominal, {})
    # rows at the start of a push are means over its approach, too
    size = np.linalg.norm(left / (1, 1, rho), axis=1)
    assert np.median(size) < 1e-3 * LOAD
    # points alone are farther away
    believed = nominal_of(log.rig)
    assert np.median(np.linalg.norm(believed.beyond_points(o.twist) / (1, 1, rho), axis=1)) > 3e-3 * LOAD


@pytest.mark.parametrize("seed", range(4))
def test_a_clean_executed_plan_has_no_cause(executed, seed):
    report = sp.diagnose(log_of(executed, seed=seed))
    assert report.verdict == "none" and not report.named
    feet = sp.IdealLimitSurface(three_feet(), 5.0)
    assert sp.diagnose(log_of(executed, seed=seed, truth=feet)).verdict in ("none", "absorbed")


def test_fingers_that_slip_are_found_and_plans_hold_again(executed, tmp_path, capsys):
    """Pokes, plan, execution that fails, diagnosis, correction, another plan, which arrives: by the commands."""
    problem, result = executed
    scene, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    from stablepush.planning import save_scene

    save_scene(problem.with_changes(bounds=(-1, -1, 3, 3), finger_radius=FINGER), scene)
    sp.save_plan(result, plan)
    noise, slippery = ["--noise", "0.02", "0.0001", "0.001"], ["--effect", "contact-friction:mu=0.25"]
    assert main(["simulate", str(scene), str(plan), *noise, *slippery, "-o", str(tmp_path / "log")]) == 0
    lost = capsys.readouterr().out
    assert main(["diagnose", str(tmp_path / "log"), "--json", str(tmp_path / "diagnosis.json")]) == 0
    assert "named: contact-friction" in capsys.readouterr().out
    assert main(["correct", str(scene), str(tmp_path / "diagnosis.json"), "-o", str(tmp_path / "corrected.json")]) == 0
    assert "finger friction 0.2" in capsys.readouterr().out
    corrected = sp.load_scene(tmp_path / "corrected.json")
    assert corrected.contacts[0].mu == pytest.approx(0.25, abs=0.03)
    assert corrected.uncertainty.contact_friction < 0.15
    # two fingers that slip so easily cannot turn as tightly: a goal that is straighter ahead
    goal, ends = (0.25, 0.6, 0.15), []
    for asked in (problem.with_changes(goal=goal), corrected.with_changes(goal=goal)):
        again = sp.plan(asked, time_limit=60, refinement_budget=2000)
        assert again.solved
        pusher = sp.Pusher.of_contact(problem.contacts[0], FINGER)
        rig = sp.VirtualRig(problem.slider, problem.surface, 0.9, pusher, [parse_effect(slippery[1])])
        end = sp.execute_plan(rig, asked, again).final_pose
        ends.append(float(np.hypot(end[0] - goal[0], end[1] - goal[1])))
    assert ends[1] <= corrected.tolerance[0] + 1e-3
    assert "from the goal" in lost


@pytest.mark.parametrize("seed", range(3))
def test_fingers_that_slip_are_found_on_feet_that_no_fit_has(executed, seed):
    """The table is not that of the plan, as on any robot; the next plan ends where it should."""
    feet = sp.IdealLimitSurface(three_feet(), 5.0)
    report = sp.diagnose(log_of(executed, "contact-friction:mu=0.28", seed=seed, truth=feet))
    assert report.named == ["contact-friction"], report.sentence
    assert report.effects["contact-friction"]["mu"] == pytest.approx(0.28, rel=0.1)
    # the picture that convinces: what each push shows of the friction, the one that is found, the one that was assumed
    (drawn,) = plot_forms(report)
    lines = {line.get_label(): line for line in drawn.lines}
    assert lines["friction found"].get_ydata()[0] == pytest.approx(0.28, rel=0.1)
    assert lines["friction assumed"].get_ydata()[0] == 0.9
    np.testing.assert_allclose(lines["push that slips"].get_ydata(), 0.28, rtol=0.2)
    assert lines["push that sticks: at least this friction"].get_ydata().max() < 1.2 * 0.28
    page = gap_html(report)
    assert page.index("What was found") < page.index("Look at it") and "Friction of the table" not in page


def test_pushes_after_the_object_was_lost_are_no_gap(executed):
    """Two more pushes in which fingers touch nothing and noise alone moves the object: left out, and said."""
    log = log_of(executed, "contact-friction:mu=0.3")
    rng = np.random.default_rng(0)
    samples = {name: list(values) for name, values in log.samples.items()}
    last = {name: values[-1] for name, values in samples.items()}
    for trial in ("lost 1", "lost 2"):
        for k in range(9):
            row = {**last, "trial": trial, "t": 0.1 * k, "phase": "push", "px": last["px"] + 0.3}
            row |= {name: last[name] + NOISE.position * rng.normal() for name in ("x", "y")}
            row |= {"theta": last["theta"] + NOISE.angle * rng.normal()}
            row |= {name: NOISE.force * rng.normal() for name in ("fx", "fy")} | {"tau": 0.0}
            row |= {name: np.nan for name in ("c1x", "c1y", "c2x", "c2y", "vx", "vy", "omega") if name in row}
            for name, values in samples.items():
                values.append(row[name])
    trials = {name: [*values, *[values[-1]] * 2] for name, values in log.trials.items()}
    trials["trial"][-2:] = ["lost 1", "lost 2"]
    begun = float(np.max(log.trials["start_time"]))
    trials["start_time"][-2:] = [begun + 100.0, begun + 200.0]
    longer = sp.diagnose(sp.PushLog(log.rig, trials, samples))
    before = sp.diagnose(log)
    assert longer.named == before.named == ["contact-friction"]
    # two of the plan's own six pushes come after the loss as well
    assert before.sentence.endswith("The object does not move in 2 of 6 pushes.")
    assert longer.sentence.endswith("The object does not move in 4 of 8 pushes.")
    assert any("lost 1" in note and "which are left out" in note for note in longer.notes)
    sizes = [next(entry.nominal for entry in report.gap if entry.channel == "wrench") for report in (before, longer)]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.05)


@pytest.mark.parametrize("forces", [True, False])
@pytest.mark.parametrize("mu", [0.25, 0.3])
def test_friction_of_fingers_that_slip_is_found_from_final_poses(executed, mu, forces):
    log = log_of(executed, f"contact-friction:mu={mu}")
    if not forces:
        log = sp.PushLog(log.rig, log.trials, {k: v for k, v in log.samples.items() if k not in ("fx", "fy", "tau")})
    report = sp.diagnose(log)
    assert report.named == ["contact-friction"] and report.ranking[0].effect == "contact-friction"
    assert report.effects["contact-friction"]["mu"] == pytest.approx(mu, rel=0.05)
    [correction] = report.corrected
    assert correction.contact_friction == pytest.approx(mu, rel=0.05) and correction.contact_friction_error < 0.1 * mu
    assert any("final poses of" in note for note in report.notes)


def test_a_channel_that_is_off_is_never_none(executed):
    """One push of six slips: without forces too little to name a cause, and said."""
    log = log_of(executed, "contact-friction:mu=0.4")
    blind = sp.PushLog(log.rig, log.trials, {k: v for k, v in log.samples.items() if k not in ("fx", "fy", "tau")})
    report = sp.diagnose(blind)
    assert report.verdict == "unknown" and "fingers slipped in 1 of 6 pushes" in report.sentence
    assert "the pose is off by" in report.sentence
    assert re.search(r"1 of 6 pushes \(.+\) ended up to", report.sentence)
    # the direction of the force and where the push ends agree on the friction
    seen = sp.diagnose(log)
    assert seen.named == ["contact-friction"] and seen.effects["contact-friction"]["mu"] == pytest.approx(0.4, rel=0.1)


def test_few_trials_have_no_small_p_value():
    """The signs of n trials have 2^(n-1) patterns: fewer than eight cannot show what happens once in a hundred logs."""
    rng = np.random.default_rng(0)
    for trials, least in ((4, 0.1), (12, 0.0)):
        shares = np.ones((trials, 1, 1))
        test = ScoreTest(1e4, 1e4, np.ones(1), np.eye(1), 1e-3 * rng.normal(size=(trials, 1)), shares)
        assert test.informative_trials() == pytest.approx(trials)
        p = family_wise_p_values({"drift": test})["drift"]
        assert p >= least and (trials == 4 or p < 0.01)


@pytest.mark.parametrize("offset", ((0.008, 0.0), (-0.004, 0.005), (0.0, 0.0)))
def test_a_corrected_surface_holds_for_pushes_that_the_plan_had_not(executed, offset):
    """Of feet that have moved since the pokes: near to the truth for pushes beside those of the log, within the ensemble."""
    feet = three_feet()
    truth = sp.IdealLimitSurface(sp.SupportDistribution(feet.points + offset, feet.weights), 1.05 * LOAD)
    log = log_of(executed, truth=truth)
    corrected = sp.diagnose(log).corrected[0].surface
    twists = observe(log).twist
    rng = np.random.default_rng(1)
    size = np.array((1.0, 1.0, 0.05))
    others = np.repeat(twists, 4, axis=0) + 0.15 * np.abs(twists[:, :2]).max() * rng.normal(size=(4 * len(twists), 3)) / size

    def directions(surface):
        loads = surface.wrench(others) / size
        return loads / np.linalg.norm(loads, axis=1, keepdims=True)

    def errors(surface):
        return np.linalg.norm(directions(surface) - directions(truth), axis=1)

    assert errors(corrected).mean() < (0.5 if any(offset) else 0.9) * errors(executed[0].surface).mean()
    assert corrected.friction_load == pytest.approx(truth.friction_load, rel=0.03)
    assert corrected.support.weights.min() >= 0
    members = corrected.members()
    spread = np.linalg.norm(np.std([directions(member) for member in members], axis=0), axis=1)
    assert np.mean(errors(corrected) < 3 * spread) > 0.8 and spread.mean() < 3 * errors(corrected).mean()
    # members are neither heavier nor lighter
    assert np.mean([m.friction_load for m in members]) == pytest.approx(corrected.friction_load, rel=0.01)


def test_fingers_are_uncertain_where_nothing_named_explains_the_gap(executed):
    feet = three_feet()
    other = sp.IdealLimitSurface(sp.SupportDistribution(feet.points, feet.weights), 1.15 * LOAD)
    report = sp.diagnose(log_of(executed, truth=other))
    assert report.verdict == "absorbed"
    [found] = report.corrected
    assert found.contact_friction is None and found.contact_friction_error == pytest.approx(0.15 * 0.9)
    assert sp.diagnose(log_of(executed)).corrected[0].contact_friction_error is None


@pytest.mark.parametrize(("ratio", "makes_sense"), ((1.3, True), (1.6, True), (1.9, False)))
def test_no_grain_is_stronger_than_friction_allows(executed, ratio, makes_sense):
    log = log_of(executed)
    size = (ratio**2 - 1) / (ratio**2 + 1)
    assert possible(log_model(observe(log), log.rig, []).likelihood, "anisotropy-object", np.array((size, 0.0))) == makes_sense


def test_corrected_loads_are_those_of_a_quadratic_program():
    rng = np.random.default_rng(0)
    believed = np.array((0.5, 0.0, 1.5, 0.0, 0.2, 0.0))
    slopes = rng.normal(size=(12, 6))
    shown = _Shown(slopes @ (0.2, 0.4, 1.0, -0.5, 0.0, 0.1) + 0.3 * rng.normal(size=12), slopes, np.arange(12) // 3)
    prior, weights = _Prior(believed, 0.3), rng.uniform(0.2, 2.0, 12)
    loads = cp.Variable(6)
    precision = np.linalg.inv(0.3**2 * np.eye(6) + 0.3**2 * np.outer(believed, believed))
    cost = cp.sum_squares(cp.multiply(np.sqrt(weights), shown.wrench - slopes @ loads))
    cost += cp.quad_form(loads - believed, cp.psd_wrap(precision))
    cp.Problem(cp.Minimize(cost), [loads >= 0]).solve(solver=cp.CLARABEL)
    found = _least(shown.root(prior, weights))
    np.testing.assert_allclose(found, loads.value, atol=1e-6)
    assert (found == 0).any()


def test_corrected_surfaces_without_forces_without_noise_and_of_several_logs(executed):
    feet = three_feet()
    truth = sp.IdealLimitSurface(sp.SupportDistribution(feet.points + np.array((0.008, 0.0)), feet.weights), LOAD)
    log = log_of(executed, truth=truth)
    exact = sp.PushLog(replace(log.rig, noise=sp.Noise(0.0, 0.0, 0.0)), log.trials, log.samples)
    assert np.isfinite(sp.diagnose(exact).corrected[0].surface.wrench(observe(log).twist)).all()
    together = sp.diagnose([log, log_of(executed, truth=truth, seed=1)])
    assert together.corrected[0].surface.support.center[0] > 0.004
    # from final poses alone, beside a nominal pressure
    for effect, center in (("pressure-shift:offset=0.008/0.004", (0.008, 0.004)), ("pressure-spread:scale=0.6", (0.0, 0.0))):
        blind = make_log(effect, count=30)
        names = {name for name in blind.samples if name in ("fx", "fy", "tau")}
        blind = sp.PushLog(blind.rig, blind.trials, {k: v for k, v in blind.samples.items() if k not in names})
        surface = sp.diagnose(blind).corrected[0].surface
        np.testing.assert_allclose(surface.support.center, center, atol=2e-3)


def test_what_no_pressure_can_do_is_said_to_be_uncertain(executed):
    """The ensemble of the fit bounds what a refit may do without being one."""
    log = log_of(executed)
    likelihood, _ = log_model(observe(log), log.rig, [])
    directions, precision = likelihood.prior.directions(False)
    modes = likelihood.experiment.open_modes.shape[1]
    assert directions.shape[1] == 1 + modes and 2 <= modes <= 10
    np.testing.assert_allclose(np.diag(precision)[1:], 1.0)
    without = replace(log.rig, model=None)
    assert log_model(observe(log), without, []).likelihood.experiment.open_modes.shape[1] == 0
