import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

import stablepush as sp
from stablepush.effects import principal
from stablepush.geometry.planar import point_velocity, transport_twist, twist_from_cor, wrench_from_force
from stablepush.geometry.se2 import compose, inverse, transform_points
from stablepush.mechanics.pushing import Pusher, TableFriction, push_twist, simulate_push

SQUARE = np.array(((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)))
FORCE, TORQUE = 3.0, 0.11


def square():
    return sp.Slider(SQUARE, mass=1.0)


def uniform(spacing=0.02):
    return sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(SQUARE, spacing), FORCE)


def ellipsoid():
    """``(fx² + fy²)/a² + tau²/b² = 1``."""
    rho = 0.04
    return sp.PolynomialLimitSurface([1 / FORCE**2, 0, 0, 1 / FORCE**2, 0, rho**2 / TORQUE**2], 2, rho)


def closed_form(point, normal, mu, velocity):
    """Lynch, Maekawa, Tanie (1992): twist of a slider with an ellipsoidal surface under one contact, and its mode."""
    c2, (x, y) = (TORQUE / FORCE) ** 2, point
    ux, uy = velocity
    size = c2 + x * x + y * y
    stick = np.array(((c2 + x * x) * ux + x * y * uy, x * y * ux + (c2 + y * y) * uy)) / size
    omega = (x * stick[1] - y * stick[0]) / c2
    force = stick
    tangent = np.array((-normal[1], normal[0]))
    along, across = force @ normal, force @ tangent
    if abs(across) <= mu * along:
        return np.array((*stick, omega)), "sticking"
    # the force keeps to the edge of the cone; the normal velocity of the contact is the pusher's
    side = 1.0 if across > 0 else -1.0
    f = normal + side * mu * tangent
    twist = np.array((*f, (x * f[1] - y * f[0]) / c2))
    at_contact = point_velocity(twist, np.array([point]))[0]
    return twist * (np.dot(velocity, normal) / (at_contact @ normal)), "right" if side > 0 else "left"


@settings(max_examples=300)
@given(st.integers(0, 2**31))
def test_one_contact_on_an_ellipsoid_against_the_closed_form(seed):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi)
    normal = np.array((np.cos(angle), np.sin(angle)))
    point = -0.05 * normal + rng.uniform(-0.05, 0.05) * np.array((-normal[1], normal[0]))
    mu = rng.uniform(0, 1.2)
    heading = angle + rng.uniform(-1.5, 1.5)
    velocity = rng.uniform(0.001, 0.1) * np.array((np.cos(heading), np.sin(heading)))
    twist, mode = closed_form(point, normal, mu, velocity)
    answer = push_twist(ellipsoid(), sp.PushContact([point], [normal], mu), (*velocity, 0.0))
    assert answer.solutions == 1
    np.testing.assert_allclose(answer.twist, twist, rtol=1e-9, atol=1e-9 * np.linalg.norm(velocity) / 0.05)
    assert answer.modes == [mode]


@settings(max_examples=300)
@given(st.integers(0, 2**31), st.sampled_from(("ideal", "uniform", "ellipsoid", "anisotropic")), st.integers(1, 3))
def test_answers_obey_the_laws_of_contact(seed, kind, count):
    """Balance, no penetration, no pull, Coulomb's law with the slip opposed: checked on the answer, whatever found it."""
    rng = np.random.default_rng(seed)
    feet = sp.IdealLimitSurface(sp.SupportDistribution(rng.uniform(-0.05, 0.05, (4, 2)), rng.uniform(0.2, 1, 4)), FORCE)
    friction = {
        "ideal": TableFriction(feet),
        "uniform": TableFriction(uniform()),
        "ellipsoid": TableFriction(ellipsoid()),
        "anisotropic": TableFriction(uniform(), world_anisotropy=principal(1.4, 0.3), gradient=(0.5, -1.0)),
    }[kind]
    edge = rng.integers(0, 4)
    points, normals = [], []
    for _ in range(count):
        a, b = SQUARE[edge], SQUARE[(edge + 1) % 4]
        points.append(a + rng.uniform(0.05, 0.95) * (b - a))
        normals.append(np.array((a[1] - b[1], b[0] - a[0])) / 0.1)
        edge = (edge + int(rng.integers(0, 2))) % 4
    mu = rng.uniform(0.05, 1.0)
    contact = sp.PushContact(points, normals, mu)
    pushed = rng.normal(size=3) * (0.03, 0.03, 0.6)
    pose = rng.normal(size=3)
    answer = push_twist(friction, contact, pushed, pose)
    if answer.solutions == 0:
        return
    speed = float(np.abs(pushed[:2]).max() + 0.05 * abs(pushed[2]))
    total = wrench_from_force(contact.points, answer.forces).sum(axis=0)
    np.testing.assert_allclose(total, answer.wrench, atol=1e-7)
    if not answer.twist.any():
        assert not answer.forces.any()
    else:
        # the load of the motion, from a pusher that holds it everywhere
        grip = sp.PushContact([(-0.1, -0.1), (0.1, -0.1), (0, 0.1)], [(1, 1), (-1, 1), (0, -1)], 10.0)
        held = push_twist(friction, grip, answer.twist, pose)
        np.testing.assert_allclose(held.twist, answer.twist, atol=1e-12)
        np.testing.assert_allclose(held.wrench, answer.wrench, atol=2e-6)
    slip = point_velocity(answer.twist - pushed, contact.points)
    tangents = np.stack((-contact.normals[:, 1], contact.normals[:, 0]), axis=-1)
    opening, across = (slip * contact.normals).sum(axis=1), (slip * tangents).sum(axis=1)
    along, side = (answer.forces * contact.normals).sum(axis=1), (answer.forces * tangents).sum(axis=1)
    assert (opening >= -1e-7 * speed).all()
    assert (along >= -1e-7).all()
    assert (np.abs(side) <= mu * along + 1e-6).all()
    for k, mode in enumerate(answer.modes):
        if mode == "open":
            assert not answer.forces[k].any()
            continue
        assert abs(opening[k]) <= 1e-7 * speed
        if mode == "sticking":
            assert abs(across[k]) <= 1e-7 * speed
        else:
            assert side[k] == pytest.approx(-mu * along[k] * (1 if mode == "left" else -1), abs=1e-6)
            assert across[k] * (1 if mode == "left" else -1) >= -1e-9 * speed


def two_fingers(mu=0.6):
    return sp.PushContact.on_edge(square(), 3, 0.05, 0.06, mu)


@settings(max_examples=60)
@given(st.integers(0, 2**31), st.booleans())
def test_stable_rotations_stay_stuck_and_the_others_do_not(seed, quartic):
    rng = np.random.default_rng(seed)
    surface = ellipsoid() if quartic else uniform()
    contact = two_fingers(rng.uniform(0.2, 1.0))
    sense = rng.choice((-1, 1))
    cor = rng.normal(size=2) * 0.15
    twist = twist_from_cor(cor, sense)
    margin = float(sp.StabilityOracle(surface, contact).margin(twist))
    if abs(margin) < 0.02:
        return
    pusher = Pusher.of_contact(contact, 0.004)
    docked = pusher.docked(contact)
    motion = [(transport_twist(twist, inverse(docked)), np.pi / 2)]
    trace = simulate_push(surface, square(), pusher, contact.mu, (0, 0, 0), docked, motion, step=1e-3)
    relative = compose(inverse(trace.pushers), trace.poses)
    moved = np.abs(relative - relative[0]).max(axis=0)
    assert len(trace.t) > 10
    assert (moved.max() < 1e-9) == (margin > 0)


def test_the_midpoint_rule_is_of_second_order():
    surface, pusher, motion = uniform(), Pusher.finger(0.005), [((0.02, 0.002, 0.1), 2.0)]
    steps = (8e-4, 4e-4, 2e-4, 2e-5)
    ends = [simulate_push(surface, square(), pusher, 0.9, (0, 0, 0), (-0.055, 0.01, 0), motion, step=h).poses[-1] for h in steps]
    errors = [float(np.abs(end - ends[-1]).max()) for end in ends[:-1]]
    assert errors[0] < 1e-4
    assert errors[1] < 0.35 * errors[0]
    assert errors[2] < 0.35 * errors[1]


def test_meeting_the_slider_costs_little_of_the_accuracy():
    surface, pusher, motion = uniform(), Pusher.finger(0.005), [((0.02, 0, 0.1), 4.0)]
    ends = [
        simulate_push(surface, square(), pusher, 0.1, (0, 0, 0.2), (-0.065, 0.0, 0.3), motion, step=h).poses[-1]
        for h in (2.5e-4, 1e-5)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=5e-5)


@pytest.mark.parametrize("mu", (0.0, 0.15, 0.8))
def test_gaps_do_not_drift(mu):
    """A finger that pushes far, slides and rolls stays in touch to far below what a laboratory sees."""
    pusher = Pusher.finger(0.006)
    motion = [((0.03, 0.004, 0.3), 4.0), ((0.03, 0.0, -0.5), 3.0)]
    trace = simulate_push(uniform(), square(), pusher, mu, (0, 0, 0), (-0.056, 0.01, 0), motion, step=2.5e-4)
    touching = (trace.modes[:, 0] > 0) & (np.roll(trace.modes[:, 0], -1) > 0)
    assert touching.sum() > 300
    centers = compose(inverse(trace.poses), trace.pushers)[1:, :2]
    gaps = shapely.distance(shapely.Polygon(SQUARE), shapely.points(centers)) - 0.006
    assert np.abs(gaps[touching][:-1]).max() < 2e-7


def test_a_pusher_that_leaves_leaves_the_slider():
    contact = two_fingers()
    pusher = Pusher.of_contact(contact, 0.004)
    docked = pusher.docked(contact)
    trace = simulate_push(uniform(), square(), pusher, 0.5, (0, 0, 0), docked, [((0.02, 0, 0), 1.0), ((-0.02, 0.01, 0), 1.0)])
    half = len(trace.modes) // 2
    assert (trace.modes[:40] == 1).all()
    assert (trace.modes[-40:] == 0).all()
    assert not trace.wrenches[-40:].any()
    np.testing.assert_allclose(trace.poses[-1], (0.02, 0, 0), atol=1e-9)
    assert np.isnan(trace.points[-1]).all()
    assert half > 40


def test_a_finger_meets_the_slider_on_its_way():
    pusher = Pusher.finger(0.005)
    trace = simulate_push(uniform(), square(), pusher, 0.5, (0, 0, 0), (-0.075, 0, 0), [((0.02, 0, 0), 3.0)])
    # 20 mm of free way, 40 mm pushed through the centre
    np.testing.assert_allclose(trace.poses[-1], (0.04, 0, 0), atol=1e-9)
    first = np.flatnonzero(trace.modes[:, 0])[0]
    assert trace.t[first] == pytest.approx(1.0, abs=0.02)


def test_a_flat_edge_turns_a_slider_until_they_are_flush():
    edge = Pusher.edge(0.2)
    trace = simulate_push(uniform(), square(), edge, 0.3, (0, 0, 0.3), (-0.075, 0.0, 0.0), [((0.02, 0, 0), 6.0)])
    assert math.remainder(trace.poses[-1, 2], np.pi / 2) == pytest.approx(0.0, abs=1e-5)
    assert (trace.modes[-1] > 0).all()
    gap = transform(trace.poses[-1])[:, 0].min() - trace.pushers[-1, 0]
    assert abs(gap) < 1e-6


def transform(pose):
    from stablepush.geometry.se2 import transform_points

    return transform_points(pose, SQUARE)


def test_flat_edges_and_fingers_at_their_ends_agree():
    """A pusher narrower than the face it pushes touches at its ends."""
    motion = [((0.02, 0.004, 0.2), 1.0)]
    edge = simulate_push(uniform(), square(), Pusher.edge(0.06), 0.5, (0, 0, 0), (-0.05, 0.01, 0), motion)
    fingers = simulate_push(uniform(), square(), Pusher.two_fingers(0.06), 0.5, (0, 0, 0), (-0.05, 0.01, 0), motion)
    np.testing.assert_allclose(edge.poses[-1], fingers.poses[-1], atol=1e-5)  # fingers of no radius have 1 µm


def held(friction, twist, pose=(0, 0, 0)):
    """Load of a twist of a slider that is held all round."""
    grip = sp.PushContact([(-0.1, -0.1), (0.1, -0.1), (0, 0.1)], [(1, 1), (-1, 1), (0, -1)], 10.0)
    answer = push_twist(friction, grip, twist, pose)
    np.testing.assert_allclose(answer.twist, twist, atol=1e-14)
    return answer.wrench


def test_effects_of_the_support_mean_what_they_say():
    surface = uniform()
    twist = np.array((0.03, 0.04, 0.0))
    np.testing.assert_allclose(held(surface, twist), surface.wrench(twist), atol=1e-9)
    # anisotropy: f = m A² v/|A v|, fixed in W
    a = principal(1.3, 0.4)
    turned = held(TableFriction(surface, world_anisotropy=a), twist, (0, 0, 0.9))
    c, s = math.cos(0.9), math.sin(0.9)
    r = np.array(((c, -s), (s, c)))
    w = a @ r @ twist[:2]
    np.testing.assert_allclose(turned[:2], FORCE * r.T @ a @ w / np.linalg.norm(w), rtol=1e-9)
    assert held(TableFriction(surface, body_anisotropy=a), (math.cos(0.4), math.sin(0.4), 0))[:2] @ (
        math.cos(0.4), math.sin(0.4)
    ) == pytest.approx(FORCE * math.sqrt(1.3))  # fmt: skip
    # speed: slope per e-fold over the reference
    fast = held(TableFriction(surface, slope=0.1, reference=0.05 / math.e), twist)
    np.testing.assert_allclose(fast, 1.1 * surface.wrench(twist), rtol=1e-9, atol=1e-12)
    # place: at the COM the relative change is g·x, and the torque comes from the gradient across the motion
    placed = held(TableFriction(surface, gradient=(0.5, -0.25)), twist, (0.2, 0.1, 0.0))
    np.testing.assert_allclose(placed[:2], (1 + 0.5 * 0.2 - 0.25 * 0.1) * surface.wrench(twist)[:2], rtol=1e-9)
    external_force = held(TableFriction(surface, external_force=(0.3, -0.1)), twist, (0, 0, 0.5))
    np.testing.assert_allclose(
        external_force[:2] - surface.wrench(twist)[:2],
        -np.array((math.cos(0.5) * 0.3 - math.sin(0.5) * 0.1, -math.sin(0.5) * 0.3 - math.cos(0.5) * 0.1)),
        atol=1e-9,
    )


@settings(max_examples=60)
@given(st.integers(0, 2**31), st.sampled_from((2, 4, 6)))
def test_loads_of_polynomials_are_those_of_the_surface(seed, degree):
    rng = np.random.default_rng(seed)
    v = rng.normal(size=(60, 3)) * (1, 1, 20)
    true = uniform()
    model = {2: "quadratic", 4: "poly4-cvx", 6: "poly6-cvx"}[degree]
    surface = _fitted(model, true, v) if seed % 10 == 0 else _fitted(model, true, None)
    for _ in range(20):
        twist = rng.normal(size=3) * (0.03, 0.03, 0.6)
        np.testing.assert_allclose(held(surface, twist), surface.wrench(twist), rtol=1e-7, atol=1e-8)


_FITS = {}


def _fitted(model, true, twists):
    if model not in _FITS:
        v = np.random.default_rng(0).normal(size=(60, 3)) * (1, 1, 20) if twists is None else twists
        _FITS[model] = sp.fit_limit_surface(true.wrench(v), v, model=model).surface
    return _FITS[model]


def test_effects_on_a_polynomial_surface_add_what_they_change():
    surface = _fitted("poly4-cvx", uniform(), None)
    twist = np.array((0.03, -0.01, 0.5))
    same = TableFriction(surface, points=uniform(), perturbed=uniform())
    np.testing.assert_allclose(held(same, twist), surface.wrench(twist), atol=1e-6)
    shifted = TableFriction(surface, points=uniform(), gradient=(0.5, 0.0))
    change = held(shifted, twist, (0.1, 0, 0)) - surface.wrench(twist)
    wanted = held(TableFriction(uniform(), gradient=(0.5, 0.0)), twist, (0.1, 0, 0)) - uniform().wrench(twist)
    np.testing.assert_allclose(change, wanted, atol=1e-6)
    with pytest.raises(sp.InputError, match="points"):
        TableFriction(surface, gradient=(0.5, 0.0)).compiled()


def test_inertia_takes_its_force_to_speed_up():
    """Two pieces of different speed: the step between them takes m dv/dt, steady pushing takes friction alone."""
    contact = two_fingers()
    pusher = Pusher.of_contact(contact, 0.004)
    docked = pusher.docked(contact)
    friction = TableFriction(uniform(), inertia=(2.0, 0.01))
    trace = simulate_push(
        friction, square(), pusher, 0.5, (0, 0, 0), docked, [((0.02, 0, 0), 0.5), ((0.03, 0, 0), 0.5)], step=1e-3
    )
    jump = int(np.argmax(trace.twists[:, 0] > 0.025))
    dt = trace.t[jump + 1] - trace.t[jump]
    assert trace.wrenches[jump, 0] == pytest.approx(FORCE + 2.0 * 0.01 / dt, rel=1e-6)
    assert trace.wrenches[-1, 0] == pytest.approx(FORCE, rel=1e-6)


SHAPES = {
    "square": ((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)),
    "ell": ((-0.05, -0.05), (0.05, -0.05), (0.05, 0.0), (0.0, 0.0), (0.0, 0.05), (-0.05, 0.05)),
    "triangle": ((-0.05, -0.05), (0.1, -0.05), (-0.05, 0.1)),
    "cup": (
        *((-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (0.02, 0.05)),
        *((0.02, -0.02), (-0.02, -0.02), (-0.02, 0.05), (-0.05, 0.05)),
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", ("edge", "fingers"))
def test_no_pusher_passes_through_a_slider(shape, kind):
    """Oblique pushes from all sides: ends meet corners, edges become flush, contacts come and go."""
    slider = sp.Slider(SHAPES[shape], 1.0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.02), 3.0)
    ring, face = shapely.LinearRing(slider.vertices), shapely.Polygon(slider.vertices)
    pusher = Pusher.edge(0.05) if kind == "edge" else Pusher.two_fingers(0.05, 0.004)
    places = np.array([(0.0, y) for y in np.linspace(-0.025, 0.025, 21)]) if kind == "edge" else pusher.fingers
    jams = 0
    for seed in (5, 9, 17, 24, 28, 34, 36, 46, 48, 49):
        rng = np.random.default_rng(seed)
        mu = rng.choice((0, 0.2, 0.5, 1.0))
        place = compose((0, 0, rng.uniform(-np.pi, np.pi)), (-0.13, rng.uniform(-0.06, 0.06), rng.uniform(-0.3, 0.3)))
        turn = rng.choice((0.0, 0.0, rng.uniform(-0.3, 0.3)))
        trace = simulate_push(surface, slider, pusher, mu, (0, 0, 0), place, [((0.02, 0.0, turn), 8.0)])
        points = transform_points(compose(inverse(trace.poses), trace.pushers), places)
        inside = shapely.contains_xy(face, points[..., 0], points[..., 1])
        signed = np.where(inside, 1, -1) * shapely.distance(ring, shapely.points(points)) + pusher.radius
        depth = signed.max(axis=1)
        # a step in which contacts change may leave a little, which the next ones take back
        assert depth.max() < 5e-4
        assert depth[-1] < 1e-5
        assert (depth > 5e-5).mean() < 0.05
        jams += int(trace.jammed.sum())
        power = (trace.wrenches * trace.twists).sum(axis=1)
        assert power.min() > -1e-9
    assert jams <= 2


@pytest.mark.parametrize("radius", (0.0, 0.005))
def test_no_finger_passes_through_an_edge_beside_an_inner_corner(radius):
    """Long steps along jagged paths leave fingers a little inside of an edge, within reach of the other one."""
    slider = sp.Slider(SHAPES["ell"], 1.0)
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.02), 3.0)
    ring, face = shapely.LinearRing(slider.vertices), shapely.Polygon(slider.vertices)
    pusher = Pusher.finger(radius)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        # on the upper edge of the corner, or mirrored on the other one, pushed into it
        place = np.array((rng.uniform(0.006, 0.012), radius + 1e-4, -np.pi / 2 + rng.uniform(-0.4, 0.4)))
        if seed % 2:
            place = np.array((place[1], place[0], -np.pi / 2 - place[2]))
        motion = [((0.05, 0.003 * rng.normal(), 0.0), 0.06) for _ in range(12)]
        trace = simulate_push(surface, slider, pusher, 0.5, (0, 0, 0), place, motion, step=0.002)
        points = transform_points(compose(inverse(trace.poses), trace.pushers), np.zeros((1, 2)))
        inside = shapely.contains_xy(face, points[..., 0], points[..., 1])
        depth = (np.where(inside, 1, -1) * shapely.distance(ring, shapely.points(points)) + radius).max(axis=1)
        assert depth.max() < 5e-4, (seed, depth.max())


@pytest.mark.parametrize(
    ("make", "words"),
    (
        (lambda: Pusher([(0, 0)] * 3), "one or two"),
        (lambda: Pusher([(0, 0), (0, 1)], 0.0, True), "flat edge"),
        (lambda: Pusher.finger(-1), "pusher.radius"),
        (lambda: simulate_push(uniform(), square(), Pusher.finger(), -0.1, (0, 0, 0), (0, 0, 0), []), "mu"),
        (lambda: simulate_push(uniform(), square(), Pusher.finger(), 0.1, (0, 0, 0), (0, 0), []), "place"),
        (lambda: simulate_push(uniform(), square(), Pusher.finger(), 0.1, (0, 0, 0), (0, 0, 0), [((1, 0, 0), 1e6)]), "step"),
        (lambda: simulate_push(uniform(), square(), Pusher.finger(), 0.1, (0, 0, 0), (0, 0, 0), []), "inside"),
        (lambda: simulate_push(uniform(), square(), Pusher.finger(), 0.1, (0, 0, 0), (-1, 0, 0), [(1, 0, 0)]), "motion"),
        (lambda: simulate_push(uniform(), square(), Pusher.finger(), 0.1, (0, 0, 0), (-1, 0, 0), 3), "motion"),
    ),
)
def test_bad_input(make, words):
    with pytest.raises(sp.InputError, match=words):
        make()
