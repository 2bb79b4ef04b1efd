"""`wallkit compare` of many logs: what every configuration is worth over all logs, in tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.batch.compare import Question
    from wallkit.report.batch import BatchData
    from wallkit.report.batch_words import Table

batch_options = common.options(
    click.option("--baseline", metavar="NAME", help="Many logs: what the others are compared with; else the first."),
    click.option("--metric", "metrics", multiple=True, metavar="KEY", help="Many logs: what is tested (repeatable)."),
    click.option("--by", multiple=True, metavar="KEY", help="Many logs: a table by a tag or a setting (repeatable)."),
    click.option("--where", multiple=True, metavar="KEY=A,B", help="Many logs: only those with one of these values."),
    click.option("--names", metavar="PATTERN", help="Many logs: tags from their names, as {scene}-{people}-{take}."),
)


def is_for(runs: tuple[Path, ...], flags: dict[str, Any]) -> bool:
    """Whether what is named are many logs: folders of folders, and an option that only makes sense there."""
    from wallkit.pipelines.batch.folders import is_folder_of_runs

    asked = [
        f"--{name}" for name in ("baseline", "metric", "by", "where", "names") if flags.get(_PLURAL.get(name, name))
    ]
    others = [run for run in runs if not is_folder_of_runs(run)]
    if asked and others:
        message = f"{', '.join(asked)} is for folders of result folders, and {others[0]} is none"
        raise click.UsageError(message)
    return bool((asked or flags["paper"]) and not others)


def compare(runs: tuple[Path, ...], names: list[str], flags: dict[str, Any], *, is_paper: bool, as_json: bool) -> None:
    """Say it, or emit it."""
    data = read(runs, names, flags, is_paper=is_paper)
    if as_json:
        common.emit(document(data))
    else:
        say(data, is_paper=is_paper)


def read(runs: tuple[Path, ...], names: list[str], flags: dict[str, Any], *, is_paper: bool) -> BatchData:
    """The runs, compared as the flags say."""
    from wallkit.pipelines.batch.compare import compare_batch
    from wallkit.pipelines.batch.folders import read_folders
    from wallkit.pipelines.batch.runs import where, with_parts_of_names

    found = read_folders(runs, names)
    if flags["names"]:
        found = with_parts_of_names(found, flags["names"])
    for words in flags["where"]:
        found = where(found, words)
    return compare_batch(found, _question(flags, is_paper=is_paper), title=" against ".join(names))


def say(data: BatchData, *, is_paper: bool) -> None:
    """Tables and sentences on stdout."""
    from wallkit.report import batch_words as words

    if is_paper:
        click.echo(_text(words.paper_table(data.summaries)))
    else:
        click.echo(_text(words.error_table(data)))
        click.echo()
        click.echo(_text(words.other_table(data)))
    for line in _sentences(data):
        click.echo(line)
    for factor in data.factors:
        click.echo()
        for key in data.differences:
            click.echo(f"mean {words.word_of(key)} by {factor.key}")
            click.echo(_text(words.factor_table(factor, key)))
        if is_paper:
            for level in factor.levels:
                click.echo(f"\n{factor.key} = {level.name}, {words.count_text(level.logs, 'log')}")
                click.echo(_text(words.paper_table(level.summaries)))
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
    from wallkit.report import batch_words as words

    for key, differences in data.differences.items():
        if differences:
            yield ""
            yield words.tested_line(key, data.baseline, len(differences))
            yield from (words.difference_line(d, key, data.baseline) for d in differences)
    if len(data.summaries) > 1 and data.contest is not None:
        yield ""
        yield from words.contest_lines(data.contest, data.key)
    for runs, what in ((data.failed, "failed"), (data.missing, "missing: asked for, and not run yet")):
        if runs:
            yield ""
            yield from words.run_lines(runs, what)


def _text(table: Table) -> str:
    headers, rows = table
    return common.table(headers, rows, right=tuple(range(1, len(headers))))


_PLURAL = {"metric": "metrics"}
