"""`wallkit bench`: how fast it is here."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common
from wallkit.cli.bench.boards import boards
from wallkit.cli.bench.ceiling import ceiling
from wallkit.cli.bench.covariance import covariance
from wallkit.cli.bench.points import bench_filter, polygons


@click.group()
def bench() -> None:
    """Measure speed and honesty; results belong in docs/benchmarks with the command that made them."""


bench.add_command(boards)
bench.add_command(covariance)
bench.add_command(ceiling)
bench.add_command(polygons)
bench.add_command(bench_filter)


def _sizes(_: click.Context, __: click.Parameter, value: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in value.split(","))
    except ValueError as error:
        raise click.BadParameter("whole numbers with commas between, for example 500,2000") from error


@bench.command()
@click.option("--particles", default="500,2000,10000", show_default=True, callback=_sizes, help="Numbers of particles.")
@click.option("--beams", default="60,180,360", show_default=True, callback=_sizes, help="Numbers of beams.")
@click.option("--cells", default="400,1000", show_default=True, callback=_sizes, help="Sides of the map in cells.")
@click.option("--threads", default="1,2", show_default=True, callback=_sizes, help="Numbers of threads.")
@click.option(
    "--numpy", "numpy_oracle", is_flag=True, help="Also time the same formula in plain NumPy, in the same rounds."
)
@common.json_option
def update(
    particles: tuple[int, ...],
    beams: tuple[int, ...],
    cells: tuple[int, ...],
    threads: tuple[int, ...],
    numpy_oracle: bool,
    as_json: bool,
) -> None:
    """Time predict, reweight and resample of one filter update.

    \b
    Examples:
      wallkit bench update
      wallkit bench update --particles 10000 --beams 360 --threads 1 --numpy
    """
    from dataclasses import asdict

    from wallkit.pipelines.bench.update import time_updates
    from wallkit.pipelines.run_folder import machine

    rows = []
    headers = [
        "sensor",
        "particles",
        "beams",
        "cells",
        "threads",
        "predict",
        "reweight",
        "resample",
        "total ms",
        "ns/lookup",
        "x NumPy",
        "spread",
    ]
    for row in time_updates(particles, beams, cells, threads, numpy_oracle=numpy_oracle):
        rows.append(row)
        click.echo(f"{row.sensor} {row.particles} x {row.beams}, {row.cells} cells, {row.threads} threads", err=True)
    if as_json:
        common.emit({"machine": machine(), "rows": [asdict(row) for row in rows]})
        return
    cells_of = [
        [
            row.sensor,
            *(str(v) for v in (row.particles, row.beams, row.cells, row.threads)),
            *(f"{v:.3f}" for v in (row.predict_ms, row.reweight_ms, row.resample_ms, row.total_ms, row.ns_per_lookup)),
            "-" if row.numpy_ratio is None else f"{row.numpy_ratio:.1f}",
            f"{row.spread:.2f}",
        ]
        for row in rows
    ]
    click.echo(common.table(headers, cells_of, right=tuple(range(1, len(headers)))))


@bench.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--map", "map_path", type=click.Path(path_type=Path), metavar="FILE", help="Map of the log.")
@click.option("--init", metavar="WHERE", help="As for wallkit localize.")
@common.json_option
def pipeline(log: Path, map_path: Path | None, init: str | None, as_json: bool) -> None:
    """Split a whole run into opening, reading, filtering, writing and drawing. Run it twice: the first one compiles.

    \b
    Examples:
      wallkit bench pipeline log.mcap --map floor.yaml --init truth
    """
    from wallkit.pipelines.bench.update import time_pipeline
    from wallkit.pipelines.run_folder import machine

    seconds = time_pipeline(log, map_path, init)
    if as_json:
        common.emit({"machine": machine(), "seconds": seconds})
        return
    rows = [[phase, f"{value:.3f}"] for phase, value in seconds.items() if phase not in ("scans", "peak_memory_mb")]
    click.echo(common.table(["phase", "seconds"], rows, right=(1,)))
    click.echo(f"{seconds['scans']:.0f} scans, {seconds['peak_memory_mb']:.0f} MB at most")
