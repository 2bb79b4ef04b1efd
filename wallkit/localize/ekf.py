"""The second baseline: an iterated extended Kalman filter that matches every scan to the distance field.

One Gaussian, no hypotheses, no recovery: what a Kalman filter does with the same odometry, scans, map and health. The
measurement update is the maximum of prior times likelihood found by Gauss-Newton (Bell & Cathey 1993), each return
contributing its distance to the nearest surface with Huber's weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.geometry import compose, invert, relative, transform_points, wrap_angle
from wallkit.core.grid import spread_of
from wallkit.core.raycast import classify_rays
from wallkit.core.types import Estimate, FieldSet, Float64Array, LabelledScan, Mode, StampedPose
from wallkit.localize.belief import StepInfo
from wallkit.localize.health import HealthSettings, Trust, count_updates, has_outlived, judge, weigh_evidence
from wallkit.localize.initial import START_SD
from wallkit.localize.motion import STANDSTILL_M
from wallkit.localize.settings import EkfSettings, LocalizeSettings


@dataclass(frozen=True, slots=True)
class GaussianBelief:
    """One Gaussian: pose (3,), covariance (3, 3), and what health remembers."""

    pose: Float64Array
    covariance: Float64Array
    odometry: Float64Array | None
    trust: Trust
    path_m: float = 0.0
    gap_s: float = 0.0
    updates: int = 0

    def estimate(self, stamp_ns: int = 0) -> Estimate:
        """Where the robot is now."""
        mode = Mode(self.pose, self.covariance, 1.0)
        return Estimate(stamp_ns, self.pose, self.covariance, self.trust.health, (mode,))


@dataclass(frozen=True)
class ScanMatchingEkf:
    """The Kalman filter on one map; made by `scan_matching_ekf`."""

    settings: EkfSettings
    health: HealthSettings
    fields: FieldSet

    def start(self, rng: np.random.Generator, at: StampedPose) -> GaussianBelief:
        """A belief about a given pose."""
        covariance = np.diag(np.square(START_SD)) if at.covariance is None else at.covariance
        return GaussianBelief(at.pose, covariance, None, Trust(is_confirmed=True))

    def predict(
        self, rng: np.random.Generator, belief: GaussianBelief, odometry: Float64Array, gap_s: float = 0.0
    ) -> GaussianBelief:
        """The belief after odometry (3,) = T_odom_base."""
        gap = max(belief.gap_s, gap_s)
        if belief.odometry is None:
            return replace(belief, odometry=odometry, gap_s=gap)
        s, moved = self.settings, relative(belief.odometry, odometry)
        driven, turned = float(np.hypot(moved[0], moved[1])), abs(float(moved[2]))
        if driven < STANDSTILL_M and turned < 1e-3:
            return replace(belief, gap_s=gap)
        c, n = np.cos(belief.pose[2]), np.sin(belief.pose[2])
        by_pose = np.array([[1, 0, -n * moved[0] - c * moved[1]], [0, 1, c * moved[0] - n * moved[1]], [0, 0, 1]])
        by_motion = np.array([[c, -n, 0], [n, c, 0], [0, 0, 1]])
        along = s.range_per_m * driven + s.range_per_turn * turned
        noise = np.diag([along, 0.5 * along, s.yaw_per_turn * turned + s.yaw_per_m * driven]) ** 2
        covariance = by_pose @ belief.covariance @ by_pose.T + by_motion @ noise @ by_motion.T
        return replace(
            belief,
            pose=compose(belief.pose, moved),
            covariance=covariance,
            odometry=odometry,
            path_m=belief.path_m + driven,
            gap_s=gap,
        )

    def wants(self, belief: GaussianBelief, scan: LabelledScan) -> bool:
        """Every scan is used."""
        return True

    def update(
        self, rng: np.random.Generator, belief: GaussianBelief, scan: LabelledScan
    ) -> tuple[GaussianBelief, StepInfo]:
        """The belief after a scan, and what the update did."""
        pose, covariance = self._matched(belief, scan)
        h = self.health
        rays = classify_rays(
            self.fields, scan.points, pose, tolerance_m=h.hit_tolerance_m, tolerance_per_m=h.hit_tolerance_per_m
        )
        evidence = weigh_evidence(rays, np.sqrt(np.diag(covariance)), (Mode(pose, covariance, 1.0),))
        trust = count_updates(h, belief.trust, evidence, path_m=belief.path_m, gap_s=belief.gap_s, has_jumped=False)
        outlived = has_outlived(h, trust, evidence, were_sought=False)
        trust = judge(h, replace(trust, is_confirmed=trust.is_confirmed or outlived), evidence)
        info = StepInfo(True, trust.reason, evidence)
        after = GaussianBelief(pose, covariance, belief.odometry, trust, updates=belief.updates + 1)
        return after, info

    def candidates(self, belief: GaussianBelief) -> tuple[Mode, ...]:
        """The one hypothesis there is."""
        return belief.estimate().modes

    def _matched(self, belief: GaussianBelief, scan: LabelledScan) -> tuple[Float64Array, Float64Array]:
        """Pose and covariance that maximise prior times likelihood."""
        s = self.settings
        used = spread_of(scan.points, s.beams, scan.weights, range_max_m=s.range_max_m)
        points, weights = scan.points.xyz_m[used, :2].astype(np.float64), scan.weights[used].astype(np.float64)
        prior = np.linalg.inv(belief.covariance)
        pose = belief.pose.copy()
        information = prior
        for _ in range(s.iterations):
            distances, slopes, is_inside = _distances_and_slopes(self.fields, pose, points)
            counted = (
                weights
                * is_inside
                * (distances < s.ignore_m)
                * np.minimum(1.0, s.huber_m / np.maximum(distances, 1e-9))
            )
            counted *= s.temper / s.sigma_m**2
            off = pose - belief.pose
            off[2] = wrap_angle(off[2])
            information = prior + slopes.T @ (counted[:, None] * slopes)
            step = -np.linalg.solve(information, prior @ off + slopes.T @ (counted * distances))
            pose = pose + step
            if np.abs(step).max() < 1e-4:
                break
        pose[2] = wrap_angle(pose[2])
        return pose, np.linalg.inv(information)


def _distances_and_slopes(
    fields: FieldSet, pose: Float64Array, points: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Distance (K,) of the points seen from a pose to the map, its slope (K, 3) by the pose, and 1 where the map knows."""
    seen = transform_points(pose, points)
    to_grid = invert(fields.origin)
    at = transform_points(to_grid, seen) / fields.resolution_m - 0.5
    height, width = fields.shape
    column, row = np.floor(at).astype(np.int64).T
    inside = (column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1)
    column, row = np.where(inside, column, 0), np.where(inside, row, 0)
    fx, fy = at[:, 0] - column, at[:, 1] - row
    d = fields.distances_m["all"].astype(np.float64)
    d00, d10, d01, d11 = d[row, column], d[row, column + 1], d[row + 1, column], d[row + 1, column + 1]
    value = d00 * (1 - fx) * (1 - fy) + d10 * fx * (1 - fy) + d01 * (1 - fx) * fy + d11 * fx * fy
    in_grid = np.column_stack([(d10 - d00) * (1 - fy) + (d11 - d01) * fy, (d01 - d00) * (1 - fx) + (d11 - d10) * fx])
    in_map = transform_points(np.array([0.0, 0.0, fields.origin[2]]), in_grid / fields.resolution_m)
    arm = seen - pose[:2]
    by_yaw = in_map[:, 1] * arm[:, 0] - in_map[:, 0] * arm[:, 1]
    return np.where(inside, value, 0.0), np.column_stack([in_map, by_yaw]) * inside[:, None], inside.astype(np.float64)


def scan_matching_ekf(settings: LocalizeSettings, fields: FieldSet) -> ScanMatchingEkf:
    """The Kalman filter for one map."""
    return ScanMatchingEkf(settings.ekf, settings.health, fields)
