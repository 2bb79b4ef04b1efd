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
(folder / "best.onnx").write_bytes(json.dumps([asked, os.environ["YOLO_OFFLINE"], os.environ["YOLO_AUTOINSTALL"]]).encode())
(folder.parent / "results.csv").write_text('''{results}''')
print("epoch 1 of 2")
"""


def interpreter(folder: Path, body: str = "") -> str:
    path = folder / "stand-in"
    path.write_text(STAND_IN.format(python=sys.executable, body=body, results=RESULTS))
    path.chmod(0o755)
    return str(path)


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
    asked, offline, install = json.loads(done.model.read_bytes())
    assert (offline, install) == ("1", "0")
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
        ("sys.exit(\"ModuleNotFoundError: No module named 'ultralytics'\")", "has no Ultralytics", "pip install"),
        ("print('out of memory'); sys.exit(3)", "(?s)ended with 3.*out of memory", "child's own"),
        ("sys.exit(0)", "left no best.pt", ""),
    ],
)
def test_what_went_wrong_is_said(tmp_path, body, says, hint):
    data = tmp_path / "data.yaml"
    data.write_text("train: []\n")
    with pytest.raises(ModelError, match=says) as caught:
        train_yolo(interpreter(tmp_path, body), data, tmp_path / "out", YoloLesson())
    assert hint in caught.value.hint


def test_a_missing_interpreter_is_said_with_the_commands_that_make_one(tmp_path):
    rooms = flat_set(tmp_path / "rooms", train=2, val=1)
    for python in ("", str(tmp_path / "nowhere")):
        with pytest.raises(ModelError) as caught:
            check_yolo(YoloRequest((rooms,), python, "yolov8n-seg.yaml"), tmp_path / "out", overwrite=False)
        assert "pip install --no-deps ultralytics" in caught.value.hint
    with pytest.raises(ModelError, match="cannot be started"):
        train_yolo(str(tmp_path / "nowhere"), tmp_path, tmp_path, YoloLesson())
