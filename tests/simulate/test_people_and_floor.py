"""People keep to the floor and apart, feet stand while they carry, ways go round what is in the way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.simulate.drawn import door, room, standing
from wallkit.errors import SimulationError
from wallkit.simulate.crowd import BODY_RADIUS_M, STEP_S, Crowd, people_from
from wallkit.simulate.figure import PARTS, Figure, postures
from wallkit.simulate.floor import floor_of
from wallkit.simulate.scene import Scene
from wallkit.simulate.world import World

HALL = room(10, 6, standing("table", (2.0, 1.0, 0.8), 5, 3))
ROBOT = np.tile([1.0, 1.0, 0.0], (int(40 / STEP_S), 1))


def crowd(seed=0, world=HALL, **counts):
    return people_from(np.random.default_rng(seed), Crowd(**counts), floor_of(world, with_doors=False), ROBOT)


def test_clearance_is_the_distance_to_the_nearest_thing():
    floor = floor_of(HALL)
    points = np.array([[2.0, 3.0], [5.0, 4.5], [9.0, 3.0], [5.0, 3.0]])
    np.testing.assert_allclose(floor.clearance_at(points), [2.0, 1.0, 1.0, 0.0], atol=0.12)
    assert floor.area_m2 == pytest.approx(10 * 6 - 2, rel=0.05)


def test_a_way_is_short_and_clear_and_needs_an_open_door():
    way = floor_of(HALL).way((2, 3), (8, 3), 0.3)
    length = float(np.hypot(*np.diff(way, axis=0).T).sum())
    exact = 2 * math.hypot(2 - 0.3, 0.8) + 2 + 0.6
    assert exact * 0.98 < length < exact * 1.15
    leaf, hinge = door("door", 4.9, 2.0, 1.0)
    walls = (standing("a", (0.1, 2.0, 2.5), 5, 1.0), standing("b", (0.1, 3.0, 2.5), 5, 4.5))
    halved = room(10, 6, *walls, leaf, bodies=(hinge,))
    turned = World("t", halved.solids, halved.bodies, halved.rooms)
    floor_of(turned, {"door_hinge": 0.0}).way((2, 3), (8, 3), 0.3)
    with pytest.raises(SimulationError, match="no way from"):
        floor_of(turned, {"door_hinge": math.pi / 2}).way((2, 3), (8, 3), 0.3)
    with pytest.raises(SimulationError, match=r"begins at 5.00 3.00, 0.00 m from an obstacle"):
        floor_of(HALL).way((5, 3), (8, 3), 0.3)


def test_a_foot_stands_while_it_carries_and_shins_are_as_far_apart_as_in_a_stride():
    walked = np.linspace(0, 3.0, 301)
    people, poses = [Figure("p")] * 301, np.column_stack([walked, 0 * walked, 0 * walked])
    parts = postures(people, poses, walked, np.full(301, 1.2))
    foot, heights = parts[:, PARTS.index("foot_l"), 0, 3], parts[:, PARTS.index("foot_l"), 2, 3]
    carries = heights < heights.min() + 0.02
    slide = np.abs(np.gradient(foot, walked))[carries]
    assert 0.25 < carries.mean() < 0.7
    assert np.median(slide) < 0.12
    shins = parts[:, [PARTS.index("shin_l"), PARTS.index("shin_r")], 0, 3]
    assert 0.25 < np.abs(np.diff(shins, axis=1)).max() < 0.6
    assert parts[:, :, 2, 3].min() > 0.0


def test_whoever_stands_has_the_legs_together():
    parts = postures([Figure("p")], np.zeros((1, 3)), np.array([0.7]), np.zeros(1))[0]
    legs = [parts[PARTS.index(f"shin_{side}"), :3, 3] for side in "lr"]
    assert legs[0][0] == pytest.approx(legs[1][0], abs=1e-9)
    assert legs[0][1] == pytest.approx(-legs[1][1], abs=1e-9)


def test_people_stay_on_the_floor_apart_and_off_the_robot():
    people = crowd(walkers=8, standing=3, queue=2, blockers=1, carts=1)
    assert [a.role for a in people.agents].count("push") == 1
    tracks = np.stack([agent.poses[:, :2] for agent in people.agents])
    assert floor_of(HALL, with_doors=False).clearance_at(tracks).min() > 0.1
    steps = np.hypot(*np.moveaxis(np.diff(tracks, axis=1), -1, 0))
    assert steps.max() <= 2.0 * 1.3 * STEP_S + 1e-9
    apart = np.hypot(*np.moveaxis(tracks[:, None] - tracks[None], -1, 0))
    apart[np.arange(len(apart)), np.arange(len(apart))] = 9
    assert np.quantile(apart.min(axis=(0, 1)), 0.02) > BODY_RADIUS_M
    walkers = [agent.walked_m[-1] for agent in people.agents if agent.role in ("walk", "push")]
    assert np.mean(walkers) > 5.0
    assert all(agent.walked_m[-1] == 0 for agent in people.agents if agent.role in ("stand", "queue", "block"))


def test_people_can_be_put_into_a_scene_and_a_lidar_sees_their_shins():
    people = crowd(walkers=2)
    world = World(HALL.name, (*HALL.solids, *people.solids), (*HALL.bodies, *people.bodies), HALL.rooms)
    scene = Scene(world)
    scene.place(people.posed(3.0))
    x, y, _ = people.agents[0].poses[int(3.0 / STEP_S)]
    bearings = np.linspace(-math.pi, math.pi, 2000)
    rays = np.column_stack([np.cos(bearings), np.sin(bearings), 0 * bearings])
    hits = scene.cast(np.array([x + 1.0, y, 0.3]), rays)
    met = {world.solids[k].body for k in hits.solids if world.solids[k].instance == "person_0"}
    assert met
    assert met <= {"person_0.shin_l", "person_0.shin_r", "person_0.thigh_l", "person_0.thigh_r"}


def test_the_same_seed_gives_the_same_people_and_nobody_is_nobody():
    a, b, c = (crowd(seed, walkers=3) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.agents[0].poses, b.agents[0].poses)
    assert not np.array_equal(a.agents[0].poses, c.agents[0].poses)
    assert crowd(walkers=0).posed(1.0) == {}
