from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.localize.ceilings import painted
from tests.report.worlds import run
from wallkit.core.types import OccupancyGrid
from wallkit.report import canvas
from wallkit.report.overhead import draw_ceiling
from wallkit.report.plan import map_figure
from wallkit.report.walls import WALL_COLOURS, View

VIEW = View(-2.0, 1.0, 8.0, 9.0)


def colours(ceiling, grid):
    """(H, W, 3) as a reader sees them, a pixel of 2 cm."""
    indices, palette = draw_ceiling(ceiling, grid, VIEW, pixels=(500, 400))
    assert len(palette) <= 64
    return np.array(palette)[indices].astype(int)


def at(x, y):
    return round((9.0 - y) * 50), round((x + 2.0) * 50)


def test_the_ceiling_lies_faded_where_the_map_has_it_and_walls_on_top():
    """Its corners by place, also when its origin is turned; a mirrored or upside-down picture fails here."""
    cells = np.full((160, 200), -1, np.int8)
    cells[:, 100] = 100
    grid = OccupancyGrid(cells, 0.05, np.array([-2.0, 1.0, 0.0]))
    for origin in ((-1.0, 2.0, 0.0), (3.0, 1.5, 0.6)):
        ceiling = painted(origin=origin, size_m=(4.0, 3.0))
        ceiling.pixels[:] = (0, 0, 255)
        ceiling.pixels[-60:, :60] = (255, 0, 0)
        ceiling.is_seen[:40, -40:] = False
        shown = colours(ceiling, grid)
        inward = ceiling.corners * 0.93 + ceiling.corners.mean(axis=0) * 0.07
        blue, red = (178, 178, 255), (255, 178, 178)
        for corner, expected in zip(inward, (blue, WALL_COLOURS[0], blue, red), strict=True):
            assert np.abs(shown[at(*corner)] - expected).max() < 12, (origin, corner)
        assert tuple(shown[at(3.02, 2.5)]) == WALL_COLOURS[2]
        assert tuple(shown[at(-1.9, 8.9)]) == WALL_COLOURS[0]


def test_without_a_map_the_ceiling_is_all_there_is():
    shown = colours(painted(), None)
    assert tuple(shown[at(-1.9, 1.1)]) == WALL_COLOURS[0]
    assert shown[at(2.0, 4.0)].min() > 175


def test_the_page_says_what_lies_behind_the_path():
    data = replace(run(), ceiling=painted())
    with canvas.style():
        picture, plain = map_figure(data), map_figure(run())
    assert picture is not None
    assert plain is not None
    assert "faded, is the ceiling" in picture.caption
    assert "ceiling" in picture.alt
    assert "ceiling" not in plain.caption + plain.alt
    assert len(plain.svg) < len(picture.svg) < 300_000
