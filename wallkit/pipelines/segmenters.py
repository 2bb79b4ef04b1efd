"""The name of a model -> what segments a run's images: the network in a file, or the masks that a simulator recorded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wallkit.core.segmentation import Segmentation
from wallkit.core.types import CameraImage
from wallkit.logs.images import pixels_from_image
from wallkit.logs.reader import Log
from wallkit.pipelines.cameras import ORACLE_MODEL, ids_from_png, oracle_names
from wallkit.segment.cache import SegmentationCache, cache_of
from wallkit.segment.settings import SegmentSettings

# an image's segmentation; names and roles of the classes in it; where it may be kept
Looks = tuple[Callable[[CameraImage], Segmentation], tuple[str, ...], tuple[str, ...], SegmentationCache | None]


def looks_of(model: str, log: Log, settings: SegmentSettings) -> Looks:
    """What segments.

    Raises:
        ModelError: the file cannot be used. LogError: the log holds no masks.
    """
    return _oracle(log, settings) if model == ORACLE_MODEL else _network(model, settings)


def _oracle(log: Log, settings: SegmentSettings) -> Looks:
    """What a simulator recorded, as a model that is never wrong."""
    from wallkit.pipelines.simulate.camera import NO_CLASS
    from wallkit.segment.class_map import class_map

    names = oracle_names(log)

    def segment(image: CameraImage) -> Segmentation:
        return class_map(ids_from_png(image), names, settings.roles, nothing=NO_CLASS)

    # no cache: the log holds the segmentations already
    return segment, names, settings.roles.of(names), None


def _network(model: str, settings: SegmentSettings) -> Looks:
    from wallkit.segment.onnx_segmenter import load_segmenter

    segmenter = load_segmenter(Path(model), settings)

    def segment(image: CameraImage) -> Segmentation:
        return segmenter.segment(pixels_from_image(image))

    return segment, segmenter.names, segmenter.roles, cache_of(segmenter, settings.cache)
