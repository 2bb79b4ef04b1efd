"""`wallkit demo`: everything on the sample inside the package, from the map to the table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.demo import Demo


@click.command()
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    default=Path("wallkit-demo"),
    show_default=True,
    help="Folder for the results.",
)
@common.overwrite_option
@common.json_option
@common.quiet_option
@click.pass_context
def demo(ctx: click.Context, /, out: Path, overwrite: bool, as_json: bool, quiet: bool) -> None:
    """Do everything on the sample inside the package, and check what comes out.

    A robot with a LiDAR and a camera starts somewhere in a restroom and corridor, not knowing where; six people walk about.
    The map is validated, the calibration verified, the default model run on the pictures, and the log localized without a
    filter, with filters of the LiDAR alone, and with the camera's. Needs no network and no display; the first run compiles
    the kernels, which takes some seconds.

    Exits 0 if all is as expected, 1 if something differs.

    \b
    Examples:
      wallkit demo
      wallkit demo --out /tmp/demo --overwrite
    """
    from wallkit.pipelines.demo import expected_answers, run_demo, surprises
    from wallkit.pipelines.outputs import result_folder

    def observe(doing: str) -> None:
        if not quiet:
            click.echo(f"{doing} ...", err=True)

    with result_folder(out, overwrite=overwrite) as folder:
        done = run_demo(folder, observe)
    surprised = surprises(done, expected_answers())
    if as_json:
        common.emit(_document(done, surprised, out))
    else:
        for line in _page(done, surprised, out):
            click.echo(line)
    if surprised:
        ctx.exit(common.FAILED_CHECK)


# ------------------------------------------------------------------------------------------------ details


def _page(found: Demo, surprised: Sequence[str], out: Path) -> list[str]:
    """What a person takes away: the table, and in words what was judged and what the table says."""
    from wallkit.pipelines.demo import answers
    from wallkit.report.demo import demo_headers, demo_rows

    headers = demo_headers()
    ending = [*answers(found), ("report", str(out / "report.html"))]
    ending.append(("verdict", "NOT as expected:" if surprised else "as expected"))
    width = max(len(what) for what, _ in ending) + 2
    return [
        common.table(headers, demo_rows(found.data), right=tuple(range(1, len(headers)))),
        "",
        *(f"{what:<{width}}{answer}" for what, answer in ending),
        *(f"  {surprise}" for surprise in surprised),
    ]


def _document(found: Demo, surprised: Sequence[str], out: Path) -> dict[str, Any]:
    from wallkit.pipelines.demo import conclusion, map_answer

    nearest, sure = conclusion(found)
    return {
        "map": map_answer(found.map),
        "calibration": found.calibration.verdict,
        "room": {gate.name: gate.verdict for gate in found.room},
        "methods": {
            name: [{k: v.value for k, v in {**e.metrics, **record.resources}.items()} for record, e in seeds]
            for name, seeds in found.runs.items()
        },
        "conclusion": [nearest, sure],
        "surprises": list(surprised),
        "out": out,
    }
