"""An ONNX file -> what goes in and out of it, what its metadata says, and a session that runs it."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wallkit.errors import ModelError
from wallkit.segment.default import model_path

Size = tuple[int, int]
_LONGEST_NAME = 100


@dataclass(frozen=True)
class Tensor:
    """An input or output: its name, shape (None: any length) and type ("float32", "uint8", ...)."""

    name: str
    shape: tuple[int | None, ...]
    dtype: str

    def __str__(self) -> str:
        return f"{self.name} {shape_words(self.shape)} {self.dtype}"


@dataclass(frozen=True, eq=False)
class ModelFile:
    """An ONNX file, loaded.

    Attributes:
        session: onnxruntime's; None where only the words matter.
        metadata: as written, all of it text.
    """

    path: Path
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    metadata: Mapping[str, str]
    session: Any = None
    producer: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the classes by id; empty where the metadata does not say.

        Raises:
            ModelError: the metadata has names that are no list or table of words.
        """
        if "names" not in self.metadata:
            return ()
        found = self.literal("names")
        table = dict(enumerate(found)) if isinstance(found, list | tuple) else found
        if not isinstance(table, dict) or not table or not all(_is_named(key, name) for key, name in table.items()):
            said = self.metadata["names"][:60]
            hint = "write {0: 'wall', 1: 'door'}"
            raise ModelError(f"the metadata's names are {said!r}", where=self.path, hint=hint)
        return tuple(str(table.get(number, f"class {number}")).strip() for number in range(max(table) + 1))

    def literal(self, key: str) -> Any:
        """A value of the metadata as Python reads it; the text itself where it cannot, None where there is none."""
        text = self.metadata.get(key)
        if text is None:
            return None
        try:
            return ast.literal_eval(text)
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            return text

    @property
    def size(self) -> Size | None:
        """(height, width) of the input; None where neither the graph nor the metadata says."""
        height, width = self.inputs[0].shape[2:]
        if height is not None and width is not None:
            return height, width
        said = self.literal("imgsz")
        sides = [said, said] if isinstance(said, int) else said
        if isinstance(sides, list | tuple) and len(sides) == 2 and all(isinstance(n, int) and n > 0 for n in sides):
            return int(sides[0]), int(sides[1])
        return None


def open_model(path: Path, *, threads: int = 1, spinning: bool = False) -> ModelFile:
    """The model in a file, ready to run on the CPU; `default` is the one inside the package.

    Raises:
        ModelError: it is not there, or onnxruntime cannot load it.
    """
    import onnxruntime

    path = model_path(path)
    if not path.is_file():
        hint = "a checkpoint becomes one with `wallkit model export best.pt`"
        raise ModelError("no such file", where=path, hint=hint)
    if path.suffix.lower() in (".pt", ".pth"):
        raise ModelError("is a checkpoint, not an ONNX file", where=path, hint=f"wallkit model export {path}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spinning else "0")
    # fatal only: what is wrong is said below, once
    options.log_severity_level = 4
    try:
        return _loaded(path, onnxruntime.InferenceSession, options)
    except Exception as error:
        # its exceptions share no base but RuntimeError's, and names of damaged files are no UTF-8
        reason = (str(error).splitlines() or ["no reason given"])[0]
        hint = "is it whole? `sha256sum` it, and export it again with `wallkit model export`"
        raise ModelError(f"onnxruntime cannot load it: {reason}", where=path, hint=hint) from error


def shape_words(shape: tuple[int | None, ...]) -> str:
    """[1, 3, ?, ?]"""
    return "[" + ", ".join("?" if side is None else str(side) for side in shape) + "]"


def _loaded(path: Path, session_class: Any, options: Any) -> ModelFile:
    # its fallback would print on stdout before it fails
    session = session_class(str(path), options, providers=["CPUExecutionProvider"], enable_fallback=0)
    meta = session.get_modelmeta()
    inputs, outputs = (tuple(map(_tensor, given)) for given in (session.get_inputs(), session.get_outputs()))
    return ModelFile(path, inputs, outputs, dict(meta.custom_metadata_map), session, meta.producer_name)


def _tensor(given: Any) -> Tensor:
    shape = tuple(side if isinstance(side, int) else None for side in given.shape)
    dtype = given.type.removeprefix("tensor(").removesuffix(")")
    return Tensor(given.name, shape, {"float": "float32", "double": "float64"}.get(dtype, dtype))


def _is_named(key: Any, name: Any) -> bool:
    is_id = isinstance(key, int) and not isinstance(key, bool) and 0 <= key < 10_000
    return is_id and isinstance(name, str) and 0 < len(name.strip()) <= _LONGEST_NAME
