"""Odometry that is wrong for one step: the place is found near by, and the update says so."""

from __future__ import annotations

import numpy as np
import pytest

from tests.localize.test_filter import at, drive, errors
from tests.localize.worlds import FLAT, fields_of, scan_at
from tests.movers import tour
from tests.plan import plan_from_polylines
from wallkit.core.geometry import compose, wrap_angle
from wallkit.core.types import Health
from wallkit.localize.estimate import find_modes
from wallkit.localize.particles import equally_weighted, normalised
from wallkit.localize.sensor import ClassConditional, LikelihoodField
from wallkit.localize.settings import LocalizeSettings
from wallkit.localize.slip import SlipSettings, look_around

ROUND = [(1.5, 1.5), (7.5, 1.5), (7.5, 3.5), (3.8, 3.8), (3.5, 7.0)]


@pytest.mark.parametrize("off", [(1.2, 0.3, 0.0), (0.0, 0.0, 1.2), (-0.8, 0.8, -1.0)])
def test_particles_within_reach_are_drawn_to_the_place_where_the_scan_fits(off):
    true = np.array([4.0, 2.0, 0.7])
    rng = np.random.default_rng(4)
    wrong = compose(true, np.array(off)) + 0.02 * rng.standard_normal((500, 3))
    fields = fields_of(FLAT)
    found = look_around(
        SlipSettings(), rng, equally_weighted(wrong), ClassConditional().on(fields), scan_at(FLAT, true, rng=rng)
    )
    best = find_modes(found.poses, normalised(found.log_weights))[0].pose
    assert len(found) == 500
    assert np.hypot(*(best - true)[:2]) < 0.1
    assert abs(wrap_angle(best[2] - true[2])) < np.deg2rad(3)


@pytest.mark.parametrize("slip", [(0.9, 0.0, 0.0), (0.0, 0.0, 1.1), (0.5, 0.3, -0.7)])
def test_a_late_stamp_costs_two_updates_of_trust_and_no_error(slip):
    """One frame's odometry is wrong and the next is right again, as when a driver stamps it late."""
    poses = tour(ROUND)
    odometry, k = poses.copy(), len(poses) // 2
    odometry[k] = compose(poses[k], np.array(slip))
    estimates, infos, _, _ = drive(LocalizeSettings(), FLAT, poses, odometry, start=at(poses[0]))
    position, heading = errors(estimates, poses)
    assert position.max() < 0.25
    assert np.rad2deg(heading.max()) < 8
    assert estimates[k].health is Health.UNCERTAIN
    assert "off in this step" in infos[k].reason
    wary = [i for i, e in enumerate(estimates) if e.health is not Health.LOCALIZED]
    assert set(wary) <= set(range(k, k + 5))


def test_without_the_look_the_same_slip_is_an_error_that_is_noticed():
    poses = tour(ROUND)
    odometry, k = poses.copy(), len(poses) // 2
    odometry[k] = compose(poses[k], np.array([1.05, 0.0, 0.0]))
    settings = LocalizeSettings(slip=SlipSettings(reach_m=0.0))
    estimates, _, _, _ = drive(settings, FLAT, poses, odometry, start=at(poses[0]))
    position, _ = errors(estimates, poses)
    assert position[k] > 0.1
    assert estimates[k].health is not Health.LOCALIZED


def test_people_who_shut_the_robot_in_are_no_slip():
    """They stand as the walls of the closet next door do: the scan fits there, but here nothing lies behind a wall."""
    hall = [(0, 2.75), (0, 6), (8, 6), (8, 0), (0, 0), (0, 2.6)]
    closet = [(0, 2.6), (-0.8, 2.6), (-0.8, 3.4), (0, 3.4)]
    plan = plan_from_polylines(hall, closet)
    poses = tour([(6.0, 1.0), (6.0, 5.0), (3.0, 3.0), (0.65, 3.0)])
    inside = np.array([4.0, 3.0])
    _, _, localizer, belief = drive(
        LocalizeSettings(sensor=LikelihoodField(sigma_m=0.05)),
        plan,
        poses,
        poses,
        start=at(poses[0]),
        fields=fields_of(plan, inside=inside),
    )
    here = belief.estimate(0).pose
    assert np.hypot(*(here - poses[-1])[:2]) < 0.05
    rng = np.random.default_rng(3)
    moved = compose(poses[-1], np.array([0.0, 0.0, np.deg2rad(12)]))
    shut_in = scan_at(plan, moved - np.array([1.05, 0.0, 0.0]), rng=rng)
    belief = localizer.predict(rng, belief, moved)
    belief, info = localizer.update(rng, belief, shut_in)
    assert info.is_update
    assert info.evidence.short > 0.5
    assert np.hypot(*(belief.estimate(1).pose - moved)[:2]) < 0.3
