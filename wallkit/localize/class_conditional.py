"""Returns that are from the map or from something unknown -> how likely every pose is; the default sensor model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.config import setting
from wallkit.core.grid import bordered, cells_from_points, placed, spread_of
from wallkit.core.types import FieldSet, Float32Array, Float64Array, Int64Array, LabelledScan
from wallkit.localize.densities import hit_density, unknown_density
from wallkit.localize.kernels import in_threads, sum_of_mixtures

if TYPE_CHECKING:
    from wallkit.localize.sensor import Likelihood


@dataclass(frozen=True)
class ClassConditional:
    """Each return is from the map or from something unknown (Akai 2023, class-conditional observation model).

    log p = temper * sum_k log(pi_k N(d_k; 0, sigma) + (1 - pi_k) p_unknown(z_k)), with p_unknown(z) the exponential
    lambda exp(-lambda z) / (1 - exp(-lambda z_max)): what is not in the map stands in front of it. The prior of beam k is
    pi_k = known_prior * w_k, w_k from the point filters; a beam of weight 0 tells nothing about the pose.
    """

    sigma_m: float = setting(0.1, "standard deviation of a return about the mapped surface", low=0.001)
    known_prior: float = setting(
        0.8, "prior that a return comes from the map when no filter says otherwise", low=0, high=1
    )
    unknown_rate_per_m: float = setting(0.2, "lambda of the exponential of unknown returns", low=1e-6)
    beams: int = setting(120, "returns used per update, spread over the sweep", low=1)
    range_max_m: float = setting(25.0, "farther returns are not used", low=0.1)
    temper: float = setting(
        0.2, "exponent of the joint likelihood: the independent share of the beams", low=0.001, high=1
    )

    def on(self, fields: FieldSet, *, threads: int = 1) -> Likelihood:
        """See SensorModel."""
        return _MixtureLikelihood(self, fields, bordered(hit_density(fields.distances_m["all"], self.sigma_m)), threads)

    def mixtures(self, scan: LabelledScan, used: Int64Array) -> tuple[Float32Array, Float32Array]:
        """Of the returns `used` (K,): pi_k, and (1 - pi_k) p_unknown(z_k)."""
        known = np.float32(self.known_prior) * scan.weights[used]
        rate = self.unknown_rate_per_m
        unknown = unknown_density(scan.points.ranges_m[used], rate_per_m=rate, range_max_m=self.range_max_m)
        # where a prior of 1 leaves no room for the unknown, the logarithm stays finite
        return known, np.maximum((1 - known) * unknown, np.float32(1e-9))


@dataclass(frozen=True)
class _MixtureLikelihood:
    settings: ClassConditional
    fields: FieldSet
    hit_field: Float32Array
    threads: int

    def log_likelihood(self, poses: Float64Array, scan: LabelledScan) -> Float64Array:
        """See Likelihood."""
        used = spread_of(scan.points, self.settings.beams, scan.weights, range_max_m=self.settings.range_max_m)
        endpoints = cells_from_points(self.fields, scan.points.xyz_m[used])
        known, floors = self.settings.mixtures(scan, used)
        out = np.zeros(len(poses))
        args = (endpoints, known, floors, self.hit_field)
        in_threads(sum_of_mixtures, placed(self.fields, poses), args, out, self.threads)
        return self.settings.temper * out
