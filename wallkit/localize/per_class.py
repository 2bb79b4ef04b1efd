"""Returns that a camera may have labelled -> how likely every pose is: what is labelled `door` is looked for at doors.

Without labels it is the class-conditional model, to the last bit. It needs a map with classes (`*.wkmap.urdf`): on a raster
a label tells nothing. How a door stands is in its class's field already, by the state prior of the map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.config import setting
from wallkit.core.grid import bordered, cells_from_points, placed, spread_of
from wallkit.core.types import FieldSet, Float32Array, Float64Array, Int64Array, LabelledScan
from wallkit.localize.class_conditional import ClassConditional
from wallkit.localize.densities import hit_density
from wallkit.localize.kernels import in_threads, sum_of_double_mixtures, sum_of_mixtures

if TYPE_CHECKING:
    from wallkit.localize.sensor import Likelihood


@dataclass(frozen=True)
class PerClass:
    """Each return is from a thing of its label's class, from anything in the map, or from something unknown.

    log p = temper * sum_k log(pi_k (g_k N(d_ck; 0, sigma) + (1 - g_k) N(d_k; 0, sigma)) + (1 - pi_k) p_unknown(z_k)), d_ck
    from return k to the nearest surface of its label's class c, d_k to the nearest of all, g_k = label_trust times the
    label's confidence, 0 without a label. A class that the map has nothing of (people, say) leaves only 1 - g_k for the
    map. pi_k and p_unknown are those of the class-conditional model (Akai 2023).
    """

    sigma_m: float = setting(
        ClassConditional.sigma_m, "standard deviation of a return about the mapped surface", low=0.001
    )
    known_prior: float = setting(
        ClassConditional.known_prior,
        "prior that a return comes from the map when no filter says otherwise",
        low=0,
        high=1,
    )
    label_trust: float = setting(0.9, "probability that a label of confidence 1 is right", low=0, high=1)
    unknown_rate_per_m: float = setting(
        ClassConditional.unknown_rate_per_m, "lambda of the exponential of unknown returns", low=1e-6
    )
    beams: int = setting(ClassConditional.beams, "returns used per update, spread over the sweep", low=1)
    range_max_m: float = setting(ClassConditional.range_max_m, "farther returns are not used", low=0.1)
    temper: float = setting(
        ClassConditional.temper,
        "exponent of the joint likelihood: the independent share of the beams",
        low=0.001,
        high=1,
    )

    def on(self, fields: FieldSet, *, threads: int = 1) -> Likelihood:
        """See SensorModel."""
        unlabelled = ClassConditional(
            self.sigma_m, self.known_prior, self.unknown_rate_per_m, self.beams, self.range_max_m, self.temper
        )
        hit_fields = {name: bordered(hit_density(d, self.sigma_m)) for name, d in fields.distances_m.items()}
        return _PerClassLikelihood(
            self, fields, hit_fields, unlabelled, unlabelled.on(fields, threads=threads), threads
        )


@dataclass(frozen=True)
class _PerClassLikelihood:
    settings: PerClass
    fields: FieldSet
    hit_fields: Mapping[str, Float32Array]
    model: ClassConditional
    unlabelled: Likelihood
    threads: int

    def log_likelihood(self, poses: Float64Array, scan: LabelledScan) -> Float64Array:
        """See Likelihood."""
        s = self.settings
        used = spread_of(scan.points, s.beams, scan.weights, range_max_m=s.range_max_m)
        labels, trust = self._labels(scan, used)
        if not (trust > 0).any():
            return self.unlabelled.log_likelihood(poses, scan)
        endpoints = cells_from_points(self.fields, scan.points.xyz_m[used])
        known, floors = self.model.mixtures(scan, used)
        at, total = placed(self.fields, poses), np.zeros(len(poses))
        for label in np.unique(labels):
            of_class = labels == label
            beams = np.ascontiguousarray(endpoints[:, of_class])
            anything = known[of_class] * (1 - trust[of_class])
            own_field = self.hit_fields.get(scan.classes[label]) if label >= 0 else None
            out = np.zeros(len(poses))
            if own_field is None:
                args = (beams, anything, floors[of_class], self.hit_fields["all"])
                in_threads(sum_of_mixtures, at, args, out, self.threads)
            else:
                own = known[of_class] * trust[of_class]
                both = (beams, anything, own, floors[of_class], self.hit_fields["all"], own_field)
                in_threads(sum_of_double_mixtures, at, both, out, self.threads)
            total += out
        return s.temper * total

    def _labels(self, scan: LabelledScan, used: Int64Array) -> tuple[Int64Array, Float32Array]:
        """Label (K,) of the returns used, -1 for none, and how far it is trusted: not at all on a map without classes."""
        if scan.labels is None or len(self.hit_fields) < 2:
            return np.full(len(used), -1), np.zeros(len(used), dtype=np.float32)
        sure = np.ones(len(used), dtype=np.float32) if scan.confidences is None else scan.confidences[used]
        labels = scan.labels[used]
        trust = np.float32(self.settings.label_trust) * np.where(labels >= 0, sure, np.float32(0.0))
        return np.where(trust > 0, labels, -1), trust
