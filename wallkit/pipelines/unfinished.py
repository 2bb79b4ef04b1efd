"""The folder of an interrupted run -> whether it is of this request, else what differs, so that no work is lost."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wallkit.errors import OutputError
from wallkit.pipelines.run_folder import write_json

_REQUEST = "request.json"


@dataclass(frozen=True)
class Unfinished:
    """Where a long run works until its results take their name.

    Attributes:
        folder: beside the result. what: is interrupted, in a word. work: glob of what is done in it, and would be lost.
    """

    folder: Path
    what: str
    work: str

    @property
    def has_begun(self) -> bool:
        """Whether something in it would be lost."""
        return any(self.folder.glob(self.work))

    def check(self, wanted: Mapping[str, Any], *, overwrite: bool) -> None:
        """Refuse to throw away the work of another request.

        Raises:
            OutputError: it is of another request (without overwrite).
        """
        if overwrite or not self.has_begun:
            return
        other = _differences(self._request, wanted)
        if other:
            hint = (
                "give the same settings to go on, choose another --out, or pass --overwrite to delete it and start anew"
            )
            said = f"holds an interrupted {self.what} of other settings: {other}"
            raise OutputError(said, where=self.folder, hint=hint)

    def open(self, wanted: Mapping[str, Any]) -> None:
        """Make the folder ready to go on; what is in there of another request is deleted: see `check`."""
        if not self.has_begun or _differences(self._request, wanted):
            shutil.rmtree(self.folder, ignore_errors=True)
            self.folder.mkdir(parents=True)
            write_json(self.folder / _REQUEST, dict(wanted))

    @contextmanager
    def kept_if_begun(self) -> Iterator[None]:
        """Deletes the folder when the block fails before there is anything to go on from."""
        try:
            yield
        except BaseException:
            if not self.has_begun:
                shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def close(self) -> None:
        """Deletes what only a run that goes on needs."""
        for path in (self.folder / _REQUEST, *self.folder.glob(self.work)):
            path.unlink()

    @property
    def _request(self) -> Mapping[str, Any]:
        try:
            found = json.loads((self.folder / _REQUEST).read_text("utf-8"))
        except (OSError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}


def unfinished_of(out: Path, what: str, work: str) -> Unfinished:
    """The one of a result: a hidden folder beside it."""
    return Unfinished(out.absolute().with_name(f".{out.name}.unfinished"), what, work)


# -------------------------------------------------------------------------------------------- details


def _differences(was: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    """Every setting that is another one, as "epochs 30, now 60"; "" for none."""
    before, now = _flat(was), _flat(wanted)
    keys = [key for key in {**before, **now} if before.get(key) != now.get(key)]
    return "; ".join(f"{key} {before.get(key, 'unknown')}, now {now.get(key, 'none')}" for key in keys)


def _flat(document: Mapping[str, Any]) -> dict[str, str]:
    """The settings by name, with values as a person reads them."""
    found: dict[str, str] = {}
    for key, value in document.items():
        found |= _flat(value) if isinstance(value, dict) else {key: _text(value)}
    return found


def _text(value: Any) -> str:
    if isinstance(value, list | dict):
        return " ".join(map(_text, value.values() if isinstance(value, dict) else value))
    # of a hash so much as tells two apart
    return re.sub(r"\b([0-9a-f]{8})[0-9a-f]{56}\b", r"\1", str(value))
