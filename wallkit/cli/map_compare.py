"""`wallkit map fmt`, `diff` and `merge`: one way to write maps, what is different between two, three made one."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common

PATH = click.Path(path_type=Path)


@click.command()
@click.argument("files", nargs=-1, required=True, type=PATH, metavar="FILE...")
@click.option("--check", is_flag=True, help="Write nothing; exit 1 if a file is not in canonical form.")
@click.option("--dry-run", is_flag=True, help="Print the patch and write nothing.")
@click.pass_context
def fmt(ctx: click.Context, /, files: tuple[Path, ...], check: bool, dry_run: bool) -> None:
    """Write maps in canonical form, in place: indentation, order of attributes, numbers.

    Comments stay, no value changes, and a second time nothing does. Exits 0 if done, with --check 1 if a file would
    change; 2 if one cannot be read, and then none is written.

    \b
    Examples:
      wallkit map fmt floor2.wkmap.urdf
      wallkit map fmt --check maps/*.urdf
      wallkit map fmt floor2.wkmap.urdf --dry-run | less
    """
    from wallkit.pipelines import map as pipeline
    from wallkit.pipelines.map_compare import format_files

    done = format_files(files)
    changed = [file for file in done if not file.is_canonical]
    for file in changed:
        if dry_run:
            click.echo(file.patch, nl=False)
        elif not check:
            pipeline.write_whole(file.path, file.after)
        said = "would change" if dry_run or check else "formatted"
        click.echo(f"{file.path}: {said}", err=dry_run)
    click.echo(f"{len(done) - len(changed)} of {len(done)} in canonical form already", err=dry_run)
    ctx.exit(common.FAILED_CHECK if check and changed else common.OK)


@click.command()
@click.argument("a", type=PATH, metavar="A")
@click.argument("b", type=PATH, metavar="B")
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0.0),
    default=1e-6,
    show_default=True,
    help="Smaller differences are rounding (m, rad).",
)
@common.json_option
@click.pass_context
def diff(ctx: click.Context, /, a: Path, b: Path, tolerance: float, as_json: bool) -> None:
    """Say what B has otherwise than A, in the map's words: what moved by how much, limits, rooms, classes, names.

    Formatting, comments, order and visuals do not count. Exits 0 if the maps mean the same, 1 if not, 2 if one cannot be
    read.

    \b
    Examples:
      wallkit map diff old.wkmap.urdf new.wkmap.urdf
      wallkit map diff old.wkmap.urdf new.wkmap.urdf --tolerance 0.005
      wallkit map diff old.wkmap.urdf new.wkmap.urdf --json | jq '.changes[] | select(.kind == "moved")'
    """
    from dataclasses import asdict

    from wallkit.pipelines.map_compare import compare_files

    changes = compare_files(a, b, tolerance=tolerance)
    if as_json:
        rows = [asdict(change) for change in changes]
        common.emit({"a": a, "b": b, "same": not changes, "changes": rows})
    elif changes:
        click.echo("\n".join(change.text for change in changes))
    else:
        click.echo(f"{a} and {b} mean the same")
    ctx.exit(common.FAILED_CHECK if changes else common.OK)
