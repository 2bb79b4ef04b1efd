"""Split and merge: walls stay, legs go, in any pose; and what is left is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of, scan_at
from tests.plan import plan_from_polylines
from wallkit.core.types import Estimate, Health
from wallkit.points.kept import KeptSettings, kept_of
from wallkit.points.line_fit import LineFit

POSE = np.array([3.0, 2.0, 0.5])
ANYWHERE = Estimate(0, POSE, np.eye(3), Health.LOST)
# legs of two people, 8 cm in radius
LEGS = np.array([[4.5, 1.0, 0.08], [4.5, 1.3, 0.08], [4.0, 3.2, 0.08], [4.25, 3.3, 0.08]])


def weigh(scan, settings=None):
    return (settings or LineFit()).on(fields_of(FLAT)).weigh(scan, ANYWHERE)


@pytest.mark.parametrize("seed", range(5))
def test_legs_go_and_walls_stay(seed):
    rng = np.random.default_rng(seed)
    pose = np.array([3.0, 2.0, rng.uniform(-3, 3)])
    clean = scan_at(FLAT, pose, beams=1080, fov_rad=2 * np.pi)
    crowded = scan_at(FLAT, pose, beams=1080, fov_rad=2 * np.pi, discs=LEGS, sigma_m=0.01, rng=rng)
    on_leg = crowded.points.ranges_m < clean.points.ranges_m - 0.2
    kept = weigh(crowded) > 0
    assert on_leg.sum() > 40
    assert kept[on_leg].mean() < 0.05
    assert kept[~on_leg].mean() > 0.95


def test_the_order_of_the_returns_and_the_robots_place_make_no_difference():
    scan = scan_at(FLAT, POSE, beams=720, discs=LEGS)
    order = np.random.default_rng(0).permutation(len(scan.weights))
    p = scan.points
    mixed = replace(scan, points=replace(p, xyz_m=p.xyz_m[order], ranges_m=p.ranges_m[order], beams=p.beams[order]))
    np.testing.assert_array_equal(weigh(mixed), weigh(scan)[order])
    c, s = np.cos(1.0), np.sin(1.0)
    turned = (p.xyz_m.astype(float) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + (3, -2, 0)).astype(np.float32)
    assert (weigh(replace(scan, points=replace(p, xyz_m=turned))) == weigh(scan)).mean() > 0.995


def test_a_wall_seen_in_pieces_is_one_wall():
    """Pieces of 0.45 m, each too short for a wall, on one line: together they are."""
    pieces = [[(2.0, y), (2.0, y + 0.45)] for y in np.arange(-2.7, 2.7, 0.9)]
    apart = plan_from_polylines(*pieces)
    scan = scan_at(apart, np.zeros(3), beams=1440, fov_rad=np.pi)
    walls = LineFit().walls(scan)
    assert len(set(walls[walls >= 0])) == 1
    assert (walls >= 0).mean() > 0.95
    alone = plan_from_polylines(pieces[3])
    assert (LineFit().walls(scan_at(alone, np.zeros(3), beams=1440, fov_rad=np.pi)) == -1).all()


def test_off_weight_and_an_empty_scan():
    scan = scan_at(FLAT, POSE, beams=720, discs=LEGS)
    assert set(np.unique(weigh(scan, LineFit(off_weight=0.25)))) == {0.25, 1}
    p = scan.points
    none = replace(scan, weights=scan.weights[:0],
                   points=replace(p, xyz_m=p.xyz_m[:0], ranges_m=p.ranges_m[:0], beams=p.beams[:0]))  # fmt: skip
    assert weigh(none).shape == (0,)


def test_too_few_and_one_sided_are_noticed():
    corridor = plan_from_polylines([(-8, -1), (8, -1)], [(-8, 1), (8, 1)])
    corner = plan_from_polylines([(-8, -1), (3, -1), (3, 8)])
    rng = np.random.default_rng(1)
    one_way = kept_of(scan_at(corridor, np.zeros(3), beams=360, sigma_m=0.01, rng=rng), KeptSettings())
    both = kept_of(scan_at(corner, np.zeros(3), beams=360, sigma_m=0.01, rng=rng), KeptSettings())
    assert one_way.is_one_sided
    assert not both.is_one_sided
    assert both.share_across > 0.1
    scan = scan_at(corner, np.zeros(3), beams=360)
    few = kept_of(replace(scan, weights=np.where(np.arange(len(scan.weights)) < 20, 1, 0.3)), KeptSettings())
    assert (few.kept, few.is_few, few.is_one_sided) == (20, True, False)


@pytest.mark.parametrize("side_m", [4.0, 10.0, 16.0, 22.0])
@pytest.mark.parametrize("beams", [240, 1080])
def test_a_square_room_holds_both_directions_alike_at_any_size_and_density(side_m, beams):
    half = side_m / 2
    room = plan_from_polylines([(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)])
    scan = scan_at(room, np.array([0.01, 0.02, 0.0]), beams=beams, fov_rad=2 * np.pi, reach_m=30.0, sigma_m=0.02,
                   rng=np.random.default_rng(0))  # fmt: skip
    kept = kept_of(scan, KeptSettings())
    assert kept.share_across == pytest.approx(0.5, abs=0.06)
    assert not kept.is_one_sided


@pytest.mark.parametrize("beams", [240, 1080])
def test_noise_makes_no_second_direction_of_a_wall_close_by(beams):
    wall = plan_from_polylines([(-8, 1), (8, 1)])
    scan = scan_at(wall, np.zeros(3), beams=beams, fov_rad=2 * np.pi, sigma_m=0.03, rng=np.random.default_rng(0))
    assert kept_of(scan, KeptSettings()).is_one_sided


def test_returns_that_are_far_from_each_other_tell_nothing():
    scan = scan_at(FLAT, POSE, beams=1080)
    apart = np.flatnonzero(scan.weights)[::60]
    few = replace(scan, weights=np.isin(np.arange(1080), apart).astype(np.float32))
    kept = kept_of(few, KeptSettings(least=1))
    assert np.isnan(kept.share_across)
    assert not kept.is_one_sided
