"""`wallkit model evaluate`: how well does a model find each class, pixel by pixel?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.model.evaluate import Judged


@click.command("evaluate")
@click.argument("model", type=click.Path(path_type=Path), metavar="MODEL.onnx")
@click.argument("dataset", type=click.Path(path_type=Path), metavar="DATASET")
@click.option(
    "--split", type=click.Choice(["val", "train", "all"]), default="val", show_default=True, help="Which part."
)
@click.option("--sheet", type=click.Path(path_type=Path), metavar="PNG", help="Some pictures with labels and masks.")
@click.option(
    "--require",
    "required",
    multiple=True,
    metavar="CLASS=IOU",
    help="Exit 1 if a class is found less well (repeatable).",
)
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@click.pass_context
def evaluate(
    ctx: click.Context,
    model: Path,
    dataset: Path,
    split: str,
    sheet: Path | None,
    required: tuple[str, ...],
    overwrite: bool,
    config_path: Path | None,
    words: tuple[str, ...],
    as_json: bool,
    quiet: bool,
) -> None:
    """Compare a model's classes with the labels of a training set: intersection over union, pooled over all pixels.

    Classes go by their names, else by what they count as, so that models with other words can be judged too. "default" is
    the model inside the package.

    \b
    Examples:
      wallkit model evaluate default rooms
      wallkit model evaluate best.onnx rooms --split all --sheet masks.png
      wallkit model evaluate default rooms --require "wall + partition=0.85" --require person=0.6
    """
    from wallkit.dataset.read import read_training_set
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.model.evaluate import evaluate_model, minimum_of
    from wallkit.pipelines.outputs import check_file_out

    if sheet is not None:
        check_file_out(sheet, overwrite=overwrite)
    least = dict(minimum_of(text) for text in required)
    settings = load_config(config_path, words).config.segment
    sets = (read_training_set(dataset),)
    with common.progress("pictures", None, quiet=quiet) as update:
        judged = evaluate_model(model, sets, split, settings, sheet=sheet, progress=update)
    short = judged.short_of(least)
    if as_json:
        common.emit({"model": model, "dataset": dataset, "split": split, **judged.document, "short": short})
    else:
        click.echo("\n".join(evaluation_text(judged)))
        for name, (iou, wanted) in short.items():
            click.echo(f"short    {name} {iou:.3f}, wanted {wanted:.3f}")
    if judged.without:
        common.warn(f"the model knows no {', '.join(judged.without)}", quiet=quiet)
    ctx.exit(common.FAILED_CHECK if short else common.OK)


def evaluation_text(judged: Judged) -> list[str]:
    """What a person reads."""
    document = judged.document
    rows = []
    for score in judged.scores:
        mistaken = document["classes"][score.name]["mistaken"]
        worst = f"{mistaken['as']} {100 * mistaken['share']:.0f} %" if mistaken else ""
        numbers = [f"{value:.3f}" for value in (score.iou, score.precision, score.recall)]
        rows.append([score.name, *numbers, f"{score.pixels}", worst])
    text = common.table(["class", "IoU", "precision", "recall", "pixels", "most taken for"], rows, right=(1, 2, 3, 4))
    accuracy, mean = document["pixel_accuracy"], document["mean_iou"]
    total, network = judged.ms
    return [
        f"pictures {judged.pictures}; right {100 * accuracy:.1f} % of pixels; mean IoU {mean:.3f}",
        f"time     {total:.1f} ms a picture, {network:.1f} of it the network (processor time, median)",
        *text.splitlines(),
    ]
