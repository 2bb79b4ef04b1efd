"""Models judged on a training set: a colour oracle is right, one with two colours exchanged is wrong where it must be."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.train.flat import NAMES, flat_set
from wallkit.dataset.read import read_training_sets
from wallkit.errors import ModelError
from wallkit.pipelines.model.evaluate import NOTHING, evaluate_model, minimum_of
from wallkit.segment.fixture import USUAL, oracle


@pytest.fixture(scope="module")
def rooms(tmp_path_factory):
    return flat_set(tmp_path_factory.mktemp("set") / "rooms", train=2, val=6)


def model(folder, colours, layout="class-scores"):
    path = folder / f"{layout}.onnx"
    path.write_bytes(oracle(colours, (96, 128), layout))
    return path


def iou(judged, name):
    return next(score.iou for score in judged.scores if score.name == name)


def test_an_oracle_is_right_about_every_class(tmp_path, rooms):
    heard: list[int] = []
    judged = evaluate_model(
        model(tmp_path, USUAL), read_training_sets([rooms]), "val", sheet=tmp_path / "sheet.png", progress=heard.append
    )
    assert judged.pictures == 6
    assert heard == [1, 2, 3, 4, 5, 6]
    # cells of the oracle are coarser than pixels, so borders are not
    assert min(iou(judged, name) for name in NAMES) > 0.8
    assert judged.without == ()
    assert (tmp_path / "sheet.png").stat().st_size > 10_000
    assert judged.document["classes"]["wall"]["mistaken"]["share"] < 0.1


def test_several_sets_are_judged_as_one(tmp_path, rooms):
    """Pixels are pooled: the confusion matrices of the sets add up."""
    more = flat_set(tmp_path / "more", train=1, val=3, seed=9)
    path = model(tmp_path, USUAL)
    sets = read_training_sets((rooms, more))
    judged = evaluate_model(path, sets, "val", sheet=tmp_path / "sheet.png")
    apart = [evaluate_model(path, read_training_sets([one]), "val") for one in (rooms, more)]
    assert judged.pictures == 6 + 3
    np.testing.assert_array_equal(judged.matrix, sum(one.matrix for one in apart))


def test_two_classes_exchanged_are_never_found(tmp_path, rooms):
    exchanged = {**USUAL, "door": USUAL["sink"], "sink": USUAL["door"]}
    judged = evaluate_model(model(tmp_path, exchanged), read_training_sets([rooms]), "val")
    assert iou(judged, "door") < 0.05
    assert iou(judged, "toilet") > 0.8
    assert judged.document["classes"]["door"]["mistaken"]["as"] == "sink"


def test_a_class_of_another_name_counts_by_its_role(tmp_path, rooms):
    renamed = {{"wall": "Wall-Tile", "person": "pedestrian"}.get(name, name): rgb for name, rgb in USUAL.items()}
    judged = evaluate_model(model(tmp_path, renamed), read_training_sets([rooms]), "val")
    assert min(iou(judged, name) for name in ("wall", "person")) > 0.8


def test_what_a_model_does_not_know_is_nothing(tmp_path, rooms):
    known = {name: rgb for name, rgb in USUAL.items() if name != "door"}
    judged = evaluate_model(model(tmp_path, known), read_training_sets([rooms]), "val")
    assert judged.without == ("door",)
    assert iou(judged, "door") == 0
    # a door is of no colour that it knows
    assert judged.document["classes"]["door"]["mistaken"]["as"] == NOTHING
    np.testing.assert_array_equal(judged.matrix[-1], 0)


def test_yolo_models_are_judged_the_same_way(tmp_path, rooms):
    judged = evaluate_model(model(tmp_path, USUAL, "yolo-rows"), read_training_sets([rooms]), "val")
    assert iou(judged, "wall") > 0.6


def test_a_model_of_other_things_is_refused(tmp_path, rooms):
    with pytest.raises(ModelError, match=r"none of its classes \(tree"):
        evaluate_model(model(tmp_path, {"tree": (1, 2, 3), "river": (200, 2, 3)}), read_training_sets([rooms]), "val")


def test_demands_on_classes(tmp_path, rooms):
    judged = evaluate_model(model(tmp_path, USUAL), read_training_sets([rooms]), "val")
    assert judged.short_of({"wall": 0.5}) == {}
    assert judged.short_of({"wall": 1.0})["wall"][1] == 1.0
    with pytest.raises(ModelError, match="'wal' is no class") as caught:
        judged.short_of({"wal": 0.5})
    assert "wall" in caught.value.hint
    assert minimum_of("wall + partition=0.85") == ("wall + partition", 0.85)
    for text in ("wall", "wall=x", "=0.5", "wall=1.5"):
        with pytest.raises(ModelError, match="no demand"):
            minimum_of(text)


def test_the_command_prints_a_table_and_judges(tmp_path, rooms, capsys):
    from wallkit.cli.app import main

    path = model(tmp_path, USUAL)
    with pytest.raises(SystemExit) as done:
        main(["model", "evaluate", str(path), str(rooms), "--require", "wall=0.5", "-q"])
    out = capsys.readouterr().out
    assert done.value.code == 0
    assert "most taken for" in out
    with pytest.raises(SystemExit) as done:
        main(["model", "evaluate", str(path), str(rooms), "--require", "wall=1.0", "--json", "-q"])
    document = json.loads(capsys.readouterr().out)
    assert done.value.code == 1
    assert document["short"]["wall"][1] == 1.0
    assert document["classes"]["toilet"]["iou"] > 0.8


def test_a_sheet_that_cannot_be_written_is_said_before_the_run(tmp_path, rooms, monkeypatch, capsys):
    from wallkit.cli.app import main
    from wallkit.pipelines.model import evaluate

    path, mine = str(model(tmp_path, USUAL)), tmp_path / "mine.png"
    mine.write_bytes(b"mine")
    with monkeypatch.context() as patched:
        patched.setattr(evaluate, "evaluate_model", lambda *_, **__: pytest.fail("it ran"))
        for sheet, says in ((mine, "exists"), (tmp_path / "no" / "m.png", "its folder does not exist")):
            with pytest.raises(SystemExit) as done:
                main(["model", "evaluate", path, str(rooms), "--sheet", str(sheet), "-q"])
            assert done.value.code == 2
            assert says in capsys.readouterr().err
    assert mine.read_bytes() == b"mine"
    with pytest.raises(SystemExit) as done:
        main(["model", "evaluate", path, str(rooms), "--sheet", str(mine), "--overwrite", "-q"])
    assert done.value.code == 0
    assert mine.read_bytes().startswith(b"\x89PNG")
