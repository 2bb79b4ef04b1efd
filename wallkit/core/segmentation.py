"""What a camera's picture shows: a class and how sure it is at any pixel, masks, and polygons; whoever found it out.

A model's own words ("Wall-tile", "windowpane") become roles ("wall", "glass") by a table of the user's; masks and polygons
are asked for by role. Pixel (0, 0) is the centre of the top-left pixel of the camera's image; (u, v) = (right, down).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol

from numpy.typing import ArrayLike

from wallkit.core.types import BoolArray, Float32Array, Float64Array, Int64Array, UInt8Array

# the class, and role, of what a model sees and has no name for
BACKGROUND = "background"


@dataclass(frozen=True, eq=False)
class Polygon:
    """One connected part of what is of one class.

    Attributes:
        label: place of its class in the segmentation's `names`.
        confidence: in [0, 1], mean over the part's pixels.
        rings: (P, 2) float64 pixels each, the outline first, then its holes; all run through the centres of the part's own
            pixels, also around a hole, and none repeats its first point.
    """

    label: int
    confidence: float
    rings: tuple[Float64Array, ...]


class Segmentation(Protocol):
    """One picture, segmented."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the classes, as the model calls them; the last may be BACKGROUND."""
        ...

    @property
    def roles(self) -> tuple[str, ...]:
        """What each class counts as ("wall", "door", "person", ...), in the order of `names`; several may share one."""
        ...

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of the camera's image."""
        ...

    def classes_at(self, pixels: ArrayLike) -> tuple[Int64Array, Float32Array]:
        """Class and confidence at pixels (K, 2), without making a mask.

        Returns:
            (K,) int64 place in `names`, -1 beside the image, where a pixel is NaN, and where nobody can tell; and
            (K,) float32 in [0, 1], 0 where the class is -1.
        """
        ...

    def labels(self) -> Int64Array:
        """(H, W) int64, `classes_at` of every pixel of the image."""
        ...

    def mask(self, roles: Collection[str]) -> BoolArray:
        """(H, W) whether a pixel's class counts as one of these."""
        ...

    def polygons(self, roles: Collection[str] | None = None) -> list[Polygon]:
        """The parts of every class that counts as one of these (None: all but the background), largest first."""
        ...


class Segmenter(Protocol):
    """A model that looks at pictures; `names` and `roles` as in Segmentation."""

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def roles(self) -> tuple[str, ...]: ...

    def segment(self, rgb: UInt8Array) -> Segmentation:
        """What a picture (H, W, 3) RGB or (H, W) grey shows."""
        ...
