"""A model and pictures -> how long each stage takes from an image to labelled LiDAR points, as CPU and as wall time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array
from wallkit.logs.images import pixels_from_image
from wallkit.pipelines.model.pictures import Picture
from wallkit.points.project import project
from wallkit.segment.model_file import Size
from wallkit.segment.onnx_segmenter import OnnxSegmenter, load_segmenter
from wallkit.segment.settings import SegmentSettings

T = TypeVar("T")
STAGES = ("decode", "prepare", "network", "read", "points")
_WARM = 3


@dataclass(frozen=True)
class Plan:
    """What is timed.

    Attributes:
        sizes: (height, width) of the input, for a model that leaves it open; none: its own.
        threads, spins: each combination. rounds: images for each. points: LiDAR points labelled in each image.
    """

    sizes: tuple[Size, ...] = ()
    threads: tuple[int, ...] = (1,)
    spins: tuple[bool, ...] = (False,)
    rounds: int = 30
    points: int = 720


@dataclass(frozen=True)
class ModelTime:
    """Medians over the rounds, in one process, for one way to run a model; ms.

    Attributes:
        cpu, wall: stage of STAGES -> ms; CPU time counts all threads.
        beside_cpu: prepare + read + points: all that is not the network, without decoding the picture.
        total_cpu, total_wall: of all stages but decoding. total_wall_p95: of its rounds.
        load: average of the machine over the last minute, before.
    """

    model: str
    size: Size
    threads: int
    is_spinning: bool
    cpu: dict[str, float]
    wall: dict[str, float]
    beside_cpu: float
    total_cpu: float
    total_wall: float
    total_wall_p95: float
    load: float


def time_model(path: Path, pictures: Sequence[Picture], settings: SegmentSettings, plan: Plan) -> Iterator[ModelTime]:
    """One row per combination of the plan.

    Raises:
        ModelError: the model cannot be used, or not at a size of the plan.
    """
    for size in plan.sizes or (None,):
        for threads in plan.threads:
            # one thread has nobody to wait for
            for spin in plan.spins if threads > 1 else plan.spins[:1]:
                chosen = replace(settings, threads=threads, spinning=spin and threads > 1)
                yield _time_one(load_segmenter(path, chosen, size=size), pictures, plan)


# ------------------------------------------------------------------------------------------------ details


@dataclass
class _Clock:
    """CPU and wall seconds of stages, one entry per round."""

    cpu: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})
    wall: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})

    def timed(self, stage: str, work: Callable[[], T]) -> T:
        wall, cpu = time.perf_counter(), time.process_time()
        done = work()
        self.cpu[stage].append(time.process_time() - cpu)
        self.wall[stage].append(time.perf_counter() - wall)
        return done


def _time_one(segmenter: OnnxSegmenter, pictures: Sequence[Picture], plan: Plan) -> ModelTime:
    load = os.getloadavg()[0]
    clock = _Clock()
    for number in range(_WARM + plan.rounds):
        if number == _WARM:
            clock = _Clock()
        picture = pictures[number % len(pictures)]
        calibration, points = _lidar(picture.rgb.shape[0], picture.rgb.shape[1], plan.points)
        _through(clock, segmenter, picture, calibration, points)
    cpu, wall = ({s: _median_ms(times[s]) for s in STAGES} for times in (clock.cpu, clock.wall))
    rounds = np.sum([clock.wall[stage] for stage in STAGES[1:]], axis=0) * 1e3
    return ModelTime(
        segmenter.model.path.name,
        segmenter.size,
        segmenter.settings.threads,
        segmenter.settings.spinning,
        cpu,
        wall,
        beside_cpu=cpu["prepare"] + cpu["read"] + cpu["points"],
        total_cpu=sum(cpu[stage] for stage in STAGES[1:]),
        total_wall=float(np.median(rounds)),
        total_wall_p95=float(np.percentile(rounds, 95)),
        load=load,
    )


def _through(
    clock: _Clock, segmenter: OnnxSegmenter, picture: Picture, calibration: Calibration, points: Float64Array
) -> None:
    """One image, and the LiDAR points of its moment."""
    rgb, encoded = picture.rgb, picture.encoded
    if encoded is not None:
        rgb = clock.timed("decode", lambda: pixels_from_image(encoded))
    frame = segmenter.frame(rgb)
    blob = clock.timed("prepare", lambda: segmenter.prepared(rgb, frame))
    answers = clock.timed("network", lambda: segmenter.answers(blob))
    found = clock.timed("read", lambda: segmenter.read(answers, frame))
    clock.timed("points", lambda: found.classes_at(project(calibration, points).pixels))


@cache
def _lidar(height: int, width: int, count: int) -> tuple[Calibration, Float64Array]:
    """A camera with a lens, and a planar LiDAR 0.3 m below it whose points at 1 to 8 m all fall into its picture.

    One for all pictures of a size, as on a robot: how far a lens can see is found once per camera, in half a millisecond.
    """
    K = np.array([[0.6 * width, 0, width / 2 - 0.5], [0, 0.6 * width, height / 2 - 0.5], [0, 0, 1]])
    camera = Camera("plumb_bob", width, height, K, np.array([-0.05, 0.01, 1e-4, -1e-4, 0.0]))
    T = np.array([[0, -1, 0, 0], [0, 0, -1, 0.3], [1, 0, 0, 0], [0, 0, 0, 1.0]])
    bearings = np.linspace(-0.6, 0.6, count)
    ranges = 4.5 + 3.5 * np.sin(9 * bearings)
    points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), np.zeros(count)], axis=1)
    return Calibration(camera, T), points


def _median_ms(seconds: list[float]) -> float:
    return float(np.median(seconds)) * 1e3 if seconds else float("nan")
