"""The contract of every sensor model, and each model's formula on a scan one can work out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of, scan_at
from tests.plan import plan_from_polylines
from wallkit.core.geometry import compose
from wallkit.core.types import FieldSet
from wallkit.localize.sensor import SENSORS, Beam, ClassConditional, LikelihoodField

TRUE = np.array([3.5, 2.0, 0.3])


@pytest.fixture(scope="module")
def fields():
    return fields_of(FLAT)


def log_likelihood(model, fields, poses, scan):
    return model.on(fields).log_likelihood(np.atleast_2d(poses), scan)


@pytest.mark.parametrize("name", SENSORS)
class TestContract:
    """What the filter relies on, for every sensor model."""

    def test_finite_and_one_number_per_pose(self, name, fields):
        poses = np.random.default_rng(0).uniform(-20, 20, (57, 3))
        out = log_likelihood(SENSORS[name](), fields, poses, scan_at(FLAT, TRUE))
        assert out.shape == (57,)
        assert np.isfinite(out).all()

    def test_the_true_pose_beats_poses_a_robot_would_notice(self, name, fields):
        scan = scan_at(FLAT, TRUE)
        offsets = [(0.3, 0, 0), (-0.3, 0, 0), (0, 0.3, 0), (0, -0.3, 0), (0, 0, 0.1), (0, 0, -0.1), (2, 1, 2)]
        out = log_likelihood(SENSORS[name](), fields, np.array([TRUE, *(TRUE + np.array(o) for o in offsets)]), scan)
        assert (out[0] > out[1:]).all()

    def test_returns_of_weight_0_change_nothing(self, name, fields):
        scan = scan_at(FLAT, TRUE, beams=40)
        poses = TRUE + np.random.default_rng(1).normal(0, 0.2, (20, 3))
        ghost = scan_at(FLAT, TRUE + [0.5, 0.3, 1.0], beams=37).points
        both = replace(
            scan.points,
            xyz_m=np.concatenate([scan.points.xyz_m, ghost.xyz_m]),
            ranges_m=np.concatenate([scan.points.ranges_m, ghost.ranges_m]),
            beams=np.concatenate([scan.points.beams, ghost.beams]),
        )
        weights = np.concatenate([scan.weights, np.zeros(len(ghost.ranges_m), np.float32)])
        with_ghosts = log_likelihood(
            SENSORS[name](beams=300), fields, poses, replace(scan, points=both, weights=weights)
        )
        alone = log_likelihood(SENSORS[name](beams=300), fields, poses, scan)
        np.testing.assert_allclose(with_ghosts - with_ghosts[0], alone - alone[0], atol=1e-3)

    def test_no_return_tells_nothing(self, name, fields):
        scan = scan_at(FLAT, TRUE)
        none = replace(
            scan.points,
            xyz_m=np.zeros((0, 3), np.float32),
            ranges_m=np.zeros(0, np.float32),
            beams=np.zeros(0, np.int64),
        )
        empty = replace(scan, points=replace(none, misses_rad=np.zeros(0, np.float32)), weights=np.zeros(0, np.float32))
        np.testing.assert_array_equal(log_likelihood(SENSORS[name](), fields, np.zeros((5, 3)), empty), np.zeros(5))

    def test_moving_map_and_poses_together_changes_nothing(self, name, fields):
        """Also by a fraction of a cell and a turn: nothing is rounded to the grid but the grid itself."""
        scan = scan_at(FLAT, TRUE, mount=(0.2, -0.1, 0.5))
        poses = TRUE + np.random.default_rng(3).normal(0, 0.2, (40, 3))
        move = np.array([3.3333, -7.77, 2.0])
        moved = FieldSet(fields.distances_m, fields.is_free, fields.resolution_m, compose(move, fields.origin))
        here = log_likelihood(SENSORS[name](), fields, poses, scan)
        there = log_likelihood(SENSORS[name](), moved, compose(move, poses), scan)
        # float32 puts a few endpoints on the other side of a cell's edge
        np.testing.assert_allclose(there, here, atol=0.03 * np.ptp(here))

    def test_any_number_of_threads_gives_the_same_bits(self, name, fields):
        scan = scan_at(FLAT, TRUE)
        poses = TRUE + np.random.default_rng(4).normal(0, 0.3, (101, 3))
        one = SENSORS[name]().on(fields, threads=1).log_likelihood(poses, scan)
        two = SENSORS[name]().on(fields, threads=2).log_likelihood(poses, scan)
        np.testing.assert_array_equal(one, two)


def one_wall(distance_m=0.0):
    """A field that is `distance_m` everywhere, so that each beam's term can be written down."""
    return FieldSet(
        {"all": np.full((400, 400), distance_m, np.float32)},
        np.ones((400, 400), bool),
        0.1,
        np.array([-20.0, -20.0, 0.0]),
    )


def test_likelihood_field_is_the_tempered_sum_of_logs():
    scan = scan_at(FLAT, TRUE, beams=50)
    model = LikelihoodField(sigma_m=0.2, z_hit=0.7, z_rand=0.3, temper=0.5, beams=100)
    d = 0.25
    p = 0.7 * np.exp(-0.5 * (d / 0.2) ** 2) / (0.2 * np.sqrt(2 * np.pi)) + 0.3 / 25.0
    out = log_likelihood(model, one_wall(d), TRUE, scan)
    assert out[0] == pytest.approx(0.5 * len(scan.weights) * np.log(p), rel=1e-5)


def test_class_conditional_mixes_known_and_unknown_per_beam():
    scan = scan_at(FLAT, TRUE, beams=50)
    weights = np.linspace(0.1, 1, len(scan.weights)).astype(np.float32)
    model = ClassConditional(sigma_m=0.2, known_prior=0.9, unknown_rate_per_m=0.5, temper=1.0, beams=100)
    d, z = 0.1, scan.points.ranges_m.astype(np.float64)
    known = np.exp(-0.5 * (d / 0.2) ** 2) / (0.2 * np.sqrt(2 * np.pi))
    unknown = 0.5 * np.exp(-0.5 * z) / (1 - np.exp(-0.5 * 25.0))
    wanted = np.log(0.9 * weights * known + (1 - 0.9 * weights) * unknown).sum()
    assert log_likelihood(model, one_wall(d), TRUE, replace(scan, weights=weights))[0] == pytest.approx(
        wanted, rel=1e-4
    )


@pytest.mark.parametrize("expected", [2.0, 8.0])
def test_beam_model_density_is_a_distribution_over_ranges(expected):
    """Short, hit and random integrate to their shares; what is left of one is z_max at the far end."""
    model = Beam(z_hit=0.7, z_short=0.15, z_max=0.05, z_rand=0.1)
    z = np.linspace(0, 9.999, 20_001).astype(np.float32)
    p = model.density(z, np.full((1, 1), expected, np.float32), 10.0)[0]
    assert np.trapezoid(p, z) == pytest.approx(0.95, abs=0.002)


def test_beam_model_notices_a_beam_that_should_have_returned():
    wall = plan_from_polylines([(0, 0), (4, 0), (4, 4), (0, 4), (0, 0)])
    fields = fields_of(wall)
    pose = np.array([2.0, 2.0, 0.0])
    scan = scan_at(wall, pose, reach_m=12.0)
    blind = replace(
        scan.points,
        xyz_m=np.zeros((0, 3), np.float32),
        ranges_m=np.zeros(0, np.float32),
        beams=np.zeros(0, np.int64),
        misses_rad=np.linspace(-1, 1, 60).astype(np.float32),
    )
    empty = replace(scan, points=blind, weights=np.zeros(0, np.float32))
    inside, outside = log_likelihood(Beam(), fields, np.array([pose, [-30.0, -30.0, 3.0]]), empty)
    assert outside > inside + 10
