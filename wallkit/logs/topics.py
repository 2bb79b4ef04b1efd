"""A log and the user's words -> which topic plays which part. One candidate is taken; several are listed; none is guessed.

Candidates are found by type. Two parts also look at names, because no type tells them: ground truth (a word of the name
is "truth", "groundtruth" or "gt") and the initial pose (a word begins with "initial"); odometry is what is left of the
Odometry topics without the truth. A transform on TF is only used when it is named, as PARENT->CHILD: the map->odom that
a localizer once published is no truth, and where both a wheel driver and a filter publish odom->base nobody can tell
which is which.
"""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import dataclass

from wallkit.errors import LogError, closest
from wallkit.logs.message import Channel, Message, Value
from wallkit.logs.reader import Log

SCAN_KINDS = (
    "sensor_msgs/LaserScan",
    "sensor_msgs/MultiEchoLaserScan",
    "foxglove.LaserScan",
    "carmen/FLASER",
    "carmen/ROBOTLASER1",
)
CLOUD_KINDS = ("sensor_msgs/PointCloud2", "foxglove.PointCloud")
ODOMETRY_KINDS = ("nav_msgs/Odometry", "foxglove.Odometry", "carmen/ODOM", "carmen/ScanOdometry")
POSE_KINDS = (
    "geometry_msgs/PoseStamped",
    "geometry_msgs/PoseWithCovarianceStamped",
    "foxglove.PoseInFrame",
    "carmen/TRUEPOS",
)
IMAGE_KINDS = (
    "sensor_msgs/Image",
    "sensor_msgs/CompressedImage",
    "foxglove.RawImage",
    "foxglove.CompressedImage",
    "foxglove.CompressedVideo",
)
TRANSFORM_KINDS = (
    "tf2_msgs/TFMessage",
    "tf/tfMessage",
    "geometry_msgs/TransformStamped",
    "foxglove.FrameTransform",
    "foxglove.FrameTransforms",
)
# what a simulator knows and no robot does
ORACLE = "/oracle/"
# what ROS' image_transport appends to the topic of the same images
_COMPRESSED = "/compressed"
_TRUTH_WORDS = {"truth", "groundtruth", "gt"}
_PEEK = 20


@dataclass(frozen=True, slots=True)
class Track:
    """Where stamped poses come from: one topic, or the transform parent -> child on all TF topics.

    Attributes:
        topics: what to read. parent, child: frames of the transform; empty for a topic of poses.
    """

    topics: tuple[str, ...]
    parent: str = ""
    child: str = ""

    def __str__(self) -> str:
        return f"{self.parent}->{self.child} of {', '.join(self.topics)}" if self.child else self.topics[0]


def pick_scan(log: Log, name: str | None = None) -> Channel:
    """The topic of LiDAR sweeps: a planar scan; a 3-D cloud when there is no planar scan.

    Raises:
        LogError: none, several, or not the one named.
    """
    planar = log.channels_of(*SCAN_KINDS)
    clouds = log.channels_of(*CLOUD_KINDS)
    candidates = (*planar, *clouds) if name else planar or clouds
    return _the_one(log, "LiDAR scan", "--scan", candidates, name)


def pick_odometry(log: Log, name: str | None = None) -> Track:
    """The topic of wheel odometry, or the transform named as "odom->base_link".

    Raises:
        LogError: none, several, or not the one named.
    """
    if name and "->" in name:
        return _transform_track(log, name, "--odom")
    candidates = log.channels_of(*ODOMETRY_KINDS)
    likely = candidates if name else tuple(c for c in candidates if not is_truth_name(c.topic))
    if not likely and (pairs := transform_pairs(log)):
        listed = ", ".join(f"{parent}->{child}" for parent, child in pairs)
        hint = f"TF holds {listed}; name the one that is odometry, for example --odom '{listed.split(', ')[0]}'"
        raise LogError("no odometry topic", where=log.name, hint=hint)
    return Track((_the_one(log, "odometry", "--odom", likely, name).topic,))


def pick_truth(log: Log, name: str | None = None) -> Track | None:
    """The topic of true poses, found by its name; or the one named, or the transform "map->base_link". None without one.

    Raises:
        LogError: several, or not the one named.
    """
    if name and "->" in name:
        return _transform_track(log, name, "--truth", is_direct=False)
    candidates = log.channels_of(*POSE_KINDS, *ODOMETRY_KINDS)
    likely = (
        candidates if name else tuple(c for c in candidates if is_truth_name(c.topic) or c.kind == "carmen/TRUEPOS")
    )
    if not likely and not name:
        return None
    return Track((_the_one(log, "ground truth", "--truth", likely, name).topic,))


def pick_initial_pose(log: Log, name: str | None = None) -> Channel | None:
    """The topic of the pose that the user gave the robot at the start ("/initialpose"). None without one.

    Raises:
        LogError: several, or not the one named.
    """
    candidates = log.channels_of(*POSE_KINDS)
    likely = candidates if name else tuple(c for c in candidates if _is_initial_name(c.topic))
    return _the_one(log, "initial pose", "--init", likely, name) if likely or name else None


def pick_image(log: Log, name: str | None = None) -> Channel | None:
    """The topic of camera images; depth images and a simulator's labels are none. None without one.

    Raises:
        LogError: several, or not the one named.
    """
    candidates = log.channels_of(*IMAGE_KINDS)
    likely = candidates if name else tuple(c for c in candidates if is_picture_name(c.topic))
    return _the_one(log, "camera image", "--image", likely, name) if likely or name else None


def is_truth_name(topic: str) -> bool:
    """Whether a topic's name says that it is ground truth."""
    words = [w for w in re.split(r"[^a-z0-9]+", topic.lower()) if w]
    return bool(_TRUTH_WORDS & set(words))


def is_picture_name(topic: str) -> bool:
    """Whether a topic of images holds what a camera saw, by its name."""
    return "depth" not in topic.lower() and not topic.startswith(ORACLE)


def is_copy(topic: str, held: Container[str]) -> bool:
    """Whether another topic has the same pixels: the raw one of its own, or the compressed one if there are no raw ones.

    Args:
        held: topics that hold images.
    """
    raw = topic.removesuffix(_COMPRESSED)
    return raw in held if raw != topic else topic not in held and topic + _COMPRESSED in held


def camera_of_topic(topic: str) -> str:
    """ "front" of /camera/front/image/compressed; else the topic with dashes."""
    words = [word for word in topic.split("/") if word]
    if words[:1] == ["camera"] and len(words) > 2:
        return words[1]
    kept = [word for word in words if word not in ("compressed", "image", "image_raw")]
    return "-".join(kept) or "camera"


def transform_topics(log: Log) -> tuple[str, ...]:
    """Topics with transforms that change over time."""
    return tuple(dict.fromkeys(c.topic for c in log.channels_of(*TRANSFORM_KINDS) if not c.is_static))


def transform_pairs(log: Log) -> list[tuple[str, str]]:
    """(parent, child) of all transforms on the TF topics."""
    pairs: dict[tuple[str, str], None] = {}
    topics = transform_topics(log)
    for message in log.messages(topics) if topics else ():
        if isinstance(message.value, tuple):
            pairs.update({(t.parent, t.child): None for t in message.value})
    return list(pairs)


def frame_of(value: Value) -> str:
    """The frame that a message is in."""
    if isinstance(value, tuple):
        return f"{value[0].parent}->{value[0].child}" if value else ""
    return "" if isinstance(value, str) else value.frame_id


def rate_hz(messages: Sequence[Message]) -> float | None:
    """Messages a second by their header stamps; None from fewer than two."""
    stamps = [m.stamp_ns for m in messages]
    span_ns = max(stamps) - min(stamps) if stamps else 0
    return (len(stamps) - 1) / (span_ns * 1e-9) if span_ns > 0 else None


def _the_one(log: Log, part: str, flag: str, candidates: Sequence[Channel], name: str | None) -> Channel:
    topics = list(dict.fromkeys(c.topic for c in candidates))
    if name is not None:
        found = next((c for c in candidates if c.topic in (name, f"/{name}")), None)
        if found is None:
            hint = closest(name, topics) if topics else f"the log has no topic that could be {part}"
            raise LogError(f"no topic '{name}' that could be {part}", where=log.name, hint=hint)
        return found
    if not topics:
        others = ", ".join(sorted({f"{c.topic} ({c.type_name})" for c in log.channels})) or "nothing"
        raise LogError(
            f"no topic that could be {part}; it holds {others}", where=log.name, hint=f"name one with {flag}"
        )
    if len(topics) > 1:
        lines = "".join(f"\n    {_described(log, next(c for c in candidates if c.topic == t))}" for t in sorted(topics))
        message = f"{len(topics)} topics could be {part}:{lines}"
        raise LogError(message, where=log.name, hint=f"choose one, for example {flag} {sorted(topics)[0]}")
    return candidates[0]


def _described(log: Log, channel: Channel) -> str:
    messages = log.first(channel.topic, _PEEK)
    rate = rate_hz(messages)
    speed = f"{rate:.1f} Hz" if rate is not None else "rate unknown"
    frame = frame_of(messages[0].value) if messages else ""
    return f"{channel.topic}  {channel.type_name}  {speed}  frame {frame or '(none)'}"


def _transform_track(log: Log, name: str, flag: str, *, is_direct: bool = True) -> Track:
    parent, _, child = (word.strip().lstrip("/") for word in name.partition("->"))
    topics = transform_topics(log)
    pairs = transform_pairs(log)
    listed = ", ".join(f"{p}->{c}" for p, c in pairs) or "nothing"
    frames = {frame for pair in pairs for frame in pair}
    if (parent, child) not in pairs and (is_direct or not {parent} <= frames):
        hint = f"name one of them with {flag} PARENT->CHILD"
        raise LogError(f"TF has no transform {parent}->{child}; it holds {listed}", where=log.name, hint=hint)
    return Track(topics, parent, child)


def _is_initial_name(topic: str) -> bool:
    return any(w.startswith("initial") for w in re.split(r"[^a-z0-9]+", topic.lower()))
