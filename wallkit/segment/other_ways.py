"""Ways in which other programs prepare a picture or read the answer -> the same model run so, to name what differs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.types import BoolArray
from wallkit.segment.agreement import Answer, answer_of_net, image_mask, painted, with_masks
from wallkit.segment.instances import Instances
from wallkit.segment.letterbox import Letterbox, Preparation
from wallkit.segment.onnx_segmenter import OnnxSegmenter

_IMAGENET = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


@dataclass(frozen=True)
class Way:
    """How a picture is prepared, said of the side that does it so."""

    says: str
    prepare: Callable[[Preparation], Preparation]


PREPARATIONS: Mapping[str, Way] = {
    "bgr": Way("takes blue, green, red (BGR) instead of RGB", lambda p: replace(p, is_bgr=not p.is_bgr)),
    "bytes": Way("takes values from 0 to 255 instead of 0 to 1", lambda p: replace(p, scale=1.0)),
    "imagenet": Way(
        "takes values normalised by ImageNet's mean and standard deviation",
        lambda p: replace(p, mean=_IMAGENET[0], std=_IMAGENET[1]),
    ),
    "signed": Way("takes values from -1 to 1", lambda p: replace(p, mean=(0.5, 0.5, 0.5), std=(0.5, 0.5, 0.5))),
    "stretch": Way(
        "takes the picture stretched to its input instead of letterboxed", lambda p: replace(p, fit="stretch")
    ),
}


def run_another_way(segmenter: OnnxSegmenter, way: str) -> OnnxSegmenter:
    """The same model, its pictures prepared another way."""
    return replace(segmenter, preparation=PREPARATIONS[way].prepare(segmenter.preparation))


def cropped_first(found: Instances) -> Answer:
    """What programs say that crop the prototypes' grid to the box before they enlarge it, as Ultralytics did until 2026."""
    found = with_masks(found)
    plain = answer_of_net(found)
    masks = _masks_cropped_first(found)
    things = [replace(one, mask=image_mask(masks[k], found.frame)) for k, one in enumerate(plain.things)]
    return painted(things, found.names, found.roles, found.shape)


def with_one_gain(found: Instances) -> Answer:
    """What programs say that undo the letterbox with one gain for both axes."""
    found = with_masks(found)
    gain = min(outer / side for outer, side in zip(found.frame.net, found.frame.image, strict=True))
    plain = answer_of_net(found)
    edges = found.detections.boxes.reshape(-1, 2, 2).astype(np.float64) - found.frame.corner[::-1]
    height, width = found.frame.image
    boxes = np.clip(edges / gain, 0, (width, height)).reshape(-1, 4)
    return Answer(plain.segmentation, tuple(replace(one, box=boxes[k]) for k, one in enumerate(plain.things)))


def _masks_cropped_first(found: Instances) -> BoolArray:
    """(D, H, W) in the network's input."""
    d, frame = found.detections, found.frame
    _, rows, columns = found.prototypes.shape
    flat = found.prototypes.reshape(len(found.prototypes), -1)
    sums = (d.coefficients @ flat).reshape(-1, rows, columns)
    x, y = np.arange(columns), np.arange(rows)
    small = d.boxes * np.array([columns / frame.net[1], rows / frame.net[0]] * 2, dtype=np.float32)
    across = (x >= small[:, :1]) & (x < small[:, 2:3])
    down = (y >= small[:, 1:2]) & (y < small[:, 3:])
    cut = np.where(down[:, :, None] & across[:, None, :], sums, 0)
    return np.array([_enlarged(one, frame) > 0 for one in cut]).reshape(-1, *frame.net)


def _enlarged(grid: np.ndarray, frame: Letterbox) -> np.ndarray:
    """(H, W) bilinear, its border cells reaching outwards."""
    import cv2

    return np.asarray(cv2.resize(grid.astype(np.float32), frame.net[::-1], interpolation=cv2.INTER_LINEAR))
