"""`wallkit bench covariance`: how often the truth lies in the intervals that calibration reports."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.calib.extrinsics.coverage import Coverage


def _counts(_: click.Context, __: click.Parameter, value: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in value.split(","))
    except ValueError as error:
        raise click.BadParameter("whole numbers with commas between, for example 12,20,40") from error


@click.command()
@click.option("--seeds", type=click.IntRange(min=10), default=500, show_default=True, help="Worlds of each kind.")
@click.option("--views", default="12,20,40", show_default=True, callback=_counts, help="Numbers of board poses.")
@click.option(
    "--lidar", type=click.Choice(["2D", "3D", "both"]), default="both", show_default=True, help="Kind of LiDAR."
)
@click.option(
    "--excess",
    type=common.Number(),
    default=1.0,
    show_default=True,
    help="How much larger board poses err than they say.",
)
@common.quiet_option
@common.json_option
@click.pass_context
def covariance(
    ctx: click.Context, /, seeds: int, views: tuple[int, ...], lidar: str, excess: float, quiet: bool, as_json: bool
) -> None:
    """Count how often the truth lies in the 95 % intervals of LiDAR-camera calibration, on simulated worlds.

    Every world has a mounting, boards and noise of its own; each board pose errs as a whole. The clustered intervals must
    hold the truth 92 to 98 times of 100, and so must the test of all six axes at once that `calib verify` uses; between two
    solves, of which one is known by what its file says, 90 will do. The columns beside them are what two simpler ways
    would have reached: the noise as declared, and (J'J)^-1 over points.

    Exits 0 if they do, 1 if not.

    \b
    Examples:
      wallkit bench covariance
      wallkit bench covariance --seeds 60 --lidar 2D --excess 2
    """
    from wallkit.calib.extrinsics.coverage import coverage
    from wallkit.calib.extrinsics.observability import DEGREES_OF_FREEDOM
    from wallkit.calib.extrinsics.worlds import World

    found: list[Coverage] = []
    for name in ["2D", "3D"] if lidar == "both" else [lidar]:
        for count in views:
            with common.progress(f"{name}, {count} views", seeds, quiet=quiet) as done:
                found.append(coverage(World(is_planar=name == "2D", excess=excess), count, seeds, done=done))
    if as_json:
        common.emit({"degrees_of_freedom": DEGREES_OF_FREEDOM, "seeds": seeds, "rows": [_row(c) for c in found]})
    else:
        rows = [
            [
                c.sensor,
                str(c.views),
                *(f"{100 * v:.1f}" for v in c.covered),
                f"{100 * c.joint:.1f}",
                f"{100 * c.agreed:.1f}",
                _range(c.predicted),
                _range(c.naive),
                f"{c.squared:.1f}",
            ]
            for c in found
        ]
        headers = [
            "LiDAR",
            "views",
            *DEGREES_OF_FREEDOM,
            "all six",
            "two solves",
            "as declared",
            "per point",
            "error^2",
        ]
        click.echo(common.table(headers, rows, right=tuple(range(1, len(headers)))))
        click.echo(f"% of {seeds} worlds in which the truth lies in the 95 % interval; 92 to 98 is honest")
        click.echo("all six, two solves: the test of all axes at once against the truth, and against another solve")
        click.echo(
            "error^2: mean squared error of all six over the declared covariance; 6 where boards err as they say"
        )
    ctx.exit(common.OK if all(c.is_honest for c in found) else common.FAILED_CHECK)


def _range(shares: Iterable[float]) -> str:
    values = [100 * float(v) for v in shares]
    return f"{min(values):.0f}...{max(values):.0f}"


def _row(c: Coverage) -> dict[str, object]:
    return {
        "lidar": c.sensor,
        "views": c.views,
        "covered": c.covered,
        "covered_all_six": c.joint,
        "two_solves_agree": c.agreed,
        "covered_as_declared": c.predicted,
        "covered_per_point": c.naive,
        "squared_error_as_declared": c.squared,
        "is_honest": c.is_honest,
    }
