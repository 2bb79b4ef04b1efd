"""`wallkit demo`: the main job on the sample inside the package."""

from __future__ import annotations

from pathlib import Path

import click

from wallkit.cli import common

COLUMNS = (
    ("ate_median_m", "median error", "cm", 100.0),
    ("heading_error_median_deg", "heading", "deg", 1.0),
    ("updates_to_converge", "converged after", "updates", 1.0),
    ("false_healthy", "false healthy", "scans", 1.0),
    ("availability", "available", "%", 100.0),
    ("update_median_ms", "per update", "ms", 1.0),
)


@click.command()
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    default=Path("wallkit-demo"),
    show_default=True,
    help="Folder for the results.",
)
@common.overwrite_option
@common.json_option
@common.quiet_option
@click.pass_context
def demo(ctx: click.Context, /, out: Path, overwrite: bool, as_json: bool, quiet: bool) -> None:
    """Localize the sample inside the package, with and without filters for people, and compare.

    A robot starts somewhere in a restroom and corridor, not knowing where; six people walk about. The first run compiles
    the kernels, which takes a few seconds.

    Exits 0 if the results are as expected, 1 if they differ.

    \b
    Examples:
      wallkit demo
      wallkit demo --out /tmp/demo --overwrite
    """
    from wallkit.pipelines.demo import run_demo
    from wallkit.pipelines.outputs import result_folder

    def observe(name: str) -> None:
        if not quiet:
            click.echo(f"localizing the sample: {name}", err=True)

    with result_folder(out, overwrite=overwrite) as folder:
        done = run_demo(folder, observe)
    if as_json:
        results = {name: {k: v.value for k, v in e.metrics.items()} for name, (_, e) in done.runs.items()}
        common.emit({"methods": results, "surprises": list(done.surprises), "out": out})
    else:
        rows = [
            [name, *(_cell(evaluation.metrics[key].value, factor) for key, _, _, factor in COLUMNS)]
            for name, (_, evaluation) in done.runs.items()
        ]
        headers = ["method", *(f"{title} [{unit}]" for _, title, unit, _ in COLUMNS)]
        click.echo(common.table(headers, rows, right=tuple(range(1, len(headers)))))
        click.echo(f"report   {out / 'report.html'} (each run's own: {out / 'METHOD' / 'report.html'})")
        verdict = "as expected" if not done.surprises else "NOT as expected:"
        click.echo(f"verdict  {verdict}")
        for surprise in done.surprises:
            click.echo(f"  {surprise}")
    if done.surprises:
        ctx.exit(common.FAILED_CHECK)


def _cell(value: float | None, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.3g}"
