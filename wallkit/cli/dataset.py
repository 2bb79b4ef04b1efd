"""`wallkit dataset`: recordings as training sets."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common


@click.group()
def dataset() -> None:
    """Make training sets of recordings."""


@dataset.command("from-log")
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")
@click.option(
    "--image", "image_topics", multiple=True, metavar="TOPIC", help="Only this camera (repeatable); else all of them."
)
@click.option(
    "--run",
    "runs",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Poses of a run; one for each log.",
)
@click.option("--review", is_flag=True, help="Only look: a contact sheet, and a list of what to drop.")
@click.option("--drops", type=click.Path(path_type=Path), metavar="CSV", help="Leave out what this list says.")
@click.option("--denoise", is_flag=True, help="Filter grain out of every picture.")
@click.option(
    "--augment",
    type=click.IntRange(0, 20),
    default=0,
    metavar="N",
    help="Add N variants of each training picture, beside.",
)
@click.option(
    "--val", type=common.Number(), default=0.2, show_default=True, metavar="SHARE", help="Of logs, for validation."
)
@click.option("--classes", type=click.Path(path_type=Path), metavar="TOML", help="What counts as what.")
@common.seed_option
@common.out_option
@common.overwrite_option
@common.json_option
@common.quiet_option
def from_log(
    logs: tuple[Path, ...],
    image_topics: tuple[str, ...],
    runs: tuple[Path, ...],
    review: bool,
    drops: Path | None,
    denoise: bool,
    augment: int,
    val: float,
    classes: Path | None,
    seed: int,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make one dataset of the pictures in logs, with the nearest scans, poses and cameras; simulated logs bring labels.

    Blurred and repeated pictures are proposed in drops.csv; nothing is left out before --drops names the list.

    \b
    Examples:
      wallkit dataset from-log run1/log.mcap run2/log.mcap --review -o look
      wallkit dataset from-log run1/log.mcap run2/log.mcap --drops look/drops.csv --augment 2 -o set
    """
    from dataclasses import asdict

    from wallkit.dataset.classes import read_label_set
    from wallkit.pipelines.dataset.from_log import FromLogs, dataset_from_logs

    labels = read_label_set(classes)
    out = out or Path("dataset")
    request = FromLogs(logs, image_topics, runs, drops, review, denoise, augment, val, seed, labels)
    with common.progress("pictures", None, quiet=quiet) as update:
        done = dataset_from_logs(request, out, overwrite=overwrite, progress=update)
    if as_json:
        common.emit({"out": out, **asdict(done)})
        return
    counted = {
        what: ", ".join(f"{n} {why}" for why, n in of.items()) or "nothing"
        for what, of in (("proposed", done.proposed), ("dropped", done.dropped), ("lost", done.lost))
    }
    click.echo(f"seen     {done.seen} pictures of {len(logs)} logs")
    click.echo(f"proposed {counted['proposed']} to be dropped: {out / 'drops.csv'}, shown in {out / 'review.png'}")
    click.echo(f"lost     {counted['lost']}")
    if review:
        click.echo(f"next     edit the list, then: wallkit dataset from-log ... --drops {out / 'drops.csv'} -o set")
        return
    click.echo(f"dropped  {counted['dropped']}")
    has = f"{done.labelled} with labels, {done.posed} with a pose; {done.augmented} augmented"
    click.echo(f"written  {done.written} pictures, {has}")
    if 0 < done.labelled < done.written:
        missing = done.written - done.labelled
        common.warn(f"{missing} pictures have no labels, and YOLO takes them for empty: make two sets", quiet=quiet)
    if len(logs) == 1 and val > 0:
        common.warn("one log cannot be split: there is nothing to validate on", quiet=quiet)
