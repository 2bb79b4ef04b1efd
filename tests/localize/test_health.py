"""Rays are classified by geometry, and the verdict tells people from a wrong place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of, scan_at
from wallkit.core.raycast import HIT, LONG, SHORT, classify_rays
from wallkit.core.types import Health, Mode
from wallkit.localize.health import (
    Evidence,
    HealthSettings,
    Trust,
    count_updates,
    has_outlived,
    is_ripe,
    judge,
    weigh_evidence,
)

POSE = np.array([3.0, 2.0, 0.5])
SETTINGS = HealthSettings()
TIGHT = np.array([0.05, 0.05, 0.01])
SURE = (Mode(POSE, np.eye(3) * 1e-3, 1.0),)


@pytest.fixture(scope="module")
def rays():
    return fields_of(FLAT)


def shares(codes):
    return np.bincount(codes, minlength=3) / len(codes)


def classified(rays, pose, scan):
    return classify_rays(rays, scan.points, np.array(pose), tolerance_m=0.2, tolerance_per_m=0.02)


def test_at_the_true_pose_everything_is_a_hit(rays):
    codes = classified(rays, POSE, scan_at(FLAT, POSE, mount=(0.2, 0.1, 0.3)))
    assert (codes == HIT).all()


def test_a_person_is_short_and_never_long(rays):
    scan = scan_at(FLAT, POSE, discs=np.array([[4.0, 2.6, 0.3]]))
    codes = classified(rays, POSE, scan)
    assert (codes == SHORT).sum() > 10
    assert not (codes == LONG).any()


def test_at_a_wrong_pose_returns_lie_behind_walls(rays):
    _, _, long = shares(classified(rays, POSE + [1.2, 0.8, 0.9], scan_at(FLAT, POSE)))
    assert long > 0.15


def evidence(hit, long, sd=TIGHT, modes=SURE):
    short = 1 - hit - long
    counts = np.round(np.array([hit, short, long]) * 1000).astype(int)
    return weigh_evidence(np.repeat([HIT, SHORT, LONG], counts).astype(np.int8), sd, modes)


def after(updates, before=Trust(Health.LOCALIZED, "", is_confirmed=True, usual=0.98), **kwargs):
    trust = before
    for e in updates:
        trust = judge(SETTINGS, count_updates(SETTINGS, trust, e, path_m=0.3, gap_s=0.0, has_jumped=False, **kwargs), e)
    return trust


def test_a_crowd_that_hides_two_thirds_of_the_walls_is_not_being_lost():
    assert after([evidence(0.33, 0.01)] * 20).health is Health.LOCALIZED


def test_a_wrong_place_is_uncertain_at_once_and_lost_at_the_second_update():
    wrong = evidence(0.4, 0.35)
    assert after([wrong]).health is Health.UNCERTAIN
    assert after([wrong, wrong]).health is Health.LOST
    assert not after([wrong, wrong]).is_confirmed


def test_what_is_bad_depends_on_what_is_usual_here():
    so_so = evidence(0.85, 0.15)
    assert after([so_so]).health is Health.UNCERTAIN
    assert after([so_so], Trust(Health.LOCALIZED, "", is_confirmed=True, usual=0.85)).health is Health.LOCALIZED


def test_people_all_around_are_no_doubt_about_the_place_unless_they_stay():
    hidden = evidence(0.02, 0.01)
    once = after([hidden])
    assert once.health is Health.UNCERTAIN
    assert once.is_confirmed
    assert "nothing of it is seen" in once.reason
    almost = after([hidden] * (SETTINGS.shut_in_updates_to_lose - 1))
    assert almost.health is Health.UNCERTAIN
    assert almost.is_confirmed
    assert after([evidence(0.98, 0.0)], almost).health is Health.LOCALIZED
    lost = after([hidden], almost)
    assert lost.health is Health.LOST
    assert not lost.is_confirmed
    # a robot that stands still among them learns nothing by waiting
    assert after([hidden] * 200, is_forced=True).health is Health.UNCERTAIN


def test_returns_that_are_missing_are_nobody_all_around():
    few = Evidence(np.full(3, HIT, np.int8), 0.05, 0.0, 0.0, TIGHT, 0.0)
    assert after([few]).is_confirmed
    assert after([few] * SETTINGS.doubtful_updates_to_lose).health is Health.LOST


def test_a_gap_or_a_jump_makes_it_a_hypothesis():
    before = Trust(Health.LOCALIZED, "", is_confirmed=True, good=50)
    good = evidence(0.99, 0.0)
    gap = count_updates(SETTINGS, before, good, path_m=0.3, gap_s=60.0, has_jumped=False)
    jump = count_updates(SETTINGS, before, good, path_m=0.3, gap_s=0.0, has_jumped=True)
    for trust in (gap, jump):
        assert judge(SETTINGS, trust, good).health is Health.UNCERTAIN
        assert trust.good == 1


@pytest.mark.parametrize(
    "doubt",
    [evidence(0.99, 0.0, sd=np.array([0.9, 0.1, 0.01])), evidence(0.99, 0.0, modes=(replace(SURE[0], weight=0.7),))],
)
def test_spread_or_a_second_hypothesis_is_uncertain(doubt):
    assert after([doubt]).health is Health.UNCERTAIN


def test_a_new_hypothesis_ripens_and_outlives():
    good = evidence(0.98, 0.0)
    start = Trust()
    young = after([good] * (SETTINGS.good_updates_to_trust - 1), start)
    ripe = after([good] * SETTINGS.good_updates_to_trust, start)
    old = after([good] * 60, start)
    assert not is_ripe(SETTINGS, young, good)
    assert is_ripe(SETTINGS, ripe, good)
    assert ripe.health is Health.UNCERTAIN
    assert not has_outlived(SETTINGS, ripe, good, were_sought=True)
    assert has_outlived(SETTINGS, old, good, were_sought=True)
    assert not has_outlived(SETTINGS, old, good, were_sought=False)


def test_no_returns_explain_nothing():
    empty = weigh_evidence(np.zeros(0, np.int8), TIGHT, SURE)
    assert (empty.hit, empty.short, empty.long, empty.explained) == (0.0, 0.0, 0.0, 0.0)
    assert isinstance(empty, Evidence)
