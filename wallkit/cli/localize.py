"""`wallkit localize`: where was the robot?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common
from wallkit.cli.up_camera import camera_from_flags, up_camera_options

if TYPE_CHECKING:
    from wallkit.logs.rig import Wanted
    from wallkit.pipelines.cameras import CameraRequest
    from wallkit.pipelines.evaluate import Evaluation
    from wallkit.pipelines.localize import Prepared, Run
    from wallkit.pipelines.run_folder import RunRecord

LOGS = click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="LOG...")

topic_options = common.options(
    click.option("--scan", metavar="TOPIC", help="LiDAR topic, when the log has several."),
    click.option("--odom", metavar="TOPIC", help='Odometry topic or transform "odom->base_link".'),
    click.option("--base-frame", metavar="FRAME", help="Frame that odometry moves, when its messages do not say."),
    click.option("--lidar-pose", metavar="X,Y,YAW", help="LiDAR on the robot [m, rad]; also X,Y,Z,ROLL,PITCH,YAW."),
    click.option(
        "--urdf", type=click.Path(path_type=Path), metavar="FILE", help="Robot description to take poses from."
    ),
)


camera_options = common.options(
    click.option(
        "--filter",
        "filters",
        multiple=True,
        metavar="NAME",
        help="wall_mask, soft_mask, reject_dynamic (cameras); line_fit, novelty (LiDAR alone); several multiply.",
    ),
    click.option("--model", metavar="FILE.onnx|oracle", help="What segments images; else wallkit's own model."),
    click.option(
        "--calib", "calibrations", multiple=True, type=click.Path(path_type=Path), metavar="FILE",
        help="Camera and LiDAR; once for each camera.",
    ),
    click.option("--camera", "cameras", multiple=True, metavar="NAME|TOPIC", help="Whose images, if not found by frame."),
    click.option("--allow-unverified", is_flag=True, help="Use a calibration that `calib verify` has refused."),
    click.option("--fallback", type=click.Choice(["lidar"]), help="Go on without cameras that cannot be used."),
    click.option("--overlay", "overlays", type=click.IntRange(min=0), default=0, metavar="N",
                 help="Draw N images with masks and returns."),
)  # fmt: skip


@click.command()
@LOGS
@click.option(
    "--map",
    "map_path",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Map; else wallkit.toml's, else the log's.",
)
@click.option(
    "--ceiling", type=click.Path(path_type=Path), metavar="FILE", help="Ceiling: with a map fused with it, else alone."
)
@click.option(
    "--init", metavar="WHERE", help="X,Y,YAW | topic | truth | global | everywhere  [default: topic, else global]"
)
@click.option("--truth", metavar="TOPIC|FILE.tum", help='True poses, if not found by name; also "map->base_link".')
@topic_options
@camera_options
@up_camera_options
@click.option("--start", type=common.Number(), metavar="S", help="Begin so many seconds after the first scan.")
@click.option("--end", type=common.Number(), metavar="S", help="End so many seconds after the first scan.")
@click.option("--particles", type=int, metavar="N", help="Particles (localize.particles).")
@click.option(
    "--seeds", type=click.IntRange(min=1), default=1, metavar="N", help="Run with N seeds, starting at --seed."
)
@click.option(
    "--format", "stream", type=click.Choice(["tum", "csv", "ndjson"]), help="Poses as a stream on stdout, with --out -."
)
@common.out_option
@common.overwrite_option
@common.config_option
@common.set_option
@common.seed_option
@common.json_option
@common.quiet_option
@common.dry_run_option
@click.pass_context
def localize(ctx: click.Context, /, logs: tuple[Path, ...], **flags: Any) -> None:
    """Find where the robot was, from a recorded log and a map.

    Reads MCAP, ROS 1 and ROS 2 bags and CARMEN logs; several files and folders are one recording. Results go to --out,
    else to LOG.wallkit in this folder: trajectories, metrics.json, report.html, and result.mcap for Foxglove.

    Exits 0 if the robot is LOCALIZED at the end, 4 if not, 3 if data was lost on the way, 2 if it could not be done.

    \b
    Examples:
      wallkit localize log.mcap --map floor.yaml
      wallkit localize log.mcap --map floor.yaml --init 1.5,2,0 --seeds 10
      wallkit localize bag/ --map floor.yaml --lidar-pose 0.2,0,0 --set localize.particles=5000
      wallkit localize log.mcap --map floor.yaml --filter line_fit
      wallkit localize log.mcap --map floor.yaml --filter wall_mask --calib front.toml --model walls.onnx --overlay 4
      wallkit localize log.mcap --ceiling ceiling.yaml --init everywhere
      wallkit localize log.mcap --map floor.yaml --ceiling ceiling.yaml
      wallkit localize log.mcap --map floor.yaml --out - --format tum > poses.tum
    """
    from wallkit.evaluate.resources import begin
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.localize import prepare

    mark = begin()
    loaded = load_config(
        flags["config_path"],
        flags["words"],
        {
            "localize.particles": (flags["particles"], "--particles"),
            "points.filters": (filters_from_words(flags["filters"]), "--filter"),
        },
    )
    request = request_from_flags(logs, flags)
    streaming = flags["out"] is not None and str(flags["out"]) == "-"
    out = flags["out"] or default_out(logs[0])
    if not streaming:
        _check_flags(flags)
        from wallkit.pipelines.outputs import check_out

        check_out(out, overwrite=flags["overwrite"])
    prepared = prepare(request, loaded.config, seeds=flags["seeds"])
    for warning in warnings_of(prepared):
        common.warn(warning, quiet=flags["quiet"])
    if flags["dry_run"]:
        _say_plan(prepared, out)
    elif streaming:
        ctx.exit(_stream(prepared, loaded, flags))
    else:
        ctx.exit(_run_all_seeds(prepared, loaded, out, mark, flags))


def request_from_flags(logs: tuple[Path, ...], flags: dict[str, Any]) -> Any:
    """The pipeline's request."""
    from wallkit.pipelines.localize import Request

    return Request(
        logs=logs,
        map=flags["map_path"],
        init=flags["init"],
        truth=flags["truth"],
        seed=flags["seed"],
        start_s=flags["start"],
        end_s=flags["end"],
        wanted=wanted_from_flags(flags),
        cameras=cameras_from_flags(flags),
        ceiling=flags["ceiling"],
        camera=camera_from_flags(flags),
    )


def cameras_from_flags(flags: dict[str, Any]) -> CameraRequest:
    """What the user says about cameras."""
    from wallkit.pipelines.cameras import CameraRequest

    return CameraRequest(
        calibrations=flags["calibrations"],
        cameras=flags["cameras"],
        model=flags["model"] or "",
        allow_unverified=flags["allow_unverified"],
        may_fall_back=flags["fallback"] is not None,
        overlays=flags["overlays"],
    )


def filters_from_words(words: tuple[str, ...]) -> tuple[str, ...] | None:
    """Names of filters, also with commas between; none: an empty list. None when nothing was said."""
    names = tuple(name for word in words for name in word.split(",") if name)
    return None if not words else () if names == ("none",) else names


def warnings_of(prepared: Prepared) -> list[str]:
    """What is odd about the map and the cameras."""
    found = [str(finding) for finding in prepared.map.findings if finding.severity != "info"]
    found += [note for camera in (prepared.sight.cameras if prepared.sight else ()) for note in camera.notes]
    cameras = prepared.request.cameras
    if prepared.fallen_back:
        found.append(f"the LiDAR alone is used: {prepared.fallen_back}")
    elif prepared.sight is None and (cameras.model or cameras.calibrations or cameras.overlays):
        found.append("nothing looks through the camera: --filter wall_mask, soft_mask or reject_dynamic would")
    return found


def wanted_from_flags(flags: dict[str, Any]) -> Wanted:
    """Topics and frames named by the user."""
    from wallkit.logs.rig import Wanted

    return Wanted(
        scan=flags["scan"],
        odometry=flags["odom"],
        base_frame=flags["base_frame"],
        lidar_pose=flags["lidar_pose"],
        urdf=flags["urdf"],
    )


def default_out(log: Path) -> Path:
    """LOG.wallkit in the current folder."""
    return Path(f"{log.resolve().name.removesuffix(log.suffix)}.wallkit")


def _check_flags(flags: dict[str, Any]) -> None:
    if flags["stream"]:
        raise click.UsageError("--format writes a stream: add --out -")


def _run_all_seeds(prepared: Prepared, loaded: Any, out: Path, mark: Any, flags: dict[str, Any]) -> int:
    """The runs of all seeds into one folder (a folder each if there are several), and the last word on stdout."""
    from wallkit.pipelines.outputs import result_folder
    from wallkit.pipelines.seeds import run_seed, write_seeds

    with result_folder(out, overwrite=flags["overwrite"]) as folder:
        total = prepared.rig.scan.count
        if flags["seeds"] == 1:
            with common.progress("scans", total, quiet=flags["quiet"]) as observe:
                run, record, evaluation = run_seed(prepared, loaded, folder, mark=mark, observe=observe)
            records = [(record, evaluation)]
        else:
            records = []
            with common.progress("seeds", flags["seeds"], quiet=flags["quiet"]) as observe:
                for i in range(flags["seeds"]):
                    seed = flags["seed"] + i
                    run, record, evaluation = run_seed(prepared, loaded, folder / f"seed-{seed}", seed=seed)
                    records.append((record, evaluation))
                    observe(i + 1)
            write_seeds(folder, records)
    if flags["as_json"]:
        common.emit(records[-1][0].answer if len(records) == 1 else _summary(records))
    elif len(records) == 1:
        click.echo("\n".join(five_lines(run, record, evaluation, out)))
    else:
        click.echo(seeds_table(records))
        click.echo(f"results  {out}")
    return exit_code(run, records)


def five_lines(run: Run, record: RunRecord, evaluation: Evaluation, out: Path) -> list[str]:
    """Where, how sure, how wrong, how fast, what was dropped."""
    answer, numbers = record.answer, evaluation.metrics
    pose, places = answer["pose"], len(answer["modes"])
    rivals = "" if answer["health"] == "LOCALIZED" else f"; {places} place{'s' if places != 1 else ''} may be right"
    lines = [
        f"where    x {pose['x_m']:.2f} m, y {pose['y_m']:.2f} m, yaw {pose['yaw_rad']:.3f} rad in the map at the end",
        (
            f"sure     {answer['health']} at the end, {numbers['localized_share'].value:.1%} of {len(record.steps)} scans; "
            f"1 sigma {max(pose['sd_x_m'], pose['sd_y_m']):.2f} m, {pose['sd_yaw_rad']:.3f} rad{rivals}"
        ),
    ]
    if "ate_rmse_m" in numbers:
        lines.append(
            f"wrong    {numbers['ate_rmse_m'].value:.3f} m rmse, {numbers['ate_max_m'].value:.2f} m at most, heading "
            f"{numbers['heading_error_mean_deg'].value:.2f} deg; false healthy {numbers['false_healthy'].value:.0f}"
        )
    else:
        lines.append("wrong    not known: the log holds no truth (--truth)")
    wall, updates = record.resources["wall_s"].value or 0.0, numbers["update_median_ms"].value or 0.0
    span = (record.steps.stamps_ns[-1] - record.steps.stamps_ns[0]) / 1e9
    lines.append(
        f"fast     {wall:.1f} s for {span:.0f} s of log; {updates:.2f} ms per update, {numbers['updates'].value:.0f} updates"
    )
    if run.filtering is not None:
        lines.append(f"filter   {'; '.join(run.filtering.lines())}")
    lines.append(f"dropped  {drop_line(run)}")
    return [*lines, "", f"report   {out / 'report.html'}"]


def drop_line(run: Run) -> str:
    """What was left out, in one line."""
    sync, loss = run.sync, run.loss.lines()
    parts = [f"{n} of {sync.scans} scans ({reason})" for reason, n in sync.scans_dropped.items()]
    parts += [f"{n} odometry messages ({reason})" for reason, n in sync.odometry_dropped.items()]
    return "; ".join([*parts, *loss]) or f"nothing of {sync.scans} scans"


def exit_code(run: Run, records: list[Any]) -> int:
    """4 if any run ends not LOCALIZED, 3 if data was lost, else 0."""
    if any(record.answer["health"] != "LOCALIZED" for record, _ in records):
        return common.CANNOT_TELL
    if run.loss or run.sync.share_dropped > 0.01:
        return common.DATA_LOST
    return common.OK


def seeds_table(records: list[Any]) -> str:
    """Mean, sd and worst over the seeds of what matters."""
    from wallkit.evaluate.statistics import summarise

    spreads = summarise([{**e.metrics, **r.resources} for r, e in records])
    keys = ("ate_rmse_m", "ate_max_m", "heading_error_mean_deg", "updates_to_converge", "false_healthy", "availability")
    rows = []
    for key in (*keys, "localized_share", "update_mean_ms"):
        if (spread := spreads.get(key)) is not None and spread.mean is not None:
            worst = "-" if spread.worst is None else f"{spread.worst:.4g}"
            rows.append([key, f"{spread.mean:.4g}", f"{spread.sd or 0:.2g}", worst, str(spread.runs - spread.missing)])
    localized = sum(r.answer["health"] == "LOCALIZED" for r, _ in records)
    title = f"{localized} of {len(records)} seeds end LOCALIZED"
    return title + "\n" + common.table(["metric", "mean", "sd", "worst", "seeds"], rows, right=(1, 2, 3, 4))


def _summary(records: list[Any]) -> dict[str, Any]:
    from wallkit.pipelines.seeds import summary_document

    return summary_document(records)


def _say_plan(prepared: Prepared, out: Path) -> None:
    p = prepared
    start = p.start if isinstance(p.start, str) else f"pose {', '.join(f'{v:.2f}' for v in p.start.pose)}"
    height, width = p.map.fields.shape
    click.echo(f"reads    {p.log.name} ({', '.join(p.log.formats)}): {p.rig.scan.topic}, {p.rig.odometry}")
    click.echo(f"mount    {p.rig.mount.source}")
    click.echo(f"map      {p.map.grid.source}: {width} x {height} cells of {p.map.fields.resolution_m:g} m")
    if p.overhead is not None:
        across, along = p.overhead.ceiling.size_m
        how = "alone" if p.overhead.is_alone else "beside the LiDAR"
        click.echo(
            f"ceiling  {p.overhead.path}: {across:.1f} x {along:.1f} m, seen by {p.overhead.up.channel.topic}, {how}"
        )
    click.echo(f"start    {start}; truth: {'yes' if p.truth is not None else 'no'}")
    click.echo(f"filter   {p.config.localize.tracker}, {p.config.localize.particles} particles")
    if p.config.points.filters:
        click.echo(f"returns  {', '.join(p.config.points.filters)}")
    for camera in p.sight.cameras if p.sight else ():
        click.echo(f"camera   {camera.name}: {camera.topic}, {camera.source}, model {p.sight.model if p.sight else ''}")
    click.echo(f"writes   {out}/  (dry run: nothing is written)")


def _stream(prepared: Prepared, loaded: Any, flags: dict[str, Any]) -> int:
    from wallkit.pipelines.localize import localize as run_localize
    from wallkit.pipelines.streams import STREAMS

    run = run_localize(prepared)
    for line in STREAMS[flags["stream"] or "tum"](run.steps):
        click.echo(line)
    return common.OK if run.estimate.health.name == "LOCALIZED" else common.CANNOT_TELL
