"""The trajectories of many runs -> for each map, how wrong they were in every place the robot passed."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array, OccupancyGrid, Trajectory
from wallkit.errors import WallkitError
from wallkit.evaluate.associate import interpolate_truth
from wallkit.evaluate.convergence import is_lost
from wallkit.evaluate.metrics import errors_from_pairs
from wallkit.evaluate.tum import read_tum
from wallkit.maps.grids.fields import MapsSettings
from wallkit.pipelines.batch.copies import fetched, seen
from wallkit.pipelines.batch.remote import is_address, name_of
from wallkit.pipelines.batch.runs import Runs
from wallkit.pipelines.evaluate import EvaluateSettings
from wallkit.pipelines.maps import load_map
from wallkit.pipelines.run_folder import read_json
from wallkit.report.batch_map import Places, cell_size

# rows kept before they are added up: memory is that of the places, not of the runs
_ROWS = 500_000


def read_places(
    runs: Runs, settings: EvaluateSettings, *, tick: Callable[[int], None] = lambda done: None
) -> tuple[Places, ...]:
    """By map, in order of first use; runs without files or truth are counted at the map of their log, if one is known."""
    grounds: dict[str, _Ground] = {}
    of_log: dict[int, _Ground] = {}
    unread: dict[int, int] = {}
    truths = _Truths()
    for number, row in enumerate(np.flatnonzero(runs.is_done).tolist(), start=1):
        tick(number)
        log, folder = int(runs.log[row]), Path(runs.folders[row])
        try:
            found = _read(folder, truths, settings)
        except WallkitError:
            unread[log] = unread.get(log, 0) + 1
            continue
        key, name, at, errors, lost = found
        ground = grounds.get(key)
        if ground is None:
            ground = grounds[key] = _Ground.of(name, at)
        of_log[log] = ground
        ground.logs.add(log)
        ground.add(at, errors, lost)
    for log, count in unread.items():
        if log in of_log:
            of_log[log].unread += count
    return tuple(ground.places(runs.logs) for ground in grounds.values())


def _read(
    folder: Path, truths: _Truths, settings: EvaluateSettings
) -> tuple[str, str, Float64Array, Float64Array, Float64Array]:
    """Key and file of the map, true places (E, 2), error [m] (E,) and whether it was lost (E,)."""
    run = read_json(folder / "run.json")
    estimate, truth = read_tum(folder / "estimate.tum"), truths.read(folder / "truth.tum")
    gap, offset = round(settings.truth_gap_s * 1e9), round(settings.truth_offset_s * 1e9)
    pairs = interpolate_truth(estimate, truth, tolerance_ns=gap, offset_ns=offset)
    errors = errors_from_pairs(pairs)
    return (
        _map_key(run),
        str(run.get("map", "")),
        pairs.truth[:, :2],
        errors.position_m,
        is_lost(errors, settings.limits).astype(float),
    )


def _map_key(run: dict[str, Any]) -> str:
    """The content of the map where it is known: copies in many folders are one map."""
    name = str(run.get("map", ""))
    hashes = [str(entry.get("sha256")) for entry in run.get("inputs", []) if entry.get("path") == name]
    return hashes[0] if hashes else name


class _Truths:
    """Truths by their bytes: every seed and configuration of a log has a copy of the same."""

    def __init__(self) -> None:
        self._bytes, self._truth = b"", Trajectory(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))

    def read(self, path: Path) -> Trajectory:
        if not path.is_file():
            raise WallkitError("the run has no truth", where=path, hint="--truth FILE.tum of wallkit localize")
        data = path.read_bytes()
        if data != self._bytes:
            self._truth, self._bytes = read_tum(path), data
        return self._truth


@dataclass
class _Ground:
    """One map and what is known of its places so far: rows of (x, y, runs, error, lost)."""

    name: str
    grid: OccupancyGrid | None
    cell_m: float
    rows: list[Float64Array] = field(default_factory=list)
    count: int = 0
    runs: int = 0
    unread: int = 0
    logs: set[int] = field(default_factory=set)

    @classmethod
    def of(cls, file: str, at: Float64Array) -> _Ground:
        grid = _grid(file)
        if grid is None:
            corners = at
        else:
            height, width = grid.cells.shape
            corners = np.array([[0.0, 0.0], [width * grid.resolution_m, height * grid.resolution_m]])
        name = (
            (name_of(file) if is_address(file) else Path(file).name)
            .removesuffix(".urdf")
            .removesuffix(".wkmap")
            .removesuffix(".yaml")
        )
        return cls(name, grid, cell_size(corners))

    def add(self, at: Float64Array, errors: Float64Array, lost: Float64Array) -> None:
        """One run: its mean in every place it passed, so that one that stands still does not outweigh the others."""
        cells, index, counts = np.unique(
            np.floor(at / self.cell_m).astype(np.int64), axis=0, return_inverse=True, return_counts=True
        )
        index = index.reshape(-1)
        means = [np.bincount(index, values) / counts for values in (errors, lost)]
        self.rows.append(np.column_stack([cells, np.ones(len(cells)), *means]))
        self.count += len(cells)
        self.runs += 1
        if self.count > _ROWS:
            self._add_up()

    def places(self, logs: Sequence[str]) -> Places:
        """Means over the runs, under the name that the logs share, or that of the file."""
        self._add_up()
        alike = itertools.takewhile(
            lambda letters: len(set(letters)) == 1, zip(*(logs[i] for i in self.logs), strict=False)
        )
        shared = "".join(letters[0] for letters in alike).rstrip("-_. ")
        (table,) = self.rows
        cells, passes = table[:, :2].astype(np.int64), table[:, 2]
        return Places(
            shared or self.name, self.grid, self.cell_m, cells, table[:, 3] / passes, table[:, 4] / passes,
            passes.astype(np.int64), self.runs, len(self.logs), self.unread,
        )  # fmt: skip

    def _add_up(self) -> None:
        table = np.vstack(self.rows)
        cells, index = np.unique(table[:, :2], axis=0, return_inverse=True)
        sums = [np.bincount(index.reshape(-1), column) for column in table[:, 2:].T]
        self.rows, self.count = [np.column_stack([cells, *sums])], len(cells)


def _grid(file: str) -> OccupancyGrid | None:
    """The walls, where the map is still there and can be read."""
    try:
        path = fetched(seen(file, is_map=True, known={}), "") if is_address(file) else Path(file)
        return load_map(path, None, MapsSettings()).grid if path.is_file() else None
    except WallkitError:
        return None
