"""The [segment] table of wallkit.toml: which model looks at the pictures, how surely, how often, and what its words mean."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.core.config import section, setting
from wallkit.errors import ConfigError
from wallkit.segment.roles import Roles

# what `segment.cache` says for the user's own folder
USERS = "user"


@dataclass(frozen=True)
class SegmentSettings:
    """How a model is run and read."""

    model: str = setting(
        "", 'used when --model is not given: an ONNX file, relative to this file; "default" (also if empty) or "oracle"'
    )
    min_score: float = setting(0.25, "detections of YOLO models that are less sure are not used", low=0, high=1)
    max_overlap: float = setting(
        0.7, "of two detections of a class that overlap more (IoU of boxes), the less sure goes", low=0, high=1
    )
    threads: int = setting(1, "threads of the network", low=1)
    spinning: bool = setting(False, "threads wait busily: faster on idle cores, twice as slow on busy ones")
    rate_hz: float = setting(0.0, "images segmented in a second at most; 0: all", low=0)
    cache: str = setting(
        "",
        'folder where segmentations are kept for later runs, relative to this file; "user": the user\'s; none if empty',
    )
    names: tuple[str, ...] = setting((), "names of the classes, for a model whose metadata has none")
    mean: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "subtracted from R, G, B in [0, 1], for a model whose metadata does not say"
    )
    std: tuple[float, float, float] = setting((1.0, 1.0, 1.0), "what R, G, B are divided by after that")
    roles: Roles = section(Roles, "what your own class names count as, before the common ones; all else is `other`")

    def __post_init__(self) -> None:
        if not all(value > 0 for value in self.std):
            raise ConfigError(f"segment.std is {list(self.std)}, but must be positive")
