"""The ceiling's models on simulated logs: how often they converge, how soon, how well, and what an update costs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingSight
from wallkit.core.config import Source, build, source_from_words
from wallkit.core.geometry import compose, interpolate_poses, relative, wrap_angle
from wallkit.core.types import Float64Array
from wallkit.evaluate.tum import read_tum
from wallkit.localize.ceiling import CEILINGS
from wallkit.localize.ceiling_eye import fields_of_ceiling
from wallkit.localize.ceiling_filter import SEED, ceiling_localizer
from wallkit.localize.settings import LocalizeSettings
from wallkit.logs.reader import open_log
from wallkit.logs.sync import SyncConfig
from wallkit.maps.ceiling.files import read_ceiling
from wallkit.pipelines.ceiling.camera import CameraWords, find_up_camera, sights_of

NEAR_M, NEAR_RAD = 0.5, np.deg2rad(10.0)
# converged: near the truth from some moment on to the end, for at least so long
_HELD_S = 10.0

MODELS: dict[str, tuple[str, ...]] = {
    "seed": SEED,
    "centre": ("ceiling.model=centre", "ceiling.model.temperature=0.05", "update_distance_m=0.1"),
    "histogram": ("ceiling.model=histogram", "update_distance_m=0.1"),
    "gradient": ("ceiling.model=gradient", "update_distance_m=0.1"),
    "patch": ("ceiling.model=patch", "update_distance_m=0.1"),
}


@dataclass(frozen=True, eq=False)
class World:
    """A simulated log, ready to be localized in: its views, where the robot truly was, and the ceiling."""

    name: str
    ceiling: CeilingMap
    sights: tuple[CeilingSight, ...]
    truth: Float64Array


@dataclass(frozen=True)
class Outcome:
    """One run: whether it converged, after how many updates, its errors once it had, and (x, y) error over time."""

    converged: bool
    updates: int
    error_m: float
    error_deg: float
    seconds: float
    lost_again: int


@dataclass(frozen=True)
class Row:
    """Runs of one configuration in one world."""

    world: str
    model: str
    resampler: str
    init: str
    story: str
    seeds: int
    converged: int
    updates: float
    error_m: float
    error_deg: float
    lost_again: int
    ms_per_update: float


def read_world(folder: Path, ceiling: Path | None = None) -> World:
    """The log of `wallkit simulate log` in a folder, with its own ceiling or another.

    Raises:
        WallkitError: it is none.
    """
    settings = LocalizeSettings().ceiling
    known = read_ceiling(ceiling or folder / "ceiling.yaml")
    log = open_log([folder / "log.mcap"])
    up = find_up_camera(log, CameraWords())
    sights = tuple(sights_of(log, up, up.eye(settings, known.height_m), SyncConfig()))
    track = read_tum(folder / "truth.tum")
    truth = interpolate_poses(track.stamps_ns, track.poses, [sight.stamp_ns for sight in sights])
    return World(folder.name, known, sights, truth)


def study(
    worlds: Sequence[World],
    seeds: int,
    *,
    models: Sequence[str],
    resamplers: Sequence[str],
    inits: Sequence[str],
    story: str = "drive",
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[Row]:
    """A row for every world, model, resampler and initialisation; a model's own resampler is called `own`."""
    for world in worlds:
        told = kidnapped(world) if story == "kidnapped" else world
        for model in models:
            for resampler in resamplers:
                for init in inits:
                    words = [word.removeprefix("localize.") for word in MODELS[model]]
                    words += [] if resampler == "own" else [f"resampler={resampler}", "resample_when=always"]
                    settings = build(LocalizeSettings, [source_from_words(words)])[0]
                    done = [run(told, settings, seed, init) for seed in range(seeds)]
                    row = _row(told, model, resampler, init, story, done)
                    progress(f"{row.world} {model} {resampler} {init}: {row.converged} of {seeds}")
                    yield row


def run(world: World, settings: LocalizeSettings, seed: int, init: str) -> Outcome:
    """One run of the ceiling's filter over a world's views."""
    tracker = ceiling_localizer(settings, fields_of_ceiling(world.ceiling), world.ceiling)
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    belief = tracker.start(rng, init)
    errors, updates = np.empty((len(world.sights), 2)), np.empty(len(world.sights), dtype=np.int64)
    began = time.process_time()
    for i, sight in enumerate(world.sights):
        belief = tracker.predict(rng, belief, sight.odometry)
        belief, _ = tracker.update(rng, tracker.look(belief, sight))
        off = belief.estimate().pose - world.truth[i]
        errors[i] = np.hypot(off[0], off[1]), abs(float(wrap_angle(off[2])))
        updates[i] = belief.updates
    return judged(world, errors, updates, time.process_time() - began)


def judged(world: World, errors: Float64Array, updates: Any, seconds: float) -> Outcome:
    """What the errors (T, 2) [m, rad] of a run amount to."""
    near = (errors[:, 0] < NEAR_M) & (errors[:, 1] < NEAR_RAD)
    far = np.flatnonzero(~near)
    first = int(far[-1]) + 1 if len(far) else 0
    stamps = np.array([sight.stamp_ns for sight in world.sights])
    held_s = 0.0 if first >= len(near) else (stamps[-1] - stamps[first]) / 1e9
    # times it was near for a second, and then was not
    second = max(1, round(1e9 / float(np.median(np.diff(stamps)))))
    held = np.convolve(near, np.ones(second), "full")[: len(near)] >= second
    lost_again = int(((held[:-1]) & (~near[1:])).sum())
    converged = held_s >= _HELD_S
    rest = errors[first:] if converged else errors[-1:] * np.nan
    return Outcome(
        converged,
        int(updates[first]) if converged else int(updates[-1]),
        float(np.median(rest[:, 0])),
        float(np.rad2deg(np.median(rest[:, 1]))),
        seconds / max(int(updates[-1]), 1),
        lost_again,
    )


def kidnapped(world: World) -> World:
    """The same log with its middle third cut out: odometry says that the robot stood still, and it is elsewhere."""
    n = len(world.sights)
    before, after = world.sights[: n // 3], world.sights[2 * n // 3 :]
    last, first = before[-1].odometry, after[0].odometry
    moved = tuple(replace(sight, odometry=compose(last, relative(first, sight.odometry))) for sight in after)
    truth = np.concatenate([world.truth[: n // 3], world.truth[2 * n // 3 :]])
    return replace(world, name=world.name, sights=before + moved, truth=truth)


def _row(world: World, model: str, resampler: str, init: str, story: str, done: list[Outcome]) -> Row:
    good = [one for one in done if one.converged]

    def middle(values: list[float]) -> float:
        return float(np.median(values)) if values else float("nan")

    return Row(
        world.name,
        model,
        resampler,
        init,
        story,
        len(done),
        len(good),
        middle([one.updates for one in good]),
        middle([one.error_m for one in good]),
        middle([one.error_deg for one in good]),
        sum(one.lost_again for one in done),
        1e3 * middle([one.seconds for one in done]),
    )


# -------------------------------------------------------------------------------------------- one update


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
    from wallkit.core.ceiling import CeilingView

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
