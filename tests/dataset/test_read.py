"""Training sets are read as they were written, and what is none is refused with the reason."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from tests.train.flat import NAMES, flat, flat_set
from wallkit.dataset.read import folders_of, pairs_of, read_pair, read_training_set, read_training_sets
from wallkit.errors import DatasetError


def test_pictures_and_labels_come_back(tmp_path):
    found = read_training_set(flat_set(tmp_path / "rooms", train=3, val=2, seed=5))
    assert found.names == NAMES
    assert found.kind == "simulated"
    assert [len(found.of(split)) for split in ("train", "val", "all")] == [3, 2, 5]
    assert len(found.sha256) == 64
    rng = np.random.default_rng(5)
    for pair in found.of("train"):
        image, numbers = read_pair(pair, len(NAMES))
        drawn = flat(rng, (128, 96))
        np.testing.assert_array_equal(numbers, drawn[1])
        # JPEG thins out colour at the borders of boxes
        assert np.median(np.abs(image.astype(int) - drawn[0])) <= 2


def test_names_may_be_a_list(tmp_path):
    folder = flat_set(tmp_path / "rooms", train=1, val=1)
    (folder / "data.yaml").write_text("names: [a, b, c, d, e, f]\n")
    assert read_training_set(folder).names == ("a", "b", "c", "d", "e", "f")


def augmented_set(tmp_path):
    """A set, and one beside it that validates by the pictures of the first, as `dataset from-log --augment` writes them."""
    rooms = flat_set(tmp_path / "rooms", train=3, val=2)
    other = flat_set(rooms / "augmented", train=4, val=0, seed=7)
    (other / "data.yaml").write_text((other / "data.yaml").read_text().replace("val: images/val", "val: ../images/val"))
    return rooms, other


def test_pictures_are_where_data_yaml_says(tmp_path):
    rooms, other = augmented_set(tmp_path)
    found = read_training_set(other)
    assert [len(found.of(split)) for split in ("train", "val", "all")] == [4, 2, 6]
    assert found.of("val") == read_training_set(rooms).of("val")
    text = (rooms / "data.yaml").read_text().replace("train: images/train", "train: [images/train, images/val]")
    (rooms / "data.yaml").write_text(text)
    assert len(read_training_set(rooms).of("train")) == 5


def test_pictures_that_sets_share_count_once(tmp_path):
    sets = read_training_sets(augmented_set(tmp_path))
    assert [len(pairs_of(sets, split)) for split in ("train", "val", "all")] == [7, 2, 9]
    assert [len(folders_of(sets, split)) for split in ("train", "val")] == [2, 1]


def test_a_root_of_another_machine_is_the_sets_own_folder(tmp_path):
    folder = flat_set(tmp_path / "rooms", train=1, val=1)
    (folder / "data.yaml").write_text((folder / "data.yaml").read_text().replace("path: .", "path: /datasets/rooms"))
    assert len(read_training_set(folder).of("all")) == 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("names: [a]\ntrain: 7\n", "train is 7"),
        ("names: []\n", "names is"),
        ("names: {0: a, 2: b}\n", "names is"),
        ("[1, 2\n", "no data.yaml"),
        ("7\n", "no data.yaml"),
    ],
)
def test_bad_names_are_refused(tmp_path, text, says):
    folder = flat_set(tmp_path / "rooms", train=1, val=1)
    (folder / "data.yaml").write_text(text)
    with pytest.raises(DatasetError, match=says):
        read_training_set(folder)


def test_what_is_no_training_set_is_refused(tmp_path):
    with pytest.raises(DatasetError, match="no such folder"):
        read_training_set(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match=r"no data\.yaml"):
        read_training_set(tmp_path)
    folder = flat_set(tmp_path / "rooms", train=1, val=1)
    for mask in (folder / "masks").rglob("*.png"):
        mask.unlink()
    with pytest.raises(DatasetError, match="label PNG"):
        read_training_set(folder)


def test_an_empty_part_is_said_with_what_there_is(tmp_path):
    found = read_training_set(flat_set(tmp_path / "rooms", train=2, val=0))
    with pytest.raises(DatasetError, match=r"'val' part \(train 2, val 0\)") as caught:
        found.of("val")
    assert "--val 0.2" in caught.value.hint


@pytest.mark.parametrize(
    ("file", "data", "says"),
    [
        ("images/val/scene_00001_00.jpg", b"", "0 bytes are no picture"),
        ("images/val/scene_00001_00.jpg", b"no picture", "10 bytes are no picture"),
        ("masks/val/scene_00001_00.png", b"", "0 bytes are no label PNG"),
        ("masks/val/scene_00001_00.png", b"\x89PNG\r\n\x1a\n cut", "12 bytes are no label PNG"),
        ("manifest.json", b'{"kind": ', "is no JSON"),
        ("manifest.json", b"\xff\xfe", "is no JSON"),
        ("manifest.json", b"[]", "is no manifest"),
        ("data.yaml", b"\xff\xfe\x00", "no data.yaml"),
    ],
)
def test_damaged_files_are_named_with_what_to_do(tmp_path, file, data, says):
    folder = flat_set(tmp_path / "rooms", train=1, val=1)
    (folder / file).write_bytes(data)
    with pytest.raises(DatasetError, match=says) as caught:
        read_pair(read_training_set(folder).of("val")[0], len(NAMES))
    assert caught.value.where == str(folder / file)
    assert "make the set again" in caught.value.hint


def test_a_label_png_of_colours_or_cut_short_is_refused(tmp_path):
    found = read_training_set(flat_set(tmp_path / "rooms", train=1, val=1))
    (pair,) = found.of("val")
    pair[1].write_bytes(pair[1].read_bytes()[:-200])
    with pytest.raises(DatasetError, match="no label PNG"):
        read_pair(pair, len(NAMES))
    Image.new("RGB", (128, 96)).save(pair[1])
    with pytest.raises(DatasetError, match="PNG of colours"):
        read_pair(pair, len(NAMES))


def test_labels_that_do_not_fit_are_refused(tmp_path):
    found = read_training_set(flat_set(tmp_path / "rooms", train=1, val=1))
    with pytest.raises(DatasetError, match="is none of 1 classes"):
        read_pair(found.of("train")[0], 1)
    other = read_training_set(flat_set(tmp_path / "small", train=1, val=1, size=(64, 64)))
    with pytest.raises(DatasetError, match="labels of 64 x 64, its picture 128 x 96"):
        read_pair((found.of("train")[0][0], other.of("train")[0][1]), len(NAMES))
