"""`wallkit simulate`: worlds that answer back, with exact truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from wallkit.cli import common
from wallkit.cli.simulate.boards import boards
from wallkit.cli.simulate.dataset import dataset
from wallkit.cli.simulate.set import simulate_set_command

if TYPE_CHECKING:
    from wallkit.pipelines.simulate.log import LogRequest, Simulated


@click.group()
def simulate() -> None:
    """Make logs with exact truth from a semantic map, and pictures with labels to train on.

    Needs MuJoCo: pip install 'wallkit[sim]'. Pictures need OpenGL; `wallkit doctor` says whether it works.
    """


simulate.add_command(boards)


@simulate.command("log")
@click.argument("map_path", type=click.Path(path_type=Path), metavar="MAP")
@click.option("--robot", "robot_path", type=click.Path(path_type=Path), metavar="URDF", help="Else one with a LiDAR.")
@click.option("--scenario", type=click.Path(path_type=Path), metavar="TOML", help="What happens; else the defaults.")
@click.option(
    "--masks",
    type=click.Choice(["none", "raster", "exact"]),
    help="What each pixel shows, of all cameras; raster is fast, exact is slow and needs no OpenGL.",
)
@click.option("--preview", "as_preview", is_flag=True, help="One PNG of one moment instead of a log.")
@click.option("--at", "at_s", type=common.Number(), metavar="S", help="The moment of --preview; else the middle.")
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Processes that make pictures.")
@common.set_option
@common.seed_option
@common.out_option
@common.overwrite_option
@common.dry_run_option
@common.json_option
@common.quiet_option
def log(
    map_path: Path,
    robot_path: Path | None,
    scenario: Path | None,
    masks: Literal["none", "raster", "exact"] | None,
    as_preview: bool,
    at_s: float | None,
    jobs: int,
    words: tuple[str, ...],
    seed: int,
    out: Path | None,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Record a robot that drives through a map among people: log.mcap, truth.tum, and a manifest to make it again.

    The same map, robot, scenario and seed give the same log, pictures up to the OpenGL driver.

    \b
    Examples:
      wallkit simulate log floor.wkmap.urdf -o run1
      wallkit simulate log floor.wkmap.urdf --scenario busy.toml --seed 3 -o run3
      wallkit simulate log floor.wkmap.urdf --set crowd.walkers=8 --set duration_s=60 -o crowded
      wallkit simulate log floor.wkmap.urdf --scenario cameras.toml --preview -o look.png
      wallkit simulate log floor.wkmap.urdf --scenario cameras.toml --masks raster --jobs 2 -o seen
    """
    from dataclasses import asdict, replace

    from wallkit.pipelines.outputs import check_out
    from wallkit.pipelines.simulate.log import LogRequest, prepare, simulate_log
    from wallkit.simulate.robot import DEFAULT_ROBOT
    from wallkit.simulate.scenario import read_scenario

    story = read_scenario(scenario, words)
    if masks is not None:
        story = replace(story, cameras=tuple(replace(camera, masks=masks) for camera in story.cameras))
    request = LogRequest(map_path, story, robot_path or DEFAULT_ROBOT, seed)
    name = f"{map_path.name.partition('.')[0]}-{seed}"
    if as_preview:
        _preview(request, at_s, out or Path(f"{name}.png"), overwrite=overwrite, dry_run=dry_run)
        return
    out = out or Path(name)
    if dry_run:
        check_out(out, overwrite=overwrite)
        play = prepare(request)
        click.echo(
            f"would write {out}: {play.duration_s:.1f} s, {len(play.people.agents)} people, robot '{play.robot.name}'"
        )
        return
    with common.progress("simulate", 100, quiet=quiet) as update:
        done = simulate_log(request, out, overwrite=overwrite, jobs=jobs, progress=update)
    if as_json:
        common.emit({"out": out, "seed": seed, **asdict(done)})
    else:
        click.echo("\n".join(_lines(out, done)))


def _preview(request: LogRequest, at_s: float | None, out: Path, *, overwrite: bool, dry_run: bool) -> None:
    import contextlib

    from wallkit.pipelines.outputs import check_file_out, write_whole
    from wallkit.pipelines.simulate.log import check_pictures, prepare
    from wallkit.pipelines.simulate.preview import preview

    check_file_out(out, overwrite=overwrite)
    check_pictures(request.scenario)
    with contextlib.closing(prepare(request)) as play:
        time_s = play.duration_s / 2 if at_s is None else at_s
        if not 0 <= time_s <= play.duration_s:
            raise click.UsageError(f"--at {time_s:g} is not within the log's {play.duration_s:.1f} s")
        if not dry_run:
            write_whole(out, preview(play, time_s))
    click.echo(
        f"{'would write' if dry_run else 'preview'}  {out}: {len(request.scenario.cameras)} cameras and the scan"
    )


def _lines(out: Path, done: Simulated) -> list[str]:
    messages = ", ".join(f"{count} {topic}" for topic, count in done.messages.items())
    lost = ", ".join(f"{count} of {name}" for name, count in done.dropped.items() if count)
    return [
        f"log      {out / 'log.mcap'}: {done.duration_s:.1f} s, {done.path_m:.1f} m, {done.people} people",
        f"messages {messages}",
        f"lost     {lost or 'nothing'} (as the scenario's timing asks)",
        f"truth    {out / 'truth.tum'}, and sweep by sweep {out / 'truth.csv'}",
        f"hardness {100 * done.unmapped_share:.1f} % of all returns come from what is not in the map",
        f"try      wallkit localize {out / 'log.mcap'} --map {out / 'map.wkmap.urdf'}",
    ]


simulate.add_command(dataset)
simulate.add_command(simulate_set_command)
