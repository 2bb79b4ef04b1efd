"""A run's snapshots -> a GIF over the ceiling it was localized by, or over its map."""

from __future__ import annotations

from pathlib import Path

from wallkit.errors import WallkitError
from wallkit.maps.ceiling.files import read_ceiling
from wallkit.pipelines.outputs import write_whole
from wallkit.pipelines.run_folder import RunRecord
from wallkit.report.animate import animation, ground_of_ceiling, ground_of_grid


def write_animation(out: Path, record: RunRecord) -> int:
    """Writes the GIF; how many moments it shows.

    Raises:
        WallkitError: the run kept no particles, or neither its ceiling nor its map is there.
    """
    if not record.snapshots:
        raise WallkitError("the run kept no particles", where=record.name, hint="run wallkit localize with one seed")
    named = record.run.get("ceiling")
    if named and Path(named).is_file():
        ground = ground_of_ceiling(read_ceiling(Path(named)))
    elif record.grid is not None:
        ground = ground_of_grid(record.grid)
    else:
        raise WallkitError(
            "neither its ceiling nor its map is there to draw on", where=record.name, hint="run wallkit localize again"
        )
    write_whole(out, animation(ground, record.snapshots, record.steps.trajectory, record.truth))
    return len(record.snapshots)
