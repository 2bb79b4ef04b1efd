"""Images that a model has looked at -> their segmentations on disk, found again by any run with the same model and image.

A file is named by the sha256 of what its content depends on: the model's file and settings, and the image's bytes. Filters,
calibrations and clocks are none of that, so all of them share it.
"""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wallkit.core.folders import cache_folder
from wallkit.core.segmentation import Segmentation
from wallkit.core.types import CameraImage
from wallkit.segment.onnx_segmenter import OnnxSegmenter
from wallkit.segment.settings import USERS
from wallkit.segment.stored import bytes_from, segmentation_from


class SegmentationCache:
    """A folder of segmentations by one model.

    Args:
        folder: made when it is first written to.
        model: the sha256 of all that says what the model makes of an image. names, roles: of its classes.

    Attributes:
        found, kept: images that were there, and that were added. unusable: files that were damaged or of something else;
            they are replaced. unwritten: files that could not be written.
    """

    def __init__(self, folder: Path, model: str, names: tuple[str, ...], roles: tuple[str, ...]) -> None:
        self._folder, self._model, self._names, self._roles = folder / model[:16], model, names, roles
        self.found = self.kept = self.unusable = self.unwritten = 0

    def find(self, image: CameraImage) -> tuple[Segmentation, float] | None:
        """The segmentation and what it has cost [ms] when it was made; None where it is not known."""
        key = _key_of(image)
        try:
            data = self._path(key).read_bytes()
        except OSError:
            return None
        try:
            segmentation, about = segmentation_from(data, self._names, self._roles)
            if about["image"] != key or about["model"] != self._model:
                raise ValueError("is of something else")
            cost_ms = float(about["cost_ms"])
        except (ValueError, KeyError, TypeError):
            self.unusable += 1
            return None
        self.found += 1
        return segmentation, cost_ms

    def keep(self, image: CameraImage, segmentation: Segmentation, cost_ms: float) -> None:
        """Add a segmentation; where that cannot be done, the next run segments again."""
        key = _key_of(image)
        data = bytes_from(segmentation, {"image": key, "model": self._model, "cost_ms": cost_ms})
        if data is None:
            return
        path = self._path(key)
        working = path.with_suffix(f".{os.getpid()}-{threading.get_ident()}.partial")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            working.write_bytes(data)
            working.replace(path)
        except OSError:
            working.unlink(missing_ok=True)
            self.unwritten += 1
            return
        self.kept += 1

    def lines(self) -> list[str]:
        """What a reader of a run's numbers should know."""
        said = (
            (self.found, "images segmented in an earlier run, whose time is counted (segment.cache)"),
            (self.unusable, "damaged or foreign files in segment.cache, made again"),
            (self.unwritten, "segmentations that could not be written to segment.cache"),
        )
        return [f"{count} {words}" for count, words in said if count]

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}.seg"


def cache_of(segmenter: OnnxSegmenter, folder: str) -> SegmentationCache | None:
    """The cache of a model in the folder that `segment.cache` names; None for ""."""
    if not folder:
        return None
    with segmenter.model.path.open("rb") as file:
        model = hashlib.file_digest(file, "sha256").hexdigest()
    settings = segmenter.settings
    depends = (model, segmenter.layout, segmenter.size, segmenter.names, segmenter.preparation,
               settings.min_score, settings.max_overlap, _engine())  # fmt: skip
    place = cache_folder("segmentations") if folder == USERS else Path(folder)
    return SegmentationCache(place, _digest([repr(depends).encode()]), segmenter.names, segmenter.roles)


def _engine() -> str:
    """Another version may round otherwise."""
    import onnxruntime

    return str(onnxruntime.__version__)


def _key_of(image: CameraImage) -> str:
    words = f"{image.encoding} {image.width} {image.height} {image.step} "
    return _digest([words.encode(), image.data])


def _digest(parts: Sequence[Any]) -> str:
    found = hashlib.sha256()
    for part in parts:
        found.update(part)
    return found.hexdigest()
