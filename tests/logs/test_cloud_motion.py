"""All of a cloud is moved to one moment as its slice is, exactly where the physics says."""

from __future__ import annotations

import numpy as np

from tests.logs.drawn import SECOND_NS, START_NS, pose_at
from wallkit.core.geometry import matrix_from_pose
from wallkit.core.types import PointCloud
from wallkit.logs.cloud_motion import cloud_in_base
from wallkit.logs.clouds import transformed
from wallkit.logs.mount import matrix_from_words


def poses_of(motion):
    return lambda stamps: np.array([pose_at(motion, int(s)) for s in stamps])


def test_a_cloud_is_moved_point_by_point_as_the_formula_says():
    """p_base(t_0) = T_base(t_0)_base(t_k) T_base_lidar p_k, on a curve that is nowhere straight."""

    def curve(t):
        return (0.8 * np.sin(3 * t), 0.5 * t, 1.5 * t - 4 * t * t)

    rng = np.random.default_rng(3)
    mount = matrix_from_words("1,2,0.5,0.1,-0.2,2")
    offsets = rng.uniform(-0.05, 0.05, 200).astype(np.float32)
    cloud = PointCloud(START_NS, "lidar", rng.normal(0, 5, (200, 3)).astype(np.float32), offsets_s=offsets)
    span = START_NS - SECOND_NS // 20, START_NS + SECOND_NS // 20
    found = cloud_in_base(cloud, mount, poses_of(curve), span_ns=span)
    start = np.linalg.inv(matrix_from_pose(pose_at(curve, START_NS)))
    for point, offset_s, moved in zip(cloud.points_m, offsets, found, strict=True):
        then = matrix_from_pose(pose_at(curve, START_NS + round(float(offset_s) * SECOND_NS)))
        # between moments 1 ms apart a turn of 2 rad/s bends 10 m by 2e-3^2 / 8
        np.testing.assert_allclose(moved, (start @ then @ mount @ [*point, 1])[:3], atol=2e-5)


def test_points_of_a_cloud_from_outside_the_sweep_move_as_its_ends():
    def turn(t):
        return (t, 0.0, 0.0)

    offsets = np.array([0.0, 0.04, 0.1, 0.2, -0.3, np.nan], np.float32)
    cloud = PointCloud(START_NS, "lidar", np.zeros((6, 3), np.float32), offsets_s=offsets)
    found = cloud_in_base(cloud, np.eye(4), poses_of(turn), span_ns=(START_NS, START_NS + SECOND_NS // 10))
    np.testing.assert_allclose(found[:, 0], [0, 0.04, 0.1, 0.1, 0, 0], atol=1e-6)
    at_once = cloud_in_base(cloud, np.eye(4), poses_of(turn), span_ns=(START_NS, START_NS))
    assert not at_once.any()


def test_a_cloud_without_times_is_only_mounted():
    mount = matrix_from_words("1,2,0.5,0.1,-0.2,2")
    cloud = PointCloud(START_NS, "lidar", np.random.default_rng(4).normal(0, 5, (20, 3)).astype(np.float32))
    found = cloud_in_base(cloud, mount, poses_of(lambda t: (9 * t, 0, 9 * t)), span_ns=(START_NS, START_NS + SECOND_NS))
    np.testing.assert_array_equal(found, transformed(cloud.points_m, mount))
