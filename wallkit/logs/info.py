"""A log -> what is in it, and whether the robot can be localized from it, and why not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from wallkit.errors import LogError
from wallkit.logs.message import Channel, Value
from wallkit.logs.reader import Log, stamp_of
from wallkit.logs.rig import Rig, Wanted, find_rig
from wallkit.logs.topics import (
    IMAGE_KINDS,
    Track,
    frame_of,
    pick_initial_pose,
    pick_odometry,
    pick_scan,
    pick_truth,
)

# a clock that starts before 2000-01-01 counts from when something was switched on
_ABSOLUTE_FROM_NS = 946_684_800 * 1_000_000_000


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """One topic of a log.

    Attributes:
        rate_hz: messages a second by header stamps; by record time of transforms, whose publishers share a topic, and of
            messages that are not decoded. None below two.
        frames: the frames its messages are in, or "parent->child" of transforms.
        start_ns, end_ns: first and last stamp. longest_gap_s, gap_at_ns: the longest time without a message.
        stamps_back: messages stamped no later than the one before.
        clock_offset_s: record time less header stamp, smallest and largest; None where messages carry no stamp.
        note: why its messages are not decoded; empty when they are.
    """

    topic: str
    type_name: str
    encoding: str
    count: int
    rate_hz: float | None
    frames: tuple[str, ...]
    start_ns: int | None
    end_ns: int | None
    longest_gap_s: float
    gap_at_ns: int | None
    stamps_back: int
    clock_offset_s: tuple[float, float] | None
    note: str = ""


@dataclass(frozen=True, slots=True)
class LogInfo:
    """What `wallkit log info` says.

    Attributes:
        start_ns, end_ns: first and last header stamp of scans and odometry; of all topics that repeat, where those are not
            known. None for an empty log.
        is_clock_absolute: whether stamps are dates, or count from when the robot was switched on.
        transforms: (parent, child, whether it is static).
        scan, odometry, mount, truth, initial_pose, maps, images: what would be used, in words; empty where there is none.
        can_localize: whether `localize` would start; reasons: why not, one sentence with its hint each.
        losses, notes, skipped: as in `loss.Loss`.
    """

    paths: tuple[str, ...]
    formats: tuple[str, ...]
    topics: tuple[TopicInfo, ...]
    start_ns: int | None
    end_ns: int | None
    is_clock_absolute: bool
    transforms: tuple[tuple[str, str, bool], ...]
    scan: str
    odometry: str
    mount: str
    truth: str
    initial_pose: str
    maps: tuple[str, ...]
    images: tuple[str, ...]
    can_localize: bool
    reasons: tuple[str, ...]
    losses: tuple[str, ...]
    notes: tuple[str, ...]
    skipped: Mapping[str, str]

    @property
    def duration_s(self) -> float:
        """Time from the first to the last stamp."""
        return 0.0 if self.start_ns is None or self.end_ns is None else (self.end_ns - self.start_ns) * 1e-9


def describe(log: Log, wanted: Wanted | None = None) -> LogInfo:
    """What is in a log; reads all of it once."""
    wanted = wanted or Wanted()
    tallies: dict[Channel, _Tally] = {channel: _Tally() for channel in log.channels}
    transforms: dict[tuple[str, str], bool] = {}
    for channel, log_ns, value in log.decoded():
        tallies[channel].add(log_ns, value)
        if isinstance(value, tuple):
            transforms.update({(t.parent, t.child): t.is_static for t in value})
    topics = tuple(t.info(c, log.loss.skipped.get(c.topic, "")) for c, t in tallies.items())
    rig, reasons = _verdict(log, wanted, topics)
    used = rig.topics if rig else {c.topic for c in log.channels if not c.is_static}
    moving = [t for t in topics if t.topic in used and t.clock_offset_s is not None and t.count > 1]
    start_ns = min((t.start_ns for t in moving if t.start_ns is not None), default=None)
    end_ns = max((t.end_ns for t in moving if t.end_ns is not None), default=None)
    truth, initial = _named(log)
    return LogInfo(
        paths=tuple(str(p) for p in log.paths),
        formats=log.formats,
        topics=topics,
        start_ns=start_ns,
        end_ns=end_ns,
        is_clock_absolute=start_ns is not None and start_ns >= _ABSOLUTE_FROM_NS,
        transforms=tuple((parent, child, static) for (parent, child), static in transforms.items()),
        scan=rig.scan.topic if rig else "",
        odometry=str(rig.odometry) if rig else "",
        mount=rig.mount.source if rig else "",
        truth=truth,
        initial_pose=initial,
        maps=tuple(log.static.maps),
        images=tuple(dict.fromkeys(c.topic for c in log.channels_of(*IMAGE_KINDS))),
        can_localize=not reasons,
        reasons=tuple(reasons),
        losses=tuple(log.loss.lines()),
        notes=tuple(log.loss.notes),
        skipped=dict(log.loss.skipped),
    )


@dataclass
class _Tally:
    count: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    previous_ns: int | None = None
    span_ns: int = 0
    gap_ns: int = 0
    gap_at_ns: int | None = None
    stamps_back: int = 0
    offsets_ns: tuple[int, int] | None = None
    frames: dict[str, None] = field(default_factory=dict)

    def add(self, log_ns: int, value: Value | None) -> None:
        stamp_ns = log_ns if value is None else stamp_of(value, log_ns)
        # several publishers share a TF topic, each with stamps of its own: only record time tells its rhythm
        time_ns = log_ns if isinstance(value, tuple) else stamp_ns
        self.count += 1
        if self.previous_ns is not None:
            self.stamps_back += time_ns <= self.previous_ns
            if time_ns - self.previous_ns > self.gap_ns:
                self.gap_ns, self.gap_at_ns = time_ns - self.previous_ns, self.previous_ns
            self.span_ns += time_ns - self.previous_ns
        self.previous_ns = time_ns
        self.first_ns = stamp_ns if self.first_ns is None else min(self.first_ns, stamp_ns)
        self.last_ns = stamp_ns if self.last_ns is None else max(self.last_ns, stamp_ns)
        if value is not None and not isinstance(value, str):
            low, high = self.offsets_ns or (log_ns - stamp_ns, log_ns - stamp_ns)
            self.offsets_ns = min(low, log_ns - stamp_ns), max(high, log_ns - stamp_ns)
            self.frames.update(dict.fromkeys(_frames_of(value)))

    def info(self, channel: Channel, note: str) -> TopicInfo:
        offset = None if self.offsets_ns is None else (self.offsets_ns[0] * 1e-9, self.offsets_ns[1] * 1e-9)
        return TopicInfo(
            topic=channel.topic,
            type_name=channel.type_name,
            encoding=channel.encoding,
            count=self.count,
            rate_hz=(self.count - 1) / (self.span_ns * 1e-9) if self.span_ns > 0 else None,
            frames=tuple(self.frames),
            start_ns=self.first_ns,
            end_ns=self.last_ns,
            longest_gap_s=self.gap_ns * 1e-9,
            gap_at_ns=self.gap_at_ns,
            stamps_back=self.stamps_back,
            clock_offset_s=offset,
            note=note,
        )


def _frames_of(value: Value) -> list[str]:
    if isinstance(value, tuple):
        return [f"{t.parent}->{t.child}" for t in value]
    return [frame_of(value)]


def _verdict(log: Log, wanted: Wanted, topics: tuple[TopicInfo, ...]) -> tuple[Rig | None, list[str]]:
    """What would be read to localize; or the sentences that say why it cannot be done."""
    reasons = [r for r in (_error(log, wanted, "scan"), _error(log, wanted, "odometry")) if r]
    if reasons:
        return None, reasons
    try:
        rig = find_rig(log, wanted)
    except LogError as error:
        return None, [str(error)]
    spans = {t.topic: (t.start_ns or 0, t.end_ns or 0) for t in topics}
    scan_start, scan_end = spans[rig.scan.topic]
    start, end = spans[rig.odometry.topics[0]]
    if scan_end < start or scan_start > end:
        apart_s = max(start - scan_end, scan_start - end) * 1e-9
        return rig, [
            f"{log.name}: stamps of {rig.scan.topic} and {rig.odometry} are {apart_s:.3f} s apart and never overlap"
        ]
    return rig, []


def _error(log: Log, wanted: Wanted, part: str) -> str:
    try:
        _ = pick_scan(log, wanted.scan) if part == "scan" else pick_odometry(log, wanted.odometry)
    except LogError as error:
        return str(error)
    return ""


def _named(log: Log) -> tuple[str, str]:
    """Topics of truth and initial pose; several candidates are said as such."""

    def words(pick: object) -> str:
        try:
            found = pick(log)  # type: ignore[operator]
        except LogError as error:
            return error.message
        return "" if found is None else str(found) if isinstance(found, Track) else found.topic

    return words(pick_truth), words(pick_initial_pose)
