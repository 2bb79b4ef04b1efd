"""The words of --init, a log and its truth -> the pose or the spread that a run begins with."""

from __future__ import annotations

import numpy as np

from wallkit.core.geometry import interpolate_poses
from wallkit.core.grid import distances_at
from wallkit.core.types import Float64Array, StampedPose, Trajectory
from wallkit.errors import ConfigError, LogError
from wallkit.localize.initial import SPREADS
from wallkit.logs.reader import Log
from wallkit.logs.rig import Rig
from wallkit.logs.topics import pick_initial_pose
from wallkit.logs.trajectories import first_pose
from wallkit.pipelines.maps import LoadedMap

# how well a start pose taken from truth is known: as well as the truth itself
TRUTH_SD = (0.1, 0.1, np.deg2rad(3.0))


def find_start(
    log: Log, init: str | None, truth: Trajectory | None, rig: Rig, window_ns: tuple[int | None, int | None]
) -> StampedPose | str:
    """The start as a pose, or the name of a spread over the map.

    Args:
        init: as Request. window_ns: header stamps between which scans are used.

    Raises:
        LogError: the log does not tell what was asked for. ConfigError: the words are no start.
    """
    if init in SPREADS:
        return init
    if init == "truth":
        return _start_from_truth(log, truth, rig, window_ns)
    if init is None or init == "topic":
        channel = pick_initial_pose(log)
        if channel is not None:
            return first_pose(log, channel)
        if init == "topic":
            raise LogError("no initial pose topic", where=log.name, hint="--init X,Y,YAW, or global")
        return "global"
    return StampedPose(0, "map", _pose_from_words(init))


def _start_from_truth(
    log: Log, truth: Trajectory | None, rig: Rig, window_ns: tuple[int | None, int | None]
) -> StampedPose:
    if truth is None:
        raise LogError(
            "--init truth needs a truth, and the log has none", where=log.name, hint="--truth TOPIC or FILE.tum"
        )
    stamp_ns = window_ns[0] if window_ns[0] is not None else log.first(rig.scan.topic)[0].stamp_ns
    if not truth.stamps_ns[0] - 10**9 <= stamp_ns <= truth.stamps_ns[-1]:
        raise LogError("the truth does not reach the first scan", where=log.name, hint="start later with --start")
    pose = interpolate_poses(truth.stamps_ns, truth.poses, [stamp_ns])[0]
    return StampedPose(stamp_ns, "map", pose, np.diag(np.square(TRUTH_SD)))


def check_on_map(pose: Float64Array, loaded: LoadedMap) -> None:
    """Refuse a start that the map does not reach: the filter would believe it and then be lost for no visible reason.

    Raises:
        ConfigError: it is outside.
    """
    if not np.isfinite(distances_at(loaded.fields, pose[None, :2])[0]):
        height, width = loaded.fields.shape
        corner = loaded.fields.origin
        raise ConfigError(
            f"the start x {pose[0]:.2f} m, y {pose[1]:.2f} m lies outside the map",
            where="--init",
            hint=f"the map has its corner at {corner[0]:.2f}, {corner[1]:.2f} and is "
            f"{width * loaded.fields.resolution_m:.1f} x {height * loaded.fields.resolution_m:.1f} m",
        )


def _pose_from_words(words: str) -> Float64Array:
    parts = words.split(",")
    try:
        pose = np.array([float(part) for part in parts])
    except ValueError:
        pose = np.zeros(0)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        names = ", ".join(["topic", "truth", *SPREADS])
        raise ConfigError(
            f"'{words}' is no start", where="--init", hint=f"X,Y,YAW in metres and radians, or one of {names}"
        )
    return pose
