"""The installed command in a subprocess: only exit code, streams and files are looked at."""

from __future__ import annotations

import json
import subprocess
import sys
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


@pytest.fixture
def wallkit(tmp_path):
    """Runs `wallkit WORDS...` in a folder of its own; `cwd` names another."""

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
