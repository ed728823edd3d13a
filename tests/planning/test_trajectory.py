from dataclasses import replace

import numpy as np
import pytest
from conftest import small_scene, two_edges

import stablepush as sp
from stablepush.geometry.se2 import compose, wrap_angle


@pytest.fixture(scope="module")
def solved():
    known = two_edges()
    problem = sp.PlanningProblem(
        known.slider, known.surface, known.contacts, known.start, known.goal, known.obstacles, known.bounds, known.pusher,
        known.tolerance, known.speed, 2.0, known.min_margin, known.uncertainty, finger_radius=0.004,
    )  # fmt: skip
    return problem, sp.plan(problem, time_limit=60)


def points_of(problem, samples):
    """Places (k, n, 2) in W of the corners of the slider and of the origin of the pusher's frame."""
    corners = [compose(samples.slider, (*vertex, 0.0))[:, :2] for vertex in problem.slider.vertices]
    return np.array([*corners, samples.pusher[:, :2]])


def test_samples_lie_on_the_plan(solved):
    problem, result = solved
    samples = sp.sample_plan(problem, result, rate=20)
    assert samples.t[0] == 0
    np.testing.assert_allclose(np.diff(samples.t), 1 / 20, atol=1e-12)
    assert samples.t[-1] > result.duration
    assert (samples.phase[0], samples.phase[-1], len(set(samples.phase))) == ("approach", "retract", 4)
    np.testing.assert_allclose(samples.slider[-1, :2], result.pushes[-1].end[:2], atol=1e-9)
    for number, segment in enumerate(result.segments):
        pushing = samples.phase == "push"
        rows = np.flatnonzero((samples.segment == number) & (pushing if isinstance(segment, sp.Push) else ~pushing))
        if isinstance(segment, sp.Push):
            # every pose is one of the push
            near = np.linspace(0, segment.duration, 4001)
            away = np.linalg.norm(segment.poses(near)[None, :, :2] - samples.slider[rows, None, :2], axis=-1).min(axis=1)
            assert away.max() < 1e-4
            docked = compose(samples.slider[rows], sp.finger_frame(problem.contacts[segment.contact], 0.004))
            np.testing.assert_allclose(samples.pusher[rows][:, :2], docked[:, :2], atol=1e-9)
            assert (samples.contact[rows] == segment.contact).all()
        elif samples.phase[rows[0]] == "transfer":
            # the slider rests, the pusher keeps to its path
            assert np.ptp(samples.slider[rows], axis=0).max() < 1e-9
            assert len(rows) / 20 >= problem.switch_cost
            ends = compose(segment.pusher_path[[0, -1]], (-0.004, 0, 0))
            assert np.hypot(*(samples.pusher[rows[-1], :2] - ends[1, :2])) < 1e-6
            assert (samples.contact[rows] == -1).all()


def test_the_frame_of_the_fingers_lies_behind_that_of_the_contact_points():
    contact = two_edges().contacts[0]
    frame = sp.finger_frame(contact, 0.004)
    np.testing.assert_allclose(frame[:2] + 0.004 * np.array((np.cos(frame[2]), np.sin(frame[2]))), contact.frame[:2])
    centers = contact.points - 0.004 * contact.normals
    np.testing.assert_allclose(frame[:2], centers.mean(axis=0), atol=1e-12)


@pytest.mark.parametrize("limits", [{}, {"acceleration": 0.3, "jerk": 5.0, "speed": 0.02}])
def test_speed_acceleration_and_jerk_stay_within_their_limits(solved, limits):
    """Along the paths of all points, by differences; a turn from one way into another is made at rest."""
    problem, result = solved
    rate, asked = 1000, {"acceleration": 0.1, "jerk": 1.0, "speed": problem.speed} | limits
    samples = sp.sample_plan(problem, result, rate, **limits)
    steps = np.linalg.norm(np.diff(points_of(problem, samples), axis=1), axis=-1)
    pace = steps * rate
    assert pace.max() <= asked["speed"] * (1 + 1e-6)
    for least in (pace[:, 0], pace[:, -1]):
        assert least.max() < 1e-4
    acceleration = np.diff(pace, axis=1) * rate
    assert np.abs(acceleration).max() <= asked["acceleration"] * 1.02 + 1e-3
    # differences of what rounding is in: within a step of the corners of the profile
    assert np.abs(np.diff(acceleration[-1]) * rate).max() <= 2.1 * asked["jerk"] + 0.05
    # and velocities are those of the poses
    turn = np.unwrap(samples.pusher[:, 2])
    poses = np.column_stack((samples.pusher[:, :2], turn))
    np.testing.assert_allclose((poses[2:] - poses[:-2]) * rate / 2, samples.velocity[1:-1], atol=3e-4)


def test_without_limits_the_clock_is_the_plan_s():
    problem = small_scene()
    result = sp.plan(problem, time_limit=60, refinement_budget=0)
    samples = sp.sample_plan(problem, result, rate=100, acceleration=np.inf, jerk=np.inf, standoff=0)
    assert samples.t[-1] == pytest.approx(result.duration, abs=0.011)
    assert set(samples.phase) == {"push"}


def test_a_trajectory_alone_drives_a_robot(solved, tmp_path):
    """In another engine, from the file; the pusher is never farther than it can go in a step."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    from stablepush.engines import Fingers, SliderOnFeet, executor

    problem, result = solved
    sp.save_trajectory(sp.sample_plan(problem, result, rate=50), tmp_path / "t.csv")
    table = np.genfromtxt(tmp_path / "t.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    pusher = np.column_stack([table[name] for name in ("px", "py", "ptheta")])
    steps = np.hypot(*np.diff(pusher[:, :2], axis=0).T)
    assert steps.max() <= problem.speed / 50 * (1 + 1e-6)
    half = np.linalg.norm(np.diff(problem.contacts[0].points, axis=0)) / 2
    support = problem.surface.support
    body = SliderOnFeet(problem.slider.vertices, 1.0, support.points, support.weights, 0.3)
    run = executor("mujoco", body, Fingers(np.array(((0.0, half), (0.0, -half))), 0.004, problem.contacts[0].mu))
    done = run.follow(problem.start, table["t"], pusher)
    off = done.slider[-1] - result.pushes[-1].end
    assert np.hypot(*off[:2]) < 2e-3 and abs(wrap_angle(off[2])) < 0.02


def test_poses_of_a_tool(solved, tmp_path):
    from scipy.spatial.transform import Rotation

    problem, result = solved
    samples = sp.sample_plan(problem, result, rate=5)
    # a flange above the fingers that looks down
    poses = samples.tool_poses(0.01, (0.0, 0.02, 0.1, 1.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(poses[:, 2], 0.11)
    np.testing.assert_allclose(np.linalg.norm(poses[:, :2] - samples.pusher[:, :2], axis=1), 0.02)
    np.testing.assert_allclose(
        Rotation.from_quat(poses[:, 3:]).apply((0, 0, 1)), np.tile((0, 0, -1.0), (len(poses), 1)), atol=1e-12
    )
    sp.save_trajectory(samples, tmp_path / "t.csv", poses)
    assert (tmp_path / "t.csv").read_text().splitlines()[0].endswith("segment,contact,tx,ty,tz,qx,qy,qz,qw")
    with pytest.raises(sp.InputError, match="quaternion"):
        samples.tool_poses(0.0, np.zeros(7))


def test_trajectories_survive_their_file(solved, tmp_path):
    problem, result = solved
    samples = sp.sample_plan(problem, result)
    sp.save_trajectory(samples, tmp_path / "t.csv")
    again = sp.load_trajectory(tmp_path / "t.csv")
    for name in ("t", "segment", "contact", "slider", "pusher", "velocity", "phase"):
        np.testing.assert_array_equal(getattr(samples, name), getattr(again, name))


def test_trajectories_survive_a_bag(solved, tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    samples = sp.sample_plan(*solved)
    for _ in range(2):
        # the second replaces the first
        sp.save_rosbag(samples, tmp_path / "bag", tool_poses=samples.tool_poses(0.1))
    again = sp.load_rosbag(tmp_path / "bag")
    np.testing.assert_allclose(again.t, samples.t, atol=1e-9)
    np.testing.assert_array_equal(again.segment, samples.segment)
    np.testing.assert_array_equal(again.contact, samples.contact)
    np.testing.assert_array_equal(again.velocity, samples.velocity)
    np.testing.assert_array_equal(again.phase, samples.phase)
    for name in ("slider", "pusher"):
        one, other = getattr(again, name), getattr(samples, name)
        np.testing.assert_array_equal(one[:, :2], other[:, :2])
        assert np.abs(wrap_angle(one[:, 2] - other[:, 2])).max() < 1e-12
    (tmp_path / "none").mkdir()
    with pytest.raises(sp.InputError, match="none"):
        sp.load_rosbag(tmp_path / "none")


def test_what_controllers_take_moves_as_it_says(solved, tmp_path):
    """Transforms of a flange that is off the pusher's frame, and velocities, against their finite differences."""
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    samples = sp.sample_plan(*solved, 200.0)
    quarter = np.sqrt(0.5)
    sp.save_rosbag(samples, tmp_path / "bag", tool_poses=samples.tool_poses(0.1, (0.05, -0.02, 0.3, 0.0, quarter, 0.0, quarter)))
    with AnyReader([tmp_path / "bag"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        (connection,) = (c for c in bag.connections if c.topic == "/stablepush/trajectory")
        ((_, _, data),) = bag.messages([connection])
        message = bag.deserialize(data, connection.msgtype)
    assert message.joint_names == ["tool"]
    t = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points])
    places = np.array([(p.transforms[0].translation.x, p.transforms[0].translation.y) for p in message.points])
    rates = np.array([(p.velocities[0].linear.x, p.velocities[0].linear.y) for p in message.points])
    assert t == pytest.approx(samples.t, abs=1e-9)
    moved = np.diff(places, axis=0) / np.diff(t)[:, None]
    # between rows the velocity changes by no more than the acceleration lets it, and by the curve of the path
    assert moved == pytest.approx((rates[1:] + rates[:-1]) / 2, abs=1.5e-3)
    assert np.abs(rates).max() > 0.02


def test_only_solved_plans_and_sound_rates(solved):
    problem, result = solved
    with pytest.raises(sp.InputError, match="solved"):
        sp.sample_plan(problem, sp.PlanResult("timeout", "hand"))
    push = result.pushes[0]
    wrong = (
        [],
        [replace(push, contact=7)],
        [replace(push, contact=-1)],
        [replace(push, duration=-1.0)],
        [replace(push, twist=np.zeros(3))],
        [replace(push, start=push.start + 1)],
        [sp.Transfer(0, 9, np.empty((0, 3)), 1.0)],
    )
    for segments in wrong:
        with pytest.raises(sp.InputError, match="segments"):
            sp.sample_plan(problem, replace(result, segments=tuple(segments)))
    for bad in ({"rate": 0}, {"rate": np.nan}, {"rate": 1e9}, {"acceleration": 0}, {"jerk": -1}, {"speed": 0}, {"standoff": -1}):
        with pytest.raises(sp.InputError):
            sp.sample_plan(problem, result, **bad)


def test_a_change_without_a_path_is_refused(solved):
    problem, result = solved
    jumps = [replace(s, pusher_path=np.empty((0, 3))) if isinstance(s, sp.Transfer) else s for s in result.segments]
    with pytest.raises(sp.InputError, match=r"pusher_path.*jump"):
        sp.sample_plan(problem, replace(result, segments=tuple(jumps)))


def test_approach_and_retract_are_as_long_as_there_is_room():
    open_scene = small_scene(obstacles=())
    result = sp.plan(open_scene, time_limit=60, refinement_budget=0)
    samples = sp.sample_plan(open_scene, result, standoff=0.03)
    assert np.hypot(*(samples.pusher[0] - samples.pusher[samples.phase == "push"][0])[:2]) == pytest.approx(0.03, abs=1e-3)
    # a wall across the way back
    docked = compose(open_scene.start, open_scene.contacts[0].frame)
    reach = 0.0 if open_scene.pusher is None else -open_scene.pusher[:, 0].min()
    wall = compose(docked, [(-reach - 0.012 - a, b, 0.0) for a, b in ((0, -0.1), (0, 0.1), (0.01, 0.1), (0.01, -0.1))])[:, :2]
    walled = small_scene(obstacles=[wall], bounds=(-2, -2, 2, 2))
    samples = sp.sample_plan(walled, result, standoff=0.03)
    way = np.hypot(*(samples.pusher[0] - samples.pusher[samples.phase == "push"][0])[:2])
    assert 0.005 < way <= 0.012
