"""`wallkit bench polygons` and `bench filter`: what it costs to look up LiDAR points in images."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.bench.points import Part

_POLYGONS = click.option("--polygons", type=click.IntRange(1), default=20, show_default=True, help="In the image.")
_CORNERS = click.option("--corners", type=click.IntRange(3), default=100, show_default=True, help="Of each polygon.")


@click.command()
@click.option("--points", type=click.IntRange(1), default=1080, show_default=True, help="Asked for.")
@_POLYGONS
@_CORNERS
@common.json_option
def polygons(points: int, polygons: int, corners: int, as_json: bool) -> None:
    """Time crossing number, winding number, even-odd and mask look-up. CPU time of one thread.

    \b
    Examples:
      wallkit bench polygons
      wallkit bench polygons --points 7560 --corners 400
    """
    from wallkit.pipelines.bench.points import time_polygons

    _say(time_polygons(points, polygons, corners), as_json=as_json)


@click.command("filter")
@click.option("--beams", type=click.IntRange(10), default=1080, show_default=True, help="All of them in the image.")
@_POLYGONS
@_CORNERS
@click.option("--particles", type=click.IntRange(1), default=2000, show_default=True, help="Of the update beside it.")
@common.json_option
def bench_filter(beams: int, polygons: int, corners: int, particles: int, as_json: bool) -> None:
    """Time the camera filter without its network, part by part, and a whole update with and without it. CPU time.

    \b
    Examples:
      wallkit bench filter
      wallkit bench filter --beams 360 --json
    """
    from wallkit.pipelines.bench.points import time_filter

    _say(time_filter(beams, polygons, corners, particles), as_json=as_json)


def _say(parts: list[Part], *, as_json: bool) -> None:
    from dataclasses import asdict

    from wallkit.pipelines.run_folder import machine

    if as_json:
        common.emit({"machine": machine(), "parts": [asdict(part) for part in parts]})
        return
    rows = [[part.name, f"{part.median_ms:.3f}", f"{part.p95_ms:.3f}", part.note] for part in parts]
    click.echo(common.table(["part", "median ms", "95 %", ""], rows, right=(1, 2)))
