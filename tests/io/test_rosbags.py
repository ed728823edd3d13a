"""Bags of ROS 1 and 2: files with a known truth, written here, come back to rounding; bad ones give one line."""

import numpy as np
import pytest
from conftest import one_line
from recordings import imported, mapping_file, recorded

import stablepush as sp
from stablepush.geometry import rotate_vectors

TOPICS = {"pose": {"topic": "/tf", "child": "slider"}, "tip": "/tip", "force": "/ft"}
BASE = (0.4, -0.2, 1.1)


def write_bag(folder, gap=False, lean=0.0, down=False, tip_type="geometry_msgs/msg/PoseStamped", frame="base"):
    """Poses of the slider as transforms in the base's frame, of the tip in the world, forces in the axes of the tip.

    ``down``: the tip's z axis points to the table.
    """
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    from stablepush.geometry import compose, inverse, rotate_vectors

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    (t, poses, tips, forces), _, loads = recorded()
    in_base = compose(inverse(np.array(BASE)), poses)

    def header(at, name):
        nanoseconds = round(at * 1e9)
        stamp = types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=name)

    def turn(angle):
        c, s = np.cos(lean / 2), np.sin(lean / 2)
        w, z = np.cos(angle / 2), np.sin(angle / 2)
        return types["geometry_msgs/msg/Quaternion"](x=float(w * s), y=float(z * s), z=float(z * c), w=float(w * c))

    vector = types["geometry_msgs/msg/Vector3"]
    with Writer(folder, version=9) as bag:
        links = {
            topic: bag.add_connection(topic, kind, typestore=store)
            for topic, kind in (("/tf", "tf2_msgs/msg/TFMessage"), ("/tip", tip_type), ("/ft", "geometry_msgs/msg/WrenchStamped"))
        }

        def send(topic, at, message):
            bag.write(links[topic], round(at * 1e9), store.serialize_cdr(message, message.__msgtype__))

        for k, at in enumerate(t):
            if gap and 60 < k < 100:
                continue
            x, y, theta = in_base[k]
            of = types["geometry_msgs/msg/Transform"]
            stamped = types["geometry_msgs/msg/TransformStamped"]
            other = stamped(header=header(at, "odom"), child_frame_id="camera", transform=of(vector(0.0, 0.0, 0.0), turn(0.0)))
            mine = stamped(header=header(at, frame), child_frame_id="slider", transform=of(vector(x, y, 0.01), turn(theta)))
            send("/tf", at, types["tf2_msgs/msg/TFMessage"]([other, mine]))
            heading = poses[k, 2] + 0.3
            point = types["geometry_msgs/msg/Point"](x=tips[k, 0], y=tips[k, 1], z=0.0)
            if tip_type.endswith("PoseStamped"):
                turned = turn(heading)
                if down:
                    # half a turn about its own x axis
                    turned = types["geometry_msgs/msg/Quaternion"](x=turned.w, y=turned.z, z=-turned.y, w=-turned.x)
                pose = types["geometry_msgs/msg/Pose"](point, turned)
                send("/tip", at, types[tip_type](header(at, "map"), pose))
            fx, fy = rotate_vectors(-heading, -forces[k]) * (1, -1 if down else 1)
            wrench = types["geometry_msgs/msg/Wrench"](vector(float(fx), float(fy), 0.0), vector(0.0, 0.0, 0.0))
            send("/ft", at, types["geometry_msgs/msg/WrenchStamped"](header(at, "tool0"), wrench))
    return poses, loads


BAG = {"topics": TOPICS, "frames": {"base": list(BASE)}, "force_axes": "tip", "forces_on": "finger", "largest_gap": 20.0}


@pytest.fixture
def rosbags():
    return pytest.importorskip("rosbags", reason="rosbags is not installed")


@pytest.mark.parametrize("down", (False, True))
def test_a_bag_comes_back(tmp_path, capsys, rosbags, down):
    poses, loads = write_bag(tmp_path / "bag", down=down)
    mapping = mapping_file(tmp_path, **BAG)
    imported(capsys, tmp_path / "bag", "--kind", "rosbag", "--mapping", mapping, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    pairs = log.pairs()
    # poses of the push, and of the second before it: stamps are good to a nanosecond
    assert log.columns("x", "y") == pytest.approx(poses[:, :2], abs=1e-8)
    assert np.cos(log.columns("theta")[:, 0] - poses[:, 2]) == pytest.approx(1.0, abs=1e-12)
    assert pairs.wrenches == pytest.approx(loads, abs=1e-7)
    assert len(log) == 3


def test_a_bag_of_ros_1_comes_back(tmp_path, capsys, rosbags):
    """Poses, and forces of a plate in the table, whose moment is about the plate's origin."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    types, plate = store.types, np.array((0.7, -0.4, 0.9))
    (t, poses, tips, forces), _, loads = recorded()
    with Writer(tmp_path / "push.bag") as bag:
        names = {
            "/box": "geometry_msgs/msg/PoseStamped",
            "/tip": "geometry_msgs/msg/PoseStamped",
            "/plate": "geometry_msgs/msg/WrenchStamped",
        }
        links = {topic: bag.add_connection(topic, kind, typestore=store) for topic, kind in names.items()}
        for k, at in enumerate(t):
            stamp = types["builtin_interfaces/msg/Time"](sec=int(at), nanosec=round(1e9 * (at % 1)) % 10**9)

            def send(topic, frame, part, at=at, k=k, stamp=stamp):
                header = types["std_msgs/msg/Header"](seq=k, stamp=stamp, frame_id=frame)
                message = types[names[topic]](header, part)
                bag.write(links[topic], round(at * 1e9), store.serialize_ros1(message, names[topic]))

            for topic, (x, y, theta) in (("/box", poses[k]), ("/tip", (*tips[k], poses[k, 2]))):
                point = types["geometry_msgs/msg/Point"](x=float(x), y=float(y), z=0.0)
                turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=float(np.sin(theta / 2)), w=float(np.cos(theta / 2)))
                send(topic, "map", types["geometry_msgs/msg/Pose"](point, turn))
            force = -forces[k]
            c, s = np.cos(plate[2]), np.sin(plate[2])
            arm = tips[k] - plate[:2]
            # the force acts at the tip, and the finger gives no moment
            moment = arm[0] * force[1] - arm[1] * force[0]
            vector = types["geometry_msgs/msg/Vector3"]
            turned = vector(float(c * force[0] + s * force[1]), float(-s * force[0] + c * force[1]), 0.0)
            send("/plate", "plate", types["geometry_msgs/msg/Wrench"](turned, vector(0.0, 0.0, float(moment))))
    topics = {"topics": {"pose": "/box", "tip": "/tip", "force": "/plate"}, "frames": {"plate": plate.tolist()}}
    entries = {**topics, "forces_on": "finger", "largest_gap": 20.0, "moment_about": "frame", "contact_kind": "two-point"}
    mapping = mapping_file(tmp_path, **entries)
    # its suffix tells
    imported(capsys, tmp_path / "push.bag", "--mapping", mapping, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert log.columns("x", "y") == pytest.approx(poses[:, :2], abs=1e-8)
    # about the tip nothing is left of the moment: the load in B is that of a force at the tip's centre
    pushing = log.samples["phase"] == "push"
    fx, fy, tau = log.columns("fx", "fy", "tau")[pushing].T
    place = rotate_vectors(-poses[pushing, 2], tips[pushing] - poses[pushing, :2])
    assert np.stack((fx, fy), axis=-1)[5:] == pytest.approx(loads[:, :2].repeat(pushing.sum() // 3, axis=0)[5:], abs=1e-6)
    assert tau == pytest.approx(place[:, 0] * fy - place[:, 1] * fx, abs=1e-8)


def test_the_rate_of_the_rows(tmp_path, capsys, rosbags):
    _, loads = write_bag(tmp_path / "bag")
    mapping = mapping_file(tmp_path, **BAG, rate=25.0)
    imported(capsys, tmp_path / "bag", "--kind", "rosbag", "--mapping", mapping, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    # the last row is the mean of what is left
    assert np.diff(log.samples["t"][log.rows("1")][:-1]) == pytest.approx(0.04, abs=1e-6)
    assert log.pairs().wrenches == pytest.approx(loads, rel=0.08, abs=0.01)


BAD_BAGS = [
    ({}, {"topics": {**TOPICS, "tip": "/gone"}}, "mapping.yaml: topics.tip: expected a topic of", "/ft, /tf, /tip, got /gone"),
    ({}, {"topics": TOPICS | {"pose": {"topic": "/tf", "child": "box"}}}, "topics.pose: expected", "camera, slider, got box"),
    ({}, {"frames": {}}, "topics.pose (/tf): expected the frame map; give its pose by frames: {base: [x, y, theta]}, got base"),
    ({}, {"force_axes": "world2"}, 'mapping.yaml: force_axes: expected "world" or "tip"'),
    ({}, {"topics": {"pose": "/ft"}}, "topics.pose (/ft): expected messages of type geometry_msgs/msg/PoseStamped"),
    ({"gap": True}, {"largest_gap": 0.25}, "topics.pose (/tf): expected samples at most 0.25 s apart (largest_gap)"),
    ({"lean": 0.6}, {}, "topics.pose (/tf): expected poses about the vertical, got one that leans by 34 deg"),
    ({}, {"topics": {k: v for k, v in TOPICS.items() if k != "tip"}}, "mapping.yaml: topics.tip: missing key: force_axes"),
    ({"lean": 0.6}, {"topics": {**TOPICS, "pose": {"topic": "/tf", "child": "camera"}}}, "leans by 34 deg"),
]  # fmt: skip


@pytest.mark.parametrize("case", BAD_BAGS, ids=[case[2][:50] for case in BAD_BAGS])
def test_a_bag_that_is_wrong_is_one_line(tmp_path, capsys, rosbags, case):
    made, entries, *words = case
    write_bag(tmp_path / "bag", **made)
    mapping = mapping_file(tmp_path, **{**BAG, **entries})
    one_line(capsys, ["import", tmp_path / "bag", "--kind", "rosbag", "--mapping", mapping, "-o", tmp_path / "log"], *words)


def test_a_folder_that_is_no_bag_is_one_line(tmp_path, capsys, rosbags):
    mapping = mapping_file(tmp_path, **BAG)
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text("none", encoding="utf-8")
    command = ["import", tmp_path / "bag", "--kind", "rosbag", "--mapping", mapping, "-o", tmp_path / "log"]
    one_line(capsys, command, "expected a bag of ROS 2 or ROS 1")
