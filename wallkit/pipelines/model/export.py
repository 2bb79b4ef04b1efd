"""A checkpoint of Ultralytics -> an ONNX file that is what was asked for, with a record of how it was made."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from wallkit.calib.files.store import read_calibration
from wallkit.errors import ModelError
from wallkit.pipelines.model.pictures import Picture
from wallkit.pipelines.model.verify import Verified, VerifyRequest, verify_models
from wallkit.pipelines.outputs import write_whole
from wallkit.segment.child import Interpreter, ask, find_interpreter
from wallkit.segment.inspection import Inspection, inspect_model
from wallkit.segment.model_file import Size
from wallkit.segment.settings import SegmentSettings

Thinning = Literal["raw", "in-graph", "none"]
_STRIDE = 32
# what the exporter is told, and the layout that must come out: versions changed what they do when told nothing
_ARGUMENTS: dict[Thinning, tuple[dict[str, Any], str]] = {
    "raw": ({}, "yolo-anchors"),
    "in-graph": ({"nms": True}, "yolo-rows"),
    "none": ({"nms": False}, "yolo-rows"),
}


@dataclass(frozen=True)
class ExportRequest:
    """What is asked for.

    Attributes:
        size: (height, width) of the input.
        thinning: of overlapping boxes: left to wallkit, inside the file, or not needed (an end-to-end head).
        python, is_trusting: the interpreter with Ultralytics, and whether the checkpoint may run anything.
    """

    checkpoint: Path
    out: Path
    size: Size
    thinning: Thinning = "raw"
    python: Path | None = None
    is_trusting: bool = False


@dataclass(frozen=True, eq=False)
class Exported:
    """What came out; `verified` only where pictures were given."""

    inspection: Inspection
    verified: Verified | None
    record: Path
    versions: dict[str, str]


def export_model(
    request: ExportRequest,
    settings: SegmentSettings,
    pictures: Sequence[Picture] = (),
    *,
    progress: Callable[[int], None] = lambda _: None,
) -> Exported:
    """Export, check that it is what was asked for, compare it with the checkpoint, and write it with its record.

    Raises:
        ModelError: no interpreter, the exporter fails, or it gives another size or layout than asked.
    """
    interpreter = check_request(request)
    arguments, layout = _ARGUMENTS[request.thinning]
    with tempfile.TemporaryDirectory(prefix="wallkit-") as place:
        # the exporter writes beside the checkpoint
        copied = Path(place) / request.checkpoint.name
        shutil.copyfile(request.checkpoint, copied)
        words = {"model": str(copied), "imgsz": list(request.size), "arguments": arguments}
        answer = ask(interpreter, "export", words, Path(place))
        made = Path(answer["file"])
        if not made.is_file():
            raise ModelError("the exporter names a file that is not there", where=made)
        found = inspect_model(made, settings)
        _check_is_asked(found, request, layout)
        data = made.read_bytes()
    write_whole(request.out, data)
    found = inspect_model(request.out, settings)
    versions = {str(key): str(value) for key, value in answer.get("versions", {}).items()}
    record = request.out.with_suffix(".json")
    write_whole(record, _record(found, request, arguments, versions))
    verified = None
    if pictures:
        asked = VerifyRequest(request.out, request.checkpoint, request.python, request.is_trusting)
        verified = verify_models(asked, pictures, settings, progress=progress)
    return Exported(found, verified, record, versions)


def check_request(request: ExportRequest) -> Interpreter:
    """The interpreter that will do it, everything else checked.

    Raises:
        ModelError: no checkpoint, an output that is no .onnx, a size that the exporter would round, or no interpreter.
    """
    if not request.checkpoint.is_file():
        raise ModelError("no such file", where=request.checkpoint, hint="name a checkpoint of Ultralytics, best.pt")
    if request.checkpoint.suffix.lower() not in (".pt", ".pth"):
        raise ModelError("is no checkpoint (.pt)", where=request.checkpoint, hint="an ONNX file needs no export")
    if request.out.suffix.lower() != ".onnx":
        hint = f"--out {request.out.with_suffix('.onnx')}; its record goes into the .json beside it"
        raise ModelError(f"'{request.out.name}' is no name of an ONNX file", where="--out", hint=hint)
    if any(side % _STRIDE for side in request.size):
        nearest = "x".join(str(max(_STRIDE, round(side / _STRIDE) * _STRIDE)) for side in request.size)
        said = f"{request.size[0]}x{request.size[1]} is not in steps of {_STRIDE}: the exporter would round it silently"
        raise ModelError(said, where="--imgsz", hint=f"--imgsz {nearest}")
    return find_interpreter(request.python, is_trusting=request.is_trusting)


def size_for_camera(path: Path, longest: int = 320) -> Size:
    """(height, width) of an input whose longer side is given, with as little grey as a camera's pictures need.

    Raises:
        CalibrationError: the file cannot be read.
    """
    camera = read_calibration(path).camera
    gain = longest / max(camera.height, camera.width)
    height, width = (-(-round(side * gain) // _STRIDE) * _STRIDE for side in (camera.height, camera.width))
    return height, width


# ------------------------------------------------------------------------------------------------ details


def _check_is_asked(found: Inspection, request: ExportRequest, layout: str) -> None:
    segmenter = found.segmenter
    if segmenter.size != request.size:
        said = (
            f"asked for {request.size[0]}x{request.size[1]}, the exporter wrote {segmenter.size[0]}x{segmenter.size[1]}"
        )
        raise ModelError(said, where=request.checkpoint, hint="ask for a multiple of the model's largest stride")
    if segmenter.layout not in (layout, "class-scores", "class-ids"):
        said = f"asked for {layout} (--nms {request.thinning}), the exporter wrote {segmenter.layout}"
        hint = "this version or model does it otherwise: ask for another --nms"
        raise ModelError(said, where=request.checkpoint, hint=hint)


def _record(found: Inspection, request: ExportRequest, arguments: dict[str, Any], versions: dict[str, str]) -> bytes:
    """How the file came to be."""
    segmenter = found.segmenter
    document = {
        "schema": 1,
        "checkpoint": request.checkpoint.name,
        "checkpoint_sha256": hashlib.sha256(request.checkpoint.read_bytes()).hexdigest(),
        "model": request.out.name,
        "model_sha256": found.sha256,
        "layout": segmenter.layout,
        "input_size_px": list(segmenter.size),
        "classes": [name for name in segmenter.names if name != "background"],
        "licence": found.licence,
        "arguments": {"format": "onnx", "imgsz": list(request.size), **arguments},
        "versions": versions,
    }
    return (json.dumps(document, indent=2) + "\n").encode()
