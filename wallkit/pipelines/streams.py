"""The rows of a run -> lines of text for a pipe."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator

from wallkit.core.steps import Steps, csv_from_steps
from wallkit.core.types import Health
from wallkit.evaluate.tum import tum_from_trajectory


def tum_lines(steps: Steps) -> Iterator[str]:
    """stamp x y z qx qy qz qw."""
    yield from tum_from_trajectory(steps.trajectory).splitlines()


def csv_lines(steps: Steps) -> Iterator[str]:
    """The columns of steps.csv."""
    yield from csv_from_steps(steps).splitlines()


def ndjson_lines(steps: Steps) -> Iterator[str]:
    """One JSON object per scan; stamps are text, as JSON numbers lose nanoseconds."""
    for stamp, pose, sd, health in zip(steps.stamps_ns, steps.poses, steps.sd, steps.health, strict=True):
        names = ("x_m", "y_m", "yaw_rad", "sd_x_m", "sd_y_m", "sd_yaw_rad")
        numbers = dict(zip(names, (*pose.tolist(), *sd.tolist()), strict=True))
        yield json.dumps({"stamp_ns": str(stamp), **numbers, "health": Health(int(health)).name})


STREAMS: dict[str, Callable[[Steps], Iterator[str]]] = {
    "tum": tum_lines,
    "csv": csv_lines,
    "ndjson": ndjson_lines,
}
