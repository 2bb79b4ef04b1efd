"""Where the first particles are."""

from __future__ import annotations

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of
from wallkit.core.grid import distances_at
from wallkit.core.types import FieldSet, StampedPose
from wallkit.errors import MapError
from wallkit.localize.initial import SPREADS, START_SD, around_pose


@pytest.mark.parametrize("name", SPREADS)
def test_every_spread_covers_the_map_in_all_headings(name):
    fields = fields_of(FLAT)
    poses = SPREADS[name](np.random.default_rng(0), fields, 20_000)
    assert poses.shape == (20_000, 3)
    assert np.isfinite(distances_at(fields, poses[:, :2])).all()
    assert abs(np.exp(1j * poses[:, 2]).mean()) < 0.02


def test_global_stands_in_free_space_and_everywhere_does_not_only():
    fields = fields_of(FLAT)
    for name, share in (("global", 1.0), ("everywhere", fields.is_free.mean())):
        poses = SPREADS[name](np.random.default_rng(1), fields, 20_000)
        column, row = np.floor((poses[:, :2] - fields.origin[:2]) / fields.resolution_m).astype(int).T
        assert fields.is_free[row, column].mean() == pytest.approx(share, abs=0.02)


def test_around_a_pose_with_its_covariance_or_the_default():
    rng = np.random.default_rng(2)
    covariance = np.diag([0.04, 0.01, 0.0025])
    poses = around_pose(rng, StampedPose(0, "map", np.array([1.0, 2.0, 0.5]), covariance), 50_000)
    np.testing.assert_allclose(poses.mean(axis=0), [1, 2, 0.5], atol=0.005)
    np.testing.assert_allclose(np.cov(poses.T), covariance, atol=0.001)
    wide = around_pose(rng, StampedPose(0, "map", np.zeros(3)), 50_000)
    np.testing.assert_allclose(wide.std(axis=0), START_SD, rtol=0.02)


def test_a_map_without_free_space_is_refused():
    closed = FieldSet({"all": np.zeros((5, 5), np.float32)}, np.zeros((5, 5), bool), 0.1, np.zeros(3), "wall.yaml")
    with pytest.raises(MapError, match="no free space"):
        SPREADS["global"](np.random.default_rng(0), closed, 10)
