"""The surfaces of a map at the LiDAR's height -> how well a robot can tell where it is in it.

A pose is *ambiguous* when another pose, more than 0.5 m or 30 deg away, explains at least 90 % of its beams within 5 cm:
nothing the LiDAR sees there tells the two apart. `settle` says what explained means, `rivals` how the other poses are
found. Scans are what the LiDAR would measure without noise, so the score is the map's, not the sensor's.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.maps.score.rivals import CONTINUUM, Rivals, find_rivals
from wallkit.maps.score.seen import Seen, look_from
from wallkit.maps.score.settle import Ground
from wallkit.maps.score.world import Scene, ScoreSettings, World, poses_on_grid, with_label, without_labels
from wallkit.maps.sight import Sighting

# poses that are asked again for every class that could be a landmark
_ASKED_AGAIN = 100
# poses that are judged between two looks at the share
_BATCH = 48
# with so few poses, filling a field costs more than it saves
_FEW_CELLS = 1_000_000
# standard deviations between a share and a limit; more than one test needs, because it is looked at up to nine times
_CERTAIN = 3.5


@dataclass(frozen=True, slots=True, eq=False)
class Ambiguity:
    """Which poses have rivals.

    Attributes:
        explained: (N,) share of a pose's beams that its rival explains; 0 without one.
        rivals: (N, 3) that rival, NaN without one.
        modes: (N,) poses that explain the scan, itself included, those no rivals of each other counted as one; CONTINUUM
            where it fits all along a line. More than MOST_RIVALS are not counted.
    """

    explained: Float64Array
    rivals: Float64Array
    modes: Int64Array

    @property
    def is_ambiguous(self) -> BoolArray:
        """(N,) whether a pose has a rival."""
        return self.explained > 0

    @property
    def share(self) -> float:
        """Share of the poses that are ambiguous."""
        return float(self.is_ambiguous.mean())

    def is_surely(self, limit: float) -> int:
        """1 where the share is surely above a limit, -1 where surely below, 0 where these poses do not tell.

        By the score test of Wilson (1927), at _CERTAIN standard deviations.
        """
        away = self.share - limit
        return int(np.sign(away)) if abs(away) > _CERTAIN * math.sqrt(limit * (1 - limit) / len(self.modes)) else 0

    @property
    def mode_counts(self) -> dict[int, int]:
        """Number of poses by number of modes, most frequent first."""
        return dict(Counter(self.modes.tolist()).most_common())

    @property
    def typical_modes(self) -> int:
        """The most frequent number of modes."""
        return next(iter(self.mode_counts))

    def worst(self, poses: Float64Array, count: int = 5, *, apart_m: float = 1.0) -> Int64Array:
        """Indices of the most ambiguous of the poses (N, 3), worst first, none nearer than `apart_m` to a worse one."""
        modes = np.where(self.modes == CONTINUUM, np.iinfo(np.int64).max, self.modes)
        order = np.lexsort((-self.explained, -modes))
        chosen: list[int] = []
        for index in order[self.is_ambiguous[order]].tolist():
            away = np.hypot(*(poses[chosen, :2] - poses[index, :2]).T)
            if np.all(away >= apart_m):
                chosen.append(index)
            if len(chosen) == count:
                break
        return np.array(chosen, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Localisability:
    """How well a robot can tell where it is.

    Attributes:
        poses: (N, 3) that were judged [m, m, rad], on a grid of side cell_m.
        plain: by ranges alone. labelled: when each return also tells the class it came from.
        landmarks: per class, the share of ambiguous poses that would be left if it alone were recognised.
        seen: from the same poses.
    """

    settings: ScoreSettings
    poses: Float64Array
    cell_m: float
    plain: Ambiguity
    labelled: Ambiguity
    landmarks: dict[str, float]
    seen: Seen


def score(world: World, settings: ScoreSettings | None = None, *, seed: int = 0) -> Localisability:
    """How well a robot can tell where it is in a map.

    Raises:
        MapError: nothing returns a beam at this height, or the robot fits nowhere.
    """
    wanted = settings or ScoreSettings()
    scene = Scene.of(world, wanted)
    poses, cell_m = poses_on_grid(world, scene.floor, wanted.poses, seed=seed)
    scans = scene.scans(poses)
    ground = scene.ground(scans)
    plain = _ambiguity(scene, without_labels(ground), poses, scans, np.full(scans.segments.shape, -1, dtype=np.int64))
    labels = np.where(scans.segments >= 0, scene.labels[scans.segments], -1)
    rivalled = np.flatnonzero(plain.is_ambiguous)
    labelled, landmarks = plain, {}
    if len(scene.label_names) > 1 and len(rivalled):
        again = _ambiguity(scene, ground, poses[rivalled], scans, labels[rivalled], of=rivalled)
        labelled = _spread(again, rivalled, len(poses))
        few = rivalled[np.unique(np.linspace(0, len(rivalled) - 1, _ASKED_AGAIN).astype(np.int64))]
        for label, name in enumerate(scene.label_names):
            if name != "wall":
                told = np.where(labels[few] < 0, -1, labels[few] == label).astype(np.int64)
                left = _ambiguity(scene, with_label(ground, label), poses[few], scans, told, of=few)
                landmarks[name] = left.share * plain.share
    return Localisability(wanted, poses, cell_m, plain, labelled, landmarks, look_from(world, poses, wanted))


def ambiguity_of(
    world: World, poses: Float64Array, settings: ScoreSettings, *, limits: tuple[float, ...]
) -> tuple[Float64Array, Ambiguity]:
    """Ambiguity by ranges alone at some of the poses (N, 3): (those judged, theirs).

    A sequential test: batches in the order given are judged until the share is surely on one side of each limit.

    Raises:
        MapError: see score.
    """
    scene = Scene.of(world, settings)
    scans = scene.scans(poses)
    ground = without_labels(scene.ground(scans, most_cells=_FEW_CELLS))
    any_class = np.full(scans.segments.shape, -1, dtype=np.int64)
    judged = Ambiguity(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64))
    for first in range(0, len(poses), _BATCH):
        batch = np.arange(first, min(first + _BATCH, len(poses)))
        more = _ambiguity(scene, ground, poses[batch], scans, any_class[batch], of=batch)
        judged = Ambiguity(
            np.concatenate([judged.explained, more.explained]),
            np.vstack([judged.rivals, more.rivals]),
            np.concatenate([judged.modes, more.modes]),
        )
        if all(judged.is_surely(limit) for limit in limits):
            break
    return poses[: len(judged.modes)], judged


# ------------------------------------------------------------------------------------------------ details


def _ambiguity(
    scene: Scene,
    ground: Ground,
    poses: Float64Array,
    scans: Sighting,
    labels: Int64Array,
    *,
    of: Int64Array | None = None,
) -> Ambiguity:
    """Of poses whose scans are all of `scans`, or those at the indices `of`."""
    ranges_m = scans.ranges_m if of is None else scans.ranges_m[of]
    rivals: Rivals = find_rivals(ground, poses, scene.bearings, ranges_m, labels)
    return Ambiguity(rivals.explained / scene.settings.beams, rivals.best, rivals.modes)


def _spread(some: Ambiguity, at: Int64Array, count: int) -> Ambiguity:
    """The ambiguity of `count` poses of which only those at some indices can have rivals."""
    explained, rivals, modes = np.zeros(count), np.full((count, 3), np.nan), np.ones(count, dtype=np.int64)
    explained[at], rivals[at], modes[at] = some.explained, some.rivals, some.modes
    return Ambiguity(explained, rivals, modes)
