"""Importers of what others record: files with a known truth, written here, come back to rounding; bad ones give one line."""

import json

import numpy as np
import pytest
import yaml
from conftest import one_line
from recordings import RADIUS, SLIDER, recorded

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import rotate_vectors
from stablepush.io import slider_to_json

RIG = {"finger_radius": RADIUS, "friction": {"support": None, "contact": 0.5}}


def slider_file(folder, slider=SLIDER):
    path = folder / "slider.json"
    path.write_text(json.dumps(slider_to_json(slider)), encoding="utf-8")
    return path


def mapping_file(folder, **entries):
    path = folder / "mapping.yaml"
    slider_file(folder)
    path.write_text(yaml.safe_dump({"slider": "slider.json", **RIG, **entries}), encoding="utf-8")
    return path


def imported(capsys, *arguments):
    code = main(["import", *map(str, arguments)])
    assert code == 0, capsys.readouterr().err


# a table


COLUMNS = {
    "t": "clock",
    "x": "X",
    "y": "Y",
    "theta": "yaw",
    "tip_x": "TX",
    "tip_y": "TY",
    "fx": "FX",
    "fy": "FY",
    "trial": "push",
}
UNITS = {"time": "ms", "length": "mm", "angle": "deg"}


def table(folder):
    (t, poses, tips, forces), trials, loads = recorded()
    numbers = np.column_stack((1000 * t, 1000 * poses[:, :2], np.degrees(poses[:, 2]), 1000 * tips, forces)).tolist()
    names = ["clock", "X", "Y", "yaw", "TX", "TY", "FX", "FY"]
    rows = [",".join([*map(repr, row), word]) for row, word in zip(numbers, trials, strict=True)]
    path = folder / "table.csv"
    path.write_text("\n".join([",".join([*names, "push"]), *rows]) + "\n", encoding="utf-8")
    return path, poses, loads


def test_a_table_in_millimetres_and_degrees(tmp_path, capsys):
    path, poses, loads = table(tmp_path)
    mapping = mapping_file(tmp_path, columns=COLUMNS, units=UNITS)
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert log.columns("x", "y", "theta") == pytest.approx(poses, abs=1e-12)
    assert log.pairs().wrenches == pytest.approx(loads, abs=1e-9)
    assert (log.rig.finger_radius, log.rig.contact_friction) == (RADIUS, 0.5)


def test_what_a_table_cannot_be_is_noted(tmp_path, capsys):
    """Forces on the finger, metres for millimetres, and no rows at rest: one line each, and the log is made."""
    path, _, _ = table(tmp_path)

    def notes(**entries):
        mapping = mapping_file(tmp_path, **{"columns": COLUMNS, "units": UNITS, **entries})
        assert main(["import", str(path), "--kind", "csv", "--mapping", str(mapping), "-o", str(tmp_path / "log")]) == 0
        return [line for line in capsys.readouterr().err.splitlines() if "note: " in line]

    assert not notes()
    (turned,) = notes(forces_on="finger")
    assert "in 3 of 3 pushes the force opposes the motion: is its sign wrong (forces_on)?" in turned
    (elsewhere,) = notes(body_pose=[0.5, 0.3, 0.0])
    assert "the centre of the tip is" in elsewhere
    assert "mm outside the slider's outline, with a finger of 5 mm radius: units (length, angle), body_pose" in elsewhere
    # metres for the degrees and the millimetres of the table
    assert {note.rpartition(": ")[2] for note in notes(units={"time": "ms"})} >= {"units (length, angle), body_pose, outline?"}
    assert any("mm/s, and rows are 10 s apart: units (time, length)?" in note for note in notes(units={**UNITS, "time": "s"}))
    lines = path.read_text().splitlines()
    # the tracker lost the slider for 0.2 s in the first push
    path.write_text("\n".join(lines[:115] + lines[135:]) + "\n")
    (lost,) = notes()
    assert "in 1 of 3 pushes rows are missing, for up to 0.21 s (usual: 0.01 s between two)" in lost
    # the second before each push is left out
    moving = [line for k, line in enumerate(lines[1:]) if k % 151 >= 100]
    path.write_text("\n".join([lines[0], *moving]) + "\n")
    assert any("have no rows at rest" in note for note in notes())


BAD_TABLES = [
    ({"columns": {**COLUMNS, "x": "gone"}}, "table.csv: line 1: column gone: missing column"),
    ({"columns": {**COLUMNS, "x": 3}}, "mapping.yaml: columns.x: expected a string, got 3"),
    ({"columns": {k: v for k, v in COLUMNS.items() if k != "theta"}}, "mapping.yaml: columns.theta: missing key"),
    ({"columns": {k: v for k, v in COLUMNS.items() if k != "fy"}}, "mapping.yaml: columns.fy: missing key"),
    ({"columns": COLUMNS, "units": {"length": "inch"}}, 'mapping.yaml: units.length: expected "m" or "cm" or "mm"'),
    ({"columns": COLUMNS, "forces_on": "air"}, 'mapping.yaml: forces_on: expected "slider"'),
    ({"columns": COLUMNS, "zero_forces": 1}, "mapping.yaml: zero_forces: expected true or false, got 1"),
    ({"columns": COLUMNS, "body_pose": [0, 0]}, "mapping.yaml: body_pose: expected 3 numbers, got 2"),
    ({"columns": COLUMNS, "slider": "none.json"}, "none.json: cannot read"),
    ({}, "mapping.yaml: columns: missing key"),
    ({"columns": {**COLUMNS, "trial": "X"}}, "mapping.yaml: columns.trial: expected a column of its own, got 'X'"),
    (
        {"columns": {**COLUMNS, "trial": "push"}, "trial_columns": {"start_time": "FY"}},
        "mapping.yaml: trial_columns.start_time: expected another name",
    ),
    (
        {"columns": {**COLUMNS, "trial": "push"}, "trial_columns": {"cor_x": "push"}},
        "mapping.yaml: trials: column cor_x: expected numbers",
    ),
]


@pytest.mark.parametrize(("entries", "words"), BAD_TABLES, ids=[words[:45] for _, words in BAD_TABLES])
def test_a_mapping_that_is_wrong_is_one_line(tmp_path, capsys, entries, words):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, **entries)
    one_line(capsys, ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"], words)
    assert not (tmp_path / "log").exists()


def test_a_table_of_an_executed_plan(tmp_path, capsys):
    """Two fingers, the surface of the plan, a moment about the tip, and a column of one's own."""
    path, _, _ = table(tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    more = [lines[0] + ",M,RH", *(f"{line},0.0,{40 + int(line[-1])}" for line in lines[1:])]
    path.write_text("\n".join(more) + "\n", encoding="utf-8")
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(SLIDER.vertices, 0.02), 2.0)
    sp.save_model(surface, tmp_path / "model.json")
    given = {"contact_kind": "two-point", "finger_distance": 0.02, "model": "model.json", "trial_columns": {"humidity": "RH"}}
    mapping = mapping_file(tmp_path, columns={**COLUMNS, "moment": "M"}, units=UNITS, **given)
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert log.rig.model is not None and log.rig.contact_kind == "two-point"
    assert log.trials["humidity"].astype(float) == pytest.approx([40, 41, 42])
    apart = np.linalg.norm(log.columns("c1x", "c1y") - log.columns("c2x", "c2y"), axis=1)
    assert np.nanmedian(apart) == pytest.approx(0.02, abs=1e-4)


def test_pushes_that_nothing_parts_are_noted(tmp_path, capsys):
    """Rows at rest left out, and no column of trials: all is one push, which is said."""
    path, _, _ = table(tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    first = [line for line in lines[1:] if line.endswith(lines[1].rsplit(",", 1)[1])]
    path.write_text("\n".join([lines[0], *first]) + "\n", encoding="utf-8")
    mapping = mapping_file(tmp_path, columns={k: v for k, v in COLUMNS.items() if k != "trial"}, units=UNITS)
    command = ["import", str(path), "--kind", "csv", "--mapping", str(mapping), "-o", str(tmp_path / "log")]
    assert main(command) == 0
    assert "one push was found" in capsys.readouterr().err
    assert len(sp.read_pushlog(tmp_path / "log")) == 1


def test_the_noise_of_a_log_without_forces_needs_none_of_them(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    columns = {k: v for k, v in COLUMNS.items() if k not in ("fx", "fy")}
    mapping = mapping_file(tmp_path, columns=columns, units=UNITS, noise={"position": 1e-4, "angle": 1e-3})
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    assert sp.read_pushlog(tmp_path / "log").rig.noise == sp.Noise(0.0, 1e-4, 1e-3)


MORE_BAD_TABLES = [
    ({"columns": {k: v for k, v in COLUMNS.items() if k != "tip_y"}}, "mapping.yaml: columns.tip_y: missing key"),
    ({"columns": {k: v for k, v in COLUMNS.items() if k not in ("tip_x", "tip_y")}}, "mapping.yaml: columns.tip_x: missing key"),
]


@pytest.mark.parametrize(("entries", "words"), MORE_BAD_TABLES, ids=[words[:45] for _, words in MORE_BAD_TABLES])
def test_columns_that_need_others(tmp_path, capsys, entries, words):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, **entries)
    one_line(capsys, ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"], words)


def test_what_stands_in_a_table_that_is_wrong(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, columns=COLUMNS, units=UNITS)
    command = ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"]
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines[:6], lines[5], *lines[7:]]) + "\n", encoding="utf-8")
    one_line(capsys, command, "table.csv: line 7: column clock: expected times that grow within trial p0")
    path.write_text("\n".join([lines[0], *(line.rpartition(",")[0] + "," for line in lines[1:])]) + "\n", encoding="utf-8")
    one_line(capsys, command, "table.csv: column push: expected a name in at least one row")
    # a date is no text, and what is wrong for all tables is said once
    (tmp_path / "other.csv").write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    text = mapping.read_text(encoding="utf-8").replace("slider: slider.json", "slider: 2020-01-01")
    mapping.write_text(text, encoding="utf-8")
    one_line(capsys, ["import", tmp_path, *command[2:]], "mapping.yaml: slider: expected an object")
    # a source is never written over
    one_line(capsys, ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path], "expected a place outside")


def test_numbers_with_an_exponent_and_no_point_are_numbers(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    mapping = mapping_file(tmp_path, columns=COLUMNS, units=UNITS)
    mapping.write_text(mapping.read_text() + "noise: {force: 2e-2, position: 1.0e-4, angle: .1E-2}\n")
    imported(capsys, path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log")
    assert sp.read_pushlog(tmp_path / "log").rig.noise == sp.Noise(0.02, 1e-4, 1e-3)
    capsys.readouterr()
    one_line(
        capsys, ["import", path, "--kind", "rosbag", "--mapping", mapping, "-o", tmp_path / "bag"], "of kind rosbag, found none"
    )


def test_yaml_that_is_none_is_one_line(tmp_path, capsys):
    path, _, _ = table(tmp_path)
    mapping = tmp_path / "m.yaml"
    command = ["import", path, "--kind", "csv", "--mapping", mapping, "-o", tmp_path / "log"]
    for text, words in (
        ("a: [1", "line 1 column 6: expected YAML"),
        ("a: 1\na: 2\n", "the key a stands twice"),
        ("- 1\n", "expected an object"),
        ("1: 2\n", "expected words as keys, got 1"),
        ("columns: !!python/object:os.system {}\n", "expected YAML"),
        ("a: &x [*x]\n", "m.yaml"),
    ):
        mapping.write_text(text, encoding="utf-8")
        one_line(capsys, command, words)
    one_line(capsys, ["import", path, "--kind", "csv", "-o", tmp_path / "log"], "--mapping: expected a YAML file")
    one_line(capsys, ["import", path, "-o", tmp_path / "log"], "found none (those of kind csv or rosbag need")
    one_line(
        capsys, ["import", path, "--mapping", mapping, "--kind", "mlab-poke", "-o", tmp_path / "log"], "--mapping: expected none"
    )


# ROS 2 bags


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
    imported(capsys, tmp_path / "push.bag", "--kind", "rosbag", "--mapping", mapping, "-o", tmp_path / "log")
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


# the MIT data set


def mit_file(folder, k, shift=(0.0, 0.0), reaction=True, ending=".json", **changes):
    """One push, three clocks of 250 Hz since 1970."""
    (t, poses, tips, forces), trials, loads = recorded(rate=250.0, twist=(0.002, 0.02, 0.0))
    rows = [row for row, word in enumerate(trials) if word == f"p{k}"]
    clock = 1.4e9 + t[rows]
    where = poses[rows].copy()
    c, s = np.cos(where[:, 2]), np.sin(where[:, 2])
    where[:, 0] -= c * shift[0] - s * shift[1]
    where[:, 1] -= s * shift[0] + c * shift[1]
    sign = -1.0 if reaction else 1.0
    late = tips[rows] + 0.0013 * np.gradient(tips[rows], clock, axis=0)
    data = {
        "object_pose": np.column_stack((clock, where)),
        "tip_pose": np.column_stack((clock + 0.0013, late, np.zeros(len(rows)))),
        "ft_wrench": np.column_stack((clock - 0.0007, sign * forces[rows], np.zeros(len(rows)))),
    } | changes  # fmt: skip
    path = folder / f"motion_surface=plywood_shape=hex_a=0_v=20_i={k}.000_s=0.300_t=-0.349{ending}"
    if ending == ".json":
        path.write_text(json.dumps({name: np.asarray(value).tolist() for name, value in data.items()}), encoding="utf-8")
    else:
        h5py = pytest.importorskip("h5py", reason="h5py is not installed")
        with h5py.File(path, "w") as file:
            for name, value in data.items():
                file[name] = value
    return path, loads[k], poses[rows]


@pytest.mark.parametrize("ending", [".json", ".h5"])
@pytest.mark.parametrize("reaction", [True, False])
def test_mit_pushes(tmp_path, capsys, ending, reaction):
    folder = tmp_path / "hex"
    folder.mkdir()
    # the outline is given about another point than its centroid
    shift = np.array((0.01, 0.005))
    outline = slider_file(tmp_path, sp.Slider(SLIDER.vertices + shift, 0.8))
    truths = [mit_file(folder, k, shift, reaction, ending) for k in range(3)]
    imported(capsys, folder, "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "log")
    log = sp.read_pushlog(tmp_path / "log")
    assert len(log) == 3
    assert log.rig.finger_radius == 0.00475
    assert log.rig.slider.vertices == pytest.approx(SLIDER.vertices, abs=1e-12)
    assert log.trials["speed"] == pytest.approx(0.02)
    assert log.trials["direction"].astype(float) == pytest.approx(-0.349)
    assert log.trials["edge"].astype(float) == pytest.approx([0, 1, 2])
    assert log.trials["start_time"] == pytest.approx([0.0, 10.0, 20.0], abs=1e-6)
    pairs = log.pairs()
    for k, (_, load, poses) in enumerate(truths):
        rows = log.rows(str(k + 1))
        # the first bin of contact is part at rest
        assert np.median(log.columns("fx", "fy", "tau")[rows][-20:], axis=0) == pytest.approx(load, rel=2e-3, abs=2e-3)
        assert log.columns("x", "y", "theta")[rows][0] == pytest.approx(poses[0], abs=1e-6)
        assert pairs.wrenches[k] == pytest.approx(load, rel=0.05, abs=0.02)


def test_mit_pushes_in_millimetres_or_about_another_origin_are_noted(tmp_path, capsys):
    folder = tmp_path / "hex"
    folder.mkdir()
    outline = slider_file(tmp_path)
    path, _, _ = mit_file(folder, 0, shift=(0.02, 0.03))
    command = ["import", folder, "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "log"]
    imported(capsys, *command[1:])
    assert "the slider's outline, with a finger of 4.75 mm radius" in capsys.readouterr().err
    data = json.loads(path.read_text(encoding="utf-8"))
    for name, columns in (("object_pose", 3), ("tip_pose", 3)):
        data[name] = [[row[0], *(1000 * v for v in row[1:columns]), *row[columns:]] for row in data[name]]
    path.write_text(json.dumps(data), encoding="utf-8")
    imported(capsys, *command[1:])
    assert "units (length)?" in capsys.readouterr().err


def test_folders_of_the_same_name_become_different_logs(tmp_path, capsys):
    outline = slider_file(tmp_path)
    for surface in ("abs", "plywood"):
        (tmp_path / "raw" / surface / "hex").mkdir(parents=True)
        path, _, _ = mit_file(tmp_path / "raw" / surface / "hex", 0)
        path.rename(path.with_name(path.name.replace("plywood", surface)))
    imported(capsys, tmp_path / "raw", "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "logs")
    assert sorted(p.name for p in (tmp_path / "logs").iterdir()) == ["hex_abs", "hex_plywood"]


def test_mit_pushes_that_are_wrong_are_one_line_or_skipped(tmp_path, capsys):
    folder = tmp_path / "hex"
    folder.mkdir()
    outline = slider_file(tmp_path)
    path, _, _ = mit_file(folder, 0)
    command = ["import", folder, "--kind", "mit-push", "--slider", outline, "-o", tmp_path / "log"]
    one_line(capsys, command[:4] + command[6:], "--slider: expected the outline in the frame of object_pose")
    kept = json.loads(path.read_text(encoding="utf-8"))
    gap = {name: [row for k, row in enumerate(rows) if not 30 < k < 90] for name, rows in kept.items()}
    for broken, words in (
        ({**kept, "tip_pose": [[0.0, 1.0]]}, "tip_pose: expected two or more rows"),
        ({name: rows for name, rows in kept.items() if name != "ft_wrench"}, "ft_wrench: missing key"),
        (gap, "object_pose: expected samples at most 0.1 s apart"),
        ({**kept, "tip_pose": [[row[0] + 100, *row[1:]] for row in kept["tip_pose"]]}, "tip_pose: expected samples at the time"),
        ({**kept, "object_pose": [[*row[:3], "a"] for row in kept["object_pose"]]}, "object_pose: expected rows of numbers"),
    ):
        path.write_text(json.dumps(broken), encoding="utf-8")
        one_line(capsys, command, path.name, words)
    # beside others that can be read, it is skipped with a note
    mit_file(folder, 1)
    assert main(list(map(str, command))) == 0
    assert "skipped" in capsys.readouterr().err
    assert len(sp.read_pushlog(tmp_path / "log")) == 1
    (folder / "motion_surface=abs_shape=hex_a=0.json").write_text("{}", encoding="utf-8")
    one_line(capsys, command, "expected the pushes of one shape on one surface")
