"""A ceiling -> a faded picture of it under a plan, with the walls of the map on top."""

from __future__ import annotations

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.ceiling_eye import smoothed
from wallkit.core.types import OccupancyGrid, UInt8Array
from wallkit.report.walls import WALL_COLOURS, View, draw_walls

# colours of the faded picture: it is a background, and bytes of every page
_COLOURS = 60
# what is left of a colour's distance from white; paths must stand out
_INK = 0.3
_UNKNOWN, _WALL = 0, 2


def draw_ceiling(
    ceiling: CeilingMap, grid: OccupancyGrid | None, view: View, *, pixels: tuple[int, int]
) -> tuple[UInt8Array, list[tuple[int, int, int]]]:
    """The ceiling inside a view as (H, W) indices into the colours beside, row 0 at the top; walls as `draw_walls` has them.

    Where nobody has seen it there is the map alone.

    Args:
        pixels: (W, H) of the picture.
    """
    from PIL import Image

    width, height = pixels
    x = view.left + (np.arange(width) + 0.5) * view.size[0] / width
    y = view.top - (np.arange(height) + 0.5) * view.size[1] / height
    # a pixel of the picture is the mean of what it covers
    evened = smoothed(ceiling, 0.5 * view.size[0] / width)
    cells, is_seen = evened.cells_at(np.stack(np.meshgrid(x, y), axis=-1))
    faded = 255 - _INK * (255.0 - evened.pixels[cells[..., 0], cells[..., 1]])
    few = Image.fromarray(np.where(is_seen[..., None], faded, 255).round().astype(np.uint8)).quantize(
        _COLOURS, dither=Image.Dither.NONE
    )
    palette = np.array(few.getpalette()).reshape(-1, 3).tolist()
    walls = np.full((height, width), _UNKNOWN, np.uint8) if grid is None else draw_walls(grid, view, pixels=pixels)
    over = is_seen & (walls != _WALL)
    indices = np.where(over, np.asarray(few, dtype=np.uint8) + len(WALL_COLOURS), walls).astype(np.uint8)
    return indices, [*WALL_COLOURS, *(tuple(colour) for colour in palette)]
