"""A run's particles -> a GIF, an MP4 or a PNG over the ceiling it was localized by, or over its map."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from wallkit.core.types import Health, Int64Array, PointCloud
from wallkit.errors import WallkitError
from wallkit.logs.reader import open_log
from wallkit.pipelines.outputs import write_whole
from wallkit.pipelines.run_folder import RESULT_MCAP, RunRecord, ceiling_of
from wallkit.report.animate import Ground, animation, film, ground_of_ceiling, ground_of_grid, sheet
from wallkit.report.data import Snapshot

Choice = Callable[[int, int], Int64Array]
_CLOUDS = "/wallkit/particles/cloud"
_FORMS = {".gif": animation, ".mp4": film, ".png": sheet}
# moments shown at most
_MOMENTS = {".gif": 60, ".mp4": 240, ".png": 6}


def write_animation(out: Path, record: RunRecord, folder: Path) -> int:
    """Writes it; how many moments it shows. They come from result.mcap, else they are the few kept for the report.

    Args:
        folder: of the run.

    Raises:
        WallkitError: the run kept no particles, neither its ceiling nor its map is there, or it can be no such file.
    """
    form = out.suffix.lower()
    if form not in _FORMS:
        raise WallkitError(
            f"'{out.suffix}' is no animation", where=out, hint="name a file that ends in .gif, .mp4 or .png"
        )
    moments = recorded(folder, record, _CHOICES[form], _MOMENTS[form]) or record.snapshots[-_MOMENTS[form] :]
    if not moments:
        raise WallkitError("the run kept no particles", where=record.name, hint="run wallkit localize with one seed")
    write_whole(out, _FORMS[form](_ground(record), moments, record.steps.trajectory, record.truth))
    return len(moments)


def recorded(folder: Path, record: RunRecord, choose: Choice, most: int) -> tuple[Snapshot, ...]:
    """Particles of a run's result.mcap at chosen updates; none if it holds none."""
    if not (folder / RESULT_MCAP).is_file():
        return ()
    log = open_log([folder / RESULT_MCAP])
    count = sum(channel.topic == _CLOUDS for _, _, channel, _ in log.raw([_CLOUDS]))
    wanted = set(choose(count, most).tolist())
    shots = []
    for i, message in enumerate(log.messages([_CLOUDS])):
        if i in wanted and isinstance(cloud := message.value, PointCloud):
            poses = cloud.points_m.astype(np.float64) * (1, 1, 0)
            row = min(int(np.searchsorted(record.steps.stamps_ns, message.stamp_ns)), len(record.steps) - 1)
            health = Health(int(record.steps.health[row])).name
            weights = np.full(len(poses), 1 / max(len(poses), 1))
            shots.append(Snapshot(message.stamp_ns, poses, weights, f"update {i + 1}  {health}"))
    return tuple(shots)


def chosen(count: int, most: int) -> Int64Array:
    """Which of so many moments are shown: the first quarter of `most` one by one, then evenly to the last."""
    if count <= most:
        return np.arange(count)
    first = most // 4
    return np.concatenate([np.arange(first), np.linspace(first, count - 1, most - first).round().astype(np.int64)])


def doubling(count: int, most: int) -> Int64Array:
    """Which of so many moments stand on a page: the first, the last, and between them each so many times later."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.geomspace(1, count, most).round().astype(np.int64)) - 1


_CHOICES: dict[str, Choice] = {".gif": chosen, ".mp4": chosen, ".png": doubling}


def _ground(record: RunRecord) -> Ground:
    if (ceiling := ceiling_of(record.run)) is not None:
        return ground_of_ceiling(ceiling)
    if record.grid is not None:
        return ground_of_grid(record.grid)
    raise WallkitError(
        "neither its ceiling nor its map is there to draw on", where=record.name, hint="run wallkit localize again"
    )
