"""Digests of input files, remembered between starts: a terabyte of logs is hashed once."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wallkit.pipelines.batch.files import Digests
from wallkit.pipelines.outputs import write_whole

FILE = ".digests.json"


@contextmanager
def remembered(folder: Path) -> Iterator[Digests]:
    """What is known by path: size, time of change [ns], digest; what is added in the block is kept."""
    path = folder / FILE
    try:
        known = {name: tuple(row) for name, row in json.loads(path.read_text(encoding="utf-8")).items()}
    except (OSError, ValueError):
        # only time is lost
        known = {}
    before = dict(known)
    try:
        yield known
    finally:
        if known != before:
            write_whole(path, json.dumps(known).encode())
