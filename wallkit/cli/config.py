"""`wallkit config` and `wallkit completion`: settings and the shell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wallkit.cli import common


@click.group()
def config() -> None:
    """Show and check settings."""


@config.command()
@common.config_option
@common.set_option
@common.json_option
def show(config_path: Path | None, words: tuple[str, ...], as_json: bool) -> None:
    """Print every setting with its value and where it comes from.

    \b
    Examples:
      wallkit config show
      wallkit config show --set localize.sensor=beam | grep sensor
    """
    from wallkit.core.config import table_from
    from wallkit.pipelines.config import load_config
    from wallkit.report.data import flatten

    loaded = load_config(config_path, words)
    table = table_from(loaded.config)
    if as_json:
        common.emit({"config": table, "origins": loaded.origins})
        return
    flat = flatten(table)
    rows = [[key, _toml(value), loaded.origins.get(key, "default")] for key, value in flat.items()]
    click.echo(common.table(["setting", "value", "from"], rows))


@config.command()
@click.argument("files", nargs=-1, type=click.Path(path_type=Path), metavar="[FILE]...")
@click.pass_context
def check(ctx: click.Context, /, files: tuple[Path, ...]) -> None:
    """Judge settings files; without FILE ./wallkit.toml.

    Exits 0 if all are good, 1 if one is not.

    \b
    Examples:
      wallkit config check wallkit.toml
    """
    from wallkit.errors import ConfigError
    from wallkit.pipelines.config import DEFAULT_FILE, load_config

    bad = False
    for path in files or (DEFAULT_FILE,):
        try:
            load_config(path)
        except ConfigError as error:
            click.echo(str(error))
            bad = True
        else:
            click.echo(f"{path}: good")
    if bad:
        ctx.exit(common.FAILED_CHECK)


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def completion(ctx: click.Context, /, shell: str) -> None:
    """Print the completion script of a shell.

    \b
    Examples:
      eval "$(wallkit completion bash)"
    """
    from click.shell_completion import get_completion_class

    found = get_completion_class(shell)
    if found is None:
        raise click.UsageError(f"click knows no completion for {shell}")
    click.echo(found(ctx.find_root().command, {}, "wallkit", "_WALLKIT_COMPLETE").source())


def _toml(value: Any) -> str:
    import json

    return json.dumps(value)
