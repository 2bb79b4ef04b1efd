"""Every command and every flag that a text of the program names is there."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

import wallkit
from wallkit.cli.app import main

PACKAGE = Path(wallkit.__file__).parent
_COMMAND = re.compile(r"\bwallkit((?: [a-z][a-z-]*)+)([^;`]*)")
# what is told of another program, up to the end of the sentence
_OTHERS = re.compile(r"\b(?:apt-get|pip|dask) [^;]*")
# commands and flags of rooms that are being built; each goes from here when it lands
COMING = {
    "calib from-urdf",
    "calib intrinsics",
    "calib extrinsics",
    "calib verify",
    "--board",
    "--image",
    "--model",
}
_FLAG = re.compile(r"(?<![\w-])--[a-z][a-z-]+")


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """The strings of a module without its docstrings, with their lines; what is filled in stands as `{}`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield node.lineno, "".join(str(p.value) if isinstance(p, ast.Constant) else "{}" for p in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (inside | said):
            yield node.lineno, node.value


def flags_of(command: click.Command) -> set[str]:
    own = {word for param in command.params for word in (*param.opts, *param.secondary_opts)}
    below = command.commands.values() if isinstance(command, click.Group) else ()
    return own.union(*(flags_of(part) for part in below), {"--help"})


def wrong(text: str, known: set[str]) -> Iterator[str]:
    """The words of a text that name no command, or a flag that its command lacks."""
    for words, rest in _COMMAND.findall(text):
        command: click.Command = main
        for word in words.split():
            if any(words.strip().startswith(coming) for coming in COMING):
                break
            if not isinstance(command, click.Group):
                break
            if word not in command.commands:
                # prose goes on after the program's name: "wallkit knows"
                if command is not main:
                    yield f"`wallkit{words}`: no such command"
                break
            command = command.commands[word]
        if command is not main:
            yield from (
                f"`wallkit{words}` has no {flag}" for flag in _FLAG.findall(rest) if flag not in flags_of(command)
            )
    yield from (
        f"nothing has a flag {flag}" for flag in _FLAG.findall(_OTHERS.sub("", text)) if flag not in known | COMING
    )


@pytest.mark.parametrize("room", sorted(p.name for p in PACKAGE.iterdir() if p.is_dir() and not p.name.startswith("_")))
def test_texts_name_commands_and_flags_that_exist(room: str) -> None:
    known = flags_of(main)
    found = [
        f"{path.relative_to(PACKAGE)}:{line}: {what}"
        for path in sorted((PACKAGE / room).rglob("*.py"))
        for line, text in texts(path)
        for what in wrong(text, known)
    ]
    assert not found, "\n".join(found)


def test_a_wrong_hint_is_seen() -> None:
    known = flags_of(main)
    assert list(wrong("wallkit map exprot FILE", known)) == ["`wallkit map exprot`: no such command"]
    assert "nothing has a flag --layers" in list(wrong("name them with --layers", known))
    assert list(wrong("wallkit map fix {} --corridor 2", known)) == ["`wallkit map fix` has no --corridor"]
    assert not list(wrong("wallkit map fix {} --fix moderate", known))
