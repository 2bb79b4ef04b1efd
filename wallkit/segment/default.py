"""Where the model inside the package is: the one used when `default` is written for a model's file."""

from __future__ import annotations

from pathlib import Path

DEFAULT = "default"
_FILE = Path(__file__).parent / "default.onnx"


def model_path(path: Path) -> Path:
    """The file meant: `default` is the package's, unless there is a file of that name."""
    return _FILE if str(path) == DEFAULT and not path.exists() else path
