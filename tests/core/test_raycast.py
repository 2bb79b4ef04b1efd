"""Rays against a distance field: exact casting among segments is the oracle."""

from __future__ import annotations

import numpy as np
import pytest

from tests.localize.worlds import FLAT, NOBODY, fields_of, scan_at
from tests.plan import cast
from wallkit.core.geometry import compose
from wallkit.core.grid import distances_at, placed, spread_of
from wallkit.core.raycast import HIT, LONG, SHORT, cast_rays, classify_rays

POSE = np.array([3.0, 1.7, 0.6])
TOLERANCES = {"tolerance_m": 0.2, "tolerance_per_m": 0.02}


@pytest.fixture(scope="module")
def fields():
    return fields_of(FLAT, 0.05)


@pytest.mark.parametrize("yaw", [0.0, 0.6, 2.5, -1.9])
def test_rays_end_where_exact_casting_says_within_a_cell_and_a_half(fields, yaw):
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    pose = np.array([3.0, 1.7, yaw])
    exact = cast(FLAT, NOBODY, pose[:2], yaw + bearings, 30.0)
    out = np.empty((1, 720), dtype=np.float32)
    directions = np.stack([np.cos(bearings), np.sin(bearings)]).astype(np.float32)
    per_m = np.float32(1 / fields.resolution_m)
    at = placed(fields, pose[None], border=0)
    cast_rays(at, directions, fields.distances_m["all"], per_m, np.float32(600), out)
    off = np.abs(out[0] * fields.resolution_m - exact)
    assert np.mean(off < 0.075) > 0.97  # the rest grazes walls or passes corners
    assert np.median(off) < 0.04


def test_a_scan_at_its_pose_hits_and_people_stand_in_front(fields):
    clear = scan_at(FLAT, POSE).points
    assert np.all(classify_rays(fields, clear, POSE, **TOLERANCES) == HIT)
    person = np.array([[*compose(POSE, np.array([1.2, 0.0, 0.0]))[:2], 0.3]])
    crowded = scan_at(FLAT, POSE, discs=person).points
    codes = classify_rays(fields, crowded, POSE, **TOLERANCES)
    blocked = crowded.ranges_m < clear.ranges_m - 0.3
    assert blocked.sum() > 10
    assert np.all(codes[blocked] == SHORT)
    assert np.all(codes[~blocked] == HIT)


def test_a_pose_outside_the_wall_sees_through_it(fields):
    """One metre to the side, many returns end behind mapped walls."""
    codes = classify_rays(fields, scan_at(FLAT, POSE).points, POSE + (0.0, 1.5, 0.0), **TOLERANCES)
    assert np.mean(codes == LONG) > 0.15
    assert np.mean(codes == HIT) < 0.7


def test_moving_map_and_robot_together_changes_nothing(fields):
    from dataclasses import replace

    move = np.array([12.0, -7.0, 2.1])
    moved = replace(fields, origin=compose(move, fields.origin))
    points = scan_at(FLAT, POSE).points
    for pose in (POSE, POSE + (0.4, 0.3, 0.1)):
        here = classify_rays(fields, points, pose, **TOLERANCES)
        there = classify_rays(moved, points, compose(move, pose), **TOLERANCES)
        assert np.mean(here == there) > 0.99


def test_distances_outside_the_map_are_infinite(fields):
    wall, far = [4.0, 0.0], [400.0, 0.0]
    near, outside = distances_at(fields, np.array([wall, far]))
    assert near <= 0.05
    assert np.isinf(outside)


def test_a_spread_of_returns_is_even_and_leaves_out_the_useless():
    points = scan_at(FLAT, POSE).points
    index = spread_of(points, 40)
    assert len(index) == 40
    assert np.diff(index).max() - np.diff(index).min() <= 1
    weights = (np.arange(len(points.ranges_m)) % 2).astype(np.float32)
    assert np.all(spread_of(points, 40, weights) % 2 == 1)
    assert points.ranges_m[spread_of(points, 500, range_max_m=2.0)].max() <= 2.0
