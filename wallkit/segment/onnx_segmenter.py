"""An ONNX model and its settings -> a Segmenter: prepare the picture, run the network, read the answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.segmentation import Segmentation
from wallkit.core.types import UInt8Array
from wallkit.errors import ModelError
from wallkit.segment.layouts import LAYOUTS, Outputs, View, class_names, layout_of
from wallkit.segment.letterbox import Letterbox, Preparation, input_from_image, letterbox
from wallkit.segment.model_file import ModelFile, Size, open_model
from wallkit.segment.settings import SegmentSettings

# coarsest grid of YOLO's heads
_STRIDE = 32


@dataclass(frozen=True, eq=False)
class OnnxSegmenter:
    """A Segmenter.

    Attributes:
        layout: its name in LAYOUTS. outputs: what that reads.
        names, roles: with the background where the model finds things.
        size: (height, width) of the input.
        preparation: of the picture.
    """

    model: ModelFile
    settings: SegmentSettings
    layout: str
    outputs: Outputs
    names: tuple[str, ...]
    roles: tuple[str, ...]
    size: Size
    preparation: Preparation = Preparation()

    def segment(self, rgb: UInt8Array) -> Segmentation:
        """See Segmenter.

        Raises:
            ModelError: the network fails, or answers with NaN.
        """
        frame = self.frame(rgb)
        return self.read(self.answers(self.prepared(rgb, frame)), frame)

    def frame(self, rgb: UInt8Array) -> Letterbox:
        """Where a picture lies in the input."""
        return letterbox((rgb.shape[0], rgb.shape[1]), self.size, self.preparation.fit)

    def prepared(self, rgb: UInt8Array, frame: Letterbox) -> Any:
        """(1, 3, H, W) input, of the network's type."""
        blob = input_from_image(rgb, frame, self.preparation)
        return blob.astype(np.float16) if self.model.inputs[0].dtype == "float16" else blob

    def answers(self, blob: Any) -> list[Any]:
        """The arrays that the layout reads.

        Raises:
            ModelError: the network fails.
        """
        names = [tensor.name for tensor in self.outputs.tensors]
        try:
            found = self.model.session.run(names, {self.model.inputs[0].name: blob})
        except Exception as error:
            # onnxruntime's exceptions share no base but RuntimeError's
            said = f"the network fails on a picture of {blob.shape[3]} x {blob.shape[2]}: {str(error).splitlines()[0]}"
            raise ModelError(said, where=self.model.path, hint="export it for another size") from error
        return [array.astype(np.float32) if array.dtype == np.float16 else array for array in found]

    def read(self, arrays: Sequence[Any], frame: Letterbox) -> Segmentation:
        """The network's answer as a Segmentation.

        Raises:
            ModelError: it is NaN, or of another shape than the file says.
        """
        if any(np.issubdtype(array.dtype, np.floating) and np.isnan(array.max()) for array in arrays):
            hint = "a quantised or half-precision model may overflow: try the original"
            raise ModelError("the network answers with NaN", where=self.model.path, hint=hint)
        for array, tensor in zip(arrays, self.outputs.tensors, strict=True):
            if array.ndim != len(tensor.shape) or array.shape[0] != 1:
                said = f"the network answers with {tensor.name} {list(array.shape)}, one picture was given"
                raise ModelError(said, where=self.model.path, hint="export it with batch 1")
        limits = self.settings.min_score, self.settings.max_overlap
        return LAYOUTS[self.layout].read(arrays, View(self.names, self.roles, frame, self.outputs, *limits))


def load_segmenter(path: Path, settings: SegmentSettings | None = None, *, size: Size | None = None) -> OnnxSegmenter:
    """The model in a file, with the layout that its shapes tell.

    Args:
        size: (height, width) of the input, for a model that leaves it open; None takes the metadata's.

    Raises:
        ModelError: it cannot be loaded, is no segmentation model, or its names do not fit.
    """
    settings = settings or SegmentSettings()
    model = open_model(path, threads=settings.threads, spinning=settings.spinning)
    layout, outputs = layout_of(model)
    names = class_names(model, layout, outputs, settings.names)
    return OnnxSegmenter(
        model,
        settings,
        layout,
        outputs,
        names,
        settings.roles.of(names),
        _size(model, size),
        Preparation(_three(model, "mean", settings.mean), _three(model, "std", settings.std)),
    )


def check_has_role(segmenter: OnnxSegmenter, *roles: str) -> None:
    """Refuse a model that has no class of a role.

    Raises:
        ModelError: with the classes that it has.
    """
    for role in roles:
        if role not in segmenter.roles:
            listed = ", ".join(segmenter.names[:12]) + (", ..." if len(segmenter.names) > 12 else "")
            hint = f'if one of these is a {role}, say so: --set segment.roles.{role}=["NAME"]'
            raise ModelError(f"no class counts as '{role}' (classes: {listed})", where=segmenter.model.path, hint=hint)


def _size(model: ModelFile, wanted: Size | None) -> Size:
    fixed = model.inputs[0].shape[2:]
    if wanted is not None:
        if any(side not in (None, asked) for side, asked in zip(fixed, wanted, strict=True)):
            said = f"its input is {fixed[0]} x {fixed[1]}, not {wanted[0]} x {wanted[1]}"
            raise ModelError(said, where=model.path, hint="export it for that size, or with dynamic=True")
        return tuple(-(-side // _STRIDE) * _STRIDE for side in wanted)  # type: ignore[return-value]
    if model.size is None:
        hint = "export it for a fixed size, or with imgsz in the metadata"
        raise ModelError("neither the graph nor the metadata says how large its input is", where=model.path, hint=hint)
    return model.size


def _three(model: ModelFile, key: str, otherwise: tuple[float, float, float]) -> tuple[float, float, float]:
    """Three numbers of the metadata."""
    said = model.literal(key)
    if isinstance(said, list | tuple) and len(said) == 3 and all(isinstance(v, int | float) for v in said):
        return float(said[0]), float(said[1]), float(said[2])
    return otherwise
