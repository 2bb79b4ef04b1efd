"""The folder of a training set -> its names, its pictures by split, and what it was made of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wallkit.core.types import UInt8Array
from wallkit.dataset.labels import classes_from_png
from wallkit.dataset.write import read_rgb
from wallkit.errors import DatasetError

Pair = tuple[Path, Path]


@dataclass(frozen=True)
class TrainingSet:
    """What a folder offers.

    Attributes:
        names: classes in the order of their numbers. pairs: split -> (picture, label PNG), by name.
        folders: split -> where its pictures are, as data.yaml says; sets can share them.
        sha256: of its manifest. kind: "simulated", or of what else it is.
    """

    folder: Path
    names: tuple[str, ...]
    pairs: Mapping[str, tuple[Pair, ...]]
    folders: Mapping[str, tuple[Path, ...]]
    sha256: str
    kind: str

    def of(self, split: str) -> tuple[Pair, ...]:
        """The pictures of train, val, or all.

        Raises:
            DatasetError: there are none.
        """
        splits = self.pairs if split == "all" else (split,)
        found = tuple(pair for one in splits for pair in self.pairs[one])
        if not found:
            has = ", ".join(f"{name} {len(pairs)}" for name, pairs in self.pairs.items())
            raise DatasetError(
                f"no labelled pictures in its '{split}' part ({has})",
                where=self.folder,
                hint="make the set with --val 0.2, of two scenes or logs or more; `model evaluate` also takes --split all",
            )
        return found


def read_training_set(folder: Path) -> TrainingSet:
    """What `wallkit simulate dataset` and `wallkit dataset from-log` write.

    Raises:
        DatasetError: no such folder, no data.yaml in it, no names, no label PNGs, or a damaged manifest.
    """
    if not (folder / "data.yaml").is_file():
        what = "no data.yaml in this folder" if folder.is_dir() else "no such folder"
        raise DatasetError(what, where=folder, hint="make a training set: wallkit simulate dataset -o rooms")
    manifest = folder / "manifest.json"
    record = _manifest(manifest) if manifest.is_file() else {}
    table = _table(folder / "data.yaml")
    folders = {split: _folders(folder, table, split) for split in ("train", "val")}
    pairs = {split: tuple(pair for one in own for pair in _pairs(one)) for split, own in folders.items()}
    if not any(pairs.values()):
        raise DatasetError(
            "none of its pictures has a label PNG beside it, in masks/",
            where=folder,
            hint="logs bring labels only when they are simulated; make a set: wallkit simulate dataset -o rooms",
        )
    digest = hashlib.sha256(manifest.read_bytes()).hexdigest() if manifest.is_file() else ""
    names, kind = _names(folder / "data.yaml", table), str(record.get("kind", "unknown"))
    return TrainingSet(folder, names, pairs, folders, digest, kind)


def read_training_sets(folders: Sequence[Path]) -> tuple[TrainingSet, ...]:
    """Several to train on together.

    Raises:
        DatasetError: one cannot be read, has no pictures for validation, or its classes are not those of the first.
    """
    sets = tuple(read_training_set(folder) for folder in folders)
    for one in sets:
        if one.names != sets[0].names:
            said = f"its classes are {', '.join(one.names)}; those of {sets[0].folder} {', '.join(sets[0].names)}"
            raise DatasetError(said, where=one.folder, hint="make both with the same --classes")
        for split in ("train", "val"):
            one.of(split)
    return sets


def pairs_of(sets: Sequence[TrainingSet], split: str) -> tuple[Pair, ...]:
    """The pictures of a part of several sets, in their order; each once, though an augmented set validates by its origin's.

    Raises:
        DatasetError: one has none.
    """
    found: dict[Path, Pair] = {}
    for pair in (pair for one in sets for pair in one.of(split)):
        found.setdefault(pair[0].resolve(), pair)
    return tuple(found.values())


def folders_of(sets: Sequence[TrainingSet], split: str) -> tuple[Path, ...]:
    """Whole paths of the folders with the pictures of a part of several sets, each once."""
    return tuple(dict.fromkeys(place.resolve() for one in sets for place in one.folders[split]))


def read_pair(pair: Pair, classes: int) -> tuple[UInt8Array, UInt8Array]:
    """(H, W, 3) RGB and (H, W) numbers of a picture.

    Raises:
        DatasetError: a damaged file, sizes that differ, or a number that is no class.
    """
    image, numbers = read_rgb(pair[0]), _numbers(pair[1])
    if image.shape[:2] != numbers.shape:
        sizes = f"{numbers.shape[1]} x {numbers.shape[0]}, its picture {image.shape[1]} x {image.shape[0]}"
        raise DatasetError(f"labels of {sizes}", where=pair[1], hint="make the set again")
    beyond = numbers[(numbers >= classes) & (numbers < 255)]
    if beyond.size:
        raise DatasetError(f"number {beyond[0]} is none of {classes} classes", where=pair[1], hint="make the set again")
    return image, numbers


# -------------------------------------------------------------------------------------------- details


def _numbers(path: Path) -> UInt8Array:
    """(H, W) numbers of a label PNG."""
    data = path.read_bytes()
    try:
        numbers = classes_from_png(data)
    except (OSError, SyntaxError, ValueError) as error:
        # Pillow has one of these for each way in which a file can be broken
        hint = "delete it and its picture, or make the set again"
        raise DatasetError(f"{len(data)} bytes are no label PNG", where=path, hint=hint) from error
    if numbers.ndim != 2:
        raise DatasetError("is a PNG of colours, not of class numbers", where=path, hint="make the set again")
    return numbers


def _manifest(path: Path) -> Mapping[str, Any]:
    try:
        record = json.loads(path.read_text("utf-8"))
    except ValueError as error:
        raise DatasetError(f"is no JSON: {error}", where=path, hint="make the set again, or delete it") from error
    if not isinstance(record, dict):
        raise DatasetError("is no manifest of a training set", where=path, hint="make the set again, or delete it")
    return record


def _folders(folder: Path, table: Mapping[str, Any], split: str) -> tuple[Path, ...]:
    """Where the pictures of a part are: what data.yaml says of it, from the folder that its `path:` names."""
    said = table.get(split, f"images/{split}") or []
    places = [said] if isinstance(said, str) else said
    if not isinstance(places, list) or not all(isinstance(place, str) for place in places):
        hint = f"{split}: images/{split}, or a list of folders"
        raise DatasetError(f"{split} is {said!r}", where=folder / "data.yaml", hint=hint)
    base = folder / str(table.get("path") or ".")
    if not base.is_dir():
        # of another machine, or of the place where a trainer keeps its sets
        base = folder
    # without following a link that leads elsewhere, unless the way goes back
    return tuple((base / place).resolve() if ".." in Path(place).parts else base / place for place in places)


def _pairs(pictures: Path) -> tuple[Pair, ...]:
    """The pictures of a folder that have labels: in images/ and masks/, the rest of their paths the same."""
    if "images" not in pictures.parts:
        return ()
    above = len(pictures.parts) - 1 - pictures.parts[::-1].index("images")
    masks = Path(*pictures.parts[:above], "masks", *pictures.parts[above + 1 :])
    pairs = ((picture, masks / f"{picture.stem}.png") for picture in sorted(pictures.glob("*.jpg")))
    return tuple(pair for pair in pairs if pair[1].is_file())


def _table(path: Path) -> Mapping[str, Any]:
    """What a data.yaml says."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        table = YAML(typ="safe").load(path.read_text("utf-8"))
    except (YAMLError, UnicodeDecodeError) as error:
        raise DatasetError("this is no data.yaml", where=path, hint="make the set again") from error
    if not isinstance(table, dict):
        raise DatasetError("this is no data.yaml", where=path, hint="make the set again")
    return table


def _names(path: Path, table: Mapping[str, Any]) -> tuple[str, ...]:
    """Of the `names:` of a data.yaml, as a list or by number."""
    names = table.get("names")
    if isinstance(names, dict) and sorted(names) == list(range(len(names))):
        names = [names[number] for number in range(len(names))]
    if not isinstance(names, list) or not names:
        raise DatasetError(f"names is {names!r}", where=path, hint="names: one line per class, numbered from 0")
    return tuple(str(name) for name in names)
