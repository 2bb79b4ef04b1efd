"""Logs -> their pictures one by one, with oracle labels where a simulated log has them, poses, scans and cameras."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.geometry import interpolate_poses
from wallkit.core.types import CameraImage, Scan, Trajectory, UInt8Array
from wallkit.dataset.classes import UNLABELLED, LabelSet
from wallkit.dataset.labels import Labelled
from wallkit.errors import DatasetError, LogError
from wallkit.evaluate.tum import read_tum
from wallkit.logs.images import pixels_from_image
from wallkit.logs.reader import Log, open_log
from wallkit.logs.topics import (
    IMAGE_KINDS,
    SCAN_KINDS,
    camera_of_topic,
    is_copy,
    is_picture_name,
    pick_image,
    pick_truth,
)
from wallkit.logs.trajectories import trajectory_of
from wallkit.pipelines.simulate.camera import NO_CLASS, NO_INSTANCE

_ORACLE = "/oracle/"
# pictures that wait for their labels
_PATIENCE = 16


@dataclass(frozen=True, eq=False)
class Source:
    """One log, and where its poses come from: a run's folder, else the log's own truth.

    Attributes:
        image_topics: to take; none for every camera's.
    """

    path: Path
    name: str
    image_topics: tuple[str, ...] = ()
    run: Path | None = None

    @cached_property
    def log(self) -> Log:
        return open_log([self.path])

    @cached_property
    def topics(self) -> tuple[str, ...]:
        """Of pictures, one for each camera: of those that hold the same images raw and compressed, the raw ones.

        Raises:
            LogError: there are none, not one that is named, or several of one camera.
        """
        if self.image_topics:
            channels = [pick_image(self.log, name) for name in self.image_topics]
            return self._of_one_camera_each([channel.topic for channel in channels if channel])
        names = dict.fromkeys(c.topic for c in self.log.channels_of(*IMAGE_KINDS) if is_picture_name(c.topic))
        if not names:
            raise LogError("holds no images", where=self.log.name, hint="`wallkit log info` lists what it holds")
        held = {name for name in names if self.log.first(name)}
        return self._of_one_camera_each([name for name in names if not is_copy(name, held)])

    def _of_one_camera_each(self, topics: list[str]) -> tuple[str, ...]:
        """The topics; two of one camera, such as raw and rectified images, would have pictures of the same names."""
        cameras: dict[str, list[str]] = {}
        for topic in dict.fromkeys(topics):
            cameras.setdefault(camera_of_topic(topic), []).append(topic)
        for camera, own in cameras.items():
            if len(own) > 1:
                lines = "".join(f"\n    {topic}" for topic in own)
                hint = f"name one for each camera, for example --image {own[0]}"
                said = f"{len(own)} topics have images of the camera '{camera}':{lines}"
                raise LogError(said, where=self.log.name, hint=hint)
        return tuple(own[0] for own in cameras.values())

    @cached_property
    def poses(self) -> Trajectory | None:
        """Where the robot was; None when nobody knows."""
        if self.run is not None:
            return read_tum(self.run / "estimate.tum")
        track = pick_truth(self.log)
        return trajectory_of(self.log, track) if track else None

    def pose_at(self, stamp_ns: int) -> list[float] | None:
        """x, y, yaw; None outside the time in which poses are known."""
        known = self.poses
        if known is None or not known.stamps_ns[0] <= stamp_ns <= known.stamps_ns[-1]:
            return None
        return [round(float(v), 6) for v in interpolate_poses(known.stamps_ns, known.poses, [stamp_ns])[0]]

    @cached_property
    def oracle_classes(self) -> list[str]:
        """Names of the numbers in oracle labels; none in a real log, or one whose cameras have no masks."""
        wanted = {f"{_ORACLE}{camera_of_topic(topic)}/classes" for topic in self.topics}
        if not wanted & {channel.topic for channel in self.log.channels}:
            return []
        for message in self.log.first(f"{_ORACLE}names"):
            return list(json.loads(str(message.value))["classes"])
        return []


def sources_of(logs: tuple[Path, ...], image_topics: tuple[str, ...], runs: tuple[Path, ...]) -> list[Source]:
    """Logs with names of their own.

    Raises:
        DatasetError: runs are given, but not one for each log.
    """
    if runs and len(runs) != len(logs):
        raise DatasetError(f"{len(runs)} runs for {len(logs)} logs", hint="--run once for each log, in their order")
    found: list[Source] = []
    for number, path in enumerate(logs):
        at = path.resolve()
        stem = at.parent.name if at.stem == "log" else at.name.partition(".")[0]
        name = "".join(c if c.isalnum() or c == "-" else "-" for c in stem)
        if any(one.name == name for one in found):
            name = f"{name}-{number}"
        found.append(Source(path, name, image_topics, runs[number] if runs else None))
    return found


def pictures_of(source: Source, labels: LabelSet, lost: dict[str, int]) -> Iterator[Labelled]:
    """Every picture of a log by time; what cannot be decoded is counted in `lost`.

    Raises:
        DatasetError: an oracle label's class has no place among the labels.
    """
    names = source.oracle_classes
    table = np.full(256, UNLABELLED, dtype=np.uint8)
    table[: len(names)] = labels.table(names)
    wanted = {
        f"{_ORACLE}{camera_of_topic(topic)}/{what}" for topic in source.topics for what in ("classes", "instances")
    }
    there = {channel.topic for channel in source.log.channels} if names else set()
    waiting: dict[tuple[str, int], dict[str, UInt8Array]] = {}
    oracle = wanted & there
    for message in source.log.messages({*source.topics, *oracle}):
        if not isinstance(message.value, CameraImage):
            continue
        is_label = message.topic in oracle
        camera = message.topic.split("/")[2] if is_label else camera_of_topic(message.topic)
        what = message.topic.rpartition("/")[2] if is_label else "image"
        parts = waiting.setdefault((camera, message.stamp_ns), {})
        try:
            parts[what] = _pixels(message.value, is_label)
        except LogError:
            lost["unreadable"] = lost.get("unreadable", 0) + 1
        needs = 1 + sum(1 for topic in oracle if topic.startswith(f"{_ORACLE}{camera}/"))
        if len(parts) == needs:
            yield from _labelled(source, camera, message.stamp_ns, waiting.pop((camera, message.stamp_ns)), table)
        while len(waiting) > _PATIENCE:
            key = next(iter(waiting))
            yield from _labelled(source, *key, waiting.pop(key), table)
    for key, parts in waiting.items():
        yield from _labelled(source, *key, parts, table)


def write_scans(source: Source, stamps_ns: dict[str, int], folder: Path) -> dict[str, float]:
    """Writes the scan nearest in time to each picture as NAME.npz; by name how much later [s] it was taken."""
    channels = source.log.channels_of(*SCAN_KINDS)
    if not channels or not stamps_ns:
        return {}
    topic = channels[0].topic
    times = np.unique([message.stamp_ns for message in source.log.messages([topic])])
    nearest: dict[int, list[str]] = {}
    for name, stamp in stamps_ns.items():
        nearest.setdefault(int(times[np.argmin(np.abs(times - stamp))]), []).append(name)
    folder.mkdir(parents=True, exist_ok=True)
    late = {}
    for message in source.log.messages([topic]):
        scan = message.value
        for name in nearest.pop(message.stamp_ns, []) if isinstance(scan, Scan) else ():
            assert isinstance(scan, Scan)
            np.savez_compressed(
                folder / f"{name}.npz", stamp_ns=scan.stamp_ns, frame=scan.frame_id, ranges_m=scan.ranges_m,
                angles_rad=scan.angles_rad, range_min_m=scan.range_min_m, range_max_m=scan.range_max_m,
            )  # fmt: skip
            late[name] = (scan.stamp_ns - stamps_ns[name]) * 1e-9
    return late


def cameras_of(source: Source) -> dict[str, Any]:
    """Every camera_info of a log by its topic."""
    return {
        topic: {
            "frame": info.frame_id,
            "width": info.width,
            "height": info.height,
            "distortion_model": info.model,
            "K": info.k.tolist(),
            "D": info.d.tolist(),
        }
        for topic, info in source.log.static.camera_infos.items()
    }


def _pixels(image: CameraImage, is_label: bool) -> UInt8Array:
    """Of labels the numbers, which may have 16 bits."""
    if not is_label:
        return pixels_from_image(image)
    import cv2

    found = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_UNCHANGED)
    if found is None:
        raise LogError(f"{len(image.data)} bytes are no label PNG")
    return np.asarray(found)


def _labelled(
    source: Source, camera: str, stamp_ns: int, parts: dict[str, UInt8Array], table: UInt8Array
) -> Iterator[Labelled]:
    if "image" not in parts:
        return
    image, classes, things = parts["image"], None, None
    if image.ndim == 2:
        image = np.repeat(image[..., None], 3, axis=2)
    if "classes" in parts:
        classes = np.where(parts["classes"] == NO_CLASS, UNLABELLED, table[parts["classes"]]).astype(np.uint8)
    if "instances" in parts:
        numbers = parts["instances"].astype(np.int64)
        things = np.where(numbers == NO_INSTANCE, -1, numbers)
    more = {"log": source.name, "camera": camera, "stamp_ns": stamp_ns, "pose": source.pose_at(stamp_ns)}
    yield Labelled(f"{source.name}_{camera}_{stamp_ns}", source.name, image, classes, things, more)
