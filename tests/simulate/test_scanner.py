"""The LiDAR's faults one by one, each against what it claims."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulate.drawn import room, standing
from wallkit.simulate.scanner import Scanner, perfect, sweep
from wallkit.simulate.scene import NOTHING, Scene
from wallkit.simulate.world import Body, Solid, upright

EXACT = perfect(Scanner(beams=361, fov_rad=2 * math.pi, range_max_m=30.0))
FRONT = replace(EXACT, beams=401, fov_rad=0.2, is_instant=True)


def sweep_at(scanner, world, T, *, seed=0, **more):
    return sweep(np.random.default_rng(seed), scanner, Scene(world), 0, lambda _: T, **more)


def kinds(done, world):
    return {world.solids[k].instance for k in done.solids if k != NOTHING}


def test_a_perfect_one_measures_the_distance_and_knows_what_it_met():
    world = room(6, 4, standing("box", (0.5, 0.5, 1.0), 4.0, 2.0))
    done = sweep_at(EXACT, world, upright(2, 2, 0, 0.3))
    assert done.scan.ranges_m[180] == pytest.approx(4.0 - 0.25 - 2.0, abs=1e-6)
    assert world.solids[done.solids[180]].instance == "box"
    assert done.scan.ranges_m[0] == pytest.approx(2.0, abs=1e-6)


def test_noise_has_the_sigma_it_claims_at_every_range():
    noisy = replace(FRONT, sigma_m=0.01, sigma_per_m=0.004, fov_rad=0.01)
    for reach in (1.0, 5.0):
        ranges = np.concatenate(
            [sweep_at(noisy, room(20, 4), upright(20 - reach, 2, 0, 0.3), seed=k).scan.ranges_m for k in range(5)]
        )
        assert np.std(ranges) == pytest.approx(0.01 + 0.004 * reach, rel=0.1)
        assert np.mean(ranges) == pytest.approx(reach, abs=0.002)


def test_grazing_beams_are_noisier_and_get_lost():
    rough = replace(FRONT, sigma_m=0.01, grazing=1.0, grazing_dropout=0.9)
    steep = sweep_at(rough, room(40, 4), upright(1, 0.25, 0.13 - math.pi / 2 + math.pi / 2, 0.3)).scan.ranges_m
    flat = sweep_at(rough, room(40, 4), upright(1, 0.15, -0.12, 0.3)).scan.ranges_m
    assert np.isinf(flat).mean() > 0.3
    assert np.isinf(sweep_at(rough, room(6, 4), upright(3, 2, 0, 0.3)).scan.ranges_m).mean() < 0.01
    assert len(steep) == len(flat)


def test_what_is_out_of_reach_is_infinite_and_what_is_too_near_is_nothing():
    near_sighted = replace(EXACT, range_max_m=2.5, range_min_m=1.2)
    ranges = sweep_at(near_sighted, room(6, 4), upright(1, 2, 0, 0.3)).scan.ranges_m
    assert np.isposinf(ranges[180])
    assert np.isnan(ranges[0])
    assert ranges[270] == pytest.approx(2.0, abs=1e-6)


def test_dropout_loses_the_share_it_claims():
    lossy = replace(EXACT, beams=4000, dropout=0.1)
    done = sweep_at(lossy, room(6, 4), upright(3, 2, 0, 0.3))
    lost = np.isinf(done.scan.ranges_m)
    assert lost.mean() == pytest.approx(0.1, abs=3 * math.sqrt(0.09 / 4000))
    assert (done.solids[lost] == NOTHING).all()


def test_glass_answers_with_its_probability_and_is_looked_through_else():
    pane = standing("pane", (0.02, 4.0, 2.0), 4.0, 2.0, light="glass", p_return=0.3, class_name="glass")
    world = room(6, 4, pane)
    done = sweep_at(replace(FRONT, beams=3000), world, upright(2, 2, 0, 0.3))
    on_glass = np.array([world.solids[k].instance == "pane" for k in done.solids])
    assert on_glass.mean() == pytest.approx(0.3, abs=3 * math.sqrt(0.21 / 3000))
    np.testing.assert_allclose(done.scan.ranges_m[on_glass].min(), 1.99, atol=1e-3)
    np.testing.assert_allclose(done.scan.ranges_m[~on_glass].min(), 4.0, atol=1e-3)


def test_a_mirror_shows_the_room_before_it_behind_it():
    mirror = standing("mirror", (0.02, 4.0, 2.0), 5.0, 2.0, light="mirror", class_name="mirror")
    world = room(6, 4, mirror)
    done = sweep_at(FRONT, world, upright(3, 2, 0, 0.3))
    # 1.99 m to the mirror, and back past the LiDAR to the wall at x = 0
    assert done.scan.ranges_m[200] == pytest.approx(1.99 + 4.99, abs=1e-3)
    assert kinds(done, world) == {"mirror"}
    blind = sweep_at(replace(FRONT, ghosts=0.0), world, upright(3, 2, 0, 0.3))
    assert np.isinf(blind.scan.ranges_m).all()


def test_a_wide_beam_on_an_edge_gives_ranges_between_the_two_surfaces():
    world = room(6, 4, standing("edge", (0.1, 1.0, 1.0), 3.0, 2.5))
    wide = replace(FRONT, divergence_rad=0.01, beams=2001)
    done = sweep_at(wide, world, upright(1, 2.0, 0, 0.3))
    between = (done.scan.ranges_m > 2.2) & (done.scan.ranges_m < 4.8)
    assert between.any()
    assert (done.solids[between] == NOTHING).all()
    # only where the beam meets both: half its width to either side of the edge
    bearings = np.abs(wide.bearings_rad[between])
    assert bearings.max() <= 0.005 + 1e-3


def test_a_tilted_plane_meets_the_floor():
    floor = Solid("floor", "floor", "box", (20, 20, 0.1), upright(3, 2, 0, -0.05))
    world = room(6, 4, floor)
    T = upright(1, 2, 0, 0.2)
    tilt = np.eye(4)
    tilt[:3, :3] = [[math.cos(0.1), 0, math.sin(0.1)], [0, 1, 0], [-math.sin(0.1), 0, math.cos(0.1)]]
    done = sweep_at(FRONT, world, T @ tilt)
    assert world.solids[done.solids[200]].instance == "floor"
    assert done.scan.ranges_m[200] == pytest.approx(0.2 / math.sin(0.1), abs=1e-3)


def test_a_sweep_takes_time_while_robot_and_people_move():
    plate = Solid("plate", "person", "box", (0.02, 2.0, 2.0), np.eye(4), body="plate")
    world = room(20, 4, plate, bodies=(Body("plate"),))
    scene = Scene(world)

    def place(at_ns):
        scene.place({"plate": upright(10 + at_ns * 1e-9, 2, 0, 1)})

    def lidar(at_ns):
        return upright(5 - at_ns * 1e-9, 2, 0, 0.3)

    slow = replace(EXACT, beams=721, rate_hz=1.0, sectors=720)
    done = sweep(np.random.default_rng(0), slow, scene, 0, lidar, place_at=place)
    # straight ahead at half of the second: the plate is 1 m farther from the LiDAR than at the beginning
    assert done.scan.ranges_m[360] == pytest.approx(4.99 + 1.0, abs=0.01)
    # astern at its beginning and end: the wall comes nearer
    assert done.scan.ranges_m[0] - done.scan.ranges_m[-1] == pytest.approx(1.0, abs=0.01)


def test_the_same_seed_gives_the_same_sweep():
    world = room(6, 4, standing("box", (0.5, 0.5, 1.0), 4.0, 2.0))
    a, b, c = (sweep_at(Scanner(), world, upright(2, 2, 0, 0.3), seed=s).scan.ranges_m for s in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)
