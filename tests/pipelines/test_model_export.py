"""Exports through a stand-in for the interpreter with Ultralytics: what is asked, checked and recorded."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from pathlib import Path

import pytest

import wallkit as package
from wallkit.calib.files.store import toml_from_calibration
from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera
from wallkit.errors import ModelError
from wallkit.pipelines.model.export import ExportRequest, export_model, size_for_camera
from wallkit.segment.child import find_interpreter
from wallkit.segment.settings import SegmentSettings

# exports an oracle of the size and layout asked for, with one known fault; notes what it was given
STAND_IN = """#!{python}
import json, os, sys
from pathlib import Path
sys.path.insert(0, {root!r})
from wallkit.segment.fixture import USUAL, oracle
request = json.load(open(sys.argv[2]))
fault = {fault!r}
noted = {{k: v for k, v in os.environ.items() if k.startswith(("YOLO_", "ULTRALYTICS_", "PYTHON"))}}
json.dump({{"request": request, "environment": noted}}, open({noted!r}, "w"))
if fault == "fails":
    print("torch.UnpicklingError: weights_only load failed"); sys.exit(1)
out = Path(request["model"]).with_suffix(".onnx")
size = [side + 32 for side in request["imgsz"]] if fault == "rounds" else request["imgsz"]
layout = "yolo-rows" if fault == "flips" or request["arguments"].get("nms") is not None else "yolo-anchors"
out.write_bytes(oracle(USUAL, tuple(size), layout))
answer = {{"file": str(out), "task": "segment", "versions": {{"ultralytics": "8.4.190"}}}}
json.dump(answer, open(request["answer"], "w"))
"""


@pytest.fixture
def asked(tmp_path):
    """A function that makes a request to a stand-in with a fault."""
    (tmp_path / "best.pt").write_bytes(b"weights")

    def make(fault: str = "", **words: object) -> ExportRequest:
        python = tmp_path / "python"
        root, noted = str(Path(package.__file__).parents[1]), str(tmp_path / "noted.json")
        python.write_text(STAND_IN.format(python=sys.executable, root=root, noted=noted, fault=fault))
        python.chmod(0o755)
        usual = {"out": tmp_path / "out.onnx", "size": (192, 320), "python": python}
        return ExportRequest(tmp_path / "best.pt", **{**usual, **words})

    return make


def test_the_file_its_record_and_nothing_else(tmp_path, asked):
    done = export_model(asked(), SegmentSettings())
    assert (done.inspection.segmenter.layout, done.inspection.segmenter.size) == ("yolo-anchors", (192, 320))
    record = json.loads((tmp_path / "out.json").read_text())
    for key, file in (("checkpoint_sha256", "best.pt"), ("model_sha256", "out.onnx")):
        assert record[key] == hashlib.sha256((tmp_path / file).read_bytes()).hexdigest()
    assert record["versions"] == {"ultralytics": "8.4.190"}
    assert record["licence"] == "Apache-2.0"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["best.pt", "noted.json", "out.json", "out.onnx", "python"]


def test_the_other_interpreter_is_offline_installs_nothing_and_loads_weights_only(tmp_path, asked, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.getcwd())
    export_model(asked(), SegmentSettings())
    noted = json.loads((tmp_path / "noted.json").read_text())
    environment = noted["environment"]
    assert (environment["YOLO_OFFLINE"], environment["YOLO_AUTOINSTALL"]) == ("1", "0")
    assert environment["ULTRALYTICS_SAFE_LOAD"] == "1"
    assert "PYTHONPATH" not in environment
    # it works on a copy, so that nothing is written beside the user's file
    assert noted["request"]["model"] != str(tmp_path / "best.pt")
    export_model(asked(is_trusting=True), SegmentSettings())
    assert json.loads((tmp_path / "noted.json").read_text())["environment"]["ULTRALYTICS_SAFE_LOAD"] == "0"


@pytest.mark.parametrize(
    ("thinning", "layout"), [("raw", "yolo-anchors"), ("in-graph", "yolo-rows"), ("none", "yolo-rows")]
)
def test_the_head_that_is_asked_for_comes_out(asked, thinning, layout):
    assert export_model(asked(thinning=thinning), SegmentSettings()).inspection.segmenter.layout == layout


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("rounds", "asked for 192x320, the exporter wrote 224x352"),
        ("flips", r"asked for yolo-anchors \(--nms raw\), the exporter wrote yolo-rows"),
        ("fails", "export by Ultralytics failed: torch.UnpicklingError"),
    ],
)
def test_what_was_not_asked_for_is_refused_and_not_written(tmp_path, asked, fault, words):
    with pytest.raises(ModelError, match=words) as caught:
        export_model(asked(fault), SegmentSettings())
    assert not list(tmp_path.glob("out.*"))
    if fault == "fails":
        assert "--trust" in caught.value.hint


def test_a_size_that_would_be_rounded_is_refused_before(asked):
    with pytest.raises(ModelError, match="300x320 is not in steps of 32") as caught:
        export_model(asked(size=(300, 320)), SegmentSettings())
    assert caught.value.hint == "--imgsz 288x320"


@pytest.mark.parametrize("name", ["best.json", "best", "best.pt"])
def test_an_output_that_its_record_or_a_reader_would_take_for_another_file_is_refused(tmp_path, asked, name):
    with pytest.raises(ModelError, match=f"'{name}' is no name of an ONNX file") as caught:
        export_model(asked(out=tmp_path / name), SegmentSettings())
    assert caught.value.hint.startswith(f"--out {tmp_path / 'best.onnx'}")
    assert (tmp_path / "best.pt").read_bytes() == b"weights"


def test_a_missing_checkpoint_and_one_that_is_none(tmp_path, asked):
    request = asked()
    (tmp_path / "best.pt").unlink()
    with pytest.raises(ModelError, match="no such file"):
        export_model(request, SegmentSettings())
    (tmp_path / "m.onnx").write_bytes(b"")
    with pytest.raises(ModelError, match="is no checkpoint"):
        export_model(ExportRequest(tmp_path / "m.onnx", tmp_path / "out.onnx", (320, 320)), SegmentSettings())


@pytest.mark.parametrize(
    ("camera", "size"), [((1280, 720), (192, 320)), ((640, 480), (256, 320)), ((720, 1280), (320, 192))]
)
def test_the_input_fits_the_camera(tmp_path, camera, size):
    width, height = camera
    path = tmp_path / "cam.toml"
    K = [[600, 0, width / 2], [0, 600, height / 2], [0, 0, 1]]
    path.write_text(toml_from_calibration(Calibration(Camera("plumb_bob", width, height, K, [0, 0, 0, 0, 0]))))
    assert size_for_camera(path) == size


@pytest.mark.parametrize("by", ["--python", "WALLKIT_YOLO_PYTHON"])
def test_an_interpreter_named_from_here_runs_in_another_folder_by_its_own_name(tmp_path, asked, monkeypatch, by):
    """A virtual environment is known by the link that its interpreter is started by."""
    stand_in = asked().python
    link = tmp_path / "yv/bin/python"
    link.parent.mkdir(parents=True)
    link.symlink_to(stand_in)
    monkeypatch.chdir(tmp_path)
    relative = Path("yv/bin/python")
    if by == "WALLKIT_YOLO_PYTHON":
        monkeypatch.setenv(by, str(relative))
    named = relative if by == "--python" else None
    assert find_interpreter(named).python == link
    export_model(asked(python=named), SegmentSettings())
    assert (tmp_path / "out.onnx").is_file()


def test_the_interpreter_is_found_by_variable_or_by_yolos_first_line(tmp_path, monkeypatch):
    monkeypatch.setenv("WALLKIT_YOLO_PYTHON", "/bin/sh")
    assert find_interpreter(None).python == Path("/bin/sh")
    monkeypatch.delenv("WALLKIT_YOLO_PYTHON")
    yolo = tmp_path / "yolo"
    yolo.write_text("#!/opt/yv/bin/python3\nimport sys\n")
    yolo.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_interpreter(None).python == Path("/opt/yv/bin/python3")
