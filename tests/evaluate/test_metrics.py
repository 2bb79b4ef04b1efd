"""The metrics: closed forms, invariances, and one contract for every entry."""

import numpy as np
import pytest

from wallkit.core.types import Trajectory
from wallkit.evaluate.metrics import METRICS, align, errors_from_pairs, measure, per_metre

from .worlds import disturbed, loop, moved, paired

MOTION = (3.0, -8.0, 2.5)


@pytest.mark.parametrize("key", [key for key, metric in METRICS.items() if metric.better])
def test_contract_a_perfect_estimate_has_no_error(key):
    assert METRICS[key].compute(paired(loop(), loop())) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("key", METRICS)
def test_contract_moving_the_map_changes_nothing(key):
    estimate, truth = disturbed(loop()), loop()
    here = METRICS[key].compute(paired(estimate, truth))
    there = METRICS[key].compute(paired(moved(estimate, MOTION), moved(truth, MOTION)))
    assert there == pytest.approx(here, abs=1e-9)


@pytest.mark.parametrize("key", METRICS)
def test_contract_names_end_in_their_unit_and_inputs_stay_as_they_were(key):
    metric = METRICS[key]
    assert key.endswith(f"_{metric.unit}")
    assert metric.definition
    assert "\n" not in metric.definition
    pairs = paired(disturbed(loop()), loop())
    before = pairs.estimate.copy(), pairs.truth.copy()
    metric.compute(pairs)
    np.testing.assert_array_equal((pairs.estimate, pairs.truth), before)


@pytest.mark.parametrize("key", [key for key in METRICS if "aligned" in key or key.startswith("rpe")])
def test_aligned_and_relative_errors_do_not_see_the_frame(key):
    pairs = paired(moved(disturbed(loop()), MOTION), loop())
    assert METRICS[key].compute(pairs) == pytest.approx(
        METRICS[key].compute(paired(disturbed(loop()), loop())), abs=1e-9
    )


def test_a_constant_offset_is_the_error():
    truth = loop()
    estimate = Trajectory(truth.stamps_ns, truth.poses + np.array([0.3, -0.4, np.deg2rad(-2)]))
    values = {key: value.value for key, value in measure(paired(estimate, truth)).items()}
    for key in ("ate_rmse_m", "ate_median_m", "ate_max_m", "error_mean_m"):
        assert values[key] == pytest.approx(0.5)
    assert values["error_sd_m"] == pytest.approx(0, abs=1e-12)
    assert values["heading_error_mean_deg"] == pytest.approx(2)
    assert values["ate_aligned_rmse_m"] == pytest.approx(0, abs=1e-12)


def test_headings_are_compared_round_the_circle():
    truth = Trajectory(np.arange(2), np.array([[0, 0, np.deg2rad(179)], [5, 0, np.deg2rad(-179)]]))
    estimate = Trajectory(np.arange(2), truth.poses * [1, 1, -1])
    np.testing.assert_allclose(errors_from_pairs(paired(estimate, truth)).heading_deg, 2)


def test_alignment_finds_the_motion_and_no_other_is_better():
    truth, estimate = loop(), disturbed(loop(), sigma_m=0.3)
    undo = align(moved(truth, MOTION).poses, truth.poses)
    np.testing.assert_allclose(moved(moved(truth, MOTION), undo).poses, truth.poses, atol=1e-9)
    best = align(estimate.poses, truth.poses)

    def cost(motion):
        return np.sum((moved(estimate, motion).poses - truth.poses)[:, :2] ** 2)

    for nudge in np.vstack([np.eye(3), -np.eye(3)]) * 1e-3:
        assert cost(best) < cost(best + nudge)


def test_a_robot_that_stood_still_has_no_aligned_or_metre_numbers():
    still = Trajectory(np.arange(5), np.zeros((5, 3)))
    values = measure(paired(disturbed(still), still))
    missing = {key for key, value in values.items() if value.value is None}
    assert missing == {key for key in METRICS if "aligned" in key} | {key for key in METRICS if "rpe_1m" in key}


def test_path_pieces_are_consecutive_and_just_long_enough():
    poses = np.column_stack([np.arange(0, 3.3, 0.3), np.zeros(11), np.zeros(11)])
    trajectory = Trajectory(np.arange(11), poses)
    starts, ends = per_metre(paired(trajectory, trajectory))
    np.testing.assert_array_equal(starts, [0, 4])
    np.testing.assert_array_equal(ends, [4, 8])


def test_rpe_of_a_wheel_that_is_five_percent_too_large():
    poses = np.column_stack([np.arange(0, 10, 0.25), np.zeros((40, 2))])
    truth, estimate = Trajectory(np.arange(40), poses), Trajectory(np.arange(40), poses * [1.05, 1, 1])
    values = measure(paired(estimate, truth))
    assert values["rpe_update_rmse_m"].value == pytest.approx(0.25 * 0.05)
    assert values["rpe_1m_rmse_m"].value == pytest.approx(1.0 * 0.05)
    assert values["path_length_m"].value == pytest.approx(9.75)
