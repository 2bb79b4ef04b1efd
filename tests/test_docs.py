"""The documentation says what the program does: pages are fresh, links lead somewhere, commands run, files are as told.

Fenced `sh` blocks are run from top to bottom in a folder that holds the sample as log.mcap and floor.yaml. `sh` must end
with 0, `sh exit=4` with 4; `sh yours` needs files of the reader's own and is only parsed. A block that begins with
`# name.py` or `# name.toml` is that file. A `text` block after a command is its output: the words must be the same,
numbers may differ, and `...` stands for any lines.
"""

from __future__ import annotations

import contextlib
import csv
import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import pytest

import wallkit.sample
from tests.localize import test_sensor
from tests.localize.worlds import FLAT, fields_of
from wallkit.cli.app import main
from wallkit.core.config import table_from
from wallkit.evaluate.metrics import METRICS
from wallkit.localize.sensor import SENSORS
from wallkit.logs.reader import open_log
from wallkit.pipelines.config import Config

ROOT = Path(__file__).parents[1]
SAMPLE = Path(wallkit.sample.__file__).parent
FOLDERS = ("docs/**", "maps", "calib", "evaluation", "")
PAGES = sorted(path for folder in FOLDERS for path in ROOT.glob(f"{folder}/*.md".lstrip("/")) if path.is_file())
SETTING = re.compile(r"`((?:logs|maps|segment|points|localize|evaluate|results)\.[a-z_0-9.]+)`|--set ([a-z_0-9.]+)=")
README = (ROOT / "README.md").read_text(encoding="utf-8")
WALLKIT = f'exec "{sys.executable}" -c "from wallkit.cli.app import main; main()" "$@"'


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@dataclass(frozen=True)
class Block:
    """A fenced block: what stands behind the fence, its text, and where."""

    kind: str
    text: str
    line: int

    @property
    def is_run(self) -> bool:
        return self.kind.split()[:1] == ["sh"] and "yours" not in self.kind

    @property
    def exit_code(self) -> int:
        return int(self.kind.partition("exit=")[2] or 0)


def blocks_of(page: Path) -> Iterator[Block]:
    """Fenced blocks, also those indented in a list."""
    fence, kind, begin, lines = "", "", 0, []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        opening = re.match(r"( *)```(.*)$", line)
        if not opening:
            lines.append(line.removeprefix(fence))
        elif begin:
            yield Block(kind, "\n".join(lines) + "\n", begin)
            begin = 0
        else:
            fence, kind, begin, lines = opening[1], opening[2].strip(), number, []


GUIDES = [page for page in PAGES if page.is_relative_to(ROOT / "docs") and any(b.is_run for b in blocks_of(page))]


# -------------------------------------------------------------------------------------------- references are fresh


def test_generated_pages_are_fresh():
    done = subprocess.run(
        [sys.executable, ROOT / "docs/build.py", "--check"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def commands(command: click.Command, words: str) -> Iterator[tuple[str, click.Command]]:
    yield words, command
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            yield from commands(inner, f"{words} {name}")


@pytest.mark.parametrize(("words", "command"), list(commands(main, "wallkit")), ids=lambda value: str(value))
def test_every_command_and_option_is_in_the_reference(words, command):
    page = (ROOT / "docs/reference/cli.md").read_text(encoding="utf-8")
    chapter = re.search(rf"^## `{re.escape(words)}`$(.*?)(?=^## |\Z)", page, re.M | re.S)
    assert chapter, f"{words} has no chapter"
    for parameter in command.params:
        if isinstance(parameter, click.Option) and parameter.name not in ("help", "version"):
            assert all(option in chapter[1] for option in parameter.opts), f"{words} {parameter.opts}"


def test_every_setting_is_in_the_reference():
    page = (ROOT / "docs/reference/config.md").read_text(encoding="utf-8")

    def keys(table: dict[str, object], prefix: str) -> Iterator[str]:
        for key, value in table.items():
            if isinstance(value, dict):
                yield from keys(value, f"{prefix}{key}.")
            elif key != "name":
                yield f"{prefix}{key}"

    for key in keys(table_from(Config()), ""):
        assert f"`{key}`" in page, key


def test_the_readme_names_every_command():
    for name in main.commands:
        assert re.search(rf"`wallkit {name}\b", README), name


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_setting_that_is_named_exists(page):
    """Settings of one alternative of a part (localize.sensor.beams) are in the reference, but not among the defaults."""
    pages = ("config.md", "scenario.md", "batch.md")
    reference = "".join((ROOT / "docs/reference" / name).read_text(encoding="utf-8") for name in pages)
    named = {key for found in SETTING.findall(page.read_text(encoding="utf-8")) for key in found if key}
    # the setting that the guide's own sensor model brings along
    named -= {"localize.sensor.scale_m"} if page.name == "add-a-sensor-model.md" else set()
    assert not [key for key in named if f"`{key}`" not in reference and f"`[{key}]`" not in reference]


# ------------------------------------------------------------------------------------------------- links and words


def anchors_of(page: Path) -> set[str]:
    """The anchors GitHub makes of a page's headings."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    titles = re.findall(r"^#+ (.*)$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_relative_links_lead_somewhere(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        at = (page.parent / file).resolve() if file else page
        assert at.exists(), f"{name_of(page)} links to {target}"
        if anchor and at.suffix == ".md":
            assert anchor in anchors_of(at), f"{name_of(page)} links to {target}"


def test_every_page_of_the_documentation_is_in_its_index():
    index = (ROOT / "docs/README.md").read_text(encoding="utf-8")
    for page in (path for path in PAGES if path.is_relative_to(ROOT / "docs") and "benchmarks" not in path.parts):
        name = page.relative_to(ROOT / "docs").as_posix()
        assert name == "README.md" or f"({name})" in index, name


def wallkit_lines(page: Path) -> Iterator[tuple[int, list[str]]]:
    """Every command line of a page that begins with `wallkit`, as words."""
    for block in blocks_of(page):
        if not block.kind.startswith("sh"):
            continue
        for offset, line in enumerate(block.text.replace("\\\n", "").splitlines(), start=1):
            words = shlex.split(line.strip().removeprefix("$ "), comments=True)
            if words[:1] == ["PYTHONPATH=."]:
                words = words[1:]
            if words[:1] == ["wallkit"]:
                end = next((i for i, word in enumerate(words) if word in ("|", ">", "&&", ";")), len(words))
                yield block.line + offset, words[1:end]


@pytest.mark.parametrize("page", [page for page in PAGES if any(wallkit_lines(page))], ids=name_of)
def test_every_command_line_can_be_parsed(page):
    for line, words in wallkit_lines(page):
        command: click.Command = main
        while isinstance(command, click.Group) and words and words[0] in command.commands:
            command, words = command.commands[words[0]], words[1:]
        try:
            with contextlib.suppress(click.exceptions.Exit):
                command.make_context("wallkit", list(words))
        except click.ClickException as error:
            pytest.fail(f"{name_of(page)}:{line}: {error.format_message()}")


# ------------------------------------------------------------------------------------------------ the README's commands


def readme_command(end: str) -> list[str]:
    """The parts of the README's indented command that ends with the given words, as .ci/run finds it."""
    found = re.findall(rf"^    (python3 -m venv .*{re.escape(end)}).*$", README, re.M)
    assert len(found) == 1
    return found[0].split(" && ")


@pytest.mark.long
def test_the_readmes_demo_command_runs(tmp_path):
    *_, install, demo = readme_command("wallkit demo")
    assert install == "pip install ."
    done = run(demo, tmp_path)
    assert (done.returncode, done.stdout.splitlines()[-1].split()) == (0, ["verdict", "as", "expected"])
    assert (tmp_path / "wallkit-demo" / "report.html").is_file()
    shown = [b for b in blocks_of(ROOT / "README.md") if b.kind == "text" and "verdict" in b.text]
    assert len(shown) == 1
    assert_same_words(shown[0].text, done.stdout)


def test_the_readmes_test_command_installs_what_the_tests_need():
    *_, install, test = readme_command("pytest -q")
    assert (install, test) == ("pip install '.[test]'", "pytest -q")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {
        "pytest",
        "pytest-xdist",
        "ezdxf",
        "mujoco",
        "hypothesis",
        "onnx",
        "ruff",
        "mypy",
        "dask",
        "distributed",
        "fsspec[http]",
    } == {re.split(r"[<>=]", name)[0] for name in project["optional-dependencies"]["test"]}


# -------------------------------------------------------------------------------------------------------- guides run


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command line in a shell whose `wallkit` is the one under test."""
    programs = folder.parent / f"{folder.name}-bin"
    if not programs.exists():
        programs.mkdir()
        for name, line in (("wallkit", WALLKIT), ("python", f'exec "{sys.executable}" "$@"')):
            (programs / name).write_text(f"#!/bin/sh\n{line}\n")
            (programs / name).chmod(0o755)
    env = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "200"}
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command], cwd=folder, env=env, capture_output=True, text=True, check=False
    )


def words_of(text: str) -> list[list[str]]:
    """Lines as words, every number replaced by 0, empty lines left out."""
    lines = [re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "0", line).split() for line in text.splitlines()]
    return [[word for word in line if word != "*"] for line in lines if line]


def assert_same_words(shown: str, said: str) -> None:
    """Each shown line follows the one before it; what `...` stands for may lie between them."""
    rest = words_of(said)
    may_skip = False
    for line in words_of(shown):
        if line == ["..."]:
            may_skip = True
            continue
        at = rest.index(line) if line in rest else -1
        assert at >= 0, f"{' '.join(line)!r} is not in the output:\n{said}"
        assert may_skip or at == 0, f"{' '.join(line)!r} is not the next line of the output:\n{said}"
        rest, may_skip = rest[at + 1 :], False
    assert may_skip or not rest, f"the page leaves out {rest}"


def follow(page: Path, folder: Path) -> None:
    """Do what a page says, in a folder with the sample as log.mcap and floor.yaml."""
    shutil.copy(SAMPLE / "log.mcap", folder / "log.mcap")
    shutil.copy(SAMPLE / "map.pgm", folder / "map.pgm")
    shutil.copy(SAMPLE / "map.yaml", folder / "floor.yaml")
    said = None
    for block in blocks_of(page):
        file = re.match(r"# ([\w.]+\.(py|toml))\n", block.text)
        if file:
            (folder / file[1]).write_text(block.text)
        elif block.is_run:
            done = run(block.text, folder)
            assert done.returncode == block.exit_code, f"{name_of(page)}:{block.line}:\n{done.stdout}{done.stderr}"
            said = done.stdout
        elif block.kind == "text" and said is not None:
            assert_same_words(block.text, said)
            said = None


@pytest.mark.guide
@pytest.mark.parametrize("page", GUIDES, ids=name_of)
def test_a_guide_can_be_followed(page, tmp_path):
    folder = tmp_path / "here"
    folder.mkdir()
    follow(page, folder)


def test_the_sensor_model_of_the_guide_keeps_the_contract(tmp_path, monkeypatch):
    """The very tests that run over SENSORS, on the model a reader would paste."""
    (code,) = [b.text for b in blocks_of(ROOT / "docs/how-to/add-a-sensor-model.md") if "# my_sensor.py" in b.text]
    path = tmp_path / "my_sensor.py"
    path.write_text(code)
    spec = importlib.util.spec_from_file_location("my_sensor", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "my_sensor", module)
    spec.loader.exec_module(module)
    monkeypatch.setitem(SENSORS, "cauchy_field", module.CauchyField)
    contract = test_sensor.TestContract()
    tests = [name for name in dir(contract) if name.startswith("test_")]
    assert len(tests) >= 5
    for name in tests:
        getattr(contract, name)("cauchy_field", fields_of(FLAT))


# -------------------------------------------------------------------------------------- the files are as they are told


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A result folder of the sample."""
    folder = tmp_path_factory.mktemp("formats") / "here"
    folder.mkdir()
    done = run(f'wallkit localize "{SAMPLE}/log.mcap" --map "{SAMPLE}/map.yaml" --out run -q', folder)
    assert done.returncode == 0, done.stderr
    return folder / "run"


FORMATS = ROOT / "docs/reference/formats.md"


def coded(page: Path) -> set[str]:
    """Everything a page sets in code."""
    return set(re.findall(r"`([^`\n]+)`", page.read_text(encoding="utf-8")))


def test_every_file_of_a_run_is_described(result):
    assert {path.name for path in result.iterdir()} <= coded(FORMATS)


@pytest.mark.parametrize("name", ["run.json", "metrics.json"])
def test_every_key_of_a_document_is_described(result, name):
    known = coded(FORMATS)
    document = json.loads((result / name).read_text())
    missing = set(document) - known
    for inner in ("pose", "inputs", "machine"):
        part = document.get(inner, {})
        missing |= set(part[0] if isinstance(part, list) else part) - known
    assert not missing


def test_every_metric_is_described():
    assert set(METRICS) <= coded(FORMATS)


def test_every_column_of_the_steps_is_described(result):
    with (result / "steps.csv").open(newline="") as file:
        assert set(next(csv.reader(file))) <= coded(FORMATS)


def test_every_topic_of_the_result_is_described_with_its_type(result):
    page = FORMATS.read_text(encoding="utf-8")
    for channel in open_log([result / "result.mcap"]).channels:
        row = re.search(rf"^\| `{re.escape(channel.topic)}`.*$", page, re.M)
        assert row, channel.topic
        assert channel.type_name.split("/")[-1] in row[0], channel.type_name
