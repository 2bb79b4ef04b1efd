"""Files and what was typed -> what a result remembers of them: names, digests and versions, and no place of this machine."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PurePath

import wallkit
from wallkit.pipelines.run_folder import sha256


def portable(words: str) -> str:
    """What was typed, if it holds on any machine; of a path from the root or from above only the last part."""
    path = PurePath(words)
    return path.name if path.is_absolute() or ".." in path.parts or words.startswith("~") else words


def digests(files: Iterable[Path]) -> dict[str, str]:
    """sha256 of every file by its name, with its folder's where two have the same; others than files are left out."""
    whole = list(dict.fromkeys(path for path in files if path.is_file()))
    names = [path.name for path in whole]
    return {
        path.name if names.count(path.name) == 1 else f"{path.resolve().parent.name}/{path.name}": sha256(path)
        for path in whole
    }


def versions() -> dict[str, str]:
    """Of what computes a calibration."""
    import cv2
    import numpy as np
    import scipy

    return {
        "wallkit": wallkit.__version__,
        "opencv": str(cv2.__version__),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }
