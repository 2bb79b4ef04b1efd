"""Frames, before the filter gets them -> which of them it will use for an update: only their images are looked at ahead."""

from __future__ import annotations

import numpy as np

from wallkit.core.geometry import relative
from wallkit.core.types import Float64Array, Frame
from wallkit.localize.settings import LocalizeSettings


class UpdatesAhead:
    """Says as the filter's `predict` whether a frame brings enough motion; frames are to be asked for in their order.

    What it cannot know, an update that the filter makes because a scan contradicts it, is told by `restart`.
    """

    def __init__(self, settings: LocalizeSettings) -> None:
        self._is_each = settings.tracker != "particle_filter"
        self._distance_m, self._turn_rad = settings.update_distance_m, np.deg2rad(settings.update_turn_deg)
        self._last: Float64Array | None = None

    def __call__(self, frame: Frame) -> bool:
        """Whether the frame will be used."""
        if self._last is not None and not self._is_each:
            moved = relative(self._last, frame.odometry)
            if np.hypot(moved[0], moved[1]) < self._distance_m and abs(moved[2]) < self._turn_rad:
                return False
        self._last = frame.odometry
        return True

    def restart(self, odometry: Float64Array) -> None:
        """The filter has made an update of its own here; motion counts from now on."""
        self._last = odometry
