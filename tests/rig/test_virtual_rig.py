import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import small_scene, three_feet, triangle

import stablepush as sp
from stablepush.effects import CATALOGUE, REFERENCE_SPEED, parse_effect
from stablepush.geometry.planar import twist_from_cor
from stablepush.geometry.se2 import compose, inverse, rotate_vectors, transform_points
from stablepush.mechanics.pushing import simulate_push
from stablepush.rig import edge_command, random_pushes

LOAD = 3.5
#: A value in the middle of the range of each effect.
MIDDLE = {
    "anisotropy-world": "ratio=1.2,direction=0.5",
    "anisotropy-object": "ratio=1.2,direction=0.5",
    "speed-dependence": "slope=0.07",
    "spatial-variation": "gradient=0.5/-0.3",
    "drift": "rate=-0.15",
    "pressure-shift": "offset=0.005/0.002",
    "pressure-spread": "scale=0.8",
    "tilt": "slope=0.02/-0.01",
    "inertia": "mass=1.2",
    "contact-friction": "mu=0.35",
    "contact-geometry": "radius=0.009",
    "force-bias": "force=0.2/-0.1",
    "force-rotation": "angle=0.1",
    "frame-offset": "offset=0.003/-0.002",
    "latency": "delay=0.1",
    "model-capacity": "facets=4",
}
NOMINAL = {
    "anisotropy-world": "ratio=1",
    "anisotropy-object": "ratio=1,direction=0.3",
    "speed-dependence": "slope=0",
    "spatial-variation": "gradient=0/0",
    "drift": "rate=0",
    "pressure-shift": "offset=0/0",
    "pressure-spread": "scale=1",
    "tilt": "slope=0/0",
    "inertia": "mass=0",
    "contact-friction": "mu=0.6",
    "contact-geometry": "radius=0.005",
    "force-bias": "force=0/0",
    "force-rotation": "angle=0",
    "frame-offset": "offset=0/0",
    "latency": "delay=0",
}
EVEN, ROUND = sp.IdealLimitSurface(three_feet(), 1), [parse_effect("contact-geometry:radius=0.01")]
#: Effects that change only what is logged.
SENSING = ("force-bias", "force-rotation", "frame-offset", "latency")


def rig(*effects, polynomial=False, two=False, **options):
    slider = sp.Slider(triangle().vertices, mass=1.2, support=three_feet())
    surface = sp.IdealLimitSurface(three_feet(), LOAD)
    if polynomial:
        v = np.random.default_rng(0).normal(size=(60, 3)) * (1, 1, 15)
        surface = sp.fit_limit_surface(surface.wrench(v), v).surface
    pusher = sp.Pusher.two_fingers(0.05, 0.005) if two else sp.Pusher.finger(0.005)
    return sp.VirtualRig(slider, surface, 0.6, pusher, [parse_effect(e) for e in effects], **options)


def campaign(two=False, count=12, **options):
    made = rig(two=two)
    return random_pushes(made.slider, made.pusher, count, groups=2, repeats=2, **options)


def told(made, **options):
    """What the rig's pusher is told for a push of edge 0, 5 cm along it."""
    push = sp.EdgePush.on_edge(made.slider, 0, 0.05, width=made.pusher.width, start=(0, 0, 0), **options)
    return edge_command(push, made.pusher, push.start)


def far():
    """A poke a metre from the origin."""
    return sp.EdgePush.on_edge(triangle(), 0, 0.05, start=(1.0, 0.0, 0.0))


def wrenches(execution):
    """Of the rows of pushes: how far the pusher is from the slider at first depends on its radius."""
    pushed = execution.log.samples["phase"] == "push"
    return np.stack([execution.log.samples[name][pushed] for name in ("fx", "fy", "tau")], axis=-1)


def test_the_catalogue_is_that_of_the_contract():
    assert list(CATALOGUE) == list(MIDDLE)
    for kind in CATALOGUE.values():
        assert kind.parameters
        assert all(p.unit and p.low < p.high for p in kind.parameters)


@pytest.mark.parametrize(
    ("id", "polynomial"),
    (
        *((id, False) for id in MIDDLE),
        *((id, True) for id in ("spatial-variation", "pressure-shift", "drift", "tilt", "latency")),
    ),
)
def test_every_effect_changes_the_log_and_none_at_its_nominal_value(id, polynomial):
    commands = campaign(two=id in ("contact-geometry",), count=6)
    two = id in ("contact-geometry",)
    plain = rig(polynomial=polynomial, two=two).execute(commands)
    middle = rig(f"{id}:{MIDDLE[id]}", polynomial=polynomial, two=two).execute(commands)
    change = np.abs(wrenches(middle) - wrenches(plain)).max()
    shift = max(float(np.abs(a.poses[-1] - b.poses[-1]).max()) for a, b in zip(plain.traces, middle.traces, strict=True))
    assert max(change, 100 * shift) > 1e-3
    if id in SENSING:
        assert shift == 0
    if id in NOMINAL:
        same = rig(f"{id}:{NOMINAL[id]}", polynomial=polynomial, two=two).execute(commands)
        np.testing.assert_allclose(wrenches(same), wrenches(plain), atol=2e-6)
        for a, b in zip(plain.traces, same.traces, strict=True):
            np.testing.assert_allclose(a.poses, b.poses, atol=1e-6)


def test_sensing_effects_mean_what_they_say():
    commands = campaign()
    plain = rig().execute(commands)
    world = lambda e: np.stack(  # noqa: E731
        [
            np.cos(e.log.samples["theta"]) * e.log.samples["fx"] - np.sin(e.log.samples["theta"]) * e.log.samples["fy"],
            np.sin(e.log.samples["theta"]) * e.log.samples["fx"] + np.cos(e.log.samples["theta"]) * e.log.samples["fy"],
        ],
        axis=-1,
    )
    biased = rig("force-bias:force=0.2/-0.1").execute(commands)
    np.testing.assert_allclose(world(biased) - world(plain), np.tile((0.2, -0.1), (len(world(plain)), 1)), atol=1e-9)
    turned = world(rig("force-rotation:angle=0.1").execute(commands))
    c, s = math.cos(0.1), math.sin(0.1)
    np.testing.assert_allclose(turned, world(plain) @ np.array(((c, s), (-s, c))), atol=1e-9)
    offset = rig("frame-offset:offset=0.003/-0.002").execute(commands)
    seen = np.stack([offset.log.samples[n] for n in ("x", "y", "theta")], axis=-1)
    true = np.stack([plain.log.samples[n] for n in ("x", "y", "theta")], axis=-1)
    np.testing.assert_allclose(compose(inverse(true), seen), np.tile((0.003, -0.002, 0), (len(true), 1)), atol=2e-5)
    # the torque about the tracked origin
    f = wrenches(plain)
    np.testing.assert_allclose(wrenches(offset)[:, 2], f[:, 2] - (0.003 * f[:, 1] + 0.002 * f[:, 0]), atol=2e-4)


def test_rows_hold_the_impulse_of_a_touch():
    """With inertia the first touch is a shock: the mean force, times the time, is the momentum that the slider gets."""
    away = told(rig(), speed=0.05)
    commands = [replace(away, pusher_pose=compose(away.pusher_pose, (2e-3, 0, 0)), motion=away.motion[1:])]
    plain, heavy = rig().execute(commands, rows=3), rig("inertia:mass=1.2").execute(commands, rows=3)
    for execution, mass in ((plain, 0.0), (heavy, 1.2)):
        trace, s = execution.traces[0], execution.log.samples
        rows = s["phase"] == "push"
        sensed = rotate_vectors(s["theta"][rows], np.stack((s["fx"][rows], s["fy"][rows]), axis=-1)).mean(axis=0) * trace.t[-1]
        steps = (
            rotate_vectors(0.5 * (trace.poses[:-1, 2] + trace.poses[1:, 2]), trace.wrenches[:, :2]) * np.diff(trace.t)[:, None]
        )
        np.testing.assert_allclose(sensed, steps.sum(axis=0), rtol=1e-3, atol=1e-4)
        friction = made_friction(execution)
        momentum = mass * rotate_vectors(trace.poses[-1, 2], trace.twists[-1, :2])
        np.testing.assert_allclose(steps.sum(axis=0) - friction, momentum, atol=0.02 * 1.2 * 0.05 + 1e-3)


def made_friction(execution):
    """Impulse (2,) in W of the friction of a support of three feet over a push."""
    trace = execution.traces[0]
    loads = sp.IdealLimitSurface(three_feet(), LOAD).wrench(trace.twists)
    middle = 0.5 * (trace.poses[:-1, 2] + trace.poses[1:, 2])
    return (rotate_vectors(middle, loads[:, :2]) * np.diff(trace.t)[:, None]).sum(axis=0)


def test_late_poses_are_those_of_before():
    commands = campaign(count=4, speeds=(0.02, 0.02))
    plain, late = rig().execute(commands, rows=200), rig("latency:delay=0.15").execute(commands, rows=200)
    for name in plain.log.trials["trial"]:
        rows = plain.log.rows(name)
        t, x, lag = plain.log.samples["t"][rows], plain.log.samples["x"][rows], late.log.samples["x"][rows]
        inside = (t > t[5] + 0.2) & (t < t[-1])
        np.testing.assert_allclose(lag[inside], np.interp(t[inside] - 0.15, t, x), atol=3e-5)


def test_drift_runs_over_the_trials_and_scatter_over_repeats():
    commands = campaign(count=11)
    plain, drifted = rig().execute(commands), rig("drift:rate=-0.3").execute(commands)
    for k, (a, b) in enumerate(zip(plain.traces, drifted.traces, strict=True)):
        sizes = np.linalg.norm(b.wrenches[-1]), np.linalg.norm(a.wrenches[-1])
        assert sizes[0] == pytest.approx((1 - 0.3 * k / 10) * sizes[1], rel=1e-6)
    scattered = rig(scatter=0.05).execute(commands, seed=1)
    ratios = [
        np.linalg.norm(b.wrenches[-1]) / np.linalg.norm(a.wrenches[-1])
        for a, b in zip(plain.traces, scattered.traces, strict=True)
    ]
    assert 0.01 < np.std(np.log(ratios)) < 0.12


def test_logs_are_read_back_and_repeat_for_a_seed(tmp_path):
    commands = campaign(two=True)
    made = rig("drift:rate=-0.1", two=True, noise=sp.Noise(0.03, 1e-4, 2e-3), outliers=0.1)
    execution = made.execute(commands, seed=5)
    sp.write_pushlog(execution.log, tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert len(log) == len(commands)
    assert log.rig.contact_kind == "two-point"
    assert log.rig.finger_radius == 0.005
    assert log.rig.support_friction == pytest.approx(LOAD / (1.2 * 9.81))
    assert set(log.samples["phase"]) == {"rest", "approach", "push"}
    assert set(np.unique(log.trials["stable"])) <= {0.0, 1.0}
    loads, twists, names = log.pairs()
    assert len(names) == len(commands) and np.isfinite(loads).all() and np.isfinite(twists).all()
    rest = log.samples["phase"] == "rest"
    assert np.abs(log.samples["fx"][rest]).max() < 1.0
    assert np.isnan(log.samples["c1x"][rest]).all()
    again = made.execute(commands, seed=5)
    for name, values in execution.log.samples.items():
        np.testing.assert_array_equal(values, again.log.samples[name])
    other = made.execute(commands, seed=6)
    assert not np.array_equal(execution.log.samples["fx"], other.log.samples["fx"])


def test_a_batch_is_the_same_for_any_number_of_processes():
    noisy = rig("drift:rate=-0.1", noise=sp.Noise(0.03, 1e-4, 2e-3))
    jobs = [(noisy, campaign(count=5), seed) for seed in range(3)]
    # equal to the last digit: the same compiled code in every process of one machine
    alone, together = sp.execute_batch(jobs, workers=1), sp.execute_batch(jobs, workers=2)
    for a, b in zip(alone, together, strict=True):
        for name, values in a.log.samples.items():
            np.testing.assert_array_equal(values, b.log.samples[name])
    assert not np.array_equal(alone[0].log.samples["fx"], alone[1].log.samples["fx"])


def test_a_campaign_varies_what_it_should():
    commands = random_pushes(rig(two=True).slider, rig(two=True).pusher, 40, seed=1, groups=3, repeats=4)
    assert len(commands) == 40
    groups = [c.group for c in commands]
    assert sorted(set(groups)) == ["", "1", "2", "3"]
    assert all(groups.count(g) == 4 for g in "123")
    assert groups != sorted(groups)
    speeds = np.array([c.speed for c in commands])
    assert speeds.min() < 0.01
    assert speeds.max() > 0.04
    assert {np.isnan(c.sense) for c in commands} == {True, False}
    with pytest.raises(sp.InputError, match="at least"):
        random_pushes(rig().slider, rig().pusher, 5, groups=4)
    assert [c.group for c in random_pushes(rig().slider, rig().pusher, 15)] == [""] * 15
    with pytest.raises(sp.InputError, match="fits"):
        random_pushes(rig().slider, sp.Pusher.two_fingers(1.0, 0.005))


def test_a_support_of_another_degree_is_simulated():
    """The slider then follows the ellipsoid nearest to its feet: further from them than the quartic."""
    commands = campaign(count=6)
    plain, quartic, round_one = (
        rig(*effects).execute(commands) for effects in ((), ("model-capacity:degree=4",), ("model-capacity:degree=2",))
    )
    near, far = (np.abs(wrenches(e) - wrenches(plain)).mean() for e in (quartic, round_one))
    assert 1e-3 < near < far


@pytest.mark.parametrize("newtons", [1.0, 0.1, 0.01])
@pytest.mark.parametrize("degree", [4, 6])
def test_a_support_of_another_degree_pushes_back_as_hard(newtons, degree):
    """Coefficients for light sliders are too large for newtons: the surface then has another unit."""
    nominal = replace(rig(), surface=sp.IdealLimitSurface(three_feet(), newtons))
    commands = campaign(count=6)
    other = replace(nominal, effects=[parse_effect(f"model-capacity:degree={degree}")])
    forces = [np.linalg.norm(wrenches(r.execute(commands))[:, :2], axis=-1).max() for r in (nominal, other)]
    assert forces[1] == pytest.approx(forces[0], rel=0.1)


def test_a_push_is_stable_from_where_all_fingers_touch():
    """Fingers that meet the face one after the other turn the slider first, which is no slip."""
    made = rig(two=True)
    straight = told(made, distance=0.05)
    assert made.execute([straight]).log.trials["stable"][0] == 1
    askew = sp.Command(compose(straight.pusher_pose, (-0.003, 0, 0.02)), [*straight.motion, *straight.motion], np.zeros(3))
    execution = made.execute([askew])
    met = np.flatnonzero((execution.traces[0].modes > 0).all(axis=1))[0]
    assert met > 0.02 * len(execution.traces[0].modes)
    assert np.abs(execution.traces[0].poses[met, 2]) > 5e-3
    assert execution.log.trials["stable"][0] == 1
    # a centre beside the fingers, 6 cm to the left of their middle
    a, b = made.slider.edge(0)
    beside = told(made, cor=a + (0.05 - 0.06) * (b - a) / np.linalg.norm(b - a), sense=1.0, distance=0.01)
    assert made.execute([beside]).log.trials["stable"][0] == 0
    assert made.execute([replace(straight, motion=straight.motion[:1])]).log.trials["stable"][0] == 0


def test_a_pusher_that_would_start_inside_the_slider_comes_from_behind():
    made = rig(two=True)
    command = told(made, distance=0.02)
    displaced = replace(command, start=np.array((0.0, -0.03, 0.4)))
    trace = made.execute([displaced]).traces[0]
    first = shapely.Polygon(transform_points(trace.poses[0], made.slider.vertices))
    centers = transform_points(trace.pushers[0], made.pusher.fingers)
    assert min(first.distance(shapely.Point(c)) for c in centers) > made.pusher.radius
    last = shapely.Polygon(transform_points(trace.poses[-1], made.slider.vertices))
    centers = transform_points(trace.pushers[-1], made.pusher.fingers)
    assert min(last.distance(shapely.Point(c)) for c in centers) > made.pusher.radius - 1e-6
    # the pusher ends where it was told to
    end = simulate_push(made.friction, made.slider, made.pusher, 0.6, (0, 0.3, 0), command.pusher_pose, command.motion).pushers[
        -1
    ]
    np.testing.assert_allclose(trace.pushers[-1], end, atol=1e-12)
    with pytest.raises(sp.InputError, match="inside"):
        simulate_push(made.friction, made.slider, made.pusher, 0.6, (0, -0.03, 0), command.pusher_pose, command.motion)


def test_a_flat_edge_inside_the_slider_comes_from_behind():
    made = rig()
    edge = sp.Pusher.edge(0.05)
    command = edge_command(sp.EdgePush.on_edge(made.slider, 0, 0.05, distance=0.02, width=0.05), edge, np.zeros(3))
    trace = made.execute([replace(command, start=np.array((0.0, -0.03, 0.4)))]).traces[0]
    line = shapely.LineString(transform_points(trace.pushers[0], edge.fingers))
    assert not line.intersects(shapely.Polygon(transform_points(trace.poses[0], made.slider.vertices)))
    assert (trace.modes > 0).any()


def test_a_plan_on_the_nominal_rig_ends_where_it_should():
    problem = small_scene()
    result = sp.plan(problem)
    contact = problem.contacts[0]
    made = sp.VirtualRig(problem.slider, problem.surface, contact.mu, sp.Pusher.of_contact(contact, 0.005))
    execution = sp.execute_plan(made, problem, result)
    np.testing.assert_allclose(execution.final_pose, result.pushes[-1].end, atol=1e-9)
    assert (execution.log.trials["stable"] == 1).all()
    assert len(execution.log) == len(result.pushes)


def test_every_contact_has_its_own_friction():
    """Where friction is unequal, a turn is held by one contact and slips on another like it."""
    problem = small_scene()
    slippery = sp.PushContact(problem.contacts[0].points, problem.contacts[0].normals, 0.0)
    made = sp.VirtualRig(problem.slider, problem.surface, 0.9, sp.Pusher.of_contact(slippery, 0.005))
    twist = twist_from_cor((-0.3, 0.05), 1) * 0.05
    rough, smooth = (
        made.execute([sp.contact_push(c, twist, 3.0, radius=0.005, pose=(0, 0, 0), reset=True)])
        for c in (problem.contacts[0], slippery)
    )
    assert rough.log.trials["stable"][0] == 1
    assert smooth.log.trials["stable"][0] == 0


def test_drift_in_the_closed_loop_runs_over_the_plan():
    problem = small_scene()
    result = sp.plan(problem)
    made = sp.VirtualRig(
        problem.slider, problem.surface, 0.9, sp.Pusher.of_contact(problem.contacts[0], 0.005), [parse_effect("drift:rate=-0.3")]
    )
    closed, opened = sp.execute_closed_loop(made, problem, result, 0.5), sp.execute_plan(made, problem, result)
    assert (closed.plans, closed.stop_reason) == (1, "")
    np.testing.assert_array_equal(closed.traces[-1].wrenches, opened.traces[-1].wrenches)


def test_the_closed_loop_says_why_it_ends():
    """Without friction at the fingers every push slips, so no number of plans arrives; the last plan is followed to its end."""
    problem = small_scene()
    result = sp.plan(problem)
    pusher, effects = sp.Pusher.of_contact(problem.contacts[0], 0.005), [parse_effect("contact-friction:mu=0")]
    made = sp.VirtualRig(problem.slider, problem.surface, 0.9, pusher, effects)
    execution = sp.execute_closed_loop(made, problem, result, 1e-6, attempts=1)
    assert execution.plans == 2 or "no plan" in execution.stop_reason
    assert execution.stop_reason


def test_planning_anew_brings_a_slider_home_that_left_its_plan():
    """The pressure is not where the plan believes it to be: pushes near the edge of the stable set slip."""
    problem = small_scene(min_margin=0.02)
    result = sp.plan(problem)
    contact = problem.contacts[0]
    effects = [parse_effect("pressure-shift:offset=-0.008/0.006")]
    made = sp.VirtualRig(problem.slider, problem.surface, contact.mu, sp.Pusher.of_contact(contact, 0.005), effects)
    opened = sp.execute_plan(made, problem, result)
    closed = sp.execute_closed_loop(made, problem, result, 0.01)

    def miss(execution):
        return float(np.hypot(*(execution.final_pose[:2] - problem.goal[:2])))

    assert len(closed.log) > len(opened.log)
    assert miss(opened) > 0.05
    assert miss(closed) < 0.011


@pytest.mark.parametrize(
    ("make", "words"),
    (
        (lambda: rig("drift:rate=0.1", "drift:rate=0.2"), "given twice"),
        (lambda: rig("gravity:g=3"), "expected one of"),
        (lambda: rig("drift:rate=a"), "expected numbers"),
        (lambda: rig("drift"), "drift:rate"),
        (lambda: rig("tilt:slope=0.1"), "expected 2"),
        (lambda: rig("anisotropy-world:ratio=0.5"), ">= 1"),
        (lambda: rig("pressure-spread:scale=0"), "> 0"),
        (lambda: rig("latency:delay=nan"), "latency: delay"),
        (lambda: rig("drift:rate=0.1,rate=0.2"), "given twice"),
        (lambda: rig("drift:rate"), "param=value"),
        (lambda: rig(outliers=-1), "outliers"),
        (lambda: rig(scatter=2), "scatter"),
        (lambda: rig(noise=sp.Noise(-1, 0, 0)), "noise.force"),
        (lambda: rig("contact-geometry:radius=1e6"), "<= 1, got"),
        (lambda: sp.VirtualRig(triangle(), sp.IdealLimitSurface(three_feet(), 1), 0.5, sp.Pusher(), None), "effects"),
        (
            lambda: sp.VirtualRig(triangle(), EVEN, 0.5, sp.Pusher.edge(0.05), [parse_effect("contact-geometry:radius=0.01")]),
            "edge",
        ),
        (lambda: sp.Effect("drift", [1]), "mapping"),
        (lambda: sp.Effect("force-bias", {"force": "12"}), "number"),
        (lambda: parse_effect(None), "text"),
        (lambda: rig().execute(campaign(), rows=0), "rows"),
        (lambda: rig().execute(campaign(), seed=-1), "seed"),
        (lambda: rig().execute([sp.Command(np.zeros(3), [], np.ones(3))]), "push 1: motion"),
        (lambda: sp.EdgePush.on_edge(triangle(), 0.5, 0.05), "edge"),
        (lambda: sp.EdgePush.on_edge(triangle(), 0, -0.05), "arc_length"),
        (lambda: sp.EdgePush.on_edge(triangle(), 0, 0.05, direction=2.0), "direction"),
        (lambda: sp.EdgePush.on_edge(triangle(), 0, 0.05, cor=(0, 0)), "sense"),
        (lambda: told(rig(), cor=(0, 5.0), sense=-1), "cor"),
        (lambda: campaign(speeds=(0, 1)), "speeds"),
        (lambda: campaign(field=math.nan), "field"),
        (lambda: campaign(turning=2), "turning"),
        (lambda: campaign(count=20.5), "count"),
        (lambda: sp.execute_batch([], workers=0), "workers"),
        (lambda: rig("spatial-variation:gradient=-3/0").execute([far()]), "push 1: effects and scatter: expected friction"),
        (lambda: rig("tilt:slope=0.25/0", "drift:rate=-0.9").execute([far(), far()]), "push 2: effect tilt"),
        (lambda: rig("model-capacity:facets=3,degree=4"), "either"),
        (lambda: rig("model-capacity:degree=5"), "2, 4, 6"),
        (lambda: rig("tilt:slope=0.4/0"), "friction holds"),
        (lambda: rig("tilt:slope=0.6/0"), "<= 0.5, got"),
        (lambda: rig("pressure-shift:offset=0.2/0"), "under the slider"),
        (lambda: sp.Effect("drift", {"rate": "x"}), "rate: expected"),
        (lambda: sp.Effect("drift", {"rate": None}), "rate: expected"),
        (lambda: sp.VirtualRig(triangle(), sp.IdealLimitSurface(three_feet(), 1), 0.5, sp.Pusher(), ["drift"]), "effects"),
        (lambda: rig().execute([]), "at least one"),
        (lambda: sp.EdgePush.on_edge(rig().slider, 5, 0.05), "edge"),
        (lambda: rig().execute([sp.Command(np.zeros(3), [])]), "where the slider starts"),
    ),
)
def test_bad_input(make, words):
    with pytest.raises(sp.InputError, match=words):
        make()


def test_reference_speed_is_stated():
    assert REFERENCE_SPEED == 0.02
