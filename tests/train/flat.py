"""Training sets of flat-coloured pictures, which a colour oracle knows, and a small network learns, exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wallkit.dataset.classes import LabelSet
from wallkit.dataset.labels import Labelled, Labelling
from wallkit.dataset.write import Layout, write_documents, write_picture
from wallkit.pipelines.run_folder import write_json
from wallkit.segment.fixture import USUAL

NAMES = tuple(USUAL)


def flat(
    rng: np.random.Generator, size: tuple[int, int], names: tuple[str, ...] = NAMES
) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) boxes in the colours of their classes before a wall, and (H, W) numbers."""
    width, height = size
    numbers = np.zeros((height, width), dtype=np.uint8)
    for _ in range(4):
        x, y = int(rng.integers(0, width - 24)), int(rng.integers(0, height - 24))
        w, h = (int(v) for v in rng.integers(24, 64, 2))
        numbers[y : y + h, x : x + w] = rng.integers(1, len(names))
    return np.array([USUAL[name] for name in names], dtype=np.uint8)[numbers], numbers


def flat_set(folder: Path, *, train: int, val: int, size: tuple[int, int] = (128, 96), seed: int = 0) -> Path:
    """A training set as `simulate dataset` writes them."""
    labels = LabelSet(names=NAMES)
    layout = Layout(folder, Labelling(labels), jpeg_quality=100)
    layout.make()
    rng = np.random.default_rng(seed)
    records = []
    for number in range(train + val):
        split = "train" if number < train else "val"
        labelled = Labelled(f"scene_{number:05d}_00", f"scene_{number:05d}", *flat(rng, size))
        records.append(write_picture(layout, labelled, split))
    write_documents(layout, records, title="flat")
    write_json(folder / "manifest.json", {"schema": 1, "kind": "simulated", "seed": seed})
    return folder
