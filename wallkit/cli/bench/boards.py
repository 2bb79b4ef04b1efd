"""`wallkit bench boards`: how often the truth lies in the intervals that calibration reports of rendered captures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common
from wallkit.cli.calib.board import board_option

if TYPE_CHECKING:
    from wallkit.pipelines.bench.boards import Recovery


@click.command()
@board_option
@click.option("--seeds", type=click.IntRange(min=1), default=20, show_default=True, help="Captures of each kind.")
@click.option("--poses", type=click.IntRange(min=8), default=20, show_default=True, help="Of the board in each.")
@click.option("--lidar", type=click.Choice(["2D", "3D"]), default="2D", show_default=True, help="Kind of LiDAR.")
@click.option("--robot", type=click.Path(path_type=Path), metavar="URDF", help="Else one with three cameras.")
@common.set_option
@common.quiet_option
@common.json_option
@click.pass_context
def boards(
    ctx: click.Context,
    /,
    board_words: str,
    seeds: int,
    poses: int,
    lidar: str,
    robot: Path | None,
    words: tuple[str, ...],
    quiet: bool,
    as_json: bool,
) -> None:
    """Calibrate simulated captures of a board, and count how often the truth lies in the 95 % intervals.

    Unlike `bench covariance`, which draws its errors, the board is rendered, found in pictures and scans, and solved as a
    user would, with the true intrinsics. Some six seconds a capture; needs OpenGL.

    Exits 0 unless an unknown is missed more often than one in a thousand such tables would.

    \b
    Examples:
      wallkit bench boards --board calib/boards/chessboard-plate-610x850.toml
      wallkit bench boards --board chessboard:5x7:0.095 --lidar 3D --robot calib/robot.urdf -s lidar.frame=lidar_3d
    """
    from wallkit.calib.board.boards import board_from
    from wallkit.pipelines.bench.boards import recoveries
    from wallkit.simulate.robot import DEFAULT_ROBOT
    from wallkit.simulate.scanner import Rings

    found: list[Recovery] = []
    rings = Rings() if lidar == "3D" else None
    with common.progress(f"{lidar} captures", seeds, quiet=quiet) as done:
        for recovery in recoveries(
            board_from(board_words),
            range(seeds),
            poses=poses,
            rings=rings,
            robot_path=robot or DEFAULT_ROBOT,
            words=words,
        ):
            found.append(recovery)
            done(len(found))
    if as_json:
        common.emit({"lidar": lidar, "board": board_words, "captures": [_row(r) for r in found]})
    else:
        click.echo("\n".join(_table(lidar, found)))
    ctx.exit(common.OK if _is_honest(found) else common.FAILED_CHECK)


def _is_honest(found: list[Recovery]) -> bool:
    """Whether every unknown is covered as often as 95 % allows: P(as few or fewer) of six unknowns above 0.001."""
    from scipy.stats import binom

    hits = [sum(bool(r.covered[k]) for r in found) for k in range(6)]
    return all(float(binom.cdf(n, len(found), 0.95)) > 0.001 / 6 for n in hits)


def _table(lidar: str, found: list[Recovery]) -> list[str]:
    import numpy as np

    from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM
    from wallkit.pipelines.bench.boards import joined

    units = np.array([np.degrees(1)] * 3 + [1e3] * 3)
    whole = joined(found)
    hits = np.sum([r.covered for r in found], axis=0)
    mean = np.mean([r.off for r in found], axis=0) * units
    rows = [
        ["in the interval", *(f"{n} of {len(found)}" for n in hits)],
        ["mean error", *(f"{v:+.3f}" for v in mean)],
        ["RMS error", *(f"{v:.3f}" for v in whole.off * units)],
        ["reported sigma", *(f"{v:.3f}" for v in whole.sigma * units)],
    ]
    headers = [lidar, *(f"{name} {'deg' if k < 3 else 'mm'}" for k, name in enumerate(DEGREES_OF_FREEDOM))]
    total = 6 * len(found)
    return [
        common.table(headers, rows, right=tuple(range(1, 7))),
        f"{int(hits.sum())} of {total} unknowns ({100 * hits.sum() / total:.1f} %) lie in their 95 % interval",
        f"{whole.used} of {whole.held} poses were usable",
        f"corners: RMS {whole.rms_px:.3f} px about where the truth projects them, bias {whole.bias_px:.4f} px",
    ]


def _row(r: Recovery) -> dict[str, object]:
    return {
        "seed": r.seed,
        "poses": r.held,
        "used": r.used,
        "kind": r.kind,
        "error": r.off,
        "sigma": r.sigma,
        "half_width_95": r.half_width,
        "rms_px": r.rms_px,
        "bias_px": r.bias_px,
    }
