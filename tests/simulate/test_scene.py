"""MuJoCo scenes of drawn worlds: rays meet what closed forms and an independent 2-D caster say, named by what it is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.maps.random_maps import clean_map
from tests.plan import Plan, cast
from tests.simulate.drawn import door, room, standing
from wallkit.errors import MapError, SimulationError
from wallkit.maps.geometry import slice_at
from wallkit.maps.read import load_map
from wallkit.pipelines.simulate.world import world_from_map
from wallkit.simulate.scene import NOTHING, Scene
from wallkit.simulate.world import Body, Solid, World, upright

BEARINGS = np.linspace(-math.pi, math.pi, 721)
AROUND = np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS), np.zeros_like(BEARINGS)])
NOBODY = np.zeros((0, 3))


def names(scene, hits):
    return [None if k == NOTHING else scene.world.solids[k].instance for k in hits.solids]


def test_ranges_in_a_room_are_the_closed_form_and_walls_have_their_names():
    scene = Scene(room(6, 4))
    hits = scene.cast(np.array([1.0, 1.0, 1.1]), np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.0]]))
    np.testing.assert_allclose(hits.ranges_m, [5, 1, 3, 1], atol=1e-9)
    assert names(scene, hits) == ["wall_e", "wall_w", "wall_n", "wall_s"]
    np.testing.assert_allclose(hits.normals, [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]], atol=1e-9)


def test_every_kind_of_shape_is_met_where_it_is():
    shapes = [
        Solid("ball", "furniture", "sphere", (0.5,), upright(3, 0, 0, 1)),
        Solid("post", "column", "cylinder", (0.25, 2.0), upright(0, 3, 0, 1)),
        Solid("pill", "person", "capsule", (0.2, 1.0), upright(-3, 0, 0, 1)),
        standing("block", (1.0, 2.0, 2.0), 0, -3, math.pi / 2),
    ]
    scene = Scene(World("shapes", tuple(shapes)))
    hits = scene.cast(np.array([0, 0, 1.0]), np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0.0], [0, 0, 1]]))
    np.testing.assert_allclose(hits.ranges_m, [2.5, 2.75, 2.8, 2.5, np.inf], atol=1e-9)
    assert names(scene, hits) == ["ball", "post", "pill", "block", None]
    assert np.isnan(hits.normals[-1]).all()


def test_rays_agree_with_an_independent_caster_on_random_buildings(tmp_path):
    for seed in range(4):
        path = tmp_path / "m.wkmap.urdf"
        path.write_bytes(clean_map(np.random.default_rng(seed)))
        semantic_map = load_map(path)
        world = world_from_map(semantic_map)
        scene, plan = Scene(world), Plan(slice_at(semantic_map, 0.3).segments)
        for r in world.rooms:
            x, y = np.mean(r.floor, axis=0)
            ranges = scene.cast(np.array([x, y, 0.3]), AROUND).ranges_m
            exact = cast(plan, NOBODY, np.array([x, y]), BEARINGS, 100.0)
            off = np.abs(ranges - exact)
            # a ray along an edge may pass it on either side
            assert np.quantile(off, 0.99) < 1e-6


def test_a_door_turns_about_its_hinge():
    leaf, hinge = door("door", 2.0, 2.0, 1.0)
    scene = Scene(room(6, 4, leaf, bodies=(hinge,)))
    ahead = np.array([[0, 1.0, 0]])
    assert names(scene, scene.cast(np.array([2.5, 1, 1.0]), ahead)) == ["door"]
    scene.place(scene.world.poses({"door_hinge": math.pi / 2}))
    hits = scene.cast(np.array([2.5, 1, 1.0]), ahead)
    assert names(scene, hits) == ["wall_n"]
    hits = scene.cast(np.array([1.0, 2.5, 1.0]), np.array([[1.0, 0, 0]]))
    assert names(scene, hits) == ["door"]
    assert hits.ranges_m[0] == pytest.approx(1.0 - 0.02)


def test_a_second_leaf_follows_the_first():
    leaf, hinge = door("a", 2.0, 2.0, 1.0)
    other = Body("b_hinge", "revolute", T_parent_body=upright(4, 2, 0), follows=("a_hinge", -1.0, 0.1))
    world = room(6, 4, leaf, bodies=(hinge, other))
    np.testing.assert_allclose(world.poses({"a_hinge": 0.5})["b_hinge"], upright(4, 2, -0.4), atol=1e-12)
    with pytest.raises(SimulationError, match="nothing that moves is called 'b_hinge'"):
        world.poses({"b_hinge": 0.5})


def test_a_map_keeps_its_names_classes_and_poses(data):
    semantic_map = load_map(data / "maps/wkmap_example/restroom.wkmap.urdf")
    world = world_from_map(semantic_map)
    assert {solid.instance for solid in world.solids} == {k for k, v in semantic_map.links.items() if v.shapes}
    assert [body.name for body in world.bodies] == ["door_m_hinge"]
    assert world.height_m == pytest.approx(2.7)
    states = {"door_m_hinge": 1.1}
    T_map_door = semantic_map.poses(states)["door_m"]
    np.testing.assert_allclose(world.poses(states)["door_m_hinge"], T_map_door, atol=1e-12)
    assert {s.instance: s.light for s in world.solids if s.light != "opaque"} == {
        "window_n": "glass",
        "mirror_1": "mirror",
    }


def test_a_class_that_nobody_knows_is_refused_by_name(tmp_path):
    text = clean_map(np.random.default_rng(0)).replace(b'class="furniture"', b'class="furnature"', 1)
    path = tmp_path / "m.wkmap.urdf"
    path.write_bytes(text.replace(b'class="sink"', b'class="snik"'))
    with pytest.raises(MapError, match=r"the unknown class '(snik|furnature)'"):
        world_from_map(load_map(path))
