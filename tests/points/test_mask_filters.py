"""What cameras say becomes weights: hard, dilated, soft, and nothing where nobody looked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of, scan_at
from wallkit.core.types import Estimate, Health
from wallkit.errors import ConfigError
from wallkit.localize.class_conditional import ClassConditional
from wallkit.pipelines.config import load_config
from wallkit.points.filters import apply_filters
from wallkit.points.mask_filters import RejectDynamic, SoftMask, WallMask

POSE = np.array([3.0, 2.0, 0.5])
ANYWHERE = Estimate(0, POSE, np.eye(3), Health.LOST)
CLASSES = ("wall", "door", "person", "background")


def labelled(shares, confidences=None):
    """A scan of as many returns as there are rows; a row of zeros is a return that no camera sees."""
    shares = np.array(shares, dtype=np.float32)
    scan = scan_at(FLAT, POSE)
    points = replace(scan.points, **{f: getattr(scan.points, f)[: len(shares)] for f in ("xyz_m", "ranges_m", "beams")})
    labels = np.where(shares.sum(axis=1) > 0, shares.argmax(axis=1), -1)
    sure = None if confidences is None else np.array(confidences, dtype=np.float32)
    return replace(scan, points=points, weights=scan.weights[: len(shares)], labels=labels, classes=CLASSES,
                   shares=shares, confidences=sure)  # fmt: skip


def weights(one, scan):
    return one.on(fields_of(FLAT)).weigh(scan, ANYWHERE).tolist()


@pytest.mark.parametrize(("table", "word"), [("wall_mask.keep", "Door"), ("reject_dynamic.reject", "people")])
def test_a_word_that_is_no_class_is_refused(table, word):
    with pytest.raises(ConfigError, match=f"'{word}' is no class") as caught:
        load_config(None, [f'points.{table}=["wall", "{word}"]'])
    assert "one of: background, ceiling, door" in str(caught.value)


ROWS = [[1, 0, 0, 0], [0.7, 0.3, 0, 0], [0.9, 0, 0.1, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]]


def test_the_wall_mask_wants_the_whole_circle_on_walls():
    assert weights(WallMask(), labelled(ROWS)) == [1, 0, 0, 0, 0, 1]
    assert weights(WallMask(keep=("wall", "door")), labelled(ROWS)) == [1, 1, 0, 0, 0, 1]
    assert weights(WallMask(unseen_weight=0.25), labelled(ROWS))[-1] == 0.25


def test_reject_dynamic_lets_a_person_reach_as_far_as_the_circle():
    assert weights(RejectDynamic(), labelled(ROWS)) == [1, 1, 0, 0, 1, 1]
    assert weights(RejectDynamic(reject=()), labelled(ROWS)) == [1, 1, 1, 1, 1, 1]


def test_the_soft_mask_is_the_mean_prior():
    soft = SoftMask(wall=1.0, door=0.8, person=0.0, background=0.5)
    np.testing.assert_allclose(weights(soft, labelled(ROWS)), [1, 0.94, 0.9, 0, 0.5, 1], atol=1e-6)
    # a model that is sure by half leaves the other half to what has no name
    np.testing.assert_allclose(weights(soft, labelled(ROWS, [0.5] * 6)), [0.75, 0.72, 0.7, 0.25, 0.5, 1], atol=1e-6)


@pytest.mark.parametrize(
    "one", [WallMask(unseen_weight=0.5), RejectDynamic(unseen_weight=0.5), SoftMask(unseen_weight=0.5)]
)
def test_without_a_camera_all_is_unseen(one):
    scan = scan_at(FLAT, POSE)
    assert set(weights(one, scan)) == {0.5}
    assert set(weights(one, replace(scan, labels=np.full(len(scan.weights), -1), classes=CLASSES))) == {0.5}


def test_labels_alone_are_shares_of_one():
    scan = replace(labelled(ROWS), shares=None)
    assert weights(WallMask(), scan) == [1, 1, 1, 0, 0, 1]
    assert weights(RejectDynamic(), scan) == [1, 1, 1, 0, 1, 1]


def test_class_conditional_takes_the_weight_as_its_prior_once():
    """pi_k = known_prior w_k, and the weight enters nowhere else."""
    scan = apply_filters([SoftMask().on(fields_of(FLAT))], labelled(ROWS, [0.8] * 6), ANYWHERE)
    known, unknown = ClassConditional(known_prior=0.9).mixtures(scan, np.arange(6))
    np.testing.assert_allclose(known, 0.9 * scan.weights, rtol=1e-6)
    everything, _ = ClassConditional(known_prior=1.0).mixtures(scan, np.arange(6))
    z = scan.points.ranges_m[:6]
    density = 0.2 * np.exp(-0.2 * z) / (1 - np.exp(-0.2 * 25))
    np.testing.assert_allclose(unknown, (1 - known) * density, rtol=1e-4)
    np.testing.assert_allclose(everything, scan.weights, rtol=1e-6)


def test_weights_multiply_in_any_order():
    scan = labelled(ROWS, [0.8] * 6)
    one, two = SoftMask(), RejectDynamic()
    a = apply_filters([one, two], scan, ANYWHERE).weights
    b = apply_filters([two, one], scan, ANYWHERE).weights
    np.testing.assert_array_equal(a, b)
    np.testing.assert_allclose(a, np.array(weights(one, scan)) * weights(two, scan), rtol=1e-6)
