"""The network, where PyTorch is installed: it learns flat colours, goes on where it stopped, and is the same as ONNX."""

from __future__ import annotations

import ast
import json
from dataclasses import replace

import numpy as np
import pytest

from tests.train.flat import NAMES, flat, flat_set
from wallkit.errors import DatasetError, ModelError, OutputError
from wallkit.pipelines.model import train as model_train
from wallkit.pipelines.model.train import TrainRequest, check_request, train_model

SIZE = (64, 48)


def torch_or_skip():
    return pytest.importorskip("torch", reason="PyTorch is not installed: pip install 'wallkit[train]'")


def pictures(count: int, seed: int):
    from wallkit.train.pictures import stacked

    rng = np.random.default_rng(seed)
    return stacked([flat(rng, (128, 96)) for _ in range(count)], SIZE)


def lesson(**given):
    from wallkit.train.augment import Changes
    from wallkit.train.learn import Lesson

    plain = Changes(repainted=0, shaded=0, blurred=0, noisy=0, squeezed=0, cluttered=0)
    return replace(Lesson(), size=SIZE, averaged=0.8, changes=plain, growth=((1.0, 1.0),), **given)


@pytest.mark.slow
def test_it_learns_flat_colours(tmp_path):
    torch_or_skip()
    from wallkit.train.learn import learn

    done = learn(pictures(64, 1), pictures(8, 2), NAMES, lesson(epochs=12), tmp_path / "checkpoint.pt")
    assert done.epochs[-1].mean_iou > 0.6 > done.epochs[0].mean_iou
    assert done.epochs[-1].train_loss < 0.5 * done.epochs[0].train_loss


def test_a_run_that_was_stopped_goes_on_as_if_it_had_not_been(tmp_path):
    torch = torch_or_skip()
    from wallkit.train.learn import learn

    train, val = pictures(16, 1), pictures(4, 2)
    whole = learn(train, val, NAMES, lesson(epochs=3), tmp_path / "whole.pt")

    def stop(epoch):
        if epoch.number == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn(train, val, NAMES, lesson(epochs=3), tmp_path / "stopped.pt", told=stop)
    heard: list[int] = []
    resumed = learn(train, val, NAMES, lesson(epochs=3), tmp_path / "stopped.pt", told=lambda e: heard.append(e.number))
    assert heard == [3]
    assert [epoch.number for epoch in resumed.epochs] == [1, 2, 3]
    for a, b in zip(whole.net.state_dict().values(), resumed.net.state_dict().values(), strict=True):
        torch.testing.assert_close(a, b)


def test_an_interrupted_training_is_lost_only_when_asked(tmp_path):
    torch_or_skip()
    rooms = flat_set(tmp_path / "rooms", train=4, val=2)
    request = TrainRequest((rooms,), (64, 64), epochs=2, batch=4)

    def stop(epoch, of):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_model(request, tmp_path / "net", told=stop)
    kept = (tmp_path / ".net.unfinished" / "checkpoint.pt").read_bytes()
    other = replace(request, epochs=3, seed=7)
    for act in (check_request, train_model):
        with pytest.raises(OutputError, match="other settings: epochs 2, now 3; seed 0, now 7") as caught:
            act(other, tmp_path / "net", overwrite=False)
        assert "--overwrite" in caught.value.hint
    assert (tmp_path / ".net.unfinished" / "checkpoint.pt").read_bytes() == kept
    check_request(other, tmp_path / "net", overwrite=True)
    # the machine is no part of what is learnt
    done = train_model(replace(request, threads=2), tmp_path / "net")
    assert done.resumed == 1
    assert json.loads((tmp_path / "net" / "run.json").read_text())["threads"] == 2
    assert not (tmp_path / ".net.unfinished").exists()


def test_a_training_that_fails_before_an_epoch_leaves_nothing(tmp_path, monkeypatch):
    torch_or_skip()
    from wallkit.train import learn

    rooms = flat_set(tmp_path / "rooms", train=4, val=2)
    request = TrainRequest((rooms,), (64, 64), epochs=1)

    def fails(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(learn, "_step", fails)
    with pytest.raises(KeyboardInterrupt):
        train_model(request, tmp_path / "net")
    next((rooms / "images" / "train").iterdir()).write_bytes(b"")
    with pytest.raises(DatasetError, match="no picture"):
        train_model(request, tmp_path / "net")
    assert [path.name for path in tmp_path.iterdir()] == ["rooms"]


def test_scores_are_of_all_sets(tmp_path):
    torch_or_skip()
    sets = tuple(flat_set(tmp_path / name, train=2, val=val, seed=val) for name, val in (("rooms", 1), ("more", 3)))
    done = train_model(TrainRequest(sets, (64, 64), epochs=1, batch=4), tmp_path / "net")
    assert done.judged.pictures == 4
    assert json.loads((tmp_path / "net" / "scores.json").read_text())["pictures"] == 4


def test_training_writes_a_model_that_is_used_like_any_other(tmp_path):
    torch_or_skip()
    from wallkit.segment.onnx_segmenter import load_segmenter

    rooms = flat_set(tmp_path / "rooms", train=16, val=4)
    request = TrainRequest((rooms,), (128, 96), epochs=1, batch=4, seed=3)
    heard: list[tuple[int, int]] = []
    done = train_model(request, tmp_path / "net", told=lambda epoch, of: heard.append((epoch.number, of)))
    assert heard == [(1, 1)]
    assert sorted(path.name for path in (tmp_path / "net").iterdir()) == [
        "curves.csv", "curves.png", "masks.png", "model.onnx", "run.json", "scores.json",
    ]  # fmt: skip
    segmenter = load_segmenter(done.model)
    assert segmenter.names == NAMES
    assert segmenter.size == (96, 128)
    metadata = segmenter.model.metadata
    assert metadata["license"] == "Apache-2.0"
    record = json.loads((tmp_path / "net" / "run.json").read_text())
    assert ast.literal_eval(metadata["datasets"]) == [record["datasets"][0]["manifest_sha256"]]
    # half-precision weights, the same answers
    assert record["export"]["agreeing"] > 0.995
    assert done.size_bytes < 2.2 * done.parameters
    labels = segmenter.segment(flat(np.random.default_rng(0), (128, 96))[0]).labels()
    assert labels.shape == (96, 128)


def test_what_cannot_be_trained_on_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(model_train, "check_libraries", lambda: None)
    rooms = flat_set(tmp_path / "rooms", train=2, val=1)
    with pytest.raises(ModelError, match="320 x 200"):
        check_request(TrainRequest((rooms,), (320, 200)), tmp_path / "net", overwrite=False)
    for rate in (0, -1, float("nan"), 2):
        with pytest.raises(ModelError, match="a learning rate of"):
            check_request(TrainRequest((rooms,), rate=rate), tmp_path / "net", overwrite=False)
    other = flat_set(tmp_path / "other", train=2, val=1)
    text = (other / "data.yaml").read_text()
    (other / "data.yaml").write_text(text.replace("door", "gate"))
    with pytest.raises(DatasetError, match="gate"):
        check_request(TrainRequest((rooms, other)), tmp_path / "net", overwrite=False)
    without = flat_set(tmp_path / "without", train=2, val=0)
    with pytest.raises(DatasetError, match="'val' part"):
        check_request(TrainRequest((without,)), tmp_path / "net", overwrite=False)
    assert len(check_request(TrainRequest((rooms,)), tmp_path / "net", overwrite=False)) == 1


def test_missing_libraries_are_named(monkeypatch):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ModelError, match="torch and onnx") as caught:
        model_train.check_libraries()
    assert "wallkit[train]" in caught.value.hint
    assert "+cpu" not in caught.value.hint


def test_the_command_says_what_it_would_do_and_what_is_missing(tmp_path, monkeypatch, capsys):
    from wallkit.cli.app import main

    rooms = flat_set(tmp_path / "rooms", train=3, val=2)
    words = ["model", "train", str(rooms), "-o", str(tmp_path / "net")]
    monkeypatch.setattr(model_train, "check_libraries", lambda: None)
    with pytest.raises(SystemExit) as done:
        main([*words, "--dry-run"])
    assert done.value.code == 0
    assert "trained on 3 pictures, judged on 2 others" in capsys.readouterr().out
    assert not (tmp_path / "net").exists()
    with pytest.raises(SystemExit) as done:
        main([*words, "--yolo", "yolov8n-seg.yaml", "--python", str(tmp_path / "nowhere")])
    assert done.value.code == 2
    assert "is no program that can be run" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rate", "said"), [("nan", "nan is no finite number"), *((rate, "0<x<=1") for rate in ("-1", "0", "2", "inf"))]
)
def test_a_rate_that_is_none_is_a_usage_error(tmp_path, capsys, rate, said):
    from wallkit.cli.app import main

    with pytest.raises(SystemExit) as done:
        main(["model", "train", str(tmp_path), "--rate", rate, "-o", str(tmp_path / "net")])
    assert done.value.code == 2
    assert said in capsys.readouterr().err
