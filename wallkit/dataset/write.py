"""Labelled pictures -> the files of a training set: a picture and its labels at a time, then what is about all of them.

images/train/*.jpg   labels/train/*.txt (YOLO-seg)   masks/train/*.png (numbers, with palette); the same in val/
data.yaml   annotations/instances_{train,val}.json (COCO)   statistics.json   contact-sheet.png
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.types import UInt8Array
from wallkit.dataset.documents import SPLITS, Record, coco_annotations, coco_document, data_yaml, statistics_of
from wallkit.dataset.labels import (
    Labelled,
    Labelling,
    class_counts,
    classes_from_png,
    label_text,
    png_from_classes,
    things_of,
)
from wallkit.dataset.sheet import Tile, contact_sheet
from wallkit.errors import DatasetError

_SHEET_TILES = 48


@dataclass(frozen=True)
class Layout:
    """Where a training set's files go."""

    folder: Path
    labelling: Labelling = Labelling()
    jpeg_quality: int = 90

    def image(self, record: Mapping[str, Any]) -> Path:
        return self.folder / "images" / str(record["split"]) / f"{record['name']}.jpg"

    def label(self, record: Mapping[str, Any]) -> Path:
        return self.folder / "labels" / str(record["split"]) / f"{record['name']}.txt"

    def mask(self, record: Mapping[str, Any]) -> Path:
        return self.folder / "masks" / str(record["split"]) / f"{record['name']}.png"

    def make(self, *, with_labels: bool = True) -> None:
        """The empty folders."""
        for kind in ("images", "labels", "masks") if with_labels else ("images",):
            for split in SPLITS:
                (self.folder / kind / split).mkdir(parents=True, exist_ok=True)


def write_picture(layout: Layout, labelled: Labelled, split: str) -> Record:
    """Writes a picture and its labels, and says what is in it."""
    height, width = labelled.image.shape[:2]
    count = len(layout.labelling.labels.names)
    jpeg = jpeg_from_rgb(labelled.image, layout.jpeg_quality)
    things, small = things_of(labelled, layout.labelling)
    record: Record = {
        "name": labelled.name,
        "group": labelled.group,
        "split": split,
        "width": width,
        "height": height,
        "sha256": hashlib.sha256(jpeg).hexdigest(),
        "too_small": small,
        "pixels": [0] * count,
        "things": [0] * count,
        "annotations": coco_annotations(things),
        "more": dict(labelled.more),
    }
    layout.image(record).write_bytes(jpeg)
    if labelled.classes is not None:
        record["pixels"], record["things"] = class_counts(labelled.classes, things, count)
        png = png_from_classes(labelled.classes, layout.labelling.labels)
        text = label_text(things, (height, width))
        record["labels_sha256"] = hashlib.sha256(png + text.encode()).hexdigest()
        layout.mask(record).write_bytes(png)
        layout.label(record).write_text(text, encoding="utf-8")
    return record


def write_documents(
    layout: Layout, records: Sequence[Record], *, title: str, with_labels: bool = True, val: str = "images/val"
) -> Record:
    """Writes what is about all pictures; the statistics come back."""
    labels = layout.labelling.labels
    statistics = statistics_of(records, layout.labelling)
    if with_labels:
        (layout.folder / "annotations").mkdir(exist_ok=True)
        for split in SPLITS:
            own = [record for record in records if record["split"] == split]
            document = coco_document(own, labels, description=title)
            text = json.dumps(document, separators=(",", ":"))
            (layout.folder / "annotations" / f"instances_{split}.json").write_text(text, encoding="utf-8")
        (layout.folder / "data.yaml").write_text(data_yaml(labels, comment=title, val=val), encoding="utf-8")
        text = json.dumps({"schema": 1, **statistics}, indent=1)
        (layout.folder / "statistics.json").write_text(text + "\n", encoding="utf-8")
    (layout.folder / "contact-sheet.png").write_bytes(_sheet(layout, records, title))
    return statistics


def manifest_record(record: Record) -> Record:
    """What the manifest keeps of a picture."""
    kept = {key: record[key] for key in ("name", "split", "group", "sha256", "labels_sha256") if key in record}
    return {**kept, **record["more"]}


def jpeg_from_rgb(pixels: UInt8Array, quality: int) -> bytes:
    """RGB (H, W, 3) or grey (H, W) pixels as JPEG."""
    import cv2

    _, data = cv2.imencode(
        ".jpg", pixels[..., ::-1] if pixels.ndim == 3 else pixels, [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    return bytes(data)


def read_rgb(path: Path) -> UInt8Array:
    """(H, W, 3) RGB of a picture file.

    Raises:
        DatasetError: it is damaged, or not there.
    """
    import cv2

    data = np.frombuffer(path.read_bytes() if path.is_file() else b"", np.uint8)
    pixels = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if pixels is None:
        hint = "delete it and its label PNG, or make the set again"
        raise DatasetError(f"{data.size} bytes are no picture", where=path, hint=hint)
    return np.ascontiguousarray(pixels[..., ::-1], dtype=np.uint8)


def _sheet(layout: Layout, records: Sequence[Record], title: str) -> bytes:
    """Some pictures, evenly from all of them, with their labels laid over."""
    chosen = np.unique(np.linspace(0, len(records) - 1, min(len(records), _SHEET_TILES)).round().astype(int)).tolist()
    tiles = []
    for record in (records[number] for number in chosen):
        mask = layout.mask(record)
        classes = classes_from_png(mask.read_bytes()) if mask.exists() else None
        tiles.append(Tile(read_rgb(layout.image(record)), f"{record['name']}  {record['split']}", classes))
    return contact_sheet(tiles, layout.labelling.labels, title=title)
