"""A camera somewhere in a scene -> its picture, and what each pixel truly shows, for any lens.

What a pixel shows comes by cast rays with the lens's own directions, which needs no OpenGL and is exact; or, faster, from
the renderer, which may differ by a pixel at edges.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array, Int64Array, UInt8Array
from wallkit.simulate.optics import Optics, optics_of
from wallkit.simulate.photo import Photo, developed
from wallkit.simulate.scene import NOTHING, Scene
from wallkit.simulate.studio import Studio
from wallkit.simulate.world import Light

Glass = Literal["surface", "through"]
Masks = Literal["none", "raster", "exact"]


@dataclass(frozen=True, eq=False)
class Unit:
    """A camera on a robot, as it is and as it is said to be.

    Attributes:
        true, T_base_true: what the pictures are made with. published, T_base_published: what the robot believes.
        glass: what a pixel on a pane is labelled as: the pane, or what is seen through it.
    """

    name: str
    frame: str
    true: Camera
    published: Camera
    T_base_true: Float64Array
    T_base_published: Float64Array
    photo: Photo = Photo()
    glass: Glass = "surface"

    @cached_property
    def optics(self) -> Optics:
        """Of the true lens."""
        return optics_of(self.true)

    def developing(self, photo: Photo) -> Unit:
        """The same camera with another exposure, its optics kept: they take longer than a picture."""
        other = replace(self, photo=photo)
        other.__dict__["optics"] = self.optics
        return other


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture and its truth.

    Attributes:
        image: (H, W, 3) RGB; None where only masks were asked for.
        classes: (H, W) place of each pixel's class in the world's `class_names`, -1 where it sees nothing.
        instances: (H, W) place of each pixel's thing in the scene's `instance_names`, -1 where it sees nothing.
    """

    image: UInt8Array | None
    classes: Int64Array
    instances: Int64Array


def photograph(
    rng: np.random.Generator,
    studio: Studio,
    unit: Unit,
    T_map_optical: Sequence[Float64Array],
    place: Callable[[int], None] = lambda _: None,
) -> UInt8Array:
    """(H, W, 3) RGB of a camera at a place, or averaged over several while the shutter is open.

    Args:
        place: puts everything that moves where it is at the k-th of these moments.

    Raises:
        SimulationError: no OpenGL works.
    """
    return developed(rng, unit.photo, exposed(studio, unit, T_map_optical, place))


def exposed(
    studio: Studio,
    unit: Unit,
    T_map_optical: Sequence[Float64Array],
    place: Callable[[int], None] = lambda _: None,
) -> UInt8Array:
    """The same before it is developed: what the lens lets through.

    Raises:
        SimulationError: no OpenGL works.
    """
    import cv2

    optics, total = unit.optics, None
    for k, T in enumerate(T_map_optical):
        place(k)
        sheet = np.concatenate([studio.picture(eye, _turned(T, R)) for eye, R in optics.eyes])
        if optics.columns is not None and optics.rows is not None:
            sheet = cv2.remap(sheet, optics.columns, optics.rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
        if len(T_map_optical) == 1:
            return np.asarray(sheet)
        total = sheet.astype(np.float32) if total is None else total + sheet
    assert total is not None
    return np.asarray(total / len(T_map_optical) + 0.5).astype(np.uint8)


def solids_by_rays(scene: Scene, unit: Unit, T_map_optical: Float64Array, rows: slice = slice(None)) -> Int64Array:
    """(H, W) the solid that each pixel's middle shows, NOTHING for none; or some rows of it: exact, and without OpenGL."""
    sees = unit.optics.sees[rows]
    found = np.full(sees.shape, NOTHING, dtype=np.int64)
    rays = unit.optics.rays[rows][sees] @ T_map_optical[:3, :3].T
    found[sees] = scene.cast(T_map_optical[:3, 3], rays, unseen=_unseen(unit.glass), is_camera=True).solids
    return found


def solids_by_raster(studio: Studio, unit: Unit, T_map_optical: Float64Array) -> Int64Array:
    """(H, W) the solid that each pixel shows as the renderer draws it: fast, and off by a pixel at edges.

    Raises:
        SimulationError: no OpenGL works.
    """
    import cv2

    optics = unit.optics
    sheet = np.concatenate(
        [studio.solids(eye, _turned(T_map_optical, R), unseen=_unseen(unit.glass)) for eye, R in optics.eyes]
    )
    if optics.columns is None or optics.rows is None:
        return sheet
    drawn = cv2.remap(
        (sheet + 1).astype(np.float32), optics.columns, optics.rows, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT
    )
    return np.asarray(drawn).astype(np.int64) - 1


def shot_of(scene: Scene, image: UInt8Array | None, solids: Int64Array) -> Shot:
    """A picture with the classes and things of its pixels' solids (H, W)."""
    return Shot(image, scene.labels(solids, scene.class_ids), scene.labels(solids, scene.instance_ids))


def _turned(T_map_optical: Float64Array, R_optical_eye: Float64Array) -> Float64Array:
    T = T_map_optical.copy()
    T[:3, :3] = T_map_optical[:3, :3] @ R_optical_eye
    return T


def _unseen(glass: Glass) -> tuple[Light, ...]:
    return ("glass",) if glass == "through" else ()
