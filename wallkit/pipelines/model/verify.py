"""Two ways to run a model, and pictures -> whether they agree, what LiDAR points would change, and why."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.errors import ModelError
from wallkit.pipelines.model.pictures import Picture, scattered
from wallkit.pipelines.model.ultralytics import recorded_answers
from wallkit.segment.agreement import Agreement, Answer, agreement, answer_of, answer_of_net
from wallkit.segment.child import Interpreter, find_interpreter
from wallkit.segment.instances import Instances
from wallkit.segment.model_file import Size
from wallkit.segment.onnx_graph import read_graph
from wallkit.segment.onnx_segmenter import OnnxSegmenter, load_segmenter
from wallkit.segment.other_ways import PREPARATIONS, cropped_first, run_another_way, with_one_gain
from wallkit.segment.settings import SegmentSettings

# agreement above which no cause is looked for
GOOD = 0.985
# a way is a cause when it closes so much of the gap
_CLOSES = 0.5
_MOST_FOR_CAUSES = 8
_BOX_PX = 0.25


@dataclass(frozen=True)
class VerifyRequest:
    """What is compared.

    Attributes:
        a: an ONNX file. b: another, or a checkpoint (.pt) that Ultralytics runs in another interpreter.
        python, is_trusting: of that interpreter.
    """

    a: Path
    b: Path
    python: Path | None = None
    is_trusting: bool = False


@dataclass(frozen=True, eq=False)
class Verified:
    """What came out.

    Attributes:
        agreement: of A and B. causes: what explains a difference, in words.
        rectangle: of A and a checkpoint run as its own predict does; None where B is no checkpoint.
        has_lidar: the points are the LiDAR's; else scattered over the pictures.
        names: of the classes that only one side has.
    """

    agreement: Agreement
    causes: tuple[str, ...]
    rectangle: Agreement | None
    has_lidar: bool
    names: tuple[str, ...]


Progress = Callable[[int], None]


def verify_models(
    request: VerifyRequest,
    pictures: Sequence[Picture],
    settings: SegmentSettings,
    *,
    progress: Progress = lambda _: None,
) -> Verified:
    """Run both sides on the pictures and compare.

    Raises:
        ModelError: a side cannot be run.
    """
    a = load_segmenter(request.a, settings)
    if request.b.suffix.lower() in (".pt", ".pth"):
        return _with_checkpoint(a, request, pictures, progress)
    b = load_segmenter(request.b, settings)
    only = tuple(sorted(set(a.names) ^ set(b.names)))
    total = compare(a, b, pictures, progress=progress)
    causes = () if _is_good(total) else tuple(_causes_of_models(a, b, pictures, total))
    return Verified(total, causes, None, _has_lidar(pictures), only)


def compare(
    a: OnnxSegmenter, b: OnnxSegmenter, pictures: Sequence[Picture], *, progress: Progress = lambda _: None
) -> Agreement:
    """Of two ONNX models on pictures."""

    def answers() -> Iterator[tuple[str, Answer, Answer, np.ndarray]]:
        for number, picture in enumerate(pictures, start=1):
            first, second = (answer_of(side.segment(picture.rgb)) for side in (a, b))
            yield picture.name, first, second, _points(picture)
            progress(number)

    return agreement(answers())


# ------------------------------------------------------------------------------------------ a checkpoint


def _with_checkpoint(
    a: OnnxSegmenter, request: VerifyRequest, pictures: Sequence[Picture], progress: Progress
) -> Verified:
    interpreter = find_interpreter(request.python, is_trusting=request.is_trusting)
    with tempfile.TemporaryDirectory(prefix="wallkit-") as place:
        square, names = _theirs(interpreter, request.b, pictures, a, Path(place), is_rectangle=False)
        rectangular, _ = _theirs(interpreter, request.b, pictures, a, Path(place), is_rectangle=True)
    ours = []
    for number, picture in enumerate(pictures, start=1):
        found = a.segment(picture.rgb)
        if not isinstance(found, Instances):
            raise ModelError(
                "is no model of things, as a YOLO checkpoint is", where=request.a, hint="give two ONNX files"
            )
        ours.append(found)
        progress(number)
    total = _between([answer_of_net(found) for found in ours], square, pictures)
    causes = () if _is_exact(total) else tuple(_causes_of_checkpoint(a, ours, square, pictures, total))
    other = _between([answer_of_net(found) for found in ours], rectangular, pictures)
    only = tuple(sorted(set(a.names[:-1]) ^ set(names)))
    return Verified(total, causes, other, _has_lidar(pictures), only)


def _theirs(
    interpreter: Interpreter,
    model: Path,
    pictures: Sequence[Picture],
    a: OnnxSegmenter,
    folder: Path,
    *,
    is_rectangle: bool,
) -> tuple[list[Answer], tuple[str, ...]]:
    return recorded_answers(interpreter, model, [p.rgb for p in pictures], a, folder, is_rectangle=is_rectangle)


def _causes_of_checkpoint(
    a: OnnxSegmenter,
    ours: Sequence[Instances],
    theirs: Sequence[Answer],
    pictures: Sequence[Picture],
    total: Agreement,
) -> Iterator[str]:
    """What the other program does differently with the same weights."""
    few, tried = slice(0, _MOST_FOR_CAUSES), {}
    for name, way in PREPARATIONS.items():
        other = run_another_way(a, name)
        found = [answer_of_net(it) for p in pictures[few] if isinstance(it := other.segment(p.rgb), Instances)]
        tried[f"the checkpoint {way.says}"] = _between(found, theirs[few], pictures[few])
    yield from _best_of(tried, total)
    if _explains(_between([cropped_first(found) for found in ours], theirs, pictures), total):
        yield "the other program crops masks to their boxes before it enlarges them (Ultralytics before May 2026)"
    gain = _between([with_one_gain(found) for found in ours], theirs, pictures)
    if total.matched and np.mean(total.box_px) > _BOX_PX and np.mean(gain.box_px) < np.mean(total.box_px) / 2:
        yield "the other program undoes the letterbox with one gain for both axes"


# ------------------------------------------------------------------------------------------ two ONNX files


def _causes_of_models(
    a: OnnxSegmenter, b: OnnxSegmenter, pictures: Sequence[Picture], total: Agreement
) -> Iterator[str]:
    """What one of them wants otherwise than it is given."""
    few, tried = pictures[:_MOST_FOR_CAUSES], {}
    for name, way in PREPARATIONS.items():
        tried[f"A ({a.model.path.name}) {way.says}"] = compare(run_another_way(a, name), b, few)
        tried[f"B ({b.model.path.name}) {way.says}"] = compare(a, run_another_way(b, name), few)
    yield from _best_of(tried, total)
    quantised = [side.model.path.name for side in (a, b) if read_graph(side.model.path).is_quantised]
    if quantised:
        yield f"{' and '.join(quantised)} counts with 8 bits"
    if a.size != b.size:
        yield f"the inputs differ: A {_words(a.size)}, B {_words(b.size)} px"
    if a.model.metadata.get("version") != b.model.metadata.get("version"):
        versions = [side.model.metadata.get("version", "unknown") for side in (a, b)]
        yield f"they were exported by different versions: A {versions[0]}, B {versions[1]}"


def _best_of(tried: Mapping[str, Agreement], total: Agreement) -> list[str]:
    """The cause that explains most: with two models run wrongly alike little is found, however well it agrees."""
    explaining = {cause: found.matched * found.quality for cause, found in tried.items() if _explains(found, total)}
    return [max(explaining, key=lambda cause: explaining[cause])] if explaining else []


def _explains(tried: Agreement, total: Agreement) -> bool:
    """Whether a way closes most of the gap."""
    gap = 1 - total.quality
    return bool(tried.quality - total.quality > max(_CLOSES * gap, 0.002))


# ------------------------------------------------------------------------------------------------ details


def _between(ours: Sequence[Answer], theirs: Sequence[Answer], pictures: Sequence[Picture]) -> Agreement:
    pairs = zip(pictures, ours, theirs, strict=True)
    return agreement((picture.name, a, b, _points(picture)) for picture, a, b in pairs)


def _points(picture: Picture) -> np.ndarray:
    return scattered(picture.rgb.shape[:2]) if picture.points is None else picture.points


def _has_lidar(pictures: Sequence[Picture]) -> bool:
    return any(picture.points is not None for picture in pictures)


def _is_good(total: Agreement) -> bool:
    return bool(total.quality >= GOOD or np.isnan(total.quality))


def _is_exact(total: Agreement) -> bool:
    """Of the same weights, where every mask and box should be the same."""
    boxes = float(np.mean(total.box_px)) if total.box_px else 0.0
    return bool(np.isnan(total.quality) or (total.quality >= 0.999 and boxes < _BOX_PX))


def _words(size: Size) -> str:
    return f"{size[0]} x {size[1]}"
