"""A model's list of classes, from a text, YAML or JSON file or an ONNX's metadata -> label by id.

text  one name a line, the first has id 0
YAML  a list, a table id: name, or either under `names` (a dataset file of Ultralytics)
JSON  likewise
ONNX  the metadata key `names`, as Ultralytics writes it: "{0: 'wall', 1: 'door'}"
"""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wallkit.errors import MapError

Labels = Mapping[int, str]
_LARGEST_TEXT = 1_000_000
_LONGEST_NAME = 100


def read_labels(path: Path) -> Labels:
    """The labels of a model by class id.

    Raises:
        MapError: the file cannot be read, or has no list of classes.
    """
    if path.suffix.lower() == ".onnx":
        return _from_names(_onnx_names(path), path)
    text = _read_text(path)
    suffix = path.suffix.lower()
    if suffix == ".json":
        try:
            return _from_names(json.loads(text), path)
        except ValueError as error:
            raise MapError(f"not valid JSON: {error}", where=path, hint=_HINT) from error
    if suffix in (".yaml", ".yml"):
        return _from_names(_yaml(text, path), path)
    names = [line.strip() for line in text.splitlines()]
    while names and not names[-1]:
        names.pop()
    return _from_names(names, path)


# -------------------------------------------------------------------------------------------- details

_HINT = "a text file with one class a line, YAML or JSON with names, or an ONNX whose metadata has names"


def _read_text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST_TEXT + 1)
    except OSError as error:
        raise MapError(f"cannot read the labels: {error.strerror}", where=path, hint=_HINT) from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MapError("the labels are no text", where=path, hint=_HINT) from error
    if len(data) > _LARGEST_TEXT or "\0" in text:
        raise MapError("the labels are no list of classes", where=path, hint=_HINT)
    return text


def _yaml(text: str, path: Path) -> Any:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark else path
        raise MapError(f"not valid YAML: {getattr(error, 'problem', error)}", where=where, hint=_HINT) from error


def _onnx_names(path: Path) -> Any:
    import onnxruntime

    if not path.is_file():
        raise MapError("cannot read the model: no such file", where=path, hint=_HINT)
    options = onnxruntime.SessionOptions()
    # fatal only: what is wrong is said below, once
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:
        # its exceptions share no base but RuntimeError's
        raise MapError(f"the model cannot be loaded: {str(error).splitlines()[0]}", where=path, hint=_HINT) from error
    metadata = session.get_modelmeta().custom_metadata_map
    if "names" not in metadata:
        listed = ", ".join(sorted(metadata)) or "nothing"
        hint = "give the classes as a text file, one a line"
        raise MapError(f"the model's metadata has no 'names' (it has {listed})", where=path, hint=hint)
    try:
        return ast.literal_eval(metadata["names"])
    except (ValueError, SyntaxError, MemoryError, RecursionError) as error:
        message = f"the model's metadata 'names' is no list or table: {metadata['names'][:60]!r}"
        raise MapError(message, where=path, hint="{0: 'wall', 1: 'door'}") from error


def _from_names(found: Any, path: Path) -> Labels:
    """Labels from a list or table of names, or from what holds one under `names`."""
    if isinstance(found, Mapping) and "names" in found:
        found = found["names"]
    rows = found.items() if isinstance(found, Mapping) else enumerate(found) if isinstance(found, list) else ()
    labels: dict[int, str] = {}
    for key, name in rows:
        number = _id_from(key)
        if number is None or not isinstance(name, str) or not name.strip() or "<" in name or len(name) > _LONGEST_NAME:
            raise MapError(
                f"class {key!r} is {str(name)[:40]!r}; it needs an id from 0 and a name", where=path, hint=_HINT
            )
        labels[number] = name.strip()
    if not labels:
        raise MapError("there are no classes in it", where=path, hint=_HINT)
    return labels


def _id_from(key: Any) -> int | None:
    if isinstance(key, str) and key.isascii() and key.isdecimal():
        key = int(key)
    return key if isinstance(key, int) and not isinstance(key, bool) and key >= 0 else None
