"""What is not known is part of the problem: scenarios, their common stable set, and plans that succeed with a given level."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from conftest import RHO, one_line, small_scene, three_feet, triangle

import stablepush as sp
from stablepush.cli import main
from stablepush.core import Deadline, binomial_interval
from stablepush.planning.chance.scenario_choice import MOST, Choice, choice_of
from stablepush.planning.chance.scenarios import draw_scenarios, likely_surfaces
from stablepush.planning.chance.success import _cause, first_losses
from stablepush.stability import Case, common_region


def problem(contacts=1, **options):
    """A triangle identified from eight noisy pokes, pushed by two fingers."""
    rng = np.random.default_rng(0)
    twists = rng.normal(size=(8, 3)) / (1, 1, RHO)
    loads = sp.IdealLimitSurface(three_feet(), 5.0).wrench(twists) * (1 + 0.03 * rng.normal(size=(8, 3)))
    surface = sp.fit_limit_surface(loads, twists, slider=triangle(), seed=0).surface
    fingers = [sp.PushContact.on_edge(triangle(), k, 0.05, 0.03, 0.5) for k in range(contacts)]
    return sp.PlanningProblem(triangle(), surface, fingers, (0, 0, 0), (0.3, 0.1, 0.5), **options)


def test_margins_of_scenarios_are_those_of_their_own_oracles():
    """In the frame of the true centre of mass, with its own contact and surface."""
    scenarios = draw_scenarios(problem(2), 20, seed=1)
    twists = np.random.default_rng(2).normal(size=(7, 3)) / (1, 1, RHO)
    for number in (0, 1):
        found = scenarios.margins(number, twists)
        for row in range(0, 20, 3):
            contact, (x, y) = scenarios.contact(row, number), scenarios.center_of_mass[row]
            moved = twists + twists[:, 2:] * (-y, x, 0)
            own = sp.PushContact(contact.points - (x, y), contact.normals, contact.mu)
            oracle = sp.StabilityOracle(scenarios.surfaces[scenarios.surface[row]], own)
            np.testing.assert_allclose(found[row], oracle.margin(moved), atol=1e-9)


def test_contacts_that_are_no_line_have_the_same_margins():
    slider = triangle()
    a, b = (sp.PushContact.on_edge(slider, k, 0.06, 0.0, 0.5) for k in (0, 1))
    corner = sp.PushContact(np.concatenate((a.points, b.points)), np.concatenate((a.normals, b.normals)), 0.5)
    asked = replace_contacts(problem(), [corner])
    scenarios = draw_scenarios(asked, 8, seed=1)
    twists = np.random.default_rng(2).normal(size=(5, 3)) / (1, 1, RHO)
    own = scenarios.contact(3, 0)
    x, y = scenarios.center_of_mass[3]
    oracle = sp.StabilityOracle(
        scenarios.surfaces[scenarios.surface[3]], sp.PushContact(own.points - (x, y), own.normals, own.mu)
    )
    np.testing.assert_allclose(scenarios.margins(0, twists)[3], oracle.margin(twists + twists[:, 2:] * (-y, x, 0)), atol=1e-9)


def replace_contacts(given, contacts):
    return sp.PlanningProblem(given.slider, given.surface, contacts, given.start, given.goal)


def test_the_common_region_is_what_every_case_calls_stable():
    """Against the oracles of all cases, at twists all over the sphere."""
    scenarios = draw_scenarios(problem(), 12, seed=3)
    cases = [
        Case(scenarios.surfaces[scenarios.surface[row]], scenarios.contact(row, 0), scenarios.center_of_mass[row])
        for row in range(len(scenarios))
    ]
    region = common_region(cases)
    twists = np.random.default_rng(4).normal(size=(4000, 3)) / (1, 1, RHO)
    twists[::5, 2] = 0.0
    least = scenarios.margins(0, twists).min(axis=0)
    inside = region.contains_twists(twists)
    clear = np.abs(least) > 1e-4
    assert clear.sum() > 3900 and inside.sum() > 50
    np.testing.assert_array_equal(inside[clear], least[clear] > 0)


def test_chosen_scenarios_all_hold_what_is_in_their_region():
    choice = Choice(problem(), seed=0)
    most_hold, all_hold, more_hold = (choice.regions(*asked, Deadline(), {0})[0] for asked in ((100, 10), (100, 0), (200, 0)))
    scenarios = draw_scenarios(problem(), MOST, seed=0).take(np.arange(100))
    assert more_hold.solid_angle() < all_hold.solid_angle()
    assert 0 < all_hold.solid_angle() < most_hold.solid_angle()
    twists = np.concatenate([all_hold.boundary_twists(1)[0], all_hold.boundary_twists(-1)[0]])
    assert scenarios.margins(0, twists).min() > -2e-4


def test_a_plan_succeeds_as_often_as_it_says_on_other_scenarios():
    asked = problem()
    quickest = sp.plan(asked, success=0, time_limit=60, refinement_budget=0)
    sure = sp.plan(asked, success=0.98, time_limit=60, refinement_budget=0)
    assert sure.success_probability > 0.96
    assert quickest.success_probability < 0.5
    assert quickest.duration < sure.duration < 1.6 * quickest.duration
    for result in (quickest, sure):
        lost = first_losses(draw_scenarios(asked, 4000, seed=77, stream=5), result).push
        low, high = binomial_interval(int((lost < 0).sum()), 4000, 0.999)
        assert low - 0.02 <= result.success_probability <= high + 0.02
        assert sp.check_plan(asked, result).valid
    wrong = replace(quickest, success_probability=0.98)
    assert any("success_probability" in words for words in sp.check_plan(asked, wrong).objections)


def test_what_is_lost_is_simulated_and_named():
    asked = problem()
    quickest = sp.plan(asked, success=0, time_limit=60, refinement_budget=0)
    found = quickest.success
    assert len(found.ends) and np.isfinite(found.ends).all()
    assert sum(share for _, share, _ in found.failures) == pytest.approx(1 - found.probability)
    assert 0 <= found.arrival <= 1


def test_nothing_unknown_leaves_nothing_to_chance():
    """A known support and no uncertainty: the quickest plan sticks in every scenario, and arrives."""
    known = small_scene()
    certain = sp.Uncertainty(contact_friction=0.0, contact_place=0.0, center_of_mass=0.0)
    asked = sp.PlanningProblem(
        known.slider, known.surface, known.contacts, known.start, known.goal, known.obstacles, known.bounds, uncertainty=certain
    )
    result = sp.plan(asked, success=0, time_limit=60, refinement_budget=0)
    found = sp.estimate_success(asked, result, 200)
    assert found.probability == 1.0 and found.arrival == 1.0 and not found.failures


def test_a_level_that_no_plan_reaches_is_said():
    """Friction that may be anything from very little to much: the surest plan comes with its number, or none."""
    asked = problem(uncertainty=sp.Uncertainty(contact_friction=(0.02, 0.8), contact_place=0.02))
    with pytest.warns(sp.PlanWarning, match="succeeds with probability 0.98"):
        result = sp.plan(asked, success=0.98, time_limit=30, refinement_budget=0)
    assert result.solved and result.success_probability < 0.9
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refused = sp.plan(asked, success=0.98, require_success=0.97, time_limit=30, refinement_budget=0)
    assert refused.status == "no-path" and "0.97 is required" in refused.message


def test_surfaces_without_an_ensemble():
    known = small_scene()
    assert likely_surfaces(known) == [known.surface]
    bare = sp.Slider(triangle().vertices)
    surface = sp.PolynomialLimitSurface(np.array((1, 0, 0, 1, 0, 1.0)), 2, RHO)
    unknown = sp.PlanningProblem(bare, surface, known.contacts, (0, 0, 0), (0.1, 0, 0))
    drawn = likely_surfaces(unknown)
    assert len(drawn) > 10
    assert all(np.abs(one.support.weights @ one.support.points).max() < 1e-6 for one in drawn)


def test_scenes_and_plans_keep_it(tmp_path, capsys):
    asked = problem(bounds=(-1, -1, 1, 1), uncertainty=sp.Uncertainty((0.4, 0.6), 0.001, 0.0, (0.001, 0.01)))
    sp.save_scene(asked, tmp_path / "scene.json")
    assert sp.load_scene(tmp_path / "scene.json").uncertainty == asked.uncertainty
    arguments = ["plan", str(tmp_path / "scene.json"), "--success", "0.9", "--refinement-budget", "0"]
    assert main([*arguments, "-o", str(tmp_path / "plan.json")]) == 0
    assert "sticks throughout with probability" in capsys.readouterr().out
    plan = sp.load_plan(tmp_path / "plan.json")
    assert plan.success_interval[0] <= plan.success_probability <= plan.success_interval[1]
    assert 0 <= plan.arrival_probability <= 1
    assert main(["check", str(tmp_path / "scene.json"), str(tmp_path / "plan.json")]) == 0
    capsys.readouterr()
    scene = json.loads((tmp_path / "scene.json").read_text())
    for value, words in BAD:
        (tmp_path / "bad.json").write_text(json.dumps({**scene, "uncertainty": value}))
        one_line(capsys, ["check", tmp_path / "bad.json", tmp_path / "plan.json"], "bad.json", "uncertainty", words)
    one_line(capsys, [*arguments[:2], "--success", "2", "-o", str(tmp_path / "p.json")], "--success", "0 to 1")


BAD = (
    ({"contact_place": -0.001}, ">= 0"),
    ({"contact_friction": 1.0}, "below 1"),
    ({"contact_friction": [0.0, 0.5]}, "above 0"),
    ({"contact_friction": [0.6, 0.5]}, "lower end first"),
    ({"start": [0.0, -1.0]}, ">= 0"),
    ({"center_of_mass": "1 mm"}, "number"),
    ({"friction": 0.1}, "friction"),
)


def test_the_worst_contact_lies_in_all_that_a_contact_may_be():
    """Guarantees hold with every friction and place: against the cones of contacts within the uncertainty."""
    slider = triangle()
    nominal = sp.PushContact.on_edge(slider, 1, 0.1, 0.05, 0.6)
    unknown = sp.Uncertainty(contact_friction=0.2, contact_place=0.004)
    worst = unknown.worst_contact(nominal)
    assert worst.mu == pytest.approx(0.48)
    assert np.linalg.norm(np.subtract(*worst.points)) == pytest.approx(0.042)
    rng = np.random.default_rng(0)
    along = np.array((-nominal.normals[0][1], nominal.normals[0][0]))
    rays = worst.rays(RHO)
    # on the boundary of the worst cone some contact is at its own: it is not smaller than it must be
    touched = np.zeros(len(worst.cone(RHO).normals), dtype=bool)
    for _ in range(300):
        mu, aside = (0.48, 0.72)[rng.integers(2)], 0.004 * rng.choice((-1, 1, rng.uniform(-1, 1)))
        cone = sp.PushContact(nominal.points + aside * along, nominal.normals, mu).cone(RHO)
        assert (rays @ cone.normals.T).min() > -1e-9
        near = np.abs(worst.cone(RHO).normals @ cone.normals.T - 1).min(axis=1) < 1e-9
        touched |= near
    assert touched.all()
    finger = sp.PushContact.on_edge(slider, 1, 0.1, 0.0, 0.6)
    with pytest.raises(sp.UnsupportedContactError, match="two fingers"):
        unknown.worst_contact(finger)
    assert sp.Uncertainty(contact_place=0.0).worst_contact(finger).mu == pytest.approx(0.54)


def test_plans_for_every_pressure_hold_for_every_friction_and_place_and_say_what_they_assume():
    asked = problem()
    result = sp.plan(asked, success=0, region="all-pressure", time_limit=60, refinement_budget=0)
    assert result.solved
    assert "contact friction from 0.45 to 0.55" in result.message and "centre of mass" in result.message
    twists = np.array([push.twist for push in result.pushes])
    for mu in (0.45, 0.55):
        for aside in (-0.002, 0.002):
            contact = asked.contacts[0]
            along = np.array((-contact.normals[0][1], contact.normals[0][0]))
            moved = sp.PushContact(contact.points + aside * along, contact.normals, mu)
            assert sp.all_pressure_region(asked.slider, moved).contains_twists(twists).all()


def test_a_finger_that_may_be_off_the_end_of_its_edge_is_told():
    asked = problem()
    near = sp.PushContact.on_edge(asked.slider, 0, 0.021, 0.04, 0.5)
    with pytest.warns(sp.PlanWarning, match="contact 0: a finger is 1 mm from a corner and may be 2 mm aside"):
        result = sp.plan(asked.with_changes(contacts=[near]), success=0, refinement_budget=0, time_limit=60)
    assert result.solved and "stays on its edge" in result.message


def test_plans_for_one_slider_share_what_is_known_of_its_scenarios():
    asked = problem()
    assert choice_of(asked.with_changes(goal=(0.2, 0.1, 0.3)), 0) is choice_of(asked, 0)
    assert choice_of(asked, 1) is not choice_of(asked, 0)
    assert choice_of(asked.with_changes(uncertainty=sp.Uncertainty(contact_place=0.001)), 0) is not choice_of(asked, 0)
    # and the plan is the one that is made from scratch
    fresh = problem()
    found = [sp.plan(p, refinement_budget=0, time_limit=60) for p in (asked.with_changes(tolerance=(0.01, 0.1)), asked, fresh)]
    np.testing.assert_array_equal(found[1].pushes[-1].end, found[2].pushes[-1].end)


def test_what_few_scenarios_have_in_common_is_no_cause():
    """Three of two thousand lay on one side by chance; and a limit that half of all lie beyond says nothing."""
    asked = problem()
    scenarios = draw_scenarios(asked, 400, seed=1)
    push = sp.plan(asked, success=0, refinement_budget=0).pushes[0]
    order = np.argsort(scenarios.contact_mu[:, push.contact])
    assert _cause(scenarios, push, order[:3]) == "too rarely to say why"
    assert _cause(scenarios, push, order[:40]).startswith("always with a contact friction below 0.4")
    assert _cause(scenarios, push, order[:180]) == "mostly with low contact friction"
    assert _cause(scenarios, push, order[-180:]) == "mostly with high contact friction"
