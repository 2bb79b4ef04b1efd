"""What was put into a training set -> its data.yaml, COCO files, statistics and split."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from wallkit.dataset.classes import LabelSet
from wallkit.dataset.labels import Labelling, Thing
from wallkit.errors import DatasetError

SPLITS = ("train", "val")
Record = dict[str, Any]


def split_of_groups(groups: Sequence[str], share: float, seed: int) -> dict[str, str]:
    """Of every scene or log, whether it is for training or validation: never both, whatever pictures it has.

    With two groups or more both sides have one.

    Raises:
        DatasetError: the share is not from 0 to below 1.
    """
    if not 0 <= share < 1:
        raise DatasetError(f"a validation share of {share:g}", hint="--val 0.2")
    names = list(dict.fromkeys(groups))
    count = round(share * len(names))
    if share > 0 and len(names) > 1:
        count = min(max(count, 1), len(names) - 1)
    chosen = np.random.default_rng([seed, 0x5711]).permutation(len(names))[:count].tolist()
    return {name: SPLITS[number in chosen] for number, name in enumerate(names)}


def data_yaml(labels: LabelSet, *, comment: str, val: str = "images/val") -> str:
    """The file that YOLO trainers are given; paths are relative to it."""
    lines = [f"# {comment}", "path: .", "train: images/train", f"val: {val}", f"nc: {len(labels.names)}", "names:"]
    return "\n".join([*lines, *(f"  {number}: {name}" for number, name in enumerate(labels.names)), ""])


def coco_annotations(things: Iterable[Thing]) -> list[Record]:
    """Of one picture, without ids, segmentations as packed run lengths without their size."""
    return [
        {"category_id": thing.number + 1, "bbox": list(thing.box), "area": thing.area_px, "counts": thing.counts}
        for thing in things
    ]


def coco_document(records: Sequence[Record], labels: LabelSet, *, description: str) -> Record:
    """A COCO file of pictures: file, width, height and annotations as `coco_annotations` has them."""
    images: list[Record] = []
    annotations: list[Record] = []
    for record in records:
        number = len(images) + 1
        height, width = record["height"], record["width"]
        images.append({"id": number, "file_name": f"{record['name']}.jpg", "width": width, "height": height})
        for made in record["annotations"]:
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": number,
                    "category_id": made["category_id"],
                    "bbox": made["bbox"],
                    "area": made["area"],
                    "iscrowd": 0,
                    "segmentation": {"size": [height, width], "counts": made["counts"]},
                }
            )
    categories = [{"id": number + 1, "name": name} for number, name in enumerate(labels.names)]
    return {
        "info": {"description": description},
        "images": images,
        "annotations": annotations,
        "categories": categories,
    }


def statistics_of(records: Sequence[Record], labelling: Labelling) -> Record:
    """Of each split and class: pictures that show it, pixels and things; and what was too small to count."""
    found: Record = {}
    count = len(labelling.labels.names)
    for split in SPLITS:
        own = [record for record in records if record["split"] == split]
        pixels = np.array([r["pixels"] for r in own], dtype=np.int64).reshape(len(own), count)
        things = np.array([r["things"] for r in own], dtype=np.int64).reshape(len(own), count)
        total = sum(r["width"] * r["height"] for r in own)
        classes = {
            name: {
                "images": int((pixels[:, number] > 0).sum()),
                "pixels": int(pixels[:, number].sum()),
                "share": round(float(pixels[:, number].sum()) / max(total, 1), 6),
                "instances": int(things[:, number].sum()),
            }
            for number, name in enumerate(labelling.labels.names if own else ())
        }
        found[split] = {
            "images": len(own),
            "groups": len({record["group"] for record in own}),
            "pixels": total,
            "too_small": sum(record["too_small"] for record in own),
            "classes": classes,
        }
    return found


def statistics_lines(statistics: Mapping[str, Any], labels: LabelSet) -> list[list[str]]:
    """Rows for people: class, and of both splits together images, share of pixels, things."""
    rows = []
    total = max(sum(statistics[split]["pixels"] for split in SPLITS), 1)
    for name in labels.names:
        both = [statistics[split]["classes"].get(name) for split in SPLITS]
        known = [one for one in both if one]
        images, pixels, things = (sum(one[key] for one in known) for key in ("images", "pixels", "instances"))
        rows.append([name, f"{images}", f"{100 * pixels / total:.2f} %", f"{things}"])
    return rows
