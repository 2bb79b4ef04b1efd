"""The contract of every point filter, and what each is for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of, scan_at
from wallkit.core.types import Estimate, Health
from wallkit.errors import ConfigError
from wallkit.points.filters import FILTERS, Novelty, PointsSettings, apply_filters

POSE = np.array([3.0, 2.0, 0.5])
KNOWN = Estimate(0, POSE, np.eye(3) * 1e-4, Health.LOCALIZED)
PERSON = np.array([[4.0, 2.6, 0.3]])


@pytest.fixture(scope="module")
def fields():
    return fields_of(FLAT)


@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_weighs_every_return_between_0_and_1(name, fields):
    bound = FILTERS[name]().on(fields)
    for discs in (PERSON, PERSON[:0]):
        scan = scan_at(FLAT, POSE, discs=discs)
        weights = bound.weigh(scan, KNOWN)
        assert weights.shape == scan.weights.shape
        assert weights.dtype == np.float32
        assert ((weights >= 0) & (weights <= 1)).all()


@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_leaves_a_clean_scan_and_its_input_alone(name, fields):
    scan = scan_at(FLAT, POSE)
    kept = apply_filters([FILTERS[name]().on(fields)], scan, KNOWN)
    assert kept.weights.mean() > 0.95
    assert (scan.weights == 1).all()


def test_novelty_drops_the_person_and_nothing_else(fields):
    clean, crowded = scan_at(FLAT, POSE), scan_at(FLAT, POSE, discs=PERSON)
    on_person = crowded.points.ranges_m < clean.points.ranges_m - 0.5
    weights = Novelty().on(fields).weigh(crowded, KNOWN)
    np.testing.assert_array_equal(weights, np.where(on_person, 0, 1))


def test_novelty_keeps_out_when_it_does_not_know_where_it_is(fields):
    scan = scan_at(FLAT, POSE, discs=PERSON)
    weights = Novelty().on(fields).weigh(scan, replace(KNOWN, health=Health.UNCERTAIN))
    assert (weights == 1).all()


def test_weights_of_several_filters_multiply(fields):
    scan = scan_at(FLAT, POSE, discs=PERSON)
    half = Novelty(novel_weight=0.5).on(fields)
    assert set(np.unique(apply_filters([half, half], scan, KNOWN).weights)) == {0.25, 1.0}


def test_an_unknown_filter_is_refused_by_name():
    with pytest.raises(ConfigError, match="no point filter is called 'novel'"):
        PointsSettings(filters=("novel",))
