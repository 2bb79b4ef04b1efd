"""Distance fields against brute force, and what free space can see of a wall."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.types import OccupancyGrid
from wallkit.errors import MapError
from wallkit.maps.grids.fields import distance_to, fields_from_grid, visible_surface


def grid_of(drawing, resolution_m=0.1):
    """A grid from rows of '#', '.', '?' with the bottom row last."""
    codes = {"#": 100, ".": 0, "?": -1}
    cells = np.array([[codes[c] for c in row] for row in drawing[::-1]], dtype=np.int8)
    return OccupancyGrid(cells, resolution_m, np.zeros(3), source="drawing")


def test_distance_is_that_of_brute_force():
    rng = np.random.default_rng(0)
    for shape in ((23, 31), (50, 7)):
        surface = rng.random(shape) < 0.03
        surface[3, 4] = True
        rows, columns = np.nonzero(surface)
        y, x = np.mgrid[: shape[0], : shape[1]]
        brute = np.sqrt((y[..., None] - rows) ** 2 + (x[..., None] - columns) ** 2).min(axis=-1) * 0.05
        np.testing.assert_allclose(distance_to(surface, 0.05), brute, atol=1e-5)


def test_a_wall_has_only_the_side_that_is_seen():
    grid = grid_of(["??????", "######", "######", "######", "......", "......"])
    fields = fields_from_grid(grid, wall_depth_m=0.0)
    np.testing.assert_array_equal(fields.distances_m["all"][:, 2] == 0, [False, False, True, False, False, False])
    np.testing.assert_array_equal(fields.is_free[:, 0], [True, True, False, False, False, False])


def test_wall_depth_keeps_the_band_of_an_uncertain_wall():
    grid = grid_of(["######"] * 6 + ["......"])
    deep = fields_from_grid(grid, wall_depth_m=0.25).distances_m["all"][:, 0]
    np.testing.assert_array_equal(deep == 0, [False, True, True, True, False, False, False])


def test_unknown_between_free_and_wall_is_looked_through_but_not_a_wall():
    occupied = np.zeros((1, 12), bool)
    occupied[0, [5, 6, 10]] = True
    free = np.zeros((1, 12), bool)
    free[0, :3] = True
    # 3, 4 unknown: seen through; 6 is hidden by 5; 10 is a wall that no free space is near
    np.testing.assert_array_equal(np.flatnonzero(visible_surface(occupied, free, 0.1)), [5, 10])


@pytest.mark.parametrize(("drawing", "words"), [(["...", "..."], "no occupied"), (["###", "???"], "no free")])
def test_a_map_one_cannot_localize_in_is_refused(drawing, words):
    with pytest.raises(MapError, match=words):
        fields_from_grid(grid_of(drawing))


def test_grey_of_a_scaled_map_is_neither_free_nor_wall():
    cells = np.array([[0, 26, 64, 65, 100, 25]], dtype=np.int8)
    fields = fields_from_grid(OccupancyGrid(cells, 0.1, np.zeros(3)), wall_depth_m=1.0)
    np.testing.assert_array_equal(fields.is_free, [[True, False, False, False, False, True]])
    np.testing.assert_array_equal(fields.distances_m["all"] == 0, [[False, False, False, True, True, False]])
