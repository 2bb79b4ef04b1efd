"""How fast: points in polygons four ways, and the camera filter part by part, beside the update that it serves."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera
from wallkit.core.config import Source, build
from wallkit.core.geometry import compose
from wallkit.core.grid import placed
from wallkit.core.polygon import POINT_IN_POLYGON, crossing_number, looked_up, mask_from, packed
from wallkit.core.raycast import cast_rays
from wallkit.core.segmentation import BACKGROUND, Polygon
from wallkit.core.types import (
    BeamLabels,
    CameraImage,
    Estimate,
    FieldSet,
    Float64Array,
    Frame,
    Health,
    LabelledScan,
    Points,
    StampedPose,
    View,
)
from wallkit.localize.filter import monte_carlo_localizer
from wallkit.localize.settings import LocalizeSettings
from wallkit.pipelines.bench.update import bench_scene
from wallkit.points.filters import FILTERS, apply_filters
from wallkit.points.labels import labelled_scan, labels_by_beam, thinned
from wallkit.points.look import ClassesAt, LookSettings, look, project_frame
from wallkit.points.outlines import classes_in
from wallkit.segment.letterbox import letterbox
from wallkit.segment.scores import ScoreMap

ROUNDS = 400
_WIDTH, _HEIGHT = 640, 480
_CLASSES = ("wall", "person", BACKGROUND)
_POSE = np.array([7.3, 6.1, 0.4])


@dataclass(frozen=True)
class Part:
    """One thing that was timed: CPU time of its thread, median and 95th percentile over the rounds."""

    name: str
    median_ms: float
    p95_ms: float
    note: str = ""


def time_polygons(points: int, polygons: int, corners: int) -> list[Part]:
    """Every way of asking which polygon holds a point, over the same points; and what is done once for each image."""
    rng = np.random.default_rng(0)
    at = rng.uniform((0, 0), (_WIDTH, _HEIGHT), (points, 2))
    rings = [[blob] for blob in _blobs(rng, polygons, corners)]
    held = packed(rings)
    mask = mask_from(held, (_HEIGHT, _WIDTH))
    wanted = crossing_number(at, held)
    work: dict[str, Callable[[], object]] = {
        **{name: lambda f=f: f(at, held) for name, f in POINT_IN_POLYGON.items() if name != "mask"},  # type: ignore[misc]
        "mask look-up": lambda: looked_up(at, mask),
        "mask drawn, once per image": lambda: mask_from(held, (_HEIGHT, _WIDTH)),
        "polygons packed, once per image": lambda: packed(rings),
    }
    notes = {name: f"{np.mean(f(at, held) == wanted):.2%} as crossing_number" for name, f in POINT_IN_POLYGON.items()}
    notes["mask look-up"] = notes.pop("mask")
    return _timed(work, notes)


def time_filter(beams: int, polygons: int, corners: int, particles: int) -> list[Part]:
    """The camera filter without its network, part by part, and a whole update with and without it.

    All beams land on the image. The update of both is the class-conditional filter's with as many particles. The scores are
    a grid as the default model's, which `points.look.lookup` asks unless it is told to make polygons of them. Parts look up
    every return; a filtered update so many as `points.look.returns` says, and the basic one stands there with as few too.
    """
    rng, fields = np.random.default_rng(0), bench_scene(400)
    frame, view, calibration = _moment(fields, beams)
    things = [Polygon(i % 2, 0.9, (ring,)) for i, ring in enumerate(_blobs(rng, polygons, corners))]
    # a net's twelve classes count as three, of which the first three are the polygons'
    T_lidar_base, class_of = np.eye(4), np.array([*(i % 3 for i in range(12)), -1])
    sharp, exact = LookSettings(lookup="crossing_number", margins=0), LookSettings(lookup="crossing_number")
    by_number = classes_in(things, _CLASSES, (_HEIGHT, _WIDTH), "crossing_number")
    by_mask = classes_in(things, _CLASSES, (_HEIGHT, _WIDTH), "mask")
    scores = _scores(rng, by_number)
    by_scores = scores.classes_at
    located = {s: project_frame(calibration, frame, view, T_lidar_base, s) for s in (sharp, exact)}
    looked = look(located[exact], by_number, class_of, 3)
    labels = BeamLabels(frame.stamp_ns, looked.labels, _CLASSES, looked.confidences, looked.shares)
    scan = labelled_scan(replace(frame, labels=labels))
    estimate = Estimate(0, _POSE, np.eye(3) * 1e-4, Health.LOCALIZED)
    filters = {name: FILTERS[name]().on(fields) for name in FILTERS}

    def filtered(settings: LookSettings, classes_at: ClassesAt = by_number, returns: int = 0) -> LabelledScan:
        few = thinned(frame, returns)
        seen = look(project_frame(calibration, few, view, T_lidar_base, settings), classes_at, class_of, 3)
        shown = labels_by_beam(few, [seen], _CLASSES)
        return apply_filters([filters["wall_mask"]], labelled_scan(replace(few, labels=shown)), estimate)

    update, usual = _updates(fields, particles), LookSettings().returns
    work: dict[str, Callable[[], object]] = {
        "project": lambda: project_frame(calibration, frame, view, T_lidar_base, sharp),
        "points in polygons": lambda: look(located[sharp], by_number, class_of, 3),
        "points in polygons, with margins": lambda: look(located[exact], by_number, class_of, 3),
        **{f"weights of {name}": lambda f=f: f.weigh(scan, estimate) for name, f in filters.items()},  # type: ignore[misc]
        "filter: project, polygons, weights": lambda: filtered(sharp),
        "filter, with margins": lambda: filtered(exact),
        "filter, with margins, by mask": lambda: filtered(exact, by_mask),
        "filter, with margins, by a net's scores": lambda: filtered(exact, by_scores),
        "update, basic": lambda: update(labelled_scan(frame)),
        f"update, basic, {usual} returns": lambda: update(labelled_scan(thinned(frame, usual))),
        "update, filtered": lambda: update(filtered(sharp, returns=usual)),
        "update, filtered with margins": lambda: update(filtered(exact, returns=usual)),
        "update, filtered with margins, every return": lambda: update(filtered(exact)),
        "update, filtered with margins, by mask": lambda: update(filtered(exact, by_mask, usual)),
        "update, filtered with margins, by scores": lambda: update(filtered(exact, by_scores, usual)),
        # the first scan after an image finds out how sure the cells are
        "update, filtered with margins, by new scores": lambda: update(
            filtered(exact, replace(scores).classes_at, usual)
        ),
        "polygons packed, once per image": lambda: classes_in(things, _CLASSES, (_HEIGHT, _WIDTH), "crossing_number"),
        "mask drawn, once per image": lambda: classes_in(things, _CLASSES, (_HEIGHT, _WIDTH), "mask"),
    }
    parts = {part.name: part for part in _timed(work, {})}
    basic = parts["update, basic"].median_ms
    for name in (name for name in parts if name.startswith("update, ") and name != "update, basic"):
        parts[name] = replace(parts[name], note=f"{parts[name].median_ms / basic:.2f} x basic")
    return list(parts.values())


def _timed(work: Mapping[str, Callable[[], object]], notes: Mapping[str, str]) -> list[Part]:
    """All take turns, so that a slow spell of the machine hits all; in a drawn order, as each finds another's caches."""
    times: dict[str, list[float]] = {name: [] for name in work}
    for run in work.values():
        run()
    rng, names = np.random.default_rng(0), list(work)
    for _ in range(ROUNDS):
        for name in (names[i] for i in rng.permutation(len(names))):
            began = time.thread_time_ns()
            work[name]()
            times[name].append((time.thread_time_ns() - began) / 1e6)
    return [
        Part(name, float(np.median(t)), float(np.percentile(t, 95)), notes.get(name, "")) for name, t in times.items()
    ]


def _updates(fields: FieldSet, particles: int) -> Callable[[LabelledScan], object]:
    """Predict and update of a filter that knows where it is, always from the same belief."""
    settings = build(LocalizeSettings, [Source({"particles": particles}, "bench")])[0]
    tracker = monte_carlo_localizer(settings, fields)
    start = tracker.start(np.random.default_rng(0), StampedPose(0, "map", _POSE, np.diag([1e-3, 1e-3, 1e-4])))
    belief = tracker.predict(np.random.default_rng(0), start, np.zeros(3))
    belief = replace(belief, updates=1)

    def update(scan: LabelledScan) -> object:
        rng = np.random.default_rng(0)
        return tracker.update(rng, tracker.predict(rng, belief, np.array([0.25, 0.0, 0.0])), scan)

    return update


def _moment(fields: FieldSet, beams: int) -> tuple[Frame, View, Calibration]:
    """A scan of a quarter turn that the camera above the LiDAR sees all of, and the image 20 ms later."""
    bearings = np.linspace(-np.pi / 4.2, np.pi / 4.2, beams)
    at = placed(fields, compose(_POSE, np.zeros(3))[None], border=0)
    ranges = np.zeros((1, beams), dtype=np.float32)
    per_m = np.float32(1 / fields.resolution_m)
    directions = np.stack([np.cos(bearings), np.sin(bearings)]).astype(np.float32)
    cast_rays(at, directions, fields.distances_m["all"], per_m, np.float32(20) * per_m, ranges)
    ranges_m = (ranges[0] * fields.resolution_m).astype(np.float32)
    xyz = np.column_stack([directions.T * ranges_m[:, None], np.full(beams, 0.3)]).astype(np.float32)
    offsets = np.linspace(0, 0.03, beams, dtype=np.float32)
    points = Points(0, xyz, ranges_m, np.arange(beams), np.zeros(2), 20.0, np.zeros(0, np.float32), offsets_s=offsets)
    T = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0.6], [1, 0, 0, 0], [0, 0, 0, 1]])
    K = np.array([[300.0, 0, 320], [0, 300, 240], [0, 0, 1]])
    camera = Camera("plumb_bob", _WIDTH, _HEIGHT, K, np.array([-0.1, 0.02, 0.0, 0.0, 0.0]))
    errors = np.array([[0.5, 6.0], [2.0, 3.0], [8.0, 2.0]])
    calibration = Calibration(camera, T, verdict="PASS", pixel_error_95=errors, time_offset_sigma_ns=1e6)
    image = CameraImage(20_000_000, "camera", "jpeg", b"")
    view = View("/camera", image, 20_000_000, np.array([0.01, 0.0, 0.01]), 0.5, 0.5)
    return Frame(0, points, np.zeros(3)), view, calibration


def _scores(rng: np.random.Generator, classes_at: ClassesAt) -> ScoreMap:
    """The same picture as a net sees it: twelve classes for each second pixel of an input of 192 x 256.

    Of the twelve the first three are those of the bench.
    """
    names = tuple(_CLASSES[i % 3] for i in range(12))
    frame = letterbox((_HEIGHT, _WIDTH), (192, 256))
    cells = 2.0 * np.stack(np.meshgrid(np.arange(128), np.arange(96)), axis=-1) + 0.5
    shown, _ = classes_at(frame.image_from_net(cells.reshape(-1, 2)))
    scores = rng.normal(0, 1, (96, 128, 12)).astype(np.float32)
    scores[np.arange(96)[:, None], np.arange(128), shown.reshape(96, 128)] += 8
    return ScoreMap(names, names, frame, scores, is_probability=False)


def _blobs(rng: np.random.Generator, polygons: int, corners: int) -> list[Float64Array]:
    """Star-shaped rings of up to a quarter of the image."""
    found = []
    for _ in range(polygons):
        angles = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.9, corners)) / corners
        radii = rng.uniform(30, 120) * rng.uniform(0.7, 1.0, corners)
        centre = rng.uniform((60, 60), (_WIDTH - 60, _HEIGHT - 60))
        found.append(centre + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]))
    return found
