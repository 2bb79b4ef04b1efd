"""Filtered scans, one after the other -> what the point filters left over the whole run, and a few moments to draw."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallkit.core.results import Value
from wallkit.core.types import Float32Array, Float64Array, Frame, Int64Array, LabelledScan, UInt8Array, View
from wallkit.pipelines.cameras import Camera
from wallkit.pipelines.sight import Glance, Labelled, Sight
from wallkit.points.filters import PointsSettings
from wallkit.points.kept import kept_of
from wallkit.points.labels import PASSED_OVER
from wallkit.points.look import project_frame

# what a return counts as that no camera labelled
UNSEEN = "not seen"


@dataclass(frozen=True)
class Filtering:
    """What the point filters left over a run.

    Attributes:
        filters, model: by name. cameras: what they are, for run.json.
        updates: of the filter. few, one_sided: those with too few kept returns, or kept returns that hold one direction.
        returns, kept: over all updates. passed_over: returns that were not looked up, beside those.
        by_class: class -> (returns, kept).
        images: looked at for updates. without_image: updates that no image could be used for.
        silent: (camera, why it said nothing) -> updates.
        segment_ms: mean of decoding and segmenting per update; None without a camera.
        notes: what else a reader of the numbers should know, a sentence each.
    """

    filters: tuple[str, ...]
    model: str
    cameras: tuple[dict[str, Any], ...]
    updates: int
    few: int
    one_sided: int
    returns: int
    kept: int
    passed_over: int
    by_class: dict[str, tuple[int, int]]
    images: int
    without_image: int
    silent: dict[tuple[str, str], int]
    segment_ms: float | None
    notes: tuple[str, ...] = ()

    @property
    def unseen(self) -> int:
        """Returns that no camera labelled."""
        return self.by_class.get(UNSEEN, (0, 0))[0]

    def values(self) -> dict[str, Value]:
        """The numbers for metrics.json; without a camera fewer."""
        of_returns = 1 / max(self.returns, 1)
        found = [
            Value(
                "kept_share", self.kept * of_returns, "share", "share of the returns that the point filters keep", ""
            ),
            Value("passed_over", float(self.passed_over), "returns", "returns of updates that were not looked up"),
            Value("few_kept", float(self.few), "updates", "updates with too few kept returns (points.kept.least)"),
            Value("one_sided", float(self.one_sided), "updates", "updates whose kept returns hold one direction only"),
        ]
        if self.segment_ms is not None:
            found += [
                Value(
                    "unseen_share", self.unseen * of_returns, "share", "share of the returns that no camera labels", ""
                ),
                Value(
                    "updates_without_image",
                    float(self.without_image),
                    "updates",
                    "updates that no image could be used for",
                ),
                Value("segment_mean_ms", self.segment_ms, "ms", "mean time of decoding and segmenting per update"),
            ]
        return {value.key: value for value in found}

    def lines(self) -> list[str]:
        """What a person should know, a sentence each; the first says what was kept."""
        said = f"{', '.join(self.filters)}: {self.kept / max(self.returns, 1):.0%} of the returns kept"
        if self.segment_ms is not None:
            said += f", {self.unseen / max(self.returns, 1):.0%} seen by no camera"
        found = [said]
        if self.passed_over:
            share, a_scan = self.passed_over / (self.passed_over + self.returns), self.returns / self.updates
            found.append(
                f"{share:.0%} of all returns were passed over: {a_scan:.0f} of a scan are looked up (points.look.returns)"
            )
        if self.few:
            found.append(f"too few returns were kept at {self.few} of {self.updates} updates")
        if self.one_sided:
            found.append(f"the kept returns hold one direction only at {self.one_sided} of {self.updates} updates")
        found += [f"{camera}: {why} at {n} of {self.updates} updates" for (camera, why), n in self.silent.items()]
        return [*found, *self.notes]

    def document(self) -> dict[str, Any]:
        """For run.json."""
        classes = {name: {"returns": n, "kept": k} for name, (n, k) in sorted(self.by_class.items())}
        return {
            "filters": list(self.filters),
            "model": self.model,
            "cameras": list(self.cameras),
            "images": self.images,
            "classes": classes,
            "silent": [{"camera": camera, "why": why, "updates": n} for (camera, why), n in self.silent.items()],
            "said": self.lines(),
        }


# for the keys and definitions of its values
NO_FILTERING = Filtering((), "", (), 0, 0, 0, 0, 0, 0, {}, 0, 0, {}, 0.0)


@dataclass(frozen=True, eq=False)
class Moment:
    """One image to draw with what the filters made of it.

    Attributes:
        classes: names of `ids` (H, W) uint8 place in them, 255 for none.
        pixels: (K, 2) of the returns on the image that were looked up; weights: (K,).
        all_pixels: (N, 2) of those that were passed over too.
    """

    camera: Camera
    view: View
    stamp_ns: int
    classes: tuple[str, ...]
    ids: UInt8Array
    pixels: Float64Array
    weights: Float32Array
    all_pixels: Float64Array


class Watch:
    """Sees every update of a run.

    Args:
        moments: how many to keep; they are spread evenly over the updates that have an image.
    """

    def __init__(self, points: PointsSettings, sight: Sight | None, moments: int) -> None:
        self._points, self._sight, self._wanted = points, sight, moments
        self._returns: Counter[str] = Counter()
        self._kept: Counter[str] = Counter()
        self._silent: Counter[tuple[str, str]] = Counter()
        self._updates = self._few = self._one_sided = self._images = self._without_image = 0
        self._passed_over = 0
        self._cost_ms = 0.0
        self._moments: list[Moment] = []
        self._every, self._looked = 1, 0

    def add(self, frame: Frame, scan: LabelledScan, seen: Labelled | None, whole: Frame) -> None:
        """One update; `whole` is the frame with the returns that were passed over."""
        left = kept_of(scan, self._points.kept)
        self._updates += 1
        self._few += left.is_few
        self._one_sided += left.is_one_sided
        self._passed_over += scan.points.dropped.get(PASSED_OVER, 0)
        names = (*scan.classes, UNSEEN)
        labels: Int64Array = np.full(len(scan.weights), -1) if scan.labels is None else scan.labels
        # -1 is the last
        every = np.bincount(labels % len(names), minlength=len(names))
        kept = np.bincount(labels % len(names), scan.weights >= self._points.kept.weight, minlength=len(names))
        self._returns.update(dict(zip(names, every.tolist(), strict=True)))
        self._kept.update({name: int(n) for name, n in zip(names, kept, strict=True)})
        if seen is None:
            return
        self._cost_ms += seen.cost_ms
        self._without_image += seen.labels is None
        self._images += len(seen.glances)
        self._silent.update(seen.silent.items())
        if seen.glances and self._wanted:
            self._keep(whole, scan, seen.glances)

    def filtering(self) -> Filtering:
        """So far."""
        cameras = self._sight.cameras if self._sight else ()
        return Filtering(
            self._points.filters,
            self._sight.model if self._sight else "",
            tuple(_described(camera) for camera in cameras),
            self._updates,
            self._few,
            self._one_sided,
            self._returns.total(),
            self._kept.total(),
            self._passed_over,
            {name: (n, self._kept[name]) for name, n in self._returns.items() if n},
            self._images,
            self._without_image,
            dict(self._silent),
            self._cost_ms / max(self._updates, 1) if self._sight else None,
            self._notes(),
        )

    def _notes(self) -> tuple[str, ...]:
        if self._sight is None:
            return ()
        given_up = f"the LiDAR alone was used from then on: {self._sight.given_up}" if self._sight.given_up else ""
        return *((given_up,) if given_up else ()), *(self._sight.cache.lines() if self._sight.cache else ())

    def moments(self) -> tuple[Moment, ...]:
        """As many as are wanted, if there were as many."""
        if len(self._moments) <= self._wanted:
            return tuple(self._moments)
        chosen = np.linspace(0, len(self._moments) - 1, self._wanted).round().astype(int)
        return tuple(self._moments[i] for i in chosen)

    def _keep(self, whole: Frame, scan: LabelledScan, glances: tuple[Glance, ...]) -> None:
        """Every n-th glance, n doubling whenever twice the wanted number is reached."""
        for glance in glances:
            if self._looked % self._every == 0:
                self._moments.append(self._moment(whole, scan, glance))
            self._looked += 1
        if len(self._moments) >= 2 * self._wanted + 1:
            self._moments, self._every = self._moments[::2], 2 * self._every

    def _moment(self, whole: Frame, scan: LabelledScan, glance: Glance) -> Moment:
        assert self._sight is not None  # somebody glanced
        at = np.flatnonzero(glance.look.is_seen)
        roles = glance.segmentation.roles
        classes = tuple(dict.fromkeys(roles))
        place = np.array([*(classes.index(role) for role in roles), 255], dtype=np.uint8)
        ids = place[glance.segmentation.labels()]
        pixels = glance.look.projection.pixels[at]
        of_all, is_seen, _ = project_frame(
            glance.camera.calibration, whole, glance.view, self._sight.T_lidar_base, self._points.look
        )
        return Moment(
            glance.camera, glance.view, whole.stamp_ns, classes, ids, pixels, scan.weights[at], of_all.pixels[is_seen]
        )


def _described(camera: Camera) -> dict[str, Any]:
    """For run.json."""
    return {
        "name": camera.name,
        "topic": camera.topic,
        "picture_topic": camera.picture_topic,
        "calibration": str(camera.source),
        "verdict": camera.calibration.verdict,
        "notes": list(camera.notes),
    }
