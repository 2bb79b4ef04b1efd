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
