"""What every command shares: exit codes, flags that mean the same everywhere, and where words go."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import click

from wallkit.errors import WallkitError

OK, FAILED_CHECK, UNABLE, DATA_LOST, CANNOT_TELL, INTERRUPTED = 0, 1, 2, 3, 4, 130

F = TypeVar("F", bound=Callable[..., Any])


class WallkitGroup(click.Group):
    """The whole mapping from what happened to an exit code.

    A bug ends with 2 and a traceback, never with 1: a crash must not look like a verdict on the user's data.
    """

    def main(self, *args: Any, **kwargs: Any) -> Any:
        try:
            with _terminated_as_by_ctrl_c():
                code = super().main(*args, **{**kwargs, "standalone_mode": False})
        # click.exceptions.Exit is a RuntimeError, so it comes before the bugs
        except click.exceptions.Exit as request:
            code = request.exit_code
        except (click.Abort, KeyboardInterrupt):
            click.echo("Interrupted", err=True)
            code = INTERRUPTED
        except click.ClickException as error:
            error.show()
            code = UNABLE
        except WallkitError as error:
            click.echo(f"Error: {error}", err=True)
            code = error.exit_code
        except BrokenPipeError:
            # the reader of our output has seen enough; nothing more can be said to it
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            code = OK
        except Exception:  # noqa: BLE001  a bug: say so, and do not look like a verdict
            traceback.print_exc()
            click.echo("This is a bug in wallkit, not in your data: please report it with the lines above.", err=True)
            code = UNABLE
        sys.exit(code if isinstance(code, int) else OK)


@contextlib.contextmanager
def _terminated_as_by_ctrl_c() -> Iterator[None]:
    """SIGTERM, which schedulers and services send before they kill, ends a command as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


class Number(click.FloatRange):
    """A finite number, in a range if one is given: click lets "nan" through, as it is beyond no end."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is no finite number.", param, ctx)
        return number

    def _describe_range(self) -> str:
        """For the help; click describes a range without ends as well."""
        return "" if self.min is None and self.max is None else super()._describe_range()


CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}

out_option = click.option("-o", "--out", type=click.Path(path_type=Path), metavar="PATH", help="Where the results go.")
overwrite_option = click.option("--overwrite", is_flag=True, help="Replace results that are already there.")
config_option = click.option(
    "-c",
    "--config",
    "config_path",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Settings; else ./wallkit.toml.",
)
set_option = click.option(
    "-s", "--set", "words", multiple=True, metavar="KEY=VALUE", help="Change one setting (repeatable)."
)
seed_option = click.option("--seed", type=int, default=0, show_default=True, help="Seed of every random choice.")
json_option = click.option("--json", "as_json", is_flag=True, help="One JSON document on stdout.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="No progress and no warnings.")
dry_run_option = click.option("--dry-run", is_flag=True, help="Check everything, say what would be done, do nothing.")
color_option = click.option(
    "--color",
    type=click.Choice(["auto", "always", "never"]),
    default="auto",
    show_default=True,
    help="Coloured output.",
)


def options(*decorators: Callable[[F], F]) -> Callable[[F], F]:
    """Several option decorators as one, shown in the order given."""

    def apply(command: F) -> F:
        for decorator in reversed(decorators):
            command = decorator(command)
        return command

    return apply


def pixel_size(ctx: click.Context, option: click.Parameter, text: str) -> tuple[int, int]:
    """Callback of a `--size WxH`: (width, height)."""
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise click.BadParameter(f"'{text}' is no size; write it as {option.default}")
    return int(width), int(height)


# what changes no result, or only where it goes
_NOT_REMEMBERED = {"out", "overwrite", "as_json", "quiet", "dry_run", "report", "ros", "write"}


def typed(ctx: click.Context) -> str:
    """The command as typed, for a result to remember: without where it was written, and without places of this machine."""
    import shlex

    from wallkit.pipelines.provenance import portable

    words = ["wallkit", "calib", str(ctx.info_name)]
    for option in ctx.command.params:
        name = str(option.name)
        if name in _NOT_REMEMBERED or ctx.get_parameter_source(name) is not click.core.ParameterSource.COMMANDLINE:
            continue
        value = ctx.params[name]
        values = value if isinstance(value, tuple) else (value,)
        for one in values:
            flag = [max(option.opts, key=len)] if isinstance(option, click.Option) else []
            words += flag if one is True else [*flag, portable(str(one))]
    return shlex.join(words)


def emit(document: dict[str, Any]) -> None:
    """One JSON document on stdout; numbers that do not exist are null."""
    click.echo(json.dumps({"schema": 1, **plain(document)}, indent=2, allow_nan=False))


def plain(value: Any) -> Any:
    """The value as JSON knows it: NaN and infinity become null, paths text, NumPy numbers Python's."""
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(inner) for inner in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def warn(text: str, *, quiet: bool = False) -> None:
    """A warning on stderr."""
    if not quiet:
        click.echo(f"warning: {text}", err=True)


def console(color: str = "auto", *, stderr: bool = False) -> Any:
    """A rich console that obeys --color, NO_COLOR and the terminal, and never wraps what goes into a file."""
    from rich.console import Console

    force = {"always": True, "never": False}.get(color)
    return Console(
        stderr=stderr,
        force_terminal=force,
        no_color=color == "never" or (color == "auto" and bool(os.environ.get("NO_COLOR"))),
        highlight=False,
        soft_wrap=True,
    )


def table(headers: list[str], rows: list[list[str]], *, right: tuple[int, ...] = ()) -> str:
    """Aligned plain text; the columns in `right` are aligned to the right."""
    cells = [headers, *rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(headers))]
    lines = []
    for row in cells:
        aligned = [c.rjust(w) if i in right else c.ljust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join(aligned).rstrip())
    return "\n".join(lines)


@contextlib.contextmanager
def progress(what: str, total: int | None, *, quiet: bool) -> Iterator[Callable[[int], None]]:
    """A callback for the number done: a bar with rate and time left on a terminal, else a line per 10 %."""
    if quiet:
        yield lambda done: None
    elif sys.stderr.isatty():
        with _bar(what, total) as update:
            yield update
    else:
        yield _lines(what, total)


@contextlib.contextmanager
def _bar(what: str, total: int | None) -> Iterator[Callable[[int], None]]:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    speed = TextColumn("{task.speed:,.0f}/s") if total is None else TextColumn("{task.fields[rate]}")
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        speed,
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total, rate="")
        began = shown = time.monotonic()

        def update(done: int) -> None:
            nonlocal shown
            now = time.monotonic()
            if now - shown > 0.1 or done == total:
                shown = now
                bar.update(task, completed=done, rate=f"{done / max(now - began, 1e-3):,.0f}/s")

        yield update


def _lines(what: str, total: int | None) -> Callable[[int], None]:
    began = time.monotonic()
    said = 0

    def update(done: int) -> None:
        nonlocal said
        tenths = 10 * done // total if total else 0
        if total and tenths > said and time.monotonic() - began > 2:
            said = tenths
            rate = done / (time.monotonic() - began)
            click.echo(f"{what}: {10 * tenths} % ({done} of {total}, {rate:,.0f}/s)", err=True)

    return update
