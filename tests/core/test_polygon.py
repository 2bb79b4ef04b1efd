"""Four ways of asking whether a point is in a polygon: shapely is the oracle, and they agree with each other."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from wallkit.core.polygon import (
    OUTSIDE,
    POINT_IN_POLYGON,
    crossing_number,
    looked_up,
    mask_from,
    mask_lookup,
    packed,
)

EXACT = ("crossing_number", "winding_number", "even_odd")
SQUARE = [(10.0, 10.0), (30.0, 10.0), (30.0, 30.0), (10.0, 30.0)]
HOLE = [(15.0, 15.0), (25.0, 15.0), (25.0, 25.0), (15.0, 25.0)]


def blob(rng, corners, centre, size):
    """A star-shaped ring: no edge crosses another."""
    angles = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.9, corners)) / corners
    radii = size * rng.uniform(0.5, 1.0, corners)
    return np.asarray(centre) + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def scene(rng, count=20, corners=100, holes=True):
    """Polygons, some of them with a hole, in a picture of 640 x 480, and the same for shapely."""
    found = []
    for i in range(count):
        centre, size = rng.uniform((60, 60), (580, 420)), rng.uniform(20, 120)
        rings = [blob(rng, corners, centre, size)]
        if holes and i % 3 == 0:
            rings.append(blob(rng, corners, centre, 0.4 * size))
        if i % 2:
            rings = [ring[::-1] for ring in rings]
        found.append(rings)
    return found, [shapely.Polygon(rings[0], rings[1:]) for rings in found]


def oracle(points, shapes):
    """The first shape that holds each point, and the distance to the nearest edge of any."""
    at = shapely.points(points)
    inside = np.array([shapely.contains(shape, at) for shape in shapes])
    away = np.min([shapely.distance(shape.boundary, at) for shape in shapes], axis=0)
    return np.where(inside.any(axis=0), inside.argmax(axis=0), OUTSIDE), away


@pytest.mark.parametrize("name", POINT_IN_POLYGON)
def test_a_square_with_a_hole(name):
    found = POINT_IN_POLYGON[name](
        [[12, 20], [20, 20], [5, 20], [28, 28], [np.nan, 20], [40, 20]], packed([[SQUARE, HOLE]])
    )
    assert found.tolist() == [0, OUTSIDE, OUTSIDE, 0, OUTSIDE, OUTSIDE]


@pytest.mark.parametrize("corners", [3, 4, 7, 20, 60, 100, 119])
def test_all_agree_with_shapely_but_on_edges(corners):
    rng = np.random.default_rng(corners)
    polygons, shapes = scene(rng, corners=corners, holes=corners >= 60)
    assert all(shape.is_valid for shape in shapes)
    points = rng.uniform((-20, -20), (660, 500), (2000, 2))
    wanted, away = oracle(points, shapes)
    clear, far = away > 1e-9, away > np.sqrt(0.5)
    assert far.sum() > 1000
    for name in EXACT:
        found = POINT_IN_POLYGON[name](points, packed(polygons))
        np.testing.assert_array_equal(found[clear], wanted[clear], err_msg=name)
    np.testing.assert_array_equal(mask_lookup(points, packed(polygons))[far], wanted[far])


def test_the_mask_is_the_crossing_number_at_pixel_centres():
    polygons = packed(scene(np.random.default_rng(3))[0])
    v, u = np.mgrid[0:480, 0:640]
    centres = np.column_stack([u.ravel(), v.ravel()]).astype(float)
    mask = mask_from(polygons, (480, 640))
    np.testing.assert_array_equal(mask.ravel(), crossing_number(centres, polygons))
    np.testing.assert_array_equal(looked_up(centres + 0.4, mask), mask.ravel())


@pytest.mark.parametrize("name", POINT_IN_POLYGON)
def test_moving_and_turning_everything_changes_nothing(name):
    """Quarter turns and whole shifts keep pixels pixels."""
    rng = np.random.default_rng(5)
    rings = [blob(rng, 30, (50, 40), 30), blob(rng, 30, (50, 40), 10)]
    points = rng.uniform(0, 100, (500, 2))
    moved = [np.column_stack([-ring[:, 1], ring[:, 0]]) + (200, -7) for ring in rings]
    away = np.column_stack([-points[:, 1], points[:, 0]]) + (200, -7)
    before, after = POINT_IN_POLYGON[name](points, packed([rings])), POINT_IN_POLYGON[name](away, packed([moved]))
    assert (before == 0).sum() > 50
    # a point just between two pixels may fall to either
    assert (before != after).sum() <= (2 if name == "mask" else 0)


@pytest.mark.parametrize("name", POINT_IN_POLYGON)
def test_the_first_of_several_polygons_wins_and_nothing_is_no_polygon(name):
    twice = packed([[SQUARE], [(np.array(SQUARE) + 5).tolist()]])
    assert POINT_IN_POLYGON[name]([[20, 20], [33, 33]], twice).tolist() == [0, 1]
    assert POINT_IN_POLYGON[name]([[20, 20]], packed([])).tolist() == [OUTSIDE]
    assert POINT_IN_POLYGON[name]([[20, 20]], packed([[SQUARE[:2]]])).tolist() == [OUTSIDE]
    assert len(POINT_IN_POLYGON[name](np.zeros((0, 2)), twice)) == 0


@pytest.mark.parametrize("name", EXACT)
def test_a_ray_through_corners_counts_them_once(name):
    """Where naive ray casting fails: points level with corners and with horizontal edges."""
    diamond = [(0.0, 0.0), (10.0, -10.0), (20.0, 0.0), (10.0, 10.0)]
    step = [(0.0, 0.0), (10.0, 0.0), (10.0, 5.0), (20.0, 5.0), (20.0, 10.0), (0.0, 10.0)]
    of = POINT_IN_POLYGON[name]
    assert of([[5, 0], [-5, 0], [25, 0]], packed([[diamond]])).tolist() == [0, OUTSIDE, OUTSIDE]
    assert of([[5, 5], [-5, 5], [25, 5], [15, 7], [15, 3]], packed([[step]])).tolist() == [
        0,
        OUTSIDE,
        OUTSIDE,
        0,
        OUTSIDE,
    ]
