"""What the user says of where the robot was -> its pose at the stamp of every image."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wallkit.core.geometry import interpolate_poses
from wallkit.core.types import Float64Array, Health, Trajectory
from wallkit.errors import LogError
from wallkit.evaluate.tum import read_tum
from wallkit.logs.reader import Log
from wallkit.logs.topics import pick_truth
from wallkit.logs.trajectories import trajectory_of

# a pose is not carried over a longer silence
_GAP_S = 0.5


def known_poses(log: Log, words: str | None) -> Trajectory:
    """Poses in frame map: of a run (only where it was LOCALIZED), a TUM file, or a topic; None and "truth": the log's truth.

    Raises:
        LogError: there are none.
    """
    if words is not None and Path(words).is_dir():
        from wallkit.pipelines.run_folder import read_run

        steps = read_run(Path(words)).steps
        sure = steps.health == Health.LOCALIZED
        if not sure.any():
            raise LogError("the run never was LOCALIZED", where=words, hint="name another run, or a TUM file")
        return Trajectory(steps.stamps_ns[sure], steps.poses[sure])
    if words is not None and words.endswith(".tum"):
        return read_tum(Path(words))
    track = pick_truth(log, None if words == "truth" else words)
    if track is None:
        raise LogError(
            "the log holds no truth",
            where=log.name,
            hint="--poses RUN|FILE.tum|TOPIC, where RUN is a folder that wallkit localize wrote",
        )
    return trajectory_of(log, track)


def pose_at(poses: Trajectory, stamp_ns: int) -> Float64Array | None:
    """(3,) at a stamp; None where no two neighbours are near."""
    after = int(np.searchsorted(poses.stamps_ns, stamp_ns))
    if after == 0 or after == len(poses):
        return None
    around = slice(after - 1, after + 1)
    if poses.stamps_ns[after] - poses.stamps_ns[after - 1] > _GAP_S * 1e9:
        return None
    return np.asarray(interpolate_poses(poses.stamps_ns[around], poses.poses[around], [stamp_ns])[0])
