"""What weighing particles by one view of the ceiling costs, model by model."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingView
from wallkit.core.config import Source, build
from wallkit.localize.ceiling import CEILINGS


@dataclass(frozen=True)
class WeighTime:
    """CPU time of weighing all particles by one view, median over the rounds; they are in a square of side `spread_m`."""

    model: str
    spread_m: float
    particles: int
    places: int
    weigh_ms: float
    ns_per_lookup: float


def time_models(particles: int = 2000, side: int = 9, rounds: int = 60) -> Iterator[WeighTime]:
    """Rows of every model on a ceiling of 20 m x 20 m at 2 cm: particles gathered, and everywhere, worst for the cache."""
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 255, (1000, 1000, 3), dtype=np.uint8)
    ceiling = CeilingMap(pixels, np.ones((1000, 1000), bool), 0.02, np.zeros(3), 2.7, "bench")
    steps = (np.arange(side) - (side - 1) / 2) * 0.15
    points = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=2).astype(np.float32)
    colours = rng.random((side, side, 3), dtype=np.float32)
    view = CeilingView(0, points, colours, np.ones((side, side), bool), np.zeros(2), colours[0, 0])
    unit = rng.uniform(-1, 1, (particles, 3))
    exact = {"patch (exposure=1)": build(CEILINGS["patch"], [Source({"exposure": 1.0}, "bench")])[0]}
    for name, model in {**{name: made() for name, made in CEILINGS.items()}, **exact}.items():
        likelihood = model.on(ceiling)
        places = 1 if name in ("centre", "histogram") else side * side
        for spread_m in (1.0, 20.0):
            poses = unit * (spread_m / 2, spread_m / 2, np.pi) + (10.0, 10.0, 0.0)
            likelihood.log_likelihood(poses, view)
            times = []
            for _ in range(rounds):
                began = time.process_time_ns()
                likelihood.log_likelihood(poses, view)
                times.append((time.process_time_ns() - began) / 1e6)
            took = float(np.median(times))
            yield WeighTime(name, spread_m, particles, places, took, 1e6 * took / (particles * places))
