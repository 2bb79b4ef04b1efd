"""`wallkit model train`: a segmentation model of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.train.curves import Epoch


@click.command("train")
@click.argument("datasets", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DATASET...")
@click.option(
    "--size", default="256x192", show_default=True, callback=common.pixel_size, metavar="WxH", help="Of its input [px]."
)
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Passes; else 30 (YOLO: 50).")
@click.option("--batch", type=click.IntRange(1), metavar="N", help="Pictures in a step; else 8 (YOLO: 16).")
@click.option("--rate", type=float, metavar="X", help="Highest learning rate; else 0.003.")
@click.option("--threads", type=click.IntRange(1, 256), default=1, show_default=True, help="Of PyTorch: free cores.")
@click.option("--yolo", metavar="MODEL", help="YOLO-seg instead: yolov8n-seg.yaml, or a checkpoint to go on from.")
@click.option("--python", "python", metavar="FILE", help="The interpreter that has Ultralytics, for --yolo.")
@common.seed_option
@common.out_option
@common.overwrite_option
@common.dry_run_option
@common.json_option
@common.quiet_option
def train(
    datasets: tuple[Path, ...],
    size: tuple[int, int],
    epochs: int | None,
    batch: int | None,
    rate: float | None,
    threads: int,
    yolo: str | None,
    python: str | None,
    seed: int,
    out: Path | None,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Train a segmentation model on training sets: wallkit's own network, from nothing, by PyTorch.

    Writes model.onnx, losses and overlaps by epoch (curves.csv, curves.png), scores.json and masks.png. Stopped with
    Ctrl-C, it goes on when started again. Needs pip install 'wallkit[train]'; a GPU is used if there is one.

    With --yolo, Ultralytics trains YOLO-seg in another interpreter; its models are under AGPL-3.0.

    \b
    Examples:
      wallkit simulate dataset --images 3000 --size 320x240 -o rooms && wallkit model train rooms -o net
      wallkit model train rooms more-rooms --epochs 60 --threads 2 -o net
      wallkit model train rooms --yolo yolov8n-seg.yaml --python yv/bin/python -o yolo
    """
    out = out or Path("model")
    if yolo:
        _yolo(datasets, size, epochs, batch, threads, yolo, python, seed, out, overwrite, dry_run, as_json, quiet)
        return
    from wallkit.cli.model.evaluate import evaluation_text
    from wallkit.pipelines.model.train import TrainRequest, check_request, train_model

    request = TrainRequest(datasets, size, epochs, batch, rate, threads, seed)
    if dry_run:
        sets = check_request(request, out, overwrite=overwrite)
        train_count, val_count = (sum(len(one.of(split)) for one in sets) for split in ("train", "val"))
        click.echo(f"would write {out}: trained on {train_count} pictures, judged on {val_count} others")
        return

    def told(epoch: Epoch, epochs: int) -> None:
        if not quiet:
            losses = f"loss {epoch.train_loss:.3f}, validation {epoch.val_loss:.3f}"
            click.echo(f"epoch {epoch.number} of {epochs}: {losses}, mean IoU {epoch.mean_iou:.3f}", err=True)

    done = train_model(request, out, overwrite=overwrite, told=told)
    if as_json:
        common.emit(
            {
                "model": done.model,
                "epochs": len(done.epochs),
                "resumed": done.resumed,
                "parameters": done.parameters,
                "size_bytes": done.size_bytes,
                "validation": done.judged.document,
            }
        )
        return
    resumed = f" ({done.resumed} had been done)" if done.resumed else ""
    click.echo(f"model    {done.model}: {done.size_bytes / 1e6:.1f} MB, {done.parameters / 1e6:.2f} M parameters")
    click.echo(f"epochs   {len(done.epochs)}{resumed}: {out / 'curves.png'}, {out / 'curves.csv'}")
    click.echo("\n".join(evaluation_text(done.judged)))
    click.echo(f"look at  {out / 'masks.png'}")


def _yolo(
    datasets: tuple[Path, ...],
    size: tuple[int, int],
    epochs: int | None,
    batch: int | None,
    threads: int,
    start: str,
    python: str | None,
    seed: int,
    out: Path,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    from wallkit.pipelines.model.train_yolo import YoloRequest, check_yolo, train_yolo_model

    request = YoloRequest(datasets, python or "", start, size, epochs, batch, threads, seed)
    if dry_run:
        check_yolo(request, out, overwrite=overwrite)
        click.echo(f"would write {out}: {start} trained by {python}")
        return
    done = train_yolo_model(
        request, out, overwrite=overwrite, told=lambda line: None if quiet else click.echo(line, err=True)
    )
    if as_json:
        common.emit({"model": done.model, "epochs": len(done.epochs), "licence": "AGPL-3.0"})
        return
    click.echo(f"model    {done.model} (AGPL-3.0), {done.model.with_suffix('.pt')}")
    click.echo(f"epochs   {len(done.epochs)}: {out / 'curves.png'}, {out / 'curves.csv'}")
    click.echo(f"judge    wallkit model evaluate {done.model} {datasets[0]}")
