"""Plans on tables whose effects make the stable pushes depend on heading, place and speed."""

import math

import numpy as np
import pytest
from conftest import small_scene, three_feet, triangle
from hypothesis import given, settings, strategies as st
from scipy.optimize import nnls

import stablepush as sp
from stablepush.geometry import compose, exp, normalize_wrench
from stablepush.planning import loads_of
from stablepush.planning.check import _margin
from stablepush.planning.pusher_loads import likely_loads

TILT = "tilt:slope=0.03/-0.02"
GRAIN = "anisotropy-world:ratio=1.4,direction=0.5"
#: The effects that plans know, alone and together.
EFFECTS = {
    "tilt": (TILT,),
    "anisotropy-world": (GRAIN,),
    "anisotropy-object": ("anisotropy-object:ratio=1.3,direction=1.0",),
    "spatial-variation": ("spatial-variation:gradient=0.3/-0.2",),
    "speed-dependence": ("speed-dependence:slope=0.1",),
    "pressure-shift": ("pressure-shift:offset=0.004/-0.002",),
    "inertia": ("inertia:mass=1.0",),
    "all": (TILT, GRAIN, "spatial-variation:gradient=0.2/0.1", "speed-dependence:slope=-0.05"),
}
MASS = 1.5
SLIDER = sp.Slider(triangle().vertices, MASS, three_feet())


def scene(*texts, **changes):
    effects = [sp.parse_effect(text) for text in texts]
    given = {"slider": SLIDER, "pusher": None, "effects": effects, **changes}
    return small_scene(**given)


def quartic():
    """A polynomial surface with an ensemble, from loads on the feet."""
    feet = sp.IdealLimitSurface(three_feet(), 5.0)
    twists = np.random.default_rng(3).normal(size=(10, 3)) / (1, 1, SLIDER.radius_of_gyration)
    return sp.fit_limit_surface(feet.wrench(twists), twists, slider=SLIDER, seed=0).surface


def test_the_load_on_a_slope_is_friction_less_the_pull():
    problem = scene(TILT)
    rng = np.random.default_rng(0)
    twists, poses = 0.02 * rng.normal(size=(50, 3)) * (1, 1, 20), rng.uniform(-3, 3, size=(50, 3))
    pull = MASS * 9.81 * np.array((0.03, -0.02))
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    expected = problem.surface.wrench(twists)
    expected[:, 0] -= c * pull[0] + s * pull[1]
    expected[:, 1] -= -s * pull[0] + c * pull[1]
    np.testing.assert_allclose(loads_of(problem).at(twists, poses), expected, atol=1e-7)
    # the feet hold the least where the pull turns the slider: never more than the sum of their friction
    assert np.hypot(*pull) / 5.0 - 1e-9 <= loads_of(problem).resting_share < 1.2 * np.hypot(*pull) / 5.0


def test_margins_at_poses_are_those_of_the_load_that_the_pusher_supplies():
    rng = np.random.default_rng(1)
    level, sloped = scene(), scene(TILT)
    twists, poses = 0.02 * rng.normal(size=(4, 6, 3)) * (1, 1, 20), rng.uniform(-3, 3, size=(4, 6, 3))
    oracle = sp.StabilityOracle(level.surface, level.contacts[0])
    np.testing.assert_allclose(sp.push_margins(level, twists, poses), oracle.margin(twists), atol=1e-12)
    # a load that is in the cone can be made of forces at the edges of the contacts' cones, and no other can
    loads = loads_of(sloped).at(twists.reshape(-1, 3), poses.reshape(-1, 3))
    contact, margins = sloped.contacts[0], sp.push_margins(sloped, twists, poses).ravel()
    edges = []
    for point, normal in zip(contact.points, contact.normals, strict=True):
        for side in (-contact.mu, contact.mu):
            force = normal + side * np.array((-normal[1], normal[0]))
            edges.append((*force, point[0] * force[1] - point[1] * force[0]))
    for load, margin in zip(loads, margins, strict=True):
        _, left = nnls(np.array(edges).T * np.array((1, 1, 10))[:, None], load * (1, 1, 10))
        assert (left < 1e-9) == (margin >= 0), (left, margin)
    assert (margins > 0).any() and (margins < 0).any()
    # one pose for all twists, the start if none is given
    np.testing.assert_array_equal(sp.push_margins(sloped, twists), sp.push_margins(sloped, twists, sloped.start))
    for problem in (level, sloped):
        assert sp.push_margins(problem, (0, 0.02, 0), np.zeros((3, 3))).shape == (3,)
        for wrong in ({"poses": np.zeros((5, 3))}, {"contact": 7}, {"contact": 0.5}, {"contact": "a"}, {"poses": (0, 0)}):
            with pytest.raises(sp.InputError, match=next(iter(wrong))):
                sp.push_margins(problem, twists, **wrong)


@pytest.mark.parametrize(
    "texts",
    [
        ("tilt:slope=0.2/0", "pressure-shift:offset=0.02/0"),
        ("tilt:slope=0.12/0", "speed-dependence:slope=0.1"),
        ("tilt:slope=0.1/0", "anisotropy-world:ratio=4,direction=0"),
    ],
)
def test_whether_a_slider_rests_is_asked_of_all_effects(texts):
    """Against another optimiser: the greatest pull·v/(F·V) of motions at a creep, from many starts."""
    from scipy.optimize import minimize

    problem = scene(*texts)
    loads, level = loads_of(problem), scene(*texts[1:])
    pull = MASS * 9.81 * problem.effects[[e.effect.id for e in problem.effects].index("tilt")].effect.vector("slope")[0]
    friction = loads_of(level)

    def negative(x):
        v = np.array((np.cos(x[0]) * np.cos(x[1]), np.sin(x[0]) * np.cos(x[1]), np.sin(x[1]) / loads.rho))
        load = friction.at(1e-5 * v[None], np.array(((0.0, 0.0, x[2]),)))[0]
        return -pull * (np.cos(x[2]) * v[0] - np.sin(x[2]) * v[1]) / (load @ v)

    starts = np.random.default_rng(0).uniform(-3, 3, size=(12, 3)) * (1, 0.3, 1)
    best = max(-minimize(negative, x, method="Nelder-Mead").fun for x in starts)
    assert best * 0.97 < loads.resting_share < best * 1.06


def test_bounds_hold_where_the_pressure_is_spread():
    problem = scene(GRAIN, "pressure-spread:scale=4")
    loads = loads_of(problem)
    rng, step = np.random.default_rng(0), 1e-3
    twists, poses = rng.normal(size=(3000, 3)) * (0.02, 0.02, 0.5), rng.uniform(-3, 3, size=(3000, 3))
    before, here, after = (loads.at(twists, poses + np.array((0, 0, d))) / (1, 1, loads.rho) for d in (-step, 0, step))
    assert np.linalg.norm(after - before, axis=1).max() / (2 * step) < loads.changing.per_turn
    assert np.linalg.norm(after - 2 * here + before, axis=1).max() / step**2 < loads.changing.bend


def test_nominal_values_are_no_effect():
    problem = scene("tilt:slope=0/0", "anisotropy-world:ratio=1,direction=0.3", slider=sp.Slider(triangle().vertices))
    assert not problem.acting_effects and loads_of(problem) is None


def test_a_flat_margin_is_checked_at_once(monkeypatch):
    """A straight push up a gradient: the margin is the same all along, the load is not."""
    slider = sp.Slider.rectangle(0.1, 0.1, mass=1.0)
    feet = sp.SupportDistribution(((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03)), (1, 1, 1, 1))
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.04, 0.6)
    problem = sp.PlanningProblem(
        slider, sp.IdealLimitSurface(feet, 3.0), [contact], (0, 0, 0), (0, 1, 0), bounds=(-1, -1, 1, 2),
        effects=[sp.parse_effect("spatial-variation:gradient=0/0.2"), sp.parse_effect("tilt:slope=0/0.01")],
    )  # fmt: skip
    push = sp.Push.from_start(0, (0.0, 0.05, 0.0), 20.0, (0, 0, 0), 0.0)
    asked = []
    loads = loads_of(problem)
    at = loads.at
    monkeypatch.setattr(loads, "at", lambda twists, poses: asked.append(len(twists)) or at(twists, poses))
    found = _margin(problem, push)
    # not a million parts
    assert sum(asked) < 20_000
    assert found == pytest.approx(loads_of(problem).least_margin(contact, push), abs=1e-9)


def test_a_held_arc_keeps_the_mass_on_it():
    """m w (-vy, vx): towards the rotation centre, m w² r."""
    problem = scene("inertia:mass=2.0")
    twist = np.array((0.0, -0.3, 3.0))
    more = loads_of(problem).at(twist[None], np.zeros((1, 3))) - problem.surface.wrench(twist)
    np.testing.assert_allclose(more[0], (2.0 * 3.0 * 0.3, 0.0, 0.0), atol=1e-6)


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("surface", ["points", "polynomial"])
def test_what_holds_along_an_arc_holds_at_every_pose_of_it(name, surface):
    """Against brute force at steps of 0.2 degrees, anywhere within the bounds; and little is refused that holds."""
    problem = scene(*EFFECTS[name], **({"surface": quartic()} if surface == "polynomial" else {}))
    loads, contact = loads_of(problem), problem.contacts[0]
    rng = np.random.default_rng(1)
    n = 150
    ahead = contact.frame[2] + rng.normal(scale=0.3, size=n)
    twists = np.column_stack((np.cos(ahead), np.sin(ahead), rng.normal(scale=4.0, size=n)))
    twists *= (problem.speed / problem.push_speed(twists))[:, None]
    headings = np.column_stack((rng.uniform(-3, 3, n), rng.uniform(-1.5, 1.5, n)))
    cone = contact.cone(loads.rho)
    held = loads.are_stable(twists, headings, np.zeros((n, 1, 3)), cone.normals[None], np.array((0.03,)))
    x0, y0, x1, y1 = problem.bounds
    least = np.empty(n)
    for i in range(n):
        thetas = headings[i, 0] + np.arange(0.0, 1.0001, 1 / max(2, math.ceil(abs(headings[i, 1]) / 0.0035))) * headings[i, 1]
        places = rng.uniform((x0, y0), (x1, y1), size=(len(thetas), 2))
        wrenches = loads.at(np.tile(twists[i], (len(thetas), 1)), np.column_stack((places, thetas)))
        least[i] = cone.margin(normalize_wrench(wrenches, loads.rho)).min()
    assert held.sum() > 10 and (~held).sum() > 10
    assert least[held].min() >= 0.03 - 1e-9
    assert held[least > 0.05].all() if name not in ("spatial-variation", "all") else held[least > 0.08].all()


@given(st.floats(-3, 3), st.floats(-8, 8), st.floats(-0.6, 0.6), st.sampled_from(sorted(EFFECTS)))
@settings(max_examples=30, deadline=None)
def test_the_least_margin_of_a_push_is_found_by_both(theta, omega, off, name):
    """Planner and check have code of their own for it; dense poses never show less."""
    problem = scene(*EFFECTS[name])
    contact = problem.contacts[0]
    ahead = contact.frame[2] + off
    twist = np.array((math.cos(ahead), math.sin(ahead), omega))
    twist *= problem.speed / problem.push_speed(twist)
    push = sp.Push.from_start(0, twist, 3.0, (0.5, 0.4, theta), 0.0)
    loads = loads_of(problem)
    poses = compose(push.start, exp(twist * np.linspace(0.0, 3.0, 2001)[:, None]))
    margins = contact.cone(loads.rho).margin(normalize_wrench(loads.at(np.tile(twist, (2001, 1)), poses), loads.rho))
    found = loads.least_margin(contact, push)
    # what is unstable is refused, however much
    assert found == pytest.approx(_margin(problem, push), abs=5e-7) if found > 0 else _margin(problem, push) < 1e-6
    assert margins.min() - 1e-5 <= found <= margins.min() + 1e-9


@pytest.fixture(scope="module", params=["tilt", "anisotropy-world", "all"])
def planned(request):
    problem = scene(*EFFECTS[request.param])
    return problem, sp.plan(problem, time_limit=120, refinement_budget=500)


def executed(problem, result):
    """How far (m) a plan ends from where it should, on a rig with the problem's effects."""
    contact = problem.contacts[0]
    effects = [entry.effect for entry in problem.effects]
    rig = sp.VirtualRig(problem.slider, problem.surface, contact.mu, sp.Pusher.of_contact(contact, 0.004), effects)
    end = sp.execute_plan(rig, problem, result).final_pose
    return float(np.hypot(*(end - result.pushes[-1].end)[:2]))


def test_plans_under_effects_hold_and_pass_the_check(planned):
    problem, result = planned
    assert result.solved and result.success_probability > 0.95 and result.arrival_probability > 0.95
    assert sp.check_plan(problem, result).valid
    loads = loads_of(problem)
    assert result.min_margin == pytest.approx(min(loads.least_margin(problem.contacts[0], push) for push in result.pushes))
    assert executed(problem, result) < 1e-3


def test_a_plan_that_does_not_know_them_is_refused_by_the_check(planned):
    problem, _ = planned
    blind = sp.plan(problem.with_changes(effects=()), success=0.0, time_limit=60, refinement_budget=0)
    report = sp.check_plan(problem, blind)
    assert not report.valid and "margin" in report.objections[0]


def test_the_quickest_plan_for_a_level_table_slips_on_a_grained_one():
    problem = scene(GRAIN, min_margin=0.0)
    blind = sp.plan(problem.with_changes(effects=()), success=0.0, time_limit=60)
    knowing = sp.plan(problem, success=0.0, time_limit=60)
    assert executed(problem, knowing) < 1e-3 < executed(problem, blind)


@pytest.mark.parametrize("planner", ["ompl-rrtconnect", "ompl-rrt"])
def test_planners_of_ompl_know_effects(planner):
    pytest.importorskip("ompl")
    problem = scene(TILT)
    result = sp.plan(problem, planner, time_limit=60, success=0.0, refinement_budget=0)
    assert result.solved and sp.check_plan(problem, result).valid


def test_success_counts_what_is_uncertain_of_an_effect():
    known = scene(TILT)
    result = sp.plan(known, success=0.0, time_limit=60, refinement_budget=0)
    entry = known.effects[0]
    wide = known.with_changes(effects=[type(entry)(entry.effect, np.diag((0.03, 0.03)) ** 2)])
    drawn = likely_loads(wide, wide.surface, wide.effects, 20, np.random.default_rng(0))
    slopes = np.array([loads.friction.external_force for loads in drawn]) / (MASS * 9.81)
    np.testing.assert_allclose(slopes.mean(axis=0), (0.03, -0.02), atol=0.025)
    assert len(drawn) == 20 and slopes.std(axis=0).min() > 0.015
    assert len(likely_loads(known, known.surface, known.effects, 20, np.random.default_rng(0))) == 1
    alone, stated = (sp.estimate_success(problem, result, 1000).probability for problem in (known, wide))
    assert stated < alone
    # brute force: slopes drawn here, each by itself
    rng, each = np.random.default_rng(5), []
    for slope in np.array((0.03, -0.02)) + 0.03 * rng.normal(size=(40, 2)):
        each.append(sp.estimate_success(scene(f"tilt:slope={slope[0]}/{slope[1]}"), result, 100).probability)
    assert stated == pytest.approx(np.mean(each), abs=0.15)
    # a rig cannot be as every draw would have it
    shifted = scene("pressure-shift:offset=0.01/0")
    entry = shifted.effects[0]
    far = shifted.with_changes(effects=[type(entry)(entry.effect, np.diag((0.05, 0.05)) ** 2)])
    assert 0 <= sp.estimate_success(far, result, 200).probability <= 1
    with pytest.raises(sp.InputError, match="covariance: expected it symmetric"):
        type(entry)(entry.effect, np.array(((1.0, 2.0), (3.0, -4.0))))


def test_alternatives_have_effects_of_their_own():
    plain, sloping = sp.Correction(0.5), sp.Correction(0.5, effects=scene("tilt:slope=0.1/0").effects)
    problem = scene(alternatives=[plain, sloping])
    quick = sp.plan(scene(), success=0.0, time_limit=60, refinement_budget=0)
    alone, both = (sp.estimate_success(p, quick, 1000).probability for p in (scene(), problem))
    assert both < alone
    result = sp.plan(problem, time_limit=60, refinement_budget=200)
    assert result.solved and sp.check_plan(problem, result).valid and result.success_probability > both


@pytest.mark.parametrize(
    "texts, changes, message",
    [
        (("contact-friction:mu=0.4",), {}, r"effects: expected effects that plans know: friction of the fingers is mu"),
        (("contact-geometry:radius=0.004",), {}, "finger_radius"),
        (("model-capacity:degree=2",), {}, "another surface is the scene's model"),
        ((TILT,), {"slider": sp.Slider(triangle().vertices)}, r"slider\.mass: expected a mass in kg, since the effect tilt acts"),
        ((TILT,), {"uncertainty": sp.Uncertainty(start=(0.002, 0.02))}, r"uncertainty\.start: expected 0, 0"),
        (("spatial-variation:gradient=0.5/0",), {"bounds": None}, "bounds: expected bounds"),
        (("spatial-variation:gradient=-3/0",), {}, "expected friction above 0 everywhere within the bounds"),
        ((GRAIN,), {"alternatives": [sp.Correction(1.0, finger_radius=0.004)]}, r"alternatives\[0\]\.finger_radius"),
    ],
)
def test_what_is_not_planned_for_is_refused_by_name(texts, changes, message):
    problem = scene(*texts, **changes)
    with pytest.raises(sp.InputError, match=message):
        sp.plan(problem, time_limit=30)
    plan = sp.plan(scene(), success=0.0, time_limit=60, refinement_budget=0)
    with pytest.raises(sp.InputError, match=message):
        sp.check_plan(problem, plan)


def test_a_slope_needs_newtons():
    """Of a surface in units of mu*N the friction of the support makes them."""
    fitted = quartic()
    scale = 0.3 * MASS * 9.81
    powers = np.array(fitted.exponents).sum(axis=1)
    unit = sp.PolynomialLimitSurface(fitted.coefficients * scale**powers, 4, fitted.characteristic_length, force_unit="mu*N")
    with pytest.raises(sp.InputError, match="support_friction: expected one, since the effect tilt acts"):
        loads_of(scene(TILT, surface=unit))
    twists, poses = np.array(((0.02, 0.01, 0.1),)), np.array(((0.1, 0.2, 0.7),))
    expected = loads_of(scene(TILT, surface=fitted)).at(twists, poses)
    np.testing.assert_allclose(loads_of(scene(TILT, surface=unit, support_friction=0.3)).at(twists, poses), expected, atol=1e-6)


def test_guarantees_are_refused_under_effects():
    with pytest.raises(sp.InputError, match="region: expected model: no guarantee is known under the effect tilt"):
        sp.plan(scene(TILT), region="all-pressure")


def test_a_slope_on_which_the_slider_does_not_rest_has_no_plan():
    problem = scene("tilt:slope=0.4/0")
    result = sp.plan(problem, time_limit=30)
    assert result.status == "no-path" and "does not rest" in result.message
    level = sp.plan(scene(), success=0.0, time_limit=60, refinement_budget=0)
    assert any("does not rest" in words for words in sp.check_plan(problem, level).objections)
