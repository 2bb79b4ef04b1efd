"""Rows of the ceiling's study <-> a CSV file that grows row by row, so that a study that was stopped goes on."""

from __future__ import annotations

import csv
import io
import types
import typing
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import OutputError
from wallkit.pipelines.bench.ceiling import Outcome, Row, Task
from wallkit.pipelines.outputs import write_whole

_TRACK = ["t_s", "x_m", "y_m", "error_m", "error_deg", "share_near"]


def read_rows(path: Path) -> list[Row]:
    """The rows of a file; none where there is no file.

    Raises:
        OutputError: it holds something else.
    """
    if not path.exists():
        return []
    kinds = typing.get_type_hints(Row)
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [
                Row(**{name: _value(kind, line[name]) for name, kind in kinds.items()}) for line in csv.DictReader(file)
            ]
    except (KeyError, ValueError, TypeError) as error:
        raise OutputError(
            f"holds no rows of `wallkit bench ceiling`: {error}", where=path, hint="choose another --rows"
        ) from None


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """The file, whole or not there."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(Row)], lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _text(value) for name, value in asdict(row).items()})
    write_whole(path, text.getvalue().encode())


def write_track(path: Path, stamps_ns: Any, truth: Float64Array, done: Sequence[Outcome]) -> None:
    """A line per view: where the robot truly was, the median errors of all runs there, and the share of them near."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_TRACK)
    errors = np.median([one.errors for one in done], axis=0)
    near = np.mean([one.is_near for one in done], axis=0)
    seconds = (stamps_ns - stamps_ns[0]) / 1e9
    for t, pose, error, share in zip(seconds, truth, errors, near, strict=True):
        cells = (t, pose[0], pose[1], error[0], np.rad2deg(error[1]), share)
        writer.writerow([f"{cell:.3f}" for cell in cells])
    write_whole(path, text.getvalue().encode())


def task_of(row: Row) -> Task:
    """What a row is of."""
    return Task(**{field.name: getattr(row, field.name) for field in fields(Task)})


def _value(kind: Any, text: str) -> Any:
    if isinstance(kind, types.UnionType):
        return None if text == "" else float(text)
    return kind(text)


def _text(value: Any) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
