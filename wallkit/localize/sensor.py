"""A labelled scan and the map's fields -> how likely every pose is.

A sensor model is a frozen dataclass of settings; `on(fields)` prepares its look-up tables once per map, and the result
answers `log_likelihood(poses, scan)`. Beams are not independent (walls are wrong together, people come in arcs), so the
sum of logs is tempered: an exponent below 1 keeps the 95 % ellipse honest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wallkit.core.config import setting
from wallkit.core.geometry import compose
from wallkit.core.grid import bordered, cells_from_points, placed, spread_of
from wallkit.core.raycast import cast_rays
from wallkit.core.types import FieldSet, Float32Array, Float64Array, LabelledScan
from wallkit.localize.class_conditional import ClassConditional
from wallkit.localize.densities import SQRT_2PI, hit_density
from wallkit.localize.kernels import in_threads, sum_of_field
from wallkit.localize.per_class import PerClass


class Likelihood(Protocol):
    """A sensor model on one map."""

    def log_likelihood(self, poses: Float64Array, scan: LabelledScan) -> Float64Array:
        """(N,) float64 [nat] for poses (N, 3) in frame map; no usable return: zeros."""
        ...


class SensorModel(Protocol):
    """Settings of a sensor model."""

    def on(self, fields: FieldSet, *, threads: int = 1) -> Likelihood:
        """The model on one map."""
        ...


@dataclass(frozen=True)
class LikelihoodField:
    """Distance from each return to the nearest surface (Probabilistic Robotics 2005, table 6.3), beams summed as logs.

    log p = temper * sum_k w_k log(z_hit N(d_k; 0, sigma) + z_rand / z_max), as a true joint likelihood with an outlier
    mixture; AMCL sums p^3 instead, which is no likelihood.
    """

    sigma_m: float = setting(0.1, "standard deviation of a return about the mapped surface", low=0.001)
    z_hit: float = setting(0.8, "share of returns that come from the map", low=0, high=1)
    z_rand: float = setting(0.2, "share of returns that come from anywhere", low=1e-6, high=1)
    beams: int = setting(120, "returns used per update, spread over the sweep", low=1)
    range_max_m: float = setting(25.0, "farther returns are not used", low=0.1)
    temper: float = setting(
        0.2, "exponent of the joint likelihood: the independent share of the beams", low=0.001, high=1
    )

    def on(self, fields: FieldSet, *, threads: int = 1) -> Likelihood:
        """See SensorModel."""
        hit = hit_density(fields.distances_m["all"], self.sigma_m)
        log_field = np.log(self.z_hit * hit + np.float32(self.z_rand / self.range_max_m))
        return _FieldLikelihood(self, fields, bordered(log_field), threads)


@dataclass(frozen=True)
class _FieldLikelihood:
    settings: LikelihoodField
    fields: FieldSet
    log_field: Float32Array
    threads: int

    def log_likelihood(self, poses: Float64Array, scan: LabelledScan) -> Float64Array:
        """See Likelihood."""
        used = spread_of(scan.points, self.settings.beams, scan.weights, range_max_m=self.settings.range_max_m)
        endpoints = cells_from_points(self.fields, scan.points.xyz_m[used])
        out = np.zeros(len(poses))
        args = (endpoints, scan.weights[used], self.log_field)
        in_threads(sum_of_field, placed(self.fields, poses), args, out, self.threads)
        return self.settings.temper * out


@dataclass(frozen=True)
class Beam:
    """Measured against ray-cast ranges: hit, short, max and random (Probabilistic Robotics 2005, table 6.1)."""

    sigma_m: float = setting(0.15, "standard deviation of a hit", low=0.001)
    z_hit: float = setting(0.7, "share of returns from the expected surface", low=0, high=1)
    z_short: float = setting(0.15, "share of returns from something in front of it", low=0, high=1)
    z_max: float = setting(0.05, "share of beams without a return where one is expected", low=0, high=1)
    z_rand: float = setting(0.1, "share of returns from anywhere", low=1e-6, high=1)
    short_rate_per_m: float = setting(0.3, "lambda of the exponential of short returns", low=1e-6)
    beams: int = setting(60, "beams used per update, spread over the sweep", low=1)
    range_max_m: float = setting(25.0, "farther returns count as none", low=0.1)
    temper: float = setting(
        0.3, "exponent of the joint likelihood: the independent share of the beams", low=0.001, high=1
    )

    def on(self, fields: FieldSet, *, threads: int = 1) -> Likelihood:
        """See SensorModel."""
        return _BeamLikelihood(self, fields, threads)

    def density(self, ranges_m: Float32Array, expected_m: Float32Array, reach_m: float) -> Float64Array:
        """p(z | z*) (N, K) [1/m] of ranges (K,) against expected ranges (N, K); a range at `reach_m` is no return."""
        z, at = ranges_m[None, :].astype(np.float64), expected_m.astype(np.float64)
        hit = np.exp(-0.5 * ((z - at) / self.sigma_m) ** 2) / (self.sigma_m * SQRT_2PI)
        rate = self.short_rate_per_m
        short = np.where(z <= at, rate * np.exp(-rate * z) / -np.expm1(-rate * np.maximum(at, 1e-3)), 0.0)
        is_max = z >= reach_m
        return self.z_hit * hit + self.z_short * short + self.z_max * is_max + self.z_rand / reach_m


@dataclass(frozen=True)
class _BeamLikelihood:
    settings: Beam
    fields: FieldSet
    threads: int

    def log_likelihood(self, poses: Float64Array, scan: LabelledScan) -> Float64Array:
        """See Likelihood."""
        reach = min(self.settings.range_max_m, scan.points.range_max_m)
        bearings, ranges, weights = self.beams(scan, reach)
        lidar = placed(self.fields, compose(poses, np.array([*scan.points.origin_m, 0.0])), border=0)
        expected = np.zeros((len(poses), len(bearings)), dtype=np.float32)
        directions = np.stack([np.cos(bearings), np.sin(bearings)])
        per_m = np.float32(1.0 / self.fields.resolution_m)
        args = (directions, self.fields.distances_m["all"], per_m, np.float32(reach) * per_m)
        in_threads(cast_rays, lidar, args, expected, self.threads)
        p = self.settings.density(ranges, expected * np.float32(self.fields.resolution_m), reach)
        return np.asarray(self.settings.temper * (np.log(p) @ weights))

    def beams(self, scan: LabelledScan, reach_m: float) -> tuple[Float32Array, Float32Array, Float64Array]:
        """Bearings in frame base, ranges and weights of the beams used: returns and misses in their own proportion."""
        points = scan.points
        total = len(points.ranges_m) + len(points.misses_rad)
        wanted = -(-self.settings.beams * len(points.ranges_m) // max(total, 1))
        used = spread_of(points, wanted, scan.weights)
        away = points.xyz_m[used, :2] - points.origin_m
        misses = points.misses_rad[:: max(1, total // self.settings.beams)]
        bearings = np.concatenate([np.arctan2(away[:, 1], away[:, 0]), misses]).astype(np.float32)
        ranges = np.minimum(np.concatenate([points.ranges_m[used], np.full(len(misses), reach_m)]), reach_m)
        weights = np.concatenate([scan.weights[used], np.ones(len(misses))])
        return bearings, ranges.astype(np.float32), weights.astype(np.float64)


SENSORS: dict[str, type[SensorModel]] = {
    "likelihood_field": LikelihoodField,
    "class_conditional": ClassConditional,
    "beam": Beam,
    "per_class": PerClass,
}
