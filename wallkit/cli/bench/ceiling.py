"""`wallkit bench ceiling`: what the ceiling's models are worth, and what they cost."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.bench.ceiling import Row


@click.command()
@click.argument("runs", nargs=-1, type=click.Path(path_type=Path), metavar="[LOG_FOLDER]...")
@click.option(
    "--seeds", type=click.IntRange(1, 1000), default=20, show_default=True, help="Runs of each configuration."
)
@click.option(
    "--models", default="seed,centre,histogram,gradient,patch", show_default=True, help="With commas between."
)
@click.option("--resamplers", default="own", show_default=True, help="own, or names with commas between.")
@click.option("--inits", default="everywhere", show_default=True, help="everywhere, global, with commas between.")
@click.option("--kidnapped", is_flag=True, help="The middle third of every log is cut out.")
@click.option(
    "--ceiling", type=click.Path(path_type=Path), metavar="FILE", help="Of all logs; else the one in each folder."
)
@click.option("--end", "end_s", type=common.Number(min=20), metavar="S", help="Only so many seconds of every log.")
@click.option(
    "--rows",
    type=click.Path(path_type=Path),
    metavar="FILE.csv",
    help="Adds the rows; those found there are not run again.",
)
@click.option(
    "--tracks",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="CSV and PNG of each new row: the path, and how many of its runs were near where.",
)
@click.option(
    "--picture", type=click.Path(path_type=Path), metavar="FILE.png", help="How many converged, by world and model."
)
@common.json_option
def ceiling(
    runs: tuple[Path, ...],
    seeds: int,
    models: str,
    resamplers: str,
    inits: str,
    kidnapped: bool,
    ceiling: Path | None,
    end_s: float | None,
    rows: Path | None,
    tracks: Path | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Run the ceiling's models on folders of `wallkit simulate log`; without folders time one update of each model.

    With --rows alone it prints the file's rows.

    Times are CPU time. A run is near within 0.5 m and 10 degrees, has come once it was near for a second, and has
    converged if it is near for the last ten seconds or more.

    \b
    Examples:
      wallkit bench ceiling
      wallkit bench ceiling unique/ painted/ --seeds 20 --rows study.csv
      wallkit bench ceiling unique/ --models patch --resamplers wheel,systematic --inits everywhere,global
      wallkit bench ceiling --rows study.csv --picture study.png
    """
    from dataclasses import asdict

    from wallkit.pipelines.run_folder import machine

    if not runs and rows is None:
        _cost(as_json)
        return
    asked = [models.split(","), resamplers.split(","), inits.split(",")]
    found = _study(runs, asked, "kidnapped" if kidnapped else "drive", end_s, seeds, ceiling, rows, tracks)
    if picture is not None:
        from wallkit.pipelines.bench.ceiling_picture import bars_picture
        from wallkit.pipelines.outputs import write_whole

        write_whole(picture, bars_picture(found))
    if as_json:
        common.emit({"machine": machine(), "rows": [asdict(row) for row in found]})
        return
    headers = [
        "world",
        "log",
        "model",
        "resampler",
        "start",
        "came",
        "after",
        "converged",
        "after",
        "error m",
        "deg",
        "near",
    ]
    cells = [
        [
            row.world, row.story + ("" if row.end_s is None else f" {row.end_s:g} s"), row.model, row.resampler, row.init,
            f"{row.came}/{row.seeds}", f"{row.first:.0f}",
            f"{row.converged}/{row.seeds}", f"{row.updates:.0f}", f"{row.error_m:.3f}", f"{row.error_deg:.2f}",
            f"{row.share_near:.0%}", f"{row.back}/{row.lost}", f"{row.back_updates:.0f}", f"{row.ms_per_update:.2f}",
        ]
        for row in found
    ]  # fmt: skip
    click.echo(common.table([*headers, "found again", "after", "ms/update"], cells, right=tuple(range(5, 15))))


def _study(
    runs: tuple[Path, ...],
    asked: list[list[str]],
    story: str,
    end_s: float | None,
    seeds: int,
    ceiling: Path | None,
    rows: Path | None,
    tracks: Path | None,
) -> list[Row]:
    """The rows that were asked for, run or found in the file."""
    from itertools import product

    import numpy as np

    from wallkit.pipelines.bench.ceiling import MODELS, Task, kidnapped, read_world, study
    from wallkit.pipelines.bench.ceiling_picture import places_picture
    from wallkit.pipelines.bench.ceiling_rows import read_rows, task_of, write_rows, write_track
    from wallkit.pipelines.outputs import write_whole

    unknown = [name for name in asked[0] if name not in MODELS]
    if unknown:
        raise click.UsageError(f"no model is called '{unknown[0]}': {', '.join(MODELS)}")
    kept: dict[Task, Row] = {} if rows is None else {task_of(row): row for row in read_rows(rows)}
    found = [] if runs else list(kept.values())
    for folder in runs:
        tasks = [
            Task(folder.name, model, resampler, init, story, end_s, seeds) for model, resampler, init in product(*asked)
        ]
        left = [task for task in tasks if task not in kept]
        if left:
            world = read_world(folder, asked[0], ceiling=ceiling, end_s=end_s)
            for row, done in study(left, world, lambda line: click.echo(line, err=True)):
                kept[task_of(row)] = row
                if rows is not None:
                    write_rows(rows, list(kept.values()))
                if tracks is not None:
                    told = kidnapped(world) if story == "kidnapped" else world
                    tracks.mkdir(parents=True, exist_ok=True)
                    name = "-".join([row.world, row.model, row.resampler, row.init, row.story])
                    write_track(tracks / f"{name}.csv", told.stamps_ns, told.truth, done)
                    near = np.mean([one.is_near for one in done], axis=0)
                    title = f"{row.model}: its {row.seeds} runs are near the truth {row.share_near:.0%} of the time"
                    seconds = (told.stamps_ns - told.stamps_ns[0]) / 1e9
                    drawn = places_picture(told.ceiling, told.truth, seconds, near, title)
                    write_whole(tracks / f"{name}.png", drawn)
        found += [kept[task] for task in tasks]
    return found


def _cost(as_json: bool) -> None:
    """What an update of each model costs."""
    from dataclasses import asdict

    from wallkit.pipelines.bench.ceiling_cost import time_models
    from wallkit.pipelines.run_folder import machine

    times = list(time_models())
    if as_json:
        common.emit({"machine": machine(), "rows": [asdict(one) for one in times]})
        return
    headers = ["model", "within m", "particles", "places", "weigh ms", "ns/lookup"]
    cells = [
        [t.model, f"{t.spread_m:g}", str(t.particles), str(t.places), f"{t.weigh_ms:.3f}", f"{t.ns_per_lookup:.2f}"]
        for t in times
    ]
    click.echo(common.table(headers, cells, right=(1, 2, 3, 4, 5)))
