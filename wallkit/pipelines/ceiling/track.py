"""A log's images -> small pictures of the ceiling straight above, each with the robot's pose, every so many metres."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wallkit.core.ceiling_eye import CeilingEye
from wallkit.core.geometry import transform_points
from wallkit.core.types import Float64Array, UInt8Array
from wallkit.logs.reader import Log
from wallkit.logs.sync import SyncConfig
from wallkit.maps.ceiling.fit import Ratio, robust_ratio
from wallkit.maps.ceiling.match import Picture, found_in, grey_of
from wallkit.pipelines.ceiling.camera import UpCamera, colours_of, frames_of

_SIDE = 321
# a chord is long against the error of a match, and short against what odometry gathers
CHORD_M = 1.0


@dataclass(frozen=True, eq=False)
class Look:
    """An image with T_odom_base (3,) where it was taken, and the ceiling above it drawn as a plan in frame base."""

    stamp_ns: int
    odometry: Float64Array
    image: UInt8Array
    eye: CeilingEye
    unit: CeilingEye

    @cached_property
    def plan(self) -> Picture:
        """+x of frame base to the right, +y up; one pixel is `per_px` of the height of the ceiling above the camera."""
        colours = self.unit.view(0, self.image).colours
        drawn = np.transpose(colours[:, ::-1], (1, 0, 2))
        return Picture(grey_of((np.ascontiguousarray(drawn) * 255).astype(np.uint8)))

    @property
    def place(self) -> Float64Array:
        """(2,) of the place straight above the camera, in frame odom."""
        return self.place_at(self.odometry)

    def place_at(self, pose: Float64Array) -> Float64Array:
        """(2,) of the same in the frame of another pose of the robot."""
        return np.asarray(transform_points(pose, self.eye.centre_m[None])[0])


MIDDLE = np.array([(_SIDE - 1) / 2, (_SIDE - 1) / 2])


def unit_eye(eye: CeilingEye) -> CeilingEye:
    """The camera below a ceiling one metre above it, its grid as fine as its pixels."""
    near = replace(eye, height_m=eye.camera_height_m + 1, side=_SIDE, smooth_m=0.0, spacing_m=0.05)
    return replace(near, spacing_m=per_px(eye))


def per_px(eye: CeilingEye) -> float:
    """Pixels of a plan in heights of the ceiling above the camera: half as large as the camera's, for more features."""
    return 0.5 / replace(eye, height_m=eye.camera_height_m + 1).px_per_m


def looks_of(log: Log, up: UpCamera, eye: CeilingEye, config: SyncConfig, *, every_m: float) -> Iterator[Look]:
    """An image every so many metres of odometry, or 30 degrees."""
    last, unit = None, unit_eye(eye)
    for frame in frames_of(log, up, config):
        off = None if last is None else frame.odometry - last
        turned = 0.0 if off is None else abs(float(np.arctan2(np.sin(off[2]), np.cos(off[2]))))
        if off is None or np.hypot(off[0], off[1]) >= every_m or turned >= np.deg2rad(30):
            last = frame.odometry
            yield Look(frame.stamp_ns, frame.odometry, colours_of(frame.image), eye, unit)


def chords(places: Float64Array, others: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Lengths (K,) of straight pieces of one track and of the same in the other: they do not overlap, so errors do not."""
    a, b, anchor = [], [], 0
    for i in range(1, len(places)):
        length = float(np.hypot(*(places[i] - places[anchor])))
        if length >= CHORD_M:
            a.append(length)
            b.append(float(np.hypot(*(others[i] - others[anchor]))))
            anchor = i
    return np.array(a), np.array(b)


def height_above_camera(looks: list[Look], poses: list[Float64Array]) -> Ratio | None:
    """Metres from the camera to the ceiling: how far it went over how far the ceiling moved in its pictures.

    None where too few neighbouring pictures match.
    """
    moved, seen = [], []
    for i in range(1, len(looks)):
        match = found_in(looks[i].plan, looks[i - 1].plan, MIDDLE)
        length = float(np.hypot(*(looks[i].place_at(poses[i]) - looks[i - 1].place_at(poses[i - 1]))))
        if match is None or length < 0.1 or abs(match.scale - 1) > 0.1:
            continue
        moved.append(length)
        seen.append(float(np.hypot(*(match.at - MIDDLE))) * per_px(looks[i].eye))
    if len(moved) < 8:
        return None
    return robust_ratio(np.array(moved), np.maximum(np.array(seen), 1e-6))
