"""Frames and what the filter said about them -> the rows, snapshots and messages of a run."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import compose, invert, wrap_angle
from wallkit.core.raycast import HIT
from wallkit.core.steps import Steps
from wallkit.core.types import Estimate, Float64Array, Frame, Health, LabelledScan, OccupancyGrid, Trajectory
from wallkit.localize.belief import Belief, StepInfo
from wallkit.localize.ekf import GaussianBelief
from wallkit.localize.particles import normalised
from wallkit.logs.results import ResultWriter
from wallkit.pipelines.annotations import annotations_of
from wallkit.pipelines.sight import Labelled
from wallkit.report.data import Snapshot

# so many moments at most are kept for the report, besides the first and the last
SNAPSHOTS_MAX = 10
_PATH_EVERY = 50


@dataclass(frozen=True)
class ResultSettings:
    """The [results] table of wallkit.toml: how much goes into result.mcap."""

    particles: int = setting(200, "particles written per update; 0 leaves them out", low=0)
    points: bool = setting(True, "write the returns that fit the map and those that do not")


class Recorder:
    """Everything a run leaves behind, gathered frame by frame. Memory grows by about 150 bytes a frame."""

    def __init__(self) -> None:
        self._numbers = array("d")
        self._stamps = array("q")
        self._odometry = array("d")
        self._reasons: list[str] = []
        self._known_reasons: dict[str, str] = {}
        self.snapshots: list[Snapshot] = []
        self._updates = 0
        self._last_health: Health | None = None

    def __len__(self) -> int:
        return len(self._stamps)

    def add(
        self, frame: Frame, estimate: Estimate, info: StepInfo, belief: Belief | GaussianBelief, elapsed_ms: float
    ) -> None:
        """Remember one frame."""
        e = info.evidence
        shares = (e.hit, e.short, e.long) if e else (np.nan, np.nan, np.nan)
        sd = np.sqrt(np.diag(estimate.covariance))
        self._stamps.append(frame.stamp_ns)
        self._numbers.extend(
            (
                *estimate.pose,
                *sd,
                float(estimate.health),
                *shares,
                info.effective,
                info.particles,
                len(estimate.modes),
                elapsed_ms if info.is_update else np.nan,
            )
        )
        self._odometry.extend(frame.odometry)
        self._reasons.append(self._known_reasons.setdefault(info.reason, info.reason))
        if info.is_update:
            self._updates += 1
            self._keep_snapshot(frame.stamp_ns, estimate, belief)
        self._last_health = estimate.health

    def steps(self) -> Steps:
        """The rows so far."""
        table = np.frombuffer(self._numbers, dtype=np.float64).reshape(-1, 14)
        return Steps(
            stamps_ns=np.array(self._stamps, dtype=np.int64),
            poses=table[:, 0:3].copy(),
            sd=table[:, 3:6].copy(),
            health=table[:, 6].astype(np.int64),
            hit_ratio=table[:, 7].copy(),
            short_ratio=table[:, 8].copy(),
            long_ratio=table[:, 9].copy(),
            ess=table[:, 10].copy(),
            particles=table[:, 11].astype(np.int64),
            modes=table[:, 12].astype(np.int64),
            update_ms=table[:, 13].copy(),
            reasons=tuple(self._reasons),
        )

    def odometry(self) -> Trajectory:
        """Odometry at every frame."""
        poses = np.frombuffer(self._odometry, dtype=np.float64).reshape(-1, 3).copy()
        return Trajectory(np.array(self._stamps, dtype=np.int64), poses, "odom")

    def _keep_snapshot(self, stamp_ns: int, estimate: Estimate, belief: Belief | GaussianBelief) -> None:
        """Particles at updates 1, 2, 4, 8, ... and where the health changes: where a run is interesting."""
        changed = self._last_health is not None and estimate.health != self._last_health
        is_power = self._updates & (self._updates - 1) == 0
        if not isinstance(belief, Belief) or not (changed or is_power) or len(self.snapshots) >= SNAPSHOTS_MAX:
            return
        label = f"becomes {estimate.health.name}" if changed else f"update {self._updates}"
        weights = normalised(belief.particles.log_weights)
        self.snapshots.append(Snapshot(stamp_ns, belief.particles.poses.copy(), weights, label))


class MessageWriter:
    """The run as messages of a result.mcap."""

    def __init__(
        self, writer: ResultWriter, settings: ResultSettings, grid: OccupancyGrid, truth: Trajectory | None
    ) -> None:
        self._writer, self._settings, self._grid, self._truth = writer, settings, grid, truth
        self._path_stamps: list[int] = []
        self._path_poses: list[Float64Array] = []
        self._frames = 0
        self._next_truth = 0

    def add(self, frame: Frame, estimate: Estimate, info: StepInfo, belief: Belief | GaussianBelief) -> None:
        """One frame."""
        stamp, w = frame.stamp_ns, self._writer
        if self._frames == 0:
            w.grid(stamp, self._grid)
        w.pose(estimate)
        w.odometry(stamp, frame.odometry)
        w.transforms(stamp, compose(estimate.pose, invert(frame.odometry)), frame.odometry)
        self._add_truth(stamp, estimate.pose)
        self._frames += 1
        if self._frames % 5 == 1:
            self._path_stamps.append(stamp)
            self._path_poses.append(estimate.pose)
        if self._frames % _PATH_EVERY == 1:
            w.path(stamp, Trajectory(np.array(self._path_stamps, dtype=np.int64), np.array(self._path_poses)))
        if info.is_update:
            self._add_update(frame, estimate, info, belief)

    def add_filtered(self, frame: Frame, scan: LabelledScan, seen: Labelled | None) -> None:
        """What the point filters made of an update's scan, and what cameras saw."""
        if not self._settings.points:
            return
        stamp, kept = frame.stamp_ns, scan.weights >= 0.5
        for name, chosen in (("kept", kept), ("rejected", ~kept)):
            self._writer.filtered(stamp, name, frame.points.xyz_m[chosen], scan.weights[chosen])
        for glance in seen.glances if seen else ():
            self._writer.annotations(glance.view.image.stamp_ns, glance.camera.name, annotations_of(glance, scan))

    def _add_update(self, frame: Frame, estimate: Estimate, info: StepInfo, belief: Belief | GaussianBelief) -> None:
        stamp, w, e = frame.stamp_ns, self._writer, info.evidence
        assert e is not None  # an update has evidence
        spread = np.sqrt(np.diag(estimate.covariance))
        numbers = {
            "hit": e.hit,
            "short": e.short,
            "long": e.long,
            "spread_m": float(max(spread[0], spread[1])),
            "spread_rad": float(spread[2]),
            "effective": info.effective,
            "modes": float(len(estimate.modes)),
        }
        w.health(stamp, estimate.health, info.reason, numbers)
        if self._settings.particles and isinstance(belief, Belief):
            weights = normalised(belief.particles.log_weights)
            step = max(1, len(weights) // self._settings.particles)
            w.particles(stamp, belief.particles.poses[::step], weights[::step])
        if self._settings.points:
            fits = e.rays == HIT
            for name, chosen in (("kept", fits), ("rejected", ~fits)):
                xyz = frame.points.xyz_m[chosen]
                w.points(stamp, name, xyz, np.ones(len(xyz), dtype=np.float32))

    def _add_truth(self, stamp_ns: int, pose: Float64Array) -> None:
        """The truth up to this stamp, and the error when it has a pose at this very stamp."""
        if self._truth is None:
            return
        stamps = self._truth.stamps_ns
        while self._next_truth < len(stamps) and stamps[self._next_truth] <= stamp_ns:
            at = self._next_truth
            true = self._truth.poses[at]
            self._writer.truth(int(stamps[at]), true)
            if stamps[at] == stamp_ns:
                off = pose - true
                self._writer.error(stamp_ns, float(np.hypot(off[0], off[1])), abs(float(wrap_angle(off[2]))))
            self._next_truth += 1
