"""What a run says about itself, one row per scan -> steps.csv and back."""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, Health, Int64Array, Trajectory
from wallkit.errors import OutputError, WallkitError


@dataclass(frozen=True, slots=True)
class Steps:
    """The filter's own account, one row per scan; a scan that moved too little for an update has no time and no ratios.

    Attributes:
        stamps_ns: (T,) int64, ascending and unique.
        poses: (T, 3) float64, T_map_base: x [m], y [m], yaw [rad].
        sd: (T, 3) float64, standard deviation of x [m], y [m], yaw [rad].
        health: (T,) int64, values of `Health`.
        hit_ratio, short_ratio, long_ratio: (T,) float64 in [0, 1], share of the beams that end on the map, before it
            (something stands in front) and beyond it (the map has a wall that is not there). NaN without an update.
        ess: (T,) float64, effective sample size before resampling.
        particles, modes: (T,) int64, particles in use, and hypotheses alive.
        update_ms: (T,) float64, time the update took; NaN without an update.
        reasons: why the health is what it is, one line of text per row.
    """

    stamps_ns: Int64Array
    poses: Float64Array
    sd: Float64Array
    health: Int64Array
    hit_ratio: Float64Array
    short_ratio: Float64Array
    long_ratio: Float64Array
    ess: Float64Array
    particles: Int64Array
    modes: Int64Array
    update_ms: Float64Array
    reasons: tuple[str, ...]

    def __post_init__(self) -> None:
        rows = len(self.stamps_ns)
        for f in fields(self):
            value = getattr(self, f.name)
            if len(value) != rows or (f.name in ("poses", "sd") and value.shape != (rows, 3)):
                raise ValueError(f"{f.name} does not fit {rows} scans")
        if np.any(np.diff(self.stamps_ns) <= 0):
            raise ValueError("stamps_ns must ascend")
        if any(len(reason.splitlines()) > 1 for reason in self.reasons):
            raise ValueError("a reason is one line")

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def is_update(self) -> BoolArray:
        """(T,) the scans at which the filter looked."""
        return np.isfinite(self.update_ms)

    @property
    def trajectory(self) -> Trajectory:
        """The estimate alone."""
        return Trajectory(self.stamps_ns, self.poses)


def health_runs(health: Int64Array) -> Iterator[tuple[int, int, Health]]:
    """Stretches of equal health as (first row, row after the last, health)."""
    edges = np.flatnonzero(np.diff(health)) + 1
    bounds = [0, *edges.tolist(), len(health)] if len(health) else []
    for start, end in itertools.pairwise(bounds):
        yield start, end, Health(int(health[start]))


# -------------------------------------------------------------------------------------------------- steps.csv


def write_steps(path: Path, steps: Steps) -> None:
    """Writes steps.csv; reading it gives the same bits back.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        path.write_text(csv_from_steps(steps), encoding="utf-8", newline="")
    except OSError as error:
        raise OutputError(f"cannot write the steps: {error}", where=path, hint="choose another --out") from error


def read_steps(path: Path) -> Steps:
    """The steps of a steps.csv.

    Raises:
        WallkitError: it cannot be read, lacks a column, or a cell does not parse (with the line).
    """
    try:
        text = path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise WallkitError(f"cannot read the steps: {error}", where=path, hint=_AGAIN) from error
    return steps_from_csv(text, where=str(path))


def csv_from_steps(steps: Steps) -> str:
    """steps.csv as text; a NaN is an empty cell."""
    columns = [
        [_cell(kind, v) for v in (values if kind in ("text", "health") else np.asarray(values).tolist())]
        for kind, values in _columns_from_steps(steps)
    ]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(zip(*columns, strict=True))
    return out.getvalue()


def steps_from_csv(text: str, where: str = "steps.csv") -> Steps:
    """The steps of a CSV text; other columns are left alone."""
    reader = csv.reader(io.StringIO(text, newline=""))
    header = next(reader, [])
    for name in COLUMNS:
        if name not in header:
            raise WallkitError(f"there is no column '{name}'", where=f"{where}:1", hint=_AGAIN)
    order = [(header.index(name), name, kind) for name, kind in COLUMNS.items()]
    table: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    for row in reader:
        if len(row) != len(header):
            place = f"{where}:{reader.line_num}"
            raise WallkitError(f"{len(row)} cells where the header has {len(header)}", where=place, hint=_AGAIN)
        for index, name, kind in order:
            try:
                table[name].append(_parsed(kind, row[index]))
            except (ValueError, KeyError) as error:
                message = f"'{row[index]}' is not a value of column '{name}'"
                raise WallkitError(message, where=f"{where}:{reader.line_num}", hint=_AGAIN) from error
    try:
        return _steps_from_columns(table)
    except ValueError as error:
        raise WallkitError(str(error), where=where, hint=_AGAIN) from error


_AGAIN = "wallkit localize writes it: a file that was cut or edited since must be made again"

COLUMNS: Mapping[str, str] = {
    "stamp_ns": "int",
    "x_m": "float",
    "y_m": "float",
    "yaw_rad": "float",
    "sd_x_m": "float",
    "sd_y_m": "float",
    "sd_yaw_rad": "float",
    "health": "health",
    "hit_ratio": "float",
    "short_ratio": "float",
    "long_ratio": "float",
    "ess": "float",
    "particles": "int",
    "modes": "int",
    "update_ms": "float",
    "reason": "text",
}


def _columns_from_steps(steps: Steps) -> Iterator[tuple[str, Any]]:
    arrays = (
        *(steps.stamps_ns, *steps.poses.T, *steps.sd.T, steps.health),
        *(steps.hit_ratio, steps.short_ratio, steps.long_ratio),
        *(steps.ess, steps.particles, steps.modes, steps.update_ms, steps.reasons),
    )
    yield from zip(COLUMNS.values(), arrays, strict=True)


def _steps_from_columns(table: Mapping[str, list[Any]]) -> Steps:
    def floats(*names: str) -> Float64Array:
        return np.array([table[n] for n in names], dtype=np.float64).T

    def ints(name: str) -> Int64Array:
        return np.array(table[name], dtype=np.int64)

    return Steps(
        stamps_ns=ints("stamp_ns"),
        poses=floats("x_m", "y_m", "yaw_rad"),
        sd=floats("sd_x_m", "sd_y_m", "sd_yaw_rad"),
        health=ints("health"),
        hit_ratio=floats("hit_ratio")[:, 0],
        short_ratio=floats("short_ratio")[:, 0],
        long_ratio=floats("long_ratio")[:, 0],
        ess=floats("ess")[:, 0],
        particles=ints("particles"),
        modes=ints("modes"),
        update_ms=floats("update_ms")[:, 0],
        reasons=tuple(table["reason"]),
    )


def _cell(kind: str, value: Any) -> str:
    if kind == "health":
        return Health(int(value)).name
    if kind == "float":
        return "" if math.isnan(value) else repr(value)
    return str(value)


def _parsed(kind: str, cell: str) -> Any:
    if kind == "health":
        return int(Health[cell])
    if kind == "float":
        return float(cell) if cell else math.nan
    return int(cell) if kind == "int" else cell
