from __future__ import annotations

from io import BytesIO

import numpy as np

from tests.localize.ceilings import painted
from wallkit.core.types import OccupancyGrid, Trajectory
from wallkit.report.animate import animation, ground_of_ceiling, ground_of_grid
from wallkit.report.data import Snapshot

STAMPS = np.array([0, 10**9, 2 * 10**9])
PATH = Trajectory(STAMPS, np.array([[0.0, 3, 0], [1, 4, 0.5], [2, 5, 1]]))


def test_places_are_where_the_picture_shows_them():
    """A red corner of the ceiling is where the animation's ground says that place is; also when the origin is turned."""
    for origin in ((-1.0, 2.0, 0.0), (3.0, 1.0, 0.8)):
        ceiling = painted(origin=origin)
        ceiling.pixels[:] = 0
        ceiling.pixels[-40:, :40] = (255, 0, 0)
        corner = ceiling.corners[3] * 0.97 + ceiling.corners.mean(axis=0) * 0.03
        ground = ground_of_ceiling(ceiling)
        column, row, _ = ground.place(np.array([[*corner, 0.0]]))[0]
        red, green, _ = ground.pixels[int(row), int(column)].tolist()
        assert red > green + 80


def test_a_gif_has_a_picture_for_every_moment_with_its_particles():
    from PIL import Image

    grid = OccupancyGrid(np.zeros((120, 160), np.int8), 0.05, np.array([-1.0, 2.0, 0.0]))
    shots = [Snapshot(int(s), np.tile([5.0, 3.0, 0.0], (50, 1)), np.full(50, 0.02), f"update {s}") for s in STAMPS]
    data = animation(ground_of_grid(grid), shots, PATH, PATH)
    image = Image.open(BytesIO(data))
    assert (image.format, image.n_frames) == ("GIF", 3)
    image.seek(1)
    pixels = np.asarray(image.convert("RGB")).astype(int)
    column, row, _ = ground_of_grid(grid).place(np.array([[5.0, 3.0, 0.0]]))[0].astype(int)
    assert pixels[row, column].sum() < 60
    assert pixels[row, column + 40].sum() > 700
