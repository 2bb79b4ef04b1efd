"""`wallkit log`: what is in a recording, and the same recording as MCAP."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.localize import LOGS, topic_options, wanted_from_flags

if TYPE_CHECKING:
    from wallkit.logs.info import LogInfo


@click.group()
def log() -> None:
    """Look into recordings and convert them."""


@log.command()
@LOGS
@topic_options
@common.json_option
@click.pass_context
def info(ctx: click.Context, /, logs: tuple[Path, ...], as_json: bool, **flags: Any) -> None:
    """Say what is in a log, and whether it can be localized.

    Exits 0 if it can be read whole, 3 if something in it is damaged, 2 if it cannot be read.

    \b
    Examples:
      wallkit log info log.mcap
      wallkit log info bag/ --json | jq .can_localize
    """
    from dataclasses import asdict

    from wallkit.logs.info import describe
    from wallkit.logs.reader import open_log

    found = describe(open_log(logs), wanted_from_flags(flags))
    if as_json:
        common.emit({**asdict(found), "can_localize": found.can_localize})
    else:
        click.echo("\n".join(_lines(found)))
    ctx.exit(common.DATA_LOST if found.losses else common.OK)


@log.command()
@LOGS
@common.out_option
@common.overwrite_option
@common.json_option
@click.pass_context
def convert(ctx: click.Context, /, logs: tuple[Path, ...], out: Path | None, overwrite: bool, as_json: bool) -> None:
    """Write a recording of any known format as one MCAP (ROS 2 profile).

    Exits 0 if everything was taken along, 3 if something was damaged, 2 if it could not be done.

    \b
    Examples:
      wallkit log convert old.bag -o new.mcap
      wallkit log convert robot.clf.gz -o robot.mcap
    """
    from wallkit.errors import OutputError
    from wallkit.logs.convert import convert_log
    from wallkit.logs.reader import open_log

    if out is None:
        raise click.UsageError("say where to: -o new.mcap")
    if out.exists() and not overwrite:
        raise OutputError("exists", where=out, hint="choose another --out, or pass --overwrite to replace it")
    source = open_log(logs)
    report = convert_log(source, out)
    _say_converted(report, out, as_json)
    for line in source.loss.lines():
        common.warn(line)
    ctx.exit(common.DATA_LOST if source.loss else common.OK)


def _lines(found: LogInfo) -> list[str]:
    """The page of `log info`."""
    clock = "dates" if found.is_clock_absolute else "relative: counts from when the robot was switched on"
    lines = [
        f"log      {', '.join(found.paths)} ({', '.join(found.formats)})",
        f"time     {found.duration_s:.1f} s from {_stamp(found.start_ns)}; clock: {clock}",
        "",
        *common.table(
            ["topic", "type", "count", "rate", "frames", "longest gap", "record - stamp"],
            [_topic_row(topic) for topic in found.topics],
            right=(2, 3, 5, 6),
        ).splitlines(),
        "",
        f"scan     {found.scan or '-'}",
        f"odometry {found.odometry or '-'}",
        f"mount    {found.mount or '-'}",
        f"truth    {found.truth or '-'}",
        f"start    {found.initial_pose or '-'}",
        f"map      {', '.join(found.maps) or '- (give one with --map)'}",
    ]
    if found.images:
        lines.append(f"images   {', '.join(found.images)}")
    lines += _transform_lines(found)
    lines += [f"lost     {line}" for line in found.losses]
    lines += [f"note     {line}" for line in found.notes]
    lines += [f"skipped  {topic}: {reason}" for topic, reason in found.skipped.items()]
    lines.append("")
    if found.can_localize:
        lines.append("verdict  can be localized" + ("" if found.maps else ", given a map"))
    else:
        lines.append("verdict  cannot be localized:")
        lines += [f"  {line}" for reason in found.reasons for line in reason.splitlines()]
    return lines


def _topic_row(topic: Any) -> list[str]:
    offset = "-"
    if topic.clock_offset_s is not None:
        low, high = topic.clock_offset_s
        offset = f"{low:.2f} s" if high - low < 0.005 else f"{low:.2f} ... {high:.2f} s"
    frames = ", ".join(topic.frames[:3]) + (f", ... ({len(topic.frames)})" if len(topic.frames) > 3 else "")
    rate = "-" if topic.rate_hz is None else f"{topic.rate_hz:.2f} Hz"
    gap = f"{topic.longest_gap_s:.2f} s" if topic.count > 1 else "-"
    note = f"  ({topic.note})" if topic.note else ""
    return [topic.topic, topic.type_name + note, str(topic.count), rate, frames, gap, offset]


def _transform_lines(found: LogInfo) -> list[str]:
    """The frames as a tree, static ones marked."""
    children: dict[str, list[tuple[str, bool]]] = {}
    for parent, child, static in found.transforms:
        children.setdefault(parent, []).append((child, static))
    below = {child for _, child, _ in found.transforms}
    lines: list[str] = []

    def walk(frame: str, depth: int) -> None:
        for child, static in sorted(children.get(frame, [])):
            lines.append(f"{'  ' * depth}{child}{'' if static else ' (moves)'}")
            if depth < 20:
                walk(child, depth + 1)

    for root in sorted(set(children) - below):
        lines.append(root)
        walk(root, 1)
    if len(lines) > 12:
        lines = [*lines[:11], f"... ({len(lines) - 11} more frames)"]
    return [f"{'frames' if i == 0 else '':<8} {line}" for i, line in enumerate(lines)]


def _stamp(stamp_ns: int | None) -> str:
    from datetime import UTC, datetime

    if stamp_ns is None:
        return "-"
    seconds = f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"
    if stamp_ns < 946_684_800 * 10**9:
        return seconds
    return f"{seconds} ({datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC)"


def _say_converted(report: Any, out: Path, as_json: bool) -> None:
    if as_json:
        common.emit({"out": out, "written": dict(report.written), "skipped": report.skipped})
        return
    rows = [[topic, str(count)] for topic, count in sorted(report.written.items())]
    click.echo(common.table(["topic", "messages"], rows, right=(1,)))
    for topic, reason in report.skipped.items():
        click.echo(f"left out {topic}: {reason}")
    click.echo(f"written  {out}")
