"""A board -> a sheet to print at true scale, as SVG or PDF: the pattern, its words, and a bar to check the printer with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wallkit.calib.board.boards import Board, opencv_board, opencv_dictionary
from wallkit.core.types import Float64Array
from wallkit.errors import CalibrationError, closest

# ISO 216, portrait [mm]
PAPERS = {"A4": (210, 297), "A3": (297, 420), "A2": (420, 594), "A1": (594, 841), "A0": (841, 1189)}
_MARGIN_MM, FOOT_MM = 8.0, 24.0
_TEXT_MM = 3.2
# width of a letter of Helvetica, on average, as a share of its height
_LETTER = 0.56


@dataclass(frozen=True, slots=True)
class Sheet:
    """A page: black rectangles (n, 4) as x, y, width, height, and lines of text as (x, y of the baseline, words) [mm].

    The origin is the page's upper left corner, y down.
    """

    width_mm: float
    height_mm: float
    rectangles: Float64Array
    texts: tuple[tuple[float, float, str], ...]


def sheet_of(board: Board, *, paper: str = "") -> Sheet:
    """The board in the middle of the smallest paper that holds it with white around, or of the paper asked for.

    Larger boards than A0 get a page of their own size, for print shops and plotters.

    Raises:
        CalibrationError: no such paper, or the board does not fit on it.
    """
    size = board.pattern_size_m * 1e3
    # detection needs white around the black squares: half a square, a quarter of a tag
    quiet = max(_MARGIN_MM, board.square_m * 1e3 * (0.5 if board.kind == "chessboard" else 0.25))
    needed = size + 2 * quiet + (0, FOOT_MM)
    width, height = _page(needed, paper)
    corner = np.array([(width - size[0]) / 2, (height - FOOT_MM - size[1]) / 2])
    low, _ = board.pattern_box
    black = black_rectangles(board) * 1e3
    black[:, :2] += corner - low * 1e3
    bar, texts = _foot(board, width, height)
    return Sheet(width, height, np.concatenate([black, bar]), texts)


def _page(needed: Float64Array, paper: str) -> tuple[float, float]:
    if paper and paper.upper() not in PAPERS:
        raise CalibrationError(f"paper '{paper}' is not known", hint=closest(paper, PAPERS))
    for name in [paper.upper()] if paper else PAPERS:
        for width, height in (PAPERS[name], PAPERS[name][::-1]):
            if width >= needed[0] and height >= needed[1]:
                return width, height
    if paper:
        size = f"{needed[0]:.0f} x {needed[1]:.0f} mm"
        raise CalibrationError(
            f"the board needs {size} with its margins: more than {paper.upper()}", hint="leave --paper out"
        )
    return float(np.ceil(needed[0])), float(np.ceil(needed[1]))


def _foot(board: Board, width: float, height: float) -> tuple[Float64Array, tuple[tuple[float, float, str], ...]]:
    """The scale bar with its ticks, and what stands below it."""
    length = 100.0 if width >= 120 else 50.0
    x, y = _MARGIN_MM, height - FOOT_MM + 6
    bar = np.array([(x, y, length, 0.4), (x, y - 2, 0.3, 4), (x + length - 0.3, y - 2, 0.3, 4)])
    words = f"{length:.0f} mm from edge to edge: measure it after printing; scale the lengths below by what you find."
    table = "  ".join(board.toml().splitlines()[1:])
    lines = [words, *_wrapped(f"[board]  {table}", width - 2 * _MARGIN_MM)]
    texts = [(x, y + 5.2 + 4.2 * i, line) for i, line in enumerate(lines[:3])]
    return bar, tuple(texts)


def _wrapped(text: str, width_mm: float) -> list[str]:
    fits = max(10, int(width_mm / (_TEXT_MM * _LETTER)))
    lines = [""]
    for part in text.split("  "):
        if lines[-1] and len(lines[-1]) + 2 + len(part) > fits:
            lines.append("")
        lines[-1] += ("  " if lines[-1] else "") + part
    return lines


def black_rectangles(board: Board) -> Float64Array:
    """(n, 4) x, y, width, height of everything black, in frame B [m]."""
    if board.kind == "chessboard":
        low, _ = board.pattern_box
        cells = [(u, v) for v in range(board.rows + 1) for u in range(board.columns + 1) if (u + v) % 2 == 0]
        return np.array([(*(low + np.array(cell) * board.square_m), board.square_m, board.square_m) for cell in cells])
    printed = opencv_board(board)
    places = np.array([np.asarray(p, dtype=np.float64)[0, :2] for p in printed.getObjPoints()])
    tags = [_tag(board, int(number), place) for number, place in zip(printed.getIds().ravel(), places, strict=True)]
    if board.kind == "charuco":
        with_marker = {tuple(np.floor(place / board.square_m).astype(int).tolist()) for place in places}
        cells = [(u, v) for v in range(board.rows) for u in range(board.columns) if (u, v) not in with_marker]
        squares = np.array([(u, v, 1, 1) for u, v in cells], dtype=np.float64) * board.square_m
        tags.append(squares)
    return np.concatenate(tags)


def _tag(board: Board, number: int, place: Float64Array) -> Float64Array:
    """Black runs of one marker whose upper left corner is at a place; rows of equal runs stay apart, none overlap."""
    dictionary = opencv_dictionary(board.dictionary)
    modules = dictionary.markerSize + 2
    black = dictionary.generateImageMarker(number, modules) < 128
    side = (board.marker_m if board.kind == "charuco" else board.square_m) / modules
    runs = []
    for row in range(modules):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], black[row].astype(np.int8), [0]])))
        runs += [(place[0] + a * side, place[1] + row * side, (b - a) * side, side) for a, b in edges.reshape(-1, 2)]
    return np.array(runs)


def svg_from_sheet(sheet: Sheet) -> bytes:
    """The sheet as SVG with its size in millimetres."""
    box = f"{sheet.width_mm:g} {sheet.height_mm:g}"
    size = f'width="{sheet.width_mm:g}mm" height="{sheet.height_mm:g}mm" viewBox="0 0 {box}"'
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" {size}>', '<rect width="100%" height="100%" fill="white"/>']
    path = "".join(f"M{x:.4f} {y:.4f}h{w:.4f}v{h:.4f}h{-w:.4f}z" for x, y, w, h in sheet.rectangles.tolist())
    lines.append(f'<path d="{path}" fill="black" shape-rendering="crispEdges"/>')
    for x, y, words in sheet.texts:
        escaped = words.replace("&", "&amp;").replace("<", "&lt;")
        style = f'font-family="Helvetica, Arial, sans-serif" font-size="{_TEXT_MM}" xml:space="preserve"'
        lines.append(f'<text x="{x:g}" y="{y:g}" {style}>{escaped}</text>')
    return ("\n".join([*lines, "</svg>"]) + "\n").encode()


def pdf_from_sheet(sheet: Sheet) -> bytes:
    """The sheet as a PDF of one page that asks the printer not to scale (PDF 32000-1:2008, PrintScaling)."""
    point = 72 / 25.4
    height = sheet.height_mm * point
    drawn = [f"{x:.4f} {height - y - h:.4f} {w:.4f} {h:.4f} re" for x, y, w, h in (sheet.rectangles * point).tolist()]
    content = ["0 g", *drawn, "f"]
    for x, y, words in sheet.texts:
        escaped = words.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
        content.append(f"BT /F {_TEXT_MM * point:.3f} Tf {x * point:.4f} {height - y * point:.4f} Td ({escaped}) Tj ET")
    stream = "\n".join(content)
    box = f"[0 0 {sheet.width_mm * point:.4f} {height:.4f}]"
    objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R /Resources << /Font << /F 5 0 R >> >> >>",
        f"<< /Length {len(stream)} >>\nstream\n{stream}\nendstream",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>",
    ]
    text, offsets = "%PDF-1.4\n", []
    for number, body in enumerate(objects, start=1):
        offsets.append(len(text))
        text += f"{number} 0 obj\n{body}\nendobj\n"
    table = "".join(f"{offset:010d} 00000 n \n" for offset in offsets)
    end = f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{len(text)}\n%%EOF\n"
    return (text + f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}{end}").encode("latin-1")


SHEETS: dict[str, Callable[[Sheet], bytes]] = {".svg": svg_from_sheet, ".pdf": pdf_from_sheet}
