"""Pictures in which a declared board was not found -> what is seen instead, said so that the user can put it right."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from wallkit.calib.board.boards import Board
from wallkit.core.types import UInt8Array
from wallkit.errors import CalibrationError

_DICTIONARIES = ("4X4_50", "5X5_100", "6X6_250", "7X7_1000", "ARUCO_ORIGINAL", "APRILTAG_36H11", "APRILTAG_16H5")
_FEWEST_MARKERS = 4


def find_pattern(grey: UInt8Array) -> tuple[int, int] | None:
    """Columns and rows of inner corners of whatever chessboard is in a picture, the larger number first; None without one.

    The smallest pattern OpenCV searches for is grown as far as it reaches (Duda & Frese, BMVC 2018).
    """
    import cv2

    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE
    is_found, _, meta = cv2.findChessboardCornersSBWithMeta(grey, (3, 3), flags)
    if not is_found or meta is None:
        return None
    rows, columns = np.asarray(meta).shape[:2]
    return max(columns, rows), min(columns, rows)


def find_dictionary(grey: UInt8Array) -> tuple[str, int] | None:
    """The dictionary whose markers a picture shows most of, and how many; None below four."""
    from cv2 import aruco

    counts = {}
    for name in _DICTIONARIES:
        detector = aruco.ArucoDetector(aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{name}")))
        _, ids, _ = detector.detectMarkers(grey)
        counts[name] = 0 if ids is None else len(np.unique(ids))
    best = max(counts, key=lambda name: counts[name])
    return (best, counts[best]) if counts[best] >= _FEWEST_MARKERS else None


def explain_larger(greys: Iterable[UInt8Array], board: Board) -> CalibrationError | None:
    """The error when most of some pictures, in which a chessboard was found, show a larger one or one with markers.

    The searches of OpenCV are content with a part of a board; its corners would get the wrong places on it.
    """
    if board.kind != "chessboard":
        return None
    looked = list(greys)
    tags = [marked[0] for grey in looked if (marked := find_dictionary(grey)) is not None]
    if 2 * len(tags) > len(looked):
        hint = f"declare a board with markers, as charuco:COLUMNSxROWS:SQUARE:MARKER:{tags[0]}"
        return CalibrationError(f"the board has markers of {tags[0]}: it is no {board.words}", hint=hint)
    declared = tuple(sorted(board.grid, reverse=True))
    seen = Counter(found for grey in looked if (found := find_pattern(grey)) is not None)
    larger = {
        size: n for size, n in seen.items() if size != declared and size[0] >= declared[0] and size[1] >= declared[1]
    }
    if not larger or 2 * sum(larger.values()) <= len(looked):
        return None
    columns, rows = max(larger, key=lambda size: larger[size])
    hint = (
        f"did you mean --board chessboard:{columns}x{rows}:{board.square_m:g}? Inner corners are counted, not squares"
    )
    what = f"a chessboard of {columns} x {rows} inner corners is seen in the pictures, of which {board.words} is a part"
    return CalibrationError(what, hint=hint)


def explain_nothing_found(greys: Iterable[UInt8Array], board: Board, count: int) -> CalibrationError:
    """The error that says why a declared board was found in none of some pictures, from a few of them."""
    looked = list(greys)
    nothing = f"the board {board.words} was found in none of {count} pictures"
    tags = Counter(marked[0] for grey in looked if (marked := find_dictionary(grey)) is not None)
    if tags:
        name = tags.most_common(1)[0][0]
        if board.kind == "chessboard":
            hint = f"declare a board with markers, as charuco:COLUMNSxROWS:SQUARE:MARKER:{name}"
            return CalibrationError(f"{nothing}, but markers of {name} were", hint=hint)
        if name.split("_")[0] != board.dictionary.split("_")[0] or board.dictionary == "":
            return CalibrationError(f"{nothing}: the markers in them are of {name}", hint=f"declare {name} in --board")
    patterns = Counter(found for grey in looked if (found := find_pattern(grey)) is not None)
    if patterns:
        return _explain_pattern(nothing, patterns, board)
    hint = "is it in the pictures, whole, sharp, and with white around it? A glossy or dark board is not found"
    return CalibrationError(nothing, hint=hint)


def _explain_pattern(nothing: str, patterns: Counter[tuple[int, int]], board: Board) -> CalibrationError:
    (columns, rows), often = patterns.most_common(1)[0]
    declared = tuple(sorted(board.grid, reverse=True))
    seen = f"a chessboard of {columns} x {rows} inner corners is seen in {often} of {sum(patterns.values())}"
    if board.kind != "chessboard":
        hint = f"is it a plain chessboard? Then: --board chessboard:{columns}x{rows}:{board.square_m:g}"
        return CalibrationError(f"{nothing}, but {seen}", hint=hint)
    is_part = columns <= declared[0] and rows <= declared[1]
    if is_part and 2 * often <= sum(patterns.values()):
        sizes = ", ".join(f"{c} x {r}" for c, r in sorted(patterns, reverse=True))
        hint = "move the board into the image: a chessboard must be seen whole; a ChArUco board need not"
        return CalibrationError(f"{nothing}; only parts of it are seen ({sizes}): it is cut off", hint=hint)
    hint = (
        f"did you mean --board chessboard:{columns}x{rows}:{board.square_m:g}? Inner corners are counted, not squares"
    )
    if is_part:
        hint += "; if the board is right, it is cut off in the pictures"
    return CalibrationError(f"{nothing}, but {seen}", hint=hint)
