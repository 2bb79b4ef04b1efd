"""A Segmentation <-> bytes that hold all its look-ups need, so that it says the same when it is read again."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from wallkit.core.segmentation import Segmentation
from wallkit.core.types import Float32Array
from wallkit.segment.detections import Detections
from wallkit.segment.instances import Instances
from wallkit.segment.letterbox import Letterbox
from wallkit.segment.scores import IdMap, ScoreMap

MAGIC = b"wallkit segmentation 1\n"
# a network's numbers are noise in their low bytes: more effort makes them no smaller
_EFFORT = 1
_DETECTIONS = ("boxes", "scores", "labels", "coefficients")


def bytes_from(segmentation: Segmentation, about: Mapping[str, Any]) -> bytes | None:
    """The file of a segmentation, compressed and with a checksum; None of a kind that cannot be stored.

    Args:
        about: to be read again with it; what JSON can hold.
    """
    arrays: dict[str, Any]
    words: dict[str, Any] = {"about": dict(about)}
    if isinstance(segmentation, ScoreMap):
        arrays, words["is_probability"] = {"scores": segmentation.scores}, segmentation.is_probability
    elif isinstance(segmentation, IdMap):
        arrays = {"ids": segmentation.ids}
    elif isinstance(segmentation, Instances):
        found = segmentation.detections
        arrays = {name: getattr(found, name) for name in _DETECTIONS}
        arrays["prototypes"] = _where_asked(segmentation)
    else:
        return None
    frame = segmentation.frame
    words["frame"] = [frame.image, frame.net, frame.inner, frame.corner]
    words["arrays"] = [[name, array.dtype.str, array.shape] for name, array in arrays.items()]
    head = json.dumps(words).encode()
    body = b"".join(_shuffled(array) for array in arrays.values())
    return MAGIC + zlib.compress(len(head).to_bytes(4, "little") + head + body, _EFFORT)


def segmentation_from(
    data: bytes, names: tuple[str, ...], roles: tuple[str, ...]
) -> tuple[Segmentation, dict[str, Any]]:
    """A segmentation and what was written about it.

    Args:
        names, roles: of the model's classes, see Segmentation.

    Raises:
        ValueError: these are no bytes of `bytes_from`, or damaged ones.
    """
    if not data.startswith(MAGIC):
        raise ValueError(f"begins with {data[:12]!r}")
    try:
        plain = zlib.decompress(memoryview(data)[len(MAGIC) :])
        size = int.from_bytes(plain[:4], "little")
        words = json.loads(plain[4 : 4 + size])
        arrays = _arrays(memoryview(plain)[4 + size :], words["arrays"])
        frame = Letterbox(*(tuple(pair) for pair in words["frame"]))
        return _built(arrays, words, frame, names, roles), words["about"]
    except (zlib.error, KeyError, TypeError) as error:
        raise ValueError(f"is damaged: {error}") from error


def _built(
    arrays: dict[str, Any], words: dict[str, Any], frame: Letterbox, names: tuple[str, ...], roles: tuple[str, ...]
) -> Segmentation:
    if "scores" in arrays and "boxes" not in arrays:
        return ScoreMap(names, roles, frame, arrays["scores"], bool(words["is_probability"]))
    if "ids" in arrays:
        return IdMap(names, roles, frame, arrays["ids"])
    found = Detections(*(arrays[name] for name in _DETECTIONS))
    return Instances(names, roles, frame, found, arrays["prototypes"])


def _where_asked(segmentation: Instances) -> Float32Array:
    """The prototypes, 0 at cells that no thing's box comes near: nobody asks there, and zeros take no room."""
    _, rows, columns = segmentation.prototypes.shape
    cell_v, cell_u = segmentation.frame.net[0] / rows, segmentation.frame.net[1] / columns
    near = np.zeros((rows, columns), dtype=bool)
    for x1, y1, x2, y2 in np.nan_to_num(segmentation.detections.boxes.astype(np.float64), posinf=1e6, neginf=-1e6):
        top, left = (max(int(low // cell) - 2, 0) for low, cell in ((y1, cell_v), (x1, cell_u)))
        bottom, right = (max(int(high // cell) + 3, 0) for high, cell in ((y2, cell_v), (x2, cell_u)))
        near[top:bottom, left:right] = True
    return np.where(near, segmentation.prototypes, np.float32(0))


def _shuffled(array: Any) -> bytes:
    """Its bytes, all first ones first: numbers that are alike differ in their last bytes."""
    flat = np.frombuffer(np.ascontiguousarray(array).tobytes(), np.uint8)
    return flat.reshape(-1, array.dtype.itemsize).T.tobytes()


def _arrays(body: memoryview, listed: list[tuple[str, str, list[int]]]) -> dict[str, Any]:
    found, at = {}, 0
    for name, kind, shape in listed:
        dtype, count = np.dtype(kind), int(np.prod(shape))
        size = count * dtype.itemsize
        planes = np.frombuffer(body[at : at + size], np.uint8).reshape(dtype.itemsize, count)
        # writable and in order, as a network's own: kernels are compiled for those
        found[name] = np.ascontiguousarray(planes.T).view(dtype).reshape(shape)
        at += size
    if at != len(body):
        raise ValueError(f"holds {len(body)} bytes of arrays, {at} are listed")
    return found
