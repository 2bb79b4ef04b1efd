"""`wallkit batch`: many logs under many settings."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.batch.manifest import Read
    from wallkit.pipelines.batch.plan import Plan
    from wallkit.pipelines.batch.run import Ended

_EVERY_S = 10.0
_MOST_FAILURES = 10


@click.command()
@click.argument("manifest", type=click.Path(path_type=Path), metavar="MANIFEST")
@click.option("--jobs", type=click.IntRange(1, 1024), default=1, show_default=True, help="Processes of this machine.")
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="A Dask scheduler, whose workers do it instead.")
@click.option("--retry", is_flag=True, help="Do the runs that failed again, too.")
@click.option("--reports", is_flag=True, help="Give every run its report.html and result.mcap: some MB each.")
@common.out_option
@common.json_option
@common.quiet_option
@common.dry_run_option
@click.pass_context
def batch(ctx: click.Context, /, manifest: Path, **flags: Any) -> None:
    """Run many logs under many settings, here or on a cluster, and go on where it was stopped.

    MANIFEST is a TOML file: logs x maps x calibrations x configurations x seeds, for localize, calib verify, map audit or
    simulate. Results go to --out, else to MANIFEST's name with .batch: batch.sqlite and batch.csv with a row for each run,
    and runs/ with a folder for each. A run that is done is skipped next time, unless its files, settings, seed or wallkit
    have changed; `wallkit compare` and `report` read the folder.

    Exits 0 if every run was done, 3 if some failed, 2 if all did or it could not begin, 130 when it was stopped.

    \b
    Examples:
      wallkit batch fleet.toml --jobs 4
      wallkit batch fleet.toml --out overnight --jobs 4 --retry
      wallkit batch fleet.toml --out /shared/overnight --scheduler tcp://10.0.0.1:8786
      wallkit batch fleet.toml --dry-run
    """
    from wallkit.batch.store import open_store
    from wallkit.pipelines.batch.digests import remembered
    from wallkit.pipelines.batch.engines import cluster_engine, local_engine
    from wallkit.pipelines.batch.manifest import read_manifest
    from wallkit.pipelines.batch.plan import plan_of
    from wallkit.pipelines.batch.run import check_folder, run_batch

    out = flags["out"] or Path(f"{manifest.name.removesuffix('.toml')}.batch")
    read = read_manifest(manifest)
    check_folder(out)
    if flags["dry_run"]:
        _say_plan(read, plan_of(read, out, {}, reports=flags["reports"]), out)
        return
    with open_store(out) as store:
        with remembered(out) as known:
            plan = plan_of(read, out, known, reports=flags["reports"])
        if flags["scheduler"]:
            engine = cluster_engine(flags["scheduler"], out.absolute(), lambda text: click.echo(text, err=True))
        else:
            engine = local_engine(flags["jobs"])
        with progress(quiet=flags["quiet"]) as observe:
            ended = run_batch(read, plan, store, engine, retry=flags["retry"], observe=observe)
    if flags["as_json"]:
        common.emit(document(out, ended))
    else:
        click.echo("\n".join(_lines(out, ended)))
    ctx.exit(exit_code(ended))


def exit_code(ended: Ended) -> int:
    """2 if nothing could be done, 3 if some could not, else 0: a bad verdict of a run is no failure of the batch."""
    if not ended.failed:
        return common.OK
    return common.UNABLE if ended.failed == ended.runs else common.DATA_LOST


def document(out: Path, ended: Ended) -> dict[str, Any]:
    """Every run with its settings and numbers, and what the numbers are."""
    from dataclasses import asdict

    from wallkit.batch.store import read_measures, read_rows

    measures = {name: {"unit": m.unit, "definition": m.definition} for name, m in read_measures(out).items()}
    runs = [{**asdict(row.asked), **asdict(row.outcome), "folder": row.folder} for row in read_rows(out)]
    return {**asdict(ended), "out": out, "measures": measures, "results": runs}


@contextlib.contextmanager
def progress(*, quiet: bool) -> Iterator[Callable[[int, int, int], None]]:
    """A callback for (ended, all, failed): a bar on a terminal, else a line every ten seconds."""
    import sys

    if quiet:
        yield lambda ended, runs, failed: None
    elif sys.stderr.isatty():
        with _bar() as update:
            yield update
    else:
        yield _line_printer()


@contextlib.contextmanager
def _bar() -> Iterator[Callable[[int, int, int], None]]:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    # pieces end every minute or so: the rate is that of the last half hour
    with Progress(
        TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeElapsedColumn(),
        TextColumn("left"), TimeRemainingColumn(), TextColumn("{task.fields[bad]}", style="red"),
        console=common.console(stderr=True), speed_estimate_period=1800, transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task("", total=None, rate="", bad="")
        rate = _Rate()

        def update(ended: int, runs: int, failed: int) -> None:
            bad = f"{failed} failed" if failed else ""
            bar.update(task, completed=ended, total=runs, rate=rate.words(ended), bad=bad)

        yield update


class _Rate:
    """Runs per minute since the first call."""

    def __init__(self) -> None:
        self._began, self._first = time.monotonic(), -1

    def per_s(self, ended: int) -> float:
        if self._first < 0:
            self._first = ended
        return (ended - self._first) / max(time.monotonic() - self._began, 1e-3)

    def words(self, ended: int) -> str:
        return f"{60 * self.per_s(ended):.3g}/min"


def _line_printer() -> Callable[[int, int, int], None]:
    rate = _Rate()
    said_at = time.monotonic()

    def update(ended: int, runs: int, failed: int) -> None:
        nonlocal said_at
        per_s = rate.per_s(ended)
        if time.monotonic() - said_at < _EVERY_S or not per_s:
            return
        said_at = time.monotonic()
        left = f"{(runs - ended) / per_s / 60:.0f} min left"
        click.echo(f"runs: {ended} of {runs}, {rate.words(ended)}, {left}, {failed} failed", err=True)

    return update


def _say_plan(read: Read, plan: Plan, out: Path) -> None:
    logs = dict.fromkeys(run.log for run in plan.asked())
    click.echo(f"job      {read.manifest.job}")
    click.echo(f"logs     {len(logs)}: {', '.join(list(logs)[:3])}{', ...' if len(logs) > 3 else ''}")
    for configuration in read.configurations:
        said = ", ".join(f"{key} = {value}" for key, value in configuration.flat.items()) or "the defaults"
        click.echo(f"settings {configuration.name}: {said}")
    click.echo(f"seeds    {', '.join(map(str, read.manifest.seeds))}")
    click.echo(f"runs     {len(plan)}")
    click.echo(f"writes   {out}/  (dry run: nothing is written)")


def _lines(out: Path, ended: Ended) -> list[str]:
    from itertools import islice

    from wallkit.pipelines.batch.run import CSV, failures

    done = ended.runs - ended.failed
    before = f"; {ended.before} of all were there already" if ended.before else ""
    lines = [f"done     {done} of {ended.runs} runs{before}"]
    if ended.failed:
        lines.append(f"failed   {ended.failed} runs; again with --retry")
        for name, log, message in islice(failures(out), _MOST_FAILURES):
            lines += [f"  {name} ({log})", *(f"    {line.strip()}" for line in message.splitlines())]
        if ended.failed > _MOST_FAILURES:
            lines.append(f"  and {ended.failed - _MOST_FAILURES} more, in the table")
    return [*lines, f"table    {out / CSV}", f"next     wallkit compare {out}"]
