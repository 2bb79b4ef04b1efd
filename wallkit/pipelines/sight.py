"""Frames -> what the cameras' images show where each return landed: BeamLabels, each scan's but once for all seeds."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.geometry import invert_matrix
from wallkit.core.segmentation import Segmentation
from wallkit.core.types import BeamLabels, CameraImage, Float64Array, Frame, Int64Array, UInt8Array, View
from wallkit.errors import LogError, ModelError, WallkitError
from wallkit.logs.images import pixels_from_image
from wallkit.logs.reader import Log
from wallkit.logs.rig import Rig
from wallkit.pipelines.cameras import (
    ORACLE_MODEL,
    Camera,
    CameraRequest,
    find_cameras,
    too_seldom,
)
from wallkit.pipelines.segmenters import looks_of
from wallkit.points.filters import PointsSettings
from wallkit.points.labels import labels_by_beam
from wallkit.points.look import ClassesAt, Look, LookSettings, look, project_frame
from wallkit.points.outlines import classes_by_outlines
from wallkit.points.perturb import PerturbSettings, perturbed, without_dropped
from wallkit.segment.ahead import Seen, look_ahead
from wallkit.segment.cache import SegmentationCache
from wallkit.segment.default import DEFAULT, model_path
from wallkit.segment.grown import grown

if TYPE_CHECKING:
    from wallkit.segment.settings import SegmentSettings

# labels of so many scans are held for the next seed: some 250 MB at 1,080 beams
_SCANS_HELD = 4096
# so many scans may be without an image, or without anything that counts as kept, before that is an error
PATIENCE = 20
Sights = tuple[Seen, ...]
# its frame and stamp
_Image = tuple[str, int]
# why a camera says nothing about a scan
NOT_NEAR = "no image within logs.image_tolerance_s"
UNREADABLE = "its image cannot be read"
BY_RATE = "its image is skipped by segment.rate_hz"


@dataclass(frozen=True, eq=False)
class Glance:
    """One camera's image at one scan: its segmentation and what it says about the returns."""

    camera: Camera
    view: View
    segmentation: Segmentation
    look: Look


@dataclass(frozen=True, eq=False)
class Labelled:
    """What all cameras say about a scan.

    Attributes:
        labels: None where no camera says anything.
        glances: of each camera; not held for later seeds.
        silent: camera -> why it says nothing.
        cost_ms: of decoding and segmenting the images. owed_ms: what of it was spent ahead, or for an earlier seed.
    """

    labels: BeamLabels | None
    glances: tuple[Glance, ...] = ()
    silent: dict[str, str] = field(default_factory=dict)
    cost_ms: float = 0.0
    owed_ms: float = 0.0


@dataclass
class Sight:
    """The cameras of a run and the model that looks through them.

    Attributes:
        model: what the user called it. segment: an image -> its Segmentation.
        roles: what the model's classes count as, in its order; classes: these, each once: those of BeamLabels.
        T_lidar_base: (4, 4). kept: classes of which something must be seen. may_fall_back: see CameraRequest.
        holds_scans: whether labels are kept for the next seed; their cost is then counted again.
        rate_hz: images of each camera that are looked at in a second at most; 0: all that are needed.
        cache: segmentations of earlier runs; their cost is counted again. perturb: errors put in after that.
        given_up: why the cameras are not used any more, in this run; "" as long as they are. Only if `may_fall_back`.
    """

    cameras: tuple[Camera, ...]
    model: str
    segment: Callable[[CameraImage], Segmentation]
    roles: tuple[str, ...]
    T_lidar_base: Float64Array
    settings: LookSettings
    kept: tuple[str, ...] = ()
    may_fall_back: bool = False
    holds_scans: bool = False
    log_name: str = ""
    rate_hz: float = 0.0
    cache: SegmentationCache | None = None
    perturb: PerturbSettings = PerturbSettings()
    classes: tuple[str, ...] = field(init=False)
    _class_of: Int64Array = field(init=False)
    _costs_ms: dict[tuple[str, int], tuple[float, float]] = field(default_factory=dict)
    _scans: dict[int, Labelled] = field(default_factory=dict)
    _unreadable: set[_Image] = field(default_factory=set)
    _failed: dict[_Image, ModelError] = field(default_factory=dict)
    given_up: str = ""
    _asked: int = 0
    _silent: int = 0
    _without_kept: int = 0
    _whys: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.classes = tuple(dict.fromkeys(self.roles))
        self._class_of = np.array([*(self.classes.index(role) for role in self.roles), -1])

    @property
    def files(self) -> tuple[Path, ...]:
        """The calibrations, and the model unless the log is asked instead."""
        model = () if self.model == ORACLE_MODEL else (model_path(Path(self.model)),)
        return *(camera.source for camera in self.cameras), *model

    def ahead(self, frames: Iterable[Frame], is_needed: Callable[[Frame], bool]) -> Iterator[tuple[Frame, Sights]]:
        """Each frame of a run with what its images show, segmented in another thread ahead of the filter."""
        self.given_up, self._asked, self._silent, self._without_kept = "", 0, 0, 0
        self._whys.clear()
        kept = (without_dropped(frame, self.perturb) for frame in frames)

        def is_new(frame: Frame) -> bool:
            return is_needed(frame) and frame.stamp_ns not in self._scans and not self.given_up

        return look_ahead(kept, self._looked, rate_hz=self.rate_hz, is_needed=is_new)

    def labels_of(self, frame: Frame, sights: Sights = ()) -> Labelled:
        """What the cameras say about a frame's returns.

        Args:
            sights: of `ahead`. An image that is not among them is segmented here, unless it was skipped by rate.

        Raises:
            LogError: none of the first scans has an image. ModelError: the model fails, or none of the first images shows
                what is kept; if the LiDAR may stand in, `given_up` says so instead.
        """
        if self.given_up:
            return Labelled(None)
        found = self._scans.get(frame.stamp_ns)
        try:
            if found is None:
                found = self._labelled(frame, sights)
            self._check(found)
        except ModelError as error:
            if not self.may_fall_back:
                raise
            self.given_up = f"{reason_of(error)} (after {self._asked} updates)"
            return Labelled(None)
        if self.holds_scans and len(self._scans) < _SCANS_HELD:
            self._scans[frame.stamp_ns] = replace(found, glances=(), owed_ms=found.cost_ms)
        return found

    def _labelled(self, frame: Frame, sights: Sights) -> Labelled:
        glances, silent, cost_ms, owed_ms = [], dict[str, str](), 0.0, 0.0
        for camera in self.cameras:
            view = next((v for v in frame.views if v.topic == camera.topic), None)
            if view is None:
                silent[camera.name] = NOT_NEAR
                continue
            segmentation = next((s.segmentation for s in sights if s.topic == camera.topic), None)
            was_ahead = segmentation is not None
            if segmentation is None and not self.rate_hz:
                segmentation = self._looked(view.image)
            # an image that the scan before had too has cost nothing more
            spent_ms, here_ms = self._costs_ms.pop(_key(view.image), (0.0, 0.0))
            cost_ms, owed_ms = cost_ms + spent_ms, owed_ms + spent_ms - (0.0 if was_ahead else here_ms)
            if segmentation is None or not _fits(segmentation, camera):
                silent[camera.name] = self._why_silent(view.image, segmentation, camera)
                continue
            located = project_frame(camera.calibration, frame, view, self.T_lidar_base, self.settings)
            seen = look(located, self._classes_at(segmentation), self._class_of, len(self.classes))
            glances.append(Glance(camera, view, segmentation, seen))
        labels = labels_by_beam(frame, [glance.look for glance in glances], self.classes)
        return Labelled(labels, tuple(glances), silent, cost_ms, owed_ms)

    def _why_silent(self, image: CameraImage, segmentation: Segmentation | None, camera: Camera) -> str:
        """Why an image says nothing.

        Raises:
            ModelError: the model failed on it, in the other thread.
        """
        if segmentation is not None:
            (height, width), of = segmentation.shape, camera.calibration.camera
            return f"its image is {width} x {height}, not {of.width} x {of.height} as its calibration"
        if _key(image) in self._failed:
            raise self._failed[_key(image)]
        return UNREADABLE if _key(image) in self._unreadable else BY_RATE

    def _looked(self, image: CameraImage) -> Segmentation | None:
        """The image's segmentation, its cost remembered; None where it cannot be read."""
        began = time.perf_counter_ns()
        found, cost_ms = (None, 0.0) if self.cache is None else self.cache.find(image) or (None, 0.0)
        if found is None:
            found = self._segmented(image)
            cost_ms = (time.perf_counter_ns() - began) / 1e6
            if self.cache is not None and found is not None:
                self.cache.keep(image, found, cost_ms)
        if found is not None and self.perturb.mask_px:
            found = grown(found, self.perturb.mask_classes, self.perturb.mask_px)
        self._costs_ms[_key(image)] = cost_ms, (time.perf_counter_ns() - began) / 1e6
        return found

    def _segmented(self, image: CameraImage) -> Segmentation | None:
        try:
            return self.segment(image)
        except LogError:
            self._unreadable.add(_key(image))
        except ModelError as error:
            if not self.may_fall_back:
                raise
            self._failed[_key(image)] = error
        return None

    def _classes_at(self, segmentation: Segmentation) -> ClassesAt:
        if self.settings.lookup == "pixels":
            return segmentation.classes_at
        return classes_by_outlines(segmentation, self.settings.lookup)

    def _check(self, found: Labelled) -> None:
        """Say early what will not get better."""
        self._asked += 1
        self._silent += found.labels is None
        self._whys.update(found.silent.values() if found.labels is None else ())
        shown = set() if found.labels is None else {self.classes[c] for c in np.unique(found.labels.labels) if c >= 0}
        self._without_kept += not (set(self.kept) & shown)
        if self._asked != PATIENCE:
            return
        if self._silent == PATIENCE:
            # images may come later, and until then the LiDAR stands in
            if self.may_fall_back:
                return
            why = self._whys.most_common(1)[0][0]
            hint = "compare stamps in `wallkit log info`; --set logs.image_tolerance_s=0.2, or --fallback lidar"
            raise LogError(
                f"none of the first {PATIENCE} scans has an image that can be used: {why}",
                where=self.log_name,
                hint=hint if why == NOT_NEAR else "leave the camera out, or --fallback lidar",
            )
        if self.kept and self._without_kept == PATIENCE:
            hint = "is it the model for these images? Look at them with --overlay 4 and --fallback lidar"
            listed = ", ".join(self.kept)
            raise ModelError(
                f"finds no {listed} under any return of the first {PATIENCE} scans", where=self.model, hint=hint
            )


def sight_of(
    log: Log,
    request: CameraRequest,
    points: PointsSettings,
    segment: SegmentSettings,
    *,
    rig: Rig,
    image_tolerance_s: float,
    holds_scans: bool = False,
) -> Sight:
    """The cameras and the model, checked.

    Args:
        image_tolerance_s: how far from a scan an image may be.

    Raises:
        WallkitError: as `find_cameras`; ModelError: the model cannot be used, or knows nothing of what filters keep.
    """
    model = request.model or segment.model or DEFAULT
    is_oracle = model == ORACLE_MODEL
    cameras = find_cameras(log, request, is_oracle=is_oracle, lidar_frame=rig.lidar_frame)
    cameras = tuple(
        replace(camera, notes=(*camera.notes, *too_seldom(camera, image_tolerance_s)))
        for camera in (_perturbed(camera, points.perturb) for camera in cameras)
    )
    looks, names, roles, cache = looks_of(model, log, segment)
    for wanted in (points.wanted(name) for name in points.filters):
        if wanted and not set(wanted) & set(roles):
            listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
            hint = f"say which of its classes counts: --set 'segment.roles.{wanted[0]}=[\"NAME\"]'; or another --filter"
            raise ModelError(f"no class counts as {' or '.join(wanted)} (classes: {listed})", where=model, hint=hint)
    return Sight(
        cameras,
        model,
        looks,
        roles,
        invert_matrix(rig.mount.matrix),
        points.look,
        kept=points.wanted("wall_mask") if "wall_mask" in points.filters else (),
        may_fall_back=request.may_fall_back,
        holds_scans=holds_scans,
        log_name=log.name,
        rate_hz=segment.rate_hz,
        cache=cache,
        perturb=points.perturb,
    )


def reason_of(error: WallkitError) -> str:
    """What is wrong and where, without what to do about it."""
    return f"{error.where}: {error.message}" if error.where else error.message


def picture_of(image: CameraImage) -> UInt8Array:
    """(H, W, 3) RGB of a recorded image."""
    pixels = pixels_from_image(image)
    return pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)


def _perturbed(camera: Camera, settings: PerturbSettings) -> Camera:
    """The camera with errors put in, and a note that says so."""
    if not settings.said:
        return camera
    note = f"{camera.source}: errors are put in on purpose: {', '.join(settings.said)} (points.perturb)"
    return replace(camera, calibration=perturbed(camera.calibration, settings), notes=(*camera.notes, note))


def _key(image: CameraImage) -> _Image:
    return image.frame_id, image.stamp_ns


def _fits(segmentation: Segmentation, camera: Camera) -> bool:
    return segmentation.shape == (camera.calibration.camera.height, camera.calibration.camera.width)
