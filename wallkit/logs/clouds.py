"""Packed point clouds -> points; a slice of points at a height -> a planar scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wallkit.core.types import Float32Array, Float64Array, PointCloud, Scan

# names that drivers give to the time of each point, and how it counts:
# Velodyne and LIO-SAM, Ouster, Livox: after the stamp [s or ns]; Hesai and RoboSense: absolute [s]
_OFFSETS = {"time": 1.0, "t": 1e-9, "offset_time": 1e-9}
_ABSOLUTE = "timestamp"


@dataclass(frozen=True, slots=True)
class Rows:
    """Packed points: height rows of width points, each point_step bytes long; a row takes row_step bytes."""

    data: bytes
    height: int
    width: int
    point_step: int
    row_step: int


def cloud_from_rows(stamp_ns: int, frame_id: str, rows: Rows, fields: Mapping[str, tuple[int, str]]) -> PointCloud:
    """The finite points of a packed cloud.

    Args:
        fields: name -> (offset in the point [byte], numpy type with byte order). x, y, z are needed; intensity, ring
            and the driver's time field are taken where present.

    Raises:
        ValueError: a field is missing, or the sizes contradict each other.
    """
    if missing := [name for name in "xyz" if name not in fields]:
        raise ValueError(f"the cloud has no field {', '.join(missing)}, only {', '.join(sorted(fields))}")
    points = _records(rows, fields)
    xyz = np.stack([points[name].astype(np.float32) for name in "xyz"], axis=-1)
    good = np.isfinite(xyz).all(axis=1)

    def column(name: str, dtype: type) -> NDArray[Any]:
        return points[name][good].astype(dtype)

    offsets = None
    for name, unit_s in _OFFSETS.items():
        if name in fields:
            offsets = (column(name, np.float64) * unit_s).astype(np.float32)
    if _ABSOLUTE in fields and offsets is None:
        offsets = (column(_ABSOLUTE, np.float64) - stamp_ns * 1e-9).astype(np.float32)
    intensities = column("intensity", np.float32) if "intensity" in fields else None
    rings = column("ring", np.int64) if "ring" in fields else None
    return PointCloud(stamp_ns, frame_id, xyz[good], intensities, rings, offsets)


def scan_from_cloud(
    cloud: PointCloud, mount: Float64Array, *, low_m: float, high_m: float, beam_width_rad: float = np.deg2rad(0.5)
) -> Scan:
    """What a planar LiDAR at the sensor's place would see of the walls between two heights.

    Of all points in the slice the nearest in each bearing is kept, as a wall hides what is behind it.

    Args:
        mount: (4, 4) T_base_lidar.
        low_m, high_m: the slice, z in frame base.
        beam_width_rad: bearings closer than this are one beam.

    Returns:
        A scan in the cloud's frame, ordered by bearing. Ranges are horizontal distances in the sensor frame and
        heights_m its z, so that (r cos, r sin, z) is the recorded point exactly. Bearings that saw nothing are absent.
    """
    points = cloud.points_m.astype(np.float64)
    z_base_m = points @ mount[2, :3] + mount[2, 3]
    ranges = np.hypot(points[:, 0], points[:, 1])
    inside = np.flatnonzero((z_base_m >= low_m) & (z_base_m <= high_m) & (ranges > 0))
    angles = np.arctan2(points[inside, 1], points[inside, 0])
    bins = np.floor((angles + np.pi) / beam_width_rad).astype(np.int64)
    order = np.lexsort((ranges[inside], bins))
    _, first = np.unique(bins[order], return_index=True)
    kept = order[first]
    chosen = inside[kept]
    offsets = None if cloud.offsets_s is None else cloud.offsets_s[chosen]
    return Scan(
        stamp_ns=cloud.stamp_ns,
        frame_id=cloud.frame_id,
        ranges_m=ranges[chosen].astype(np.float32),
        angles_rad=angles[kept].astype(np.float32),
        beam_interval_s=0.0,
        range_min_m=0.0,
        range_max_m=np.inf,
        heights_m=points[chosen, 2].astype(np.float32),
        offsets_s=offsets,
    )


def transformed(points: Float32Array, matrix: Float64Array) -> Float32Array:
    """Points (P, 3) moved by a (4, 4) transform."""
    return (points @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)


def _records(rows: Rows, fields: Mapping[str, tuple[int, str]]) -> NDArray[Any]:
    """(P,) structured array over the packed points, row padding left out."""
    width_bytes = rows.width * rows.point_step
    row_step = rows.row_step or width_bytes
    if row_step < width_bytes or len(rows.data) < rows.height * row_step or rows.point_step <= 0:
        size = f"{rows.height} x {rows.width} points of {rows.point_step} bytes"
        raise ValueError(f"{len(rows.data)} bytes do not hold {size} in rows of {row_step} bytes")
    layout = np.dtype(
        {
            "names": list(fields),
            "formats": [dtype for _, dtype in fields.values()],
            "offsets": [offset for offset, _ in fields.values()],
            "itemsize": rows.point_step,
        }
    )
    packed = np.frombuffer(rows.data, np.uint8, rows.height * row_step).reshape(rows.height, row_step)[:, :width_bytes]
    return np.ascontiguousarray(packed).reshape(-1).view(layout)
