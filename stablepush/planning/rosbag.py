"""Trajectories as ROS 2 bags, in pure Python (extra ``ros``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError, UnavailableError, read_only
from stablepush.io import whole_folder
from stablepush.planning.trajectory import Trajectory

#: Topics: paths of the slider's body frame and of the pusher's, and segments followed by contacts, one each a pose.
SLIDER, PUSHER, CONTACT = "/stablepush/slider_path", "/stablepush/pusher_path", "/stablepush/segment_and_contact"


def save_rosbag(trajectory: Trajectory, path: str | Path, frame_id: str = "map") -> None:
    """Write a trajectory as a ROS 2 bag: a ``nav_msgs/Path`` each for slider and pusher, stamped from zero.

    Parameters
    ----------
    path : path
        Folder to write; one that is there is replaced.
    frame_id : str
        Name of the world frame.

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
        for stamp, (x, y, theta) in zip(stamps, poses, strict=True):
            position = types["geometry_msgs/msg/Point"](x=float(x), y=float(y), z=0.0)
            turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=float(np.sin(theta / 2)), w=float(np.cos(theta / 2)))
            pose = types["geometry_msgs/msg/Pose"](position=position, orientation=turn)
            found.append(types["geometry_msgs/msg/PoseStamped"](header=header(stamp=stamp, frame_id=frame_id), pose=pose))
        return types["nav_msgs/msg/Path"](header=header(stamp=_stamp(types, 0.0), frame_id=frame_id), poses=found)

    numbers = np.concatenate((trajectory.segment, trajectory.contact)).astype(np.int32)
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    messages = {
        SLIDER: path_of(trajectory.slider),
        PUSHER: path_of(trajectory.pusher),
        CONTACT: types["std_msgs/msg/Int32MultiArray"](layout=layout, data=numbers),
    }
    with whole_folder(path) as folder:
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
    for topic in (SLIDER, PUSHER, CONTACT):
        if topic not in found:
            raise InputError("", f"expected the topic {topic}, found {', '.join(sorted(found)) or 'none'}", file=path)

    def poses(message: Any) -> FloatArray:
        rows = [
            (p.pose.position.x, p.pose.position.y, 2 * np.arctan2(p.pose.orientation.z, p.pose.orientation.w))
            for p in message.poses
        ]
        return read_only(np.array(rows).reshape(-1, 3))

    stamps = [p.header.stamp for p in found[SLIDER].poses]
    numbers = np.asarray(found[CONTACT].data, dtype=np.float64)
    half = len(stamps)
    if not len(found[PUSHER].poses) == half or len(numbers) != 2 * half:
        raise InputError("", f"expected as many poses of the pusher, segments and contacts as of the slider, {half}", file=path)
    t = read_only(np.array([s.sec + 1e-9 * s.nanosec for s in stamps]))
    return Trajectory(t, read_only(numbers[:half]), read_only(numbers[half:]), poses(found[SLIDER]), poses(found[PUSHER]))


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
