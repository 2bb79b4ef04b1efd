"""`wallkit map score` and `probe`: how well a robot can tell where it is in a map, and what it should see at a pose."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common
from wallkit.cli.map.words import ANGLE, FILE, LENGTH, SignedCommand

PICTURE = click.option("-o", "--out", type=click.Path(path_type=Path), metavar="PICTURE", help="A .png or .svg of it.")


@click.command("score")
@FILE
@click.option(
    "--poses", type=click.IntRange(1, 100_000), default=1000, show_default=True, help="Most poses, on a grid."
)
@common.seed_option
@PICTURE
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
def score_command(
    file: Path,
    poses: int,
    seed: int,
    out: Path | None,
    overwrite: bool,
    config_path: Path | None,
    words: tuple[str, ...],
    as_json: bool,
) -> None:
    """Say how well a robot can tell where it is in a map: places alike, directions left open, and what would help.

    A pose is ambiguous when another one more than 0.5 m or 30 deg away explains at least 90 % of its beams within 5 cm.
    FILE is a semantic map or a map_server YAML. Range, robot radius and scan plane are the settings' (rules.max_range_m,
    rules.robot_radius_m, rules.scan_plane_m), else the map's, else defaults; they are printed.

    \b
    Examples:
      wallkit map score floor2.wkmap.urdf
      wallkit map score floor2.wkmap.urdf -o heat.png --set rules.max_range_m=8
      wallkit map score floor.yaml --poses 300 --json | jq .plain.ambiguous_share
    """
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.map.heat import check_picture, heat_picture, write_picture
    from wallkit.pipelines.map.score import score_document, score_map, summary_lines

    kind = check_picture(out, overwrite=overwrite) if out is not None else ""
    scored = score_map(file, load_config(config_path, words).config.rules, poses=poses, seed=seed)
    if out is not None:
        write_picture(out, heat_picture(scored, kind), overwrite=overwrite)
    if as_json:
        common.emit({**score_document(scored), "picture": out})
        return
    click.echo("\n".join([*summary_lines(scored), f"  for {scored.robot}"]))
    if out is not None:
        click.echo(f"wrote {out}")


@click.command(cls=SignedCommand)
@FILE
@click.argument("x", type=LENGTH, metavar="X")
@click.argument("y", type=LENGTH, metavar="Y")
@click.argument("yaw", type=ANGLE, metavar="YAW")
@PICTURE
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
def probe(
    file: Path,
    x: float,
    y: float,
    yaw: float,
    out: Path | None,
    overwrite: bool,
    config_path: Path | None,
    words: tuple[str, ...],
    as_json: bool,
) -> None:
    """Show the scan expected at X Y YAW of frame map, in metres and radians: what is met, by how many beams, how near.

    Exits 2 if the pose is inside something or where no floor is. Defaults as for `wallkit map score`.

    \b
    Examples:
      wallkit map probe floor2.wkmap.urdf 2.5 1.0 90deg
      wallkit map probe floor2.wkmap.urdf 2.5 1.0 -1.57 -o scan.png
      wallkit map probe floor2.wkmap.urdf 2.5 1.0 0 --json | jq '.beams[] | select(.class == "door")'
    """
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.map.heat import check_picture, probe_picture, write_picture
    from wallkit.pipelines.map.score import probe_map

    kind = check_picture(out, overwrite=overwrite) if out is not None else ""
    found = probe_map(file, load_config(config_path, words).config.rules, (x, y, yaw))
    if out is not None:
        write_picture(out, probe_picture(found, kind), overwrite=overwrite)
    if as_json:
        beams = [
            {"bearing_rad": bearing, "range_m": reach, "link": link or None, "class": name or None}
            for bearing, reach, link, name in zip(
                found.bearings_rad.tolist(), found.ranges_m.tolist(), found.links, found.classes, strict=True
            )
        ]
        shares = {name or "nothing": share for name, share in found.shares().items()}
        common.emit({"pose": [x, y, yaw], "shares": shares, "beams": beams, "picture": out})
        return
    said = ", ".join(f"{name or 'nothing'} {share:.0%}" for name, share in found.shares().items())
    click.echo(f"beams meet: {said} ({found.robot})")
    rows = [[link, name, str(beams), f"{near:.2f}"] for link, name, beams, near in found.nearest()]
    click.echo(common.table(["link", "class", "beams", "nearest [m]"], rows, right=(2, 3)))
    if out is not None:
        click.echo(f"wrote {out}")
