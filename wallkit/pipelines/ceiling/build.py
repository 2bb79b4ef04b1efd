"""A log with known poses -> a picture of the ceiling it drove below."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.errors import LogError, MapError
from wallkit.logs.reader import open_log
from wallkit.maps.ceiling.fit import Ratio
from wallkit.maps.ceiling.stitch import Stitching
from wallkit.pipelines.ceiling.camera import CameraWords, find_up_camera
from wallkit.pipelines.ceiling.poses import known_poses, pose_at
from wallkit.pipelines.ceiling.track import height_above_camera, looks_of
from wallkit.pipelines.config import Config

# a picture of a hall of 100 m x 100 m at 2 cm
_MOST_PX = 25_000_000


@dataclass(frozen=True)
class BuildRequest:
    """What the user asked for.

    Attributes:
        poses: see known_poses. height_m: of the ceiling above the floor; None finds it. evens: see Stitching.
    """

    logs: tuple[Path, ...]
    poses: str | None = None
    height_m: float | None = None
    resolution_m: float = 0.02
    every_m: float = 0.1
    evens: bool = True


@dataclass(frozen=True, eq=False)
class Built:
    """The ceiling; its height with sigma where it was found; images used, and left out for want of a pose."""

    ceiling: CeilingMap
    height: Ratio | None
    used: int
    left_out: int


def build_ceiling(
    request: BuildRequest, words: CameraWords, config: Config, progress: Callable[[int], None] = lambda _: None
) -> Built:
    """Stitch what the camera saw.

    Raises:
        LogError: no poses, or none of them in the time of the images. MapError: the height cannot be found, or the extent
            is too large. CalibrationError: see CeilingEye.
    """
    log = open_log(request.logs)
    up = find_up_camera(log, words)
    poses = known_poses(log, request.poses)
    blind = up.eye(config.localize.ceiling, math.nan)
    pairs = [
        (look, pose_at(poses, look.stamp_ns)) for look in looks_of(log, up, blind, config.logs, every_m=request.every_m)
    ]
    known = [(look, pose) for look, pose in pairs if pose is not None]
    if not known:
        raise LogError(
            f"none of {len(pairs)} images has a pose",
            where=log.name,
            hint="poses and images must have one clock: --poses",
        )
    height, found = request.height_m, None
    if height is None:
        some = known[:: max(1, round(0.2 / request.every_m))][:150]
        found = height_above_camera([look for look, _ in some], [pose for _, pose in some])
        if found is None:
            raise MapError(
                "the ceiling's height cannot be told from these images: too few neighbours match",
                where=log.name,
                hint="measure it from the floor: --height 2.7",
            )
        found = Ratio(found.value + blind.camera_height_m, found.sigma, found.count, found.outliers)
        height = found.value
    eye = up.eye(config.localize.ceiling, height)
    places = np.array([look.place_at(pose) for look, pose in known])
    reach = height - eye.camera_height_m
    low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
    low = np.floor(low / request.resolution_m) * request.resolution_m
    pixels = float(np.prod((high - low) / request.resolution_m))
    if pixels > _MOST_PX:
        raise MapError(
            f"the picture would have {pixels:,.0f} pixels", where=log.name, hint="--resolution to a larger one"
        )
    stitching = Stitching(low, high, request.resolution_m, evens=request.evens)
    for number, (look, pose) in enumerate(known):
        stitching.add(eye, look.image, pose)
        progress(number + 1)
    return Built(stitching.done(height, log.name), found, len(known), len(pairs) - len(known))
