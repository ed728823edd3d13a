"""Trajectories as ROS 2 bags, in pure Python (extra ``ros``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError, UnavailableError, read_only
from stablepush.geometry import wrap_angle
from stablepush.io import whole_folder
from stablepush.planning.trajectory import PHASES, Trajectory

#: Files of a bag.
_FILES = ("metadata.yaml", "bag.db3")
#: Topics: paths of the slider's body frame, of the pusher's and of the tool's, velocities of the pusher in W (three numbers a
#: pose), and segments followed by contacts and phases (numbers of ``PHASES``), one each a pose.
SLIDER, PUSHER, TOOL = "/stablepush/slider_path", "/stablepush/pusher_path", "/stablepush/tool_path"
VELOCITY, STATE = "/stablepush/pusher_velocity", "/stablepush/segment_contact_and_phase"
#: What controllers take: transforms and velocities of the pusher, or of the tool, with the times from the start.
COMMAND = "/stablepush/trajectory"


def save_rosbag(trajectory: Trajectory, path: str | Path, frame_id: str = "map", tool_poses: FloatArray | None = None) -> None:
    """Write a trajectory as a ROS 2 bag: a ``nav_msgs/Path`` each for slider and pusher, stamped from zero.

    For controllers, ``/stablepush/trajectory`` is a ``trajectory_msgs/MultiDOFJointTrajectory`` of one joint, ``pusher``, or
    ``tool`` if ``tool_poses`` are given: transforms and velocities in W, by the time from the start.

    Parameters
    ----------
    path : path
        Folder to write; one that is there is replaced.
    frame_id : str
        Name of the world frame.
    tool_poses : array, shape (n, 7), optional
        As :meth:`Trajectory.tool_poses` gives them: one path more, and what the trajectory is of.

    Raises
    ------
    UnavailableError
        Without the extra ``ros``.
    """
    writer_class, _, store = _ros()
    types = store.types
    stamps = [_stamp(types, t) for t in trajectory.t]

    def path_of(poses: FloatArray) -> Any:
        header = types["std_msgs/msg/Header"]
        found = []
        for stamp, (x, y, z, *turn) in zip(stamps, poses.tolist(), strict=True):
            position = types["geometry_msgs/msg/Point"](x=x, y=y, z=z)
            orientation = types["geometry_msgs/msg/Quaternion"](x=turn[0], y=turn[1], z=turn[2], w=turn[3])
            pose = types["geometry_msgs/msg/Pose"](position=position, orientation=orientation)
            found.append(types["geometry_msgs/msg/PoseStamped"](header=header(stamp=stamp, frame_id=frame_id), pose=pose))
        return types["nav_msgs/msg/Path"](header=header(stamp=_stamp(types, 0.0), frame_id=frame_id), poses=found)

    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    phases = np.array([PHASES.index(word) for word in trajectory.phase])
    numbers = np.concatenate((trajectory.segment, trajectory.contact, phases)).astype(np.int32)
    messages = {
        SLIDER: path_of(_spatial(trajectory.slider)),
        PUSHER: path_of(_spatial(trajectory.pusher)),
        VELOCITY: types["std_msgs/msg/Float64MultiArray"](layout=layout, data=np.array(trajectory.velocity).ravel()),
        STATE: types["std_msgs/msg/Int32MultiArray"](layout=layout, data=numbers),
    }
    driven = _spatial(trajectory.pusher)
    if tool_poses is not None:
        driven = np.asarray(tool_poses, dtype=np.float64)
        messages[TOOL] = path_of(driven)
    name, rates = "pusher" if tool_poses is None else "tool", _velocities(trajectory, driven)
    vector, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    points = []
    for t, place, (vx, vy, omega) in zip(trajectory.t, driven.tolist(), rates.tolist(), strict=True):
        nanoseconds = round(float(t) * 1e9)
        transform = types["geometry_msgs/msg/Transform"](translation=vector(*place[:3]), rotation=turn(*place[3:]))
        velocity = types["geometry_msgs/msg/Twist"](linear=vector(vx, vy, 0.0), angular=vector(0.0, 0.0, omega))
        duration = types["builtin_interfaces/msg/Duration"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        point = types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"]
        points.append(point(transforms=[transform], velocities=[velocity], accelerations=[], time_from_start=duration))
    messages[COMMAND] = types["trajectory_msgs/msg/MultiDOFJointTrajectory"](
        header=types["std_msgs/msg/Header"](stamp=_stamp(types, 0.0), frame_id=frame_id), joint_names=[name], points=points
    )
    with whole_folder(path, *_FILES) as folder:
        with writer_class(folder / "bag", version=9) as bag:
            for topic, message in messages.items():
                connection = bag.add_connection(topic, message.__msgtype__, typestore=store)
                bag.write(connection, 0, store.serialize_cdr(message, message.__msgtype__))
        # the library makes a folder of its own
        for file in (folder / "bag").iterdir():
            file.rename(folder / file.name)
        (folder / "bag").rmdir()


def load_rosbag(path: str | Path) -> Trajectory:
    """Read a bag that :func:`save_rosbag` wrote; times are good to a nanosecond."""
    _, reader_class, store = _ros()
    found: dict[str, Any] = {}
    try:
        with reader_class(Path(path)) as bag:
            for connection, _, data in bag.messages():
                found[connection.topic] = store.deserialize_cdr(data, connection.msgtype)
    except Exception as error:
        raise InputError("", f"expected a ROS 2 bag: {error}", file=path) from None
    for topic in (SLIDER, PUSHER, VELOCITY, STATE):
        if topic not in found:
            raise InputError("", f"expected the topic {topic}, found {', '.join(sorted(found)) or 'none'}", file=path)

    def poses(message: Any) -> FloatArray:
        rows = [
            (p.pose.position.x, p.pose.position.y, 2 * np.arctan2(p.pose.orientation.z, p.pose.orientation.w))
            for p in message.poses
        ]
        found = np.array(rows).reshape(-1, 3)
        # half of a heading is in the quaternion, whose sign is lost: headings go on as they were written
        found[:, 2] = np.unwrap(np.concatenate((wrap_angle(found[:1, 2]), found[1:, 2])))
        return read_only(found)

    stamps = [p.header.stamp for p in found[SLIDER].poses]
    numbers, rates = np.asarray(found[STATE].data, dtype=np.int64), np.asarray(found[VELOCITY].data, dtype=np.float64)
    count = len(stamps)
    if not len(found[PUSHER].poses) == count or len(numbers) != 3 * count or len(rates) != 3 * count:
        raise InputError("", f"expected as many poses and velocities of the pusher as poses of the slider, {count}", file=path)
    segment, contact, phase = numbers.reshape(3, count)
    if not ((phase >= 0) & (phase < len(PHASES))).all():
        raise InputError("", f"{STATE}: expected phases from 0 to {len(PHASES) - 1}", file=path)
    t = np.array([s.sec + 1e-9 * s.nanosec for s in stamps])
    parts = (
        t, poses(found[SLIDER]), poses(found[PUSHER]), rates.reshape(count, 3), np.array(PHASES)[phase],
        segment.astype(np.float64), contact.astype(np.float64),
    )  # fmt: skip
    return Trajectory(*parts)


def _velocities(trajectory: Trajectory, driven: FloatArray) -> FloatArray:
    """Velocities (n, 3) in W of frames at places (n, 7) that move with the pusher: ``v + omega x r``, m/s and rad/s."""
    arm = driven[:, :2] - trajectory.pusher[:, :2]
    vx, vy, omega = trajectory.velocity.T
    return np.column_stack((vx - omega * arm[:, 1], vy + omega * arm[:, 0], omega))


def _spatial(poses: FloatArray) -> FloatArray:
    """Planar poses (n, 3) as positions and quaternions (n, 7)."""
    nothing, half = np.zeros(len(poses)), poses[:, 2] / 2
    return np.column_stack((poses[:, :2], nothing, nothing, nothing, np.sin(half), np.cos(half)))


def _stamp(types: Any, t: float) -> Any:
    nanoseconds = round(t * 1e9)
    return types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def _ros() -> tuple[Any, Any, Any]:
    try:
        from rosbags.rosbag2 import Reader, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise UnavailableError("rosbag: expected the extra ros: pip install 'stablepush[ros]'") from None
    return Writer, Reader, get_typestore(Stores.ROS2_HUMBLE)
