"""Training sets are read as they were written, and what is none is refused with the reason."""

from __future__ import annotations

import numpy as np
import pytest

from tests.train.flat import NAMES, flat, flat_set
from wallkit.dataset.read import read_pair, read_training_set
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


@pytest.mark.parametrize(
    ("text", "says"),
    [
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
    with pytest.raises(DatasetError, match=r"'val' part \(train 2, val 0\)"):
        found.of("val")


def test_labels_that_do_not_fit_are_refused(tmp_path):
    found = read_training_set(flat_set(tmp_path / "rooms", train=1, val=1))
    with pytest.raises(DatasetError, match="is none of 1 classes"):
        read_pair(found.of("train")[0], 1)
    other = read_training_set(flat_set(tmp_path / "small", train=1, val=1, size=(64, 64)))
    with pytest.raises(DatasetError, match="labels of 64 x 64, its picture 128 x 96"):
        read_pair((found.of("train")[0][0], other.of("train")[0][1]), len(NAMES))
