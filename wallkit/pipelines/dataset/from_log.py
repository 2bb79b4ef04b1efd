"""Logs, and what a person said to drop -> one structured dataset. Read `dataset_from_logs` from top to bottom."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import wallkit
from wallkit.dataset.augment import augmented, denoised
from wallkit.dataset.classes import LabelSet
from wallkit.dataset.documents import Record, split_of_groups
from wallkit.dataset.labels import Labelled, Labelling
from wallkit.dataset.review import Proposal, drop_list, proposals, read_drop_list, sharpness, thumbnail
from wallkit.dataset.sheet import Tile, contact_sheet
from wallkit.dataset.write import Layout, manifest_record, write_documents, write_picture
from wallkit.errors import DatasetError
from wallkit.pipelines.calib.captures import input_files
from wallkit.pipelines.dataset.logs import Source, cameras_of, pictures_of, sources_of, write_scans
from wallkit.pipelines.outputs import result_folder
from wallkit.pipelines.run_folder import sha256, write_json

_SHEET_TILES = 240
Progress = Callable[[int], None]


@dataclass(frozen=True)
class FromLogs:
    """What to make of which logs.

    Attributes:
        image_topics: one for each camera to take; none for all of them.
        runs: folders of `wallkit localize`, one for each log, whose poses are taken; else the logs' own truth.
        drops: the list of what to leave out. review: only look: the sheet and the list, no dataset.
        augment: variants of each training picture, in a set of their own.
    """

    logs: tuple[Path, ...]
    image_topics: tuple[str, ...] = ()
    runs: tuple[Path, ...] = ()
    drops: Path | None = None
    review: bool = False
    denoise: bool = False
    augment: int = 0
    val: float = 0.2
    seed: int = 0
    labels: LabelSet = LabelSet()


@dataclass(frozen=True)
class FromLogsDone:
    """What came of it. dropped: pictures left out by reason; lost: pictures that could not be read."""

    seen: int
    written: int
    labelled: int
    posed: int
    augmented: int
    proposed: dict[str, int]
    dropped: dict[str, int]
    lost: dict[str, int]
    splits: dict[str, str]
    statistics: dict[str, Any] = field(default_factory=dict)


def dataset_from_logs(
    request: FromLogs, out: Path, *, overwrite: bool = False, progress: Progress = lambda _: None
) -> FromLogsDone:
    """A folder with pictures, labels, scans, poses and cameras; or, to review, a contact sheet and a drop list.

    Raises:
        LogError, DatasetError, OutputError: no images, an unknown class, a drop list that does not fit, no place.
    """
    sources = sources_of(request.logs, request.image_topics, request.runs)
    with result_folder(out, overwrite=overwrite) as folder:
        lost: dict[str, int] = {}
        names, found, tiles = _judged(sources, request, lost, progress)
        if not names:
            raise DatasetError("no picture could be read", where=", ".join(map(str, request.logs)))
        drops = read_drop_list(request.drops, names) if request.drops else {}
        _write_review(folder, found, tiles, len(names), request.labels)
        proposed = dict(Counter(one.reason for one in found))
        splits = split_of_groups([source.name for source in sources], request.val, request.seed)
        seen = len(names)
        done = FromLogsDone(seen, 0, 0, 0, 0, proposed, dict(Counter(drops.values())), lost, splits)
        if not request.review:
            done = _write_set(folder, request, sources, drops, splits, done)
        write_json(folder / "run.json", {"schema": 1, "command": "dataset from-log", "seed": request.seed})
    return done


def _judged(
    sources: list[Source], request: FromLogs, lost: dict[str, int], progress: Progress
) -> tuple[list[str], list[Proposal], list[Tile]]:
    """Names of all pictures, what is better dropped, and tiles of some of them, of all that are proposed."""
    names: list[str] = []
    looks: dict[tuple[str, str], list[tuple[str, float, np.ndarray]]] = {}
    tiles: dict[str, Tile] = {}
    stride = 1
    for labelled in _all(sources, request.labels, lost):
        names.append(labelled.name)
        key = (labelled.group, str(labelled.more["camera"]))
        looks.setdefault(key, []).append((labelled.name, sharpness(labelled.image), thumbnail(labelled.image)))
        if len(names) % stride == 0:
            tiles[labelled.name] = _small(labelled)
        if len(tiles) > 2 * _SHEET_TILES:
            # evenly, and never a whole log in memory
            tiles, stride = dict(list(tiles.items())[1::2]), 2 * stride
        progress(len(names))
    found = []
    for rows in looks.values():
        own, sharp, thumbs = (list(column) for column in zip(*rows, strict=True))
        found += proposals(own, sharp, thumbs)
    alarms = {one.name: f"{one.reason} {one.number:g}" for one in found}
    held = list(tiles)
    chosen = np.unique(np.linspace(0, len(held) - 1, min(len(held), _SHEET_TILES)).round().astype(int)).tolist()
    shown = [held[number] for number in chosen] if held else []
    return names, found, [replace(tiles[name], alarm=alarms.get(name, "")) for name in shown]


def _all(sources: list[Source], labels: LabelSet, lost: dict[str, int]) -> Iterator[Labelled]:
    for source in sources:
        yield from pictures_of(source, labels, lost)


def _small(labelled: Labelled) -> Tile:
    """A tile with the picture at the size it is shown in, so that a log's worth fits into memory."""
    import cv2

    h, w = labelled.image.shape[:2]
    size = (256, round(256 * h / w))
    image = np.asarray(cv2.resize(labelled.image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    classes = labelled.classes
    if classes is not None:
        classes = np.asarray(cv2.resize(classes, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
    return Tile(image, labelled.name[-40:], classes)


def _write_review(folder: Path, found: list[Proposal], tiles: list[Tile], count: int, labels: LabelSet) -> None:
    title = f"{len(tiles)} of {count} pictures; red: {len(found)} proposed to be dropped"
    (folder / "review.png").write_bytes(contact_sheet(tiles, labels, title=title))
    (folder / "drops.csv").write_text(drop_list(found), encoding="utf-8")


def _write_set(
    folder: Path,
    request: FromLogs,
    sources: list[Source],
    drops: Any,
    splits: dict[str, str],
    done: FromLogsDone,
) -> FromLogsDone:
    labelling = Labelling(request.labels)
    layout, other = Layout(folder, labelling), Layout(folder / "augmented", labelling)
    with_labels = any(source.oracle_classes for source in sources)
    layout.make(with_labels=with_labels)
    records: list[Record] = []
    variants: list[Record] = []
    if request.augment:
        other.make(with_labels=with_labels)
    for labelled in _all(sources, request.labels, {}):
        if labelled.name in drops:
            continue
        if request.denoise:
            labelled = replace(labelled, image=denoised(labelled.image))
        split = splits[labelled.group]
        records.append(write_picture(layout, labelled, split))
        for number in range(request.augment if split == "train" else 0):
            rng = np.random.default_rng([request.seed, number, labelled.more["stamp_ns"]])
            variants.append(write_picture(other, augmented(rng, labelled, number), split))
    if not records:
        raise DatasetError(f"all {done.seen} pictures are dropped", where=request.drops or "", hint="keep some: no")
    _write_sensors(folder, sources, records)
    title = f"wallkit {wallkit.__version__}, {len(records)} pictures of {len(sources)} logs"
    statistics = write_documents(layout, records, title=title, with_labels=with_labels)
    about = {
        "schema": 1,
        "wallkit": wallkit.__version__,
        "numpy": np.__version__,
        "seed": request.seed,
        "kind": "recorded",
        "denoised": request.denoise,
        "logs": [
            {"name": s.name, "files": {f.name: sha256(f) for f in input_files([s.path])}, "split": splits[s.name]}
            for s in sources
        ],
        "names": request.labels.names,
        "dropped": drops,
    }
    pictures = [manifest_record(record) for record in records]
    write_json(folder / "manifest.json", {**about, "augmented": False, "statistics": statistics, "pictures": pictures})
    if variants:
        title = f"{title}: {len(variants)} augmented"
        counted = write_documents(other, variants, title=title, with_labels=with_labels, val="../images/val")
        pictures = [manifest_record(record) for record in variants]
        document = {**about, "augmented": True, "statistics": counted, "pictures": pictures}
        write_json(folder / "augmented" / "manifest.json", document)
    labelled_count = sum(1 for record in records if "labels_sha256" in record)
    posed = sum(1 for record in records if record["more"]["pose"] is not None)
    return replace(
        done, written=len(records), labelled=labelled_count, posed=posed, augmented=len(variants), statistics=statistics
    )


def _write_sensors(folder: Path, sources: list[Source], records: list[Record]) -> None:
    """Scans, and cameras by log; how late each scan is goes into its picture's record."""
    cameras = {}
    for source in sources:
        own = {r["name"]: r for r in records if r["group"] == source.name}
        stamps = {name: int(record["more"]["stamp_ns"]) for name, record in own.items()}
        for name, late_s in write_scans(source, stamps, folder / "scans").items():
            own[name]["more"]["scan_late_s"] = round(late_s, 6)
        cameras[source.name] = cameras_of(source)
    write_json(folder / "cameras.json", cameras)
