"""`wallkit map audit`: does a recorded log agree with the map?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.localize import topic_options, wanted_from_flags

if TYPE_CHECKING:
    from wallkit.maps.audit.nouns import ElementEvidence
    from wallkit.pipelines.map.audit import Audit

COLORS = {"error": "red", "warning": "yellow", "info": "cyan"}


@click.command()
@click.argument("map_path", type=click.Path(path_type=Path), metavar="MAP")
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option("--truth", metavar="TOPIC|FILE.tum|log", help="Take true poses; log: what the log itself calls truth.")
@click.option(
    "--run", type=click.Path(path_type=Path), metavar="DIR", help="Take the poses of a finished localize run."
)
@click.option("--init", metavar="WHERE", help="Else localize in MAP first, from X,Y,YAW | topic | truth | global.")
@topic_options
@click.option("--select", multiple=True, metavar="RULES", help="Only these: A003, WK-A00.")
@click.option("--ignore", multiple=True, metavar="RULES", help="All but these (both repeatable; commas allowed).")
@click.option("--lenient", is_flag=True, help="Only errors make the verdict bad, warnings do not.")
@click.option(
    "--format",
    "format_name",
    type=click.Choice(["text", "json", "sarif", "junit", "github"]),
    default="text",
    show_default=True,
    help="How findings are written.",
)
@click.option("--elements", is_flag=True, help="List every element: how much was seen, how far it is off.")
@common.out_option
@common.overwrite_option
@common.config_option
@common.set_option
@common.seed_option
@common.json_option
@common.color_option
@common.quiet_option
@click.pass_context
def audit(ctx: click.Context, /, map_path: Path, logs: tuple[Path, ...], **flags: Any) -> None:
    """Compare a semantic map with a recorded log: what is gone, what is new, what stands elsewhere, how doors stood.

    Every offset comes with its standard deviation; the poses' own errors are in it. Without --truth and --run the log is
    localized in the map itself, and the parts where the robot was not LOCALIZED are left out. PATH (.svg or .png) is a
    picture: seen walls, missing ones, new things, offsets.

    Exits 0 if the map agrees with the log, 1 if not (WK-A001 to WK-A004), 4 if the log does not let one tell, 2 if it
    could not be done.

    \b
    Examples:
      wallkit map audit floor2.wkmap.urdf log.mcap
      wallkit map audit floor2.wkmap.urdf log.mcap --truth log -o audit.svg
      wallkit map audit floor2.wkmap.urdf log.mcap --run log.wallkit --elements
      wallkit map audit floor2.wkmap.urdf log.mcap --format sarif > audit.sarif
    """
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.map import audit as pipeline
    from wallkit.pipelines.map.draw import check_target

    if flags["truth"] is not None and flags["run"] is not None:
        raise click.UsageError("take poses from one of --truth and --run")
    if flags["out"] is not None:
        check_target(flags["out"], overwrite=flags["overwrite"])
    pipeline.check_semantic(map_path)
    config = load_config(flags["config_path"], flags["words"]).config
    with common.progress("localize", None, quiet=flags["quiet"]) as observe:
        done = pipeline.audit(_request(map_path, logs, flags), config, observe=observe)
    _print(done, "json" if flags["as_json"] else flags["format_name"], flags)
    if flags["out"] is not None:
        pipeline.write_picture(flags["out"], done)
        click.echo(f"wrote {flags['out']}", err=True)
    ctx.exit(exit_code(done))


def exit_code(done: Audit) -> int:
    """The verdict."""
    if done.cannot_tell:
        return common.CANNOT_TELL
    return common.OK if done.judged.is_good else common.FAILED_CHECK


# ------------------------------------------------------------------------------------------------ details


def _request(map_path: Path, logs: tuple[Path, ...], flags: dict[str, Any]) -> Any:
    import datetime

    from wallkit.pipelines.map.audit import AuditRequest

    return AuditRequest(
        map=map_path,
        logs=logs,
        today=datetime.datetime.now().astimezone().date(),
        truth=flags["truth"],
        run=flags["run"],
        init=flags["init"],
        seed=flags["seed"],
        wanted=wanted_from_flags(flags),
        select=_words(flags["select"]),
        ignore=_words(flags["ignore"]),
        is_lenient=flags["lenient"],
    )


def _words(values: tuple[str, ...]) -> list[str]:
    return [word for value in values for word in value.replace(",", " ").split()]


def _print(done: Audit, format_name: str, flags: dict[str, Any]) -> None:
    import json

    from wallkit.maps.findings.formats import DOCUMENTS, TEXTS
    from wallkit.maps.findings.text import text_from

    judged = [done.judged]
    if format_name == "json":
        common.emit({**DOCUMENTS["json"](judged), "audit": _facts(done)})
    elif format_name in DOCUMENTS:
        click.echo(json.dumps(common.plain(DOCUMENTS[format_name](judged)), indent=2, allow_nan=False))
    elif format_name != "text":
        click.echo(TEXTS[format_name](judged), nl=False)
    else:
        is_coloured = bool(common.console(flags["color"]).color_system)
        paint = (lambda text, as_: click.style(text, COLORS[as_])) if is_coloured else (lambda text, _: text)
        click.echo(text_from(judged, paint=paint), nl=False, color=is_coloured)
        click.echo("\n".join(_lines(done, with_elements=flags["elements"])))


def _lines(done: Audit, *, with_elements: bool) -> list[str]:
    """What to paste, the elements, and what it all rests on."""
    evidence = done.evidence
    pastes = [f.detail["paste"] for f in done.judged.report.findings if "paste" in f.detail]
    lines = ["", "to paste before </robot>:", *pastes, ""] if pastes else []
    if with_elements:
        headers = ["element", "seen m", "of m", "missing m", "views", "places", "off its face cm"]
        rows = [_row(element) for element in evidence.elements.values()]
        lines += [common.table(headers, rows, right=(1, 2, 3, 4, 5)), ""]
    lines.append(f"poses    {done.poses_from}")
    lines.append(f"looked   {done.views} scans from {evidence.places} places, LiDAR {done.z_m:g} m above the floor")
    lines.append(
        f"seen     {evidence.coverage:.0%} of the outline; the map explains {evidence.explained:.1%} of the returns"
    )
    drift = evidence.drift
    lines.append(f"scale    {1 + drift.values[3]:.4f} +- {drift.sd[3]:.4f} of the map's")
    told = [door for door in evidence.doors.values() if len(door.states)]
    if told:
        lines.append(f"doors    {len(told)} of {len(evidence.doors)} seen well enough to tell how they stood")
    lines.append(f"verdict  {_verdict(done)}")
    return lines


def _verdict(done: Audit) -> str:
    if done.cannot_tell:
        return f"cannot tell: {done.cannot_tell}"
    return "the map agrees with the log" if done.judged.is_good else "the map does not agree with the log"


def _row(element: ElementEvidence) -> list[str]:
    numbers = [f"{v:.2f}" for v in (element.observed_m, element.length_m, element.unsupported_m)]
    shifts = ", ".join(f"{s.offset_m * 100:+.1f} +- {s.sd_m * 100:.1f}" for s in element.shifts) or "-"
    return [element.link, *numbers, str(element.views), str(element.places), shifts]


def _facts(done: Audit) -> dict[str, Any]:
    from dataclasses import asdict

    evidence = done.evidence
    x, y, yaw, scale = evidence.drift.values.tolist()
    return {
        "cannot_tell": done.cannot_tell,
        "poses_from": done.poses_from,
        "scans": done.views,
        "places": evidence.places,
        "scan_plane_m": done.z_m,
        "coverage": evidence.coverage,
        "explained": evidence.explained,
        "drift": {"x_m": x, "y_m": y, "yaw_rad": yaw, "scale": 1 + scale, "sd": evidence.drift.sd},
        "elements": [asdict(element) for element in evidence.elements.values()],
        "doors": [asdict(door) for door in evidence.doors.values()],
    }
