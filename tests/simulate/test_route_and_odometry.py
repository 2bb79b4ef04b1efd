"""Robots drive as bases do and go round things; odometry errs as its settings say, and they can be fitted back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulate.drawn import room, standing
from wallkit.core.geometry import relative, wrap_angle
from wallkit.errors import SimulationError
from wallkit.simulate.floor import floor_of
from wallkit.simulate.odometry import WheelOdometry, fitted_alphas, odometry_of
from wallkit.simulate.route import Route, drive
from wallkit.simulate.scenario import Timing
from wallkit.simulate.timing import schedule

HALL = floor_of(room(10, 6, standing("table", (2.0, 1.0, 0.8), 5, 3)))
SQUARE = Route(waypoints=((1, 1), (9, 1), (9, 5), (1, 5)))
EXACT = WheelOdometry(0, 0, 0, 0, radius_error=0, difference_error=0, baseline_error=0)


def driven(route=SQUARE, rate_hz=20.0, seed=0, **more):
    return drive(np.random.default_rng(seed), route, HALL, rate_hz, **more)


# ------------------------------------------------------------------------------------------------------- route


def test_a_robot_passes_its_waypoints_no_faster_than_it_can():
    poses = driven(replace(SQUARE, laps=2))
    for waypoint in SQUARE.waypoints:
        assert np.hypot(*(poses[:, :2] - waypoint).T).min() < 0.2
    np.testing.assert_allclose(poses[-1, :2], SQUARE.waypoints[0], atol=0.07)
    speeds = np.hypot(*np.diff(poses[:, :2], axis=0).T) * 20
    turns = np.abs(wrap_angle(np.diff(poses[:, 2]))) * 20
    assert speeds.max() <= SQUARE.speed_m_s + 1e-6
    assert turns.max() <= SQUARE.turn_rad_s + 1e-6
    # it comes to rest from a crawl
    assert np.abs(np.diff(speeds)).max() <= 2 * SQUARE.acceleration_m_s2 / 20 + 0.06


def test_a_base_never_moves_sideways():
    steps = relative((poses := driven(rate_hz=100.0))[:-1], poses[1:])
    assert np.abs(steps[:, 1]).max() < 1e-4


def test_the_way_goes_round_the_table_unless_told_to_go_straight():
    through = Route(waypoints=((2, 3), (8, 3)))
    assert HALL.clearance_at(driven(through)[:, :2]).min() > through.radius_m - 0.1
    with pytest.raises(SimulationError, match=r"from 2.00 3.00 to 8.00 3.00 goes through something at 4"):
        driven(replace(through, direct=True))
    with pytest.raises(SimulationError, match="one waypoint"):
        driven(Route(waypoints=((2, 3),)))


def test_a_log_may_end_before_its_route_and_stops_pause():
    assert len(driven(duration_s=4.0)) == 81
    pausing = driven(replace(SQUARE, pause_s=2.0))
    still = np.hypot(*np.diff(pausing[:, :2], axis=0).T) < 1e-9
    assert still.sum() / 20 >= 3 * 2.0 + 1.0 - 0.3


# ---------------------------------------------------------------------------------------------------- odometry


def test_odometry_without_errors_is_the_way_seen_from_its_start():
    poses = driven()
    claimed = odometry_of(np.random.default_rng(0), EXACT, poses, 20.0)
    np.testing.assert_allclose(claimed[:, :2], relative(poses[0], poses)[:, :2], atol=1e-9)


def test_larger_wheels_claim_too_little_and_a_wider_base_turns_too_little():
    straight = driven(Route(waypoints=((1, 1), (9, 1))))
    big = odometry_of(np.random.default_rng(0), replace(EXACT, radius_error=0.02), straight, 20.0)
    assert big[-1, 0] == pytest.approx(np.hypot(*(straight[-1] - straight[0])[:2]) / 1.02, abs=1e-3)
    wide = odometry_of(np.random.default_rng(0), replace(EXACT, baseline_error=0.1), driven(), 20.0)
    truth = relative(driven()[0], driven())
    turned = np.unwrap(truth[:, 2])[-1] - truth[0, 2]
    assert np.unwrap(wide[:, 2])[-1] == pytest.approx(1.1 * turned, rel=1e-3)


def test_slips_claim_their_way_as_often_as_they_should():
    still = np.zeros((20 * 600, 3))
    slips = replace(EXACT, slips_per_minute=3.0, slip_m=0.05, slip_rad=0.0)
    claimed = odometry_of(np.random.default_rng(0), slips, still, 20.0)
    assert claimed[-1, 0] / 0.05 == pytest.approx(30, abs=3 * math.sqrt(30))


def test_ticks_lose_less_than_one():
    poses = driven(Route(waypoints=((1, 1), (9, 1))))
    coarse = odometry_of(np.random.default_rng(0), replace(EXACT, tick_m=0.01), poses, 20.0)
    assert np.abs(coarse[:, 0] - relative(poses[0], poses)[:, 0]).max() < 0.011


def test_the_alphas_of_twenty_minutes_are_those_they_were_made_with():
    wanted = np.array([0.05, 0.01, 0.02, 0.01])
    noise = replace(EXACT, **dict(zip(("alpha1", "alpha2", "alpha3", "alpha4"), wanted.tolist(), strict=True)))
    poses = driven(Route(random_stops=150), duration_s=1200.0)
    claimed = odometry_of(np.random.default_rng(1), noise, poses, 20.0)
    found, sigma = fitted_alphas(relative(poses[:-1], poses[1:]), relative(claimed[:-1], claimed[1:]))
    assert np.all(np.abs(found - wanted) < np.maximum(0.1 * wanted, 3 * sigma))
    assert np.all(sigma < 0.05 * wanted)


# ------------------------------------------------------------------------------------------------------ timing


def test_a_schedule_has_the_rate_faults_and_losses_it_was_asked_for():
    timing = Timing(phase_s=0.03, jitter_s=0.004, latency_s=0.05, offset_s=0.02, drift_ppm=100.0, drops=0.1)
    done = schedule(np.random.default_rng(0), timing, 10.0, 400.0)
    times, stamps, logs = done.times_ns / 1e9, done.stamps_ns / 1e9, done.logs_ns / 1e9
    assert len(times) + done.dropped == 4000
    assert done.dropped == pytest.approx(400, abs=3 * math.sqrt(360))
    assert (np.diff(times) > 0).all()
    regular = 0.03 + np.round((times - 0.03) * 10) / 10
    assert np.std(times - regular) == pytest.approx(0.004, rel=0.1)
    np.testing.assert_allclose(stamps - times, 0.02 + 1e-4 * times, atol=1e-8)
    np.testing.assert_allclose(logs - times, 0.05, atol=1e-8)
