"""Two answers to the same pictures -> how far they agree: things matched, masks, scores, roles and labels of points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wallkit.core.segmentation import BACKGROUND, Segmentation
from wallkit.core.types import BoolArray, Float64Array
from wallkit.segment.class_map import ClassMap
from wallkit.segment.detections import Detections
from wallkit.segment.instances import Instances
from wallkit.segment.letterbox import Letterbox

# masks of one class that overlap by more than this IoU are the same thing
SAME = 0.5
# of the picture; less of a class is no thing of a semantic model
_LEAST_SHARE = 0.002


@dataclass(frozen=True, eq=False)
class Thing:
    """One thing in a picture: class, score, (4,) edges of its box [px of the image; NaN without one], (H, W) mask."""

    name: str
    score: float
    box: Float64Array
    mask: BoolArray


@dataclass(frozen=True, eq=False)
class Answer:
    """What one side says of a picture."""

    segmentation: Segmentation
    things: tuple[Thing, ...]


@dataclass(eq=False)
class Agreement:
    """Of two sides, A and B, over all pictures.

    Attributes:
        of_a, of_b: things. ious, drifts: mask IoU and score of B less that of A, of each matched pair.
        box_px: mean distance of the edges of their boxes. worst: name of the picture that agrees least, and its share.
        inside: role -> pixels of both, of either. moved: (role by A, role by B) -> points whose role changes.
        points: that were labelled.
    """

    of_a: int = 0
    of_b: int = 0
    ious: list[float] = field(default_factory=list)
    drifts: list[float] = field(default_factory=list)
    box_px: list[float] = field(default_factory=list)
    worst: tuple[str, float] = ("", 2.0)
    inside: dict[str, tuple[int, int]] = field(default_factory=dict)
    moved: Counter[tuple[str, str]] = field(default_factory=Counter)
    points: int = 0

    @property
    def matched(self) -> int:
        """Things that both sides see."""
        return len(self.ious)

    @property
    def share(self) -> float:
        """Matched things over those of the side that has more; NaN where neither has any."""
        return self.matched / max(self.of_a, self.of_b) if max(self.of_a, self.of_b) else float("nan")

    @property
    def quality(self) -> float:
        """Mask IoU summed over the matched things, over those of the side that has more; NaN where neither has any."""
        return sum(self.ious) / max(self.of_a, self.of_b) if max(self.of_a, self.of_b) else float("nan")

    def role_iou(self) -> dict[str, float]:
        """Role -> IoU of its pixels, pooled over the pictures."""
        return {role: both / either for role, (both, either) in sorted(self.inside.items()) if either}

    def add(self, name: str, a: Answer, b: Answer, points: Float64Array) -> None:
        """Count one more picture; `points` (K, 2) pixels are labelled by both."""
        pairs = matches(a.things, b.things)
        self.of_a += len(a.things)
        self.of_b += len(b.things)
        for i, j, iou in pairs:
            self.ious.append(iou)
            self.drifts.append(b.things[j].score - a.things[i].score)
            self.box_px.append(float(np.abs(b.things[j].box - a.things[i].box).mean()))
        most = max(len(a.things), len(b.things))
        share = sum(iou for _, _, iou in pairs) / most if most else 1.0
        if share < self.worst[1]:
            self.worst = (name, share)
        self._add_roles(a.segmentation, b.segmentation)
        self._add_points(a.segmentation, b.segmentation, points)

    def _add_roles(self, a: Segmentation, b: Segmentation) -> None:
        for role in {*a.roles, *b.roles} - {BACKGROUND, "other"}:
            first, second = a.mask({role}), b.mask({role})
            both, either = self.inside.get(role, (0, 0))
            self.inside[role] = both + int((first & second).sum()), either + int((first | second).sum())

    def _add_points(self, a: Segmentation, b: Segmentation, points: Float64Array) -> None:
        first, second = (np.array([*s.roles, BACKGROUND])[s.classes_at(points)[0]] for s in (a, b))
        self.points += len(points)
        changed = first != second
        self.moved.update(zip(first[changed].tolist(), second[changed].tolist(), strict=True))


def agreement(answers: Iterable[tuple[str, Answer, Answer, Float64Array]]) -> Agreement:
    """Of (picture's name, answer of A, answer of B, pixels of points)."""
    total = Agreement()
    for name, a, b, points in answers:
        total.add(name, a, b, points)
    return total


def matches(a: Sequence[Thing], b: Sequence[Thing]) -> list[tuple[int, int, float]]:
    """(place in a, place in b, mask IoU) of things of one class, each at most once, the best pairs first."""
    pairs = [(iou, i, j) for i, one in enumerate(a) for j, other in enumerate(b) if (iou := _iou(one, other)) > SAME]
    taken_a: set[int] = set()
    taken_b: set[int] = set()
    found = []
    for iou, i, j in sorted(pairs, reverse=True):
        if i not in taken_a and j not in taken_b:
            found.append((i, j, iou))
            taken_a.add(i)
            taken_b.add(j)
    return found


def answer_of_net(found: Instances) -> Answer:
    """What things look like in the network's input, each pixel of the image taking the nearest there.

    That is comparable with a program whose masks are of the input's size.
    """
    things = tuple(_things(found, masks_of_net=True))
    return painted(things, found.names, found.roles, found.shape)


def answer_of(segmentation: Segmentation) -> Answer:
    """What a segmentation says; things of a semantic model are its classes."""
    if isinstance(segmentation, Instances):
        return Answer(segmentation, tuple(_things(segmentation, masks_of_net=False)))
    labels, things = segmentation.labels(), []
    for number, (name, role) in enumerate(zip(segmentation.names, segmentation.roles, strict=True)):
        mask = labels == number
        if role != BACKGROUND and mask.mean() > _LEAST_SHARE:
            things.append(Thing(name, _mean_confidence(segmentation, mask), np.full(4, np.nan), mask))
    return Answer(segmentation, tuple(things))


def painted(things: Sequence[Thing], names: tuple[str, ...], roles: tuple[str, ...], shape: tuple[int, int]) -> Answer:
    """Things as an answer; where their masks overlap the higher score counts. The last name is the background's."""
    ids = np.full(shape, len(names) - 1, dtype=np.int64)
    best = np.zeros(shape, dtype=np.float32)
    for thing in things:
        is_better = thing.mask & (thing.score > best)
        ids[is_better], best[is_better] = names.index(thing.name), thing.score
    return Answer(ClassMap(ids, names, roles), tuple(things))


def with_masks(found: Instances) -> Instances:
    """Without the things that have no pixel in the network's input; Ultralytics leaves them out too."""
    d, kept = found.detections, found.masks(of_net=True).any(axis=(1, 2))
    return replace(found, detections=Detections(d.boxes[kept], d.scores[kept], d.labels[kept], d.coefficients[kept]))


def image_mask(mask: BoolArray, frame: Letterbox) -> BoolArray:
    """(H, W) a mask of the network's input as the image's pixels see it: each takes the nearest."""
    height, width = frame.image
    columns = frame.net_from_image(np.stack([np.arange(width), np.zeros(width)], axis=1))[:, 0]
    rows = frame.net_from_image(np.stack([np.zeros(height), np.arange(height)], axis=1))[:, 1]
    near = [
        np.clip(np.rint(line), 0, side - 1).astype(int) for line, side in zip((rows, columns), mask.shape, strict=True)
    ]
    return np.asarray(mask[np.ix_(*near)])


# ------------------------------------------------------------------------------------------------ details


def _things(found: Instances, *, masks_of_net: bool) -> Iterable[Thing]:
    """Those of `with_masks`."""
    found = with_masks(found)
    masks = found.masks(of_net=masks_of_net)
    d, boxes = found.detections, found.frame.boxes_in_image(found.detections.boxes)
    for k in range(len(d)):
        mask = image_mask(masks[k], found.frame) if masks_of_net else masks[k]
        yield Thing(found.names[d.labels[k]], float(d.scores[k]), boxes[k], mask)


def _iou(one: Thing, other: Thing) -> float:
    if one.name != other.name:
        return 0.0
    either = int((one.mask | other.mask).sum())
    return int((one.mask & other.mask).sum()) / either if either else 0.0


def _mean_confidence(segmentation: Segmentation, mask: BoolArray) -> float:
    """Over some hundred pixels of a mask."""
    v, u = np.nonzero(mask)
    chosen = slice(None, None, max(1, len(u) // 500))
    _, sure = segmentation.classes_at(np.stack([u[chosen], v[chosen]], axis=1))
    return float(sure.mean())
