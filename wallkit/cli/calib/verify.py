"""`wallkit calib verify`: may this calibration be trusted?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.calib.verify import Verification

EXITS = {"PASS": common.OK, "FAIL": common.FAILED_CHECK, "CANNOT TELL": common.CANNOT_TELL}
_MOST_REASONS = 4

FILE = click.Path(path_type=Path)


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=FILE, metavar="LOG|FILES...")
@click.option("--calib", "calibration", required=True, type=FILE, metavar="FILE", help="The calibration to judge.")
@click.option("--board", "board_words", metavar="BOARD", help="A board file or 'chessboard:9x6:0.025'; else no target.")
@click.option("--scans", type=FILE, metavar="FOLDER", help="Scans of pictures: .pcd, .csv or .npz.")
@click.option("--lidar-sigma", "sigma", metavar="LENGTH|LIDAR", help="Noise of a range: 15mm, or vlp-16, lds-01, ...")
@click.option("--urdf", type=FILE, metavar="FILE", help="The robot: does it agree with the calibration?")
@click.option("--lidar", "lidar_link", default="", metavar="LINK", help="The LiDAR's frame in the URDF.")
@click.option("--camera-frame", "camera_link", default="", metavar="LINK", help="The optical frame in the URDF.")
@click.option("--prior", default="1deg,10mm", show_default=True, metavar="TURN,SHIFT", help="Trust in the URDF.")
@click.option("--room", is_flag=True, help="With --board: ask the room, too; a board and a room that disagree FAIL.")
@click.option(
    "--lidar-height", type=common.Number(), metavar="M", help="Height of a 2-D LiDAR, for the floor line (no board)."
)
@click.option("--scan", "scan_topic", metavar="TOPIC", help="LiDAR topic of a log, when there are several.")
@click.option("--image", "image_topic", metavar="TOPIC", help="Camera topic of a log, when there are several.")
@click.option("--report", type=FILE, metavar="FILE", help="Also write an HTML page with overlays and figures.")
@click.option("--write", is_flag=True, help="Store verdict and pixel errors in the calibration file.")
@common.out_option
@common.config_option
@common.set_option
@common.seed_option
@common.overwrite_option
@common.json_option
@common.quiet_option
@common.dry_run_option
@click.pass_context
def verify(
    ctx: click.Context,
    /,
    inputs: tuple[Path, ...],
    calibration: Path,
    board_words: str | None,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
    dry_run: bool,
    **given: Any,
) -> None:
    """Judge a calibration by a recording: PASS, FAIL or CANNOT TELL, with reasons and what to do next.

    With --board, every view of the board is judged by a calibration that did not use it. Pictures without scans judge the
    intrinsics alone. Without --board the room itself is the target: that can contradict a calibration, and support it along
    the axes named, but never PASS as a whole. Nothing is written unless --write, --out or --report says so. The bounds are
    settings (`wallkit config show`, calib.verify).

    Exits 0 for PASS, 1 for FAIL, 4 when the data cannot tell, 2 if it could not be done.

    \b
    Examples:
      wallkit calib verify log.mcap --calib cal.toml --board board.toml --lidar-sigma lds-01
      wallkit calib verify log.mcap --calib cal.toml --board board.toml --urdf robot.urdf --report verify.html
      wallkit calib verify pictures/ --scans scans/ --calib cal.toml --board chessboard:11x8:0.019 --json
      wallkit calib verify drive.mcap --calib cal.toml
      wallkit calib verify log.mcap --calib cal.toml --board board.toml --set calib.verify.pixel_px=8
    """
    from wallkit.pipelines.calib.verify import VerifyRequest, verify_calibration
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.outputs import check_file_out, write_whole

    if given["write"] and (out is not None or calibration.suffix != ".toml"):
        hint = "give --out COPY.toml instead" if out is None else "choose --write or --out"
        raise click.UsageError(f"--write changes {calibration}, a .toml, in place; {hint}")
    for path in (p for p in (out, given["report"]) if p is not None):
        check_file_out(path, overwrite=overwrite)
    request = VerifyRequest(
        inputs=inputs,
        calibration=calibration,
        board=_board(board_words),
        scans=given["scans"],
        urdf=given["urdf"],
        lidar_link=given["lidar_link"],
        camera_link=given["camera_link"],
        prior=given["prior"],
        sigma_range=given["sigma"],
        scan_topic=given["scan_topic"],
        image_topic=given["image_topic"],
        lidar_height_m=given["lidar_height"],
        room=given["room"],
        seed=given["seed"],
    )
    limits = load_config(given["config_path"], given["words"]).config.calib.verify
    if dry_run:
        target = calibration if given["write"] else out or "nothing"
        click.echo(f"would judge {calibration} by {', '.join(map(str, inputs))} and write {target}")
        return
    with common.progress("looking", None, quiet=quiet) as update:
        found = verify_calibration(request, limits=limits, progress=update)
    if (target_file := calibration if given["write"] else out) is not None:
        from wallkit.calib.files.store import toml_from_calibration

        write_whole(target_file, toml_from_calibration(found.stored()).encode())
    if given["report"] is not None:
        from wallkit.pipelines.calib.verify_page import page_of

        write_whole(given["report"], page_of(found).encode())
    if as_json:
        from wallkit.pipelines.calib.verify_document import document

        common.emit(document(found))
    else:
        click.echo("\n".join(_page(found, is_stored=target_file is not None)))
        for note in found.notes:
            common.warn(note, quiet=quiet)
    ctx.exit(EXITS[found.judgement.verdict])


# ------------------------------------------------------------------------------------------------ details


def _board(words: str | None) -> Any:
    from wallkit.calib.board.boards import board_from

    return None if words is None else board_from(words)


def _page(found: Verification, *, is_stored: bool) -> list[str]:
    """All answers as a table, and the verdict at the end, where a terminal stands."""
    evidence = found.evidence
    lines = [
        f"judged    {found.request.calibration} by {found.looked_at} pictures, {len(evidence.boards)} with the board"
    ]
    lines += [f"left out  {name}: {why}" for name, why in found.left_out]
    lines += [f"left out  {view.name}: {view.why}" for view in evidence.views if view.why]
    if evidence.held_out:
        lines.append(f"held out  {evidence.held_out}")
        lines.append(f"sigma     of a range {evidence.sigma_range_m * 1e3:.0f} mm ({evidence.sigma_source})")
    asked = [gate for _, gate in found.judgement.gates if gate.verdict]
    rows = [[g.verdict, g.name, f"{g.value:.4g} {g.unit}".rstrip(), g.wanted, g.refused] for g in asked]
    lines += ["", *common.table(["", "asked", "found", "PASS", "FAIL"], rows).splitlines()]
    skipped = [gate for _, gate in found.judgement.gates if not gate.verdict and "alone" not in gate.reason]
    if found.is_camera_alone:
        lines += ["", f"not asked {len(skipped)} questions about a LiDAR: pictures come without scans (--scans)"]
    elif skipped:
        lines += ["", *(f"not asked {gate.name}: {gate.reason}" for gate in skipped)]
    return [*lines, "", *_ending(found, is_stored=is_stored)]


def _ending(found: Verification, *, is_stored: bool) -> list[str]:
    """What a person takes away in five seconds."""
    from wallkit.calib.verify.sure import pixel_error_at
    from wallkit.pipelines.calib.verify import next_step, pixel_words, verdict_meaning

    judgement = found.judgement
    lines = [f"{judgement.verdict}: {verdict_meaning(found)}"]
    reasons = [g for _, g in judgement.gates if g.verdict == judgement.verdict and g.reason]
    lines += [f"  because  {gate.reason}" for gate in reasons[:_MOST_REASONS]]
    if len(reasons) > _MOST_REASONS:
        lines.append(f"           and {len(reasons) - _MOST_REASONS} more, in the table")
    if found.calibration.T_camera_lidar is not None:
        lines.append(f"  means    {pixel_words(found, pixel_error_at(found.evidence, found.limits.reference_m))}")
    is_done = judgement.verdict == "PASS" and is_stored
    return [*lines, f"  next     {'use it' if is_done else next_step(found)}"]
