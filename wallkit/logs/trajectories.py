"""Poses in a log -> one trajectory: ground truth, odometry, or a pose that somebody published."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wallkit.core.geometry import pose_from_matrix
from wallkit.core.types import Float64Array, Odometry, StampedPose, Trajectory
from wallkit.errors import LogError
from wallkit.logs.frames import moving_transforms
from wallkit.logs.message import Channel, Value
from wallkit.logs.reader import Log
from wallkit.logs.topics import Track, transform_pairs


def poses_of(value: Value, track: Track) -> Iterator[tuple[int, Float64Array]]:
    """(stamp [ns], planar pose (3,)) that a message holds of a track."""
    if isinstance(value, Odometry | StampedPose):
        yield value.stamp_ns, value.pose
    elif isinstance(value, tuple):
        for t in value:
            if t.parent == track.parent and t.child == track.child:
                yield t.stamp_ns, pose_from_matrix(t.matrix)


def trajectory_of(log: Log, track: Track, *, start_ns: int | None = None, end_ns: int | None = None) -> Trajectory:
    """All poses of a track by ascending stamp; repeated and backward stamps are left out.

    Raises:
        LogError: it holds no pose, or its transforms are not connected.
    """
    if track.child and (track.parent, track.child) not in transform_pairs(log):
        return _of_chain(log, track, start_ns, end_ns)
    stamps: list[int] = []
    poses: list[Float64Array] = []
    frame_id = track.parent
    for message in log.messages(set(track.topics), start_ns, end_ns):
        for stamp_ns, pose in poses_of(message.value, track):
            if not stamps or stamp_ns > stamps[-1]:
                stamps.append(stamp_ns)
                poses.append(pose)
        if isinstance(message.value, Odometry | StampedPose):
            frame_id = message.value.frame_id
    if not stamps:
        raise LogError(f"{track} holds no pose in the chosen time", where=log.name)
    return Trajectory(np.array(stamps, dtype=np.int64), np.array(poses), frame_id)


def first_pose(log: Log, channel: Channel) -> StampedPose:
    """The first pose on a topic: where the user said the robot is.

    Raises:
        LogError: the topic holds none.
    """
    first = log.first(channel.topic)
    if not first or not isinstance(first[0].value, StampedPose):
        raise LogError(f"{channel.topic} holds no readable pose", where=log.name)
    return first[0].value


def _of_chain(log: Log, track: Track, start_ns: int | None, end_ns: int | None) -> Trajectory:
    transforms = moving_transforms(log, track.topics)
    stamps = transforms.stamps_between(track.parent, track.child)
    low = -np.inf if start_ns is None else start_ns
    high = np.inf if end_ns is None else end_ns
    stamps = stamps[(stamps >= low) & (stamps < high)]
    if not len(stamps):
        raise LogError(f"{track} holds no pose in the chosen time", where=log.name)
    return Trajectory(stamps, transforms.poses_at(track.parent, track.child, stamps), track.parent)
