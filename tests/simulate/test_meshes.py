"""Meshes in the place of boxes: a drawn tetrahedron lies in its box as its file's axes say, for rays, pixels and ways."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulate.drawn import room, standing
from tests.simulate.test_camera import near_edges, studio, turned, unit
from wallkit.errors import ConfigError, SimulationError
from wallkit.simulate.camera import shot_of, solids_by_raster, solids_by_rays
from wallkit.simulate.floor import floor_of
from wallkit.simulate.meshes import MeshFor, bounds_of, corners_of
from wallkit.simulate.scenario import Extra, Scenario, read_scenario
from wallkit.simulate.scene import NOTHING, Scene
from wallkit.simulate.stage import staged
from wallkit.simulate.world import upright

# in centimetres, y up, looking along z, its right angle at the back, left and low; off its own origin, and
# its triangles inside out, as some files have them
TETRAHEDRON = """
v 10 5 -3
v -20 5 -3
v 10 55 -3
v 10 5 17
f 1 2 4
f 1 3 2
f 1 4 3
f 2 3 4
"""
SINK = standing("sink_1", (0.4, 0.6, 0.8), 3.0, 2.0, math.pi / 2, class_name="sink")


@pytest.fixture
def obj(tmp_path):
    path = tmp_path / "own" / "sink.obj"
    path.parent.mkdir()
    path.write_text(TETRAHEDRON)
    return path


@pytest.fixture
def world(obj):
    """A room with a sink that looks along +y; and a box of the map that stays one."""
    meshes = (MeshFor("sink", str(obj), up="y", front="z"),)
    return staged(room(6, 4, SINK, standing("cupboard", (0.5, 1.0, 1.1), 5.0, 3.0)), Scenario(meshes=meshes))


def test_a_mesh_fills_its_box(obj, world):
    np.testing.assert_allclose(bounds_of(obj), [[-20, 5, -3], [10, 55, 17]], atol=1e-5)
    (sink,) = (solid for solid in world.solids if solid.instance == "sink_1")
    got = (corners_of(sink) @ sink.T_body_solid.T)[:, :3]
    wanted = (corners_of(SINK) @ SINK.T_body_solid.T)[:, :3]
    np.testing.assert_allclose(np.ptp(got, axis=0), np.ptp(wanted, axis=0), atol=1e-6)
    np.testing.assert_allclose(got.mean(axis=0), wanted.mean(axis=0), atol=1e-6)


def test_rays_meet_the_tetrahedron_where_its_plane_is(world):
    """x / 0.4 + (right of its left side) / 0.6 + z / 0.8 = 1 in the sink's own frame: any flipped axis fails."""
    scene = Scene(world)
    rng = np.random.default_rng(0)
    met = 0
    for right, up in rng.uniform((0.02, 0.02), (0.58, 0.78), size=(60, 2)):
        forward = 0.4 * (1 - right / 0.6 - up / 0.8)
        # it looks along +y, so that its right is along +x; its back is at y = 1.8, its left side at x = 2.7
        hits = scene.cast(np.array([2.7 + right, 3.5, up]), np.array([[0, -1.0, 0]]))
        if forward > 0:
            assert world.solids[hits.solids[0]].instance == "sink_1"
            assert hits.ranges_m[0] == pytest.approx(3.5 - 1.8 - forward, abs=1e-6)
            met += 1
        else:
            assert world.solids[hits.solids[0]].instance == "wall_s"
    assert 15 < met < 45


def test_pixels_on_it_have_its_class_by_rays_and_by_the_renderer(gl, world):
    scene, T = Scene(world), turned(0.05, -0.3)
    exact = solids_by_rays(scene, unit(), T)
    shot = shot_of(scene, None, exact)
    number = world.class_names.index("sink")
    assert (shot.classes == number).sum() > 100
    # half of the box around it is air
    boxed = solids_by_rays(Scene(staged(room(6, 4, SINK), Scenario())), unit(), T)
    assert (shot.classes == number).sum() < 0.7 * (boxed == 4).sum()
    with studio(world) as stage:
        drawn = solids_by_raster(stage, unit(), T)
    off = exact != drawn
    assert not (off & ~near_edges(exact) & ~near_edges(drawn)).any()
    assert (drawn != NOTHING).all()


def test_a_way_goes_round_it(world):
    boxes = staged(room(6, 4, SINK, standing("cupboard", (0.5, 1.0, 1.1), 5.0, 3.0)), Scenario())
    points = np.array([[3.0, 2.0], [2.0, 2.0], [3.0, 3.0]])
    np.testing.assert_allclose(floor_of(world).clearance_at(points), floor_of(boxes).clearance_at(points), atol=0.02)


def test_one_thing_by_name_comes_before_its_class_and_what_was_added_has_meshes_too(obj, tmp_path):
    other = tmp_path / "other.obj"
    other.write_text(TETRAHEDRON)
    second = replace(SINK, instance="sink_2", T_body_solid=upright(1, 1, 0, 0.4))
    meshes = (MeshFor("sink_2", str(other)), MeshFor("sink", str(obj)), MeshFor("chair", str(obj)))
    scenario = Scenario(meshes=meshes, extra=(Extra("chair", "furniture", (0.5, 0.5, 0.9), (5, 1, 0)),))
    world = staged(room(6, 4, SINK, second), scenario)
    files = {solid.instance: solid.mesh for solid in world.solids if solid.kind == "mesh"}
    assert files == {"sink_1": obj, "sink_2": other, "chair": obj}
    with pytest.raises(SimulationError, match=r"\[\[meshes\]\] names 'snik', which is no class or thing"):
        staged(room(6, 4, SINK), Scenario(meshes=(MeshFor("snik", str(obj)),)))


def test_a_scenario_finds_meshes_from_where_it_is(obj):
    path = obj.parent.parent / "story.toml"
    path.write_text('[[meshes]]\nof = "sink"\nfile = "own/sink.obj"\nup = "y"\nfront = "z"\n')
    assert read_scenario(path).meshes == (MeshFor("sink", str(obj), up="y", front="z"),)


@pytest.mark.parametrize(
    ("content", "words", "said"),
    [
        (None, "", "no such file"),
        ("this is no mesh", "", "no mesh that can be used"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n", "", "flat"),
        (TETRAHEDRON, 'up = "-x"', "up is '-x' and front is 'x'"),
    ],
)
def test_a_mesh_that_cannot_be_used_is_named_with_its_scenario(content, words, said, tmp_path):
    if content is not None:
        (tmp_path / "bad.obj").write_text(content)
    path = tmp_path / "story.toml"
    path.write_text(f'title = "x"\n\n[[meshes]]\nof = "sink"\nfile = "bad.obj"\n{words}\n')
    with pytest.raises(ConfigError) as raised:
        read_scenario(path)
    assert f"{path}:5: [[meshes]] of 'sink' has file = 'bad.obj'" in str(raised.value)
    assert said in str(raised.value)
