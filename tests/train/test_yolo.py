"""The child that trains YOLO: how it is called, what is read back, and what is said when it fails."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
import yaml

from tests.train.flat import flat_set
from wallkit.errors import ModelError
from wallkit.pipelines.model.train_yolo import YoloRequest, check_yolo, train_yolo_model
from wallkit.segment.child import SETUP, VARIABLE
from wallkit.train.yolo import YoloLesson, command, epochs_of, train_yolo

RESULTS = """epoch,time,train/box_loss,train/seg_loss,metrics/mAP50(M),metrics/mAP50-95(M),val/box_loss,val/seg_loss,lr/pg0
1,2.5,1.5,2.5,0.2,0.1,1.25,2.25,0.001
2,5.0,1.0,2.0,0.4,0.25,1.0,2.0,0.0005
"""
# stands in the interpreter's place: understands the one JSON argument and leaves what Ultralytics leaves
STAND_IN = """#!{python}
import json, os, pathlib, sys
assert sys.argv[1] == "-c" and "ultralytics" in sys.argv[2]
asked = json.loads(sys.argv[3])
assert "train:" in pathlib.Path(asked["data"]).read_text()
{body}
folder = pathlib.Path(asked["folder"]) / "train" / "weights"
folder.mkdir(parents=True)
(folder / "best.pt").write_bytes(b"checkpoint")
(folder / "best.onnx").write_bytes(json.dumps([asked, dict(os.environ)]).encode())
(folder.parent / "results.csv").write_text('''{results}''')
print("epoch 1 of 2")
"""


def interpreter(folder: Path, body: str = "") -> Path:
    path = folder / "stand-in"
    path.write_text(STAND_IN.format(python=sys.executable, body=body, results=RESULTS))
    path.chmod(0o755)
    return path


def test_the_command_is_a_program_and_one_json_argument(tmp_path):
    words = command("py", tmp_path / "data.yaml", tmp_path / "out", YoloLesson(size=(320, 192), epochs=7))
    assert words[:2] == ["py", "-c"]
    compile(words[2], "child", "exec")
    asked = json.loads(words[3])
    assert asked["imgsz"] == 320
    assert asked["export_size"] == [192, 320]
    assert asked["epochs"] == 7


def test_a_training_leaves_a_model_a_checkpoint_and_curves(tmp_path):
    rooms = flat_set(tmp_path / "rooms", train=2, val=1)
    heard: list[str] = []
    request = YoloRequest((rooms,), interpreter(tmp_path), "yolov8n-seg.yaml", size=(320, 240), epochs=2)
    done = train_yolo_model(request, tmp_path / "out", told=heard.append)
    asked, environment = json.loads(done.model.read_bytes())
    assert (environment["YOLO_OFFLINE"], environment["YOLO_AUTOINSTALL"]) == ("1", "0")
    # sides that YOLO can take
    assert asked["export_size"] == [256, 320]
    assert done.model.with_suffix(".pt").read_bytes() == b"checkpoint"
    assert heard == ["epoch 1 of 2"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "curves.csv", "curves.png", "model.onnx", "model.pt", "run.json",
    ]  # fmt: skip
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["licence"] == "AGPL-3.0"


def test_several_sets_are_one_to_learn_from(tmp_path):
    """The child is told all of their pictures, train and val apart; the record names each."""
    sets = tuple(flat_set(tmp_path / name, train=2, val=1) for name in ("rooms", "more"))
    shown = tmp_path / "data.yaml"
    python = interpreter(tmp_path, f"import shutil; shutil.copy(asked['data'], {str(shown)!r})")
    train_yolo_model(YoloRequest(sets, python, "yolov8n-seg.yaml", epochs=2), tmp_path / "out")
    told = yaml.safe_load(shown.read_text())
    assert told["train"] == [str(one / "images/train") for one in sets]
    assert told["val"] == [str(one / "images/val") for one in sets]
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert [one["folder"] for one in record["datasets"]] == ["rooms", "more"]


def test_epochs_add_up_the_losses():
    first, second = epochs_of(RESULTS)
    assert (first.train_loss, first.val_loss) == (4.0, 3.5)
    assert second.ious == {"mask mAP50": 0.4}
    assert second.mean_iou == 0.25
    with pytest.raises(ModelError, match=r"no results\.csv"):
        epochs_of("a,b\n1,2\n")


@pytest.mark.parametrize(
    ("body", "says", "hint"),
    [
        ("sys.exit(\"ModuleNotFoundError: No module named 'ultralytics'\")", "has no Ultralytics", "--print-setup"),
        ("print('out of memory'); sys.exit(3)", "(?s)ended with 3.*out of memory", "child's own"),
        ("sys.exit('_pickle.UnpicklingError: Weights only load failed')", "ended with 1", "pass --trust"),
        ("sys.exit(0)", "left no best.pt", ""),
    ],
)
def test_what_went_wrong_is_said(tmp_path, body, says, hint):
    data = tmp_path / "data.yaml"
    data.write_text("train: []\n")
    with pytest.raises(ModelError, match=says) as caught:
        train_yolo(str(interpreter(tmp_path, body)), data, tmp_path / "out", YoloLesson())
    assert hint in caught.value.hint


@pytest.mark.parametrize(("is_trusting", "safe"), [(False, "1"), (True, "0")])
def test_only_weights_are_loaded_from_a_checkpoint_unless_it_is_trusted(tmp_path, monkeypatch, is_trusting, safe):
    monkeypatch.setenv("ULTRALYTICS_SAFE_LOAD", "0")
    rooms = flat_set(tmp_path / "rooms", train=2, val=1)
    request = YoloRequest((rooms,), interpreter(tmp_path), "best.pt", epochs=2, is_trusting=is_trusting)
    done = train_yolo_model(request, tmp_path / "out")
    asked, environment = json.loads(done.model.read_bytes())
    assert environment["ULTRALYTICS_SAFE_LOAD"] == safe
    assert "is_trusting" not in asked


def test_the_interpreter_may_be_named_by_the_variable(tmp_path, monkeypatch):
    rooms = flat_set(tmp_path / "rooms", train=2, val=1)
    named = interpreter(tmp_path)
    monkeypatch.setenv(VARIABLE, str(named))
    found, _ = check_yolo(YoloRequest((rooms,), None, "yolov8n-seg.yaml"), tmp_path / "out", overwrite=False)
    assert found.python == named


def test_a_missing_interpreter_is_said_with_how_to_make_one(tmp_path, monkeypatch):
    rooms = flat_set(tmp_path / "rooms", train=2, val=1)
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    for python, hint in ((None, "model export --print-setup"), (tmp_path / "nowhere", "bin/python")):
        with pytest.raises(ModelError) as caught:
            check_yolo(YoloRequest((rooms,), python, "yolov8n-seg.yaml"), tmp_path / "out", overwrite=False)
        assert hint in caught.value.hint
    with pytest.raises(ModelError, match="cannot be started"):
        train_yolo(str(tmp_path / "nowhere"), tmp_path, tmp_path, YoloLesson())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--yolo", "yolov8n-seg.yaml", "--rate", "0.001"], "--rate is of wallkit's own network"),
        (["--trust"], "--trust is for --yolo"),
        (["--python", "py"], "--python is for --yolo"),
    ],
)
def test_a_flag_that_would_not_be_heeded_is_refused(tmp_path, capsys, words, says):
    from wallkit.cli.app import main

    with pytest.raises(SystemExit) as done:
        main(["model", "train", str(tmp_path), *words, "-o", str(tmp_path / "out")])
    assert done.value.code == 2
    assert says in capsys.readouterr().err


def test_the_commands_that_make_an_interpreter_are_from_one_index():
    """A local version such as 2.13.0+cpu is on no index that pip asks by itself."""
    assert "+cpu" not in SETUP
    # what training imports beyond what exporting does
    assert all(f"{name}==" in SETUP for name in ("matplotlib", "polars", "psutil"))
