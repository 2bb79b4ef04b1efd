"""`wallkit model train`: a segmentation model of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

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
@click.option("--rate", type=common.Number(0, 1, min_open=True), metavar="X", help="Highest learning rate; else 0.003.")
@click.option("--threads", type=click.IntRange(1, 256), default=1, show_default=True, help="Of PyTorch: free cores.")
@click.option("--yolo", metavar="MODEL", help="YOLO-seg instead: yolov8n-seg.yaml, or a checkpoint to go on from.")
@click.option(
    "--python",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="For --yolo: interpreter with Ultralytics; else WALLKIT_YOLO_PYTHON, or yolo's.",
)
@click.option("--trust", is_flag=True, help="For --yolo: load all that the checkpoint holds; it may run anything.")
@common.seed_option
@common.out_option
@common.overwrite_option
@common.dry_run_option
@common.json_option
@common.quiet_option
def train(datasets: tuple[Path, ...], **flags: Any) -> None:
    """Train a segmentation model on training sets: wallkit's own network, from nothing, by PyTorch.

    Writes model.onnx, losses and overlaps by epoch (curves.csv, curves.png), scores.json and masks.png. Stopped with
    Ctrl-C, it goes on when started again. Needs pip install 'wallkit[train]'; a GPU is used if there is one.

    With --yolo, Ultralytics trains YOLO-seg in another interpreter, at a rate of its own choice, and loads only weights
    from a checkpoint unless --trust; its models are under AGPL-3.0.

    \b
    Examples:
      wallkit simulate dataset --images 3000 --size 320x240 -o rooms && wallkit model train rooms -o net
      wallkit model train rooms more-rooms --epochs 60 --threads 2 -o net
      wallkit model train rooms --yolo yolov8n-seg.yaml --python yv/bin/python -o yolo
    """
    out = flags["out"] or Path("model")
    _check_flags(flags)
    if flags["yolo"]:
        _yolo(datasets, out, flags)
    else:
        _own(datasets, out, flags)


# ------------------------------------------------------------------------------------------------ details


def _check_flags(flags: dict[str, Any]) -> None:
    """Refuse what the chosen way of training would not heed."""
    if flags["yolo"] and flags["rate"] is not None:
        raise click.UsageError("--rate is of wallkit's own network: with --yolo, Ultralytics chooses it; leave it out")
    if not flags["yolo"] and (flags["python"] or flags["trust"]):
        given = "--python" if flags["python"] else "--trust"
        raise click.UsageError(f"{given} is for --yolo: name a model or checkpoint with --yolo, or leave it out")


def _own(datasets: tuple[Path, ...], out: Path, flags: dict[str, Any]) -> None:
    """wallkit's own network, by PyTorch."""
    from wallkit.cli.model.evaluate import evaluation_text
    from wallkit.dataset.read import pairs_of
    from wallkit.pipelines.model.train import TrainRequest, check_request, train_model

    numbers = {name: flags[name] for name in ("size", "epochs", "batch", "rate", "threads", "seed")}
    request = TrainRequest(datasets, **numbers)
    if flags["dry_run"]:
        sets = check_request(request, out, overwrite=flags["overwrite"])
        train_count, val_count = (len(pairs_of(sets, split)) for split in ("train", "val"))
        click.echo(f"would write {out}: trained on {train_count} pictures, judged on {val_count} others")
        return

    def told(epoch: Epoch, epochs: int) -> None:
        if not flags["quiet"]:
            losses = f"loss {epoch.train_loss:.3f}, validation {epoch.val_loss:.3f}"
            click.echo(f"epoch {epoch.number} of {epochs}: {losses}, mean IoU {epoch.mean_iou:.3f}", err=True)

    done = train_model(request, out, overwrite=flags["overwrite"], told=told)
    if flags["as_json"]:
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


def _yolo(datasets: tuple[Path, ...], out: Path, flags: dict[str, Any]) -> None:
    """YOLO-seg, by Ultralytics."""
    from wallkit.pipelines.model.train_yolo import YoloRequest, check_yolo, train_yolo_model

    numbers = {name: flags[name] for name in ("size", "epochs", "batch", "threads", "seed")}
    request = YoloRequest(datasets, flags["python"], flags["yolo"], **numbers, is_trusting=flags["trust"])
    if flags["dry_run"]:
        interpreter, _ = check_yolo(request, out, overwrite=flags["overwrite"])
        click.echo(f"would write {out}: {request.start} trained by {interpreter.python}")
        return

    def told(line: str) -> None:
        if not flags["quiet"]:
            click.echo(line, err=True)

    done = train_yolo_model(request, out, overwrite=flags["overwrite"], told=told)
    if flags["as_json"]:
        common.emit({"model": done.model, "epochs": len(done.epochs), "licence": "AGPL-3.0"})
        return
    click.echo(f"model    {done.model} (AGPL-3.0), {done.model.with_suffix('.pt')}")
    click.echo(f"epochs   {len(done.epochs)}: {out / 'curves.png'}, {out / 'curves.csv'}")
    click.echo(f"judge    wallkit model evaluate {done.model} {datasets[0]}")
