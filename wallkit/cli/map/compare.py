"""`wallkit map fmt`, `diff` and `merge`: one way to write maps, what is different between two, three made one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.map.compare import MergedFile

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
    from wallkit.pipelines.map import verdicts as pipeline
    from wallkit.pipelines.map.compare import format_files

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
    type=common.Number(min=0.0),
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

    from wallkit.pipelines.map.compare import compare_files

    changes = compare_files(a, b, tolerance=tolerance)
    if as_json:
        rows = [asdict(change) for change in changes]
        common.emit({"a": a, "b": b, "same": not changes, "changes": rows})
    elif changes:
        click.echo("\n".join(change.text for change in changes))
    else:
        click.echo(f"{a} and {b} mean the same")
    ctx.exit(common.FAILED_CHECK if changes else common.OK)


@click.command()
@click.argument("base", type=PATH, metavar="BASE")
@click.argument("ours", type=PATH, metavar="A")
@click.argument("theirs", type=PATH, metavar="B")
@common.out_option
@click.option("--ours", "favour", flag_value="ours", help="Where both changed something, take A's.")
@click.option("--theirs", "favour", flag_value="theirs", help="Where both changed something, take B's.")
@common.overwrite_option
@common.dry_run_option
@common.json_option
@click.pass_context
def merge(
    ctx: click.Context,
    /,
    base: Path,
    ours: Path,
    theirs: Path,
    out: Path | None,
    favour: str | None,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Make one map of A and B, which were both made of BASE: A's file with what B changed.

    Everything of A stays as it is written: comments, order, indentation. Names tell what is the same thing, and what one
    side renamed is followed. What both changed differently is a conflict: it is listed with both values and nothing is
    written, unless --ours or --theirs says whose to take.

    Exits 0 if merged, 1 if there are conflicts or the result would be broken, 2 if a file cannot be read.

    \b
    Examples:
      wallkit map merge base.wkmap.urdf mine.wkmap.urdf hers.wkmap.urdf -o floor2.wkmap.urdf
      wallkit map merge base.wkmap.urdf mine.wkmap.urdf hers.wkmap.urdf --dry-run
      wallkit map merge base.wkmap.urdf mine.wkmap.urdf hers.wkmap.urdf -o mine.wkmap.urdf --overwrite --theirs
    """
    from dataclasses import asdict

    from wallkit.pipelines.map import verdicts as files
    from wallkit.pipelines.map.compare import check_target, merge_files

    if out is None and not dry_run:
        raise click.UsageError("say where to: -o merged.wkmap.urdf, or --dry-run")
    if out is not None:
        check_target(out, overwrite=overwrite)
    done = merge_files(base, ours, theirs, favour="theirs" if favour == "theirs" else "ours")
    is_good = not done.broken and (favour is not None or not done.conflicts)
    if is_good and out is not None and not dry_run:
        files.write_whole(out, done.data)
    if as_json:
        common.emit({**{key: value for key, value in asdict(done).items() if key != "data"}, "merged": is_good})
    else:
        click.echo("\n".join(_merge_lines(done, favour)))
        if is_good and out is not None:
            click.echo(f"{'would write' if dry_run else 'wrote'} {out}")
        elif not is_good:
            click.echo(
                "nothing is written" + ("" if done.broken else ": pass --ours or --theirs, or settle them by hand")
            )
    ctx.exit(common.OK if is_good else common.FAILED_CHECK)


# ------------------------------------------------------------------------------------------------ details


def _merge_lines(done: MergedFile, favour: str | None) -> list[str]:
    lines = []
    for conflict in done.conflicts:
        lines.append(
            f"conflict: {conflict.place}" + (f" (taken from {'A' if favour == 'ours' else 'B'})" if favour else "")
        )
        values = (("base", conflict.base), ("A", conflict.ours), ("B", conflict.theirs))
        lines += [f"  {side:<5} {value or '(none)'}" for side, value in values]
    lines += [f"taken from B: {change.text}" for change in done.taken]
    lines += [f"broken by the merge: {message}" for message in done.broken]
    return lines or ["B changed nothing that A has not"]
