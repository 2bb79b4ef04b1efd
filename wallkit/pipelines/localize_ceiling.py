"""A ceiling and the camera below it -> what `localize` needs of them: alone, or beside a LiDAR."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import tee
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingSight, CeilingView
from wallkit.core.ceiling_eye import CeilingEye
from wallkit.core.types import CameraImage, FieldSet, Float64Array, Frame, OccupancyGrid, Points
from wallkit.errors import ConfigError, Finding, LogError, MapError
from wallkit.localize.ceiling import CentrePixel
from wallkit.localize.ceiling_eye import fields_of_ceiling
from wallkit.localize.ceiling_filter import CeilingLocalizer
from wallkit.localize.filter import MonteCarloLocalizer
from wallkit.logs.mount import Mount
from wallkit.logs.reader import Log
from wallkit.logs.rig import Rig
from wallkit.logs.sync import SyncReport, synchronise
from wallkit.maps.ceiling.files import read_ceiling
from wallkit.maps.grids.fields import MapsSettings
from wallkit.pipelines.ceiling.camera import CameraWords, UpCamera, find_up_camera, is_grey, sights_of
from wallkit.pipelines.config import Config
from wallkit.pipelines.maps import LoadedMap, load_map
from wallkit.pipelines.shared import Shared

Window = tuple[int | None, int | None]
# below this share of the map's free space under the ceiling people should know
_LITTLE_OVERLAP = 0.5


@dataclass(frozen=True, eq=False)
class Overhead:
    """A ceiling and the camera that sees it; `is_alone`: there is no LiDAR in it."""

    ceiling: CeilingMap
    path: Path
    up: UpCamera
    eye: CeilingEye
    is_alone: bool

    def sights(
        self, log: Log, config: Config, window_ns: Window, report: SyncReport | None = None
    ) -> Iterator[CeilingSight]:
        """What the camera sees of it over time."""
        return sights_of(log, self.up, self.eye, config.logs, report=report, window_ns=window_ns)


def find_overhead(log: Log, path: Path | None, words: CameraWords, config: Config, *, has_map: bool) -> Overhead | None:
    """The ceiling named by flag or settings, with the camera that looks at it; None without a ceiling.

    Args:
        has_map: whether a map was named; one that the log carries counts too.

    Raises:
        MapError: the ceiling cannot be read, or its height is not known and the model needs it.
        LogError, CalibrationError: see find_up_camera and CeilingEye. ConfigError: the tracker does not go with it.
    """
    path = path or (Path(config.ceiling) if config.ceiling else None)
    tracker, settings = config.localize.tracker, config.localize.ceiling
    if path is None:
        if tracker == "ceiling":
            raise ConfigError(
                "the tracker is 'ceiling', and no ceiling was given", where="--ceiling", hint="name its YAML"
            )
        return None
    if tracker == "ekf":
        raise ConfigError(
            "the Kalman filter does not look at the ceiling", where="--ceiling", hint="--set localize.tracker=ceiling"
        )
    ceiling = read_ceiling(path)
    up = find_up_camera(log, words)
    if math.isnan(ceiling.height_m) and not isinstance(settings.model, CentrePixel):
        raise MapError(
            "the ceiling's height is not known, and only the model `centre` does without",
            where=path,
            hint="add `height: 2.7` [m above the floor]; `wallkit ceiling fit` and `build` find it from a log",
        )
    first = log.first(up.channel.topic)[0].value
    if isinstance(first, CameraImage) and is_grey(first) and settings.model.needs_colour:
        raise LogError(
            f"the images on {up.channel.topic} are grey, and this model compares colours",
            where=log.name,
            hint="--set localize.ceiling.model=gradient compares brightness",
        )
    is_alone = tracker == "ceiling" or not (has_map or log.static.maps)
    return Overhead(ceiling, path, up, up.eye(settings, ceiling.height_m), is_alone)


def alone(overhead: Overhead, map_path: Path | None, config: Config) -> tuple[Rig, LoadedMap, Config]:
    """What to read, where the robot can be, and the settings when the ceiling alone is looked at."""
    loaded = map_of_ceiling(overhead.ceiling, map_path, config.maps)
    localize = replace(config.localize, tracker="ceiling")
    return (
        camera_rig(overhead.up),
        loaded,
        replace(config, localize=localize, points=replace(config.points, filters=())),
    )


def camera_rig(up: UpCamera) -> Rig:
    """What to read from a log for its camera alone: images take the place of sweeps."""
    return Rig(up.channel, up.odometry, up.base_frame, up.camera.frame, Mount(up.T_base_optical, up.mount))


def map_of_ceiling(ceiling: CeilingMap, map_path: Path | None, settings: MapsSettings) -> LoadedMap:
    """The map that tells where a robot can be: the one named, else everywhere below the ceiling."""
    if map_path is not None:
        return load_map(map_path, None, settings)
    fields = fields_of_ceiling(ceiling)
    cells = np.where(fields.is_free, 0, -1).astype(np.int8)
    grid = OccupancyGrid(cells, fields.resolution_m, fields.origin, source=ceiling.source)
    return LoadedMap(grid, fields, (), ())


def checked(loaded: LoadedMap, overhead: Overhead | None) -> LoadedMap:
    """The map with what is odd about the ceiling over it.

    Raises:
        MapError: see check_overlap.
    """
    if overhead is None:
        return loaded
    return replace(loaded, findings=(*loaded.findings, *check_overlap(overhead.ceiling, loaded.fields)))


def check_overlap(ceiling: CeilingMap, fields: FieldSet) -> Iterator[Finding]:
    """What is odd about a map and the ceiling over it.

    Raises:
        MapError: no place where the robot can be lies below the ceiling.
    """
    rows, columns = np.nonzero(fields.is_free)
    if not len(rows):
        return
    cells = np.column_stack([columns + 0.5, rows + 0.5]) * fields.resolution_m
    c, s = np.cos(fields.origin[2]), np.sin(fields.origin[2])
    free = cells @ np.array([[c, s], [-s, c]]) + fields.origin[:2]
    share = float(ceiling.cells_at(free)[1].mean())
    fit = "wallkit ceiling fit LOG --poses RUN/estimate.tum"
    hint = f"correct `origin` in {ceiling.source}, or fit it in the map's frame: {fit}"
    if share == 0:
        raise MapError(
            "map and ceiling do not overlap: "
            f"the map's free space is {_extent(free)}, the ceiling {_extent(ceiling.corners)}",
            where=ceiling.source,
            hint=hint,
        )
    if share < _LITTLE_OVERLAP:
        message = f"the ceiling covers {share:.0%} of the map's free space"
        yield Finding("ceiling.overlap", "warning", ceiling.source, message, hint=hint)


class Views:
    """The views of a ceiling in order of time, given out as time goes on."""

    def __init__(self, sights: Iterator[CeilingSight]) -> None:
        self._sights = sights
        self._next = next(sights, None)

    def until(self, stamp_ns: int) -> list[CeilingSight]:
        """Those up to a stamp that were not given out before."""
        found = []
        while self._next is not None and self._next.stamp_ns <= stamp_ns:
            found.append(self._next)
            self._next = next(self._sights, None)
        return found


def frames_and_views(
    log: Log,
    rig: Rig,
    overhead: Overhead | None,
    config: Config,
    report: SyncReport,
    window_ns: Window,
    shared: Shared | None = None,
) -> tuple[Iterator[Frame], Views]:
    """Scans, and the views of the ceiling at a rate of their own; without a LiDAR every view is a frame.

    Args:
        shared: holds the scans of runs before.
    """
    if overhead is not None and overhead.is_alone:
        frames, views = tee(overhead.sights(log, config, window_ns, report))
        return (frame_of(sight, overhead.ceiling.height_m) for sight in frames), Views(views)
    read = shared.frames if shared else synchronise
    scans = read(log, rig, config.logs, report=report, start_ns=window_ns[0], end_ns=window_ns[1])
    return scans, Views(iter(()) if overhead is None else overhead.sights(log, config, window_ns))


def frame_of(sight: CeilingSight, height_m: float) -> Frame:
    """A view as a frame whose points are the places on the ceiling."""
    points = points_of(sight.view, 0.0 if math.isnan(height_m) else height_m)
    return Frame(sight.stamp_ns, points, sight.odometry, sight.gap_s)


def points_of(view: CeilingView, height_m: float) -> Points:
    """The places of a view as points (P, 3) in frame base."""
    flat = view.points_m.reshape(-1, 2)
    xyz = np.column_stack([flat, np.full(len(flat), height_m, dtype=np.float32)])
    ranges = np.hypot(*flat.T).astype(np.float32)
    return Points(view.stamp_ns, xyz, ranges, np.arange(len(flat)), np.zeros(2), 100.0, np.zeros(0, np.float32))


def seen_by(tracker: Any, belief: Any, sights: Sequence[CeilingSight]) -> Any:
    """The belief with the views of the ceiling counted in, by a tracker that can."""
    if isinstance(tracker, MonteCarloLocalizer | CeilingLocalizer):
        for sight in sights:
            belief = tracker.look(belief, sight)
    return belief


def _extent(points: Float64Array) -> str:
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return f"x {x0:.1f} to {x1:.1f} m, y {y0:.1f} to {y1:.1f} m"
