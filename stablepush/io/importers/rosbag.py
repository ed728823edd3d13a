"""Bags of ROS 2 and ROS 1 without ROS: poses of slider and tip, forces, by a mapping of topics and frames (extra ``ros``)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError, Node, UnavailableError
from stablepush.geometry import compose, rotate_vectors
from stablepush.io.importers.mapping import mapping_of
from stablepush.io.importers.registry import Source, name_of, within
from stablepush.io.importers.streams import Stream, on_one_clock, without_leaps
from stablepush.io.pushlog import PushLog
from stablepush.objects import Slider

#: Streams of the mapping's ``topics``, and the types of messages that they take.
_POSES = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/TransformStamped", "tf2_msgs/msg/TFMessage")
TOPICS = {"pose": _POSES, "tip": _POSES, "force": ("geometry_msgs/msg/WrenchStamped",)}
#: Endings of the files of a bag.
_ENDINGS = (".bag", ".db3", ".mcap", ".yaml", ".zstd")
#: A pose that leans by more than this (rad) off the vertical is of no slider on a table.
_LARGEST_TILT = math.radians(20)


@dataclass(slots=True)
class _Topic:
    """A stream as it is read: ``child``: the frame wanted of transforms; what was seen of others. ``down``: the frame's z axis
    points to the table, None if no message told; ``leans``: words, if it points neither there nor up all the time."""

    name: str
    topic: str
    child: str | None
    place: Node
    times: list[float] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)
    frames: set[str] = field(default_factory=set)
    children: set[str] = field(default_factory=set)
    down: bool | None = None
    leans: str = ""

    def __str__(self) -> str:
        """Key of the mapping and topic, as errors name it."""
        return f"{self.place.place} ({self.topic})"


class RosBags:
    """Importer of ROS bags: kind ``rosbag``. Those of ROS 2 are folders, those of ROS 1 files that end in ``.bag``."""

    needs_mapping = True
    suffixes = (".bag",)

    def find(self, root: Path) -> Iterator[Source]:
        if root.is_file():
            # a file of a bag of ROS 2 stands for the whole
            bags = [root if root.suffix == ".bag" else root.parent] if root.suffix in _ENDINGS else []
        else:
            bags = sorted({*(file.parent for file in root.rglob("metadata.yaml")), *root.rglob("*.bag")})
        return (Source("rosbag", bag, name_of(bag), {}) for bag in bags)

    def read(self, source: Source, slider: Slider | None) -> tuple[PushLog, list[str]]:
        mapping = mapping_of(source, slider, "topics", "world", "frames", "force_axes", "moment_about", "rate", "largest_gap")
        root = mapping.root
        topics = {name: _wanted(name, root["topics"]) for name in TOPICS if name in root["topics"].object()}
        root["topics"].expect_keys(*TOPICS)
        root["topics"]["pose"]
        rate, gap, world, axes = root.get("rate"), root.get("largest_gap"), root.get("world"), root.get("force_axes")
        frames = {}
        if root.get("frames") is not None:
            frames = {name: root["frames"][name].array(3) for name in root["frames"].object()}
        turned = None if axes is None else axes.text(("world", "tip"))
        about = None if root.get("moment_about") is None else root["moment_about"].text(("tip", "frame"))
        name_of_world = "map" if world is None else world.text()
        _read(source.file, list(topics.values()))
        streams: dict[str, Stream] = {}
        with within(source.file):
            for name, topic in topics.items():
                rows = np.array(topic.rows)
                if name != "force":
                    rows = compose(_frame(topic, frames, name_of_world, source.file), rows)
                elif turned is None or about == "frame":
                    origin = _frame(topic, frames, name_of_world, source.file)
                    if turned is None:
                        rows[:, :2] = rotate_vectors(origin[2], rows[:, :2])
                streams[name] = Stream(str(topic), np.array(topic.times), rows, None if name == "force" else 2)
            leaps: list[str] = []
            for name, length in (("pose", mapping.rig.slider.characteristic_length), ("force", None)):
                if name in streams:
                    streams[name], words = without_leaps(streams[name], length)
                    leaps += words
            t, (poses, tips, loads), notes = on_one_clock(
                [streams.get(name) for name in TOPICS],
                None if rate is None else rate.number(positive=True), 0.25 if gap is None else gap.number(positive=True),
            )  # fmt: skip
            if loads is not None and turned == "tip":
                if tips is None:
                    raise InputError("topics.tip", "missing key: force_axes says that the forces are in its axes", file=root.file)
                if topics["tip"].leans:
                    raise InputError("force_axes", "expected a tip that looks up or down", topics["tip"].leans, file=root.file)
                if topics["tip"].down:
                    # seen from above the y axis of a tool that looks down is turned round, and so is its moment
                    loads[:, 1:] *= -1
                loads[:, :2] = rotate_vectors(tips[:, 2], loads[:, :2])
            forces = None if loads is None else loads[:, :2]
            if loads is not None and about == "frame":
                if tips is None:
                    raise InputError("topics.tip", "missing key: the moment about the tip is needed", file=root.file)
                arm = origin[:2] - tips[:, :2]
                loads[:, 2] += arm[:, 0] * loads[:, 1] - arm[:, 1] * loads[:, 0]
            # a round finger gives no moment: what the sensor reads as one is that of its own place
            moments = None if loads is None or mapping.rig.contact_kind == "point" else loads[:, 2]
            log, more = mapping.log(t, poses, forces, tips, moments=moments)  # type: ignore[arg-type]
            return log, [*leaps, *notes, *more]


BAGS = RosBags()


def _wanted(name: str, topics: Node) -> _Topic:
    node = topics[name]
    if isinstance(node.value, dict):
        node.expect_keys("topic", "child")
        child = node.get("child")
        return _Topic(name, node["topic"].text(), None if child is None else child.text(), node)
    return _Topic(name, node.text(), None, node)


def _frame(topic: _Topic, frames: dict[str, FloatArray], world: str, file: Path) -> FloatArray:
    """The pose (3,) in W of the frame that the messages of a topic are in."""
    if len(topic.frames) > 1:
        raise InputError(str(topic), "expected one frame", " and ".join(sorted(topic.frames)), file=file)
    if not topic.frames:
        raise InputError(str(topic), "expected a message of finite numbers", f"none in {len(topic.rows)}", file=file)
    name = next(iter(topic.frames))
    if name in frames:
        return frames[name]
    if name.lstrip("/") != world.lstrip("/"):
        known = " or ".join([world, *frames])
        tool = ", or say force_axes: tip if it turns with the tool" if topic.name == "force" else ""
        words = f"expected the frame {known}; give its pose by frames: {{{name}: [x, y, theta]}}{tool}"
        raise InputError(str(topic), words, name, file=file)
    return np.zeros(3)


def _read(bag_path: Path, topics: list[_Topic]) -> None:
    """Fill topics from a bag."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise UnavailableError("rosbag: expected the extra ros: pip install 'stablepush[ros]'") from None
    complaint: InputError | None = None
    try:
        with AnyReader([bag_path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
            complaint = _read_topics(bag, bag_path, topics)
    except Exception as error:
        raise InputError("", f"expected a bag of ROS 2 or ROS 1: {' '.join(str(error).split())[:200]}", file=bag_path) from None
    if complaint is not None:
        raise complaint


def _read_topics(bag: Any, folder: Path, topics: list[_Topic]) -> InputError | None:
    """Fill topics from an open bag, or return what is wrong: errors of the bag's reader and ours are not to be confused."""
    present = {connection.topic: connection.msgtype for connection in bag.connections}
    for topic in topics:
        if topic.topic not in present:
            found = ", ".join(sorted(present)) or "none"
            return InputError(
                topic.place.place, f"expected a topic of {folder}, which has {found}", topic.topic, file=topic.place.file
            )
        if present[topic.topic] not in TOPICS[topic.name]:
            words = " or ".join(TOPICS[topic.name])
            return InputError(str(topic), f"expected messages of type {words}", present[topic.topic], file=folder)
    wanted = {topic.topic for topic in topics}
    for connection, stamp, data in bag.messages([c for c in bag.connections if c.topic in wanted]):
        message = bag.deserialize(data, connection.msgtype)
        for topic in topics:
            if topic.topic == connection.topic:
                leaning = _take(topic, message, connection.msgtype, stamp)
                if leaning is not None:
                    return InputError(str(topic), "expected poses about the vertical", leaning, file=folder)
    for topic in topics:
        if topic.child is None and len(topic.children) > 1 and topic.rows:
            found = ", ".join(sorted(topic.children))
            return InputError(
                topic.place.place, f"expected child: one of the frames of {topic.topic}", found, file=topic.place.file
            )
        if not topic.rows:
            if topic.children:
                found = ", ".join(sorted(topic.children))
                return InputError(
                    topic.place.place, f"expected child: and one of the frames of {topic.topic}, {found}",
                    topic.child or "none", file=topic.place.file,
                )  # fmt: skip
            return InputError(str(topic), "expected at least one message", file=folder)
    return None


def _take(topic: _Topic, message: Any, kind: str, received: int) -> str | None:
    """Add a message to a topic; return words if it is a pose that leans."""
    parts = message.transforms if kind == "tf2_msgs/msg/TFMessage" else [message]
    for part in parts:
        stamp = part.header.stamp
        at = stamp.sec + 1e-9 * stamp.nanosec or 1e-9 * received
        if kind == "geometry_msgs/msg/WrenchStamped":
            w = part.wrench
            row: tuple[float, ...] = (w.force.x, w.force.y, w.torque.z)
        else:
            if hasattr(part, "transform"):
                topic.children.add(part.child_frame_id)
                # of a topic with transforms of many frames, the wanted one; of one with a single frame, that
                if topic.child != part.child_frame_id and (topic.child or kind == "tf2_msgs/msg/TFMessage"):
                    continue
                place, q = part.transform.translation, part.transform.rotation
            else:
                place, q = part.pose.position, part.pose.orientation
            size = math.hypot(q.x, q.y, q.z, q.w)
            # a tracker that has lost its object sends a quaternion of zeros or NaN
            known = size > 0 and math.isfinite(size)
            if known and not 0.5 < size < 2.0:
                return f"a quaternion of length {size:.3g} at {at:.3f} s"
            complaint = _look(topic, (q.x**2 + q.y**2) / size**2, at) if known else None
            if complaint is not None:
                return complaint
            # the heading is that of the x axis, seen from above, for tools that look down, too
            heading = math.atan2(2 * (q.x * q.y + q.w * q.z), q.w**2 + q.x**2 - q.y**2 - q.z**2) if known else math.nan
            row = (place.x, place.y, heading)
        topic.times.append(at)
        topic.rows.append(row)
        if all(map(math.isfinite, row)):
            topic.frames.add(part.header.frame_id)
    return None


def _look(topic: _Topic, across: float, at: float) -> str | None:
    """Keep where the z axis of a frame points; return words if a slider leans. ``across``: x² + y² of its unit quaternion."""
    lean = math.acos(max(-1.0, min(1.0, 1 - 2 * across)))
    if topic.name == "pose":
        return f"one that leans by {math.degrees(lean):.0f} deg at {at:.3f} s" if lean > _LARGEST_TILT else None
    upright, down = lean <= _LARGEST_TILT, lean >= math.pi - _LARGEST_TILT
    if topic.down is not None and topic.down == upright:
        topic.leans = f"one that turns over at {at:.3f} s"
    topic.down = down
    if not (upright or down):
        topic.leans = f"one that leans by {math.degrees(lean):.0f} deg at {at:.3f} s"
    return None
