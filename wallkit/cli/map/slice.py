"""`wallkit map slice` and `compat`: what a LiDAR at a height sees of a map, and what other programs make of its file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common
from wallkit.cli.map.words import FILE, PLANE, Number

if TYPE_CHECKING:
    from wallkit.maps.plane import PlaneView, Standing
    from wallkit.maps.space import Region
    from wallkit.pipelines.map.compat import Compat


@click.command("slice")
@FILE
@click.option(
    "--z", "plane", type=PLANE, default="lidar", show_default=True, metavar="M|lidar", help="Height; lidar: the map's."
)
@click.option(
    "--wobble",
    "wobble_m",
    type=Number("length", least=0.0, most=1.0),
    default=0.05,
    show_default=True,
    metavar="M",
    help="How far a tilt moves the plane.",
)
@common.out_option
@common.overwrite_option
@common.json_option
def slice_(
    file: Path,
    plane: float | str,
    wobble_m: float,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Say what a LiDAR at a height sees and does not see, which floor is closed there, and what a tilt changes.

    With -o PATH (.svg or .png) the plan is drawn too, with what the plane cuts in bold.

    \b
    Examples:
      wallkit map slice floor2.wkmap.urdf
      wallkit map slice floor2.wkmap.urdf --z 0.85 -o seen.svg
      wallkit map slice floor2.wkmap.urdf --z 1.5 --json | jq '.out[].link'
    """
    from wallkit.maps.draw.plan import PlanSettings
    from wallkit.maps.plane import view_at
    from wallkit.maps.read import load_map
    from wallkit.pipelines.map import draw as map_draw

    if out is not None:
        map_draw.check_target(out, overwrite=overwrite)
    semantic_map = load_map(file)
    z_m = map_draw.plane_of(semantic_map, plane) or 0.0
    view = view_at(semantic_map, z_m, wobble_m=wobble_m)
    if as_json:
        common.emit(_document(view, file))
    else:
        click.echo("\n".join(_lines(view)))
    if out is not None:
        size = map_draw.write_plan(out, semantic_map, PlanSettings(z_m=z_m))
        click.echo(f"wrote {out}: {size / 1000:.0f} kB", err=True)


@click.command()
@FILE
@click.option(
    "--run", "with_yourdfpy", is_flag=True, help="Load it with yourdfpy too, and compare where the links are."
)
@common.config_option
@common.set_option
@common.json_option
@click.pass_context
def compat(
    ctx: click.Context,
    /,
    file: Path,
    with_yourdfpy: bool,
    config_path: Path | None,
    words: tuple[str, ...],
    as_json: bool,
) -> None:
    """Say what yourdfpy, urdfdom and MuJoCo make of a file; none of them needs to be installed.

    Exits 0 if all load it as it is meant, 1 if one refuses it or loads something else, 2 if it cannot be read.

    \b
    Examples:
      wallkit map compat floor2.wkmap.urdf
      wallkit map compat apartment.urdf --json | jq '.programs[] | {program, outcome}'
      wallkit map compat floor2.wkmap.urdf --run
    """
    import datetime

    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.map.compat import compat_of
    from wallkit.pipelines.map.verdicts import Selection

    today = datetime.datetime.now().astimezone().date()
    selection = Selection(load_config(config_path, words).config.rules, today)
    found = compat_of(file, selection, with_yourdfpy=with_yourdfpy)
    if as_json:
        common.emit(_compat_document(found))
    else:
        click.echo("\n".join(_compat_lines(found)))
    ctx.exit(common.OK if found.is_good else common.FAILED_CHECK)


# ------------------------------------------------------------------------------------------------ details


def _lines(view: PlaneView) -> list[str]:
    seen = [element for element in view.elements if element.sight == "in"]
    missed = [element for element in view.elements if element.sight != "in"]
    lines = [f"plane    {view.z_m:g} m; a tilt moves it by {view.wobble_m:g} m"]
    lines += ["", f"in the plane: {len(seen)} of {len(view.elements)} elements"]
    lines += _table(seen, [_remark(element) for element in seen])
    lines += ["", f"not seen: {len(missed)}"]
    lines += _table(missed, [{"between": "in two parts"}.get(e.sight, e.sight) for e in missed])
    lines += [
        "",
        f"closed floor, doors closed: {_areas(view.closed)}",
        f"closed floor, doors open: {_areas(view.open)}",
    ]
    low, high = view.z_m - view.wobble_m, view.z_m + view.wobble_m
    lines += [
        "",
        f"what changes from {low:g} to {high:g} m: {'' if view.changing or view.regions_change else 'nothing'}",
    ]
    for element in view.changing:
        edges = " and ".join(f"{edge:.2f} m" for edge in element.changes)
        lines.append(f"  {element.link} ({element.class_name or 'no class'}) begins or ends at {edges}")
    if view.regions_change:
        counts = ", ".join(f"{count} at {z:.2f} m" for z, count in view.open_counts)
        lines.append(f"  closed floor, doors open: {counts}")
    return [line.rstrip() for line in lines]


def _table(elements: list[Standing], remarks: list[str]) -> list[str]:
    if not elements:
        return []
    rows = [
        [f"  {e.link}", e.class_name or "-", _heights(e), remark] for e, remark in zip(elements, remarks, strict=True)
    ]
    return common.table(["  link", "class", "heights", ""], rows).splitlines()


def _remark(element: Standing) -> str:
    return "" if element.lidar == "opaque" else {"none": "never returns"}.get(element.lidar, element.lidar)


def _heights(element: Standing) -> str:
    return ", ".join(f"{low:.2f} ... {high:.2f}" for low, high in element.z_m)


def _areas(regions: Sequence[Region]) -> str:
    areas = [f"{region.area_m2:.1f} m2" for region in regions]
    return f"{len(areas)} ({', '.join(areas)})" if areas else "none"


def _document(view: PlaneView, file: Path) -> dict[str, object]:
    def row(element: Standing) -> dict[str, object]:
        return {
            "link": element.link,
            "class": element.class_name,
            "lidar": element.lidar,
            "z_m": element.z_m,
            "sight": element.sight,
            "changes_at_m": element.changes,
        }

    return {
        "file": file,
        "z_m": view.z_m,
        "wobble_m": view.wobble_m,
        "in": [row(element) for element in view.elements if element.sight == "in"],
        "out": [row(element) for element in view.elements if element.sight != "in"],
        "closed_area_m2": [region.area_m2 for region in view.closed],
        "open_area_m2": [region.area_m2 for region in view.open],
        "changes": [element.link for element in view.changing],
        "regions_change": view.regions_change,
        "open_counts": [{"z_m": z, "regions": count} for z, count in view.open_counts],
    }


_SAID = {"loads": "loads it", "differs": "loads something else", "refuses": "refuses it"}


def _compat_lines(found: Compat) -> list[str]:
    from wallkit.maps.findings.text import text_from

    lines = []
    for view in found.views:
        # of MuJoCo not every trap is known
        is_sure = view.outcome != "loads" or not view.tool.startswith("MuJoCo")
        lines.append(f"{view.tool}: {_SAID[view.outcome] if is_sure else 'nothing known against it'}")
        for trap in view.traps:
            at = f"{trap.finding.line}:{trap.finding.column}"
            lines.append(f"  {at} {trap.finding.code}: {trap.effect}")
    if found.loaded:
        lines.append(f"yourdfpy here: {found.loaded}")
    return [*lines, "", text_from([found.judged]).rstrip("\n")]


def _compat_document(found: Compat) -> dict[str, object]:
    programs = [
        {
            "program": view.tool,
            "outcome": view.outcome,
            "traps": [
                {"rule": t.finding.code, "line": t.finding.line, "column": t.finding.column, "effect": t.effect}
                for t in view.traps
            ],
        }
        for view in found.views
    ]
    return {
        "file": found.judged.report.source,
        "good": found.is_good,
        "programs": programs,
        "yourdfpy_here": found.loaded or None,
    }
