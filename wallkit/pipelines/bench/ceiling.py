"""The ceiling's models on simulated logs: how often they converge, how soon, how well, and whether they come back."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallkit.core.ceiling import CeilingMap, CeilingSight
from wallkit.core.config import build, source_from_words
from wallkit.core.geometry import compose, interpolate_poses, relative, wrap_angle
from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.evaluate.tum import read_tum
from wallkit.localize.ceiling_eye import fields_of_ceiling
from wallkit.localize.ceiling_filter import SEED, ceiling_localizer
from wallkit.localize.settings import LocalizeSettings
from wallkit.logs.reader import open_log
from wallkit.logs.sync import SyncConfig
from wallkit.maps.ceiling.files import read_ceiling
from wallkit.pipelines.ceiling.camera import CameraWords, colours_of, find_up_camera, frames_of

NEAR_M, NEAR_RAD = 0.5, np.deg2rad(10.0)
# converged: near the truth from some moment on to the end, for at least so long
_HELD_S = 10.0

MODELS: dict[str, tuple[str, ...]] = {
    "seed": tuple(word.removeprefix("localize.") for word in SEED),
    "centre": ("ceiling.model=centre", "ceiling.model.temperature=0.05", "update_distance_m=0.1"),
    "histogram": ("ceiling.model=histogram", "update_distance_m=0.1"),
    "gradient": ("ceiling.model=gradient", "update_distance_m=0.1"),
    "patch": ("ceiling.model=patch", "update_distance_m=0.1"),
}


@dataclass(frozen=True, eq=False)
class World:
    """A simulated log, ready to be localized in.

    Attributes:
        sights: its views, by the sigma [m] that they are blurred with.
        truth: (T, 3) where the robot truly was at each.
    """

    name: str
    ceiling: CeilingMap
    sights: Mapping[float, tuple[CeilingSight, ...]]
    truth: Float64Array

    @property
    def stamps_ns(self) -> Int64Array:
        """(T,) of the views."""
        return np.array([sight.stamp_ns for sight in next(iter(self.sights.values()))])


@dataclass(frozen=True, eq=False)
class Outcome:
    """One run, judged.

    Attributes:
        first: updates until it was near the truth for a second; NaN if it never was.
        updates: until it was near for good, NaN unless it converged. error_m, error_deg: medians after that.
        lost: how often it was near for a second and then was not. back: updates until each loss was made good,
            of those that were.
        seconds: CPU time of an update. errors: (T, 2) [m, rad] over time.
    """

    converged: bool
    first: float
    updates: float
    error_m: float
    error_deg: float
    lost: int
    back: tuple[int, ...]
    seconds: float
    errors: Float64Array

    @property
    def is_near(self) -> BoolArray:
        """(T,) whether it was near the truth."""
        return np.asarray((self.errors[:, 0] < NEAR_M) & (self.errors[:, 1] < NEAR_RAD))


@dataclass(frozen=True)
class Task:
    """A configuration to run: a world's name and what is done in it; `end_s` from the first view on."""

    world: str
    model: str
    resampler: str
    init: str
    story: str
    end_s: float | None
    seeds: int

    @property
    def settings(self) -> LocalizeSettings:
        """A model's own resampling is called `own`; another resampler draws at every update."""
        words = list(MODELS[self.model])
        words += [] if self.resampler == "own" else [f"resampler={self.resampler}", "resample_when=always"]
        return build(LocalizeSettings, [source_from_words(words)])[0]


@dataclass(frozen=True)
class Row(Task):
    """What a task came to: medians over those that have the number, `lost` and `back` of all of them.

    Attributes:
        came: runs that were near the truth for a second. share_near: of all views of all runs, those at which it was near.
        back: losses made good. back_updates: after how many.
    """

    converged: int
    came: int
    first: float
    updates: float
    error_m: float
    error_deg: float
    share_near: float
    lost: int
    back: int
    back_updates: float
    ms_per_update: float


def read_world(
    folder: Path, models: Sequence[str], *, ceiling: Path | None = None, end_s: float | None = None
) -> World:
    """The log of `wallkit simulate log` in a folder, with its own ceiling or another; decoded once for all models.

    Raises:
        WallkitError: it is none.
    """
    known = read_ceiling(ceiling or folder / "ceiling.yaml")
    log = open_log([folder / "log.mcap"])
    up = find_up_camera(log, CameraWords())
    seen = [Task("", model, "own", "", "", None, 0).settings.ceiling for model in models]
    eyes = {settings.smooth_m: up.eye(settings, known.height_m) for settings in seen}
    sights: dict[float, list[CeilingSight]] = {smooth_m: [] for smooth_m in eyes}
    end_ns = None if end_s is None else log.first(up.channel.topic)[0].stamp_ns + round(end_s * 1e9)
    for frame in frames_of(log, up, SyncConfig(), window_ns=(None, end_ns)):
        pixels = colours_of(frame.image)
        for smooth_m, eye in eyes.items():
            sights[smooth_m].append(CeilingSight(eye.view(frame.stamp_ns, pixels), frame.odometry, frame.gap_s))
    world = World(folder.name, known, {key: tuple(value) for key, value in sights.items()}, np.zeros((0, 3)))
    track = read_tum(folder / "truth.tum")
    return replace(world, truth=interpolate_poses(track.stamps_ns, track.poses, world.stamps_ns))


def kidnapped(world: World) -> World:
    """The same log with its middle third cut out: odometry says that the robot stood still, and it is elsewhere."""
    n = len(world.truth)

    def cut(sights: tuple[CeilingSight, ...]) -> tuple[CeilingSight, ...]:
        before, after = sights[: n // 3], sights[2 * n // 3 :]
        last, first = before[-1].odometry, after[0].odometry
        return before + tuple(replace(s, odometry=compose(last, relative(first, s.odometry))) for s in after)

    truth = np.concatenate([world.truth[: n // 3], world.truth[2 * n // 3 :]])
    return replace(world, sights={key: cut(value) for key, value in world.sights.items()}, truth=truth)


def study(
    tasks: Sequence[Task], world: World, progress: Callable[[str], None] = lambda _: None
) -> Iterator[tuple[Row, list[Outcome]]]:
    """A row for every task in a world, and the runs it is of."""
    for task in tasks:
        told = kidnapped(world) if task.story == "kidnapped" else world
        done = [run(told, task.settings, seed, task.init) for seed in range(task.seeds)]
        row = summary(task, done)
        progress(f"{row.world} {row.model} {row.resampler} {row.init} {row.story}: {row.converged} of {row.seeds}")
        yield row, done


def run(world: World, settings: LocalizeSettings, seed: int, init: str) -> Outcome:
    """One run of the ceiling's filter over a world's views."""
    tracker = ceiling_localizer(settings, fields_of_ceiling(world.ceiling), world.ceiling)
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    belief = tracker.start(rng, init)
    sights = world.sights[settings.ceiling.smooth_m]
    errors, updates = np.empty((len(sights), 2)), np.empty(len(sights), dtype=np.int64)
    began = time.process_time()
    for i, sight in enumerate(sights):
        belief = tracker.predict(rng, belief, sight.odometry)
        belief, _ = tracker.update(rng, tracker.look(belief, sight))
        off = belief.estimate().pose - world.truth[i]
        errors[i] = np.hypot(off[0], off[1]), abs(float(wrap_angle(off[2])))
        updates[i] = belief.updates
    return judged(world.stamps_ns, errors, updates, time.process_time() - began)


def judged(stamps_ns: Int64Array, errors: Float64Array, updates: Int64Array, seconds: float) -> Outcome:
    """What the errors (T, 2) [m, rad] of a run amount to.

    Args:
        updates: (T,) done by then. seconds: the run took.
    """
    near = (errors[:, 0] < NEAR_M) & (errors[:, 1] < NEAR_RAD)
    far = np.flatnonzero(~near)
    start = int(far[-1]) + 1 if len(far) else 0
    held_s = 0.0 if start >= len(near) else (stamps_ns[-1] - stamps_ns[start]) / 1e9
    second = max(1, round(1e9 / float(np.median(np.diff(stamps_ns)))))
    held = np.convolve(near, np.ones(second), "full")[: len(near)] >= second
    came = np.flatnonzero(held)
    lost = np.flatnonzero(held[:-1] & ~near[1:]) + 1
    returns = [came[came > at][0] for at in lost if came[-1] > at] if len(came) else []
    converged = held_s >= _HELD_S
    rest = errors[start:] if converged else np.full((1, 2), np.nan)
    return Outcome(
        bool(converged),
        float(updates[came[0]]) if len(came) else float("nan"),
        float(updates[start]) if converged else float("nan"),
        float(np.median(rest[:, 0])),
        float(np.rad2deg(np.median(rest[:, 1]))),
        len(lost),
        tuple(int(updates[to] - updates[at]) for at, to in zip(lost, returns, strict=False)),
        seconds / max(int(updates[-1]), 1),
        errors,
    )


def summary(task: Task, done: Sequence[Outcome]) -> Row:
    """The row of a task's runs."""

    def middle(values: Sequence[float]) -> float:
        known = [value for value in values if not np.isnan(value)]
        return float(np.median(known)) if known else float("nan")

    back = [updates for one in done for updates in one.back]
    return Row(
        **vars(task),
        converged=sum(one.converged for one in done),
        came=sum(not np.isnan(one.first) for one in done),
        first=middle([one.first for one in done]),
        updates=middle([one.updates for one in done]),
        error_m=middle([one.error_m for one in done]),
        error_deg=middle([one.error_deg for one in done]),
        share_near=float(np.mean([one.is_near.mean() for one in done])),
        lost=sum(one.lost for one in done),
        back=len(back),
        back_updates=middle([float(updates) for updates in back]),
        ms_per_update=1e3 * middle([one.seconds for one in done]),
    )
