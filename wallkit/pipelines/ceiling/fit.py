"""A picture of a ceiling and a log that drove below it -> metres per pixel, where it lies, how high, how sure that is."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.types import Float64Array, UInt8Array
from wallkit.errors import LogError, MapError
from wallkit.logs.reader import open_log
from wallkit.maps.ceiling.files import read_picture
from wallkit.maps.ceiling.fit import Ratio, Similarity, robust_ratio, robust_similarity
from wallkit.maps.ceiling.match import Picture, found_in, grey_of
from wallkit.pipelines.ceiling.camera import CameraWords, find_up_camera
from wallkit.pipelines.ceiling.poses import known_poses, pose_at
from wallkit.pipelines.ceiling.track import MIDDLE, Look, chords, looks_of, per_px
from wallkit.pipelines.config import Config

_MOST_PX = 1000
# looks found at another scale than most were found wrongly
_SAME_SCALE = 1.08
_LEAST_CHORDS = 4
# errors of odometry within so many chords go together
_BLOCK = 5


@dataclass(frozen=True)
class FitRequest:
    """What the user asked for.

    Attributes:
        picture: of the ceiling, of any scale, from above or below. poses: see known_poses; None: odometry alone.
        matches: CSV of stamp_s, u_px, v_px clicked by hand; None: found by features.
    """

    logs: tuple[Path, ...]
    picture: Path
    poses: str | None = None
    matches: Path | None = None
    every_m: float = 0.25


@dataclass(frozen=True, eq=False)
class Fitted:
    """What came out.

    Attributes:
        ceiling: the picture made metric. resolution: its metres per pixel. height: of the ceiling above the floor.
        lies: picture [m] to frame map, or to frame odom at the log's beginning.
        is_mirrored: it was taken from below, and is turned over. found, looked: images found in it, and tried.
    """

    ceiling: CeilingMap
    resolution: Ratio
    height: Ratio | None
    lies: Similarity
    is_mirrored: bool
    found: int
    looked: int


def fit_ceiling(request: FitRequest, words: CameraWords, config: Config) -> Fitted:
    """Metres per pixel by least squares, from how far the robot went and how far its place moved in the picture.

    Of odometry only straight pieces of a metre count, never its whole, whose heading drifts; with known poses all of it.

    Raises:
        MapError: the images are not found in the picture, or the robot hardly moved. LogError: see find_up_camera.
    """
    log = open_log(request.logs)
    up = find_up_camera(log, words)
    eye = up.eye(config.localize.ceiling, math.nan)
    looks = list(looks_of(log, up, eye, config.logs, every_m=request.every_m))
    poses = None if request.poses is None else known_poses(log, request.poses)
    rgba = read_picture(request.picture)
    clicked = None if request.matches is None else _read_matches(request.matches)
    found, is_mirrored = _places(looks, rgba, request, clicked)
    kept = [(look, at, k, pose) for look, at, k in found if (pose := _pose_of(look, poses)) is not None]
    if len(kept) < 2:
        raise MapError(f"{len(kept)} images have both a place and a pose", where=request.picture, hint="--poses RUN")
    robot = np.array([look.place_at(pose) for look, _, _, pose in kept])
    pixels = np.array([at for _, at, _, _ in kept])
    metres, px = chords(robot, pixels)
    if len(metres) < _LEAST_CHORDS:
        raise MapError(
            f"the robot moved {metres.sum():.1f} m where its images were found: too little to scale a picture by",
            where=request.picture,
            hint="record a drive of some metres below this ceiling",
        )
    resolution = robust_ratio(metres, px)
    blocks = np.arange(len(kept)) // _BLOCK
    if poses is not None:
        whole = robust_similarity(robot, pixels, blocks=blocks)
        resolution = Ratio(whole.scale, whole.scale_sigma, whole.count, whole.outliers)
    lies = robust_similarity(robot, pixels * resolution.value, scale=1.0, blocks=blocks)
    height = _height(kept, resolution, eye.camera_height_m)
    turned = rgba[:, ::-1] if is_mirrored else rgba
    ceiling = CeilingMap(
        np.ascontiguousarray(turned[::-1, :, :3]),
        np.ascontiguousarray(turned[::-1, :, 3] > 0),
        resolution.value,
        np.array([*lies.shift, lies.yaw]),
        math.nan if height is None else height.value,
        str(request.picture),
    )
    return Fitted(ceiling, resolution, height, lies, is_mirrored, len(kept), len(looks))


def _pose_of(look: Look, poses: Any) -> Float64Array | None:
    return look.odometry if poses is None else pose_at(poses, look.stamp_ns)


def _height(kept: list[Any], resolution: Ratio, camera_m: float) -> Ratio | None:
    """Of the ceiling above the floor: how large the camera's pictures are in the picture says how far it is away."""
    sizes = np.array([k for _, _, k, _ in kept if k > 0])
    if not len(sizes):
        return None
    middle = float(np.median(sizes))
    spread = 1.4826 * float(np.median(np.abs(sizes - middle))) / math.sqrt(len(sizes))
    sigma = math.hypot(resolution.sigma * middle, resolution.value * spread)
    return Ratio(camera_m + resolution.value * middle, sigma, len(sizes), 0.0)


def _places(
    looks: list[Look], rgba: UInt8Array, request: FitRequest, clicked: Float64Array | None
) -> tuple[list[tuple[Look, Float64Array, float]], bool]:
    """Looks with their place in the picture [px from its lower left corner] and px there for a height above the camera.

    Both the picture and its mirror image are tried on some looks; that which more are found in is the one.
    """
    height, width = rgba.shape[:2]
    if clicked is not None:
        return _clicked_places(looks, clicked, height), False
    shrink = min(1.0, _MOST_PX / max(height, width))
    sides = {}
    tried = looks[:: max(1, len(looks) // 12)]
    for is_mirrored in (False, True):
        sides[is_mirrored] = _large(rgba[:, ::-1] if is_mirrored else rgba, shrink)
    scores = {
        side: sum(m.inliers for look in tried if (m := found_in(look.plan, sides[side], MIDDLE))) for side in sides
    }
    is_mirrored = scores[True] > scores[False]
    found = []
    for look in looks:
        match = found_in(look.plan, sides[is_mirrored], MIDDLE)
        if match is not None:
            u, v = (match.at + 0.5) / shrink
            found.append((look, np.array([u, height - v]), match.scale / shrink / per_px(look.eye)))
    found = _of_one_scale(found)
    if len(found) < 2:
        raise MapError(
            f"{len(found)} of {len(looks)} images of the log were found in the picture",
            where=request.picture,
            hint="a picture of this very ceiling with lamps, vents or patterns in it; or places by hand: --matches FILE.csv",
        )
    return found, is_mirrored


def _of_one_scale(found: list[tuple[Look, Float64Array, float]]) -> list[tuple[Look, Float64Array, float]]:
    """Those whose scale most agree on: the camera is always as far below the ceiling."""
    if not found:
        return found
    scales = np.log([k for _, _, k in found])
    near = np.abs(scales[:, None] - scales[None]) < np.log(_SAME_SCALE)
    middle = float(np.median(scales[near[int(near.sum(axis=1).argmax())]]))
    return [one for one, scale in zip(found, scales, strict=True) if abs(scale - middle) < np.log(_SAME_SCALE)]


def _large(rgba: UInt8Array, shrink: float) -> Picture:
    import cv2

    rgb = np.ascontiguousarray(rgba[..., :3])
    if shrink < 1:
        rgb = np.asarray(cv2.resize(rgb, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA))
    return Picture(grey_of(rgb))


def _clicked_places(looks: list[Look], clicked: Float64Array, height: int) -> list[tuple[Look, Float64Array, float]]:
    """Each clicked pixel with the look nearest in time; the picture is taken as it is."""
    stamps = np.array([look.stamp_ns for look in looks])
    start = stamps[0]
    found = []
    for seconds, u, v in clicked.tolist():
        at_ns = start + round(seconds * 1e9) if seconds < 1e8 else round(seconds * 1e9)
        look = looks[int(np.argmin(np.abs(stamps - at_ns)))]
        if abs(look.stamp_ns - at_ns) < 1e9:
            found.append((look, np.array([u + 0.5, height - v - 0.5]), 0.0))
    return found


def _read_matches(path: Path) -> Float64Array:
    """(K, 3) stamp_s, u_px, v_px of a CSV with that header.

    Raises:
        LogError: it cannot be read, with the line.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"cannot be read: {error}", where=path, hint="columns stamp_s,u_px,v_px") from error
    if not rows or [cell.strip() for cell in rows[0]] != ["stamp_s", "u_px", "v_px"]:
        raise LogError(
            "the first line is not stamp_s,u_px,v_px", where=f"{path}:1", hint="seconds, and pixels from the upper left"
        )
    found = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            found.append([float(cell) for cell in row])
        except ValueError as error:
            raise LogError(f"{row} are no three numbers", where=f"{path}:{number}", hint="seconds, u, v") from error
        if len(row) != 3:
            raise LogError(f"{len(row)} cells where 3 are wanted", where=f"{path}:{number}", hint="stamp_s,u_px,v_px")
    return np.array(found).reshape(-1, 3)
