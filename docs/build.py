"""Commands, settings and map rules -> cli.md, config.md and map-rules.md in docs/reference.

With `--check` nothing is written, and the exit code is 1 if a page is stale.
"""

from __future__ import annotations

import dataclasses
import inspect
import json
import re
import sys
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from wallkit.cli.app import main as wallkit
from wallkit.core.config import name_in
from wallkit.maps.rules import RULES
from wallkit.maps.rules.base import PREREQUISITES, Rule
from wallkit.maps.rules.docs import doc_of, is_file
from wallkit.pipelines.batch.expand import Sweep
from wallkit.pipelines.batch.manifest import Manifest
from wallkit.pipelines.config import Config
from wallkit.simulate.scenario import Scenario

REFERENCE = Path(__file__).parent / "reference"
NOTE = "<!-- Written by `python docs/build.py`: change the docstring or the option in the code, not this page. -->"


def cli_page() -> str:
    """Every command with its arguments, options and examples."""
    intro = "Every command with `--help` says the same. `-h` and `--help` work everywhere and are left out below."
    lines = ["# Commands", "", NOTE, "", intro]
    for words, command, ctx in commands(wallkit, "wallkit"):
        lines += ["", f"## `{words}`", "", "```text", " ".join([words, *command.collect_usage_pieces(ctx)]), "```"]
        for paragraph in inspect.cleandoc(command.help or "").split("\n\n"):
            lines += ["", *(_example(paragraph) if paragraph.startswith("\b") else [_one_line(paragraph)])]
        options = (p for p in command.params if isinstance(p, click.Option) and p.name not in ("help", "version"))
        rows = [(f"`{names}`", text) for names, text in (option.get_help_record(ctx) or ("", "") for option in options)]
        lines += ["", *_table(("option", "meaning"), rows)] if rows else []
    return "\n".join(lines) + "\n"


def commands(command: click.Command, words: str, parent: click.Context | None = None) -> Iterator[Any]:
    """(words, command, context) of a command and of everything below it."""
    ctx = click.Context(command, info_name=words.rpartition(" ")[2], parent=parent)
    yield words, command, ctx
    for name in command.list_commands(ctx) if isinstance(command, click.Group) else ():
        inner = command.get_command(ctx, name)
        if inner is not None:
            yield from commands(inner, f"{words} {name}", ctx)


def config_page() -> str:
    """Every setting with its default, range and meaning, and every part that can be chosen by name."""
    intro = (
        "A setting is written in `wallkit.toml` under its table, or given as `--set KEY=VALUE`. A flag beats `--set`,"
        " `--set` beats the file, the file beats the default. `wallkit config show` prints the values in use and where"
        " each comes from.\n\nA part with several alternatives is chosen by its name:"
        ' `--set localize.sensor=beam`, or `sensor.name = "beam"` in the file. `package.module:Name` takes your own'
        " ([how](../how-to/add-a-sensor-model.md))."
    )
    lines = ["# Settings", "", NOTE, "", intro, *_settings(Config, (), 2)]
    return "\n".join(lines) + "\n"


def _table_header(f: dataclasses.Field[Any], key: tuple[str, ...]) -> str:
    """[table] or [[one of several]]."""
    name = f"[{'.'.join(key)}]"
    return f"[{name}]" if "tables" in f.metadata else name


def scenario_page() -> str:
    """Everything that can be said of a simulated log."""
    intro = (
        "What happens in a log that `wallkit simulate log MAP --scenario FILE.toml` makes, and what its sensors do wrong."
        " Every key can also be given as `--set KEY=VALUE`. What is a list of tables is written `[[doors]]` once for each."
    )
    return "\n".join(["# Scenarios", "", NOTE, "", intro, *_settings(Scenario, (), 2)]) + "\n"


def manifest_page() -> str:
    """Everything that the manifest of a batch can say."""
    intro = (
        "What `wallkit batch MANIFEST` runs: every log x map x calibration x configuration x seed. Paths are from the"
        " manifest's folder; `beside:NAME` is a file in the folder of each log. Logs, maps, calibrations, truth, board,"
        " robot and model may be addresses, [s3:// and others](../how-to/run-many-logs.md#logs-in-a-bucket)."
        " How to write one: [Run many logs](../how-to/run-many-logs.md)."
    )
    tables = (
        (
            "settings",
            'for all configurations, as in `wallkit.toml`: `[settings.localize]`, or `"localize.particles" = 500`',
        ),
        (
            "[configurations]",
            "one for each: `name`, `settings = {...}` over those for all, and `model` instead of the manifest's",
        ),
    )
    rows = [(f"`[{name}]`", meaning) for name, meaning in tables]
    over = (
        '`[sweep.over]` names what is varied: `"localize.particles" = [200, 500, 1000]`, and for random and sobol also'
        " ranges, `{low = 100, high = 5000, log = true, integer = true}`. With `[[configurations]]` each of them is swept."
    )
    lines = [
        "# Manifests of a batch",
        "",
        NOTE,
        "",
        intro,
        *_settings(Manifest, (), 2),
        "",
        *_table(("table", "meaning"), rows),
    ]
    return "\n".join([*lines, "", "## `[sweep]`", *_settings(Sweep, (), 3), "", over]) + "\n"


def _settings(cls: type[Any], key: tuple[str, ...], level: int) -> Iterator[str]:
    """The table of a settings class, then everything below it."""
    hints = typing.get_type_hints(cls)
    fields = dataclasses.fields(cls)
    plain = [
        f for f in fields if not {"registry", "tables"} & {*f.metadata} and not dataclasses.is_dataclass(hints[f.name])
    ]
    rows = [(f"`{'.'.join((*key, f.name))}`", _default(f), _range(f, hints[f.name]), f.metadata["doc"]) for f in plain]
    yield from ("", *_table(("setting", "default", "range", "meaning"), rows)) if rows else ("", "No settings.")
    for f in (f for f in plain if "choice" in f.metadata):
        choices = [
            (f"`{name}`", _one_line(inspect.getdoc(entry) or "")) for name, entry in f.metadata["choice"].items()
        ]
        yield from ("", f"{'#' * level} `{'.'.join((*key, f.name))}`", "", _sentence(f), "")
        yield from _table(("name", "what it does"), choices)
    for f in (f for f in fields if f not in plain):
        here = (*key, f.name)
        yield from ("", f"{'#' * level} `{_table_header(f, here)}`", "", _sentence(f))
        if "registry" not in f.metadata:
            yield from _settings(f.metadata.get("tables", hints[f.name]), here, level + 1)
            continue
        registry = f.metadata["registry"]
        default = name_in(registry, f.default_factory())  # type: ignore[misc]
        yield from ("", f"One of {', '.join(f'`{name}`' for name in registry)}; default `{default}`.")
        for name, entry in registry.items():
            yield from ("", f"{'#' * (level + 1)} `{'.'.join(here)}` = `{name}`", "", inspect.getdoc(entry) or "")
            yield from _settings(entry, here, level + 2)


GROUPS = {
    "X": "Bytes and XML",
    "S": "Schema and numbers",
    "G": "Graph of links and joints",
    "E": "Geometry of elements",
    "O": "Openings and doors",
    "T": "Rooms and topology",
    "C": "Classes and labels",
    "L": "Localization",
    "P": "Portability",
    "R": "Rasters",
    "A": "Audit against a log",
}


def rules_page() -> str:
    """Every rule about maps: severity, repair, why, and an example that raises it and one that does not."""
    intro = (
        "What `wallkit map validate` checks. An error makes the exit code 1, a warning only with `--strict`. A repair is"
        " made by `wallkit map fix`: safe ones keep the meaning, moderate ones (`--fix moderate`) are most likely meant,"
        " risky ones are only shown. A group runs when the groups it waits for have no blocking error; what did not run is"
        ' told, and never counts as passed.\n\nExamples stand inside `<robot>` beside `<link name="map"/>`, unless they are'
        " whole files. Where the lines are drawn is under [rules](config.md#rules) in the settings. In a map,"
        ' `<wk:ignore rule="WK-E023" reason="..."/>` takes out findings of the element it stands in.'
    )
    lines = ["# Map rules", "", NOTE, "", intro]
    for group, waits_for in PREREQUISITES.items():
        rules = sorted((rule for rule in RULES.values() if rule.group == group), key=lambda rule: rule.code)
        if not rules:
            continue
        lines += ["", f"## {group}: {GROUPS[group]}", "", f"Waits for: {' '.join(waits_for) or 'nothing'}.", ""]
        rows = [(f"[{r.code}](#{r.code.lower()})", r.severity, r.fix or "-", _cell(doc_of(r).title)) for r in rules]
        lines += _table(("rule", "severity", "repair", "what is wrong"), rows)
        for rule in rules:
            lines += _rule(rule)
    return "\n".join(lines) + "\n"


def _rule(rule: Rule) -> Iterator[str]:
    doc = doc_of(rule)
    repair = f", repair: {rule.fix}" if rule.fix else ""
    yield from ("", f"### {rule.code}", "", f"{_cell(doc.title)} *{rule.severity}{repair}*")
    if doc.why:
        yield from ("", _cell(doc.why))
    for word, example in (("Bad", doc.bad), ("Good", doc.good)):
        kind = "xml" if is_file(example) else "yaml" if rule.group == "R" else ""
        if kind:
            yield from ("", f"{word}:", "", f"```{kind}", *example.splitlines(), "```")
        elif example:
            yield from ("", f"{word}: {_cell(' '.join(example.split()))}")


def _cell(text: str) -> str:
    """Words with what looks like a tag or an expression as code, so that Markdown shows it."""
    return re.sub(r"<[!/?]?[\w:.-]+[^<>]*>|<!DOCTYPE|\$\{\w+\}|\*\.[\w.]+", lambda match: f"`{match[0]}`", text)


def _default(f: dataclasses.Field[Any]) -> str:
    value = f.default
    return f"`{json.dumps(list(value) if isinstance(value, tuple) else value)}`"


def _range(f: dataclasses.Field[Any], hint: Any) -> str:
    if typing.get_origin(hint) is typing.Literal or "choice" in f.metadata:
        return ", ".join(f"`{name}`" for name in f.metadata.get("choice") or typing.get_args(hint))
    low, high = f.metadata["low"], f.metadata["high"]
    if low is not None or high is not None:
        return f"{low} to {high}" if None not in (low, high) else f"≥ {low}" if high is None else f"≤ {high}"
    return {bool: "`true`, `false`", str: "text", float: "any number"}.get(hint, "list")


def _sentence(f: dataclasses.Field[Any]) -> str:
    text = str(f.metadata["doc"])
    return f"{text[0].upper()}{text[1:]}."


def _example(paragraph: str) -> list[str]:
    title, *rest = paragraph.removeprefix("\b").strip("\n").splitlines()
    return [title, "", "```text", *(line.removeprefix("  ") for line in rest), "```"]


def _one_line(text: str) -> str:
    return " ".join(text.split("\n\n")[0].split())


def _table(headers: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    return [f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in _with_rule(headers, rows)]


def _with_rule(headers: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    return [headers, tuple("---" for _ in headers), *rows]


PAGES = {
    "cli.md": cli_page,
    "config.md": config_page,
    "map-rules.md": rules_page,
    "scenario.md": scenario_page,
    "batch.md": manifest_page,
}


def main(is_check: bool) -> int:
    """Write the pages, or say which are stale."""
    stale = []
    for name, page in PAGES.items():
        path, text = REFERENCE / name, page()
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            continue
        stale.append(name)
        if not is_check:
            path.write_text(text, encoding="utf-8", newline="\n")
    if is_check and stale:
        print(f"stale: {', '.join(stale)}; run `python docs/build.py`", file=sys.stderr)
    return 1 if is_check and stale else 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
