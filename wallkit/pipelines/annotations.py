"""What a camera saw at an update -> outlines of its masks and the returns on it, kept and rejected, for result.mcap."""

from __future__ import annotations

from wallkit.core.segmentation import BACKGROUND
from wallkit.core.types import LabelledScan
from wallkit.logs.annotations import Drawn
from wallkit.pipelines.sight import Glance
from wallkit.points.overlay_filter import KEPT_RGB, REJECTED_RGB, colour_of

_FILL = 0.25


def annotations_of(glance: Glance, scan: LabelledScan) -> list[Drawn]:
    """Every mask but the background in its class's colour, and the returns that the camera sees."""
    found: list[Drawn] = []
    for polygon in glance.segmentation.polygons():
        role = glance.segmentation.roles[polygon.label]
        if role == BACKGROUND:
            continue
        r, g, b = (c / 255 for c in colour_of(role))
        found += [
            Drawn("loop", ring, (r, g, b, 1.0), (r, g, b, _FILL if i == 0 else 0.0))
            for i, ring in enumerate(polygon.rings)
        ]
    pixels, seen, kept = glance.look.projection.pixels, glance.look.is_seen, scan.weights >= 0.5
    for chosen, rgb in ((seen & kept, KEPT_RGB), (seen & ~kept, REJECTED_RGB)):
        if chosen.any():
            r, g, b = (c / 255 for c in rgb)
            found.append(Drawn("points", pixels[chosen], (r, g, b, 1.0), (r, g, b, 1.0), 5.0))
    return found
