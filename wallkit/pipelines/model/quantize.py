"""A float model and pictures -> the same in fewer bits, and what that costs on pictures it was not calibrated with."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.errors import ModelError
from wallkit.pipelines.model.pictures import Picture
from wallkit.pipelines.model.verify import compare
from wallkit.pipelines.outputs import write_whole
from wallkit.segment.agreement import Agreement
from wallkit.segment.onnx_segmenter import OnnxSegmenter, load_segmenter
from wallkit.segment.quantize import Kind, quantise
from wallkit.segment.settings import SegmentSettings

# fewer pictures than this calibrate and judge at once, and the verdict says so
_ENOUGH = 6
_TIMED = 8


@dataclass(frozen=True, eq=False)
class Quantised:
    """What came out.

    Attributes:
        agreement: of the float model and the new one, on pictures not used to calibrate unless `is_judged_by_same`.
        calibrated, judged: pictures. kept_float: nodes.
        bytes_before, bytes_after: of the files. network_ms: CPU of the network before and after, medians.
        is_written: whether it was good enough.
    """

    agreement: Agreement
    calibrated: int
    judged: int
    is_judged_by_same: bool
    kept_float: int
    bytes_before: int
    bytes_after: int
    network_ms: tuple[float, float]
    is_written: bool


def quantise_model(
    path: Path,
    out: Path,
    pictures: Sequence[Picture],
    settings: SegmentSettings,
    *,
    kind: Kind = "int8",
    min_match: float = 0.8,
    progress: Callable[[int], None] = lambda _: None,
) -> Quantised:
    """Quantise, judge, and write the file if at least a share `min_match` of the things is still found.

    Raises:
        ModelError: it cannot be quantised, or nothing is found on the pictures, so that nobody can judge.
    """
    is_same = len(pictures) < _ENOUGH
    calibrating, judging = (pictures, pictures) if is_same else (pictures[::2], pictures[1::2])
    segmenter = load_segmenter(path, settings)
    with tempfile.TemporaryDirectory(prefix="wallkit-") as place:
        made = Path(place) / out.name
        kept = quantise(segmenter, [p.rgb for p in calibrating], made, kind=kind, work=Path(place))
        smaller = load_segmenter(made, settings)
        agreement = compare(segmenter, smaller, judging, progress=progress)
        times = _network_ms(segmenter, judging), _network_ms(smaller, judging)
        data = made.read_bytes()
    if not agreement.of_a:
        hint = "give pictures of what it is for"
        raise ModelError("the model finds nothing on these pictures, so nobody can judge", where=path, hint=hint)
    is_good = agreement.share >= min_match
    if is_good:
        write_whole(out, data)
    sizes = segmenter.model.path.stat().st_size, len(data)
    return Quantised(agreement, len(calibrating), len(judging), is_same, kept, *sizes, times, is_good)


def check_model(path: Path, settings: SegmentSettings) -> None:
    """Refuse what cannot be quantised before pictures are read.

    Raises:
        ModelError: it cannot be loaded, or is no segmentation model.
    """
    load_segmenter(path, settings)


def _network_ms(segmenter: OnnxSegmenter, pictures: Sequence[Picture]) -> float:
    """Median CPU time of the network."""
    spent = []
    for k in range(_TIMED):
        rgb = pictures[k % len(pictures)].rgb
        blob = segmenter.prepared(rgb, segmenter.frame(rgb))
        began = time.process_time()
        segmenter.answers(blob)
        spent.append(time.process_time() - began)
    return float(np.median(spent[1:])) * 1e3
