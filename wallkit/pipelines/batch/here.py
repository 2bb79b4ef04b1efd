"""A run whose inputs lie elsewhere -> the same run over copies on this machine, and texts that name them as the user did."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from wallkit.pipelines.batch import remote
from wallkit.pipelines.batch.copies import fetched
from wallkit.pipelines.batch.files import path_of
from wallkit.pipelines.batch.plan import Task


@dataclass(frozen=True)
class Here:
    """A run as it can be done on this machine.

    Attributes:
        copies: path on this machine by address.
    """

    task: Task
    copies: Mapping[str, Path]

    def as_written(self, text: str) -> str:
        """A text or JSON document with addresses instead of the paths of their copies."""
        for url, path in self.copies.items():
            # what belongs to a file lies beside it
            for there, here in ((url.rstrip("/"), path), (remote.beside(url.rstrip("/"), ""), path.parent)):
                for words in (json.dumps(str(here))[1:-1], str(here)):
                    text = text.replace(words, there.rstrip("/"))
        return text


def here(task: Task) -> Here:
    """The run over copies; those that are missing are fetched.

    Raises:
        WallkitError: see copies.fetched.
    """
    if not task.remote:
        return Here(task, {})
    cache = task.manifest.cache and str(Path(task.home) / path_of(task.manifest.cache))
    copies = {copied.url: fetched(copied, cache) for copied in task.remote}

    def local(word: str) -> str:
        return str(copies.get(word, word))

    m = task.manifest
    over = replace(
        task,
        log=local(task.log),
        map=local(task.map),
        calibrations=tuple(local(word) for word in task.calibrations),
        truth=local(task.truth),
        model=local(task.model),
        manifest=replace(m, board=local(m.board), robot=local(m.robot)),
    )
    return Here(over, copies)
