"""`wallkit model bench`: is the model fast enough here?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.model.words import sizes_from_words

if TYPE_CHECKING:
    from wallkit.pipelines.model.bench import ModelTime

FILE = click.Path(path_type=Path)


def _numbers(_: click.Context, __: click.Parameter, value: str) -> tuple[int, ...]:
    try:
        found = tuple(int(part) for part in value.split(","))
    except ValueError:
        found = ()
    if not found or min(found) < 1:
        raise click.BadParameter("whole numbers with commas between, for example 1,2")
    return found


def _switches(_: click.Context, __: click.Parameter, value: str) -> tuple[bool, ...]:
    words = value.lower().split(",")
    if not all(word in ("on", "off") for word in words):
        raise click.BadParameter("on, off, or off,on")
    return tuple(word == "on" for word in words)


@click.command()
@click.argument("models", nargs=-1, required=True, type=FILE, metavar="MODEL.onnx...")
@click.option(
    "--images", multiple=True, type=FILE, metavar="FOLDER|LOG", help="Pictures; else one of noise, 1280 x 720."
)
@click.option("--sizes", default="", callback=sizes_from_words, metavar="HxW,...", help="Of models that leave it open.")
@click.option("--threads", default="1", show_default=True, callback=_numbers, help="Numbers of threads.")
@click.option(
    "--spin", default="off", show_default=True, callback=_switches, help="Threads wait busily: off, on, or both."
)
@click.option(
    "--rate", "rate_hz", type=common.Number(0.01), default=10, show_default=True, help="Images per second [Hz]."
)
@click.option("--rounds", type=click.IntRange(1), default=30, show_default=True, help="Images timed for each row.")
@click.option("--points", type=click.IntRange(1), default=720, show_default=True, help="LiDAR points labelled in each.")
@common.config_option
@common.set_option
@common.json_option
@common.quiet_option
@click.pass_context
def bench(ctx: click.Context, /, models: tuple[Path, ...], **flags: Any) -> None:
    """Time a model stage by stage, from an image to labelled LiDAR points, against the time between two images.

    CPU time hardly changes with what else runs, wall time does: the load of the machine stands beside both. Decoding the
    picture is not in the totals. Exits 0 if every row is done before the next image, 1 if one is not, 4 if one would
    be on an idle machine and this one is busy.

    \b
    Examples:
      wallkit model bench best.onnx --images log.mcap
      wallkit model bench best.onnx int8.onnx --images pictures/ --threads 1,2 --spin off,on --rate 15
      wallkit model bench dynamic.onnx --sizes 192x320,320,640
    """
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.model.bench import Plan, time_model

    settings = load_config(flags["config_path"], flags["words"]).config.segment
    plan = Plan(flags["sizes"], flags["threads"], flags["spin"], flags["rounds"], flags["points"])
    pictures = _pictures(flags["images"])
    rows: list[ModelTime] = []
    for model in models:
        for row in time_model(model, pictures, settings, plan):
            rows.append(row)
            if not flags["quiet"]:
                click.echo(f"{row.model} {_size(row)}, {_threads(row)}: {row.total_wall:.1f} ms", err=True)
    budget_ms = 1e3 / flags["rate_hz"]
    if flags["as_json"]:
        _emit(rows, budget_ms)
    else:
        click.echo("\n".join(_page(rows, budget_ms, flags["rate_hz"])))
    ctx.exit(max(_VERDICTS[_verdict(row, budget_ms)] for row in rows))


# ------------------------------------------------------------------------------------------------ details


def _pictures(places: tuple[Path, ...]) -> list[Any]:
    import numpy as np

    from wallkit.pipelines.model.pictures import Picture, PictureSource, pictures_of

    if places:
        return pictures_of(PictureSource(places, count=12))
    return [Picture("noise", np.random.default_rng(0).integers(0, 256, size=(720, 1280, 3), dtype=np.uint8))]


def _page(rows: list[ModelTime], budget_ms: float, rate_hz: float) -> list[str]:
    headers = ["model", "size", "threads", "spin", *_HEADERS, "beside CPU", "total CPU", "total wall", "p95", "load"]
    table = common.table(headers, [_cells(row) for row in rows], right=tuple(range(2, len(headers))))
    lines = [
        *table.splitlines(),
        "",
        "ms, medians; stages as CPU time. beside: prepare + read + points, all but the network.",
    ]
    for row in rows:
        spent = f"{row.total_wall / budget_ms:.0%} of the {budget_ms:.3g} ms between images at {rate_hz:g} Hz"
        lines.append(f"{_verdict(row, budget_ms)}: {row.model} {_size(row)}, {_threads(row)}: {spent}")
    if any(_is_busy(row) for row in rows):
        lines.append("the machine is busy: trust the CPU columns, not the wall time")
    return lines


_VERDICTS = {"fits": common.OK, "too slow": common.FAILED_CHECK, "cannot tell": common.CANNOT_TELL}


def _verdict(row: ModelTime, budget_ms: float) -> str:
    if row.total_wall <= budget_ms:
        return "fits"
    return "cannot tell" if _is_busy(row) and row.total_cpu <= budget_ms else "too slow"


def _is_busy(row: ModelTime) -> bool:
    """Whether others want the cores that the row needs."""
    import os

    return row.load + row.threads > (os.cpu_count() or 1) + 0.5


def _threads(row: ModelTime) -> str:
    spinning = ", spinning" if row.is_spinning else ""
    return "1 thread" if row.threads == 1 else f"{row.threads} threads{spinning}"


_HEADERS = ("decode", "prepare", "network", "read", "points")


def _cells(row: ModelTime) -> list[str]:
    stages = ["-" if row.cpu[s] != row.cpu[s] else f"{row.cpu[s]:.2f}" for s in _HEADERS]
    totals = (row.beside_cpu, row.total_cpu, row.total_wall, row.total_wall_p95, row.load)
    spin = "on" if row.is_spinning else "off"
    return [row.model, _size(row), str(row.threads), spin, *stages, *(f"{value:.2f}" for value in totals)]


def _size(row: ModelTime) -> str:
    return f"{row.size[0]}x{row.size[1]}"


def _emit(rows: list[ModelTime], budget_ms: float) -> None:
    from wallkit.evaluate.resources import peak_memory_mb
    from wallkit.pipelines.run_folder import machine

    common.emit(
        {
            "machine": machine(),
            "budget_ms": budget_ms,
            "peak_memory_mb": peak_memory_mb(),
            "rows": [
                {
                    "model": row.model,
                    "input_size_px": list(row.size),
                    "threads": row.threads,
                    "spinning": row.is_spinning,
                    "cpu_ms": row.cpu,
                    "wall_ms": row.wall,
                    "beside_cpu_ms": row.beside_cpu,
                    "total_cpu_ms": row.total_cpu,
                    "total_wall_ms": row.total_wall,
                    "total_wall_p95_ms": row.total_wall_p95,
                    "load": row.load,
                    "verdict": _verdict(row, budget_ms),
                }
                for row in rows
            ],
        }
    )
