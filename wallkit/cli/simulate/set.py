"""`wallkit simulate set`: many logs from one folder of scenarios."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.simulate.set import BuiltSet


@click.command("set")
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False), metavar="FOLDER")
@click.option("--only", multiple=True, metavar="PATTERN", help="Logs whose names fit, as 'restroom-4-*' (repeatable).")
@click.option("--no-pictures", "without", is_flag=True, help="Leave the cameras out; all else stays the same.")
@click.option("--freeze", "as_freeze", is_flag=True, help="Store the hashes of what is there in FOLDER/hashes.json.")
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Logs recorded at once.")
@common.out_option
@common.dry_run_option
@common.json_option
@common.quiet_option
def simulate_set_command(
    folder: Path,
    only: tuple[str, ...],
    without: bool,
    as_freeze: bool,
    jobs: int,
    out: Path | None,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Record every scene of FOLDER/set.toml at every crowd level with every seed, each log as `simulate log` would.

    A log's name is SCENE-PEOPLE-SEED. Stopped with Ctrl-C, it goes on when started again: logs that are there, of the same
    scenario and versions, are kept. FOLDER/hashes.json says which scans and poses everybody should get.

    Exits 0 also when they differ from hashes.json, as they may with other versions; it says so.

    \b
    Examples:
      wallkit simulate set evaluation --dry-run
      wallkit simulate set evaluation --only 'restroom-*-1' -o set
      wallkit simulate set evaluation --no-pictures --jobs 2 -o scans
    """
    from wallkit.pipelines.simulate.set import SetRequest, freeze, is_made, requests_of, simulate_set

    request = SetRequest(folder, only, pictures=not without)
    out = out or Path(f"{folder.resolve().name}-logs")
    if dry_run:
        for name, one in requests_of(request).items():
            click.echo(f"{'is there' if is_made(out / name, one) else 'would record'}  {out / name}")
        return
    total = len(requests_of(request))
    with common.progress("logs", total, quiet=quiet) as update:
        built = simulate_set(request, out, jobs=jobs, observe=lambda done, _: update(done))
    if as_freeze:
        freeze(folder, built)
    if as_json:
        common.emit({"out": out, **_document(built)})
        return
    click.echo("\n".join(_lines(out, built)))
    if built.differ and not as_freeze:
        first = ", ".join(built.differ[:3])
        common.warn(
            f"{len(built.differ)} logs have other scans or poses than {folder / 'hashes.json'}: {first}", quiet=quiet
        )


def _document(built: BuiltSet) -> dict[str, Any]:
    from dataclasses import asdict

    return {**asdict(built), "bytes": built.size_bytes}


def _lines(out: Path, built: BuiltSet) -> list[str]:
    rows = [
        [row["name"], f"{row['duration_s']:.0f}", f"{row['path_m']:.0f}", f"{100 * row['unmapped_share']:.1f}",
         f"{row['bytes'] / 1e6:.1f}", ", ".join(row["cameras"]) or "-"]
        for row in built.logs
    ]  # fmt: skip
    headers = ["log", "s", "m", "not on the map [%]", "MB", "cameras"]
    same = len(built.logs) - len(built.differ) - len(built.unknown)
    return [
        common.table(headers, rows, right=(1, 2, 3, 4)),
        f"recorded {len(built.made)}, kept {len(built.kept)}: {built.size_bytes / 1e6:.0f} MB in {out}",
        f"hashes   {same} of {len(built.logs)} have the scans and poses of hashes.json",
    ]
