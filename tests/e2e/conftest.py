"""The installed command in a process of its own: only exit code, streams and files are looked at."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest


@dataclass(frozen=True)
class Done:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@dataclass(frozen=True)
class Twig:
    """The process that forks one child for every command."""

    process: subprocess.Popen[str]
    scratch: Path

    def run(self, words: Sequence[str], cwd: Path) -> Done:
        out, err = self.scratch / "out", self.scratch / "err"
        for path in (out, err):
            path.write_bytes(b"")
        request = {"words": words, "cwd": str(cwd), "environ": dict(os.environ), "out": str(out), "err": str(err)}
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        if not select.select([self.process.stdout], [], [], 300)[0]:
            pytest.fail(f"not done after 300 s: wallkit {' '.join(words)}")
        return Done(int(self.process.stdout.readline()), out.read_text("utf-8"), err.read_text("utf-8"))


@pytest.fixture(scope="session")
def twig(tmp_path_factory) -> Iterator[Twig]:
    """Alive as long as the tests are."""
    command = [sys.executable, "-m", "tests.e2e.twig"]
    scratch = tmp_path_factory.mktemp("twig")
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8", cwd=root
    ) as process:
        yield Twig(process, scratch)
        assert process.stdin is not None
        process.stdin.close()


@pytest.fixture
def wallkit(twig, tmp_path):
    """Runs `wallkit WORDS...` in a process and a folder of its own; `cwd` names another folder."""

    def run(*words: object, cwd: Path = tmp_path) -> Done:
        return twig.run([str(word) for word in words], cwd)

    return run


@pytest.fixture
def wallkit_from_nothing(tmp_path):
    """Runs `wallkit WORDS...` in an interpreter started for it: what the imports and the end of a process do."""

    def run(*words: object, cwd: Path = tmp_path) -> Done:
        command = [sys.executable, "-c", "from wallkit.cli.app import main; main()", *(str(word) for word in words)]
        done = subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=300, check=False)
        return Done(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture(scope="session")
def board_log(tmp_path_factory) -> Path:
    """42 seconds of a board held before camera and LiDAR at 14 places."""
    from tests.e2e.board_log import stations, write_log

    path = tmp_path_factory.mktemp("calib") / "log.mcap"
    write_log(path, stations())
    return path
