"""`wallkit simulate dataset`: pictures with labels, of buildings nobody built."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.dataset.classes import LabelSet


@click.command("dataset")
@click.option("--images", type=int, default=3000, show_default=True, metavar="N", help="Pictures to make.")
@click.option(
    "--map",
    "maps",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="MAP",
    help="In these, in turn; else in random ones.",
)
@click.option(
    "--size", default="640x480", show_default=True, callback=common.pixel_size, metavar="WxH", help="Of a picture [px]."
)
@click.option("--per-scene", type=int, default=12, show_default=True, metavar="N", help="Pictures in one scene.")
@click.option(
    "--val", type=common.Number(), default=0.2, show_default=True, metavar="SHARE", help="Of scenes, for validation."
)
@click.option(
    "--classes", type=click.Path(path_type=Path), metavar="TOML", help="What counts as what; else 12 usual classes."
)
@click.option("--exact-masks", "exact", is_flag=True, help="Masks by cast rays: right to the pixel, slower.")
@click.option("--jobs", type=int, default=1, show_default=True, metavar="J", help="Processes at once.")
@common.seed_option
@common.out_option
@common.overwrite_option
@common.dry_run_option
@common.json_option
@common.quiet_option
def dataset(
    images: int,
    maps: tuple[Path, ...],
    size: tuple[int, int],
    per_scene: int,
    val: float,
    classes: Path | None,
    exact: bool,
    jobs: int,
    seed: int,
    out: Path | None,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make a training set: pictures of rooms, restrooms and corridors with YOLO-seg, COCO and PNG labels.

    Every scene has its own building, looks, light, lens and people, drawn from the seed: the same seed gives the same
    labels. Training and validation never share a scene. Stopped with Ctrl-C, it goes on when started again.

    \b
    Examples:
      wallkit simulate dataset --images 3000 --jobs 2 -o rooms
      wallkit simulate dataset --images 600 --map floor2.wkmap.urdf --seed 7 -o floor2
      wallkit simulate dataset --images 12 --size 320x240 -o look && xdg-open look/contact-sheet.png
    """
    from wallkit.dataset.classes import read_label_set
    from wallkit.pipelines.outputs import check_out
    from wallkit.pipelines.simulate.dataset import DatasetRequest, check_request, simulate_dataset

    labels = read_label_set(classes)
    out = out or Path(f"dataset-{seed}")
    request = DatasetRequest(images, seed, maps, size, per_scene, val, exact, labels)
    if dry_run:
        check_out(out, overwrite=overwrite)
        check_request(request)
        click.echo(f"would write {out}: {images} pictures of {request.scenes} scenes")
        return
    with common.progress("pictures", images, quiet=quiet) as update:
        made = simulate_dataset(request, out, jobs=jobs, overwrite=overwrite, progress=update)
    if as_json:
        document = {"out": out, "seed": seed, "images": made.images, "scenes": made.scenes, "resumed": made.resumed}
        common.emit({**document, "statistics": made.statistics})
    else:
        resumed = f" ({made.resumed} were there already)" if made.resumed else ""
        click.echo(f"pictures {made.images} of {made.scenes} scenes{resumed}")
        click.echo("\n".join(statistics_text(made.statistics, labels)))
        click.echo(f"train    yolo segment train data={out / 'data.yaml'}")
        click.echo(f"look at  {out / 'contact-sheet.png'}")


def statistics_text(statistics: dict, labels: LabelSet) -> list[str]:  # type: ignore[type-arg]
    """Lines on how often each class is there."""
    from wallkit.dataset.documents import statistics_lines

    counts = [f"{statistics[split]['images']} {split} ({statistics[split]['groups']})" for split in ("train", "val")]
    rows = statistics_lines(statistics, labels)
    text = common.table(["class", "pictures", "pixels", "things"], rows, right=(1, 2, 3))
    return [f"split    {', '.join(counts)}", *text.splitlines()]
