"""How fast: the filter's inner steps on a scene of its own, and a whole run split into its parts."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.core.config import Source, build
from wallkit.core.geometry import compose
from wallkit.core.types import FieldSet, Float64Array, LabelledScan, Points
from wallkit.localize.motion import DifferentialDrive
from wallkit.localize.particles import normalised
from wallkit.localize.resample import systematic
from wallkit.localize.sensor import SENSORS, LikelihoodField

ROUNDS = 60


@dataclass(frozen=True)
class UpdateTime:
    """Medians over the rounds, in one process, for one size.

    `total_ms` is predict + reweight + resample, as peers count an update; `spread` is the 95th over the 5th percentile of
    the rounds: above 1.5 the machine was busy and only ratios mean something.
    """

    sensor: str
    particles: int
    beams: int
    cells: int
    threads: int
    predict_ms: float
    reweight_ms: float
    resample_ms: float
    total_ms: float
    ns_per_lookup: float
    numpy_ratio: float | None
    spread: float


def time_updates(
    particles: Sequence[int], beams: Sequence[int], cells: Sequence[int], threads: Sequence[int], *, numpy_oracle: bool
) -> Iterator[UpdateTime]:
    """One row per combination, of the likelihood field (as the peers' figures) and of the class-conditional model."""
    for side in cells:
        fields = bench_scene(side)
        for count in particles:
            for k in beams:
                scan = _scan(k)
                for name in ("likelihood_field", "class_conditional"):
                    for t in threads:
                        yield _time_one(name, fields, scan, count, t, numpy_oracle=numpy_oracle and t == 1)


def numpy_log_likelihood(
    settings: LikelihoodField, fields: FieldSet, poses: Float64Array, scan: LabelledScan
) -> Float64Array:
    """The likelihood field in plain NumPy: what the kernel computes, as one would write it."""
    points = scan.points.xyz_m[:, :2].astype(np.float64)
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    x = poses[:, 0][:, None] + c * points[:, 0] - s * points[:, 1]
    y = poses[:, 1][:, None] + s * points[:, 0] + c * points[:, 1]
    column = ((x - fields.origin[0]) / fields.resolution_m).astype(np.int64).clip(0, fields.shape[1] - 1)
    row = ((y - fields.origin[1]) / fields.resolution_m).astype(np.int64).clip(0, fields.shape[0] - 1)
    d = fields.distances_m["all"]
    hit = np.exp(-0.5 * (d / settings.sigma_m) ** 2) / (settings.sigma_m * np.sqrt(2 * np.pi))
    log_field = np.log(settings.z_hit * hit + settings.z_rand / settings.range_max_m)
    return np.asarray(settings.temper * log_field[row, column].sum(axis=1))


def _time_one(
    name: str, fields: FieldSet, scan: LabelledScan, count: int, threads: int, *, numpy_oracle: bool
) -> UpdateTime:
    beams = len(scan.weights)
    rng = np.random.default_rng(0)
    poses = compose(np.array([10.0, 10.0, 0.3]), rng.normal(0, (0.3, 0.3, 0.1), (count, 3)))
    likelihood = build(SENSORS[name], [Source({"beams": beams}, "bench")])[0].on(fields, threads=threads)
    motion, step = DifferentialDrive(), np.array([0.2, 0.0, 0.05])
    weights = normalised(likelihood.log_likelihood(poses, scan))
    phases: dict[str, Callable[[], object]] = {
        "predict": lambda: motion.sample(rng, poses, step),
        "reweight": lambda: normalised(likelihood.log_likelihood(poses, scan)),
        "resample": lambda: poses[systematic(rng, weights, count)],
    }
    if numpy_oracle and name == "likelihood_field":
        settings = LikelihoodField(beams=beams)
        phases["numpy"] = lambda: normalised(numpy_log_likelihood(settings, fields, poses, scan))
    # the phases take turns, so that a slow spell of the machine hits all of them
    times: dict[str, list[float]] = {phase: [] for phase in phases}
    for phase, run in phases.items():
        run()
        for _ in range(3 if phase == "numpy" else 0):
            run()
    for i in range(ROUNDS):
        for phase, run in phases.items():
            if phase == "numpy" and i >= 8:
                continue
            began = time.perf_counter_ns()
            run()
            times[phase].append((time.perf_counter_ns() - began) / 1e6)
    predict, reweight, resample = (float(np.median(times[p])) for p in ("predict", "reweight", "resample"))
    low, high = np.percentile(times["reweight"], [5, 95])
    return UpdateTime(
        sensor=name,
        particles=count,
        beams=beams,
        cells=fields.shape[0],
        threads=threads,
        predict_ms=predict,
        reweight_ms=reweight,
        resample_ms=resample,
        total_ms=predict + reweight + resample,
        ns_per_lookup=1e6 * reweight / (count * beams),
        numpy_ratio=float(np.median(times["numpy"])) / reweight if "numpy" in times else None,
        spread=float(high / low),
    )


def bench_scene(cells: int) -> FieldSet:
    """A square of rooms, cells of 5 cm: 400 cells are 20 m."""
    import cv2

    occupied = np.zeros((cells, cells), np.uint8)
    for at in range(0, cells, 100):
        occupied[at : at + 2, :] = occupied[:, at : at + 2] = 1
        occupied[at + 40 : at + 58, :] = occupied[at + 40 : at + 58, :] * 0
    occupied[-2:, :] = occupied[:, -2:] = 1
    away = cv2.distanceTransform(1 - occupied, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * np.float32(0.05)
    return FieldSet({"all": away.astype(np.float32)}, occupied == 0, 0.05, np.zeros(3), "bench scene")


def _scan(beams: int) -> LabelledScan:
    rng = np.random.default_rng(1)
    bearings = np.linspace(-2.3, 2.3, beams)
    ranges = rng.uniform(1.0, 8.0, beams)
    xyz = np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings), np.zeros(beams)]).astype(np.float32)
    points = Points(0, xyz, ranges.astype(np.float32), np.arange(beams), np.zeros(2), 25.0, np.zeros(0, np.float32))
    return LabelledScan(points, np.ones(beams, dtype=np.float32))


def time_pipeline(log: Path, map_path: Path | None, init: str | None) -> dict[str, float]:
    """Seconds of a whole run by phase: opening, reading and decoding, filtering, writing, drawing the report."""
    import tempfile

    from wallkit.evaluate.resources import begin, usage_since
    from wallkit.pipelines.config import load_config
    from wallkit.pipelines.localize import Request, prepare
    from wallkit.pipelines.seeds import run_seed

    mark = begin()
    loaded = load_config(None)
    began = time.perf_counter()
    prepared = prepare(Request((log,), map_path, init=init), loaded.config)
    opened = time.perf_counter() - began
    with tempfile.TemporaryDirectory() as folder:
        run, _, evaluation = run_seed(prepared, loaded, Path(folder), mark=mark)
    usage = {key: value.value or 0.0 for key, value in usage_since(mark).items()}
    scans = evaluation.metrics["scans"].value or 0.0
    return {
        "open": opened,
        **run.timers.seconds,
        "whole": usage["wall_s"],
        "scans": scans,
        "peak_memory_mb": usage["peak_memory_mb"],
    }
