"""Shared fixtures: where the real data lies."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of real logs, maps and captures, named by WALLKIT_TEST_DATA."""
    folder = os.environ.get("WALLKIT_TEST_DATA", "")
    if folder and Path(folder).is_dir():
        return Path(folder)
    reason = f"WALLKIT_TEST_DATA={folder!r} names no folder of real data"
    if os.environ.get("WALLKIT_REQUIRE_DATA") == "1":
        pytest.fail(reason)
    pytest.skip(reason)
