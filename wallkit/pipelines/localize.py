"""A recorded log and a map -> where the robot was, how far to trust it, and a folder that says so.

The whole run reads top to bottom in `localize`; start here to find your way in the code.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.steps import Steps
from wallkit.core.types import Estimate, StampedPose, Trajectory
from wallkit.errors import ConfigError, WallkitError
from wallkit.evaluate.resources import Mark, Timers, begin
from wallkit.evaluate.tum import read_tum
from wallkit.localize.ceiling_filter import CeilingLocalizer, ceiling_localizer
from wallkit.localize.ekf import ScanMatchingEkf, scan_matching_ekf
from wallkit.localize.filter import MonteCarloLocalizer, monte_carlo_localizer
from wallkit.localize.per_class import PerClass
from wallkit.logs.loss import Loss
from wallkit.logs.reader import Log, open_log
from wallkit.logs.results import ResultWriter
from wallkit.logs.rig import Rig, Wanted, find_rig
from wallkit.logs.sync import SyncReport
from wallkit.logs.topics import pick_truth
from wallkit.logs.trajectories import trajectory_of
from wallkit.pipelines.cameras import CameraRequest
from wallkit.pipelines.ceiling.camera import CameraWords
from wallkit.pipelines.config import Config
from wallkit.pipelines.localize_ceiling import Overhead, alone, checked, find_overhead, frames_and_views, seen_by
from wallkit.pipelines.maps import LoadedMap, load_map
from wallkit.pipelines.need import UpdatesAhead
from wallkit.pipelines.recorder import MessageWriter, Recorder
from wallkit.pipelines.shared import Shared
from wallkit.pipelines.sight import Sight, reason_of, sight_of
from wallkit.pipelines.start import check_on_map, find_start
from wallkit.pipelines.watch import Filtering, Moment, Watch
from wallkit.points.filters import apply_filters
from wallkit.points.labels import labelled_scan, thinned
from wallkit.report.data import Snapshot


@dataclass(frozen=True)
class Request:
    """What the user asked for.

    Attributes:
        logs: files and folders of one recording. map: None takes the log's own.
        init: "X,Y,YAW", "topic", "truth", "global", "everywhere"; None: topic when there is one, else global.
        truth: a topic, "map->base_link", a TUM file, or None for what the log calls its truth.
        start_s, end_s: seconds from the first scan; None for all.
        wanted: topics and frames named by the user.
        cameras: what filters look through, when one of them needs a camera or a model is named.
        ceiling: of a camera that looks up; with no map at all it is what the robot is localized by. camera: where that is.
    """

    logs: tuple[Path, ...]
    map: Path | None = None
    init: str | None = None
    truth: str | None = None
    seed: int = 0
    start_s: float | None = None
    end_s: float | None = None
    wanted: Wanted = field(default_factory=Wanted)
    cameras: CameraRequest = field(default_factory=CameraRequest)
    ceiling: Path | None = None
    camera: CameraWords = field(default_factory=CameraWords)

    def looks(self, config: Config) -> bool:
        """Whether cameras are used: by a filter, or by the sensor model that asks for classes."""
        by_sensor = isinstance(config.localize.sensor, PerClass)
        return config.points.needs_camera or (by_sensor and bool(self.cameras.model or self.cameras.calibrations))


@dataclass(frozen=True)
class Prepared:
    """Everything found and checked before the first scan is looked at.

    Attributes:
        sight: the cameras; None without. fallen_back: why they are not used although they were asked for.
        shared: what runs over the same log need only once; None: this run reads the log itself.
    """

    request: Request
    config: Config
    log: Log
    rig: Rig
    map: LoadedMap
    truth: Trajectory | None
    start: StampedPose | str
    window_ns: tuple[int | None, int | None]
    sight: Sight | None = None
    fallen_back: str = ""
    overhead: Overhead | None = None
    shared: Shared | None = None


@dataclass(frozen=True)
class Run:
    """What came out.

    Attributes:
        steps: one row per scan.
        estimate: the last one; its modes are every place the robot may be then.
        odometry: at every scan. snapshots: particles at a few moments.
        sync, loss: what was dropped on the way. timers: seconds by phase. mark: when the run began.
        filtering: what the point filters left; None without them. sights: a few moments to draw.
    """

    prepared: Prepared
    steps: Steps
    estimate: Estimate
    odometry: Trajectory
    snapshots: tuple[Snapshot, ...]
    sync: SyncReport
    loss: Loss
    timers: Timers
    mark: Mark
    filtering: Filtering | None = None
    moments: tuple[Moment, ...] = ()


Observer = Callable[[int], None]


def prepare(request: Request, config: Config, *, seeds: int = 1, shared: Shared | None = None) -> Prepared:
    """Open the log and the map, and find what is needed in them.

    Args:
        seeds: how many runs there will be: the log is read, and images are segmented, for the first only.
        shared: of other runs, with other settings, over the same log: it is read for the first of them only.

    Raises:
        WallkitError: something is missing; nothing has been computed or written yet.
    """
    shared = shared or (Shared() if seeds > 1 else None)
    log = shared.log(request.logs) if shared else open_log(request.logs)
    map_path = request.map or (Path(config.map) if config.map else None)
    overhead = find_overhead(log, request.ceiling, request.camera, config, has_map=map_path is not None)
    if overhead is not None and overhead.is_alone:
        rig, loaded, config = alone(overhead, map_path, config)
        sight, fallen_back = None, ""
    else:
        rig, loaded = find_rig(log, request.wanted), load_map(map_path, log, config.maps)
        sight, config, fallen_back = _find_sight(log, rig, request, config, holds_scans=seeds > 1)
        if sight is not None:
            rig = replace(rig, cameras=tuple(camera.wanted for camera in sight.cameras))
    loaded = checked(loaded, overhead)
    truth = _find_truth(log, request.truth)
    window = _window_ns(log, rig, request)
    start = find_start(log, request.init, truth, rig, window)
    if isinstance(start, StampedPose):
        check_on_map(start.pose, loaded)
    return Prepared(request, config, log, rig, loaded, truth, start, window, sight, fallen_back, overhead, shared)


def localize(
    prepared: Prepared,
    *,
    result_mcap: Path | None = None,
    observe: Observer | None = None,
    mark: Mark | None = None,
    moments: int = 0,
) -> Run:
    """Run the filter over the whole log.

    Args:
        result_mcap: where to write every step as messages; None does not.
        observe: called with the number of scans done after each.
        mark: when the run began, for its times.
        moments: how many images to keep with what the filters made of them.
    """
    p, timers, mark = prepared, Timers(), mark or begin()
    with timers.phase("prepare"):
        tracker, filters = _tracker(p), p.config.points.on(p.map.fields)
        of_lidar = p.config.points.without_camera().on(p.map.fields)
    rng = np.random.default_rng(np.random.SeedSequence(p.request.seed))
    belief: Any = tracker.start(rng, p.start)  # type: ignore[arg-type]  # _tracker refuses a spread for the EKF
    sync, recorder = SyncReport(), Recorder()
    watch = Watch(p.config.points, p.sight, moments)
    frames, views = frames_and_views(p.log, p.rig, p.overhead, p.config, sync, p.window_ns, p.shared)
    ahead = UpdatesAhead(p.config.localize)
    looked = p.sight.ahead(frames, ahead) if p.sight else ((frame, ()) for frame in frames)
    with _message_writer(p, result_mcap) as messages:
        for frame, sights in timers.each("read", looked):
            with timers.phase("filter"):
                began = time.perf_counter_ns()
                belief = tracker.predict(rng, belief, frame.odometry, frame.odometry_gap_s)
                whole, scan, seen = frame, labelled_scan(frame), None
                # the ceiling is seen at any time between two scans: each sensor has a rate of its own
                belief = seen_by(tracker, belief, views.until(frame.stamp_ns))
                # an image is looked at only for an update: most scans need none
                if p.sight is not None and tracker.wants(belief, scan):
                    ahead.restart(frame.odometry)
                    frame = thinned(frame, p.config.points.look.returns)
                    seen = p.sight.labels_of(frame, sights)
                    scan = labelled_scan(replace(frame, labels=seen.labels))
                has_given_up = p.sight is not None and p.sight.given_up
                scan = apply_filters(of_lidar if has_given_up else filters, scan, belief.estimate())
                belief, info = tracker.update(rng, belief, scan)
                elapsed_ms = (time.perf_counter_ns() - began) / 1e6
            estimate = belief.estimate(frame.stamp_ns)
            recorder.add(frame, estimate, info, belief, elapsed_ms + (seen.owed_ms if seen else 0.0))
            if filters and info.is_update:
                watch.add(frame, scan, seen, whole)
            if messages:
                with timers.phase("write"):
                    messages.add(frame, estimate, info, belief)
                    if filters and info.is_update:
                        messages.add_filtered(frame, scan, seen)
            if observe:
                observe(len(recorder))
    final = replace(estimate, modes=tracker.candidates(belief))
    return Run(
        p,
        recorder.steps(),
        final,
        recorder.odometry(),
        tuple(recorder.snapshots),
        sync,
        p.log.loss,
        timers,
        mark,
        watch.filtering() if filters else None,
        watch.moments(),
    )


def _find_sight(
    log: Log, rig: Rig, request: Request, config: Config, *, holds_scans: bool
) -> tuple[Sight | None, Config, str]:
    """The cameras, the settings, and why there are none: the user let the LiDAR alone stand in for them.

    Raises:
        WallkitError: cameras are needed and cannot be used.
    """
    if not request.looks(config):
        return None, config, ""
    try:
        sight = sight_of(
            log,
            request.cameras,
            config.points,
            config.segment,
            rig=rig,
            image_tolerance_s=config.logs.image_tolerance_s,
            holds_scans=holds_scans,
        )
    except WallkitError as error:
        if not request.cameras.may_fall_back:
            raise
        return None, replace(config, points=config.points.without_camera()), reason_of(error)
    return sight, config, ""


def _tracker(p: Prepared) -> MonteCarloLocalizer | ScanMatchingEkf | CeilingLocalizer:
    ceiling = None if p.overhead is None else p.overhead.ceiling
    if p.config.localize.tracker == "ceiling" and ceiling is not None:
        return ceiling_localizer(p.config.localize, p.map.fields, ceiling)
    if p.config.localize.tracker == "particle_filter":
        return monte_carlo_localizer(p.config.localize, p.map.fields, ceiling)
    if isinstance(p.start, str):
        raise ConfigError(
            "the Kalman filter cannot start without a pose", where="--init", hint="--init X,Y,YAW, or truth"
        )
    return scan_matching_ekf(p.config.localize, p.map.fields)


@contextmanager
def _message_writer(p: Prepared, path: Path | None) -> Iterator[MessageWriter | None]:
    if path is None:
        yield None
        return
    with ResultWriter(path, base=p.rig.base_frame) as writer:
        yield MessageWriter(writer, p.config.results, p.map.grid, p.truth)


def _find_truth(log: Log, name: str | None) -> Trajectory | None:
    if name is not None and name.endswith(".tum"):
        return read_tum(Path(name))
    track = pick_truth(log, name)
    return None if track is None else trajectory_of(log, track)


def _window_ns(log: Log, rig: Rig, request: Request) -> tuple[int | None, int | None]:
    """Header stamps between which scans are used."""
    if request.start_s is None and request.end_s is None:
        return None, None
    first = log.first(rig.scan.topic)[0].stamp_ns
    return tuple(None if s is None else first + round(s * 1e9) for s in (request.start_s, request.end_s))  # type: ignore[return-value]
