"""Packed clouds in every layout; a slice of a room is the room's planar scan."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.drawn import ROOM_M, START_NS, on_walls
from wallkit.core.types import PointCloud
from wallkit.logs.clouds import Rows, cloud_from_rows, scan_from_cloud
from wallkit.logs.mount import matrix_from_words
from wallkit.logs.sweep import points_from_scan

RNG = np.random.default_rng(3)
XYZ = RNG.normal(size=(12, 3)).astype(np.float32)


def packed(dtype, columns, *, height=3, padding=0):
    table = np.zeros(12, np.dtype(dtype))
    for name, values in columns.items():
        table[name] = values
    rows = table.view(np.uint8).reshape(height, -1)
    rows = np.hstack([rows, np.full((height, padding), 9, np.uint8)])
    step = table.dtype.itemsize
    fields = {n: (table.dtype.fields[n][1], table.dtype.fields[n][0].str.replace("|", "<")) for n in table.dtype.names}
    return Rows(rows.tobytes(), height, 12 // height, step, rows.shape[1]), fields


XYZ_COLUMNS = dict(zip("xyz", XYZ.T, strict=True))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("padding", [0, 6])
def test_points_rings_and_times(order, padding):
    names = {"x": "f4", "gap": "u1", "y": "f8", "z": "f4", "intensity": "u1", "ring": "u2", "time": "f4"}
    dtype = [(name, order + code) for name, code in names.items()]
    columns = XYZ_COLUMNS | {"intensity": range(12), "ring": range(12), "time": np.arange(12) * 0.001}
    cloud = cloud_from_rows(5, "lidar", *packed(dtype, columns, padding=padding))
    np.testing.assert_allclose(cloud.points_m, XYZ, rtol=1e-6)
    np.testing.assert_array_equal(cloud.intensities, np.arange(12))
    np.testing.assert_array_equal(cloud.rings, np.arange(12))
    np.testing.assert_allclose(cloud.offsets_s, np.arange(12) * 0.001, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "dtype", "values"),
    [
        ("time", "<f4", np.arange(12) * 0.01),
        ("t", "<u4", np.arange(12) * 10_000_000),
        ("offset_time", "<u4", np.arange(12) * 10_000_000),
        ("timestamp", "<f8", 1000.0 + np.arange(12) * 0.01),
    ],
)
def test_the_time_fields_of_the_makers(name, dtype, values):
    layout = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), (name, dtype)]
    cloud = cloud_from_rows(1000 * 10**9, "lidar", *packed(layout, XYZ_COLUMNS | {name: values}))
    np.testing.assert_allclose(cloud.offsets_s, np.arange(12) * 0.01, atol=1e-6)


def test_points_that_are_no_number_are_left_out():
    xyz = XYZ.copy()
    xyz[3, 1] = np.nan
    layout = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
    cloud = cloud_from_rows(0, "lidar", *packed(layout, dict(zip("xyz", xyz.T, strict=True))))
    np.testing.assert_array_equal(cloud.points_m, np.delete(xyz, 3, axis=0))


def test_what_is_no_cloud_is_said():
    rows, fields = packed([("x", "<f4"), ("y", "<f4")], {})
    with pytest.raises(ValueError, match="no field z"):
        cloud_from_rows(0, "lidar", rows, fields)
    for bad in (Rows(b"123", 1, 1, 12, 12), Rows(bytes(24), 1, 2, 12, 20), Rows(b"", 1, 0, 0, 0)):
        with pytest.raises(ValueError, match="do not hold"):
            cloud_from_rows(0, "lidar", bad, dict.fromkeys("xyz", (0, "<f4")))


def room_cloud(mount):
    """Points on the room's walls up to 2 m, on its floor, and behind its walls, in the frame of a LiDAR."""
    side = RNG.uniform(-ROOM_M, ROOM_M, 4000)
    wall = RNG.integers(0, 4, 4000)
    x = np.choose(wall, [side, side, np.full(4000, ROOM_M), np.full(4000, -ROOM_M)])
    y = np.choose(wall, [np.full(4000, ROOM_M), np.full(4000, -ROOM_M), side, side])
    z = RNG.uniform(0, 2, 4000)
    walls = np.stack([x, y, z], axis=-1)
    floor = np.stack([RNG.uniform(-ROOM_M, ROOM_M, 500), RNG.uniform(-ROOM_M, ROOM_M, 500), np.zeros(500)], axis=-1)
    behind = walls[:1000] * [1.5, 1.5, 1.0]
    points = np.vstack([walls, floor, behind])
    local = (points - mount[:3, 3]) @ mount[:3, :3]
    return PointCloud(START_NS, "lidar", local.astype(np.float32), offsets_s=np.zeros(len(local), np.float32))


@pytest.mark.parametrize("words", ["0,0,0", "0.3,-0.2,0.9", "0.3,0.1,0.4,0.1,-0.2,2", "0,0,1,3.14159265,0,0"])
def test_a_slice_of_a_room_lies_on_its_walls(words):
    mount = matrix_from_words(words)
    scan = scan_from_cloud(room_cloud(mount), mount, low_m=0.2, high_m=1.0, beam_width_rad=np.deg2rad(2))
    points = points_from_scan(scan, mount, lambda s: np.zeros((len(s), 3)), range_min_m=0.0, range_max_m=50.0)
    assert len(points.xyz_m) > 150
    assert points.xyz_m[:, 2].min() >= 0.2 - 1e-5
    assert points.xyz_m[:, 2].max() <= 1.0 + 1e-5
    # the nearest in each bearing is on a wall, never behind it
    assert np.quantile(on_walls(np.zeros(3), points.xyz_m[:, :2]), 0.98) < 1e-4
    assert np.all(np.diff(scan.angles_rad) > 0)


def test_an_empty_slice_is_an_empty_scan():
    scan = scan_from_cloud(PointCloud(0, "l", XYZ), np.eye(4), low_m=50, high_m=60)
    assert len(scan.ranges_m) == len(scan.angles_rad) == len(scan.heights_m) == 0
