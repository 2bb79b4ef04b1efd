"""`wallkit simulate`: worlds that answer back, with exact truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.simulate_log import Simulated


@click.group()
def simulate() -> None:
    """Make logs with exact truth from a semantic map: LiDAR, odometry, people and doors.

    Needs MuJoCo: pip install 'wallkit[sim]'.
    """


@simulate.command("log")
@click.argument("map_path", type=click.Path(path_type=Path), metavar="MAP")
@click.option("--robot", "robot_path", type=click.Path(path_type=Path), metavar="URDF", help="Else one with a LiDAR.")
@click.option("--scenario", type=click.Path(path_type=Path), metavar="TOML", help="What happens; else the defaults.")
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
    words: tuple[str, ...],
    seed: int,
    out: Path | None,
    overwrite: bool,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Record a robot that drives through a map among people: log.mcap, truth.tum, and a manifest to make it again.

    The same map, robot, scenario and seed give the same log.

    \b
    Examples:
      wallkit simulate log floor.wkmap.urdf -o run1
      wallkit simulate log floor.wkmap.urdf --scenario busy.toml --seed 3 -o run3
      wallkit simulate log floor.wkmap.urdf --set crowd.walkers=8 --set duration_s=60 -o crowded
    """
    from dataclasses import asdict

    from wallkit.pipelines.outputs import check_out
    from wallkit.pipelines.simulate_log import LogRequest, prepare, simulate_log
    from wallkit.simulate.robot import DEFAULT_ROBOT
    from wallkit.simulate.scenario import read_scenario

    out = out or Path(f"{map_path.name.partition('.')[0]}-{seed}")
    request = LogRequest(map_path, read_scenario(scenario, words), robot_path or DEFAULT_ROBOT, seed)
    if dry_run:
        check_out(out, overwrite=overwrite)
        play = prepare(request)
        click.echo(
            f"would write {out}: {play.duration_s:.1f} s, {len(play.people.agents)} people, robot '{play.robot.name}'"
        )
        return
    with common.progress("simulate", 100, quiet=quiet) as update:
        done = simulate_log(request, out, overwrite=overwrite, progress=update)
    if as_json:
        common.emit({"out": out, "seed": seed, **asdict(done)})
    else:
        click.echo("\n".join(_lines(out, done)))


def _lines(out: Path, done: Simulated) -> list[str]:
    messages = ", ".join(f"{count} {topic}" for topic, count in done.messages.items())
    lost = ", ".join(f"{count} of {name}" for name, count in done.dropped.items() if count)
    return [
        f"log      {out / 'log.mcap'}: {done.duration_s:.1f} s, {done.path_m:.1f} m, {done.people} people",
        f"messages {messages}",
        f"lost     {lost or 'nothing'} (as the scenario's timing asks)",
        f"truth    {out / 'truth.tum'}",
        f"try      wallkit localize {out / 'log.mcap'} --map {out / 'map.wkmap.urdf'}",
    ]
