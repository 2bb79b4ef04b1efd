"""Figures of epochs, as rows, as CSV and as a picture."""

from __future__ import annotations

import csv
import io

import pytest

from wallkit.train.curves import Epoch, csv_of, draw_curves

EPOCHS = [
    Epoch(n, 2.0 / n, 2.2 / n, 0.1 * n, 1e-3, 320, {"wall": 0.2 * n, "wall + partition": 0.21 * n}) for n in (1, 2, 3)
]


def test_rows_come_back_as_epochs():
    assert [Epoch.of(epoch.row()) for epoch in EPOCHS] == EPOCHS


def test_the_csv_has_a_line_an_epoch_and_a_column_a_class():
    rows = list(csv.DictReader(io.StringIO(csv_of(EPOCHS))))
    assert [row["epoch"] for row in rows] == ["1", "2", "3"]
    assert float(rows[2]["iou wall"]) == pytest.approx(0.6)
    assert float(rows[1]["train_loss"]) == pytest.approx(1.0)


def test_the_picture_is_one(tmp_path):
    from PIL import Image

    draw_curves(EPOCHS, tmp_path / "curves.png", title="three epochs")
    image = Image.open(tmp_path / "curves.png")
    assert image.width > 1000
    # the curves' colours are on it, not only paper and ink
    assert len(image.convert("RGB").getcolors(1 << 24)) > 100
