"""Every number on a command line is finite: click lets "nan" through any range."""

from __future__ import annotations

from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner

from wallkit.cli.app import main
from wallkit.cli.common import Number


def floats(command: click.Command, name: str = "wallkit") -> Iterator[tuple[str, click.Parameter]]:
    """Parameters that take a number, with what they are of."""
    yield from (
        (f"{name} {param.name}", param)
        for param in command.params
        if isinstance(param.type, click.types.FloatParamType)
    )
    for word, inner in getattr(command, "commands", {}).items():
        yield from floats(inner, f"{name} {word}")


def test_no_command_takes_numbers_that_are_none():
    found = dict(floats(main))
    assert len(found) > 20
    assert [name for name, param in found.items() if not isinstance(param.type, Number)] == []


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e999", "x"])
def test_what_is_no_finite_number_is_refused(word):
    @click.command()
    @click.option("--share", type=Number(0, 1))
    @click.option("--height", type=Number())
    def command(share, height):
        click.echo(f"{share} {height}")

    for flag in ("--share", "--height"):
        done = CliRunner().invoke(command, [flag, word])
        assert done.exit_code == 2, done.output
        assert f"Invalid value for '{flag}'" in done.output
    assert CliRunner().invoke(command, ["--share", "0.5", "--height", "-3"]).output == "0.5 -3.0\n"
    text = CliRunner().invoke(command, ["--help"]).output
    assert "0<=x<=1" in text
    assert "None" not in text
