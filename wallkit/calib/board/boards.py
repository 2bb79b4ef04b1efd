"""A calibration board: its words on the command line or in TOML -> where its corners and its plate are.

Board frame B: x along the columns, y along the rows, z into the board, metres. The origin is the first inner corner of a
chessboard, and the outer corner of the first square or tag of the others, as in OpenCV.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError, closest

KINDS = ("chessboard", "charuco", "aprilgrid")
_SPELLING = (
    "chessboard:9x6:0.025, charuco:5x7:0.04:0.03:5X5_100, aprilgrid:6x6:0.05:0.015:APRILTAG_36H11, or a TOML file"
)
# what `columns` and `rows` count, and which lengths a kind has beside square_m
_COUNTED = {"chessboard": "corners", "charuco": "squares", "aprilgrid": "tags"}
_LENGTHS = {"chessboard": ("square_m",), "charuco": ("square_m", "marker_m"), "aprilgrid": ("square_m", "gap_m")}


@dataclass(frozen=True, slots=True)
class Board:
    """What is printed, and on what plate.

    Attributes:
        kind: "chessboard", "charuco" or "aprilgrid" (a grid of AprilTags, OpenCV's GridBoard).
        columns, rows: inner corners of a chessboard, squares of a ChArUco board, tags of an AprilGrid.
        square_m: side of a square, or of a tag.
        marker_m: side of a ChArUco board's markers. gap_m: between the tags of an AprilGrid.
        dictionary: OpenCV's, without DICT_.
        is_legacy: a ChArUco board with an even number of rows as OpenCV before 4.6 printed it.
        plate_m: width (along x) and height of the physical plate; None: the printed pattern with one square around it.
        plate_offset_m: centre of the plate minus centre of the pattern (x, y).

    Raises:
        CalibrationError: what cannot be, with the value.
    """

    kind: str
    columns: int
    rows: int
    square_m: float
    marker_m: float = 0.0
    gap_m: float = 0.0
    dictionary: str = ""
    is_legacy: bool = False
    plate_m: tuple[float, float] | None = None
    plate_offset_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise CalibrationError(f"board kind '{self.kind}' is not known", hint=closest(self.kind, KINDS))
        least = 1 if self.kind == "aprilgrid" else 3
        if self.columns < least or self.rows < least:
            counted = _COUNTED[self.kind]
            raise CalibrationError(f"a {self.kind} of {self.columns} x {self.rows} {counted} is too small (< {least})")
        for name in _LENGTHS[self.kind]:
            if not 1e-4 < getattr(self, name) < 10:
                hint = "lengths are in metres: a 25 mm square is 0.025"
                raise CalibrationError(f"{name} = {getattr(self, name)} is not between 0.1 mm and 10 m", hint=hint)
        if self.kind == "charuco" and self.marker_m >= self.square_m:
            raise CalibrationError(f"markers of {self.marker_m} m do not fit into squares of {self.square_m} m")
        if self.kind != "chessboard":
            opencv_dictionary(self.dictionary)
        if self.plate_m is not None and (np.array(self.plate_m) < self.pattern_size_m - 1e-9).any():
            size = " x ".join(f"{v:.3f}" for v in self.pattern_size_m)
            raise CalibrationError(f"the plate of {self.plate_m} m is smaller than its pattern of {size} m")

    @property
    def words(self) -> str:
        """The board as --board takes it, without its plate."""
        parts = [self.kind, f"{self.columns}x{self.rows}", *(f"{getattr(self, n):g}" for n in _LENGTHS[self.kind])]
        return ":".join(parts if self.kind == "chessboard" else [*parts, self.dictionary])

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of the corners that are detected; of an AprilGrid those of its tags."""
        inner = 1 if self.kind == "charuco" else 0
        return self.columns - inner, self.rows - inner

    @property
    def object_points(self) -> Float64Array:
        """(n, 3) corners in frame B [m], row by row; an AprilGrid's are four of each tag, clockwise from its first."""
        columns, rows = self.grid
        u, v = np.meshgrid(np.arange(columns), np.arange(rows))
        cells = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], -1).astype(np.float64)
        if self.kind == "aprilgrid":
            tag = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * self.square_m
            return (cells[:, None] * (self.square_m + self.gap_m) + tag).reshape(-1, 3)
        first = 1 if self.kind == "charuco" else 0
        return np.asarray((cells + np.array([first, first, 0])) * self.square_m)

    @property
    def pattern_box(self) -> tuple[Float64Array, Float64Array]:
        """(2,) lowest and highest x, y of what is printed, in frame B [m]: squares included."""
        if self.kind == "chessboard":
            low = np.full(2, -self.square_m)
            return low, np.array([self.columns, self.rows]) * self.square_m
        pitch = self.square_m + self.gap_m
        return np.zeros(2), np.array([self.columns, self.rows]) * pitch - self.gap_m

    @property
    def pattern_size_m(self) -> Float64Array:
        """(2,) width and height of what is printed."""
        low, high = self.pattern_box
        return np.asarray(high - low)

    @property
    def plate_corners(self) -> Float64Array:
        """(4, 3) corners of the plate in frame B [m], clockwise from the one with the lowest x and y."""
        low, high = self.pattern_box
        size = np.array(self.plate_m) if self.plate_m else high - low + 2 * self.square_m
        middle = (low + high) / 2 + self.plate_offset_m
        corners = middle + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2
        return np.concatenate([corners, np.zeros((4, 1))], -1)

    def toml(self) -> str:
        """The [board] table that `board_from` reads."""
        lines = ["[board]", f'kind = "{self.kind}"', f"{_COUNTED[self.kind]} = [{self.columns}, {self.rows}]"]
        lines += [f"{name} = {getattr(self, name)!r}" for name in _LENGTHS[self.kind]]
        if self.kind != "chessboard":
            lines.append(f'dictionary = "{self.dictionary}"')
        if self.is_legacy:
            lines.append("legacy = true")
        if self.plate_m is not None:
            lines.append(f"plate_m = {list(self.plate_m)}")
        if any(self.plate_offset_m):
            lines.append(f"plate_offset_m = {list(self.plate_offset_m)}")
        return "\n".join(lines) + "\n"


def board_from(words: str) -> Board:
    """The board that a TOML file or `kind:COLUMNSxROWS:lengths:dictionary` describes.

    Raises:
        CalibrationError: neither, or a board that cannot be.
    """
    path = Path(words)
    if path.suffix == ".toml" or path.is_file():
        return _from_file(path)
    kind, *parts = words.split(":")
    if kind not in KINDS:
        hint = f"write it as {_SPELLING}"
        raise CalibrationError(f"'{words}' is no board, and no such file exists", hint=hint)
    lengths = _LENGTHS[kind]
    count = 1 + len(lengths) + (kind != "chessboard")
    columns, _, rows = parts[0].partition("x") if parts else ("", "", "")
    if len(parts) != count or not (columns.isdecimal() and rows.isdecimal()):
        raise CalibrationError(f"'{words}' is no board", hint=f"write it as {_SPELLING}")
    values = {name: _number(text, words) for name, text in zip(lengths, parts[1:], strict=False)}
    dictionary = "" if kind == "chessboard" else parts[-1].upper().removeprefix("DICT_")
    return Board(
        kind,
        int(columns),
        int(rows),
        values["square_m"],
        marker_m=values.get("marker_m", 0.0),
        gap_m=values.get("gap_m", 0.0),
        dictionary=dictionary,
    )


def _number(text: str, words: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise CalibrationError(f"'{text}' in '{words}' is no length", hint=f"write it as {_SPELLING}") from error


def _from_file(path: Path) -> Board:
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CalibrationError(f"cannot be read: {error.strerror}", where=path) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CalibrationError(f"is no TOML: {error}", where=path) from error
    table = document.get("board")
    if not isinstance(table, dict):
        raise CalibrationError(
            "has no [board] table", where=path, hint="`wallkit calib board` prints one with the sheet"
        )
    try:
        return board_from_table(table)
    except CalibrationError as error:
        raise CalibrationError(error.message, where=error.where or path, hint=error.hint) from error


def board_from_table(table: Mapping[str, Any]) -> Board:
    """The board of a [board] table.

    Raises:
        CalibrationError: a key that is missing, unknown or has an impossible value.
    """
    kind = table.get("kind")
    if kind not in KINDS:
        raise CalibrationError(f"[board] kind = {kind!r} is not known", hint=f"one of: {', '.join(KINDS)}")
    needed = [_COUNTED[kind], *_LENGTHS[kind], *(["dictionary"] if kind != "chessboard" else [])]
    valid = {"kind", *needed, "plate_m", "plate_offset_m", *(["legacy"] if kind == "charuco" else [])}
    for key in table:
        if key not in valid:
            raise CalibrationError(f"[board] has no key '{key}' for a {kind}", hint=closest(key, valid))
    for key in needed:
        if key not in table:
            raise CalibrationError(f"[board] lacks '{key}'", hint=f"a {kind} has: {', '.join(needed)}")
    counts = table[_COUNTED[kind]]
    if not (isinstance(counts, list) and len(counts) == 2 and all(type(n) is int for n in counts)):
        raise CalibrationError(f"[board] {_COUNTED[kind]} = {counts!r} is not [columns, rows]")
    for key in _LENGTHS[kind]:
        if not isinstance(table[key], (int, float)) or isinstance(table[key], bool):
            raise CalibrationError(f"[board] {key} = {table[key]!r} is no length [m]")
    lengths = {key: float(table[key]) for key in _LENGTHS[kind]}
    dictionary = str(table.get("dictionary", "")).upper().removeprefix("DICT_")
    return Board(
        kind,
        counts[0],
        counts[1],
        lengths["square_m"],
        marker_m=lengths.get("marker_m", 0.0),
        gap_m=lengths.get("gap_m", 0.0),
        dictionary=dictionary,
        is_legacy=bool(table.get("legacy", False)),
        plate_m=_pair(table, "plate_m"),
        plate_offset_m=_pair(table, "plate_offset_m") or (0.0, 0.0),
    )


def _pair(table: Mapping[str, Any], key: str) -> tuple[float, float] | None:
    value = table.get(key)
    if value is None:
        return None
    if not (isinstance(value, list) and len(value) == 2 and all(isinstance(v, (int, float)) for v in value)):
        raise CalibrationError(f"[board] {key} = {value!r} is not [x, y] in metres")
    return float(value[0]), float(value[1])


def opencv_dictionary(name: str) -> Any:
    """OpenCV's marker dictionary of a name without DICT_.

    Raises:
        CalibrationError: no such dictionary.
    """
    from cv2 import aruco

    number = getattr(aruco, f"DICT_{name}", None)
    if not name or number is None:
        names = [n.removeprefix("DICT_") for n in dir(aruco) if n.startswith("DICT_")]
        raise CalibrationError(f"marker dictionary '{name}' is not known", hint=closest(name, names))
    return aruco.getPredefinedDictionary(number)


def opencv_board(board: Board) -> Any:
    """OpenCV's CharucoBoard or GridBoard of a board that has markers."""
    from cv2 import aruco

    dictionary, size = opencv_dictionary(board.dictionary), (board.columns, board.rows)
    if board.kind == "aprilgrid":
        return aruco.GridBoard(size, board.square_m, board.gap_m, dictionary)
    charuco = aruco.CharucoBoard(size, board.square_m, board.marker_m, dictionary)
    charuco.setLegacyPattern(board.is_legacy)
    return charuco
