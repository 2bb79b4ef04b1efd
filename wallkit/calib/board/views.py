"""What calibration is made of: the corners of one board in several images of one camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.core.types import Float64Array, Int64Array
from wallkit.errors import CalibrationError


@dataclass(frozen=True, slots=True)
class View:
    """One image of the board.

    Attributes:
        name: of the file, or the stamp of the image in a log.
        ids: (n,) int64 rows of `Board.object_points`. pixels: (n, 2) float64.
        sharpness: see `detect.Corners`; NaN when only the corners are known.
        motion_px: how far the corners move between neighbouring frames; NaN without neighbours.
        stamp_ns: of an image in a log; None of a file.
    """

    name: str
    ids: Int64Array
    pixels: Float64Array
    sharpness: float = float("nan")
    motion_px: float = float("nan")
    stamp_ns: int | None = None


@dataclass(frozen=True)
class Capture:
    """All views of one camera, in the order of their names or stamps.

    Attributes:
        board: what is seen. width, height: of every image [px].
        views: where the board was found.
        looked_at: how many images were searched. left_out: why views were not used -> how many.
        camera_name, frame: as far as the source says.
    """

    board: Board
    width: int
    height: int
    views: tuple[View, ...]
    looked_at: int = 0
    left_out: tuple[tuple[str, int], ...] = ()
    camera_name: str = ""
    frame: str = ""


@dataclass(frozen=True, slots=True)
class Observations:
    """Corners of several views stacked for the solver, sorted by view.

    Attributes:
        points: (N, 3) in the board frame [m]. pixels: (N, 2). views: (N,) int64 index of the view, ascending, none missing.
    """

    points: Float64Array
    pixels: Float64Array
    views: Int64Array

    @property
    def count(self) -> int:
        """Number of views."""
        return int(self.views[-1]) + 1 if len(self.views) else 0

    @property
    def starts(self) -> Int64Array:
        """(G,) row where each view begins."""
        return np.searchsorted(self.views, np.arange(self.count)).astype(np.int64)

    def of_views(self, chosen: Sequence[int] | Int64Array) -> Observations:
        """Only some views, renumbered in the order of this one."""
        wanted = np.unique(np.asarray(chosen, dtype=np.int64))
        rows = np.isin(self.views, wanted)
        return Observations(self.points[rows], self.pixels[rows], np.searchsorted(wanted, self.views[rows]))


def observations_of(views: Sequence[View], board: Board) -> Observations:
    """The corners of the views, stacked."""
    points = board.object_points
    return Observations(
        np.concatenate([points[view.ids] for view in views]),
        np.concatenate([view.pixels for view in views]),
        np.repeat(np.arange(len(views)), [len(view.ids) for view in views]),
    )


def capture_from_npz(path: Path, board: Board, size: tuple[int, int] | None) -> Capture:
    """Corners that were found elsewhere: one array (n, 2) or (n, 1, 2) of pixels a view, NaN where a corner is not seen.

    Args:
        size: width and height of the images; None: the file's `image_size`.

    Raises:
        CalibrationError: no such file, no corners, another number of corners than the board has, or no image size.
    """
    try:
        arrays = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise CalibrationError(f"is no archive of arrays: {error}", where=path) from error
    if not isinstance(arrays, np.lib.npyio.NpzFile):
        raise CalibrationError("is a single array, not an .npz archive with one array a view", where=path)
    with arrays:
        loaded: dict[str, Any] = {name: arrays[name] for name in arrays.files}
    stored = loaded.pop("image_size", None)
    if size is None and stored is None:
        raise CalibrationError("does not say how large the images are", where=path, hint="give --size WIDTHxHEIGHT")
    width, height = size or (int(stored[0]), int(stored[1]))
    names = sorted(loaded, key=lambda name: (not name.isdecimal(), int(name) if name.isdecimal() else 0, name))
    views = tuple(_view_from_array(path, name, loaded[name], board) for name in names)
    if not views:
        raise CalibrationError("holds no views", where=path)
    outside = [v.name for v in views if (v.pixels < -0.5).any() or (v.pixels > (width - 0.5, height - 0.5)).any()]
    if outside:
        where = f"outside an image of {width} x {height} px"
        raise CalibrationError(f"corners of view '{outside[0]}' lie {where}", where=path, hint="check --size")
    return Capture(board, width, height, views, looked_at=len(views))


def _view_from_array(path: Path, name: str, array: Any, board: Board) -> View:
    pixels = np.asarray(array, dtype=np.float64)
    count = len(board.object_points)
    if pixels.size != 2 * count:
        columns, rows = board.grid
        hint = f"the board {board.words} has {columns} x {rows} corners: check --board"
        found = f"view '{name}' has {pixels.size / 2:g} corners, not {count}"
        raise CalibrationError(found, where=path, hint=hint)
    pixels = pixels.reshape(count, 2)
    seen = np.isfinite(pixels).all(axis=1)
    return View(name, np.flatnonzero(seen), pixels[seen])
