"""A play -> the ceiling over it as a metric picture: the oracle that a log's own ceiling is held against."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wallkit.core.ceiling import CeilingMap
from wallkit.core.geometry import pose_from_matrix
from wallkit.maps.ceiling.files import ceiling_files
from wallkit.pipelines.simulate.play import Play
from wallkit.simulate.looks import Wardrobe

_RESOLUTION_M = 0.01


def true_ceiling(play: Play) -> CeilingMap | None:
    """The ceiling as painted, without the light in the room; None where nothing is overhead.

    The picture that a renderer hangs overhead has its rows along +y, as a CeilingMap has.
    """
    import cv2

    slab = next((solid for solid in play.world.solids if solid.class_name == "ceiling"), None)
    if slab is None:
        return None
    looks = play.scenario.looks
    size = (float(slab.size[0]), float(slab.size[1]))
    surface = Wardrobe(play.world, looks, play.seed if looks.seed < 0 else looks.seed).ceiling(size)
    assert surface.texture is not None
    texture = surface.texture
    height, width = texture.pixels.shape[:2]
    columns, rows = (int(np.ceil(side / _RESOLUTION_M)) for side in size)
    u = (np.arange(columns) + 0.5) * _RESOLUTION_M / texture.size_m[0] * width - 0.5
    v = (np.arange(rows) + 0.5) * _RESOLUTION_M / texture.size_m[1] * height - 0.5
    at_u, at_v = np.meshgrid((u % width).astype(np.float32), (v % height).astype(np.float32))
    pixels = cv2.remap(texture.pixels, at_u, at_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    yaw = pose_from_matrix(slab.T_body_solid)[2]
    c, s = np.cos(yaw), np.sin(yaw)
    corner = slab.T_body_solid[:2, 3] - np.array([[c, -s], [s, c]]) @ (np.array(size) / 2)
    underside = float(slab.T_body_solid[2, 3] - slab.size[2] / 2)
    is_seen = np.ones((rows, columns), dtype=bool)
    return CeilingMap(
        np.asarray(pixels, dtype=np.uint8), is_seen, _RESOLUTION_M, np.array([*corner, yaw]), underside, "simulated"
    )


def write_true_ceiling(folder: Path, play: Play) -> None:
    """ceiling.yaml and ceiling.png of a simulated log."""
    ceiling = true_ceiling(play)
    if ceiling is None:
        return
    note = "the simulated ceiling as it is painted; lamps, people and the camera's exposure are not in it"
    text, png = ceiling_files(ceiling, "ceiling.png", (note,))
    (folder / "ceiling.yaml").write_bytes(text)
    (folder / "ceiling.png").write_bytes(png)
