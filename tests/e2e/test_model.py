"""`wallkit model` as a user runs it."""

from __future__ import annotations

import pytest


@pytest.fixture
def oracle(wallkit, tmp_path):
    assert wallkit("model", "fixture", "oracle.onnx", "--imgsz", "192x320").code == 0
    return tmp_path / "oracle.onnx"


def test_inspect_names_layout_and_roles_and_judges_them(wallkit, oracle):
    done = wallkit("model", "inspect", oracle, "--require", "wall,door", "--json")
    assert done.code == 0
    assert done.json["layout"] == "yolo-anchors"
    assert done.json["input_size_px"] == [192, 320]
    assert done.json["classes"][1] == {"id": 1, "name": "door", "role": "door"}
    done = wallkit("model", "inspect", oracle, "--require", "wall,floor")
    assert (done.code, "no class counts as floor" in done.out) == (1, True)
    done = wallkit("model", "inspect", oracle, "--require", "wal")
    assert (done.code, "did you mean 'wall'" in done.err) == (2, True)


def test_inspect_refuses_what_is_no_model(wallkit, tmp_path):
    (tmp_path / "page.onnx").write_text("<html>")
    done = wallkit("model", "inspect", "page.onnx")
    assert done.code == 2
    assert "page.onnx: onnxruntime cannot load it" in done.err
    assert "Traceback" not in done.err


def test_fixture_takes_colours_and_keeps_what_is_there(wallkit, tmp_path, oracle):
    (tmp_path / "colours.toml").write_text("wall = [200, 180, 160]\nrobot = [10, 20, 200]\n")
    assert wallkit("model", "fixture", oracle).code == 2
    assert (
        wallkit("model", "fixture", oracle, "--overwrite", "--classes", "colours.toml", "--layout", "class-ids").code
        == 0
    )
    found = wallkit("model", "inspect", oracle, "--json").json
    assert [one["name"] for one in found["classes"]] == ["wall", "robot"]
    assert found["layout"] == "class-ids"
    (tmp_path / "colours.toml").write_text("wall = [200, 180, 160]\ndoor = [199, 180, 160]\n")
    done = wallkit("model", "fixture", "b.onnx", "--classes", "colours.toml")
    assert (done.code, "too near each other" in done.err) == (2, True)
    (tmp_path / "colours.toml").write_text("wall = 'grey'\n")
    done = wallkit("model", "fixture", "b.onnx", "--classes", "colours.toml")
    assert (done.code, "colours.toml:1: 'wall' is 'grey', no colour" in done.err) == (2, True)
    assert not (tmp_path / "b.onnx").exists()
