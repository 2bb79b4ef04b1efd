"""Files and folders of results that are either whole or not there."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
    put_in_place(working, out)


def put_in_place(working: Path, out: Path) -> None:
    """Gives a finished folder the name `out`; what was there goes only once it does, and is put back if it cannot.

    Raises:
        OutputError: it cannot be moved there; both folders are as they were.
    """
    old = out.absolute().with_name(f".{out.name}.replaced-{os.getpid()}")
    try:
        if out.is_dir():
            out.rename(old)
        working.rename(out)
    except OSError as error:
        if old.is_dir():
            old.rename(out)
        raise OutputError(
            f"cannot be written: {error.strerror}", where=out, hint=f"the result is in {working}: move it yourself"
        ) from error
    if old.is_symlink():
        old.unlink()
    elif old.is_dir():
        shutil.rmtree(old)


def check_file_out(out: Path, *, overwrite: bool) -> None:
    """Refuse a file that is there already, or a place that cannot be written.

    Raises:
        OutputError: it exists (without overwrite), is a folder, or its folder is not there.
    """
    if out.is_dir():
        raise OutputError("is a folder, not a file", where=out, hint="give the name of a file")
    if out.exists() and not overwrite:
        raise OutputError("exists", where=out, hint="choose another name, or pass --overwrite to replace it")
    if not out.absolute().parent.is_dir():
        raise OutputError("cannot be written: its folder does not exist", where=out, hint=f"mkdir -p {out.parent}")


def write_whole(path: Path, data: bytes) -> None:
    """Replace a file in one step, keeping its permissions; a link stays a link.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_file(path) as working:
        working.write_bytes(data)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file to write beside another, whose place it takes when the block ends; see write_whole.

    Raises:
        OutputError: it cannot be written.
    """
    target = path.resolve()
    working = target.with_name(f".{target.name}.partial-{os.getpid()}")
    try:
        yield working
        if target.exists():
            working.chmod(target.stat().st_mode)
        working.replace(target)
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror}", where=path, hint="choose another place") from error
    finally:
        with suppress(OSError):
            working.unlink(missing_ok=True)
