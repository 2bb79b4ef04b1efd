"""`wallkit compare` and `report` of many logs: what every configuration is worth, in sentences, tables and a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wallkit.pipelines.batch.compare import Question
    from wallkit.pipelines.batch.runs import Runs
    from wallkit.pipelines.evaluate import EvaluateSettings
    from wallkit.report.batch import BatchData
    from wallkit.report.batch_map import Places
    from wallkit.report.batch_tables import Table

batch_options = common.options(
    click.option("--baseline", metavar="NAME", help="Many logs: what the others are compared with; else the first."),
    click.option("--metric", "metrics", multiple=True, metavar="KEY", help="Many logs: what is tested (repeatable)."),
    click.option("--by", multiple=True, metavar="KEY", help="Many logs: a table by a tag or a setting (repeatable)."),
    click.option("--where", multiple=True, metavar="KEY=A,B", help="Many logs: only those with one of these values."),
    click.option("--names", metavar="PATTERN", help="Many logs: tags from their names, as {scene}-{people}-{take}."),
)


def is_for(runs: tuple[Path, ...], flags: dict[str, Any]) -> bool:
    """Whether what is named are many logs: several folders of folders, or one and an option that only makes sense there."""
    from wallkit.pipelines.batch.folders import configurations_in, is_folder_of_runs
    from wallkit.pipelines.batch.read import is_batch

    if len(runs) == 1 and (is_batch(runs[0]) or configurations_in(runs[0])):
        return True
    asked = [
        f"--{name}" for name in ("baseline", "metric", "by", "where", "names") if flags.get(_PLURAL.get(name, name))
    ]
    others = [run for run in runs if not is_folder_of_runs(run)]
    if asked and others:
        message = f"{', '.join(asked)} is for a batch or folders of result folders, and {others[0]} is neither"
        raise click.UsageError(message)
    # a single folder without a question is shown as its runs
    return not others and (bool(asked) or flags["paper"] or len(runs) > 1)


def compare(
    runs: tuple[Path, ...],
    names: list[str],
    flags: dict[str, Any],
    *,
    out: Path | None,
    is_paper: bool,
    as_json: bool,
) -> None:
    """Say it, or emit it; with `out` a page without maps as well."""
    if flags["config_path"] is not None or flags["words"]:
        message = "many logs are compared by the numbers that their runs wrote, which --config and --set do not change"
        raise click.UsageError(f"{message}: compare two runs of one log, or localize again")
    found = read(runs, names, flags)
    data = judged(found, names, flags, is_paper=is_paper)
    if as_json:
        common.emit(document(data))
    else:
        say(data, is_paper=is_paper)
    if out is not None:
        _write(out, data, ())
        click.echo(f"report   {out}", err=as_json)


def report(
    runs: tuple[Path, ...], names: list[str], flags: dict[str, Any], *, out: Path | None, settings: EvaluateSettings
) -> None:
    """The page, with the places on the map where runs fail."""
    from wallkit.pipelines.batch.places import read_places

    if out is None and len(runs) == 1:
        out = runs[0] / "report.html"
    if out is None:
        raise click.UsageError("many logs make a page of their own: say where with --out report.html")
    found = read(runs, names, flags)
    data = judged(found, names, flags, is_paper=False)
    with common.progress("runs", int(found.is_done.sum()), quiet=flags["quiet"]) as tick:
        places = read_places(found, settings, tick=tick)
    _write(out, data, places)
    click.echo(f"report   {out}")


def read(runs: tuple[Path, ...], names: list[str], flags: dict[str, Any]) -> Runs:
    """Those of the runs that the flags ask for."""
    from wallkit.pipelines.batch.folders import configurations_in, read_folders
    from wallkit.pipelines.batch.read import is_batch, read_runs
    from wallkit.pipelines.batch.runs import where, with_parts_of_names

    if flags["truth"] is not None:
        raise click.UsageError("--truth is of one log; many logs have their truths from wallkit localize --truth")
    if len(runs) == 1 and (inside := configurations_in(runs[0])):
        runs, names = inside, [folder.name for folder in inside]
    found = read_runs(runs[0]) if is_batch(runs[0]) else read_folders(runs, names)
    if flags["names"]:
        found = with_parts_of_names(found, flags["names"])
    for words in flags["where"]:
        found = where(found, words)
    return found


def judged(runs: Runs, names: list[str], flags: dict[str, Any], *, is_paper: bool) -> BatchData:
    """What the runs say about the configurations."""
    from wallkit.pipelines.batch.compare import compare_batch

    return compare_batch(runs, _question(flags, is_paper=is_paper), title=" against ".join(names))


def say(data: BatchData, *, is_paper: bool) -> None:
    """Tables and sentences on stdout."""
    from wallkit.report import batch_tables as tables
    from wallkit.report import batch_words as words

    if is_paper:
        click.echo(_text(tables.paper_table(data.summaries)))
    else:
        click.echo(_text(tables.error_table(data)))
        click.echo()
        click.echo(_text(tables.other_table(data)))
    for line in _sentences(data):
        click.echo(line)
    for factor in data.factors:
        click.echo()
        for key in data.differences:
            click.echo(f"mean {words.word_of(key)} by {factor.key}")
            click.echo(_text(tables.factor_table(factor, key)))
        if is_paper:
            for level in factor.levels:
                click.echo(f"\n{factor.key} = {level.name}, {words.count_text(level.logs, 'log')}")
                click.echo(_text(tables.paper_table(level.summaries)))
    if data.factors and len(data.summaries) > 1:
        click.echo(words.star_line(data))


def document(data: BatchData) -> dict[str, Any]:
    """Everything as one JSON document."""
    return asdict(data)


def _question(flags: dict[str, Any], *, is_paper: bool) -> Question:
    from wallkit.pipelines.batch.compare import Question
    from wallkit.pipelines.report import COMPARED_IN_PAPERS

    metrics = tuple(dict.fromkeys(flags["metrics"])) or (COMPARED_IN_PAPERS if is_paper else ())
    return Question(flags["baseline"] or "", metrics, tuple(dict.fromkeys(flags["by"])), flags["seed"])


def _sentences(data: BatchData) -> Iterator[str]:
    from wallkit.report import batch_tables as tables
    from wallkit.report import batch_words as words

    for key, differences in data.differences.items():
        if differences:
            yield ""
            yield words.tested_line(key, data.baseline, len(differences))
            yield from words.difference_lines(differences, key, data.baseline)
    if len(data.summaries) > 1 and data.contest is not None:
        yield ""
        yield from words.contest_lines(data.contest, data.key)
        if data.effects and (candidates := tables.candidate_table(data)):
            yield _text(candidates)
    if data.worst:
        yield ""
        yield "worst runs:"
        for run in data.worst[:_WORST]:
            text = words.mean_text(run.value or 0.0, data.unit)
            yield f"  {words.run_name(run)}: {text}{f'  {run.folder}' if run.folder else ''}"
    for runs, what in ((data.failed, "failed"), (data.missing, "missing: asked for, and not run yet")):
        if runs:
            yield ""
            yield from words.run_lines(runs, what)


def _write(out: Path, data: BatchData, places: Sequence[Places]) -> None:
    import os

    from wallkit.report.batch_page import write_batch_page

    def link_to(folder: str) -> str:
        """The page of a run, else its folder, as seen from ours."""
        page = Path(folder) / "report.html"
        found = page if page.is_file() else Path(folder)
        return Path(os.path.relpath(found, out.parent)).as_posix() if found.exists() else ""

    write_batch_page(out, data, places, link_to=link_to)


def _text(table: Table) -> str:
    headers, rows = table
    return common.table(headers, rows, right=tuple(range(1, len(headers))))


_WORST = 5
_PLURAL = {"metric": "metrics"}
