"""Pairs of estimate and truth: one to one, nothing invented, everything left out is counted."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallkit.core.types import Trajectory
from wallkit.errors import WallkitError
from wallkit.evaluate.associate import ASSOCIATIONS, interpolate_truth, match_nearest

from .worlds import loop

STAMPS = st.sets(st.integers(0, 300), min_size=2, max_size=25)


def on_line(stamps):
    """A trajectory whose x is its stamp, so that a pose tells where it came from."""
    stamps = np.array(sorted(stamps), dtype=np.int64)
    return Trajectory(stamps, np.column_stack([stamps, np.zeros(len(stamps)), np.zeros(len(stamps))]).astype(float))


@pytest.mark.parametrize("name", ASSOCIATIONS)
def test_contract_equal_stamps_pair_equal_poses(name):
    truth = loop()
    pairs = ASSOCIATIONS[name](truth, truth, tolerance_ns=0)
    np.testing.assert_array_equal(pairs.rows, np.arange(len(truth)))
    np.testing.assert_allclose(pairs.estimate, truth.poses, atol=1e-12)
    np.testing.assert_allclose(pairs.truth, truth.poses, atol=1e-12)
    assert pairs.dropped == {}


@pytest.mark.parametrize("name", ASSOCIATIONS)
@given(estimate=STAMPS, truth=STAMPS, tolerance_ns=st.integers(0, 20))
def test_contract_rows_ascend_and_every_pose_is_accounted_for(name, estimate, truth, tolerance_ns):
    estimate = on_line(estimate)
    try:
        pairs = ASSOCIATIONS[name](estimate, on_line(truth), tolerance_ns=tolerance_ns)
    except WallkitError:
        return
    assert np.all(np.diff(pairs.rows) > 0)
    np.testing.assert_array_equal(pairs.stamps_ns, estimate.stamps_ns[pairs.rows])
    assert len(pairs) + sum(pairs.dropped.values()) == len(estimate)


@pytest.mark.parametrize("name", ASSOCIATIONS)
def test_contract_the_offset_is_added_to_the_truth(name):
    late = Trajectory(loop().stamps_ns + 7_000_000_000, loop().poses)
    pairs = ASSOCIATIONS[name](loop(), late, tolerance_ns=0, offset_ns=-7_000_000_000)
    np.testing.assert_allclose(pairs.truth, pairs.estimate, atol=1e-12)


@pytest.mark.parametrize("name", ASSOCIATIONS)
@pytest.mark.parametrize("shift_ns", [5_000_000_000_000, 5_900_000_000])
def test_contract_files_without_common_time_are_refused(name, shift_ns):
    late = Trajectory(loop().stamps_ns + shift_ns, loop().poses)
    with pytest.raises(
        WallkitError, match=r"estimate 1700000000\.000000000 to 1700000005\.900000000 s, truth 17"
    ) as caught:
        ASSOCIATIONS[name](loop(), late, tolerance_ns=10_000_000)
    assert f"--t-offset -{shift_ns // 10**9}." in caught.value.hint


@given(estimate=STAMPS, truth=STAMPS, tolerance_ns=st.integers(0, 20))
def test_nearest_is_one_to_one_and_no_partner_is_closer(estimate, truth, tolerance_ns):
    try:
        pairs = match_nearest(on_line(estimate), on_line(truth), tolerance_ns=tolerance_ns)
    except WallkitError:
        return
    partners = pairs.truth[:, 0]
    assert len(set(partners)) == len(pairs)
    gaps = np.abs(partners - pairs.stamps_ns)
    assert gaps.max() <= tolerance_ns
    long = np.array(sorted(truth if len(truth) >= len(estimate) else estimate))
    short = pairs.stamps_ns if len(truth) >= len(estimate) else partners
    np.testing.assert_array_equal(gaps, np.abs(short[:, None] - long).min(axis=1))


def test_a_tie_takes_the_earlier_and_a_shared_partner_goes_to_the_nearer():
    pairs = match_nearest(on_line({10, 30}), on_line({5, 15, 30}), tolerance_ns=9)
    np.testing.assert_array_equal(pairs.truth[:, 0], [5, 30])
    pairs = match_nearest(on_line({10, 14, 40}), on_line({13, 41, 99}), tolerance_ns=9)
    np.testing.assert_array_equal(pairs.stamps_ns, [14, 40])
    assert pairs.dropped == {"without a truth pose in time": 1}


def test_truth_is_interpolated_along_the_shorter_turn():
    truth = Trajectory(np.array([0, 100]), np.array([[0, 0, np.deg2rad(170)], [1, 2, np.deg2rad(-170)]]))
    estimate = Trajectory(np.array([25, 50]), np.zeros((2, 3)))
    pairs = interpolate_truth(estimate, truth, tolerance_ns=100)
    np.testing.assert_allclose(pairs.truth[:, :2], [[0.25, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(np.abs(pairs.truth[:, 2]), np.deg2rad([175, 180]))


def test_nothing_is_extrapolated_or_invented_in_a_gap():
    pairs = interpolate_truth(on_line({0, 10, 15, 20, 50, 79, 90}), on_line({10, 20, 80}), tolerance_ns=5)
    np.testing.assert_array_equal(pairs.stamps_ns, [10, 15, 20, 79])
    np.testing.assert_allclose(pairs.truth[:, 0], pairs.stamps_ns)
    assert pairs.dropped == {"before the truth starts": 1, "after the truth ends": 1, "in a gap of the truth": 1}
