"""A semantic map and a recorded log -> what the log says about the map, as findings of the rules WK-A."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wallkit.core.geometry import interpolate_poses, wrap_angle
from wallkit.core.steps import Steps
from wallkit.core.types import Float64Array, Health, Int64Array, Points, Trajectory
from wallkit.errors import LogError, MapError
from wallkit.evaluate.tum import read_tum
from wallkit.logs.reader import Log, open_log
from wallkit.logs.rig import Rig, Wanted, find_rig
from wallkit.logs.sync import synchronise
from wallkit.logs.topics import pick_truth
from wallkit.logs.trajectories import trajectory_of
from wallkit.maps.audit.audit import evidence_of
from wallkit.maps.audit.nouns import Evidence, Logged
from wallkit.maps.audit.settings import AuditSettings
from wallkit.maps.findings.judged import Judged
from wallkit.maps.grids.semantic_fields import height_m
from wallkit.maps.read import load_map
from wallkit.maps.rules import audit_against
from wallkit.pipelines.config import Config
from wallkit.pipelines.localize import Request, localize, prepare
from wallkit.pipelines.map.verdicts import write_whole

# what the log itself calls its truth
TRUTH_OF_LOG = "log"
_VIEWS_MIN, _PLACES_MIN = 8, 3
# poses are not carried farther than this over a gap in a truth
_GAP_MAX_NS = 10**9


@dataclass(frozen=True)
class AuditRequest:
    """What the user asked for.

    Attributes:
        truth: a TUM file, a topic, "log" for what the log calls its truth; None without. run: folder of a finished run.
            Without both the log is localized in the map itself.
        today: ignores that ended before it do not count; of None all do. init: where localizing starts.
        select, ignore: of the rules.
    """

    map: Path
    logs: tuple[Path, ...]
    today: datetime.date | None
    truth: str | None = None
    run: Path | None = None
    init: str | None = None
    seed: int = 0
    wanted: Wanted = field(default_factory=Wanted)
    select: Sequence[str] = ()
    ignore: Sequence[str] = ()
    is_lenient: bool = False


@dataclass(frozen=True)
class Audit:
    """What came out.

    Attributes:
        poses_from: where the poses are from and what was left out, in words.
        views: scans looked at. cannot_tell: why the log does not let one judge the map, or "".
        z_m: height of the LiDAR.
    """

    judged: Judged
    evidence: Evidence
    poses_from: str
    views: int
    z_m: float
    cannot_tell: str


@dataclass(frozen=True)
class _Track:
    """Poses by stamp: poses (T, 3) and sd (T, 3) at stamps (T,); a pose between two of them is interpolated.

    Attributes:
        gap_ns: farther apart than this nothing is interpolated. is_absolute: they do not come from the map.
    """

    stamps_ns: Int64Array
    poses: Float64Array
    sd: Float64Array
    gap_ns: int
    is_absolute: bool
    words: str

    def at(self, stamp_ns: int) -> tuple[Float64Array, Float64Array] | None:
        """Pose and sd (3,) at a stamp; None where the track has none near."""
        index = int(np.searchsorted(self.stamps_ns, stamp_ns))
        if index < len(self.stamps_ns) and self.stamps_ns[index] == stamp_ns:
            return self.poses[index], self.sd[index]
        if index in (0, len(self.stamps_ns)) or self.stamps_ns[index] - self.stamps_ns[index - 1] > self.gap_ns:
            return None
        return interpolate_poses(self.stamps_ns, self.poses, [stamp_ns])[0], self.sd[index]


def audit(request: AuditRequest, config: Config, *, observe: Callable[[int], None] | None = None) -> Audit:
    """Compare a map with a log.

    Args:
        observe: called with the number of scans done while the log is localized.

    Raises:
        WallkitError: a file cannot be read, or the log lacks what is needed.
    """
    semantic_map = load_map(request.map)
    z_m = height_m(semantic_map, config.maps.scan_plane_m)
    log = open_log(request.logs)
    rig = find_rig(log, request.wanted)
    track = _track(request, config, log, observe)
    logged = _logged(log, rig, track, config)
    evidence = evidence_of(semantic_map, logged, z_m, sigma_m=config.audit.sigma_m)
    report = audit_against(
        semantic_map.document,
        evidence,
        config.rules,
        select=request.select,
        ignore=request.ignore,
        today=request.today,
    )
    judged = Judged(semantic_map.document, report, is_strict=not request.is_lenient)
    return Audit(judged, evidence, track.words, len(logged), z_m, _why_not(evidence, logged, config.audit))


# ------------------------------------------------------------------------------------------------ poses


def _track(request: AuditRequest, config: Config, log: Log, observe: Callable[[int], None] | None) -> _Track:
    if request.truth is not None:
        return _track_from_truth(_truth(log, request.truth), config.audit, request.truth)
    if request.run is not None:
        from wallkit.pipelines.run_folder import read_run

        return _track_from_steps(read_run(request.run).steps, config.audit, f"poses of the run {request.run}")
    asked = Request(request.logs, request.map, request.init, seed=request.seed, wanted=request.wanted)
    run = localize(prepare(asked, config), observe=observe)
    return _track_from_steps(run.steps, config.audit, "poses by localizing the log in this map")


def _truth(log: Log, name: str) -> Trajectory:
    if name.endswith(".tum"):
        return read_tum(Path(name))
    track = pick_truth(log, None if name == TRUTH_OF_LOG else name)
    if track is None:
        raise LogError("the log has no truth", where=log.name, hint="--truth FILE.tum, or leave it out to localize")
    return trajectory_of(log, track)


def _track_from_truth(truth: Trajectory, settings: AuditSettings, name: str) -> _Track:
    sd = np.tile([settings.truth_sd_m, settings.truth_sd_m, np.deg2rad(settings.truth_sd_deg)], (len(truth), 1))
    words = f"true poses ({'of the log' if name == TRUTH_OF_LOG else name}), good to {settings.truth_sd_m * 100:g} cm"
    return _Track(truth.stamps_ns, truth.poses, sd, _GAP_MAX_NS, True, words)


def _track_from_steps(steps: Steps, settings: AuditSettings, words: str) -> _Track:
    """The scans at which the robot knew where it was.

    Raises:
        LogError: it never did.
    """
    known = steps.health == Health.LOCALIZED
    if not known.any():
        raise LogError(
            f"{words}: it never knew where it was, so nothing can be said about the map",
            hint="is it the map of this place? --init X,Y,YAW helps, and --truth does without",
        )
    least = np.array([settings.localized_sd_m, settings.localized_sd_m, np.deg2rad(settings.localized_sd_deg)])
    left_out = int((~known).sum())
    words += f"; {left_out} of {len(steps)} scans are left out, where it was not LOCALIZED" if left_out else ""
    sd = np.maximum(steps.sd[known], least)
    return _Track(steps.stamps_ns[known], steps.poses[known], sd, 0, False, words)


# ------------------------------------------------------------------------------------------------ scans


def _logged(log: Log, rig: Rig, track: _Track, config: Config) -> Logged:
    """The scans that an audit looks at: those from new places, thinned to the most that are wanted."""
    s = config.audit
    kept: list[tuple[Points, Float64Array, Float64Array]] = []
    for frame in synchronise(log, rig, config.logs):
        found = track.at(frame.stamp_ns)
        if found is None:
            continue
        pose, sd = found
        if kept and not _is_elsewhere(pose, frame.stamp_ns, kept[-1], s):
            continue
        kept.append((frame.points, pose, sd))
        if len(kept) > 2 * s.views:
            kept = kept[::2]
    if not kept:
        raise LogError(
            "no scan has a pose", where=log.name, hint="`wallkit log info` shows the stamps; do the poses reach them?"
        )
    kept = [kept[i] for i in np.linspace(0, len(kept) - 1, min(len(kept), s.views)).astype(int)]
    first_ns = kept[0][0].stamp_ns
    beams = [_beams(points, s.beams) for points, *_ in kept]
    return Logged(
        stamps_s=np.array([(points.stamp_ns - first_ns) * 1e-9 for points, *_ in kept]),
        poses=np.array([pose for _, pose, _ in kept]),
        sd=np.array([sd for *_, sd in kept]),
        views=np.repeat(np.arange(len(kept)), [len(bearings) for bearings, _ in beams]),
        bearings_rad=np.concatenate([bearings for bearings, _ in beams]),
        ranges_m=np.concatenate([ranges for _, ranges in beams]),
        origin_m=kept[0][0].origin_m,
        reach_m=max(points.range_max_m for points, *_ in kept),
        is_absolute=track.is_absolute,
    )


def _is_elsewhere(
    pose: Float64Array, stamp_ns: int, last: tuple[Points, Float64Array, Float64Array], s: AuditSettings
) -> bool:
    points, before, _ = last
    moved = np.hypot(*(pose - before)[:2]) >= s.view_distance_m
    turned = abs(wrap_angle(pose[2] - before[2])) >= np.deg2rad(s.view_turn_deg)
    return bool(moved or turned or stamp_ns - points.stamp_ns >= s.view_pause_s * 1e9)


def _beams(points: Points, most: int) -> tuple[Float64Array, Float64Array]:
    """Bearings and ranges in the plane of the returns and of the misses, at most so many, spread over the sweep."""
    away = points.xyz_m[:, :2].astype(np.float64) - points.origin_m
    bearings = np.concatenate([np.arctan2(away[:, 1], away[:, 0]), points.misses_rad.astype(np.float64)])
    ranges = np.concatenate([np.hypot(*away.T), np.full(len(points.misses_rad), np.inf)])
    order = np.argsort(bearings, kind="stable")
    order = order[np.linspace(0, len(order) - 1, min(len(order), most)).astype(int)]
    return bearings[order], ranges[order]


# ---------------------------------------------------------------------------------------------- verdict


def _why_not(evidence: Evidence, logged: Logged, settings: AuditSettings) -> str:
    """Why the log does not let one tell, or ""."""
    if len(logged) < _VIEWS_MIN or evidence.places < _PLACES_MIN:
        return f"only {len(logged)} scans from {evidence.places} places"
    if evidence.explained < settings.explained_min:
        return f"the map explains only {evidence.explained:.0%} of the returns: another place, or wrong poses?"
    if evidence.coverage < settings.coverage_min:
        return f"the log looked at only {evidence.coverage:.0%} of the map"
    return ""


def write_picture(out: Path, done: Audit) -> None:
    """Draw the audit into a .svg or .png file.

    Raises:
        OutputError: it cannot be written.
    """
    from wallkit.maps.audit.draw import draw_audit
    from wallkit.maps.draw.png import png_from_drawing
    from wallkit.maps.draw.svg import svg_from_drawing

    report = done.judged.report
    if report.map is None:
        raise ValueError("an audited map has been read")
    drawing = draw_audit(report.map, done.evidence, report.findings, done.z_m)
    write_whole(out, svg_from_drawing(drawing) if out.suffix.lower() == ".svg" else png_from_drawing(drawing))


def check_semantic(path: Path) -> None:
    """Refuse rasters with the way to make them semantic.

    Raises:
        MapError: it is no semantic map.
    """
    from wallkit.pipelines.maps import is_semantic

    if not is_semantic(path):
        raise MapError(
            "is no semantic map", where=path, hint=f"wallkit map import {path} -o floor.wkmap.urdf --scan-plane 0.3"
        )
