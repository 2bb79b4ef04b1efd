"""A folder of results that is either whole or not there."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wallkit.errors import OutputError


def check_out(out: Path, *, overwrite: bool) -> None:
    """Refuse a place where results cannot or must not go.

    Raises:
        OutputError: it is a file, a folder with something in it (without overwrite), or cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise OutputError("is a file, not a folder", where=out, hint="choose another --out")
    if out.is_dir() and any(out.iterdir()):
        if not overwrite:
            raise OutputError("is not empty", where=out, hint="choose another --out, or pass --overwrite to replace it")
        if not (out / "run.json").is_file():
            raise OutputError(
                "is not empty and no result of wallkit: it is not replaced", where=out, hint="choose another --out"
            )
    parent = next(p for p in (out, *out.absolute().parents) if p.is_dir())
    if not os.access(parent, os.W_OK):
        raise OutputError("cannot be written", where=out, hint="choose another --out")


@contextmanager
def result_folder(out: Path, *, overwrite: bool) -> Iterator[Path]:
    """A working folder beside `out` that takes its name when the block ends, and is deleted when it fails.

    Raises:
        OutputError: see check_out.
    """
    check_out(out, overwrite=overwrite)
    working = out.absolute().with_name(f".{out.name}.partial-{os.getpid()}")
    working.mkdir(parents=True)
    try:
        yield working
    except BaseException:
        shutil.rmtree(working, ignore_errors=True)
        raise
    if out.is_dir():
        old = out.absolute().with_name(f".{out.name}.replaced-{os.getpid()}")
        out.rename(old)
        working.rename(out)
        shutil.rmtree(old)
    else:
        working.rename(out)
