"""`wallkit bench ceiling`: what the ceiling's models are worth, and what they cost."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common


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
@common.json_option
def ceiling(
    runs: tuple[Path, ...],
    seeds: int,
    models: str,
    resamplers: str,
    inits: str,
    kidnapped: bool,
    ceiling: Path | None,
    as_json: bool,
) -> None:
    """Run the ceiling's models on folders of `wallkit simulate log`; without folders time one update of each model.

    Times are CPU time. A run has converged if it ends within 0.5 m and 10 degrees, and has been for ten seconds.

    \b
    Examples:
      wallkit bench ceiling
      wallkit bench ceiling unique/ painted/ --seeds 20
      wallkit bench ceiling unique/ --models patch --resamplers wheel,systematic --inits everywhere,global
    """
    from dataclasses import asdict

    from wallkit.pipelines.bench.ceiling import MODELS, read_world, study, time_models
    from wallkit.pipelines.run_folder import machine

    if not runs:
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
        return
    names = models.split(",")
    unknown = [name for name in names if name not in MODELS]
    if unknown:
        raise click.UsageError(f"no model is called '{unknown[0]}': {', '.join(MODELS)}")
    rows = list(
        study(
            [read_world(folder, ceiling) for folder in runs],
            seeds,
            models=names,
            resamplers=resamplers.split(","),
            inits=inits.split(","),
            story="kidnapped" if kidnapped else "drive",
            progress=lambda line: click.echo(line, err=True),
        )
    )
    if as_json:
        common.emit({"machine": machine(), "rows": [asdict(row) for row in rows]})
        return
    headers = [
        "world",
        "model",
        "resampler",
        "start",
        "converged",
        "updates",
        "error m",
        "deg",
        "lost again",
        "ms/update",
    ]
    cells = [
        [
            row.world, row.model, row.resampler, row.init, f"{row.converged}/{row.seeds}", f"{row.updates:.0f}",
            f"{row.error_m:.3f}", f"{row.error_deg:.2f}", str(row.lost_again), f"{row.ms_per_update:.2f}",
        ]
        for row in rows
    ]  # fmt: skip
    click.echo(common.table(headers, cells, right=tuple(range(4, 10))))
