"""`wallkit map`: the words that can follow, and those that judge a map."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common
from wallkit.cli.map.add import add, new
from wallkit.cli.map.audit import audit
from wallkit.cli.map.compare import diff, fmt, merge
from wallkit.cli.map.draw import show
from wallkit.cli.map.edit import array, move, remove, rename, reparent, rotate, set_
from wallkit.cli.map.export import export
from wallkit.cli.map.frame import adopt, origin, scale
from wallkit.cli.map.look import import_, info, ls
from wallkit.cli.map.measure import measure, tree
from wallkit.cli.map.score import probe, score_command
from wallkit.cli.map.slice import compat, slice_
from wallkit.cli.map.walls import cut, fill, join, snap, split

if TYPE_CHECKING:
    from wallkit.maps.findings.judged import Judged
    from wallkit.pipelines.map.verdicts import RepairedFile, Selection

FILES = click.argument("files", nargs=-1, type=click.Path(path_type=Path), metavar="[FILE]...")
COLORS = {"error": "red", "warning": "yellow", "info": "cyan"}

selection_options = common.options(
    click.option("--select", multiple=True, metavar="RULES", help="Only these: E, WK-E010, or a profile as schema."),
    click.option("--ignore", multiple=True, metavar="RULES", help="All but these (both repeatable; commas allowed)."),
    common.config_option,
    common.set_option,
)


@click.group("map")
def map_group() -> None:
    """Draw, change, judge, repair, look into, import and export semantic maps (URDF with walls, doors, rooms)."""


@map_group.command()
@FILES
@selection_options
@click.option("--strict", is_flag=True, help="Warnings count as errors.")
@click.option(
    "--labels", type=click.Path(path_type=Path), metavar="FILE", help="A model's classes: text, YAML, JSON, ONNX."
)
@click.option("--baseline", type=click.Path(path_type=Path), metavar="FILE", help="Accept the findings listed in it.")
@click.option("--write-baseline", is_flag=True, help="List the findings of now in the baseline, and accept them.")
@click.option(
    "--format",
    "format_name",
    type=click.Choice(["text", "json", "sarif", "junit", "github"]),
    default="text",
    show_default=True,
    help="How findings are written.",
)
@common.json_option
@common.color_option
@click.pass_context
def validate(
    ctx: click.Context,
    /,
    files: tuple[Path, ...],
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    config_path: Path | None,
    words: tuple[str, ...],
    strict: bool,
    labels: Path | None,
    baseline: Path | None,
    write_baseline: bool,
    format_name: str,
    as_json: bool,
    color: str,
) -> None:
    """Say everything that is wrong in maps: which rule, line and column, where in the map, and what to do.

    Without FILE: the map named in wallkit.toml, else every *.wkmap.urdf here. FILE may also be a map_server YAML, which is
    judged with its image (rules R).

    Exits 0 if no error is found (with --strict: no warning either), 1 if one is, 2 if a file cannot be read. Rules that
    an error keeps from running are named; they never count as passed.

    \b
    Examples:
      wallkit map validate
      wallkit map validate maps/*.urdf --strict --ignore P007
      wallkit map validate floor2.wkmap.urdf --select schema,O --set rules.scan_plane_m=0.3
      wallkit map validate old.wkmap.urdf --baseline accepted.json --write-baseline
      wallkit map validate floor2.wkmap.urdf --format sarif > map.sarif
      wallkit map validate floor2.wkmap.urdf --labels wallseg.onnx
      wallkit map validate floor.yaml --strict
    """
    from dataclasses import replace

    from wallkit.maps.findings.text import counted
    from wallkit.maps.labels import read_labels
    from wallkit.pipelines.map import verdicts as pipeline

    if write_baseline and baseline is None:
        raise click.UsageError("say where to: --baseline FILE --write-baseline")
    selection, configured = _selection(select, ignore, config_path, words)
    if labels is not None:
        selection = replace(selection, labels=read_labels(labels))
    judged = pipeline.judge(pipeline.map_files(files, configured), selection, is_strict=strict)
    if baseline is not None and write_baseline:
        count = pipeline.write_baseline(baseline, judged)
        click.echo(f"{baseline}: accepts {counted(count, 'finding')} from now on", err=True)
    if baseline is not None:
        judged, gone = pipeline.accept(judged, pipeline.read_baseline(baseline))
        if gone:
            common.warn(
                f"{baseline}: {counted(gone, 'finding')} no longer there; --write-baseline brings it up to date"
            )
    _print_judged(judged, "json" if as_json else format_name, color)
    ctx.exit(common.OK if all(file.is_good for file in judged) else common.FAILED_CHECK)


@map_group.command()
@click.argument("codes", nargs=-1, required=True, metavar="RULE...")
def explain(codes: tuple[str, ...]) -> None:
    """Explain a rule: what it objects to and why, with an example that raises it and one that does not.

    \b
    Examples:
      wallkit map explain WK-G001
      wallkit map explain s022 s024
    """
    from wallkit.maps.rules import explain as explanation

    click.echo("\n".join(explanation(code) for code in codes), nl=False)


@map_group.command()
@click.argument("selectors", nargs=-1, metavar="[RULES]...")
@common.json_option
def rules(selectors: tuple[str, ...], as_json: bool) -> None:
    """List the rules, or those of some groups: code, severity, class of the repair, and what is wrong.

    \b
    Examples:
      wallkit map rules
      wallkit map rules G WK-S02
      wallkit map rules --json | jq '.rules[] | select(.fix == "safe").rule'
    """
    from wallkit.maps.rules import RULES
    from wallkit.maps.rules.base import PREREQUISITES
    from wallkit.maps.rules.docs import doc_of
    from wallkit.maps.rules.engine import codes_matching

    chosen = codes_matching(selectors, RULES) if selectors else set(RULES)
    groups = list(PREREQUISITES)
    in_order = sorted((RULES[code] for code in chosen), key=lambda rule: (groups.index(rule.group), rule.code))
    found = [(rule, doc_of(rule).title) for rule in in_order]
    if as_json:
        rows = [{"rule": r.code, "severity": r.severity, "fix": r.fix, "title": title} for r, title in found]
        common.emit({"rules": rows})
        return
    cells = [[rule.code, rule.severity, rule.fix or "-", title] for rule, title in found]
    click.echo(common.table(["rule", "severity", "fix", "what is wrong"], cells))


@map_group.command()
@FILES
@click.option(
    "--fix",
    "kind",
    type=click.Choice(["safe", "moderate", "risky"]),
    default="safe",
    show_default=True,
    help="Repairs made: safe keep the meaning, moderate are most likely meant; risky are only shown (--dry-run).",
)
@selection_options
@click.option("--dry-run", is_flag=True, help="Print the patch and write nothing.")
@click.pass_context
def fix(
    ctx: click.Context,
    /,
    files: tuple[Path, ...],
    kind: str,
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    config_path: Path | None,
    words: tuple[str, ...],
    dry_run: bool,
) -> None:
    """Repair maps: only the bytes a repair needs change, and a second time changes nothing.

    Without FILE: as for `wallkit map validate`. Exits 0 if no error is left, 1 if one is, 2 if a file cannot be read.

    \b
    Examples:
      wallkit map fix floor2.wkmap.urdf
      wallkit map fix floor2.wkmap.urdf --fix moderate --dry-run > floor2.patch
      wallkit map fix maps/*.urdf --select S023,S024 --fix moderate
    """
    from wallkit.pipelines.map import verdicts as pipeline
    from wallkit.pipelines.outputs import write_whole

    if kind == "risky" and not dry_run:
        raise click.UsageError("risky repairs are only shown: add --dry-run, and make those you want by hand")
    selection, configured = _selection(select, ignore, config_path, words)
    repaired = pipeline.repair_files(pipeline.map_files(files, configured), selection, kind)  # type: ignore[arg-type]
    for file in repaired:
        if dry_run:
            click.echo(file.patch, nl=False)
        elif file.after != file.before:
            write_whole(file.path, file.after)
        _say_fixed(file, dry_run=dry_run)
    ctx.exit(common.OK if all(file.judged.is_good for file in repaired) else common.FAILED_CHECK)


# ------------------------------------------------------------------------------------------------ details


def _selection(
    select: tuple[str, ...], ignore: tuple[str, ...], config_path: Path | None, words: tuple[str, ...]
) -> tuple[Selection, str]:
    """What the flags and settings select, and the map that the settings name."""
    import datetime

    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.map.verdicts import Selection

    config = load_config(config_path, words).config
    today = datetime.datetime.now().astimezone().date()
    return Selection(config.rules, today, _words(select), _words(ignore)), config.map


def _words(values: tuple[str, ...]) -> list[str]:
    return [word for value in values for word in value.replace(",", " ").split()]


def _print_judged(judged: Sequence[Judged], format_name: str, color: str) -> None:
    import json

    from wallkit.maps.findings.formats import DOCUMENTS, TEXTS
    from wallkit.maps.findings.text import text_from

    if format_name == "json":
        common.emit(DOCUMENTS["json"](judged))
    elif format_name in DOCUMENTS:
        document = common.plain(DOCUMENTS[format_name](judged))
        click.echo(json.dumps(document, indent=2, allow_nan=False))
    elif format_name == "text" and common.console(color).color_system:
        click.echo(text_from(judged, paint=lambda text, as_: click.style(text, COLORS[as_])), nl=False, color=True)
    else:
        click.echo(TEXTS[format_name](judged), nl=False)


def _say_fixed(file: RepairedFile, *, dry_run: bool) -> None:
    """What was repaired, and what is left; on stderr where stdout is the patch."""
    from wallkit.maps.findings.text import counted

    would = "would be fixed" if dry_run else "fixed"
    for finding in file.fixed:
        click.echo(
            f"{finding.file}:{finding.line}:{finding.column}: {would} {finding.code}: {finding.message}", err=dry_run
        )
    report = file.judged.report
    left = f"{counted(report.count('error'), 'error')} and {counted(report.count('warning'), 'warning')} left"
    kinds = [finding.fix.kind for finding in report.findings if finding.fix is not None]
    more = f"; {len(kinds)} more have a repair: {', '.join(sorted(set(kinds)))}" if kinds else ""
    click.echo(f"{file.path}: {len(file.fixed)} {would}, {left}{more}", err=dry_run)


for command in (
    *(new, add, array, move, rotate, rename, reparent, remove, set_),
    *(cut, fill, split, join, snap),
    *(adopt, scale, origin),
    *(info, ls, tree, show, measure, slice_, audit, compat, score_command, probe),
    *(fmt, diff, merge, import_, export),
):
    map_group.add_command(command)
