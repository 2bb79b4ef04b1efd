"""A purpose -> the folder where programs keep what they can make again, for this user on this system."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder(purpose: str) -> Path:
    """Not made: whoever writes to it does."""
    home = Path.home()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base / "wallkit" / purpose
