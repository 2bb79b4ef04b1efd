"""Surfaces: metric, seamless where they repeat, different where they must not, cut where rooms meet."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.simulate.ceiling import ceiling_picture, lamps_of
from wallkit.simulate.decals import DECALS, picture
from wallkit.simulate.panels import floor_triangles, panels_of
from wallkit.simulate.textures import TEXTURES, colour
from wallkit.simulate.world import Room, Solid, World, upright


def made(name, seed=0):
    rng = np.random.default_rng(seed)
    return TEXTURES[name](rng, colour(rng, 0.3, 0.2, 0.8))


# painted for the height of a wall, or with the grain of one leaf: they do not repeat upwards
@pytest.mark.parametrize("name", [n for n in TEXTURES if n != "wainscot"])
def test_a_texture_repeats_without_a_seam(name):
    """The step over the seam is no larger than the largest steps inside."""
    pixels = made(name).pixels.astype(float).mean(axis=2)
    for axis in (0, 1):
        inside = np.abs(np.diff(pixels, axis=axis)).mean(axis=1 - axis)
        seam = np.abs(np.take(pixels, 0, axis) - np.take(pixels, -1, axis)).mean()
        assert seam <= 1.5 * inside.max() + 2


@pytest.mark.parametrize("name", TEXTURES)
def test_a_texture_follows_from_its_seed_and_no_two_seeds_agree(name):
    np.testing.assert_array_equal(made(name).pixels, made(name).pixels)
    a, b = made(name, 1).pixels, made(name, 2).pixels
    assert a.shape != b.shape or (a != b).any()


def test_tiles_have_their_size_in_metres():
    """The lines of grout come back after one of the sides that tiles are sold in."""
    for seed in range(5):
        texture = made("tiles", seed)
        rows = texture.pixels.astype(float).mean(axis=(1, 2))
        power = np.abs(np.fft.rfft(rows - rows.mean()))
        across = np.fft.rfftfreq(len(rows), texture.size_m[1] / len(rows))
        power[across < 1 / 0.31] = 0
        pitch = 1 / across[int(np.argmax(power))]
        sides = np.array([0.05, 0.075, 0.10, 0.15, 0.20, 0.30])
        # or a harmonic of it
        assert np.abs(sides[:, None] / np.arange(1, 5) / pitch - 1).min() < 0.02


@pytest.mark.parametrize("name", DECALS)
@pytest.mark.parametrize("size_m", [(0.02, 0.5), (0.4, 0.4), (3.0, 0.3)])
def test_every_face_can_be_painted_at_any_size(name, size_m):
    texture = picture(np.random.default_rng(0), name, size_m, (0.8, 0.8, 0.8))
    assert texture.size_m == size_m
    assert texture.pixels.dtype == np.uint8


def test_no_two_places_of_a_unique_ceiling_look_the_same():
    rng = np.random.default_rng(0)
    size = (9.6, 6.0)
    lamps = lamps_of(rng, size)
    lit = np.column_stack([lamps, np.ones(len(lamps))])
    image = ceiling_picture(rng, size, lit, px_per_m=40).pixels.astype(float).mean(axis=2)
    patches = [image[y : y + 64, x : x + 64] for y in range(0, 170, 24) for x in range(0, 310, 24)]
    flat = np.array([(p - p.mean()).ravel() / p.std() for p in patches])
    likeness = flat @ flat.T / flat.shape[1]
    assert likeness[~np.eye(len(flat), dtype=bool)].max() < 0.9
    # while the panels of the repeating one are
    grid = np.tile(made("ceiling_grid").pixels, (2, 2, 1))
    np.testing.assert_array_equal(grid[:480, :480], grid[480:, 480:])


def test_a_wall_that_passes_two_rooms_is_cut_where_they_meet():
    wall = Solid("wall_long", "wall", "box", (6.0, 0.1, 2.5), upright(3.0, -0.05, 0.0, 1.25))
    rooms = (
        Room("west", "office", ((0, 0), (2, 0), (2, 3), (0, 3))),
        Room("east", "restroom", ((2.1, 0), (6, 0), (6, 3), (2.1, 3))),
    )
    left = [p for p in panels_of(World("w", (wall,), rooms=rooms), 0) if p.side == "left"]
    by_room = {p.room: p for p in left if p.room}
    assert by_room["west"].size_m[0] == pytest.approx(2.0, abs=0.06)
    assert by_room["east"].size_m[0] == pytest.approx(3.9, abs=0.06)
    assert sum(p.size_m[0] for p in left) == pytest.approx(6.0)
    # seen from the rooms, north of it, the wall runs from the right (west) to the left: its texture too, from the floor on
    vertices, triangles, uvs = by_room["west"].grid((1.0, 2.0))
    np.testing.assert_allclose(uvs[:, 0] - uvs[0, 0], -(vertices[:, 0] - vertices[0, 0]))
    np.testing.assert_allclose(uvs[:, 1], 1 - vertices[:, 2] / 2)
    a, b, c = vertices[triangles[0]]
    assert np.cross(b - a, c - a)[1] > 0


def test_all_faces_of_a_box_look_outwards_and_cover_it():
    world = World("b", (Solid("bin", "trash", "box", (0.3, 0.5, 0.7), upright(1, 2, 0.7, 0.35)),))
    area = 0.0
    for panel in panels_of(world, 0):
        vertices, triangles, _ = panel.grid(None)
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        area += np.linalg.norm(normals, axis=1).sum() / 2
        assert (np.sum(normals * ((a + b + c) / 3 - (1, 2, 0.35)), axis=1) > 0).all()
    assert area == pytest.approx(2 * (0.3 * 0.5 + 0.3 * 0.7 + 0.5 * 0.7))


def test_the_floor_of_a_room_with_a_corner_cut_out_is_covered_once():
    bent = Room("bent", "office", ((0, 0), (4, 0), (4, 1.3), (1.7, 1.3), (1.7, 3), (0, 3)))
    corners, triangles = floor_triangles(bent)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(4 * 1.3 + 1.7 * 1.7)
