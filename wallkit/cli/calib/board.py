"""`wallkit calib board`: the board to print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.calib.board.boards import Board

board_option = click.option(
    "--board",
    "board_words",
    required=True,
    metavar="BOARD",
    help="The board: a TOML file, or as chessboard:9x6:0.025 (inner corners, square in metres).",
)


@click.command()
@click.argument("words", metavar="BOARD")
@common.out_option
@click.option(
    "--paper", default="", metavar="NAME", help="A4, A3, A2, A1 or A0; else the smallest that holds the board."
)
@common.overwrite_option
@common.json_option
def board(words: str, out: Path | None, paper: str, overwrite: bool, as_json: bool) -> None:
    """Print a calibration board at true scale, as PDF or SVG, and its description as TOML.

    BOARD is a TOML file with a [board] table, or words: chessboard:COLUMNSxROWS:SQUARE counts inner corners,
    charuco:COLUMNSxROWS:SQUARE:MARKER:DICTIONARY squares, aprilgrid:COLUMNSxROWS:TAG:GAP:DICTIONARY tags (a grid without
    black squares between the tags); lengths are metres. Without --out only the TOML is printed.

    Print without scaling, measure the bar at the foot of the sheet, and glue it to something flat.

    \b
    Examples:
      wallkit calib board chessboard:9x6:0.025 -o board.pdf
      wallkit calib board charuco:5x7:0.036:0.027:5X5_100 -o board.svg --paper A3
      wallkit calib board chessboard:7x5:0.095 > board.toml
    """
    from wallkit.calib.board.boards import board_from
    from wallkit.errors import CalibrationError

    described = board_from(words)
    if out is not None:
        from wallkit.calib.board.sheet import SHEETS, sheet_of
        from wallkit.pipelines.outputs import check_file_out, write_whole

        suffix = out.suffix.lower()
        if suffix not in SHEETS:
            known = " or ".join(SHEETS)
            raise CalibrationError(f"sheets are {known}, not '{out.suffix}'", where=out, hint="give --out board.pdf")
        check_file_out(out, overwrite=overwrite)
        sheet = sheet_of(described, paper=paper)
        write_whole(out, SHEETS[suffix](sheet))
        click.echo(f"{out}: {sheet.width_mm:g} x {sheet.height_mm:g} mm; print it without scaling", err=True)
    if as_json:
        common.emit({"out": out, **_document(described)})
    else:
        click.echo(described.toml(), nl=False)


def _document(described: Board) -> dict[str, object]:
    return {
        "board": described.words,
        "kind": described.kind,
        "columns": described.columns,
        "rows": described.rows,
        "square_m": described.square_m,
        "pattern_m": described.pattern_size_m,
        "plate_m": described.plate_m,
        "corners": len(described.object_points),
    }
