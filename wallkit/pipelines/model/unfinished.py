"""The folder of an interrupted training -> whether it is of this request, else what differs, so that no epoch is lost."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from wallkit.errors import OutputError
from wallkit.pipelines.run_folder import write_json

_REQUEST, _CHECKPOINT = "request.json", "checkpoint.pt"


def unfinished_folder(out: Path) -> Path:
    """Where a training works until its results take the name `out`."""
    return out.absolute().with_name(f".{out.name}.unfinished")


def has_epochs(working: Path) -> bool:
    """Whether epochs were done in it, which would be lost."""
    return (working / _CHECKPOINT).is_file()


def check_unfinished(working: Path, wanted: Mapping[str, Any], *, overwrite: bool) -> None:
    """Refuse to throw away the epochs of another training.

    Raises:
        OutputError: it is of another request (without overwrite).
    """
    if overwrite or not has_epochs(working):
        return
    other = _differences(_request_of(working), wanted)
    if other:
        hint = "give the same settings to go on, choose another --out, or pass --overwrite to delete it and start anew"
        raise OutputError(f"holds an interrupted training of other settings: {other}", where=working, hint=hint)


def open_unfinished(working: Path, wanted: Mapping[str, Any]) -> Path:
    """The checkpoint's path in the folder; what is in there of another request is deleted: see check_unfinished."""
    if not has_epochs(working) or _differences(_request_of(working), wanted):
        shutil.rmtree(working, ignore_errors=True)
        working.mkdir(parents=True)
        write_json(working / _REQUEST, dict(wanted))
    return working / _CHECKPOINT


@contextmanager
def kept_if_begun(working: Path) -> Iterator[None]:
    """Deletes the folder when the block fails before there is an epoch to go on from."""
    try:
        yield
    except BaseException:
        if not has_epochs(working):
            shutil.rmtree(working, ignore_errors=True)
        raise


def close_unfinished(working: Path) -> None:
    """Deletes what only a training that goes on needs."""
    (working / _CHECKPOINT).unlink()
    (working / _REQUEST).unlink()


# -------------------------------------------------------------------------------------------- details


def _request_of(working: Path) -> Mapping[str, Any]:
    try:
        found = json.loads((working / _REQUEST).read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _differences(was: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    """Every setting that is another one, as "epochs 30, now 60"; "" for none."""
    before, now = _flat(was), _flat(wanted)
    keys = [key for key in {**before, **now} if before.get(key) != now.get(key)]
    return "; ".join(f"{key} {before.get(key, 'unknown')}, now {now.get(key, 'none')}" for key in keys)


def _flat(document: Mapping[str, Any]) -> dict[str, str]:
    """The settings by name, with values as a person reads them."""
    found: dict[str, str] = {}
    for key, value in document.items():
        if isinstance(value, dict):
            found |= _flat(value)
        elif key == "datasets":
            found[key] = " ".join(f"{one['folder']} ({one['manifest_sha256'][:8]})" for one in value)
        else:
            found[key] = " ".join(map(str, value)) if isinstance(value, list) else str(value)
    return found
