"""Files -> one Log of decoded messages, whatever recorder wrote them; recognised by their bytes, not their names."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from wallkit.core.types import CameraInfo, OccupancyGrid, Transform
from wallkit.errors import LogError
from wallkit.logs.bag import MAGIC as BAG_MAGIC
from wallkit.logs.bag import OLD_MAGICS, BagFile
from wallkit.logs.carmen import CarmenFile, looks_like_carmen
from wallkit.logs.decode import Decoder, UndecodableError, UnknownTypeError, decoder
from wallkit.logs.loss import Loss
from wallkit.logs.mcap import McapFile
from wallkit.logs.mcap_records import MAGIC as MCAP_MAGIC
from wallkit.logs.message import Channel, LogFile, Message, RawMessage, Value
from wallkit.logs.sqlite import MAGIC as SQLITE_MAGIC
from wallkit.logs.sqlite import SqliteFile
from wallkit.logs.unpack import Unpacked, files_of_directory, unpacked

_HEAD_BYTES = 65536


@dataclass(frozen=True, slots=True)
class Format:
    """How a file format is recognised from the first 64 KiB, and what reads it."""

    matches: Callable[[bytes], bool]
    open: Callable[[Path, Loss], LogFile]


@dataclass(frozen=True)
class Static:
    """What holds for the whole recording, wherever in it the message stands.

    Attributes:
        transforms: of /tf_static, of all publishers; of two for the same child and parent the later.
        robot_descriptions: topic -> URDF text. maps: topic -> its last OccupancyGrid.
        camera_infos: topic -> its first CameraInfo.
    """

    transforms: tuple[Transform, ...]
    robot_descriptions: Mapping[str, str]
    maps: Mapping[str, OccupancyGrid]
    camera_infos: Mapping[str, CameraInfo]


def open_log(paths: Sequence[Path]) -> Log:
    """One log of all files and split directories, merged by record time.

    Raises:
        LogError: a path does not exist, is no recording, or nothing in it can be recovered.
    """
    if not paths:
        raise LogError("no log was given")
    loss = Loss()
    files = [f for path in paths for f in (files_of_directory(path) if path.is_dir() else [path])]
    opened = [unpacked(_existing(file)) for file in files]
    return Log(tuple(paths), [_open(u, loss) for u in opened], loss, opened)


class Log:
    """A recording. It can be read any number of times; what is lost on the way is counted in `loss`.

    Attributes:
        paths: as given by the user. files: the readers behind them.
        channels: one for each topic, type and encoding, in the order of the files.
    """

    def __init__(
        self, paths: tuple[Path, ...], files: Sequence[LogFile], loss: Loss, keep: Sequence[Unpacked] = ()
    ) -> None:
        self.paths, self.files, self.loss = paths, tuple(files), loss
        self._keep = keep  # temporary copies of compressed files live as long as the log
        merged: dict[Channel, int | None] = {}
        for channel in (c for f in files for c in f.channels):
            before = merged.get(channel, 0)
            merged[channel] = None if before is None or channel.count is None else before + channel.count
        self.channels = tuple(replace(c, count=n) for c, n in merged.items())
        self._decoders: dict[Channel, Decoder | None] = {}

    @property
    def name(self) -> str:
        """The paths, for messages."""
        return ", ".join(str(p) for p in self.paths)

    @property
    def formats(self) -> tuple[str, ...]:
        """What kinds of file it is made of."""
        return tuple(sorted({f.format for f in self.files}))

    def reopened(self) -> Log:
        """The same recording, of which nothing was lost yet; compressed files are not unpacked again."""
        loss = Loss()
        return Log(self.paths, [_open(unpacked_file, loss) for unpacked_file in self._keep], loss, self._keep)

    def channels_of(self, *kinds: str) -> tuple[Channel, ...]:
        """Channels that carry one of the types ("sensor_msgs/LaserScan"), and can be decoded."""
        return tuple(c for c in self.channels if c.kind in kinds and self._decoder(c) is not None)

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Serialised messages of the topics (None: of all) by record time, of all files."""
        streams = [f.raw(topics) for f in self.files if topics is None or any(c.topic in topics for c in f.channels)]
        return streams[0] if len(streams) == 1 else heapq.merge(*streams, key=lambda message: message[0])

    def messages(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Message]:
        """Decoded messages by record time.

        Args:
            topics: only these; None for every topic that can be decoded.
            start_ns, end_ns: only header stamps in [start, end). Static things are not cut off: they are in `static`.
        """
        for channel, log_ns, value in self.decoded(topics):
            if value is None:
                continue
            stamp_ns = stamp_of(value, log_ns)
            if (start_ns is None or stamp_ns >= start_ns) and (end_ns is None or stamp_ns < end_ns):
                yield Message(channel.topic, stamp_ns, log_ns, channel.type_name, value)

    def decoded(self, topics: Collection[str] | None = None) -> Iterator[tuple[Channel, int, Value | None]]:
        """(channel, record time [ns], value) of every message; the value is None where it cannot be decoded."""
        undecodable: dict[str, int] = {}
        decoders: dict[
            int, Decoder | None
        ] = {}  # by id: hashing a channel for every message would cost as much as reading
        for log_ns, _, channel, data in self.raw(topics):
            if id(channel) not in decoders:
                decoders[id(channel)] = self._decoder(channel)
            decode = decoders[id(channel)]
            value = None
            if decode is not None:
                try:
                    value = decode(data)
                except UndecodableError as error:
                    undecodable[channel.topic] = undecodable.get(channel.topic, 0) + 1
                    self.loss.count_undecodable(channel.topic, undecodable[channel.topic], str(error))
            yield channel, log_ns, value

    def first(self, topic: str, count: int = 1) -> list[Message]:
        """The first few messages of a topic."""
        return [m for m, _ in zip(self.messages([topic]), range(count), strict=False)]

    @cached_property
    def static(self) -> Static:
        """What holds for the whole recording, read from all of it."""
        transforms: dict[tuple[str, str], Transform] = {}
        for message in self._all_of(c for c in self.channels if c.is_static):
            if isinstance(message.value, tuple):
                transforms.update({(t.parent, t.child): t for t in message.value})
        maps = {m.topic: m.value for m in self._all_of(self.channels_of("nav_msgs/OccupancyGrid"))}
        texts = [c for c in self.channels_of("std_msgs/String") if c.topic.endswith("robot_description")]
        descriptions = {m.topic: m.value for m in self._all_of(texts)}
        infos = {}
        for channel in self.channels_of("sensor_msgs/CameraInfo", "foxglove.CameraCalibration"):
            infos.update({m.topic: m.value for m in self.first(channel.topic)})
        return Static(
            tuple(transforms.values()),
            {t: v for t, v in descriptions.items() if isinstance(v, str)},
            {t: v for t, v in maps.items() if isinstance(v, OccupancyGrid)},
            {t: v for t, v in infos.items() if isinstance(v, CameraInfo)},
        )

    def _all_of(self, channels: Collection[Channel] | Iterator[Channel]) -> Iterator[Message]:
        topics = {c.topic for c in channels}
        return self.messages(topics) if topics else iter(())

    def _decoder(self, channel: Channel) -> Decoder | None:
        if channel not in self._decoders:
            try:
                self._decoders[channel] = decoder(channel, self.loss)
            except UnknownTypeError as error:
                self._decoders[channel] = None
                self.loss.skipped.setdefault(channel.topic, str(error))
        return self._decoders[channel]


def stamp_of(value: Value, log_ns: int) -> int:
    """Header stamp of a decoded message; its record time where the type has none."""
    if isinstance(value, str):
        return log_ns
    if isinstance(value, tuple):
        return value[0].stamp_ns if value else log_ns
    return value.stamp_ns


def _existing(path: Path) -> Path:
    if not path.exists():
        raise LogError("no such file", where=path, hint="check the path; a split recording is given as its directory")
    if path.stat().st_size == 0:
        raise LogError("the file is empty (0 bytes)", where=path, hint="the recorder wrote nothing; record again")
    return path


def _open(file: Unpacked, loss: Loss) -> LogFile:
    with file.path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES)
    if head.startswith(OLD_MAGICS):
        version = head.split(b"\n", 1)[0].decode(errors="replace")
        hint = "convert it with `rosbag fix` of an old ROS 1"
        raise LogError(f"this bag is older than version 2.0 ({version!r})", where=file.source, hint=hint)
    for form in READERS.values():
        if form.matches(head):
            return form.open(file.path, loss)
    known = ", ".join(READERS)
    hint = f"readable are: {known}, and these compressed by zstd, lz4 or gzip"
    raise LogError(f"not a recording: it begins with {head[:12]!r}", where=file.source, hint=hint)


READERS: dict[str, Format] = {
    "MCAP": Format(lambda head: head.startswith(MCAP_MAGIC), McapFile),
    "ROS 1 bag": Format(lambda head: head.startswith(BAG_MAGIC), BagFile),
    "rosbag2 SQLite": Format(lambda head: head.startswith(SQLITE_MAGIC), SqliteFile),
    "CARMEN": Format(looks_like_carmen, CarmenFile),
}
